"""What was measured of the tools and parts that programs speak of."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from taskcal.correction.external_axis import ExternalAxis
from taskcal.short_repr import short_repr


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Measured:
    """What is known of one tool or part beside the controller's value; at most one of the ways to know it."""

    name: str
    """As programs call it."""
    controller: Float[np.ndarray, "4 4"] | None = None
    """The controller's value, for programs that declare no frames."""
    in_tracker: Float[np.ndarray, "4 4"] | None = None
    """Pose in the tracker's frame of the calibration, of what stands still."""
    touched: Float[np.ndarray, "k joints"] | None = None
    """Joint positions at which the robot touched the points from which the controller's frame was set, radians."""
    touched_with: str = ""
    """Tool that touched them."""
    in_flange: Float[np.ndarray, "4 4"] | None = None
    """True pose in the flange, of what the robot holds."""
    in_target: Float[np.ndarray, "4 4"] | None = None
    """Pose in the frame whose poses were measured, of what the robot holds."""
    reflectors: Mapping[str, Float[np.ndarray, " 3"]] = field(default_factory=dict[str, np.ndarray])
    """Centres of the calibration's reflectors in the frame of what the robot holds, metres."""
    uncertainty: float = 0.0
    """Standard uncertainty of what was measured, per axis, metres: of each reflector's centre, of the position, or of one touch."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Cell:
    """Tools and parts by name, letter case aside."""

    tools: Mapping[str, Measured] = field(default_factory=dict[str, Measured])
    parts: Mapping[str, Measured] = field(default_factory=dict[str, Measured])
    T_world_base: Float[np.ndarray, "4 4"] | None = None
    """Where the robot stands in the world, with all external axes at zero; None where it is not stated."""
    axes: tuple[ExternalAxis, ...] = ()
    """External axes, by number."""

    def tool(self, name: str) -> Measured:
        """What was measured of a tool."""
        return self.tools.get(name.casefold(), Measured(name=name))

    def part(self, name: str) -> Measured:
        """What was measured of a part."""
        return self.parts.get(name.casefold(), Measured(name=name))
