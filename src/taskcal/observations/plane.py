"""A plane that the tip of the tool touches: a surface plate, a machine table, the side of a block."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.observations.base import (
    Differential,
    Measured,
    ObservedColumns,
    Placed,
    Read,
    Scene,
    Standalone,
    Stated,
    TrackerNoise,
    refer,
    spots,
    unlocated,
)
from taskcal.robot.parameter import ShownUnit

# Which planes a tip touched, and where the tip is on the tool, from poses of the tool alone.

FEWEST = 4
"""Touches of a plane, to find it: three tell the plane, one more what else is unknown."""

TIPS = 0.15 * np.array([[0, 0, 0], [0, 0, 1], [0, 0, -1], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]], dtype=float)
"""Where the tip may be, to start a search from, metres from the tool point."""

ROUNDS = 8
"""Of reweighting, after which rows that disagree hardly count."""

FAR = 10.0
"""Times the median distance, from which on a row disagrees."""

SAME_PLACE = 1e-9
"""Precision that holds the tip near where its search starts, where the rows do not tell."""


def to_one_side(normals: Float[np.ndarray, "planes 3"]) -> Float[np.ndarray, "planes 3"]:
    """Choose of each plane's two normals the one whose largest coordinate is positive."""
    return normals * np.sign(np.take_along_axis(normals, np.abs(normals).argmax(axis=1)[:, None], axis=1))


class FittedPlanes(NamedTuple):
    """Planes of the smallest distances from the touches, the tip held."""

    planes: Float[np.ndarray, "planes 4"]
    """Normal and offset; NaN for planes of fewer than three touches, whose tips are at no distance."""
    middle: Float[np.ndarray, "planes 3"]
    """Mean of the touches of each."""
    spread: Float[np.ndarray, "planes 3"]
    """How far these are spread, root mean square, metres: off the plane, and in it the narrow and the wide way."""
    off: Float[np.ndarray, " n"]
    """Distance of each tip from its own, signed, metres."""
    by_tip: Float[np.ndarray, "n 3"]
    """Derivative of that by the tip. To first order the planes need not follow it (Kaufman 1975)."""


class Touches(NamedTuple):
    """Poses of a tool whose tip touched planes: n·(p + R·t) = d. The tip t alone is sought, for it tells the planes."""

    R: Float[np.ndarray, "n 3 3"]
    p: Float[np.ndarray, "n 3"]
    plane: Int[np.ndarray, " n"]
    """Number of the plane of each row."""
    names: tuple[str, ...]
    called: str = "plane"
    """What a plane is, for messages."""

    def planes(self, t: Float[np.ndarray, " 3"], weight: Float[np.ndarray, " n"]) -> FittedPlanes:
        """Planes by weighted least squares."""
        x = self.p + self.R @ t
        member = np.arange(len(self.names))[:, None] == self.plane
        share = member * weight
        share = share / np.maximum(share.sum(axis=1), 1e-300)[:, None]
        middle = share @ x
        apart = x - middle[self.plane]
        square = (share @ (apart[:, :, None] * apart[:, None, :]).reshape(-1, 9)).reshape(-1, 3, 3)
        values, vectors = np.linalg.eigh(square)
        normal = to_one_side(vectors[:, :, 0])
        turned = np.einsum("nij,ni->nj", self.R, normal[self.plane])
        off, by_tip = (apart * normal[self.plane]).sum(axis=1), turned - (share @ turned)[self.plane]
        few = member.sum(axis=1) < 3
        off[few[self.plane]], by_tip[few[self.plane]] = 0.0, 0.0
        planes = np.concatenate([normal, (normal * middle).sum(axis=1, keepdims=True)], axis=1)
        planes[few] = np.nan
        return FittedPlanes(planes, middle, np.sqrt(np.maximum(values, 0.0)), off, by_tip)

    def find_tip(self) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " n"]]:
        """The tip that leaves the smallest distances, from the best of several starts, and what each row counts."""
        weight = np.ones(len(self.p))
        t = min((self._search(start, weight) for start in TIPS), key=lambda found: self._cost(found, weight))
        touched = np.bincount(self.plane, minlength=len(self.names))
        judged = touched[self.plane] >= FEWEST
        if not judged.any():
            return t, weight
        for _ in range(ROUNDS):
            off = np.abs(self.planes(t, weight).off)
            weight = 1.0 / np.maximum(off, max(float(np.median(off[judged])), 1e-6))
            t = self._search(t, weight)
        off = np.abs(self.planes(t, weight).off)
        near = off <= FAR * max(float(np.median(off[judged])), 1e-5)
        left = np.bincount(self.plane[near], minlength=len(self.names))
        if near.mean() > 0.5 and (left[touched >= FEWEST] >= FEWEST).all():
            weight = near.astype(float)
        return self._search(t, weight), weight

    def hidden(self, t: Float[np.ndarray, " 3"], weight: Float[np.ndarray, " n"]) -> Float[np.ndarray, "3 3"]:
        """Projector onto directions of the tip that these rows do not tell."""
        fitted = self.planes(t, weight)
        x, normal = self.p + self.R @ t, fitted.planes[self.plane, :3]
        by_plane = np.zeros((len(x), len(self.names), 4))
        by_plane[np.arange(len(x)), self.plane] = np.concatenate([x, -np.ones((len(x), 1))], axis=1)
        root = np.sqrt(weight / weight.max())[:, None]
        rms = float(np.sqrt(weight @ fitted.off**2 / weight.sum()))
        by_tip = np.einsum("nij,ni->nj", self.R, normal)
        return unlocated(root * by_tip, root * by_plane.reshape(len(x), -1), rms)

    def check_count(self) -> None:
        """Raise a `CampaignError` where a plane was touched too seldom to be found."""
        for number, count in enumerate(np.bincount(self.plane, minlength=len(self.names))):
            if 0 < count < FEWEST:
                raise CampaignError(
                    f"{count} touches of {self.called} '{self.names[number]}' do not tell where it is; touch it {FEWEST} times or "
                    "more"
                )

    def _search(self, start: np.ndarray, weight: np.ndarray) -> np.ndarray:
        from scipy.optimize import least_squares

        root = np.sqrt(weight / weight.max())

        def residual(t: np.ndarray) -> np.ndarray:
            return np.concatenate([root * self.planes(t, weight).off, SAME_PLACE * (t - start)])

        def jacobian(t: np.ndarray) -> np.ndarray:
            return np.concatenate([root[:, None] * self.planes(t, weight).by_tip, SAME_PLACE * np.eye(3)])

        return least_squares(residual, start, jac=jacobian, method="lm", xtol=1e-12).x  # pyright: ignore[reportArgumentType]

    def _cost(self, t: np.ndarray, weight: np.ndarray) -> float:
        return float(weight @ self.planes(t, weight).off ** 2)


# What planes and cubes have in common: a touch is one number, that nothing is left between the tip and a face.

TOUCH = 2e-5
"""How well a touch is noticed where the campaign does not say, metres."""


class Touching(Standalone):
    """A kind whose rows are touches of faces."""

    width: ClassVar[int] = 1
    touched: ClassVar[bool] = True

    def covariance(
        self, measured: Measured, uncertainty: Float[np.ndarray, " n"] | None, tracker: TrackerNoise
    ) -> Float[np.ndarray, "n w w"]:
        """Covariance of the noise of each row."""
        deviation = np.full(len(measured.points), TOUCH) if uncertainty is None else uncertainty
        return deviation[:, None, None] ** 2


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
        """Condition that normals have unit length."""
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
        """Describe it for a file."""
        return {"planes": list(self.planes)}

    @classmethod
    def of_description(cls, content: Mapping[str, Any]) -> "Planes":
        """Make it from what `describe` gave, without rows."""
        return cls(planes=tuple(content["planes"]))
