"""What is known of a datum cube."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from taskcal.measurement.observation.columns import ObservedColumns


@dataclass(frozen=True, kw_only=True)
class CubeSize:
    """What is known of a cube."""

    name: str
    edge: float
    """Distance of opposite faces, metres."""
    tip: float
    """Radius of the ball that touches it, metres; zero for a point."""


def sizes_of(columns: ObservedColumns, cubes: Sequence[str]) -> tuple[CubeSize, ...]:
    """What the rows say of every cube.

    Raises:
        FileError: they do not say the same, or no length.
    """
    edge = columns.lengths("edge")
    tip = columns.lengths("tip") if "tip" in columns else np.zeros(len(edge))
    out: dict[str, CubeSize] = {}
    for row, name in enumerate(cubes):
        if not name:
            continue
        if not edge[row] > 0.0:
            raise columns.error("give the distance of opposite faces, such as 100", row, "edge")
        size = CubeSize(name=name, edge=float(edge[row]), tip=float(np.nan_to_num(tip[row])))
        if size.tip < 0.0:
            raise columns.error("give the radius of the ball that touches, zero for a point", row, "tip")
        if out.setdefault(name, size) != size:
            raise columns.error(f"cube '{name}' has another edge or tip in a row above; give one of them", row, "edge")
    return tuple(out.values())
