"""An effect of one's own: toothed belts that err once in each of their own rounds."""

from dataclasses import dataclass

import numpy as np

from taskcal.effects import Effect, LinearTerm, at_joints


@dataclass(frozen=True, kw_only=True)
class Belt(Effect):
    """Belts between motor and gear, which err by a cosine and a sine of how far they have run."""

    key = "belt"  # on the command line
    label = "belt"  # in tables and reports
    summary = "toothed belts that err once in each of their own rounds"

    rounds: float = 6.5
    """Of the belt in a turn of the joint."""

    def term(self, robot) -> LinearTerm:
        """Parameters ``J2.belt_cos``, ``J2.belt_sin`` …, radians."""
        joints = self.chosen(robot)

        def turns(q):
            angle = self.rounds * robot.joint_map(q)[:, joints]
            return np.concatenate([np.cos(angle), np.sin(angle)], axis=1)

        names = [f"{robot.joint_names[j]}.belt_{part}" for part in ("cos", "sin") for j in joints]
        return at_joints(names, robot, np.array([*joints, *joints]), [self.tolerance] * len(names), turns)
