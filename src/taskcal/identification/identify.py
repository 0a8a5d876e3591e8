"""The fit: a campaign and a model in, a Calibration out."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.arguments import Named, by_name, checked, chosen_options
from taskcal.campaigns.campaign import Campaign, check_rows, named_file
from taskcal.errors import CampaignError, FitError
from taskcal.estimation.matrices import single_threaded
from taskcal.estimation.noisy_rows import FREEDOM, MIN_VARIANCE, TYPICAL
from taskcal.estimation.trimmed_squares import Sizes, TrimmedRows, find_agreeing, scaled_lengths, student_limits
from taskcal.identification.calibration import Calibration, covariance_on
from taskcal.identification.checks.checks import (
    OF_FIT,
    OF_GEOMETRY,
    OF_SIBLING,
    Asked,
    Sibling,
    WrongRows,
    by_tolerances,
    hold_scale,
    nothing_learnt,
    open_frame,
    refuse,
    said_of,
    several_stations_held,
    too_many_wrong_rows,
    typical_error,
)
from taskcal.identification.fit import Fit, consider, fitted_alone
from taskcal.identification.group_model import geometry_alone
from taskcal.identification.held_out import LeftOut
from taskcal.identification.hyperparameters import first_errors, fit_with_hyperparameters
from taskcal.identification.layout import PriorOfEstimate, layout_of, prior_of
from taskcal.identification.measured_range import MeasuredRange
from taskcal.identification.options import FitOptions
from taskcal.identification.problem import Problem, problem_of
from taskcal.observations.base import TrackerNoise
from taskcal.registration.plausibility import check_plausible, check_targets, most_wrong_rows
from taskcal.registration.registration import (
    FAR_MEDIANS,
    PLAUSIBLE_SHARE,
    Registration,
    nominal_poses,
    register,
    register_trimmed,
    trusted_distance,
)
from taskcal.registration.rotations import refuse_wrong_rotations
from taskcal.robot.error_model import ErrorModel

# Rows that cannot be right beside all others: found before the fit, left out, and said.
#
# Tracker frame and targets are registered in spite of gross errors, and the campaign is linearised there. Which rows agree on all
# parameters of the model, under its tolerances, is sought among these linear rows (`trimmed_squares`). The fit follows them, and
# judges the others once more.

INNOCENT_ROWS = 0.05
"""Sound rows, expected a campaign, that are taken for wrong where errors of single poses are t-distributed with `FREEDOM` degrees
of freedom, as those of measured robots are taken to be. A convention."""

GROSS_SIGMAS = 10.0
"""Standard deviations from which on a row is wrong however many there are. A convention: of five thousand sound rows some are
farther off by such tails, and a row like that is worth a look."""

EXTRAPOLATED_RANGES, EXTRAPOLATED_SIGMAS = 0.1, 15.0
"""A row so far outside what all others measured, in ranges of the joints, is wrong from these standard deviations on: errors that
no model has grow there. Sound rows of measured robots reach 11 (FANUC R-2000iC, J2 16° above the others; effects explain it). Of 60
evenly spread rows, an end is a tenth of its range beyond the others in one campaign of forty."""

SAMPLE = 300
"""Rows, at most, evenly among all, that are searched; the others are judged by what these say. A convention, as for pose noise."""

MAX_REJECTION_ROUNDS = 6
"""Rounds of fit and judgement, at most. A convention: two are enough as a rule."""


def _find_right_rows(
    model: ErrorModel, campaign: Campaign, poses: Float[np.ndarray, "n 4 4"], options: FitOptions
) -> tuple[Bool[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
    """The rows that agree, and those in which nothing was seen; and rows that are far off for the nominal robot already.

    They are those of the whole model and its tolerances, whichever parameters are to be estimated.
    """
    right, seen = np.ones(len(campaign), dtype=bool), np.flatnonzero(campaign.seen)
    registration, far = options.registration, np.zeros(len(campaign), dtype=bool)
    if registration is None:
        registration, distance = register_trimmed(poses, campaign, model)
        far = np.asarray(distance > FAR_MEDIANS * float(np.median(distance[seen])))
        if trusted_distance(distance[seen]) > PLAUSIBLE_SHARE * model.robot.reach:
            return right, far  # joints and points do not belong together, as the fit says
    layout = layout_of(model, np.arange(len(model)), registration, campaign, fixed=options.frames == "fixed")
    whole, prior = problem_of(layout, campaign, options.noise), prior_of(layout, "tolerances")
    some = seen[np.unique(np.linspace(0, len(seen) - 1, min(len(seen), SAMPLE)).astype(int))]
    linear = _rows_about_start(whole.take(some), prior, _limits(campaign), options)
    count = max(len(some) - 2 * most_wrong_rows(len(some)), 1)
    found = find_agreeing(linear, _first_sizes(whole, options), count)
    right[some] = found.rows
    others = np.setdiff1d(seen, some)
    if len(others):
        rest, scale, sizes = whole.take(others), prior.scale, found.weighed.sizes
        left, own = rest.propagate(layout.start() + scale * found.d, found.covariance * np.outer(scale, scale))
        lengths = scaled_lengths(np.nan_to_num(left), np.nan_to_num(own) + rest.covariance(sizes.errors.variances))
        right[others] = (lengths <= linear.limits).all(axis=1)
    return right, far


def _rows_about_start(problem: Problem, prior: PriorOfEstimate, limits: np.ndarray, options: FitOptions) -> TrimmedRows:
    """A problem where the prior expects it, in units of the prior."""
    z, seen = problem.layout.start(), problem.seen
    measured = np.zeros(problem.noise.shape[:3], dtype=bool)
    for t, kind in enumerate(seen.kinds):
        measured[:, t, kind.block()] = seen.valid[:, [t]]
    rows = geometry_alone(problem, prior, options).rows(z, problem.linearise(z, joints=False))
    return TrimmedRows(rows=rows, measured=measured, limits=limits)


def _first_sizes(problem: Problem, options: FitOptions) -> Sizes:
    """As given; or a tenth of what the registered nominal robot leaves, and the tolerances as they are."""
    errors, scale = first_errors(problem, options), options.prior_scale
    least = errors.with_variances(np.maximum(errors.variances, MIN_VARIANCE))
    return Sizes(least, 1.0 if isinstance(scale, str) else float(scale) ** 2)


def _limits(campaign: Campaign) -> Float[np.ndarray, " targets"]:
    """Standard deviations from which on each target is wrong."""
    widths = np.array([kind.width for kind in campaign.observations])
    chance = INNOCENT_ROWS / max(int(campaign.valid.sum()), 1)
    return np.minimum(student_limits(widths, FREEDOM, chance), GROSS_SIGMAS)


def _fit_right_rows(
    fit_rows: Callable[[Campaign], Fit],
    campaign: Campaign,
    right: Bool[np.ndarray, " n"],
    far: Bool[np.ndarray, " n"],
    noise: TrackerNoise | None,
) -> Fit:
    """Fit the rows that can be right, and say which were left out."""
    try:
        fit = fit_rows(campaign.without(~right))
    except CampaignError:  # without them something is not determined
        if (right | far).all():
            raise
        right = np.asarray(right | ~far)
        fit = fit_rows(campaign.without(~right))
    if right.all():
        return fit
    seen = campaign.seen
    for _ in range(MAX_REJECTION_ROUNDS):
        rest = np.flatnonzero(seen & ~right)
        if not len(rest):
            break
        _, length = _of_rest(fit.located, campaign, rest, noise)
        others = MeasuredRange.of_rows(fit.problem.layout.model.robot, campaign.q[seen & right])
        beyond = np.sqrt(others.extrapolation(campaign.q[rest])) > EXTRAPOLATED_RANGES
        back = rest[(length <= np.where(beyond[:, None], EXTRAPOLATED_SIGMAS, _limits(campaign))).all(axis=1)]
        if not len(back):
            break
        right = right.copy()
        right[back] = True
        fit = fit_rows(campaign.without(~right))
    rest = np.flatnonzero(seen & ~right)
    if len(rest) > most_wrong_rows(int(seen.sum())):
        # so many may also be of a robot that the model does not describe, as one that gives under load
        rest = np.flatnonzero(seen & ~right & far)
        refuse(WrongRows(campaign, rest), [too_many_wrong_rows], named_file(campaign))
        fit = fit_rows(campaign.without(~right & far))
    if not len(rest):
        return fit
    distance, length = (of.max(axis=1) for of in _of_rest(fit.located, campaign, rest, noise))
    left_out = tuple(
        LeftOut(
            row=campaign.row_of(int(i)),
            line=campaign.line_of(int(i)),
            id=campaign.ids[i],
            distance=float(off),
            studentised=float(sigmas),
        )
        for i, off, sigmas in zip(rest, distance, length, strict=True)
    )
    return replace(fit, measured=campaign, left_out=left_out)


def _of_rest(
    calibration: Calibration, campaign: Campaign, rest: Int[np.ndarray, " k"], noise: TrackerNoise | None
) -> tuple[Float[np.ndarray, "k targets"], Float[np.ndarray, "k targets"]]:
    """What `target_errors` says of some rows."""
    # of some rows alone a kind may lack what it refers to
    others, at = (campaign.take(rest), slice(None)) if campaign.tracked else (campaign, rest)
    distance, length = target_errors(calibration, others, noise)
    return distance[at], length[at]


def target_errors(
    calibration: Calibration, campaign: Campaign, noise: TrackerNoise | None
) -> tuple[Float[np.ndarray, "n targets"], Float[np.ndarray, "n targets"]]:
    """Distance of each target from its prediction, metres, and in standard deviations; zero where it was not seen."""
    residual = np.nan_to_num(calibration.residuals_on(campaign))
    covariance = covariance_on(calibration, campaign, campaign.covariances(noise))
    return np.linalg.norm(residual[..., :3], axis=2), scaled_lengths(residual, covariance)


@by_name(FitOptions)
@checked
@single_threaded
def identify(
    _kind: Callable[Named, FitOptions],
    model: ErrorModel,
    campaign: Campaign,
    options: FitOptions | None = None,
    *_args: Named.args,
    **_named: Named.kwargs,
) -> Calibration:
    """Identify the model's parameters from a campaign, the tracker frame and the targets with them.

    The estimate minimises the whitened residuals with a Gaussian prior on every parameter. The prior distributes the
    estimate among linearly dependent parameters. Real robots deviate from any geometry by far more than the tracker's
    noise: the model error and the common scale of the prior are those of the largest marginal likelihood.

    Args:
        model: the model.
        campaign: the measurements.
        options: of the fit.

    Returns:
        the calibration: estimate, covariance, residuals, and predictions with their uncertainty. Where no parameter explains the
        rows, or their fit does not converge under its prior, it is that of tracker frame and targets alone, the robot nominal and
        uncertain by its tolerances, and a remark says so.

    Raises:
        CampaignError: too few rows, a row at which the nominal robot's closed loop does not close, joints and points that do
            not belong together, rotations that do not fit though positions do, a tracker frame whose rotation they leave open (one
            joint in motion, points near a line), lengths without a prior where none was measured or stated, more wrong rows
            than can be told from right ones, a target too far from the TCP, or a model that depends on temperature or time and a
            row without.
        UnknownName: a name in `keep` that the model does not have.
        FitError: the fit did not converge.
        NothingLearntError: it took everything that was measured for error, and more than the robot's tolerances allow.
        TaskcalError: ``like`` is of a robot with other joints or parameters, or its sizes are of another kind of fit.
        ValueError: an option that would silently mean something else.
    """
    chosen = chosen_options(_kind, options, *_args, **_named)
    fit = by_tolerances(attempt(model, campaign, chosen))
    calibration = fit.with_growth()
    return replace(calibration, remarks=(*said_of(fit, OF_GEOMETRY), *calibration.remarks))


@single_threaded
def attempt(model: ErrorModel, campaign: Campaign, options: FitOptions) -> Fit:
    """Identify a model as `identify` does; where its parameters cannot be estimated, find tracker frame and targets alone.

    Args:
        model: the model.
        campaign: the measurements.
        options: of the fit.

    Raises:
        CampaignError: as `identify`.
        FitError: a fit without prior, or that of tracker frame and targets alone, did not converge.
    """
    options, asked = options.without_exact(model), options
    try:
        fit = _identify(model, campaign, options)
    except FitError as refusal:
        if options.prior is None:
            raise
        # the robot stays nominal, and varies by its tolerances all the same
        alone = replace(options, keep=(), prior_scale=1.0 if options.prior_scale == "estimate" else options.prior_scale)
        try:
            frames = _identify(model, campaign, replace(alone, prior="tolerances", like=None))
        except FitError:
            raise refusal from None
        fit = replace(frames, refusal=refusal)
    fit = replace(fit, asked=asked)
    return replace(fit, remarks=said_of(fit, OF_FIT))


def _identify(model: ErrorModel, campaign: Campaign, chosen: FitOptions) -> Fit:
    """Identify a model."""
    kept = np.arange(len(model)) if chosen.keep is None else model.indices(chosen.keep)
    check_rows(campaign)
    refuse(Asked(model, campaign, chosen), [several_stations_held], named_file(campaign))
    chosen = hold_scale(Asked(model, campaign, chosen))
    if chosen.like is not None:
        refuse(Sibling(model, chosen.like, effects=False), OF_SIBLING)
    for effect in model.effects:
        campaign.check_told(effect.needs, effect.key)
    poses = nominal_poses(model, campaign)

    def fit_rows(part: Campaign) -> Fit:
        return _fit(model, part, poses, kept, chosen)

    fit = (
        fit_rows(campaign)
        if chosen.gross_errors == "keep"
        else _fit_right_rows(fit_rows, campaign, *_find_right_rows(model, campaign, poses, chosen), chosen.noise)
    )
    refuse(fit, [nothing_learnt])
    return fit


def _fit(
    model: ErrorModel,
    campaign: Campaign,
    poses: Float[np.ndarray, "n 4 4"],
    kept: Int[np.ndarray, " kept"],
    chosen: FitOptions,
) -> Fit:
    """Fit all rows of a campaign."""
    registration = chosen.registration or _checked(
        register(model, campaign, poses), model, campaign, chosen.target_within
    )
    layout = layout_of(model, np.arange(len(model)), registration, campaign, fixed=chosen.frames == "fixed")
    whole = problem_of(layout, campaign, chosen.noise)
    problem = replace(whole, layout=replace(whole.layout, estimated=kept))
    alone = len(kept) == len(model) or chosen.prior != "tolerances"
    # what a sibling left as error beside all parameters is not what some of them leave
    own = chosen if alone else replace(chosen, like=None)
    by = fit_with_hyperparameters(problem, prior_of(problem.layout, chosen.prior, chosen.target_within), own)
    if alone:
        fit = fitted_alone(by, whole, campaign, chosen)
        if any(typical_error.condition(fit)):
            typical = replace(by.hyper, variances=np.full(len(by.hyper.variances), TYPICAL**2))
            fit = replace(consider(by, whole, by.prior, typical, campaign, chosen), help=by.help)
    else:
        prior = prior_of(whole.layout, chosen.prior, chosen.target_within)
        try:
            all_fitted = fit_with_hyperparameters(whole, prior, chosen)
        except FitError:
            if len(kept):
                raise
            all_fitted = by  # of tracker frame and targets alone, whose errors of single poses are the larger
        fit = replace(consider(by, whole, prior, all_fitted.hyper, campaign, chosen), help=all_fitted.help)
    refuse(fit, [open_frame], named_file(campaign))
    return fit


def _checked(registration: Registration, model: ErrorModel, campaign: Campaign, target_within: float) -> Registration:
    """The registration that the data give."""
    refuse_wrong_rotations(model, campaign)
    check_plausible(registration, model, campaign)
    check_targets(registration, campaign, target_within)
    return registration


# The robot as its file describes it, with only tracker frame and targets found: what a calibration has to be better
# than.


def fit_nominal(model: ErrorModel, campaign: Campaign, options: FitOptions) -> Calibration:
    """Fit tracker frame and targets of the nominal robot, to all rows.

    Args:
        model: its effects are left out.
        campaign: the measurements, without rows that cannot be right.
        options: of the fit that it is compared with.

    Raises:
        CampaignError: too few rows.
        FitError: the fit did not converge.
    """
    nominal = ErrorModel(model.robot, lengths_only=model.lengths_only)
    frames_only = replace(options, keep=(), prior=None, prior_scale="estimate", gross_errors="keep", like=None)
    return identify(nominal, campaign, options=frames_only)
