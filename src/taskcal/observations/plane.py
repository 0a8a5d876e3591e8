"""A plane that the tip of the tool touches: a surface plate, a machine table, the side of a block."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.observations.base import Differential, Measured, ObservedColumns, Read, Scene, Stated, refer, spots
from taskcal.observations.standalone import TIPS, Found, Search, Standalone
from taskcal.robot.parameter import ShownUnit

FEWEST = 4
"""Touches of a plane, to find it: three tell the plane, one more what else is unknown."""


def to_one_side(normals: Float[np.ndarray, "planes 3"]) -> Float[np.ndarray, "planes 3"]:
    """Choose of each plane's two normals the one whose largest coordinate is positive."""
    return normals * np.sign(np.take_along_axis(normals, np.abs(normals).argmax(axis=1)[:, None], axis=1))


class FittedPlanes(NamedTuple):
    """Planes of the smallest distances from places of a tip."""

    planes: Float[np.ndarray, "planes 4"]
    """Normal and offset; NaN for planes of fewer than three touches."""
    middle: Float[np.ndarray, "planes 3"]
    """Mean of the touches of each."""
    spread: Float[np.ndarray, "planes 3"]
    """How far these are spread, root mean square, metres: off the plane, and in it the narrow and the wide way."""


def fit_planes(
    x: Float[np.ndarray, "n 3"], numbers: Int[np.ndarray, " n"], count: int, weight: Float[np.ndarray, " n"]
) -> FittedPlanes:
    """Fit planes to places of the tip by weighted least squares.

    Args:
        x: places, metres.
        numbers: of the plane that is touched at each.
        count: number of planes.
        weight: of each place.
    """
    share = (np.arange(count)[:, None] == numbers) * weight
    share = share / np.maximum(share.sum(axis=1), 1e-300)[:, None]
    middle = share @ x
    apart = x - middle[numbers]
    square = (share @ (apart[:, :, None] * apart[:, None, :]).reshape(-1, 9)).reshape(-1, 3, 3)
    values, vectors = np.linalg.eigh(square)
    normal = to_one_side(vectors[:, :, 0])
    planes = np.concatenate([normal, (normal * middle).sum(axis=1, keepdims=True)], axis=1)
    planes[np.bincount(numbers, minlength=count) < 3] = np.nan
    return FittedPlanes(planes, middle, np.sqrt(np.maximum(values, 0.0)))


# What planes and cubes have in common: a touch is one number, that nothing is left between the tip and a face.


class Touching(Standalone):
    """A kind whose rows are touches of faces."""

    width: ClassVar[int] = 1
    touched: ClassVar[bool] = True
    resolution: ClassVar[float] = 2e-5  # what a touch trigger probe repeats within
    rows_to_judge: ClassVar[int] = FEWEST


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
    each: ClassVar[tuple[str, ...]] = ("nx", "ny", "nz", "offset")
    instrument: ClassVar[str] = "plane"
    columns: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType({"plane": ("plane", "touched plane", "ebene")})
    units: ClassVar[Mapping[str, ShownUnit]] = MappingProxyType(dict.fromkeys(("nx", "ny", "nz"), ShownUnit("", 1.0)))
    things: ClassVar[str] = "planes"
    planes: tuple[str, ...]
    """Names."""

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

    def check(self, rows: Search) -> None:
        """Raise a `CampaignError` where a plane was touched too seldom to be found."""
        for name, count in zip(self.planes, rows.counts, strict=True):
            if 0 < count < FEWEST:
                raise CampaignError(
                    f"{count} touches of plane '{name}' do not tell where it is; touch it {FEWEST} times or more"
                )

    def starts(self, rows: Search) -> Iterable[Float[np.ndarray, " x"]]:
        """Several places on the tool, and the planes that fit there."""
        for tip in TIPS:
            x, even = rows.tool[:, :3, 3] + rows.tool[:, :3, :3] @ tip, np.ones(len(rows.tool))
            planes = fit_planes(x, rows.numbers, len(self.planes), even).planes
            yield rows.about(se3.translation(*tip), planes.reshape(-1))

    def find(self, tool: Float[np.ndarray, "n 4 4"], measured: Measured) -> Found:
        """Find tip and planes.

        Raises:
            CampaignError: too few touches of a plane, or touches along a line.
        """
        found = super().find(tool, measured)
        rows = found.rows
        x = (rows.tool @ rows.target(found.x))[:, :3, 3]
        narrow = fit_planes(x, rows.numbers, len(self.planes), found.weight).spread[:, 1]
        for number in np.unique(rows.numbers):
            if narrow[number] < NARROW:
                raise CampaignError(
                    f"plane '{self.planes[number]}' was touched along a line only; touch it at places to both sides too"
                )
        return found

    def settle(
        self, target: Float[np.ndarray, "n 4 4"], measured: Measured, known: Float[np.ndarray, " u"]
    ) -> Float[np.ndarray, " u"]:
        """Each plane as its own rows say; NaN for those that fewer than three show.

        Raises:
            CampaignError: so few touch a plane that is not known.
        """
        seen = measured.valid
        numbers = self.numbers[seen]
        found = fit_planes(target[seen, :3, 3], numbers, len(self.planes), np.ones(len(numbers))).planes
        for number in np.unique(numbers):
            if np.isnan(found[number]).any() and np.isnan(known[4 * number : 4 * number + 4]).any():
                raise CampaignError(
                    f"fewer than three touches of plane '{self.planes[number]}', which the calibration does not know, do not "
                    "tell where it is"
                )
        return found.reshape(-1)

    def stated(self, unknown: Float[np.ndarray, " u"]) -> Stated:
        """Condition that normals have unit length."""
        count = len(self.planes)
        normal = unknown.reshape(-1, 4)[:, :3]
        length = np.linalg.norm(normal, axis=1)
        by_unknown = np.zeros((count, count, 4))
        by_unknown[np.arange(count), np.arange(count), :3] = normal / length[:, None]
        return Stated(1.0 - length, by_unknown.reshape(count, -1), np.full(count, UNIT_LENGTH))

    @classmethod
    def stage(cls, tool: Float[np.ndarray, "n 4 4"], places: int | None, rng: np.random.Generator) -> Scene:
        """Three planes that face different ways, each touched over a hand's breadth; the tip is at the TCP."""
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
