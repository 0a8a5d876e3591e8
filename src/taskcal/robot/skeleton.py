"""A robot as lines: where its joints are at some poses, and the way of its links from joint to joint, to be drawn."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.geometry.chain import JointKind
from taskcal.geometry.four_bar import close_four_bar
from taskcal.robot.loop_pins import find_loop_pins
from taskcal.robot.robot import Part, Robot


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

    Args:
        robot: the robot.
        q: joint positions, radians (metres where a joint slides).

    Raises:
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    q = np.asarray(q, dtype=float)
    s = robot.joint_map(q)
    if robot.four_bar is not None:
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
