"""The unit of short lengths on a page: one of them throughout."""

from dataclasses import dataclass


@dataclass(frozen=True)
class LengthUnit:
    """Millimetres or micrometres, and the digits that are worth reading."""

    name: str
    factor: float
    """From metres."""
    digits: int
    """Behind the point: a tenth of a micrometre for what was computed, a micrometre for what was measured."""


MILLIMETRES = LengthUnit("mm", 1e3, 3)
MICROMETRES = LengthUnit("µm", 1e6, 1)
