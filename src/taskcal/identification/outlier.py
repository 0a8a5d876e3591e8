"""Measured points that the fit cannot believe."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.estimation.whitening import inverse_factors
from taskcal.identification.neighbouring_poses import single_postures
from taskcal.measurement.campaign import Campaign

NEIGHBOURS = 4
"""Rows before and after one, and as many of the nearest poses, that are asked whether they have its error too."""

ALIKE = 0.4
"""Part of an outlier's residual that a neighbour's has along it, to be the same error. Outliers have 4.5 standard deviations
or more, so that an error of its own has 1.8 in that direction once in thirty times."""

FEWEST_ALIKE = 2
"""Neighbours with the same error, of `NEIGHBOURS`, that show it to be of the model: by chance once in a hundred times."""


@dataclass(frozen=True, kw_only=True)
class Outlier:
    """A measured point that the fit cannot believe."""

    row: int | None
    """Row of the whole campaign, counted from 0, whichever rows were fitted; None where a file of an older version counted the
    fitted rows alone."""
    line: int | None = None
    """Line of the campaign's file, counted from 1; None where it is not known."""
    id: str
    target: str
    studentised: float
    """Length of its residual over that residual's standard deviation."""
    residual: float
    """Length of its position residual, metres."""


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """A row that was not fitted, since it cannot be right."""

    row: int
    """Row of the whole campaign, counted from 0, whichever rows were to be fitted."""
    line: int | None = None
    """Line of the campaign's file, counted from 1; None where it is not known."""
    id: str
    distance: float
    """How far its farthest point is from where the fit of the others has it, metres."""
    studentised: float
    """The same over its standard deviation."""


def studentise(
    residual: Float[np.ndarray, "n targets b"],
    own: Float[np.ndarray, "n targets b b"],
    covariance: Float[np.ndarray, "n targets b b"],
    campaign: Campaign,
    level: float,
) -> tuple[Float[np.ndarray, "n targets"], tuple[Outlier, ...]]:
    """Length of each residual over its own standard deviation, and the points too long for chance.

    The level is shared among all points (Bonferroni), so that a sound campaign names any at all with that probability.

    Args:
        residual: measured less predicted, metres (and radians, for poses).
        own: covariance of the residuals after the fit.
        covariance: of the measurements, model error included: the scale below which a direction has no residual to judge.
        campaign: the measurements.
        level: chance of naming any where there is none.
    """
    valid, out = campaign.valid, np.full(campaign.valid.shape, np.nan)
    widths = np.array([one.width for one in campaign.observations] or [residual.shape[2]] * valid.shape[1])
    for b in np.unique(widths):  # numbers that were measured of a block
        judged = valid & (widths == b)
        floor = 1e-6 * np.trace(covariance[judged][:, :b, :b], axis1=1, axis2=2) / b
        square = _squared_lengths(residual[judged][:, :b], own[judged][:, :b, :b], floor)
        out[judged] = np.sqrt(square)
    from scipy.special import chdtri

    limit = np.sqrt(chdtri(widths, level / max(int(valid.sum()), 1)))
    rows = [(float(out[i, t]), int(i), int(t)) for i, t in zip(*np.nonzero(out > limit), strict=True)]
    named = [
        Outlier(
            row=campaign.row_of(i),
            line=campaign.line_of(i),
            id=campaign.ids[i],
            target=campaign.targets[t],
            studentised=s,
            residual=float(np.linalg.norm(residual[i, t, :3])),
        )
        for s, i, t in sorted(rows, reverse=True)
    ]
    return out, tuple(named)


def _squared_lengths(
    residual: Float[np.ndarray, "k b"], own: Float[np.ndarray, "k b b"], floor: Float[np.ndarray, " k"]
) -> Float[np.ndarray, " k"]:
    """Of residuals in units of their own covariances; directions whose variance is below the floor do not count.

    The fit follows those entirely: they have no residual to judge.
    """
    W = inverse_factors(own)
    square = np.sum((W @ residual[:, :, None])[:, :, 0] ** 2, axis=1)
    # the smallest variance is at least 1/tr(own⁻¹) = 1/|W|²
    doubtful = ~(np.einsum("kij,kij->k", W, W) * floor < 1.0)
    if doubtful.any():
        values, vectors = np.linalg.eigh(own[doubtful])
        along, least = np.einsum("kij,ki->kj", vectors, residual[doubtful]), floor[doubtful, None]
        square[doubtful] = np.sum(np.where(values > least, along**2 / np.maximum(values, least), 0.0), axis=1)
    return square


def shared_with_neighbours(
    outliers: Sequence[Outlier],
    residual: Float[np.ndarray, "n targets b"],
    studentised: Float[np.ndarray, "n targets"],
    q: Float[np.ndarray, "n joints"],
) -> tuple[bool, ...]:
    """Whether neighbours of each outlier, in the order of the rows or by their poses, have much the same error.

    An error that neighbours share is what the model leaves, or something that moved for a while; a wrong reading stands alone.
    Rows of one posture are one pose, whose joints may have been noted wrongly once for all of them: they do not count.

    Args:
        outliers: as `studentise` names them.
        residual: that they were judged by, metres first.
        studentised: the lengths that `studentise` gave.
        q: joint positions, radians (metres where a joint slides).
    """
    if not outliers:
        return ()
    from scipy.spatial import KDTree

    posture, shared = single_postures(q), list[bool]()
    trees: dict[int, tuple[np.ndarray, KDTree]] = {}
    for outlier in outliers:
        i, t = np.unravel_index(np.nanargmin(np.abs(studentised - outlier.studentised)), studentised.shape)
        i, t = int(i), int(t)
        if t not in trees:
            seen = np.flatnonzero(np.isfinite(studentised[:, t]))
            trees[t] = seen, KDTree(q[seen])
        seen, tree = trees[t]
        place = int(np.searchsorted(seen, i))
        nearest = tree.query(q[i], k=min(8 * NEIGHBOURS, len(seen)), p=np.inf)[1]
        before, after = seen[:place][::-1], seen[place + 1 :]
        own = np.nan_to_num(residual[i, t, :3])

        def alike(
            rows: np.ndarray, count: int, own: np.ndarray = own, mine: int = int(posture[i]), target: int = t
        ) -> int:
            others = rows[posture[rows] != mine][:count]
            along = np.nan_to_num(residual[others, target, :3]) @ own
            return int(np.sum(along >= ALIKE * float(own @ own)))

        half = NEIGHBOURS // 2
        in_order = alike(before[:50], half) + alike(after[:50], half)
        shared.append(max(in_order, alike(seen[np.atleast_1d(nearest)], NEIGHBOURS)) >= FEWEST_ALIKE)
    return tuple(shared)
