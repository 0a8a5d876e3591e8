"""What is left of the speed at which each drive came."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.robot.approach import MAX_REST_MOTION
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects.effect import Effect
from taskcal.robot.effects.linear_term import LinearTerm
from taskcal.robot.effects.way_term import at_drives
from taskcal.robot.robot import Robot


@dataclass(frozen=True, kw_only=True)
class Overshoot(Effect):
    """A rest of the last move in proportion to the speed at which the joint came to its end.

    The drives of a synchronised move start and stop together, so that their speeds are to each other as their moves. The
    one that turns farthest sets the pace, whatever the length of its move.
    Without the moves that led to the poses, they are taken for settled.
    """

    key = "overshoot"
    label = "overshoot"
    summary = "joints that keep a small rest of the last move, in proportion to the speed at which they came"
    uses = ("move",)

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.overshoot``, radians where the joint sets the pace: beyond the end if positive, short of it if not."""
        joints = np.array(self.chosen(robot), dtype=np.int64)
        names = [f"{robot.joint_names[j]}.overshoot" for j in joints]
        units = ["m" if robot.prismatic[j] else "rad" for j in joints]
        return at_drives(names, units, robot, joints, self.tolerance, _pace)


def _pace(conditions: Conditions) -> Float[np.ndarray, "n joints"] | None:
    """Each drive's move as a share of the largest, with its sign; radians and metres count alike."""
    if conditions.move is None:
        return None
    farthest = np.abs(conditions.move).max(axis=1, keepdims=True)
    return np.divide(conditions.move, farthest, out=np.zeros_like(conditions.move), where=farthest > MAX_REST_MOTION)
