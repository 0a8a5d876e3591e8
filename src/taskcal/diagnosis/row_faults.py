"""Rows that cannot be right beside the others: swapped targets, mixed-up pairs, duplicated poses, gross errors."""

import itertools
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.diagnosis.linear_fit import LinearFit, register_trimmed
from taskcal.diagnosis.row_pairing import rearranged
from taskcal.diagnosis.supposition import Case
from taskcal.errors import CampaignError
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.registration import Registration, register_closely

FAR_QUARTILES = 10.0
"""Of the upper quartile of what the robust fit leaves of the rows. The tails of real robots are heavy: one that leans far back is
off by three times the 95th percentile there, in all rows of that posture, and none of them is wrong."""

FAR = 1e-3
"""Metres; nearer than that a row is not grossly wrong."""

MOST_SHARE = 0.2
"""Of the rows, that may be grossly wrong; with more it is another mistake."""

MOST_MIXED_UP = 0.5
"""Of the rows, that may have the points of one another: that all of them find their place is proof in itself."""

SAME_POSE = 2e-5
"""Radians, or metres."""


@dataclass(frozen=True, eq=False, kw_only=True)
class RowFault:
    """Rows, what is wrong with them, and the campaign without it."""

    id: str
    rows: Int[np.ndarray, " k"]
    targets: tuple[int, ...]
    mended: Campaign
    before: float
    """Median distance of these rows, metres."""
    after: float
    """The same, mended; of the other rows, where these are left out."""


def find_swapped(case: Case) -> RowFault | None:
    """Two targets that changed places in some of the rows.

    From the registration of all rows, and of every stretch of them alone, the targets of the others are told apart; the one on
    which most rows agree decides.
    """
    campaign = case.campaign
    if len(campaign.targets) < 2:
        return None
    T = case.poses(np.arange(len(campaign)))
    best: tuple[float, np.ndarray, tuple[int, int]] | None = None
    given = np.inf
    usable = np.flatnonzero(np.isfinite(T[:, 0, 3]) & campaign.seen)
    for rows in (usable, *np.array_split(usable, 3)):
        try:
            registration = register_trimmed(campaign.take(rows), T[rows])
        except (CampaignError, np.linalg.LinAlgError):
            continue
        kept = _row_errors(registration, campaign.points, T)
        given = min(given, _mean(kept))
        for a, b in itertools.combinations(range(len(campaign.targets)), 2):
            exchanged = _row_errors(registration, _exchanged(campaign.points, a, b), T)
            swapped = exchanged < 0.3 * kept
            error = _mean(np.where(swapped, exchanged, kept))
            if swapped.any() and (best is None or error < best[0]):
                best = (error, swapped, (a, b))
    if best is None or best[0] > 0.4 * given:
        return None
    error, swapped, (a, b) = best
    if swapped.mean() > 0.5:
        swapped = ~swapped
    points = campaign.points.copy()
    points[swapped] = _exchanged(points[swapped], a, b)
    return RowFault(
        id="target-swapped",
        rows=np.flatnonzero(swapped),
        targets=(a, b),
        mended=replace(campaign, points=points),
        before=given,
        after=error,
    )


def _exchanged(points: np.ndarray, a: int, b: int) -> np.ndarray:
    out = points.copy()
    out[:, [a, b]] = out[:, [b, a]]
    return out


def _row_errors(registration: Registration, points: np.ndarray, T: np.ndarray) -> Float[np.ndarray, " n"]:
    ends = (registration.T_tracker_base @ T)[:, None] @ registration.T_tool_target
    return np.sqrt(np.nansum((points - ends[..., :3, 3]) ** 2, axis=(1, 2)) / np.maximum(_count(points), 1))


def _count(points: np.ndarray) -> Int[np.ndarray, " n"]:
    return (~np.isnan(points[..., 0])).sum(axis=1)


def _mean(errors: np.ndarray) -> float:
    return float(np.nanmean(errors))


def far_rows(fit: LinearFit, rows: int) -> Bool[np.ndarray, " n"]:
    """Rows that are much farther off than the others, from the fit and from the nominal robot.

    A fit that does not follow a row may bend away from it where it stands alone.
    """
    worst = np.zeros(rows)
    np.maximum.at(worst, fit.rows, np.minimum(fit.distance, np.linalg.norm(fit.residual, axis=1)))
    quartile = float(np.quantile(worst[np.unique(fit.rows)], 0.75))
    return worst > max(FAR, FAR_QUARTILES * quartile)


def find_row_fault(case: Case, fit: LinearFit) -> RowFault | None:
    """What is wrong with the rows that are far off, if they are few."""
    campaign = case.campaign
    far = far_rows(fit, len(campaign))
    same = _duplicates(campaign, fit)
    if same is not None:
        return _left_out("duplicate-poses", same, case, fit)
    rows = np.flatnonzero(far)
    share = far[campaign.seen].mean()
    if not len(rows) or share > MOST_MIXED_UP:
        return None
    mixed_up = _mixed_up(case, rows, fit)
    if mixed_up is not None or share > MOST_SHARE:
        return mixed_up
    return _left_out("gross-rows", rows, case, fit)


def _left_out(name: str, rows: np.ndarray, case: Case, fit: LinearFit) -> RowFault:
    concerned = np.isin(fit.rows, rows)
    return RowFault(
        id=name,
        rows=rows,
        targets=(),
        mended=case.campaign.take(np.setdiff1d(np.arange(len(case.campaign)), rows)),
        before=float(np.median(fit.distance[concerned])) if concerned.any() else 0.0,
        after=float(np.median(fit.distance[~concerned])),
    )


def _duplicates(campaign: Campaign, fit: LinearFit) -> Int[np.ndarray, " k"] | None:
    """Rows with the same joints whose points differ by more than any robot repeats."""
    bound = max(FAR, 6.0 * fit.median)
    order = np.lexsort(np.round(campaign.q / SAME_POSE).T)
    near = np.abs(np.diff(campaign.q[order], axis=0)).max(axis=1) < SAME_POSE
    out: set[int] = set()
    for i in np.flatnonzero(near):
        a, b = order[i], order[i + 1]
        apart = np.linalg.norm(campaign.points[a] - campaign.points[b], axis=1)
        if np.nanmax(apart, initial=0.0) > bound:
            out |= {int(a), int(b)}
    return np.array(sorted(out)) if out else None


def _mixed_up(case: Case, rows: np.ndarray, fit: LinearFit) -> RowFault | None:
    """Rows whose points fit the joints of one another."""
    if len(rows) < 2:
        return None
    campaign, T = case.campaign, case.poses(np.arange(len(case.campaign)))
    others = np.setdiff1d(np.flatnonzero(np.isfinite(T[:, 0, 3]) & campaign.seen), rows)
    try:
        registration = register_closely(campaign.take(others), T[others])
    except (CampaignError, np.linalg.LinAlgError):
        return None
    ends = ((registration.T_tracker_base @ T[rows])[:, None] @ registration.T_tool_target)[..., :3, 3]
    apart = np.nan_to_num(
        np.nanmax(np.linalg.norm(ends[:, None] - campaign.points[rows][None], axis=3), axis=2), nan=1e3
    )
    from scipy.optimize import linear_sum_assignment

    of, taken = linear_sum_assignment(apart)
    if np.median(apart[of, taken]) > 0.2 * np.median(np.diag(apart)):
        return None
    source = np.arange(len(campaign))
    source[rows[of]] = rows[taken]
    mended = rearranged(campaign, source)
    concerned = np.isin(fit.rows, rows)
    return RowFault(
        id="rows-shuffled",
        rows=rows,
        targets=(),
        mended=mended,
        before=float(np.median(fit.distance[concerned])),
        after=float(np.median(apart[of, taken])),
    )
