"""Which frame, which tool: how what the robot holds stands to what stands still, on the robot as calibrated.

A path is accurate relative to something. What stands still is known in the calibrated base as the controller has it, or was
measured by the tracker, or was touched by the robot itself, whose errors there then cancel in part. What the robot holds is
known where the controller has it in the flange, or by the reflectors that were measured on it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.correction.cell import Cell, Measured
from taskcal.correction.placement import Placement
from taskcal.errors import TaskcalError
from taskcal.geometry import se3, walk
from taskcal.identification.calibration import Calibration
from taskcal.programs.program import Move
from taskcal.robot.error_frames import COMPONENTS
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot

SAME = 1e-6
"""A program's tool is the robot's own if it differs by less, metres and radians."""

MISFIT = 5e-4
"""Reflectors that fit worse than this, metres, are not where they are said to be."""

CHUNK = 4096
"""Poses whose derivatives are held at once; those of 10⁵ would take 300 MB."""

Twists = Callable[[np.ndarray], np.ndarray]
"""From joint positions (n, joints) to derivatives (n, 6, z) of a frame's pose by the estimate, at its origin in tracker axes."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Held:
    """What the robot holds."""

    T_tool_held: Float[np.ndarray, "4 4"]
    """In the calibrated robot's own tool."""
    statement: str
    twists: Twists
    covariance: Float[np.ndarray, "3 3"]
    """Of its origin, by how it was measured against reflectors or flange, in its own axes, metres²."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Standing:
    """What stands still."""

    T_base_standing: Float[np.ndarray, "4 4"]
    """In the calibrated base."""
    statement: str
    follows_base: bool
    """Whether it is only known where the controller's base is."""
    twist: Float[np.ndarray, "6 z"] | None
    """Derivative of its pose by the estimate, for a point at the tracker's origin; None where it does not depend on it."""
    uncertainty: float
    """Of its measured position, per axis, metres."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Relation:
    """A tool and a part, on the robot as calibrated."""

    calibration: Calibration
    held: Held
    standing: Standing
    part_in_hand: bool

    @property
    def statement(self) -> str:
        """What the accuracy is relative to, in words."""
        return f"{self.held.statement}; {self.standing.statement}"

    @property
    def placement(self) -> Placement:
        """Where both are."""
        return Placement(
            T_tool_held=self.held.T_tool_held,
            T_base_standing=self.standing.T_base_standing,
            part_in_hand=self.part_in_hand,
        )

    def covariance(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 3 3"]:
        """Covariance of where the held origin is against what stands still, in the standing frame's axes, metres².

        The model error of a single new pose is not in it.
        """
        calibration = self.calibration
        J = self.held.twists(q)[:, :3]
        if self.standing.follows_base:
            J = J.copy()
            J[:, :, _columns(calibration, "base.")] = 0.0
        elif self.standing.twist is not None:
            T = calibration.predict_tool(q) @ self.held.T_tool_held
            twist = np.broadcast_to(self.standing.twist, (len(q), *self.standing.twist.shape))
            J = J - se3.carry(twist, T[:, :3, 3])[:, :3]
        R = (calibration.T_tracker_base @ self.standing.T_base_standing)[:3, :3]
        J = R.T @ J
        known = J @ calibration.z_covariance @ np.swapaxes(J, 1, 2)
        R_standing_held = R.T @ (calibration.predict_tool(q) @ self.held.T_tool_held)[:, :3, :3]
        held = R_standing_held @ self.held.covariance @ np.swapaxes(R_standing_held, 1, 2)
        return known + held + self.standing.uncertainty**2 * np.eye(3)

    def uncertainty(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, " n"]:
        """Root mean square of the error in space that the calibration must expect at joint positions, metres.

        What the parameters do not tell, and what the model cannot explain at a new pose.
        """
        variance = np.zeros(len(q))
        for first in range(0, len(q), CHUNK):
            part = slice(first, first + CHUNK)
            variance[part] = np.trace(self.covariance(q[part]), axis1=1, axis2=2)
        if self.calibration.field is None:
            variance += 3.0 * self.calibration.model_error[0] ** 2
        else:
            variance += self.calibration.field.variance(q)[:, :3].sum(axis=1)
        return np.sqrt(variance)


def relate(calibration: Calibration, move: Move, cell: Cell) -> Relation:
    """The relation of a motion's tool and part.

    Raises:
        TaskcalError: what was measured of them does not fit to what they are used for, or to the calibration.
    """
    tool, part = cell.tool(move.tool.name), cell.part(move.part.name)
    held, standing = (part, tool) if move.part_in_hand else (tool, part)
    held_frame, standing_frame = (move.part, move.tool) if move.part_in_hand else (move.tool, move.part)
    return Relation(
        calibration=calibration,
        held=_held(calibration, held, held_frame.T),
        standing=_standing(calibration, standing, standing_frame.T, cell),
        part_in_hand=move.part_in_hand,
    )


def _held(calibration: Calibration, known: Measured, controller: Float[np.ndarray, "4 4"]) -> Held:
    if known.in_tracker is not None or known.touched is not None:
        raise TaskcalError(
            f"'{known.name}' is held by the robot; it cannot be measured where it stands: give flange, target or reflectors_mm "
            "in the cell file"
        )
    robot, name = calibration.model.robot, known.name
    if known.reflectors:
        return _by_reflectors(calibration, known)
    if known.in_target is not None:
        if not calibration.layout.pose:
            raise TaskcalError(
                f"'{name}' is given in the measured target's frame, but the calibration is from points, which have none; give "
                "reflectors_mm or flange"
            )
        return Held(
            T_tool_held=calibration.T_tool_target[0] @ known.in_target,
            statement=f"tool '{name}' by the measured poses of '{calibration.targets[0]}'",
            twists=lambda q: _target_twists(calibration, known, q),
            covariance=known.uncertainty**2 * np.eye(3),
        )
    if known.in_flange is None and np.abs(controller - robot.T_flange_tool).max() < SAME:
        return Held(
            T_tool_held=np.eye(4),
            statement=f"tool '{name}' is the robot file's, its errors as calibrated",
            twists=calibration.tool_jacobian,
            covariance=np.zeros((3, 3)),
        )
    in_flange = controller if known.in_flange is None else known.in_flange
    stated = "as the controller has it" if known.in_flange is None else "as measured in the flange"
    T_tool_held = _flange_in_tool(calibration) @ in_flange
    return Held(
        T_tool_held=T_tool_held,
        statement=f"tool '{name}' {stated}",
        twists=lambda q: _flange_twists(calibration, T_tool_held, q),
        covariance=known.uncertainty**2 * np.eye(3),
    )


def _flange_in_tool(calibration: Calibration) -> Float[np.ndarray, "4 4"]:
    """The flange in the robot's own tool, which the calibration has moved against it by the tool's errors."""
    model = calibration.model
    errors = np.zeros(6)
    for i, name in enumerate(model.names):
        if name.startswith("tool."):
            errors[COMPONENTS.index(name.removeprefix("tool."))] = calibration.estimate[i]
    return se3.inverse(model.robot.T_flange_tool @ se3.error_transform(errors))


def _by_reflectors(calibration: Calibration, known: Measured) -> Held:
    seen = [name for name in known.reflectors if name in calibration.targets]
    if len(seen) < 3:
        raise TaskcalError(
            f"'{known.name}' has {len(seen)} reflectors that the calibration measured ({', '.join(calibration.targets)}); "
            "it takes 3"
        )
    own = np.array([known.reflectors[name] for name in seen])
    rows = [calibration.targets.index(name) for name in seen]
    there = calibration.T_tool_target[rows, :3, 3]
    T, misfit = fit_points(own, there)
    if misfit > MISFIT:
        raise TaskcalError(
            f"the reflectors of '{known.name}' do not fit: as calibrated they lie up to {misfit * 1e3:.2f} mm from where "
            "reflectors_mm puts them; check their names and units"
        )
    return Held(
        T_tool_held=T,
        statement=f"tool '{known.name}' by its reflectors {', '.join(seen)}",
        twists=lambda q: _reflector_twists(calibration, rows, T, q),
        covariance=_fitted_covariance(own, known.uncertainty),
    )


def _fitted_covariance(own: Float[np.ndarray, "k 3"], uncertainty: float) -> Float[np.ndarray, "3 3"]:
    """Covariance of the origin of a frame that is fitted to points known to an uncertainty per axis, metres²."""
    every = np.eye(own.size).reshape(1, len(own), 3, own.size)
    by_point = _rigid_fit(own[None], every, np.zeros((1, 3)))[0, :3]
    return uncertainty**2 * by_point @ by_point.T


def _standing(calibration: Calibration, known: Measured, controller: Float[np.ndarray, "4 4"], cell: Cell) -> Standing:
    if known.in_flange is not None or known.in_target is not None or known.reflectors:
        raise TaskcalError(
            f"'{known.name}' stands still; it cannot be measured in the robot's hand: give tracker or touched_deg in the cell file"
        )
    if known.in_tracker is not None:
        return Standing(
            T_base_standing=se3.inverse(calibration.T_tracker_base) @ known.in_tracker,
            statement=f"part '{known.name}' as the tracker measured it",
            follows_base=False,
            twist=None,
            uncertainty=known.uncertainty,
        )
    if known.touched is not None:
        return _touched(calibration, known, known.touched, controller, cell)
    return Standing(
        T_base_standing=controller,
        statement=f"part '{known.name}' where the controller has it in the robot's base, as calibrated",
        follows_base=True,
        twist=None,
        uncertainty=0.0,
    )


def _touched(
    calibration: Calibration,
    known: Measured,
    q: Float[np.ndarray, "k joints"],
    controller: Float[np.ndarray, "4 4"],
    cell: Cell,
) -> Standing:
    robot = calibration.model.robot
    if q.shape[1] != len(robot.joints):
        raise TaskcalError(
            f"touched_deg of '{known.name}' has {q.shape[1]} angles a row; {robot.name} has {len(robot.joints)} joints"
        )
    toucher = cell.tool(known.touched_with)
    believed = toucher.controller if toucher.controller is not None else toucher.in_flange
    if believed is None:
        raise TaskcalError(f"the cell does not say where the controller has '{known.touched_with}', which touched")
    held = _held(calibration, toucher, believed)
    true = calibration.tool_in_base(q) @ held.T_tool_held
    nominal = nominal_flange(robot, q) @ believed
    M, _ = fit_points(nominal[:, :3, 3], true[:, :3, 3])
    in_tracker = calibration.T_tracker_base @ true
    points = in_tracker[:, :3, 3]
    twist = _rigid_fit(points[None], held.twists(q)[None, :, :3], np.zeros((1, 3)))[0]
    return Standing(
        T_base_standing=M @ controller,
        statement=f"part '{known.name}' where the robot touched it with '{known.touched_with}'",
        follows_base=False,
        twist=twist,
        uncertainty=0.0,
    )


def nominal_flange(robot: Robot, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 4 4"]:
    """Where a controller has its flange at joint positions q."""
    return ErrorModel(robot).poses(q) @ se3.inverse(robot.T_flange_tool)


def fit_points(
    own: Float[np.ndarray, "k 3"], there: Float[np.ndarray, "k 3"]
) -> tuple[Float[np.ndarray, "4 4"], float]:
    """The motion that brings points nearest to others (Kabsch 1976), and the farthest that one is left, metres.

    Raises:
        TaskcalError: the points lie in a line and do not locate a frame.
    """
    extent = np.linalg.svd(own - own.mean(axis=0), compute_uv=False)
    if extent[1] < 1e-3 * extent[0] or extent[0] < 1e-3:
        raise TaskcalError("the points lie in a line or at one place; three that span a triangle locate a frame")
    T = se3.fit_points(own, there)
    return T, float(np.linalg.norm(se3.apply(T, own) - there, axis=1).max())


def _columns(calibration: Calibration, prefix: str) -> list[int]:
    return [i for i, name in enumerate(calibration.all_names) if name.startswith(prefix)]


def _rigid_fit(
    points: Float[np.ndarray, "n k 3"], J: Float[np.ndarray, "n k 3 z"], at: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n 6 z"]:
    """The twists at given points of the rigid motions that come nearest to how some points move."""
    n, k = points.shape[:2]
    return np.linalg.pinv(se3.by_twist(points - at[:, None]).reshape(n, 3 * k, 6)) @ J.reshape(n, 3 * k, -1)


def _flange_twists(
    calibration: Calibration, T_tool_held: Float[np.ndarray, "4 4"], q: Float[np.ndarray, "n joints"]
) -> Float[np.ndarray, "n 6 z"]:
    """Of a frame fixed to the flange, which the errors of the robot's own tool do not move."""
    J = calibration.tool_jacobian(q)
    J[:, :, _columns(calibration, "tool.")] = 0.0
    return se3.carry(J, calibration.predict_tool(q)[:, :3, :3] @ T_tool_held[:3, 3])


def _reflector_twists(
    calibration: Calibration, rows: list[int], T: Float[np.ndarray, "4 4"], q: Float[np.ndarray, "n joints"]
) -> Float[np.ndarray, "n 6 z"]:
    """Of a frame that is known by its reflectors."""
    J, tool = calibration.tool_jacobian(q), calibration.predict_tool(q)
    arms = [tool[:, :3, :3] @ calibration.T_tool_target[k, :3, 3] for k in rows]
    moved: list[np.ndarray] = []
    for k, arm in zip(rows, arms, strict=True):
        point = se3.carry(J, arm)[:, :3]
        columns = calibration.layout.point_columns[k]
        if columns[0] >= 0:
            point[:, :, columns] = tool[:, :3, :3]
        moved.append(point)
    points = tool[:, None, :3, 3] + np.stack(arms, axis=1)
    return _rigid_fit(points, np.stack(moved, axis=1), (tool @ T)[:, :3, 3])


def _target_twists(
    calibration: Calibration, known: Measured, q: Float[np.ndarray, "n joints"]
) -> Float[np.ndarray, "n 6 z"]:
    """Of a frame that is known in the measured target's."""
    at = calibration.layout.walked(q, calibration.z)
    J = walk.columns(at.chain, at.s, at.e, at.layout, at.factor, angular=True)
    target = calibration.predict_tool(q) @ calibration.T_tool_target[0]
    offset = np.zeros(3) if known.in_target is None else known.in_target[:3, 3]
    return se3.carry(J, target[:, :3, :3] @ offset)
