"""Where the pins of a closed loop are, in the robot's base."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.errors import RobotError
from taskcal.geometry.four_bar import close_four_bar
from taskcal.robot.robot import Robot


@dataclass(frozen=True, eq=False, kw_only=True)
class LoopPins:
    """Pins of the loop at some poses, metres; arm and crank turn about one ground axis."""

    ground: Float[np.ndarray, "n 3"]
    crank: Float[np.ndarray, "n 3"]
    """Between crank and rod."""
    rocker: Float[np.ndarray, "n 3"]
    """Between rod and rocker."""
    hinge: Float[np.ndarray, "n 3"]
    """Between rocker and arm."""
    axis: Float[np.ndarray, "n 3"]
    """Of ground and crank."""
    elbow_axis: Float[np.ndarray, "n 3"]
    """Of rocker and hinge, in the same sense."""


def find_loop_pins(
    robot: Robot,
    q: Float[np.ndarray, "n joints"],
    origins: Float[np.ndarray, "n joints 3"],
    axes: Float[np.ndarray, "n joints 3"],
) -> LoopPins:
    """Pins of the nominal loop.

    Args:
        robot: with a four-bar.
        q: joint positions, radians.
        origins: a point of every joint's axis in the base, metres.
        axes: their directions.

    Raises:
        ClosureError: the loop does not close at some pose.
        RobotError: the axes leave no arm between them.
    """
    drive = robot.four_bar
    assert drive is not None
    bar, arm, elbow = drive.bar, int(np.argmax(np.abs(drive.arm))), int(drive.moved[0])
    alpha, kappa = q @ drive.arm, q @ drive.crank
    theta = close_four_bar(bar, alpha, kappa).angle
    axis, ground, hinge = axes[:, arm], origins[:, arm], origins[:, elbow]
    same = np.sum(axis * axes[:, elbow], axis=1, keepdims=True) >= 0.0
    elbow_axis = np.where(same, axes[:, elbow], -axes[:, elbow])
    across = (hinge - ground) - axis * np.sum(axis * (hinge - ground), axis=1, keepdims=True)
    reach = np.linalg.norm(across, axis=1, keepdims=True)
    if reach.min() < 1e-9:
        names = f"{robot.joint_names[arm]} and {robot.joint_names[elbow]}"
        raise RobotError(
            f"the four-bar has an arm of {bar.arm * 1e3:g} mm, but the axes of {names} meet; check the joints"
        )
    forward = across / reach
    # the loop's angles grow with the joint that turns the arm, which may turn against its axis
    sense = float(np.sign(robot.joint_map.matrix[arm] @ drive.arm))

    def turned(about: Float[np.ndarray, "n 3"], angle: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n 3"]:
        """The way forward, which stands square on the axis, turned about it."""
        return np.cos(angle)[:, None] * forward + np.sin(angle)[:, None] * np.cross(about, forward)

    return LoopPins(
        ground=ground,
        crank=ground + bar.crank * turned(axis, sense * (kappa + bar.crank_angle - alpha)),
        rocker=hinge + bar.rocker * turned(elbow_axis, sense * (theta + bar.rocker_angle - alpha)),
        hinge=hinge,
        axis=axis,
        elbow_axis=elbow_axis,
    )
