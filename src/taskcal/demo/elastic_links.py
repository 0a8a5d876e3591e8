"""Links that bend, twist and stretch under the weight they carry: what joints alone cannot yield to."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3, walk
from taskcal.geometry.chain import Chain, Fixed, Joint, Step
from taskcal.robot.effects.effect import Effect
from taskcal.robot.effects.linear_term import LinearTerm
from taskcal.robot.effects.load_path import LoadPath
from taskcal.robot.robot import Robot
from taskcal.robot.statics import STANDARD_GRAVITY

AXES = 6
"""Ways in which a link's end yields: along x, y, z and about them."""


@dataclass(frozen=True, kw_only=True)
class ElasticLinks(Effect, abstract=True):
    """The end of a link shifts by the force, and turns by the moment, that it carries there.

    For virtual robots only: it is not registered, so that no fit ever tries it.
    """

    turns: tuple[float, ...]
    """Of the ends of the first links, the stand before axis 1 being the first, radians per newton metre; with the bearing."""
    shifts: tuple[float, ...]
    """Of the same, metres per newton."""
    spread: float = 0.3
    """Standard deviation of both from robot to robot, as a share."""

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.turn`` and ``J2.shift``, of what carries axis 2: deviations from the stated compliance."""
        count, first = len(self.turns), len(robot.joints)
        names = [f"{robot.joint_names[link]}.{part}" for link in range(count) for part in ("shift", "turn")]
        nominal = np.stack([self.shifts, self.turns], axis=1).ravel()
        pairs = [(first + AXES * link + c, 2 * link + (c >= 3)) for link in range(count) for c in range(AXES)]
        return LinearTerm(
            names=tuple(names),
            units=("m/N", "rad/Nm") * count,
            tolerances=tuple((self.spread * nominal).tolist()),
            pairs=np.array(pairs),
            coordinates=first + AXES * count,
            basis=lambda q: carried(robot, count, q),
            nominal=nominal,
        )

    def extend(self, robot: Robot, steps: Sequence[Step]) -> tuple[Step, ...]:
        """Three slides and three turns before each of the first axes."""
        out: list[Step] = []
        link = 0
        for step in steps:
            if isinstance(step, Joint):
                if link < len(self.turns):
                    out += _yielding(len(robot.joints) + AXES * link)
                link += 1
            out.append(step)
        return tuple(out)


def carried(robot: Robot, count: int, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n columns"]:
    """Force and moment that the end of each of the first links carries, in the frame of the axis there, N and Nm."""
    coordinates = LoadPath.at(robot, q).coordinates
    steps: list[Step] = []
    ends: list[np.ndarray] = []
    bodies: list[tuple[float, np.ndarray]] = []

    def pose() -> Float[np.ndarray, "n 4 4"]:
        chain = Chain.of(steps)
        return walk.poses(chain, np.ascontiguousarray(coordinates[:, : chain.joints]), np.zeros((0, 6)))

    for joint, link in zip(robot.joints, robot.statics.links or (), strict=True):
        steps += [Fixed(part.transform) for part in joint.before]
        ends.append(pose())
        steps.append(Joint("prismatic" if joint.kind == "prismatic" else "revolute"))
        steps += [Fixed(part.transform) for part in joint.after]
        bodies.append((link.mass, se3.apply(pose(), np.array(link.centre))))
    steps += [Fixed(part.transform) for part in robot.flange]
    payload = robot.statics.payload
    bodies.append((payload.mass, se3.apply(pose(), np.array(payload.centre))))
    out: list[np.ndarray] = []
    for number, end in enumerate(ends[:count]):
        inward = np.swapaxes(end[:, :3, :3], 1, 2)
        force, moment = np.zeros((len(q), 3)), np.zeros((len(q), 3))
        for mass, centre in bodies[number:]:
            weight = mass * STANDARD_GRAVITY * robot.statics.gravity
            force += weight
            moment += np.cross(centre - end[:, :3, 3], weight)
        out += [np.einsum("nij,nj->ni", inward, force), np.einsum("nij,nj->ni", inward, moment)]
    return np.concatenate(out, axis=1)


def _yielding(first: int) -> list[Step]:
    """Slides along x, y and z, then turns about them, each in the frame where it stands."""
    turned_to_z = (se3.rotation("y", np.pi / 2), se3.rotation("x", -np.pi / 2), np.eye(4))
    steps: list[Step] = []
    for c in range(AXES):
        R = turned_to_z[c % 3]
        kind = "prismatic" if c < 3 else "revolute"
        steps += [Fixed(R), Joint(kind, first + c), Fixed(se3.inverse(R))]
    return steps
