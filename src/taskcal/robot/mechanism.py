"""Mobility and overconstraint of the mechanism, from its joint graph and the screw system of its loop."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.errors import RobotError
from taskcal.geometry import se3
from taskcal.geometry.four_bar import FourBar, can_close, close_four_bar
from taskcal.kernels.chain import JointKind
from taskcal.robot.joint_side import FourBarDrive
from taskcal.robot.robot import Part, Robot

# Where the pins of a closed loop are, in the robot's base.


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


# A robot as lines: where its joints are at some poses, and the way of its links from joint to joint, to be drawn.


@dataclass(frozen=True, eq=False, kw_only=True)
class Skeleton:
    """Lines of the nominal robot in its base, metres."""

    links: tuple[Float[np.ndarray, "n _ 3"], ...]
    """Corners of every body from the base on: to the first joint, from joint to joint, and from the last one to the tool."""
    origins: Float[np.ndarray, "n joints 3"]
    """A point of every joint's axis."""
    axes: Float[np.ndarray, "n joints 3"]
    """Directions of these."""
    loop: tuple[Float[np.ndarray, "n _ 3"], ...]
    """Crank, rod and rocker of a closed loop; empty for an open chain."""
    tool: Float[np.ndarray, "n 4 4"]
    """Poses of the tool."""


def trace_skeleton(robot: Robot, q: Float[np.ndarray, "n joints"]) -> Skeleton:
    """The lines of a robot at some poses.

    Raises:
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    q = np.asarray(q, dtype=float)
    s = robot.joint_map(q)
    if robot.four_bar is not None:  # drawn also where it folded over
        drive, kappa = robot.four_bar, q @ robot.four_bar.crank
        s = s + (close_four_bar(drive.bar, q @ drive.arm, kappa).angle - kappa)[:, None] * drive.output
    T = np.broadcast_to(np.eye(4), (len(q), 4, 4))
    corners = [T[:, :3, 3]]
    links: list[np.ndarray] = []
    origins: list[np.ndarray] = []
    axes: list[np.ndarray] = []

    def walk(parts: Iterable[Part]) -> None:
        nonlocal T
        for part in parts:
            T = T @ (part.transform if part.driven is None else _moved(part.driven.kind, s[:, part.driven.number]))
            corners.append(T[:, :3, 3])

    for number, joint in enumerate(robot.joints):
        walk(joint.before)
        links.append(np.stack(corners, axis=1))
        origins.append(T[:, :3, 3])
        axes.append(T[:, :3, 2])
        corners = [T[:, :3, 3]]
        T = T @ _moved(joint.kind, s[:, number])
        if joint.kind == "prismatic":
            corners.append(T[:, :3, 3])
        walk(joint.after)
    walk(robot.tool)
    links.append(np.stack(corners, axis=1))
    at, along = np.stack(origins, axis=1), np.stack(axes, axis=1)
    loop: tuple[np.ndarray, ...] = ()
    if robot.four_bar is not None:
        pins = find_loop_pins(robot, q, at, along)
        bars = ((pins.ground, pins.crank), (pins.crank, pins.rocker), (pins.rocker, pins.hinge))
        loop = tuple(np.stack(ends, axis=1) for ends in bars)
    return Skeleton(links=tuple(links), origins=at, axes=along, loop=loop, tool=np.array(T))


def _moved(kind: JointKind, s: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n 4 4"]:
    """Turned about, or moved along, the local z axis."""
    along = np.stack([np.zeros_like(s), np.zeros_like(s), s], axis=1)
    turns = kind == "revolute"
    return se3.pose(se3.exp(along if turns else 0.0 * along), 0.0 * along if turns else along)


MAX_ROUNDING_SHARE = 1e-9
"""Of the largest singular value of a loop's screws: what is below it is rounding."""


@dataclass(frozen=True, kw_only=True)
class Mechanism:
    """Mobility of a mechanism by its joint graph and loop screws (Grübler–Kutzbach with the rank of each loop)."""

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
    """Freedoms of one closed chain, and its overconstrained directions."""

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
        """The freedom of a closed chain, from the unit screws (ω, v) of its joints, metres."""
        values = np.linalg.svd(screws, compute_uv=False)
        rank = int((values > MAX_ROUNDING_SHARE * values[0]).sum())
        orientations = 3 - int(np.linalg.matrix_rank(screws[:3], tol=MAX_ROUNDING_SHARE * values[0]))
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
