"""How near a motion passes by its target, where it does not stop in it."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Zone:
    """Where on its path a motion may be left for the next one.

    The tool leaves the path where every size allows it, and at most half of the path before the target. With all sizes
    zero it goes through the target.
    """

    distance: float = 0.0
    """Of the tool point from the target along its path, metres."""
    turn_distance: float = 0.0
    """Of the tool point from the target where the orientation begins to change for the next motion, metres; it counts
    where it is more than `distance`."""
    angle: float = 0.0
    """Of the orientation from the target's, radians; it counts where the tool only turns."""
    share: float = math.inf
    """Of the motion's own length that is left."""

    @property
    def rounds(self) -> bool:
        """Whether the tool may pass by the target at all."""
        return min(max(self.distance, self.turn_distance, self.angle), self.share) > 0.0


THROUGH_TARGET = Zone()
"""Of motions that meet their targets."""
