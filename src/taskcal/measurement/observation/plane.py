"""A plane that the tip of the tool touches: a surface plate, a machine table, the side of a block."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.measurement.observation.columns import ObservedColumns
from taskcal.measurement.observation.observation import (
    Differential,
    Measured,
    Placed,
    Read,
    Scene,
    Stated,
    refer,
)
from taskcal.measurement.observation.spots import spots
from taskcal.measurement.observation.touched_planes import Touches, to_one_side
from taskcal.measurement.observation.touching import Touching
from taskcal.robot.parameter import ShownUnit

HALF_WIDTH = 0.05
"""Of a plane in a virtual cell, metres."""

NARROW = 5e-3
"""Metres that touches of a plane must spread to both sides."""

UNIT_LENGTH = 1e-3
"""By how much a normal's length may differ from one, as good as not at all: it moves no prediction."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Planes(Touching):
    """0 = (m·p − d)/|m|: the tip p is on a plane of unknown normal m and offset d.

    Planes in three directions that are touched often enough tell all that sockets do, and like these not how large the robot is.
    A normal has three numbers and a length that is stated to be one, so that no plane is at the end of any coordinates.
    """

    key: ClassVar[str] = "plane"
    needed: ClassVar[tuple[str, ...]] = ("plane",)
    label: ClassVar[str] = "plane"
    instrument: ClassVar[str] = "plane"
    columns: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType({"plane": ("plane", "touched plane", "ebene")})
    units: ClassVar[Mapping[str, ShownUnit]] = MappingProxyType(dict.fromkeys(("nx", "ny", "nz"), ShownUnit("", 1.0)))
    things: ClassVar[str] = "planes"
    planes: tuple[str, ...]
    """Names."""

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Normal and offset of every plane."""
        return tuple(f"plane {name}.{c}" for name in self.planes for c in ("nx", "ny", "nz", "offset"))

    @property
    def tells_scale(self) -> bool:
        """No length is known."""
        return False

    @property
    def shrinks(self) -> bool:
        """A robot of no size touches every plane."""
        return True

    def differentiate(
        self, target: Float[np.ndarray, "n 4 4"], unknown: Float[np.ndarray, " u"], measured: Measured
    ) -> Differential:
        """Residual and derivatives."""
        n, k, x = len(target), self.numbers, target[:, :3, 3]
        normal, offset = np.split(unknown.reshape(-1, 4)[k], [3], axis=1)
        length = np.linalg.norm(normal, axis=1)[:, None]
        unit = normal / length
        off = ((normal * x).sum(axis=1, keepdims=True) - offset) / length
        by_target, by_unknown = np.zeros((n, 1, 6)), np.zeros((n, len(self.planes), 4))
        by_target[:, 0, :3] = unit
        by_unknown[np.arange(n), k] = np.concatenate([x - off * unit, -np.ones((n, 1))], axis=1) / length
        return Differential(-off, by_target, by_unknown.reshape(n, 1, -1))

    def place(self, tool: Float[np.ndarray, "n 4 4"], measured: Measured) -> Placed:
        """By the tip that leaves all touches nearest to planes; the planes follow from it.

        Raises:
            CampaignError: too few touches of a plane, or touches along a line.
        """
        seen = measured.valid
        touches = Touches(tool[seen, :3, :3], tool[seen, :3, 3], self.numbers[seen], self.planes)
        touches.check_count()
        t, weight = touches.find_tip()
        hidden = touches.hidden(t, weight)
        t = t - hidden @ t
        fitted = touches.planes(t, weight)
        for number in np.unique(touches.plane):
            if fitted.spread[number, 1] < NARROW:
                raise CampaignError(
                    f"plane '{self.planes[number]}' was touched along a line only; touch it at places to both sides too"
                )
        planes = np.where(np.isnan(fitted.planes), [0.0, 0.0, 1.0, 0.0], fitted.planes)  # of those that no row shows
        distance = np.zeros(len(tool))
        distance[seen] = np.abs(fitted.off)
        return Placed(se3.pose(np.eye(3), t), planes.reshape(-1), distance, hidden)

    def settle(
        self, target: Float[np.ndarray, "n 4 4"], measured: Measured, known: Float[np.ndarray, " u"]
    ) -> Float[np.ndarray, " u"]:
        """Each plane as its own rows say; NaN for those that fewer than three show.

        Raises:
            CampaignError: so few touch a plane that is not known.
        """
        seen = measured.valid
        touches = Touches(target[seen, :3, :3], target[seen, :3, 3], self.numbers[seen], self.planes)
        found = touches.planes(np.zeros(3), np.ones(int(seen.sum()))).planes
        for number in np.unique(touches.plane):
            if np.isnan(found[number]).any() and np.isnan(known[4 * number : 4 * number + 4]).any():
                raise CampaignError(
                    f"fewer than three touches of plane '{self.planes[number]}', which the calibration does not know, do not "
                    "tell where it is"
                )
        return found.reshape(-1)

    def stated(self, unknown: Float[np.ndarray, " u"]) -> Stated:
        """That normals have the length one."""
        count = len(self.planes)
        normal = unknown.reshape(-1, 4)[:, :3]
        length = np.linalg.norm(normal, axis=1)
        by_unknown = np.zeros((count, count, 4))
        by_unknown[np.arange(count), np.arange(count), :3] = normal / length[:, None]
        return Stated(1.0 - length, by_unknown.reshape(count, -1), np.full(count, UNIT_LENGTH))

    @classmethod
    def stage(cls, tool: Float[np.ndarray, "n 4 4"], places: int | None, rng: np.random.Generator) -> Scene:
        """Three planes that face different ways, each touched over a hand's breadth; the tip is at the tool point."""
        at = tool[spots(tool[:, :3, 3], places or 3), :3, 3]
        of = np.arange(len(tool)) % len(at)
        axes = to_one_side(se3.exp(rng.normal(size=3))[:, np.arange(len(at)) % 3].T)
        offset = (axes * at).sum(axis=1)
        aside = at[of] + rng.uniform(-HALF_WIDTH, HALF_WIDTH, (len(tool), 3))
        goals = aside + (offset[of] - (axes[of] * aside).sum(axis=1))[:, None] * axes[of]

        def approach(target: np.ndarray, rows: np.ndarray) -> np.ndarray:
            return se3.pose(target[:, :3, :3], goals[rows])

        names = tuple(str(number) for number in range(1, len(at) + 1))
        unknown = np.concatenate([axes, offset[:, None]], axis=1)
        return Scene(cls(planes=names, of=of), "tip", np.eye(4), unknown.reshape(-1), approach)

    @classmethod
    def read(cls, columns: ObservedColumns) -> Read | None:
        """A plane in every row where the tip touched one."""
        if "plane" not in columns:
            return None
        names, of = refer(columns.texts("plane"))
        points = np.where((of >= 0)[:, None], np.zeros(3), np.nan)
        return Read("tip", cls(planes=names, of=of), points) if names else None

    def cells(self, measured: Measured) -> dict[str, list[str]] | None:
        """Plane of every row."""
        return {"plane": self.labels(measured)}

    def describe(self) -> dict[str, Any]:
        """What a file holds of it."""
        return {"planes": list(self.planes)}

    @classmethod
    def of_description(cls, content: Mapping[str, Any]) -> "Planes":
        """What `describe` gave, without rows."""
        return cls(planes=tuple(content["planes"]))
