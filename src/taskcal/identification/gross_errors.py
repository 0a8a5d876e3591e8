"""Rows that cannot be right: found by what all other rows agree on, left out, and said.

A fit of all rows follows a gross error, and where one row alone decides a direction it follows it entirely. So the rows are
first asked whether they agree on tracker frame and targets (`find_consensus`). Those that do not are judged by the fit of the
others, each by its prediction's residual over the standard deviation of that, and come back where that fit finds them right.

The nominal robot is off by millimetres itself, so that smaller gross errors agree with it. The outliers of the fit are therefore
judged in the same way: by the fit of all other rows.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import CampaignError, FitError
from taskcal.identification.calibration import Calibration
from taskcal.identification.observed_errors import covariance_by_kind
from taskcal.identification.outlier import LeftOut
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.enough_rows import named_file
from taskcal.measurement.plausibility import most_wrong_rows
from taskcal.measurement.tracker import TrackerNoise

GROSS_SIGMAS = 10.0
"""Standard deviations from which on a row that disagrees is wrong, not unlucky."""

MASKED_SIGMAS = 15.0
"""The same by the fit of the others, for an outlier that is nearer than `GROSS_SIGMAS` in the fit that it is part of: gross errors
raise the model error and so hide themselves. Sound rows of measured robots, in postures that few rows have, reach 11."""

MAX_ROUNDS = 6
"""Of fit and judgement in turn; two are enough as a rule."""

MANY, SOME = 5000, 1000
"""Rows from which on those that disagree are first judged by a fit of so many of the others."""

MAX_NAMED_ROWS = 6
"""Rows that a message names."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FittedRows:
    """What a fit of all rows of a campaign gives."""

    calibration: Calibration
    unlearnt: float | None = None
    """Model error, metres per axis, of a fit that learnt nothing and called all that was measured error; None of others."""


Fit = Callable[[Campaign, Int[np.ndarray, " k"] | None], FittedRows]
"""Of a campaign with all its rows, or of some of them only."""


def fit_right_rows(
    fit: Fit, campaign: Campaign, rows: Bool[np.ndarray, " n"], noise: TrackerNoise | None
) -> FittedRows:
    """Fit the rows that can be right, and say which were left out.

    Args:
        fit: identifies from all rows of a campaign that were seen, or from those of a list.
        campaign: the measurements.
        rows: those that agree, to begin with.
        noise: the tracker's, where the campaign does not state uncertainties.

    Raises:
        CampaignError: more rows are wrong than can be told from right ones.
    """
    seen = campaign.seen
    agreed = np.flatnonzero(seen & rows)
    if len(agreed) > MANY and not rows[seen].all() and not campaign.observations:
        some = np.sort(np.random.default_rng(0).choice(agreed, size=SOME, replace=False))
        _, length = _judge(fit(campaign, some).calibration, campaign, rows, noise)
        rows = np.logical_or(rows, np.logical_and(seen, length <= GROSS_SIGMAS))
    fitted = fit(campaign.without(seen & ~rows), None)
    distance, length = _judge(fitted.calibration, campaign, rows, noise)
    for _ in range(MAX_ROUNDS):
        following = np.logical_or(rows, np.logical_and(seen, length <= GROSS_SIGMAS))
        if np.array_equal(following, rows):
            break
        rows = following
        fitted = fit(campaign.without(seen & ~rows), None)
        distance, length = _judge(fitted.calibration, campaign, rows, noise)
    _check_few(seen & ~rows, campaign)
    for _ in range(MAX_ROUNDS):
        unbelieved = _wrong_outliers(fit, fitted.calibration, campaign, rows, noise)
        if not unbelieved.any():
            break
        rows = np.asarray(rows & ~unbelieved)
        fitted = fit(campaign.without(seen & ~rows), None)
        distance, length = _judge(fitted.calibration, campaign, rows, noise)
    wrong = np.flatnonzero(seen & ~rows)
    if not len(wrong):
        return fitted
    left_out = tuple(
        LeftOut(
            row=campaign.row_of(int(i)),
            line=campaign.line_of(int(i)),
            id=campaign.ids[i],
            distance=float(distance[i]),
            studentised=float(length[i]),
        )
        for i in wrong
    )
    said = _said(left_out, [campaign.row(int(i)) for i in wrong], int(seen.sum()))
    calibration = fitted.calibration
    return replace(fitted, calibration=replace(calibration, left_out=left_out, remarks=(said, *calibration.remarks)))


def _wrong_outliers(
    fit: Fit, calibration: Calibration, campaign: Campaign, rows: Bool[np.ndarray, " n"], noise: TrackerNoise | None
) -> Bool[np.ndarray, " n"]:
    """Outliers of a fit of some rows that the fit of the others finds wrong; none where more than a tenth of all would be."""
    named = {outlier.row for outlier in calibration.outliers}
    outlying = np.array([bool(rows[i]) and campaign.row_of(i) in named for i in range(len(campaign))])
    seen, none = campaign.seen, np.zeros(len(campaign), dtype=bool)
    others = np.asarray(rows & ~outlying)
    if not outlying.any() or (seen & ~others).sum() > most_wrong_rows(int(seen.sum())):
        return none
    try:
        judge = fit(campaign.without(seen & ~others), None).calibration
    except (CampaignError, FitError):  # without them something is not determined
        return none
    _, length = _judge(judge, campaign, others, noise)
    own = np.nan_to_num(calibration.studentised).max(axis=1)
    return np.asarray(outlying & (length > np.where(own > GROSS_SIGMAS, GROSS_SIGMAS, MASKED_SIGMAS)))


def _check_few(wrong: Bool[np.ndarray, " n"], campaign: Campaign) -> None:
    rows = np.flatnonzero(wrong)
    seen = int(campaign.seen.sum())
    if len(rows) > most_wrong_rows(seen):
        named = ", ".join(campaign.row(int(row)) for row in rows[:MAX_NAMED_ROWS])
        named += ", …" if len(rows) > MAX_NAMED_ROWS else ""
        raise CampaignError(
            f"{named_file(campaign)}{len(rows)} of {seen} rows do not agree with the others ({named}): "
            "with more than a tenth of the rows, which are the wrong ones cannot be told. "
            "Correct or leave out the wrong ones, or fit all of them with a robust loss (gross_errors='keep', loss=Cauchy(); "
            "--gross-errors keep --loss cauchy)"
        )


def _said(left_out: tuple[LeftOut, ...], names: list[str], seen: int) -> str:
    named = "; ".join(
        f"{name}, {row.distance * 1e3:.1f} mm off, {row.studentised:.0f} standard deviations"
        for name, row in zip(names[:MAX_NAMED_ROWS], left_out, strict=False)
    )
    more = f"; and {len(left_out) - MAX_NAMED_ROWS} more" if len(left_out) > MAX_NAMED_ROWS else ""
    return (
        f"{len(left_out)} of {seen} rows cannot be right beside all others and were left out: {named}{more}. Measure them again; "
        "or, if they are right, more like them, and fit all rows with gross_errors='keep' (--gross-errors keep)"
    )


def _judge(
    calibration: Calibration, campaign: Campaign, fitted: Bool[np.ndarray, " n"], noise: TrackerNoise | None
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """How far the farthest target of each row that was left out is off, metres, and in its standard deviations; else zero."""
    distance, length = np.zeros(len(campaign)), np.zeros(len(campaign))
    rest = np.flatnonzero(campaign.seen & ~fitted)
    if len(rest):
        # of some rows alone a kind may lack what it refers to
        others, at = (campaign, rest) if campaign.observations else (campaign.take(rest), slice(None))
        residual = np.nan_to_num(calibration.residuals_on(others)[at])
        predicted = covariance_by_kind if campaign.observations else _predicted_covariance
        covariance = (predicted(calibration, others) + others.covariances(noise))[at]
        square = np.einsum("nti,nti->nt", residual, np.linalg.solve(covariance, residual[..., None])[..., 0])
        distance[rest] = np.linalg.norm(residual[..., :3], axis=2).max(axis=1)
        length[rest] = np.sqrt(square.max(axis=1))
    return distance, length


def _predicted_covariance(calibration: Calibration, campaign: Campaign) -> Float[np.ndarray, "n targets b b"]:
    return calibration.predict_covariance(campaign.q, campaign.conditions)
