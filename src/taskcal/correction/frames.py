"""Tool and part frames on the calibrated robot: the held object relative to the fixed one.

A path is accurate relative to something. What stands still is known in the calibrated base as the controller has it, or was
measured by the tracker, or was touched by the robot itself, whose errors there then cancel in part. What the robot holds is
known where the controller has it in the flange, by the reflectors that were measured on it, or by joint positions at which its
tip was at one point.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Int

from robot_programs.core.program import Motion
from taskcal.correction.cell import Cell, Measured
from taskcal.correction.controller import DriveDirections
from taskcal.correction.path import PlacedMotions, Placement, distinct_frames
from taskcal.errors import TaskcalError
from taskcal.estimation.matrices import root_of
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration, PoseErrors, pose_errors
from taskcal.identification.problem import Rows
from taskcal.robot.conditions import Conditions, conditions_in_order
from taskcal.robot.error_model import COMPONENTS, ErrorModel
from taskcal.robot.robot import Robot
from taskcal_groundwork.said import Said

# Rigid motions nearest to how points move.


def fit_points(
    own: Float[np.ndarray, "k 3"], there: Float[np.ndarray, "k 3"]
) -> tuple[Float[np.ndarray, "4 4"], float]:
    """The motion that brings points nearest to others, and the farthest that one is left, metres.

    Raises:
        TaskcalError: the points lie in a line and do not locate a frame.
    """
    extent = np.linalg.svd(own - own.mean(axis=0), compute_uv=False)
    if extent[1] < 1e-3 * extent[0] or extent[0] < 1e-3:
        raise TaskcalError("the points lie in a line or at one place; three that span a triangle locate a frame")
    T = se3.fit_points(own, there)
    return T, float(np.linalg.norm(se3.apply(T, own) - there, axis=1).max())


def rigid_twists(
    points: Float[np.ndarray, "n k 3"], J: Float[np.ndarray, "n k 3 z"], at: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n 6 z"]:
    """The twists at given points of the rigid motions that come nearest to how some points move."""
    n, k = points.shape[:2]
    return np.linalg.pinv(se3.by_twist(points - at[:, None]).reshape(n, 3 * k, 6)) @ J.reshape(n, 3 * k, -1)


# What the robot holds: where it is in the calibrated robot's own tool, and how it moves with the estimate.
#
# It is known where the controller has it in the flange, by the reflectors or the pose that were measured on it, or by its tip.

MAX_TOOL_DIFFERENCE = 1e-6
"""A program's tool is the robot's own if it differs by less, metres and radians."""

MAX_MISFIT_M = 5e-4
"""Reflectors that fit worse than this, metres, are not where they are said to be."""

MAX_TIP_MISFIT_M = 3e-3
"""Touches of one point that miss each other by more, metres, are not of one point: by hand one is met within 1 mm."""

MIN_TIP_TURN = 0.1
"""Least singular value of how the tool was turned between the touches, over the root of their number: some 10° about each of two
axes. Below, a touch that is off by 0.1 mm puts the tip off by more than 1 mm."""

Twists = Callable[[np.ndarray, Conditions | None], np.ndarray]
"""From joint positions (n, joints), and how they are reached, to derivatives (n, 6, z) of a frame's pose by the estimate, at its
origin in tracker axes."""


@dataclass(frozen=True, eq=False, kw_only=True)
class GraspedFrame:
    """Frame of the held object."""

    T_tool_grasped: Float[np.ndarray, "4 4"]
    """In the calibrated robot's own tool."""
    twists: Twists
    statement: str = ""
    covariance: Float[np.ndarray, "3 3"] = field(default_factory=lambda: np.zeros((3, 3)))
    """Of its origin, by how it was measured against reflectors or flange, in its own axes, metres²."""


def grasped_frame(calibration: Calibration, measured: Measured, controller: Float[np.ndarray, "4 4"]) -> GraspedFrame:
    """The frame of what the robot holds.

    Raises:
        TaskcalError: what was measured of it does not fit to what it is used for, or to the calibration.
    """
    if measured.in_tracker is not None or measured.touched is not None:
        raise TaskcalError(
            f"'{measured.name}' is held by the robot; it cannot be measured where it stands: give flange, tip_deg, target or "
            "reflectors_mm in the cell file"
        )
    robot, name = calibration.model.robot, measured.name
    if measured.reflectors:
        return _by_reflectors(calibration, measured)
    if measured.tip is not None:
        return _by_tip(calibration, measured, measured.tip, controller)
    if measured.in_target is not None:
        if not calibration.layout.pose:
            raise TaskcalError(
                f"'{name}' is given in the measured target's frame, but the calibration is from points, which have none; give "
                "reflectors_mm or flange"
            )
        return GraspedFrame(
            T_tool_grasped=calibration.T_tool_target[0] @ measured.in_target,
            statement=Said(
                "tool '{name}' by the measured poses of '{target}'", name=name, target=calibration.targets[0]
            ),
            twists=lambda q, conditions: _target_twists(calibration, measured, q, conditions),
            covariance=measured.uncertainty**2 * np.eye(3),
        )
    if measured.in_flange is None and np.abs(controller - robot.T_flange_tool).max() < MAX_TOOL_DIFFERENCE:
        return GraspedFrame(
            T_tool_grasped=np.eye(4),
            statement=Said("tool '{name}' is the robot file's, its errors as calibrated", name=name),
            twists=calibration.tool_jacobian,
        )
    in_flange = controller if measured.in_flange is None else measured.in_flange
    by_controller, in_its_flange = (
        Said("tool '{name}' as the controller has it", name=name),
        Said("tool '{name}' as measured in the flange", name=name),
    )
    T_tool_grasped = _flange_in_tool(calibration) @ in_flange
    return GraspedFrame(
        T_tool_grasped=T_tool_grasped,
        statement=by_controller if measured.in_flange is None else in_its_flange,
        twists=lambda q, conditions: _flange_twists(calibration, T_tool_grasped, q, conditions),
        covariance=measured.uncertainty**2 * np.eye(3),
    )


def _flange_in_tool(calibration: Calibration) -> Float[np.ndarray, "4 4"]:
    """The flange in the robot's own tool, which the calibration has moved against it by the tool's errors."""
    model = calibration.model
    errors = np.zeros(6)
    for i, name in enumerate(model.names):
        if name.startswith("tool."):
            errors[COMPONENTS.index(name.removeprefix("tool."))] = calibration.estimate[i]
    return se3.inverse(model.robot.T_flange_tool @ se3.error_transform(errors))


def _by_reflectors(calibration: Calibration, measured: Measured) -> GraspedFrame:
    seen = [name for name in measured.reflectors if name in calibration.targets]
    if len(seen) < 3:
        raise TaskcalError(
            f"'{measured.name}' has {len(seen)} reflectors that the calibration measured ({', '.join(calibration.targets)}); "
            "it takes 3"
        )
    own = np.array([measured.reflectors[name] for name in seen])
    rows = [calibration.targets.index(name) for name in seen]
    there = calibration.T_tool_target[rows, :3, 3]
    T, misfit = fit_points(own, there)
    if misfit > MAX_MISFIT_M:
        raise TaskcalError(
            f"the reflectors of '{measured.name}' do not fit: as calibrated they lie up to {misfit * 1e3:.2f} mm from where "
            "reflectors_mm puts them; check their names and units"
        )
    return GraspedFrame(
        T_tool_grasped=T,
        statement=Said("tool '{name}' by its reflectors {seen}", name=measured.name, seen=", ".join(seen)),
        twists=lambda q, conditions: _reflector_twists(calibration, rows, T, q, conditions),
        covariance=_fitted_covariance(own, measured.uncertainty),
    )


def _by_tip(
    calibration: Calibration,
    measured: Measured,
    q: Float[np.ndarray, "k joints"],
    controller: Float[np.ndarray, "4 4"],
) -> GraspedFrame:
    """The tool whose tip was at one point at some joint positions; how it is turned, the controller says.

    Raises:
        TaskcalError: they are of another robot, or the tool was hardly turned, or they do not meet in a point.
    """
    robot, name = calibration.model.robot, measured.name
    check_angles(robot, "tip_deg", name, q)
    conditions = Conditions(approach=conditions_in_order(robot, q).approach)
    poses = calibration.predict_tool(q, conditions)
    turns, places = (part - part.mean(axis=0) for part in (poses[:, :3, :3], poses[:, :3, 3]))
    stacked = turns.reshape(-1, 3)
    if np.linalg.svd(stacked, compute_uv=False)[-1] < MIN_TIP_TURN * np.sqrt(len(q)):
        raise TaskcalError(
            f"tip_deg of '{name}' does not locate its tip: the tool was hardly turned between the touches; touch the point with "
            "the tool turned by 30° and more about two axes"
        )
    inverse = np.linalg.pinv(stacked)
    tip = -inverse @ places.reshape(-1)
    missed = turns @ tip + places
    if (worst := float(np.linalg.norm(missed, axis=1).max())) > MAX_TIP_MISFIT_M:
        raise TaskcalError(
            f"tip_deg of '{name}' does not meet in one point: its touches lie up to {worst * 1e3:.1f} mm from it; check the "
            "angles, and that nothing moved"
        )
    T_tool_tip = _flange_in_tool(calibration) @ controller
    shift = float(np.linalg.norm(T_tool_tip[:3, 3] - tip))
    T_tool_tip[:3, 3] = tip
    scatter = float((missed**2).sum()) / (3 * len(q) - 6)
    at_tip = se3.carry(calibration.tool_jacobian(q, conditions), poses[:, :3, :3] @ tip)[:, :3]
    by_estimate = -inverse @ (at_tip - at_tip.mean(axis=0)).reshape(len(stacked), -1)

    def twists(q: Float[np.ndarray, "n joints"], conditions: Conditions | None) -> Float[np.ndarray, "n 6 z"]:
        J, R = calibration.tool_jacobian(q, conditions), calibration.predict_tool(q)[:, :3, :3]
        moved = se3.carry(J, R @ tip)
        moved[:, :3] += R @ by_estimate
        moved[:, 3:, columns_of(calibration, "tool.")] = 0.0  # how it is turned in the flange, the controller says
        return moved

    errors = _errors_at(calibration, q, poses @ se3.translation(*tip), conditions).single[:, 0]
    touch = max(scatter, measured.uncertainty**2 + float(_total(errors).mean()) / 3.0)
    return GraspedFrame(
        T_tool_grasped=T_tool_tip,
        statement=Said(
            "tool '{name}' by {count} touches of one point, {shift:.2f} mm from where the controller has it",
            name=name,
            count=len(q),
            shift=float(shift) * 1e3,
        ),
        twists=twists,
        covariance=touch * np.linalg.inv(stacked.T @ stacked),
    )


def check_angles(robot: Robot, key: str, name: str, q: Float[np.ndarray, "k joints"]) -> None:
    """See that rows of a cell file have an angle for every joint, and that none of them slides."""
    if True in robot.prismatic:
        sliding = robot.joint_names[robot.prismatic.index(True)]
        raise TaskcalError(
            f"{key} of '{name}' has angles alone, and joint {sliding} of {robot.name} slides; measure it otherwise"
        )
    if q.shape[1] != len(robot.joints):
        raise TaskcalError(
            f"{key} of '{name}' has {q.shape[1]} angles a row; {robot.name} has {len(robot.joints)} joints"
        )


def _fitted_covariance(own: Float[np.ndarray, "k 3"], uncertainty: float) -> Float[np.ndarray, "3 3"]:
    """Covariance of the origin of a frame that is fitted to points known to an uncertainty per axis, metres²."""
    every = np.eye(own.size).reshape(1, len(own), 3, own.size)
    by_point = rigid_twists(own[None], every, np.zeros((1, 3)))[0, :3]
    return uncertainty**2 * by_point @ by_point.T


def columns_of(calibration: Calibration, prefix: str) -> list[int]:
    """Columns of the estimate whose names begin so."""
    return [i for i, name in enumerate(calibration.all_names) if name.startswith(prefix)]


def _flange_twists(
    calibration: Calibration,
    T_tool_grasped: Float[np.ndarray, "4 4"],
    q: Float[np.ndarray, "n joints"],
    conditions: Conditions | None,
) -> Float[np.ndarray, "n 6 z"]:
    """Twists of a frame fixed to the flange, which the errors of the robot's own tool do not move."""
    J = calibration.tool_jacobian(q, conditions)
    J[:, :, columns_of(calibration, "tool.")] = 0.0
    return se3.carry(J, calibration.predict_tool(q)[:, :3, :3] @ T_tool_grasped[:3, 3])


def _reflector_twists(
    calibration: Calibration,
    rows: list[int],
    T: Float[np.ndarray, "4 4"],
    q: Float[np.ndarray, "n joints"],
    conditions: Conditions | None,
) -> Float[np.ndarray, "n 6 z"]:
    """Twists of a frame that is known by its reflectors."""
    J, tool = calibration.tool_jacobian(q, conditions), calibration.predict_tool(q)
    points = calibration.target_poses(q)[:, rows][..., :3, 3]
    moved: list[np.ndarray] = []
    for k, arm in zip(rows, np.moveaxis(points - tool[:, None, :3, 3], 1, 0), strict=True):
        point = se3.carry(J, arm)[:, :3]
        columns = calibration.layout.point_columns[k]
        if columns[0] >= 0:
            point[:, :, columns] = tool[:, :3, :3]
        moved.append(point)
    return rigid_twists(points, np.stack(moved, axis=1), (tool @ T)[:, :3, 3])


def _target_twists(
    calibration: Calibration, measured: Measured, q: Float[np.ndarray, "n joints"], conditions: Conditions | None
) -> Float[np.ndarray, "n 6 z"]:
    """Twists of a frame that is known in the measured target's."""
    targets = Rows.of_targets(calibration.layout, calibration.z, q, calibration.model.prepare(q, conditions))
    J, target = targets.linearise().by_entry, calibration.target_poses(q)[:, 0]
    offset = np.zeros(3) if measured.in_target is None else measured.in_target[:3, 3]
    return se3.carry(J, target[:, :3, :3] @ offset)


# What stands still: in the calibrated base as the controller has it, measured by the tracker, or touched by the
# robot.


@dataclass(frozen=True, eq=False, kw_only=True)
class FixedFrame:
    """Frame of the fixed object."""

    T_base_fixed: Float[np.ndarray, "4 4"]
    """In the calibrated base."""
    statement: str = ""
    follows_base: bool = False
    """Whether it is only known where the controller's base is."""
    twist: Float[np.ndarray, "6 z"] | None = None
    """Derivative of its pose by the estimate, for a point at the tracker's origin; None where it does not depend on it."""
    warmth: Float[np.ndarray, "6 c"] | None = None
    """The same by how warm the robot is, where that is not told (`PoseErrors.warmth`): a part is taken to be touched when the robot
    is as warm as it is at work."""
    covariance: Float[np.ndarray, "6 6"] = field(default_factory=lambda: np.zeros((6, 6)))
    """Of the twist of its pose by how it was measured, for a point at the tracker's origin, tracker axes; metres and radians.

    What the estimate does not tell: the tracker's measurement of it, or at each touched point the model error, how well a
    touch repeats, and where the tool that touched has its tip."""


def fixed_frame(
    calibration: Calibration, measured: Measured, controller: Float[np.ndarray, "4 4"], cell: Cell, robot: Robot
) -> FixedFrame:
    """The frame of what is fixed in the cell; arguments as of `frames_on`.

    Raises:
        TaskcalError: what was measured of it does not fit to what it is used for, or to the calibration.
    """
    held = (measured.in_flange, measured.in_target, measured.tip)
    if measured.reflectors or any(given is not None for given in held):
        raise TaskcalError(
            f"'{measured.name}' stands still; it cannot be measured in the robot's hand: give tracker or touched_deg in the "
            "cell file"
        )
    if measured.in_tracker is not None:
        return FixedFrame(
            T_base_fixed=se3.inverse(calibration.T_tracker_base) @ measured.in_tracker,
            statement=Said("part '{name}' as the tracker measured it", name=measured.name),
            covariance=np.diag([measured.uncertainty**2] * 3 + [0.0] * 3),
        )
    if measured.touched is not None:
        return _touched(calibration, measured, measured.touched, controller, cell, robot)
    return FixedFrame(
        T_base_fixed=controller,
        statement=Said(
            "part '{name}' where the controller has it in the robot's base, as calibrated", name=measured.name
        ),
        follows_base=True,
    )


def _touched(
    calibration: Calibration,
    measured: Measured,
    q: Float[np.ndarray, "k joints"],
    controller: Float[np.ndarray, "4 4"],
    cell: Cell,
    robot: Robot,
) -> FixedFrame:
    check_angles(robot, "touched_deg", measured.name, q)
    toucher = cell.tool(measured.touched_with)
    T_controller = toucher.controller if toucher.controller is not None else toucher.in_flange
    if T_controller is None:
        raise TaskcalError(f"the cell does not say where the controller has '{measured.touched_with}', which touched")
    tool = grasped_frame(calibration, toucher, T_controller)
    conditions = Conditions(approach=conditions_in_order(robot, q).approach)
    true = calibration.tool_in_base(q, conditions) @ tool.T_tool_grasped
    nominal = ErrorModel(robot).poses(q) @ se3.inverse(robot.T_flange_tool) @ T_controller
    M, _ = fit_points(nominal[:, :3, 3], true[:, :3, 3])
    in_tracker = calibration.T_tracker_base @ true
    points = in_tracker[:, :3, 3]
    errors = _errors_at(calibration, q, in_tracker, conditions)
    return FixedFrame(
        T_base_fixed=M @ controller,
        statement=Said(
            "part '{name}' where the robot touched it with '{tool}'",
            name=measured.name,
            tool=str(measured.touched_with),
        ),
        twist=_fitted_twist(points, tool.twists(q, conditions)[:, :3]),
        warmth=_fitted_twist(points, errors.warmth[:, 0]),
        covariance=_touch_covariance(measured, in_tracker, errors.single[:, 0], tool.covariance),
    )


def _fitted_twist(points: Float[np.ndarray, "k 3"], J: Float[np.ndarray, "k 3 z"]) -> Float[np.ndarray, "6 z"]:
    """The twist at the tracker's origin of the rigid motion nearest to how touched points move."""
    return rigid_twists(points[None], J[None], np.zeros((1, 3)))[0]


def _touch_covariance(
    measured: Measured,
    touched: Float[np.ndarray, "k 4 4"],
    errors: Float[np.ndarray, "k 3 3"],
    tip: Float[np.ndarray, "3 3"],
) -> Float[np.ndarray, "6 6"]:
    """Covariance of a part fitted to touched points, without that of the estimate.

    Args:
        measured: the part; its uncertainty is that of one touch, per axis.
        touched: poses of the tool that touched, tracker frame.
        errors: covariance of what errs at each touch alone (`PoseErrors.single`).
        tip: covariance of its tip in its own axes, the same at every touch.
    """
    k = len(touched)
    per_touch = np.zeros((k, 3, k, 3))
    per_touch[range(k), :, range(k)] = root_of(errors + measured.uncertainty**2 * np.eye(3))
    single = _fitted_twist(touched[:, :3, 3], per_touch.reshape(k, 3, 3 * k))
    common = _fitted_twist(touched[:, :3, 3], touched[:, :3, :3])
    return single @ single.T + common @ tip @ common.T


def _errors_at(
    calibration: Calibration,
    q: Float[np.ndarray, "n joints"],
    T: Float[np.ndarray, "n 4 4"],
    conditions: Conditions | None,
) -> PoseErrors:
    """What errs of the origins of frames on the tool, which stand so in the tracker's frame, beside the estimate."""
    arm = T[:, :3, 3] - calibration.predict_tool(q, conditions)[:, :3, 3]
    return pose_errors(calibration, q, se3.by_twist(arm)[:, None], conditions)


SOURCES = ("geometry", "model error", "tool", "part")
"""Of the uncertainty of a tool in a part. The model error is all that the estimate does not tell of a pose (`PoseErrors`)."""

GROWING = ("geometry", "model error")
"""Of these what the calibration's covariance grows by beyond the measured range (`Calibration.growth_at`)."""

CAUSES_OF_FRAMES = 9
"""The last ones of `FrameCalibration.causes`, which each pair of frames has of its own: three of what is held, six of what stands
still."""

RELATIVE_UNCERTAINTY = 0.25
"""Of what is stated of an uncertainty, over itself: the share that the GUM takes as an example of one that is not from repeated
measurements (JCGM 100:2008, G.4.2; 8 degrees of freedom). Robots are not of the model's class: on held-out rows of three measured
ones the errors were 0.87 to 1.57 times what was expected."""

CHUNK_POSES = 4096
"""Poses whose derivatives are held at once; those of 10⁵ would take 300 MB."""


@dataclass(frozen=True, eq=False, kw_only=True)
class MovedFrame:
    """The grasped frame at some poses."""

    J: Float[np.ndarray, "n 3 z"]
    """Derivatives of its origin by the estimate, in tracker axes."""
    T: Float[np.ndarray, "n 4 4"]
    """In the tracker's frame, metres."""
    errors: PoseErrors
    """What errs of its origin there beside the estimate."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FrameCalibration:
    """A tool and a part, on the robot as calibrated."""

    calibration: Calibration
    grasped: GraspedFrame
    fixed: FixedFrame
    part_in_hand: bool

    @property
    def statement(self) -> str:
        """Reference of the accuracy, in words."""
        return f"{self.grasped.statement}; {self.fixed.statement}"

    @property
    def placement(self) -> Placement:
        """Placement of both frames."""
        return Placement(
            T_tool_grasped=self.grasped.T_tool_grasped,
            T_base_fixed=self.fixed.T_base_fixed,
            part_in_hand=self.part_in_hand,
        )

    def covariance(
        self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None
    ) -> Float[np.ndarray, "n 3 3"]:
        """Covariance of where the grasped frame's origin is against the fixed frame, in the fixed frame's axes, metres².

        What errs at a pose alone is not in it.

        Args:
            q: joint positions, radians.
            conditions: how the poses are reached, for effects that depend on it.
        """
        relative = self.causes(q, conditions)
        return relative @ np.swapaxes(relative, 1, 2)

    def moved(self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None) -> "MovedFrame":
        """The grasped frame at some poses; arguments as of `causes`."""
        T = self.calibration.predict_tool(q, conditions) @ self.grasped.T_tool_grasped
        errors = _errors_at(self.calibration, q, T, conditions)
        return MovedFrame(J=self.grasped.twists(q, conditions)[:, :3], T=T, errors=errors)

    def causes(
        self,
        q: Float[np.ndarray, "n joints"],
        conditions: Conditions | None = None,
        moved: "MovedFrame | None" = None,
    ) -> Float[np.ndarray, "n 3 k"]:
        """Errors of the grasped frame's origin against the fixed frame by independent causes of one standard deviation each.

        Each is the same at all poses: first those of the estimate, then those of how warm the robot is, where that is not told,
        three of what is held and six of what stands still. In the fixed frame's axes, metres. What errs at a pose alone is not
        in it.

        Args:
            q: joint positions, radians.
            conditions: how the poses are reached, for effects that depend on it.
            moved: as `moved` gives it, where it is known.
        """
        moved = moved or self.moved(q, conditions)
        fixed, position, J, warmth = self.fixed, moved.T[:, :3, 3], moved.J, moved.errors.warmth[:, 0]
        if fixed.follows_base:
            J = J.copy()
            J[:, :, columns_of(self.calibration, "base.")] = 0.0
        stands = se3.by_twist(position)
        if fixed.twist is not None and fixed.warmth is not None:
            J, warmth = J - stands @ fixed.twist, warmth - stands @ fixed.warmth
        return self.turn.T @ np.concatenate([*self._held(moved, J, warmth), stands @ root_of(fixed.covariance)], axis=2)

    def _held(
        self, moved: "MovedFrame", J: Float[np.ndarray, "n 3 z"], warmth: Float[np.ndarray, "n 3 c"]
    ) -> list[Float[np.ndarray, "n 3 k"]]:
        """Errors of the grasped frame's origin by the estimate, by warmth and by how it was measured; tracker axes."""
        by_estimate = np.sqrt(moved.errors.growth)[:, None, None] * (J @ self.calibration.z_spread)
        return [by_estimate, warmth, moved.T[:, :3, :3] @ root_of(self.grasped.covariance)]

    @property
    def turn(self) -> Float[np.ndarray, "3 3"]:
        """Axes of the fixed frame in the tracker's."""
        return (self.calibration.T_tracker_base @ self.fixed.T_base_fixed)[:3, :3]

    def points(self, moved: "MovedFrame") -> Float[np.ndarray, "n 3"]:
        """The grasped frame's origin in the fixed frame, metres."""
        return (se3.inverse(self.calibration.T_tracker_base @ self.fixed.T_base_fixed) @ moved.T)[:, :3, 3]

    def spread(self, moved: "MovedFrame") -> Float[np.ndarray, "n 3 k"]:
        """Errors of the grasped frame's origin by independent causes of one standard deviation each, metres.

        They go together at all poses, so that what poses have in common can be taken out; in the fixed frame's axes, and without
        what is not known of the fixed frame itself.
        """
        return self.turn.T @ np.concatenate(self._held(moved, moved.J, moved.errors.warmth[:, 0]), axis=2)

    def variances(
        self,
        q: Float[np.ndarray, "n joints"],
        conditions: Conditions | None = None,
        moved: "MovedFrame | None" = None,
        causes: Float[np.ndarray, "n 3 k"] | None = None,
    ) -> Float[np.ndarray, "n sources"]:
        """The square of the uncertainty by where it comes from, in the order of `SOURCES`, metres².

        Of the geometry is what the calibration does not know of its own targets in the tracker's frame; of the tool, what
        comes to that for what is held; of the part, what comes to that for what stands still. What falls, because both are
        in error alike, is counted as nothing.

        Args:
            q: joint positions, radians.
            conditions: how the poses are reached, for effects that depend on it.
            moved: as `moved` gives it, where it is known.
            causes: as `causes` gives them, where they are known.
        """
        q = np.asarray(q, dtype=float)
        moved = moved or self.moved(q, conditions)
        causes = self.causes(q, conditions, moved) if causes is None else causes
        covariance = self.calibration.predict_covariance(q, conditions, model_error=False)[..., :3, :3]
        by_estimate, _, held = self._held(moved, moved.J, moved.errors.warmth[:, 0])
        warm = _square(causes[:, :, len(self.calibration.z) : -CAUSES_OF_FRAMES])
        geometry, grasped = _total(covariance).mean(axis=1), _square(by_estimate) + _square(held)
        total = _square(causes) - warm
        parts = np.stack([geometry, grasped - geometry, total - grasped], axis=1)
        parts = np.maximum(parts, 0.0)
        parts *= (total / np.maximum(parts.sum(axis=1), 1e-300))[:, None]
        beside = _total(moved.errors.single[:, 0]) + warm
        return np.stack([parts[:, 0], beside, parts[:, 1], parts[:, 2]], axis=1)


def _square(errors: Float[np.ndarray, "n 3 k"]) -> Float[np.ndarray, " n"]:
    return (errors**2).sum(axis=(1, 2))


def _total(covariance: Float[np.ndarray, "*b 3 3"]) -> Float[np.ndarray, "*b"]:
    return np.trace(covariance, axis1=-2, axis2=-1)


def calibrate_frames(
    calibration: Calibration, move: Motion, cell: Cell, robot: Robot | None = None
) -> FrameCalibration:
    """Frames of a motion's tool and part on the robot as calibrated; arguments as of `frames_on`.

    Raises:
        TaskcalError: what was measured of them does not fit to what they are used for, or to the calibration.
    """
    tool, part = cell.tool(move.tool.name), cell.part(move.part.name)
    grasped, fixed = (part, tool) if move.part_in_hand else (tool, part)
    stated_grasped, stated_fixed = (move.part, move.tool) if move.part_in_hand else (move.tool, move.part)
    if stated_fixed.moved and (fixed.in_tracker is not None or fixed.touched is not None):
        raise TaskcalError(
            f"{move.place}: '{fixed.name}' was measured with the external axes at zero, and here one is away from it: take tracker "
            "or touched_deg out of the cell file, or give the axes' positions at zero a program of their own"
        )
    return FrameCalibration(
        calibration=calibration,
        grasped=grasped_frame(calibration, grasped, stated_grasped.T),
        fixed=fixed_frame(calibration, fixed, stated_fixed.T, cell, robot or calibration.model.robot),
        part_in_hand=move.part_in_hand,
    )


# The motions of a program with their frames, on the robot as calibrated.


def frames_on(
    calibration: Calibration, motions: Sequence[Motion], cell: Cell, robot: Robot | None = None
) -> tuple[list[FrameCalibration], Int[np.ndarray, " m"]]:
    """Calibrated frames of tools and parts, those in common once, and the number of every motion's.

    Args:
        calibration: the robot as calibrated.
        motions: whose frames they are.
        cell: what was measured of them.
        robot: as its controller computes with it; the calibration's by default.
    """
    examples, number = distinct_frames(motions)
    return [calibrate_frames(calibration, move, cell, robot) for move in examples], number


def place_motions(
    calibration: Calibration,
    frames: Sequence[FrameCalibration],
    number: Int[np.ndarray, " m"],
    directions: DriveDirections | None,
) -> PlacedMotions:
    """The motions on the robot as calibrated, each drive coming from its side where the model tells one from the other."""

    def tool_in_base(
        q: Float[np.ndarray, "k joints"], move: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"]
    ) -> Float[np.ndarray, "k 4 4"]:
        return calibration.tool_in_base(q, None if directions is None else directions.at(move, share))

    placements = tuple(frame.placement for frame in frames)
    return PlacedMotions(tool_in_base=tool_in_base, placements=placements, number=number)


@dataclass(frozen=True, eq=False, kw_only=True)
class Uncertainty:
    """What the calibration must expect at targets beyond its prediction."""

    variances: Float[np.ndarray, "m sources"]
    """Mean square of the error in space at every target, by source, metres²; NaN where it is not known."""
    weights: Float[np.ndarray, " m"]
    """How much each target counts; zero where its variances are not known, else adding up to one."""
    common: Float[np.ndarray, "k k"]
    """Mean over the targets of SᵀS, of causes that are the same at all of them (`FrameCalibration.causes`), metres²."""
    single: Float[np.ndarray, " m"]
    """What errs at each target alone adds so much to the trace of its covariance's square, metres⁴; NaN where it is not known."""
    growth: Float[np.ndarray, " m"]
    """By how much the variances of geometry and model error at every target are larger for lying beyond the measured range."""

    @property
    def least(self) -> float:
        """Sum of the mean variances without that growth, which allows for what nothing measured and may not be there, metres²."""
        beyond = 1.0 - 1.0 / self.growth
        of_robot = [source in GROWING for source in SOURCES]
        return float(self.mean.sum() - (self.weights * beyond) @ np.nan_to_num(self.variances)[:, of_robot].sum(axis=1))

    @property
    def mean(self) -> Float[np.ndarray, " sources"]:
        """Of the variances over the targets where they are known, metres²; zero where none is."""
        return self.weights @ np.nan_to_num(self.variances)

    @property
    def variance_of_mean_square(self) -> float:
        """Variance of the error's mean square over the targets, metres⁴.

        Of normal errors it is twice the trace of their covariance's square: for causes that are the same at all targets that of
        `common`, and at each of them what errs there alone (`single`), which many targets average out. To that comes how well the
        calibration knows its own uncertainty (`RELATIVE_UNCERTAINTY`).
        """
        single = np.sum(self.weights**2 * np.nan_to_num(self.single))
        own = 2.0 * RELATIVE_UNCERTAINTY * self.mean.sum()
        return float(2.0 * np.sum(self.common**2) + 2.0 * single + own**2)


def uncertainty_at(
    frames: Sequence[FrameCalibration],
    number: Int[np.ndarray, " m"],
    q: Float[np.ndarray, "m joints"],
    conditions: Conditions | None = None,
    weights: Float[np.ndarray, " m"] | None = None,
) -> Uncertainty:
    """What the calibration must expect at every target.

    Args:
        frames: tools and parts of one calibration.
        number: of each target's.
        q: joint positions at the targets, radians; NaN where they are not known.
        conditions: how the targets are reached, as far as it is told.
        weights: how much each target counts; all alike by default.
    """
    ended = np.isfinite(q[:, 0])
    counts = ended * (np.ones(len(q)) if weights is None else weights)
    counts /= counts.sum() or 1.0
    variances, single = np.full((len(number), len(SOURCES)), np.nan), np.full(len(number), np.nan)
    common = np.zeros((0, 0))
    for k, frame in enumerate(frames):
        rows = np.flatnonzero(ended & (number == k))
        for first in range(0, len(rows), CHUNK_POSES):
            some = rows[first : first + CHUNK_POSES]
            told = None if conditions is None else conditions.take(some)
            moved = frame.moved(q[some], told)
            causes = frame.causes(q[some], told, moved)
            variances[some] = frame.variances(q[some], told, moved, causes)
            shared = causes.shape[2] - CAUSES_OF_FRAMES
            if not len(common):
                common = np.zeros((shared + CAUSES_OF_FRAMES * len(frames),) * 2)
            columns = np.r_[:shared, shared + CAUSES_OF_FRAMES * k + np.arange(CAUSES_OF_FRAMES)]
            flat = (np.sqrt(counts[some])[:, None, None] * causes).reshape(-1, len(columns))
            common[np.ix_(columns, columns)] += flat.T @ flat
            own = frame.turn.T @ moved.errors.single[:, 0] @ frame.turn
            single[some] = np.einsum("nij,nji->n", own + 2.0 * (causes @ np.swapaxes(causes, 1, 2)), own)
    growth = np.ones(len(number))
    if frames:
        growth[ended] = frames[0].calibration.growth_at(q[ended])
    return Uncertainty(variances=variances, weights=counts, common=common, single=single, growth=growth)
