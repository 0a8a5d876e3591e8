"""How the reference points beside a robot moved together from row to row."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from taskcal.geometry import se3

COLLINEAR_RATIO = 0.05
"""Second extent of the points over their first under which they are taken for a line, about which nothing is seen to turn."""

MISPLACED_SIGMAS = 10.0
"""Standard deviations by which the distance of two points may differ from the usual one before one of them is taken for lost."""

MIN_DISTANCE_NOISE = 1e-6
"""Smallest standard deviation of that distance, metres."""

MAX_ROUNDS = 20
"""Of reference points placed by the motions and motions by the reference points."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ReferenceMotion:
    """The reference points' common motion in every row, as far as each row tells."""

    centre: Float[np.ndarray, " 3"]
    """Centre of the reference points in their common frame, metres."""
    axes: Float[np.ndarray, "3 3"]
    """Their principal axes, columns."""
    values: Float[np.ndarray, "n components"]
    """Translation of the centre along the axes, metres, and, where three reference points tell it, rotation about them, radians."""
    per_noise: Float[np.ndarray, "n components"]
    """Variance of each value for noise of unit variance."""
    noise: float | None
    """Standard deviation of a reference point's coordinate, by what no common motion explains, metres; None for a single one."""
    freedom: int
    """Degrees of freedom of that estimate."""
    lost: Bool[np.ndarray, "n points"]
    """Reference points that stood out of place."""

    @property
    def rigid(self) -> bool:
        """Whether rotations are seen."""
        return self.values.shape[1] == 6


def observe_reference_points(reference_points: Mapping[str, Float[np.ndarray, "_ 3"]]) -> ReferenceMotion:
    """Find the common motion of reference points.

    Each row's motion is the rigid one that carries the points' usual places nearest to the seen ones (Kabsch 1976), and the usual
    places are those that all rows agree on best; of fewer than three points, or points on a line, the mean movement.

    Args:
        reference_points: the places of each, row by row, metres; NaN where it was not seen. One at least.
    """
    seen = np.stack(list(reference_points.values()), axis=1)
    lost = _misplaced(seen)
    seen = np.where(lost[..., None], np.nan, seen)
    there = ~np.isnan(seen[..., 0])
    usual = np.nanmean(seen, axis=0)
    extent = np.linalg.svd(usual - usual.mean(axis=0), compute_uv=False)
    if seen.shape[1] < 3 or extent[1] < COLLINEAR_RATIO * extent[0]:
        return _shift(seen, there, usual, lost)
    R, place = np.broadcast_to(np.eye(3), (len(seen), 3, 3)), np.zeros((len(seen), 3))
    for _ in range(MAX_ROUNDS):
        R, place = _rigid(seen, there, usual)
        usual = np.nanmean(np.einsum("kji,knj->kni", R, seen - place[:, None]), axis=0)
    centre = usual.mean(axis=0)
    axes = np.linalg.svd(usual - centre)[2].T
    resolved = _not_on_a_line(there, usual)
    residual = np.where(
        (there & resolved[:, None])[..., None], seen - place[:, None] - usual @ np.swapaxes(R, 1, 2), 0.0
    )
    freedom = int(3 * there[resolved].sum() - 6 * resolved.sum() - (3 * len(usual) - 6))
    arm = ((usual - centre) @ axes) ** 2
    lever = there @ (arm.sum(axis=1)[:, None] - arm)
    values = np.concatenate([(se3.apply(se3.pose(R, place), centre) - centre) @ axes, se3.log(R) @ axes], 1)
    values[~resolved] = np.nan
    shares = np.concatenate([np.repeat(there.sum(axis=1)[:, None], 3, axis=1), lever], axis=1)
    return ReferenceMotion(
        centre=centre,
        axes=axes,
        values=values,
        per_noise=1.0 / np.maximum(shares, 1e-12),
        noise=float(np.sqrt((residual**2).sum() / max(freedom, 1))),
        freedom=freedom,
        lost=lost,
    )


def _rigid(
    seen: Float[np.ndarray, "n points 3"], there: Bool[np.ndarray, "n points"], usual: Float[np.ndarray, "points 3"]
) -> tuple[Float[np.ndarray, "n 3 3"], Float[np.ndarray, "n 3"]]:
    """Rotation and translation from the usual places to the seen ones, row by row."""
    count = np.maximum(there.sum(axis=1), 1)[:, None]
    here = np.where(there[..., None], seen, 0.0)
    middle, usually = here.sum(axis=1) / count, there @ usual / count
    moment = np.einsum("kni,knj->kij", here - there[..., None] * middle[:, None], usual - usually[:, None])
    R = se3.nearest_rotation(moment)
    return R, middle - np.einsum("kij,kj->ki", R, usually)


def _shift(
    seen: Float[np.ndarray, "n points 3"],
    there: Bool[np.ndarray, "n points"],
    usual: Float[np.ndarray, "points 3"],
    lost: Bool[np.ndarray, "n points"],
) -> ReferenceMotion:
    """Translations alone."""
    count, number = there.sum(axis=1)[:, None], seen.shape[1]
    moved = np.zeros((len(seen), 3))
    for _ in range(MAX_ROUNDS):
        moved = np.where(there[..., None], seen - usual, 0.0).sum(axis=1) / np.maximum(count, 1)
        usual = np.nanmean(seen - moved[:, None], axis=0)
    freedom = int(3 * (there.sum() - (count > 0).sum() - number + 1))
    residual = np.where(there[..., None], seen - usual - moved[:, None], 0.0)
    return ReferenceMotion(
        centre=usual.mean(axis=0),
        axes=np.eye(3),
        values=np.where(count > 0, moved, np.nan),
        per_noise=np.repeat(1.0 / np.maximum(count, 1), 3, axis=1),
        noise=None if number == 1 else float(np.sqrt((residual**2).sum() / max(freedom, 1))),
        freedom=freedom,
        lost=lost,
    )


def _misplaced(seen: Float[np.ndarray, "n points 3"]) -> Bool[np.ndarray, "n points"]:
    """Reference points whose distances from all others that were seen are unusual: a beam that met another reflector."""
    distance = np.linalg.norm(seen[:, :, None] - seen[:, None], axis=3)
    off = np.abs(distance - np.nanmedian(distance, axis=0))
    deviation = np.maximum(1.4826 * np.nanmedian(off, axis=0), MIN_DISTANCE_NOISE)
    other = ~np.isnan(distance) & ~np.eye(seen.shape[1], dtype=bool)
    return other.any(axis=2) & ((off > MISPLACED_SIGMAS * deviation) | ~other).all(axis=2)


def _not_on_a_line(there: Bool[np.ndarray, "n points"], usual: Float[np.ndarray, "points 3"]) -> Bool[np.ndarray, " n"]:
    """Rows whose reference points tell a rotation."""
    out = np.zeros(len(there), dtype=bool)
    for kind in np.unique(there, axis=0):
        some = usual[kind]
        extent = np.linalg.svd(some - some.mean(axis=0), compute_uv=False) if kind.sum() > 2 else np.zeros(2)
        out[(there == kind).all(axis=1)] = kind.sum() > 2 and extent[1] >= COLLINEAR_RATIO * extent[0]
    return out
