"""Mobility and overconstraint of the mechanism, from its joint graph and the screw system of its loop."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.errors import RobotError
from taskcal.geometry.four_bar import FourBar, can_close, close_four_bar
from taskcal.robot.joint_side import FourBarDrive
from taskcal.robot.robot import Robot


@dataclass(frozen=True, kw_only=True)
class Mechanism:
    """What the joint graph and the loop's screws say (Grübler–Kutzbach with the rank of each loop)."""

    bodies: int
    """The base included."""
    motorised: tuple[str, ...]
    passive: tuple[str, ...]
    loops: int
    """Independent loops: joints − bodies + 1."""
    loop_joints: tuple[str, ...]
    """Joints of the loop; empty for an open chain."""
    loop_rank: int
    """Dimension of the loop's screw system."""

    @property
    def mobility(self) -> int:
        """Degrees of freedom: joints less the loops' ranks."""
        return len(self.motorised) + len(self.passive) - self.loop_rank * self.loops

    @property
    def overconstraint(self) -> int:
        """Degree of overconstraint: closure conditions of the loops that its screws already satisfy."""
        return (6 - self.loop_rank) * self.loops

    @property
    def explanation(self) -> str:
        """Why some defects are parameters and others are not."""
        if not self.loops:
            return (
                f"an open chain of {len(self.motorised)} joints and {self.bodies} bodies: mobility {self.mobility}, nothing "
                "overconstrained, so all six defects of every joint frame are free"
            )
        return (
            f"{len(self.motorised)} motorised and {len(self.passive)} passive joints between {self.bodies} bodies make "
            f"{self.loops} loop, of joints {', '.join(self.loop_joints)}; their screws span {self.loop_rank} dimensions, so "
            f"mobility is {len(self.motorised) + len(self.passive)} − {self.loop_rank} = {self.mobility} and the loop is "
            f"overconstrained to degree 6 − {self.loop_rank} = {self.overconstraint}. It only assembles with its axes parallel, "
            "which manufacturing ensures: orientation defects between them are not modelled, the three lengths of the loop are"
        )


def analyse_mechanism(robot: Robot) -> Mechanism:
    """Mobility and overconstraint of a robot."""
    motorised = robot.joint_names
    drive = robot.four_bar
    if drive is None:
        return Mechanism(
            bodies=len(motorised) + 1, motorised=motorised, passive=(), loops=0, loop_joints=(), loop_rank=0
        )
    arm, crank = _turning(robot, drive.arm), _turning(robot, drive.crank)
    n = len(motorised)
    passive = tuple(f"J{n + 1 + i}" for i in range(3))
    # the forearm hangs on the arm by a passive joint, and is one body with the rocker; crank and rod are two more
    joints, bodies = n + 3, n + 3
    return Mechanism(
        bodies=bodies,
        motorised=motorised,
        passive=passive,
        loops=joints - bodies + 1,
        loop_joints=(arm, crank, *passive),
        loop_rank=int(np.linalg.matrix_rank(_loop_screws(drive), tol=1e-9)),
    )


def _turning(robot: Robot, coefficients: np.ndarray) -> str:
    """The joint whose motor gives an angle of the loop."""
    return robot.joint_names[int(np.argmax(np.abs(coefficients)))]


def _loop_screws(drive: FourBarDrive) -> Float[np.ndarray, "6 5"]:
    """Unit screws (ω, −ω × r) of the loop's five joints at an ordinary position, the loop's plane being x y."""
    bar = drive.bar
    alpha = 0.1
    kappa = _ordinary(bar, alpha)
    theta = float(close_four_bar(bar, np.array([alpha]), np.array([kappa])).angle[0])

    def at(length: float, angle: float) -> np.ndarray:
        return np.array([length * np.cos(angle), length * np.sin(angle), 0.0])

    elbow = at(bar.arm, alpha)
    points = [
        np.zeros(3),
        np.zeros(3),
        at(bar.crank, kappa + bar.crank_angle),
        elbow + at(bar.rocker, theta + bar.rocker_angle),
        elbow,
    ]
    axis = np.array([0.0, 0.0, 1.0])
    return np.array([np.concatenate([axis, np.cross(r, axis)]) for r in points]).T


def _ordinary(bar: FourBar, alpha: float) -> float:
    """A crank angle at which the loop closes, in the middle of the widest range of such.

    Raises:
        RobotError: it closes nowhere.
    """
    # a range may go on from half a turn to minus half a turn
    kappa = alpha + np.linspace(-np.pi, 3.0 * np.pi, 1441)
    closing = np.concatenate([[False], can_close(bar, np.full(len(kappa), alpha), kappa), [False]])
    first, end = np.flatnonzero(np.diff(closing)).reshape(-1, 2).T
    if not len(first):
        raise RobotError(f"the four-bar closes at no angle: {bar.describe(alpha, alpha)}; check the four lengths")
    widest = int(np.argmax(end - first))
    return float(kappa[(first[widest] + end[widest] - 1) // 2])
