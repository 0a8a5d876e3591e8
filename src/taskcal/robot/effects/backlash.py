"""Lost motion of drives."""

from dataclasses import dataclass

import numpy as np

from taskcal.robot.effects.effect import Effect
from taskcal.robot.effects.linear_term import LinearTerm
from taskcal.robot.effects.way_term import at_drives
from taskcal.robot.robot import Robot


@dataclass(frozen=True, kw_only=True)
class Backlash(Effect):
    """Lost motion: a joint stops elsewhere when its drive turned up to the pose than when it turned down to it.

    Without the ways in which a pose was approached, it is taken for the middle between both.
    """

    key = "backlash"
    label = "backlash"
    summary = "joints that stop elsewhere when they come from above than from below"
    uses = ("approach",)

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.backlash``, half the lost motion, radians: beyond the middle if positive, short of it if negative."""
        joints = np.array(self.chosen(robot), dtype=np.int64)
        names = [f"{robot.joint_names[j]}.backlash" for j in joints]
        units = ["m" if robot.prismatic[j] else "rad" for j in joints]
        return at_drives(names, units, robot, joints, self.tolerance, lambda conditions: conditions.approach)
