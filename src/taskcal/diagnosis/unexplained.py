"""What is told where no usual mistake explains a campaign: rows in another order, or a robot that is not known."""

import numpy as np
from jaxtyping import Float

from taskcal.diagnosis.finding import Finding
from taskcal.diagnosis.frame_mistakes import scale_mistakes
from taskcal.diagnosis.joint_mistakes import unit_mistakes
from taskcal.diagnosis.quick_fit import LEVER_SHARE, misfits
from taskcal.diagnosis.row_mistakes import common_shift, shift_fix
from taskcal.diagnosis.row_pairing import Pairing, pair_rows
from taskcal.diagnosis.search import spread_rows
from taskcal.diagnosis.supposition import Case, Supposition
from taskcal.measurement.campaign import Campaign

AT_CHANCE = 0.7
"""Of the error of points that were given out at random: rows with as much have nothing to do with each other."""


def find_other_order(case: Case, before: float) -> tuple[list[Finding], Campaign] | None:
    """The findings, and the campaign in another order of its measurements, if one fits.

    Args:
        case: robot and campaign as given.
        before: error as given, metres.
    """
    units = [*list(scale_mistakes(case))[:1], *unit_mistakes(case)]
    in_units = case
    for supposition in units:
        in_units = supposition.undo(in_units)
    paired = pair_rows(in_units)
    if paired is None:
        return None
    before *= extent(in_units) / extent(case)
    confidence = float(np.clip(1.0 - paired.error / paired.next_best, 0.0, 0.99))
    findings = [
        Finding(
            id=mistake.id,
            subject=mistake.subject,
            error_before=before,
            error_after=paired.error,
            confidence=confidence,
            fix=mistake.fix,
        )
        for mistake in [*units, *([_order(case, paired)] if len(paired.moved) else [])]
    ]
    return findings, paired.mended


def find_what_is_left(case: Case, before: float) -> Finding:
    """The finding of last resort, which nothing mends.

    Args:
        case: robot and campaign as given.
        before: error as given, metres.
    """
    if at_chance(case):
        name = "rows-shuffled"
        fix = (
            "joints and points have no more to do with each other than rows drawn by lot, and no order of them fits: pair them "
            "again, by name or time"
        )
    else:
        name = "other-robot"
        fix = (
            f"neither {case.robot.name} nor a robot of the catalogue fits, with any usual mistake undone: check the lengths in "
            "the robot file, or give the robot that was measured"
        )
    return Finding(id=name, subject=(), error_before=before, error_after=None, confidence=0.5, fix=fix)


def at_chance(case: Case) -> bool:
    """Whether the rows fit no better than rows that are paired by lot."""
    return _error_at(case, None) > AT_CHANCE * _error_at(case, np.random.default_rng(0))


def _order(case: Case, paired: Pairing) -> Supposition:
    by = common_shift(paired.source)
    if by is not None:
        return Supposition(id="rows-shifted", subject=(f"{by:+d}",), fix=shift_fix(by))
    rows = paired.moved
    fix = (
        f"the measurements of {len(rows)} rows stand beside the joints of other rows: pair them again by name or time, or take "
        "the order of --fix, the only one that fits"
    )
    return Supposition(id="rows-shuffled", subject=_names(case, rows), fix=fix)


def extent(case: Case) -> float:
    """Median distance of the points from their middle: what is off without any robot, metres."""
    points = case.campaign.points
    return float(np.nanmedian(np.linalg.norm(points - np.nanmedian(points, axis=0), axis=2)))


def _names(case: Case, rows: np.ndarray) -> tuple[str, ...]:
    """Ids of some rows; none where they are all."""
    return () if len(rows) > 0.9 * len(case.campaign) else tuple(case.campaign.ids[i] for i in rows)


def _error_at(case: Case, rng: np.random.Generator | None) -> float:
    """Of the quick fit as given, or the median of rows that are paired by lot, metres."""
    rows = spread_rows(len(case.campaign), 60)
    T, campaign = case.poses(rows), case.campaign.take(rows)
    orders = [np.arange(len(rows))] if rng is None else [rng.permutation(len(rows)) for _ in range(15)]
    points: Float[np.ndarray, "h n t 3"] = np.stack([campaign.points[order] for order in orders])
    poses = np.broadcast_to(T, (len(orders), *T.shape))
    return float(np.median(misfits(poses, points, None, LEVER_SHARE * case.model.robot.reach)))
