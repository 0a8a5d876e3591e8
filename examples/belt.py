"""A user-defined effect: toothed belts with an error once per revolution of the belt."""

from dataclasses import dataclass

import numpy as np

from taskcal.effects import Effect, LinearTerm, at_joints


@dataclass(frozen=True, kw_only=True)
class Belt(Effect):
    """Belts between motor and gear, with an error of a cosine and a sine of their own angle."""

    key = "belt"  # on the command line
    label = "belt"  # in tables and reports
    summary = "toothed belts: periodic error, once per revolution of the belt"

    rounds: float = 6.5
    """Revolutions of the belt per turn of the joint."""

    def term(self, robot) -> LinearTerm:
        """Parameters ``J2.belt_cos``, ``J2.belt_sin`` …, radians."""
        joints = self.chosen(robot)

        def turns(q):
            angle = self.rounds * robot.joint_map(q)[:, joints]
            return np.concatenate([np.cos(angle), np.sin(angle)], axis=1)

        names = [f"{robot.joint_names[j]}.belt_{part}" for part in ("cos", "sin") for j in joints]
        return at_joints(names, robot, np.array([*joints, *joints]), [self.tolerance] * len(names), turns)
