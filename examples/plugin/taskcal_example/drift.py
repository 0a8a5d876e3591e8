"""An effect: zeros of joints that drift with the time since the robot began to work."""

from dataclasses import dataclass

import numpy as np

from taskcal.effects import Effect, LinearTerm, at_joints

HOUR = 3600.0
"""Seconds."""


@dataclass(frozen=True, kw_only=True)
class Drift(Effect):
    """Each joint's zero moves in proportion to the time."""

    key = "drift"
    label = "drift"
    summary = "zeros that drift with the time since the robot began to work"
    needs = ("time",)

    def term(self, robot) -> LinearTerm:
        """Parameters ``J1.drift`` …: by how much a zero moves in an hour, radians."""
        joints = self.chosen(robot)
        names = [f"{robot.joint_names[j]}.drift" for j in joints]

        def at_start(q):
            return np.zeros((len(q), len(joints)))

        def given(q, conditions):
            return at_start(q) if conditions.time is None else at_start(q) + conditions.time[:, None] / HOUR

        return at_joints(names, robot, np.array(joints), [self.tolerance] * len(names), at_start, given=given)
