"""What is left of the last move."""

from dataclasses import dataclass

import numpy as np

from taskcal.robot.effects.effect import Effect
from taskcal.robot.effects.linear_term import LinearTerm
from taskcal.robot.effects.way_term import at_drives
from taskcal.robot.robot import Robot


@dataclass(frozen=True, kw_only=True)
class Settling(Effect):
    """A rest of the last move, in proportion to it: a joint that creeps, or that is read before it has come to rest.

    Without the moves that led to the poses, they are taken for settled.
    """

    key = "settling"
    label = "settling"
    summary = "joints that keep a small rest of the last move, in proportion to its length"
    uses = ("move",)

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.settling``, radians per radian: beyond the end of the move if positive, short of it if negative."""
        joints = np.array(self.chosen(robot), dtype=np.int64)
        names = [f"{robot.joint_names[j]}.settling" for j in joints]
        units = ["m/m" if robot.prismatic[j] else "rad/rad" for j in joints]
        return at_drives(names, units, robot, joints, self.tolerance, lambda conditions: conditions.move)
