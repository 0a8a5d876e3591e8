"""Lost motion of drives."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.robot.approach import own_sense
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects.effect import Effect
from taskcal.robot.effects.linear_term import LinearTerm
from taskcal.robot.effects.load_path import drive
from taskcal.robot.robot import Robot


@dataclass(frozen=True, kw_only=True)
class Backlash(Effect):
    """Lost motion: a joint stops elsewhere when its drive turned up to the pose than when it turned down to it.

    Without the ways in which a pose was approached, it is taken for the middle between both.
    """

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.backlash``, half the lost motion, radians: beyond the middle if positive, short of it if negative."""
        joints = np.array(self.chosen(robot), dtype=np.int64)
        turned = drive(robot) if robot.four_bar is not None else np.diag(own_sense(robot))
        parameter, coordinate = np.nonzero(turned[:, joints].T)
        gear = turned[coordinate, joints[parameter]]

        def middle(q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n pairs"]:
            return np.zeros((len(q), len(gear)))

        def given(q: Float[np.ndarray, "n joints"], conditions: Conditions) -> Float[np.ndarray, "n pairs"]:
            return middle(q) if conditions.approach is None else conditions.approach[:, joints[parameter]] * gear

        return LinearTerm(
            names=tuple(f"{robot.joint_names[j]}.backlash" for j in joints),
            units=tuple("m" if robot.prismatic[j] else "rad" for j in joints),
            tolerances=(self.tolerance,) * len(joints),
            pairs=np.stack([coordinate, parameter], axis=1),
            coordinates=len(robot.joints),
            basis=middle,
            given=given,
        )
