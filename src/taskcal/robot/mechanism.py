"""Mobility and overconstraint of the mechanism, from its joint graph and the screw system of its loop."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.errors import RobotError
from taskcal.geometry.four_bar import FourBar, can_close
from taskcal.robot.joint_side import FourBarDrive
from taskcal.robot.loop_pins import find_loop_pins
from taskcal.robot.robot import Robot
from taskcal.robot.skeleton import trace_skeleton

SINGULAR_SHARE = 1e-9
"""Of the largest singular value of a loop's screws: what is below it is rounding."""


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
    driven: tuple[str, ...] = ()
    """Joints that a linkage moves with others; their loops are not modelled."""
    fixed_orientations: int = 0
    """Relative rotations of the loop's bodies that it closes whatever its joints do: orientation defects left unmodelled."""
    fixed_positions: int = 0
    """The same of relative translations: position defects left unmodelled."""

    @property
    def mobility(self) -> int:
        """Degrees of freedom: joints less the loops' ranks."""
        return len(self.motorised) + len(self.passive) - self.loop_rank * self.loops

    @property
    def overconstraint(self) -> int:
        """Degree of overconstraint: closure conditions of the loops that its screws already satisfy."""
        return (6 - self.loop_rank) * self.loops

    @property
    def _linkage(self) -> str:
        if not self.driven:
            return ""
        return f"; {', '.join(self.driven)} {'moves' if len(self.driven) == 1 else 'move'} with others by a linkage without play"

    @property
    def explanation(self) -> str:
        """Why some defects are parameters and others are not."""
        if not self.loops:
            return (
                f"an open chain of {len(self.motorised)} joints and {self.bodies} bodies: mobility {self.mobility}, nothing "
                f"overconstrained, so all six defects of every joint frame are free{self._linkage}"
            )
        return (
            f"{len(self.motorised)} motorised and {len(self.passive)} passive joints between {self.bodies} bodies make "
            f"{self.loops} loop, of joints {', '.join(self.loop_joints)}; their screws span {self.loop_rank} dimensions, so "
            f"mobility is {len(self.motorised) + len(self.passive)} − {self.loop_rank} = {self.mobility} and the loop is "
            f"overconstrained to degree 6 − {self.loop_rank} = {self.overconstraint}. It only assembles because manufacturing "
            f"ensures that its axes stay true in {self.fixed_orientations} relative rotations and "
            f"{self.fixed_positions} relative translations: these defects are not modelled, the three lengths of the loop are"
        )


@dataclass(frozen=True, kw_only=True)
class LoopFreedom:
    """What the screws of one closed chain leave free, and what they close whatever the joints do."""

    rank: int
    """Dimension of the screw system."""
    fixed_orientations: int
    """Rotations between its bodies that no joint of it can make."""
    fixed_positions: int
    """Translations that no joint of it can make, at its first joint."""

    @property
    def overconstraint(self) -> int:
        """Closure conditions that hold whatever the joints do: as many defects would keep it from being assembled."""
        return 6 - self.rank

    @staticmethod
    def of(screws: Float[np.ndarray, "6 n"]) -> "LoopFreedom":
        """Of any closed chain, from the unit screws (ω, v) of its joints, metres."""
        values = np.linalg.svd(screws, compute_uv=False)
        rank = int((values > SINGULAR_SHARE * values[0]).sum())
        orientations = 3 - int(np.linalg.matrix_rank(screws[:3], tol=SINGULAR_SHARE * values[0]))
        return LoopFreedom(rank=rank, fixed_orientations=orientations, fixed_positions=6 - rank - orientations)


def analyse_mechanism(robot: Robot) -> Mechanism:
    """Mobility and overconstraint of a robot, its loop at a posture where it closes.

    Raises:
        RobotError: the loop closes nowhere, or the robot's axes leave no arm between them.
    """
    motorised = robot.joint_names
    drive = robot.four_bar
    if drive is None:
        return Mechanism(
            bodies=len(motorised) + len(robot.driven) + 1,
            motorised=motorised,
            passive=(),
            loops=0,
            loop_joints=(),
            loop_rank=0,
            driven=tuple(joint.name for joint in robot.driven),
        )
    arm, crank = _turning(robot, drive.arm), _turning(robot, drive.crank)
    n = len(motorised)
    passive = tuple(f"J{n + 1 + i}" for i in range(3))
    # the forearm hangs on the arm by a passive joint, and is one body with the rocker; crank and rod are two more
    joints, bodies = n + 3, n + 3
    freedom = LoopFreedom.of(loop_screws(robot, drive))
    return Mechanism(
        bodies=bodies,
        motorised=motorised,
        passive=passive,
        loops=joints - bodies + 1,
        loop_joints=(arm, crank, *passive),
        loop_rank=freedom.rank,
        fixed_orientations=freedom.fixed_orientations,
        fixed_positions=freedom.fixed_positions,
    )


def _turning(robot: Robot, coefficients: np.ndarray) -> str:
    """The joint whose motor gives an angle of the loop."""
    return robot.joint_names[int(np.argmax(np.abs(coefficients)))]


def screw(axis: Float[np.ndarray, " 3"], point: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 6"]:
    """Unit screw (ω, −ω × r) of a revolute joint, from its axis and a point of it, metres."""
    return np.concatenate([axis, np.cross(point, axis)])


def loop_screws(robot: Robot, drive: FourBarDrive) -> Float[np.ndarray, "6 5"]:
    """Screws of the loop's five joints: arm and elbow as the robot's chain has them, crank and pins by the loop's lengths.

    The crank turns about the arm's axis; its pin is parallel to that, the rocker's to the elbow's axis.
    """
    alpha = float(robot.limits.mean(axis=1) @ drive.arm) if np.isfinite(robot.limits).all() else 0.0
    kappa = _ordinary(drive.bar, alpha)
    q = np.linalg.pinv(np.stack([drive.arm, drive.crank])) @ np.array([alpha, kappa])
    skeleton = trace_skeleton(robot, q[None])
    pins = find_loop_pins(robot, q[None], skeleton.origins, skeleton.axes)
    ground = pins.ground[0]
    directed = [(pins.axis, pins.ground)] * 2
    directed += [(pins.axis, pins.crank), (pins.elbow_axis, pins.rocker), (pins.elbow_axis, pins.hinge)]
    return np.stack([screw(direction[0], point[0] - ground) for direction, point in directed], axis=1)


def _ordinary(bar: FourBar, alpha: float) -> float:
    """A crank angle at which the loop closes, a third into the widest range of such: in its middle levers may stand square.

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
    return float(kappa[(2 * first[widest] + end[widest] - 1) // 3])
