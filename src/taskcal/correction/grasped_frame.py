"""What the robot holds: where it is in the calibrated robot's own tool, and how it moves with the estimate.

It is known where the controller has it in the flange, or by the reflectors or the pose that were measured on it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.correction.cell import Measured
from taskcal.correction.rigid_motion import fit_points, rigid_twists
from taskcal.errors import TaskcalError
from taskcal.geometry import se3, walk
from taskcal.identification.calibration import Calibration
from taskcal.robot.conditions import Conditions
from taskcal.robot.error_frames import COMPONENTS

SAME_TOOL = 1e-6
"""A program's tool is the robot's own if it differs by less, metres and radians."""

MAX_MISFIT_M = 5e-4
"""Reflectors that fit worse than this, metres, are not where they are said to be."""

Twists = Callable[[np.ndarray, Conditions | None], np.ndarray]
"""From joint positions (n, joints), and how they are reached, to derivatives (n, 6, z) of a frame's pose by the estimate, at its
origin in tracker axes."""


@dataclass(frozen=True, eq=False, kw_only=True)
class GraspedFrame:
    """What the robot holds."""

    T_tool_grasped: Float[np.ndarray, "4 4"]
    """In the calibrated robot's own tool."""
    statement: str
    twists: Twists
    covariance: Float[np.ndarray, "3 3"]
    """Of its origin, by how it was measured against reflectors or flange, in its own axes, metres²."""


def grasped_frame(calibration: Calibration, measured: Measured, controller: Float[np.ndarray, "4 4"]) -> GraspedFrame:
    """Where what the robot holds is.

    Raises:
        TaskcalError: what was measured of it does not fit to what it is used for, or to the calibration.
    """
    if measured.in_tracker is not None or measured.touched is not None:
        raise TaskcalError(
            f"'{measured.name}' is held by the robot; it cannot be measured where it stands: give flange, target or reflectors_mm "
            "in the cell file"
        )
    robot, name = calibration.model.robot, measured.name
    if measured.reflectors:
        return _by_reflectors(calibration, measured)
    if measured.in_target is not None:
        if not calibration.layout.pose:
            raise TaskcalError(
                f"'{name}' is given in the measured target's frame, but the calibration is from points, which have none; give "
                "reflectors_mm or flange"
            )
        return GraspedFrame(
            T_tool_grasped=calibration.T_tool_target[0] @ measured.in_target,
            statement=f"tool '{name}' by the measured poses of '{calibration.targets[0]}'",
            twists=lambda q, conditions: _target_twists(calibration, measured, q, conditions),
            covariance=measured.uncertainty**2 * np.eye(3),
        )
    if measured.in_flange is None and np.abs(controller - robot.T_flange_tool).max() < SAME_TOOL:
        return GraspedFrame(
            T_tool_grasped=np.eye(4),
            statement=f"tool '{name}' is the robot file's, its errors as calibrated",
            twists=calibration.tool_jacobian,
            covariance=np.zeros((3, 3)),
        )
    in_flange = controller if measured.in_flange is None else measured.in_flange
    stated = "as the controller has it" if measured.in_flange is None else "as measured in the flange"
    T_tool_grasped = _flange_in_tool(calibration) @ in_flange
    return GraspedFrame(
        T_tool_grasped=T_tool_grasped,
        statement=f"tool '{name}' {stated}",
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
        statement=f"tool '{measured.name}' by its reflectors {', '.join(seen)}",
        twists=lambda q, conditions: _reflector_twists(calibration, rows, T, q, conditions),
        covariance=_fitted_covariance(own, measured.uncertainty),
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
    """Of a frame fixed to the flange, which the errors of the robot's own tool do not move."""
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
    """Of a frame that is known by its reflectors."""
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
    """Of a frame that is known in the measured target's."""
    at = calibration.layout.walked(q, calibration.z, calibration.model.prepare(q, conditions))
    J = walk.columns(at.chain, at.s, at.e, at.layout, at.factor, angular=True)
    target = calibration.target_poses(q)[:, 0]
    offset = np.zeros(3) if measured.in_target is None else measured.in_target[:3, 3]
    return se3.carry(J, target[:, :3, :3] @ offset)
