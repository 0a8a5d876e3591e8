"""What stands still: in the calibrated base as the controller has it, measured by the tracker, or touched by the robot."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.correction.cell import Cell, Measured
from taskcal.correction.grasped_frame import grasped_frame
from taskcal.correction.rigid_motion import fit_points, rigid_twists
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.robot.approach import conditions_in_order
from taskcal.robot.conditions import Conditions
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot


@dataclass(frozen=True, eq=False, kw_only=True)
class FixedFrame:
    """What stands still."""

    T_base_fixed: Float[np.ndarray, "4 4"]
    """In the calibrated base."""
    statement: str
    follows_base: bool
    """Whether it is only known where the controller's base is."""
    twist: Float[np.ndarray, "6 z"] | None
    """Derivative of its pose by the estimate, for a point at the tracker's origin; None where it does not depend on it."""
    covariance: Float[np.ndarray, "6 6"]
    """Of the twist of its pose by how it was measured, for a point at the tracker's origin, tracker axes; metres and radians.

    What the estimate does not tell: the tracker's measurement of it, or at each touched point the model error, how well a
    touch repeats, and where the tool that touched has its tip."""


def fixed_frame(
    calibration: Calibration, measured: Measured, controller: Float[np.ndarray, "4 4"], cell: Cell
) -> FixedFrame:
    """Where what stands still is.

    Raises:
        TaskcalError: what was measured of it does not fit to what it is used for, or to the calibration.
    """
    if measured.in_flange is not None or measured.in_target is not None or measured.reflectors:
        raise TaskcalError(
            f"'{measured.name}' stands still; it cannot be measured in the robot's hand: give tracker or touched_deg in the "
            "cell file"
        )
    if measured.in_tracker is not None:
        return FixedFrame(
            T_base_fixed=se3.inverse(calibration.T_tracker_base) @ measured.in_tracker,
            statement=f"part '{measured.name}' as the tracker measured it",
            follows_base=False,
            twist=None,
            covariance=_position_covariance(measured),
        )
    if measured.touched is not None:
        return _touched(calibration, measured, measured.touched, controller, cell)
    return FixedFrame(
        T_base_fixed=controller,
        statement=f"part '{measured.name}' where the controller has it in the robot's base, as calibrated",
        follows_base=True,
        twist=None,
        covariance=np.zeros((6, 6)),
    )


def _touched(
    calibration: Calibration,
    measured: Measured,
    q: Float[np.ndarray, "k joints"],
    controller: Float[np.ndarray, "4 4"],
    cell: Cell,
) -> FixedFrame:
    robot = calibration.model.robot
    if q.shape[1] != len(robot.joints):
        raise TaskcalError(
            f"touched_deg of '{measured.name}' has {q.shape[1]} angles a row; {robot.name} has {len(robot.joints)} joints"
        )
    toucher = cell.tool(measured.touched_with)
    T_controller = toucher.controller if toucher.controller is not None else toucher.in_flange
    if T_controller is None:
        raise TaskcalError(f"the cell does not say where the controller has '{measured.touched_with}', which touched")
    tool = grasped_frame(calibration, toucher, T_controller)
    conditions = Conditions(approach=conditions_in_order(robot, q).approach)
    true = calibration.tool_in_base(q, conditions) @ tool.T_tool_grasped
    nominal = nominal_flange(robot, q) @ T_controller
    M, _ = fit_points(nominal[:, :3, 3], true[:, :3, 3])
    in_tracker = calibration.T_tracker_base @ true
    points = in_tracker[:, :3, 3]
    return FixedFrame(
        T_base_fixed=M @ controller,
        statement=f"part '{measured.name}' where the robot touched it with '{measured.touched_with}'",
        follows_base=False,
        twist=_fitted_twist(points, tool.twists(q, conditions)[:, :3]),
        covariance=_touch_covariance(calibration, measured, q, in_tracker, tool.covariance),
    )


def _position_covariance(measured: Measured) -> Float[np.ndarray, "6 6"]:
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = measured.uncertainty**2 * np.eye(3)
    return covariance


def _fitted_twist(points: Float[np.ndarray, "k 3"], J: Float[np.ndarray, "k 3 z"]) -> Float[np.ndarray, "6 z"]:
    """The twist at the tracker's origin of the rigid motion nearest to how touched points move."""
    return rigid_twists(points[None], J[None], np.zeros((1, 3)))[0]


def _touch_covariance(
    calibration: Calibration,
    measured: Measured,
    q: Float[np.ndarray, "k joints"],
    touched: Float[np.ndarray, "k 4 4"],
    tip: Float[np.ndarray, "3 3"],
) -> Float[np.ndarray, "6 6"]:
    """Of a part fitted to touched points, but for the estimate.

    Args:
        calibration: of the robot that touched.
        measured: the part; its uncertainty is that of one touch, per axis.
        q: joint positions of the touches.
        touched: poses of the tool that touched, tracker frame.
        tip: covariance of its tip in its own axes, the same at every touch.
    """
    k = len(q)
    each = np.eye(3 * k).reshape(k, 3, 3 * k)
    single = _fitted_twist(
        touched[:, :3, 3], each * np.sqrt(_white_variances(calibration, q) + measured.uncertainty**2)[:, :, None]
    )
    common = _fitted_twist(touched[:, :3, 3], touched[:, :3, :3])
    return single @ single.T + common @ tip @ common.T


def _white_variances(calibration: Calibration, q: Float[np.ndarray, "k joints"]) -> Float[np.ndarray, "k 3"]:
    """Of what the model cannot explain at single poses, metres²."""
    if calibration.field is None:
        return np.full((len(q), 3), calibration.model_error[0] ** 2)
    return calibration.field.variance(q)[:, :3]


def nominal_flange(robot: Robot, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 4 4"]:
    """Where a controller has its flange at joint positions q."""
    return ErrorModel(robot).poses(q) @ se3.inverse(robot.T_flange_tool)
