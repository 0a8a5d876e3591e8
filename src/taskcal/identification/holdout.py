"""Which rows a fit does not see, so that they show what it predicts: groups of neighbouring poses, blocks, or single rows.

Of two poses side by side, one in the fit tells the error of the other, and rows held out one by one flatter the fit.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeVar

import numpy as np
from jaxtyping import Float, Int

from taskcal.campaigns.campaign import Campaign
from taskcal.campaigns.performance import group_postures
from taskcal.errors import CampaignError, WrongValue
from taskcal.estimation.group_variances import Evidence
from taskcal.estimation.noisy_rows import PoseNoise
from taskcal.estimation.prior import GaussianPrior
from taskcal.identification.calibration import Calibration, as_known, covariance_on, in_its_frames
from taskcal.identification.group_model import (
    GroupFit,
    fit_about,
    geometry_alone,
)
from taskcal.identification.held_out import (
    SAME_POSTURE_RAD,
    HeldOut,
    group_neighbours,
    in_regions,
)
from taskcal.identification.layout import prior_of
from taskcal.identification.measured_range import LEAST_RANGE, MeasuredRange
from taskcal.identification.options import FitOptions, Grouping, Holdout
from taskcal.identification.problem import Problem
from taskcal.kernels.chunks import in_chunks
from taskcal.observations.base import TrackerNoise

GROUPS = 20
"""Into which the rows are divided, unless a small share or many folds need more."""

FitRows = Callable[[Campaign], Calibration]
Judged = TypeVar("Judged")


def groups_of(holdout: Holdout, campaign: Campaign) -> Int[np.ndarray, " n"]:
    """The group of every row, counted from 0."""
    n = len(campaign)
    if holdout.by == "rows":
        return np.arange(n)
    share = 0.5 if holdout.share is None else min(holdout.share, 1.0 - holdout.share)
    count = min(max(GROUPS, 2 * (holdout.folds or 0), int(np.ceil(2.0 / share))), n)
    return np.arange(n) * count // n if holdout.by == "blocks" else group_neighbours(campaign.q, count)


def rows_held_out(holdout: Holdout, campaign: Campaign) -> Int[np.ndarray, " k"]:
    """Rows that are held out, where a share is.

    Raises:
        CampaignError: none, or all.
    """
    n, share = len(campaign), holdout.share or 0.0
    wanted = round(share * n)
    if not 0 < wanted < n:
        raise CampaignError(f"holding out {share:g} of {n} rows leaves {n - wanted} to fit and {wanted} to test")
    group = groups_of(holdout, campaign)
    rows = np.bincount(group)
    if len(rows) < 2:
        raise CampaignError(f"all {n} rows are one pose: a part held out would say nothing; measure at other poses")
    order = np.random.default_rng(holdout.seed).permutation(len(rows))
    reached = np.cumsum(rows[order])[:-1]
    count = int(np.argmin(np.abs(reached - wanted))) + 1
    return np.flatnonzero(np.isin(group, order[:count]))


def folds_of(holdout: Holdout, campaign: Campaign) -> list[Int[np.ndarray, " _"]]:
    """Rows of every fold.

    Raises:
        CampaignError: fewer groups than folds.
    """
    folds, group = holdout.folds or 0, groups_of(holdout, campaign)
    rows = np.bincount(group)
    if len(rows) < folds:
        raise CampaignError(
            f"{len(campaign)} rows at {len(rows)} different poses are too few to hold out one part of {folds} after another; "
            "choose fewer folds, or measure more poses"
        )
    order = np.random.default_rng(holdout.seed).permutation(len(rows))
    fold = np.empty(len(rows), dtype=int)
    held = np.zeros(folds)
    for number in order[np.argsort(-rows[order], kind="stable")]:
        fold[number] = int(held.argmin())
        held[fold[number]] += rows[number]
    return [np.flatnonzero(fold[group] == k) for k in range(folds)]


def hold_out(
    fit: FitRows, campaign: Campaign, holdout: Holdout, nominal: FitRows, *, noise: TrackerNoise | None = None
) -> Calibration:
    """Fit a campaign, and keep with the calibration how well rows were predicted that a fit had not seen.

    Args:
        fit: of the rows of a campaign.
        campaign: the measurements.
        holdout: what is held out.
        nominal: the same of the nominal robot, whose tracker frame and targets alone are fitted.
        noise: the tracker's, where the campaign does not state uncertainties.

    Raises:
        CampaignError: too few rows or poses, or nothing was measured in the rows held out.
        FitError: a fit did not converge.
        WrongValue: nothing is held out.
    """
    if not holdout.asked:
        raise WrongValue("holdout holds nothing out; give it a share of the rows, or a number of folds")
    if holdout.folds is None:
        out = rows_held_out(holdout, campaign)
        calibration = fit(_without(campaign, out))
        group = np.unique(groups_of(holdout, campaign)[out], return_inverse=True)[1].reshape(-1)
        return with_held_out(calibration, campaign, out, nominal, noise=noise, by=holdout.by, part=group)
    calibration, parts = fit(campaign), folds_of(holdout, campaign)
    fits = [fit(_without(campaign, part)) for part in parts]
    part = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    return _with_errors(calibration, campaign, parts, fits, nominal, noise, by=holdout.by, folds=len(parts), part=part)


def with_held_out(
    calibration: Calibration,
    campaign: Campaign,
    out: Int[np.ndarray, " k"],
    nominal: FitRows,
    *,
    noise: TrackerNoise | None = None,
    by: Grouping | None = None,
    part: Int[np.ndarray, " k"] | None = None,
) -> Calibration:
    """The calibration with its errors on rows that it has not seen.

    Args:
        calibration: fitted to all other rows.
        campaign: all rows.
        out: those that were held out.
        nominal: the fit of the nominal robot's tracker frame and targets.
        noise: the tracker's, where the campaign does not state uncertainties.
        by: how they were chosen; None where the user named the rows to fit.
        part: the group of each; None to group neighbours.
    """
    if part is None:
        part = group_neighbours(campaign.q[out], GROUPS)
    return _with_errors(
        calibration, campaign, [out], [calibration], nominal, noise, by=by or "chosen", folds=0, part=part
    )


def _with_errors(
    calibration: Calibration,
    campaign: Campaign,
    parts: Sequence[Int[np.ndarray, " _"]],
    fits: Sequence[Calibration],
    nominal: FitRows,
    noise: TrackerNoise | None,
    *,
    by: Grouping | Literal["chosen"],
    folds: int,
    part: Int[np.ndarray, " k"],
) -> Calibration:
    """The calibration with the errors of parts of a campaign, each predicted by the fit that has not seen it."""
    predicted = [_predict(one, campaign, part, nominal) for one, part in zip(fits, parts, strict=True)]
    inside = [regions_on(one, campaign.take(part), noise) for one, part in zip(fits, parts, strict=True)]
    held_out = HeldOut(
        by=by,
        folds=folds,
        rows=np.array([campaign.row_of(int(i)) for i in np.concatenate(parts)]),
        part=part,
        residuals=np.concatenate([own for own, _ in predicted]),
        nominal=np.concatenate([before for _, before in predicted]),
        inside=np.concatenate([lengths for lengths, _ in inside]),
        rotation_inside=np.concatenate([angles for _, angles in inside]),
        kinds=campaign.kinds,
    )
    return replace(calibration, held_out=held_out)


def regions_on(
    calibration: Calibration, campaign: Campaign, noise: TrackerNoise | None
) -> tuple[Float[np.ndarray, "k targets"], Float[np.ndarray, "k targets"]]:
    """Whether what was measured is in the region that is stated for it, and the same of rotations, as of `in_regions`.

    NaN for all where a station is among the rows that the calibration does not know: its frame is found from them.
    """
    campaign = as_known(calibration, campaign)
    residual, errors = calibration.residuals_on(campaign), campaign.covariances(noise)
    if in_its_frames(calibration, campaign)[1]:
        nothing = np.full(campaign.valid.shape, np.nan)
        return nothing, nothing
    kinds, own = campaign.observations, covariance_on(calibration, campaign, errors)
    return in_regions(residual, own, errors, kinds), in_regions(residual, own, errors, kinds, rotations=True)


def _without(campaign: Campaign, out: Int[np.ndarray, " k"]) -> Campaign:
    return campaign.take(np.setdiff1d(np.arange(len(campaign)), out))


def _predict(
    fitted: Calibration, campaign: Campaign, out: Int[np.ndarray, " k"], nominal: FitRows
) -> tuple[Float[np.ndarray, "k targets b"], Float[np.ndarray, "k targets b"]]:
    """Residuals of held-out rows, in the axes of the robot's base, and those that the nominal robot leaves.

    Raises:
        CampaignError: nothing was measured in them.
    """
    unseen, rest = campaign.take(out), _without(campaign, out)
    if not unseen.valid.any():
        raise CampaignError(
            f"in none of the {len(out)} rows that are held out was anything measured; choose others (seed)"
        )
    wrong = {row.id for row in fitted.left_out}
    before = nominal(rest.without(np.array([name in wrong for name in rest.ids])))
    return fitted.residuals_on(unseen, frame="base"), before.residuals_on(unseen, frame="base")


# Cross-validation on postures that were not fitted: rows of one posture, measured again and again, are left out
# together.
#
# Left in the fit, a repeated pose would tell the errors of its own posture beforehand.


def split_postures(q: Float[np.ndarray, "n joints"], folds: int, seed: int) -> list[Int[np.ndarray, " _"]]:
    """Rows of each fold. Rows within half a degree of each other in every joint are in one fold, and chains of such rows.

    Args:
        q: joint positions, radians.
        folds: how many parts are left out, one after another.
        seed: of their composition.

    Raises:
        CampaignError: fewer postures than folds.
    """
    posture = group_postures(q, SAME_POSTURE_RAD)
    different = len(np.unique(posture))
    if different < folds:
        raise CampaignError(
            f"{len(q)} rows at {different} different poses are too few to leave out one part of {folds} after another; "
            "measure more poses"
        )
    # the generator, and so the folds, of scikit-learn's GroupKFold, whose import takes longer than a fit
    order = np.random.RandomState(seed).permutation(np.unique(posture))
    part = np.array_split(order, folds)
    return [np.flatnonzero(np.isin(posture, some)) for some in part]


def predict_left_out(
    fit: Callable[[Campaign], Calibration], campaign: Campaign, parts: list[Int[np.ndarray, " _"]]
) -> Float[np.ndarray, "rows targets"]:
    """Error in space of every point when its part is left out of the fit, metres; NaN for lost beams."""
    out = np.full(campaign.valid.shape, np.nan)
    for part in parts:
        fitted = fit(campaign.take(np.setdiff1d(np.arange(len(campaign)), part)))
        out[part] = np.linalg.norm(fitted.residuals_on(campaign.take(part))[..., :3], axis=2)
    return out


def mean_over_rows(values: Float[np.ndarray, "rows targets"]) -> tuple[float, float]:
    """Mean over the points, and its standard error over the rows, whose targets have their errors in common."""
    count, rows = int(np.isfinite(values).sum()), int(np.isfinite(values).any(axis=1).sum())
    mean = float(np.nanmean(values))
    by_row = np.nansum(values - mean, axis=1)
    return mean, float(np.sqrt((by_row**2).sum() * rows / max(rows - 1, 1)) / count)


# What a fit is worth where it was not fitted: left-out errors, and how far stated regions reach, beyond the measured range too.
#
# Parts are left out of the rows, and the sizes of the groups follow by a few steps of the search, as do the weights of the poses
# (`NoisyFit.without`). The rows are not linearised again, and what single poses add stays. An effect's worth is the error without
# its groups, the others as they are, so that no model is fitted again.
#
# Real errors have longer tails than normal ones, sizes that were fitted are a little too good, and effects that were allowed for
# but are not there make what is stated too large: all of it shows in the left-out errors. They are taken for t-distributed with ν
# degrees of freedom and the scale N + s·X, N the covariance of the instrument's noise, which is stated, and X what is predicted
# beside it; X is stretched so that the 95 % region of N and X is that of this distribution.
#
# Among the measured poses the factor is one number, s = f. What a model leaves is not white: a smooth error is followed among the
# poses by parameters that do not have it, and beyond them they go on where it does not. There s = f·(1 + g·u²), with u how far a
# pose lies beyond the measured range, in ranges (`MeasuredRange.extrapolation`), and g found in the same way from folds that leave
# out the ends of the joints' ranges, and no less than regions need to hold 95 % there. Ends tell nothing of f: among the poses
# u = 0, and an f that held the ends too would be too large where nothing is extrapolated.

FOLD_STEPS, FOLD_GAIN = 2, 1e-2
"""Steps of a search in a fold, at most, and the gain of log posterior, expected of the next, at which it ends. A convention: sizes
of nearly the same rows are near at the start."""

VALIDATION_DRAWS = 2
"""Draws of the sizes in a fold. A convention: errors of all folds are averaged as well."""

TAILS = np.array([4.0, 6.0, 9.0, 14.0, 25.0, 60.0, 1000.0])
"""Degrees of freedom that are tried."""

STRETCH = np.exp(np.linspace(np.log(0.05), np.log(9.0), 73))
"""Values of f that are tried."""

MAX_STRETCH = 25.0
"""Factor f of the covariance, at most, with the tails: five times the predicted deviation. A convention."""

STRETCH_WIDTH = 1.0
"""Standard deviation of log f about 0, before anything is left out: a factor of 1.6 in size. A convention, as of one joint's
size beside the others."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PartErrors:
    """Mean errors of parts of the rows, each left out as a whole, metres."""

    whole: Float[np.ndarray, " parts"]
    """Of the one model; NaN of a part in which nothing was measured."""
    without: Mapping[str, Float[np.ndarray, " parts"]]
    """The same with each effect left out."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LeftOutErrors:
    """Errors where rows were not fitted."""

    whole: Float[np.ndarray, "n targets"]
    """Of the one model, metres; NaN where a beam was lost."""
    without: Mapping[str, Float[np.ndarray, "n targets"]]
    """The same with each effect left out."""
    stretch: float
    """Factor of the covariance, but for the instrument's noise, that makes 95 % regions hold 95 %."""
    growth: float
    """How it grows beyond the measured range (`Calibration.range_growth`)."""
    ends: PartErrors
    """At the ends of the joints' ranges (`end_parts`)."""


def validate_groups(
    fitted: GroupFit, parts: Sequence[Int[np.ndarray, " _"]], effects: Sequence[str], rng: np.random.Generator
) -> LeftOutErrors:
    """Cross-validate a fit.

    Args:
        fitted: the fit.
        parts: rows of each fold.
        effects: names of those whose worth is asked for.
        rng: for the draws of the sizes.
    """
    n, targets = fitted.group_model.problem.seen.valid.shape
    numbers = {name: fitted.group_model.of_effect(name) for name in effects}
    errors = {name: np.full((n, targets), np.nan) for name in ("", *effects)}
    error, predicted = np.zeros((n, targets, 3)), np.zeros((n, targets, 3, 3))

    def without_effects(part: np.ndarray, at: Evidence) -> tuple[Evidence, list[np.ndarray]]:
        return at, [_lengths(fitted, part, at.without(group).mean) for group in numbers.values()]

    for part, (at, others) in zip(parts, _of_folds(fitted, parts, without_effects), strict=True):
        error[part], predicted[part] = _judge(fitted, part, at, rng)
        errors[""][part] = np.linalg.norm(error[part], axis=2)
        for name, lengths in zip(numbers, others, strict=True):
            errors[name][part] = lengths
    seen = fitted.group_model.problem.seen.valid
    for values in errors.values():
        values[~seen] = np.nan
    noise = fitted.group_model.problem.noise[:, :, :3, :3][seen]
    stretch = stretch_of(error[seen], noise, predicted[seen] - noise)
    growth, ends = judge_ends(fitted, stretch, effects)
    return LeftOutErrors(
        whole=errors[""],
        without={name: errors[name] for name in effects},
        stretch=stretch,
        growth=growth,
        ends=ends,
    )


def errors_of_parts(
    fitted: GroupFit, parts: Sequence[Int[np.ndarray, " _"]], effects: Sequence[str] = ()
) -> PartErrors:
    """Mean error of each part where it is left out.

    Args:
        fitted: the fit.
        parts: rows of each, which may have rows in common.
        effects: names of those whose worth is asked for.
    """

    def judge(part: np.ndarray, at: Evidence) -> list[float]:
        return _means(fitted, part, _lengths(fitted, part, at.mean), at, effects)

    return _by_part(effects, _of_folds(fitted, parts, judge))


def _by_part(effects: Sequence[str], means: Sequence[Sequence[float]]) -> PartErrors:
    columns = np.array(means).reshape(len(means), 1 + len(effects)).T
    return PartErrors(whole=columns[0], without=dict(zip(effects, columns[1:], strict=True)))


def _means(
    fitted: GroupFit,
    part: Int[np.ndarray, " k"],
    lengths: Float[np.ndarray, "k targets"],
    at: Evidence,
    effects: Sequence[str],
) -> list[float]:
    """Mean error of a part of the rows, of which these are the lengths, and the same without each effect."""
    seen = fitted.group_model.problem.seen.valid[part]
    without = [_lengths(fitted, part, at.without(fitted.group_model.of_effect(name)).mean) for name in effects]
    return [float(some[seen].mean()) if seen.any() else np.nan for some in (lengths, *without)]


def _of_folds(
    fitted: GroupFit,
    parts: Sequence[Int[np.ndarray, " _"]],
    judge: Callable[[Int[np.ndarray, " _"], Evidence], Judged],
) -> list[Judged]:
    """What is said of each part by the fit without it."""
    end = fitted.end
    # few rows take little memory; with many, each pass over them has threads of its own
    at_once = 1 if end.y.size < end.A.shape[2] else max(len(parts), 1)
    found = in_chunks(
        lambda some: [judge(part, end.without(part, FOLD_STEPS, FOLD_GAIN)) for part in parts[some]],
        len(parts),
        at_once,
    )
    return [one for some in found for one in some]


def _left(fitted: GroupFit, part: np.ndarray, mean: np.ndarray) -> Float[np.ndarray, "k m"]:
    """Whitened residuals of some rows; what only they measure, such as a socket of theirs, stands where they say."""
    left = fitted.end.y[part] - fitted.end.A[part] @ mean
    frames = np.flatnonzero(fitted.group_model.groups.group < 0)
    others = np.delete(fitted.end.A[:, :, frames], part, axis=0)
    lone = frames[
        ~others.any(axis=(0, 1)) & fitted.end.A[np.ix_(part, np.arange(left.shape[1]), frames)].any(axis=(0, 1))
    ]
    if not len(lone):
        return left
    own = fitted.end.A[part][:, :, lone].reshape(-1, len(lone))
    return left - (own @ np.linalg.lstsq(own, left.reshape(-1), rcond=None)[0]).reshape(left.shape)


def _lengths(fitted: GroupFit, part: np.ndarray, mean: np.ndarray) -> Float[np.ndarray, "k targets"]:
    """Errors of position of some rows, metres."""
    error = np.linalg.solve(fitted.end.whitener[part], _left(fitted, part, mean)[..., None])[..., 0]
    targets = fitted.group_model.problem.seen.valid.shape[1]
    return np.linalg.norm(error.reshape(len(part), targets, -1)[:, :, :3], axis=2)


def _judge(
    fitted: GroupFit, part: np.ndarray, at: Evidence, rng: np.random.Generator
) -> tuple[Float[np.ndarray, "k targets 3"], Float[np.ndarray, "k targets 3 3"]]:
    """Errors of position of some rows by the fit without them, and their covariance as a calibration of that would state it."""
    m = fitted.end.A.shape[1]
    # of geometry's one size `about_calibration` has the expectation already
    spread = at.averaged_spread(fitted.end.A[part], VALIDATION_DRAWS if fitted.group_model.tails else 1, rng)
    back = np.linalg.inv(fitted.end.whitener[part])
    error = np.einsum("nij,nj->ni", back, _left(fitted, part, at.mean))
    # a new pose has a weight of its own, that is told by no residual
    single = np.eye(m) * fitted.end.weights[part, None, None]
    covariance = back @ (spread + single) @ np.swapaxes(back, 1, 2)
    targets = fitted.group_model.problem.seen.valid.shape[1]
    width = m // targets
    own = [slice(t * width, t * width + 3) for t in range(targets)]
    return np.stack([error[:, at] for at in own], axis=1), np.stack([covariance[:, at, at] for at in own], axis=1)


def stretch_of(
    error: Float[np.ndarray, "points 3"],
    noise: Float[np.ndarray, "points 3 3"],
    predicted: Float[np.ndarray, "points 3 3"],
) -> float:
    """Factor of the predicted covariance that makes the 95 % region of it and the noise hold 95 % of such errors.

    Args:
        error: left-out errors.
        noise: covariance of the instrument's noise.
        predicted: covariance of what is predicted beside it.
    """
    v, square = _diagonal(error, noise, predicted)
    best, longer = _likeliest(square, 1.0 + STRETCH[:, None, None] * v, (np.log(STRETCH) / STRETCH_WIDTH) ** 2)
    # longer tails of the whole, the noise's with it, are held by what is predicted alone: in the mean, or as far as that goes
    scale = 1.0 + STRETCH[best] * v

    def held(stretch: float) -> float:
        return float((scale / (1.0 + stretch * v)).mean()) - 1.0 / longer

    if held(MAX_STRETCH) >= 0.0:
        return MAX_STRETCH
    low, high = 0.0, MAX_STRETCH
    for _ in range(60):  # halved down to rounding; SciPy's root finders take longer to import
        middle = 0.5 * (low + high)
        low, high = (middle, high) if held(middle) > 0.0 else (low, middle)
    return low


def _diagonal(
    error: Float[np.ndarray, "points 3"],
    noise: Float[np.ndarray, "points 3 3"],
    predicted: Float[np.ndarray, "points 3 3"],
) -> tuple[Float[np.ndarray, "points 3"], Float[np.ndarray, "points 3"]]:
    """Variances of what is predicted, and squares of the errors, in the axes in which noise is 1 and these are diagonal."""
    root = np.linalg.inv(np.linalg.cholesky(noise))
    v, turn = np.linalg.eigh(root @ predicted @ np.swapaxes(root, 1, 2))
    square = (np.swapaxes(turn, 1, 2) @ (root @ error[..., None]))[..., 0] ** 2
    return np.maximum(v, 0.0), square


def _likeliest(
    square: Float[np.ndarray, "points 3"],
    scales: Float[np.ndarray, "k points 3"],
    unexpected: Float[np.ndarray, " k"],
    weight: Float[np.ndarray, " points"] | float = 1.0,
) -> tuple[int, float]:
    """The likeliest of some scales of t-distributed errors, and how far their 95 % region is larger than a normal one, squared.

    Args:
        square: errors along the axes of the scales.
        scales: squares of the scale along each axis.
        unexpected: squared distance of each from what is expected, in standard deviations.
        weight: of every error.
    """
    from scipy.special import chdtri, fdtri

    lengths, volume = (square / scales).sum(axis=2), 0.5 * np.log(scales).sum(axis=2)
    log = np.array([((multivariate_t_log(lengths, nu) - volume) * weight).sum(axis=1) for nu in TAILS]).T
    best, tail = np.unravel_index(int((log - 0.5 * unexpected[:, None]).argmax()), log.shape)
    return int(best), float(3.0 * fdtri(3.0, TAILS[tail], 0.95) / chdtri(3.0, 0.05))


def multivariate_t_log(squares: Float[np.ndarray, "..."], nu: float) -> Float[np.ndarray, "..."]:
    """Log density of a t-distribution in three dimensions at these squared lengths, but for its scale and log π."""
    from scipy.special import gammaln

    return gammaln(0.5 * (nu + 3.0)) - gammaln(0.5 * nu) - 1.5 * np.log(nu) - 0.5 * (nu + 3.0) * np.log1p(squares / nu)


# Beyond the measured range.

END_SHARE = 0.25
"""Share of the rows that are left out at an end of a joint's range."""

GROWTH = np.exp(np.linspace(np.log(0.05), np.log(300.0), 30))
"""Values of g that are tried."""

EXPECTED_GROWTH, GROWTH_WIDTH = 3.0, 1.0
"""Growth that is expected before any end is left out, a doubled deviation one measured range beyond, and the standard deviation of
its logarithm. A convention."""

ERRORS_OF_AN_END = 5.0
"""Independent errors that an end counts as, at most: its poses have what the model leaves there in common. A convention."""

MAX_END_ROWS = 1000
"""Rows, at most, evenly among all, that ends are left out of. A convention that bounds the time."""


def end_parts(problem: Problem) -> list[Int[np.ndarray, " _"]]:
    """Rows at each end of the range of each joint that moves."""
    seen, out = np.flatnonzero(problem.seen.valid.any(axis=1)), list[np.ndarray]()
    for along in problem.q[seen].T:
        if np.ptp(along) < LEAST_RANGE:
            continue
        low, high = np.quantile(along, [END_SHARE, 1.0 - END_SHARE])
        out += [seen[rows] for rows in (along < low, along > high) if rows.any()]
    return out


def judge_ends(fitted: GroupFit, stretch: float, effects: Sequence[str] = ()) -> tuple[float, PartErrors]:
    """Growth g of the covariance beyond the measured range, and the errors of each end where it is left out.

    Args:
        fitted: the fit.
        stretch: factor of the covariance among the poses.
        effects: names of those whose worth is asked for.
    """
    problem = fitted.group_model.problem
    seen, robot = problem.seen.valid, problem.layout.model.robot

    def judge(part: np.ndarray, at: Evidence) -> tuple[list[float], tuple[np.ndarray, ...]]:
        rest = np.setdiff1d(np.flatnonzero(seen.any(axis=1)), part)
        u = MeasuredRange.of_rows(robot, problem.q[rest]).extrapolation(problem.q[part])
        # draws of its own, whichever end is judged first
        error, predicted = _judge(fitted, part, at, np.random.default_rng(part))
        row, target = np.nonzero(seen[part])
        noise = problem.noise[part][row, target][:, :3, :3]
        v, square = _diagonal(error[row, target], noise, stretch * (predicted[row, target] - noise))
        weight = np.full(len(row), min(1.0, ERRORS_OF_AN_END / len(row)))
        means = _means(fitted, part, np.linalg.norm(error, axis=2), at, effects)
        return means, (v, square, u[row], weight)

    judged = _of_folds(fitted, end_parts(problem), judge)
    errors, ends = _by_part(effects, [means for means, _ in judged]), [end for _, end in judged]
    if not ends:
        return EXPECTED_GROWTH, errors
    v, square, u, weight = (np.concatenate(parts) for parts in zip(*ends, strict=True))
    scales = 1.0 + (1.0 + GROWTH[:, None] * u)[..., None] * v
    best, longer = _likeliest(square, scales, (np.log(GROWTH / EXPECTED_GROWTH) / GROWTH_WIDTH) ** 2, weight)
    # longer tails are held where ends lie, in the mean
    reach = float(u.mean())
    likeliest = float((longer * (1.0 + GROWTH[best] * reach) - 1.0) / reach)
    return max(likeliest, _growth_that_holds(ends)), errors


def _growth_that_holds(ends: Sequence[tuple[np.ndarray, ...]]) -> float:
    """The least growth with which 95 % regions hold 95 % of the errors of an end, in the mean over the ends; or the largest tried.

    What ends have in common is one law of one g, and they differ: the likeliest g is that of most of them.

    Args:
        ends: variances of what is predicted and squares of the errors, in units of the noise, and how far outside they lie.
    """
    from scipy.special import chdtri

    held = [
        ((square / (1.0 + (1.0 + GROWTH[:, None] * u)[..., None] * v)).sum(axis=2) < chdtri(3.0, 0.05)).mean(axis=1)
        for v, square, u, _ in ends
    ]
    enough = np.mean(held, axis=0) >= 0.95
    return float(GROWTH[int(enough.argmax())] if enough.any() else GROWTH[-1])


def about_calibration(calibration: Calibration, problem: Problem, options: FitOptions) -> GroupFit:
    """The rows of a problem, linear about a calibration, with its model error and the scale of its prior.

    Parameters that were not estimated are taken as if they had been, where they have tolerances as their prior: as they are
    considered, they add to what is predicted.

    Args:
        calibration: of geometry alone, or with effects that were asked for.
        problem: in the layout of all parameters.
        options: of the fit.
    """
    p, z = len(calibration.model), calibration.z
    if options.prior is None or isinstance(options.prior, GaussianPrior):
        kept = calibration.estimated
        problem = replace(problem, layout=replace(problem.layout, estimated=kept))
        z = np.concatenate([z[kept], z[p:]])
    one = geometry_alone(problem, prior_of(problem.layout, options.prior), options)
    errors = PoseNoise.of_deviations(calibration.model_error)
    sizes = np.full(len(one.labels), 2.0 * np.log(calibration.prior_scale or 1.0))
    return fit_about(one, z, errors, sizes)


def growth_of(calibration: Calibration, problem: Problem, options: FitOptions) -> float:
    """Growth of a calibration's covariance beyond the measured range, its stated regions as they are among the poses.

    Args:
        calibration: of geometry alone, or with effects that were asked for.
        problem: what was fitted, in the layout of all parameters.
        options: of the fit.
    """
    n = len(problem.q)
    some = problem if n <= MAX_END_ROWS else problem.take(np.linspace(0, n - 1, MAX_END_ROWS).astype(int))
    return judge_ends(about_calibration(calibration, some, options), 1.0)[0]
