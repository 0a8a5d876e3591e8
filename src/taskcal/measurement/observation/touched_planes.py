"""Which planes a tip touched, and where the tip is on the tool, from poses of the tool alone."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import CampaignError
from taskcal.measurement.observation.unlocated import unlocated

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
    """Of the two normals of each plane the one whose largest coordinate is positive."""
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
