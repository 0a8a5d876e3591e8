"""Accuracy and repeatability of the distance between two poses: ISO 9283:1998, clause 7.3."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.errors import CampaignError
from taskcal.short_repr import short_repr


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class DistancePerformance:
    """How the distance between two commanded positions was attained."""

    attained: Float[np.ndarray, " cycles"]
    """Attained distance D of each cycle, metres."""
    components: Float[np.ndarray, "cycles 3"]
    """Attained distances along the frame's axes, not negative, metres."""
    commanded: Float[np.ndarray, " 3"]
    """Commanded distances along the axes, not negative, metres."""

    @property
    def cycles(self) -> int:
        """How often both positions were measured."""
        return len(self.attained)

    @property
    def accuracy(self) -> float:
        """Distance accuracy AD_p: mean attained less commanded distance, metres (7.3.2)."""
        return float(self.attained.mean() - np.linalg.norm(self.commanded))

    @property
    def offset(self) -> Float[np.ndarray, " 3"]:
        """Distance accuracy along the axes AD_x, AD_y, AD_z, metres (7.3.2)."""
        return self.components.mean(axis=0) - self.commanded

    @property
    def repeatability(self) -> float | None:
        """Distance repeatability RD, which is to be read as ±, metres (7.3.3); None for a single cycle."""
        return float(3.0 * self.attained.std(ddof=1)) if self.cycles > 1 else None

    @property
    def axis_repeatability(self) -> Float[np.ndarray, " 3"] | None:
        """Distance repeatability along the axes RD_x, RD_y, RD_z, ±, metres (7.3.3)."""
        return 3.0 * self.components.std(axis=0, ddof=1) if self.cycles > 1 else None

    def summary(self) -> dict[str, float | int]:
        """What is known of it, in millimetres."""
        out: dict[str, float | int] = {"cycles": self.cycles, "AD_p_mm": self.accuracy * 1e3}
        out |= {f"AD_{axis}_mm": float(value) * 1e3 for axis, value in zip("xyz", self.offset, strict=True)}
        if self.repeatability is not None and self.axis_repeatability is not None:
            out["RD_p_mm"] = self.repeatability * 1e3
            repeatabilities = zip("xyz", self.axis_repeatability, strict=True)
            out |= {f"RD_{axis}_mm": float(value) * 1e3 for axis, value in repeatabilities}
        return out


def assess_distance(
    first: Float[np.ndarray, "cycles 3"],
    second: Float[np.ndarray, "cycles 3"],
    commanded_first: Float[np.ndarray, " 3"],
    commanded_second: Float[np.ndarray, " 3"],
) -> DistancePerformance:
    """Accuracy and repeatability of the distance between two positions (ISO 9283:1998, 7.3.2 and 7.3.3).

    It needs no common frame of measurements and commands, but for the components along the axes.

    Args:
        first: measured first positions, a row for each cycle, metres.
        second: measured second positions, of the same cycles, metres.
        commanded_first: commanded first position, metres.
        commanded_second: commanded second position, metres.

    Raises:
        CampaignError: there is no cycle.
    """
    if not len(first):
        raise CampaignError("a distance needs at least one cycle in which both positions were measured")
    apart = first - second
    return DistancePerformance(
        attained=np.linalg.norm(apart, axis=1),
        components=np.abs(apart),
        commanded=np.abs(commanded_first - commanded_second),
    )
