"""Joints that move a little with others."""

from dataclasses import dataclass

import numpy as np

from taskcal.errors import TaskcalError, UnknownName
from taskcal.geometry import se3
from taskcal.robot.effects.base import Effect, LinearTerm, at_joints
from taskcal.robot.robot import Robot

MEETING_DISTANCE = 1e-6
"""Distance under which axes meet, metres."""


@dataclass(frozen=True, kw_only=True)
class Coupling(Effect):
    """A share of one joint's motion that another makes too: wrists whose drives run through each other.

    By default the robot's last three joints: the middle one by the first, the last one by both. Of a shaft that slides and turns,
    as at the end of a SCARA, the slide by the turn: the nut of its screw stands still while the shaft turns in it.
    """

    key = "coupling"
    label = "coupling"
    asks_for = "the last three axes do not meet in a point, and the last joints are not of one shaft"
    summary = "joints of the wrist that move a little by each other"

    pairs: tuple[tuple[str, str], ...] | None = None
    """Names of the joint that drives and of the joint that it moves; those of the wrist by default."""

    def suits(self, robot: Robot) -> bool:
        """Whether its last three axes meet in a point, or its last joints are of one shaft: such drives run through each other."""
        if _shaft(robot) is not None:
            return True
        return len(robot.joints) > 2 and not any(robot.prismatic[-3:]) and _meet(robot)

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J5.by_J4`` …, a share of the motion that drives, with `tolerance` as standard deviation.

        Raises:
            UnknownName: a joint that the robot does not have.
            TaskcalError: a joint moved by itself, or a robot without a wrist.
        """
        names, moved = robot.joint_names, self.chosen(robot)
        pairs = [(drives, moves) for drives, moves in self._pairs(robot) if moves in moved]
        for i, j in pairs:
            if i == j:
                raise TaskcalError(f"{names[j]} cannot be coupled to itself: name two different joints")
        by = np.array([i for i, _ in pairs], dtype=np.int64)
        middle = robot.joint_map(np.zeros((1, len(names))))[0]
        return at_joints(
            [f"{names[j]}.by_{names[i]}" for i, j in pairs],
            robot,
            np.array([j for _, j in pairs], dtype=np.int64),
            [self.tolerance] * len(pairs),
            lambda q: (robot.joint_map(q) - middle)[:, by],
            by_joint=lambda q: np.broadcast_to(robot.joint_map.matrix[by], (len(q), *robot.joint_map.matrix[by].shape)),
            share=by,
        )

    def _pairs(self, robot: Robot) -> list[tuple[int, int]]:
        names = robot.joint_names
        if self.pairs is None:
            last, shaft = len(names) - 1, _shaft(robot)
            if shaft is not None:
                return [shaft]
            if last < 2:
                raise TaskcalError(
                    f"{robot.name} has no wrist of three joints; name the pairs of joints that are coupled"
                )
            return [(last - 2, last - 1), (last - 2, last), (last - 1, last)]
        for name in (name for pair in self.pairs for name in pair):
            if name not in names:
                raise UnknownName("joint", name, names, f"of {robot.name}")
        return [(names.index(drives), names.index(moves)) for drives, moves in self.pairs]


def _shaft(robot: Robot) -> tuple[int, int] | None:
    """The turn and the slide of the last two joints, where they lie along each other; None where they do not."""
    last = len(robot.joints) - 1
    if last < 1 or robot.prismatic[last] == robot.prismatic[last - 1]:
        return None
    between = np.eye(4)
    for part in (*robot.joints[last - 1].after, *robot.joints[last].before):
        between = between @ part.transform
    if abs(between[2, 2]) < 1.0 - MEETING_DISTANCE:
        return None
    return (last - 1, last) if robot.prismatic[last] else (last, last - 1)


def _meet(robot: Robot) -> bool:
    """Whether a point lies on the last three axes; by least squares over their lines."""
    pose, normal, right = np.eye(4), np.zeros((3, 3)), np.zeros(3)
    left: list[tuple[np.ndarray, np.ndarray]] = []
    for i, joint in enumerate(robot.joints):
        for part in joint.before:
            pose = pose @ part.transform
        if i >= len(robot.joints) - 3:
            across = np.eye(3) - np.outer(pose[:3, 2], pose[:3, 2])
            left.append((across, pose[:3, 3]))
            normal += across
            right += across @ pose[:3, 3]
        pose = pose @ se3.rotation("z", 0.7)  # away from where axes line up
        for part in joint.after:
            pose = pose @ part.transform
    point = np.linalg.lstsq(normal, right, rcond=None)[0]
    return all(float(np.linalg.norm(across @ (point - origin))) < MEETING_DISTANCE for across, origin in left)
