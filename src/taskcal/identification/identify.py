"""The fit: a campaign and a model in, a Calibration out."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.arguments import Named, by_name, checked, chosen_options
from taskcal.campaigns.campaign import Campaign, check_rows, name_moving, named_file
from taskcal.errors import CampaignError, FitError, NothingLearntError, OpenFrameError, listed
from taskcal.estimation.matrices import invert_positive, single_threaded
from taskcal.estimation.noisy_rows import FREEDOM, MIN_VARIANCE, TYPICAL
from taskcal.estimation.trimmed_squares import Sizes, TrimmedRows, find_agreeing, scaled_lengths, student_limits
from taskcal.identification.calibration import Calibration, covariance_on, tells_nothing
from taskcal.identification.checks.checks import DOCTOR, error_by_tolerances, with_checks
from taskcal.identification.fit import Fit, consider, effects_remarks, fitted_alone
from taskcal.identification.group_model import geometry_alone
from taskcal.identification.held_out import LeftOut
from taskcal.identification.hyperparameters import MAX_ROUNDS, Weighed, first_errors, fit_with_hyperparameters
from taskcal.identification.layout import PriorOfEstimate, layout_of, prior_of
from taskcal.identification.measured_range import MeasuredRange
from taskcal.identification.options import FitOptions
from taskcal.identification.problem import Problem, problem_of
from taskcal.identification.sibling import check_sibling, remark_on
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
from taskcal.registration.rotations import fit_rotations, refuse_wrong_rotations
from taskcal.robot.error_model import ErrorModel
from taskcal_groundwork.said import Said

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

MAX_NAMED_ROWS = 6
"""Rows that a message names."""


def _find_right_rows(
    model: ErrorModel, campaign: Campaign, poses: Float[np.ndarray, "n 4 4"], options: FitOptions
) -> tuple[Bool[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
    """The rows that agree, and those in which nothing was seen; and rows that are far off for the nominal robot already.

    They are those of the whole model and its tolerances, whichever parameters are to be estimated.

    Args:
        model: the model.
        campaign: the measurements.
        poses: of the nominal tool in the base, at every row.
        options: of the fit.

    Raises:
        CampaignError: rows that do not determine tracker frame and targets.
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
    """Fit the rows that can be right, and say which were left out.

    Args:
        fit_rows: fits all rows of a campaign that were seen.
        campaign: the measurements.
        right: rows that agree; the fit of these takes back those that it finds right.
        far: rows that alone are left out where more than a tenth would be: so many may also be of a robot that the model does not
            describe, as one that gives under load.
        noise: the tracker's, where the campaign does not state uncertainties.

    Raises:
        CampaignError: more rows are wrong than can be told from right ones.
    """
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
        rest = np.flatnonzero(seen & ~right & far)
        _check_few(rest, campaign)
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
    turned = fit_rotations(fit.problem.layout.model, campaign)
    degrees = np.degrees(np.where(turned.wrong, turned.off, 0.0) if turned else np.zeros(len(campaign)))[rest]
    said = _said(left_out, degrees, [campaign.row(int(i)) for i in rest], int(seen.sum()))
    return replace(fit, measured=campaign, left_out=left_out, remarks=(said, *fit.remarks))


def _check_few(rows: Int[np.ndarray, " k"], campaign: Campaign) -> None:
    seen = int(campaign.seen.sum())
    if len(rows) > most_wrong_rows(seen):
        named = listed((campaign.row(int(row)) for row in rows), MAX_NAMED_ROWS)
        raise CampaignError(
            f"{named_file(campaign)}{len(rows)} of {seen} rows do not agree with the others ({named}): "
            "with more than a tenth of the rows, which are the wrong ones cannot be told. "
            "Correct or leave out the wrong ones, or fit all of them (gross_errors='keep', --gross-errors keep)"
        )


def _said(left_out: tuple[LeftOut, ...], turned_deg: Float[np.ndarray, " k"], names: list[str], seen: int) -> str:
    every = (
        f"{name}, {row.distance * 1e3:.1f} mm{f' and its rotation {turn:.0f}°' if turn else ''} off, "
        f"{row.studentised:.0f} standard deviations"
        for name, row, turn in zip(names, left_out, turned_deg, strict=True)
    )
    named = listed(every, MAX_NAMED_ROWS, "; ")
    return Said(
        "{count} of {seen} rows cannot be right beside all others and were left out: {named}. Measure them again; or, if they are "
        "right, more like them, and fit all rows with gross_errors='keep' (--gross-errors keep)",
        count=len(left_out),
        seen=seen,
        named=named,
    )


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


# Campaigns that no length is in: a robot of any size fits them, and the smallest fits best.

MAX_SCALE = 3.0
"""Prior scale, at most, of campaigns that no length is in. A convention: beyond, the residuals of a shrinking robot gain more
than its lengths lose."""


def hold_scale(model: ErrorModel, campaign: Campaign, options: FitOptions) -> FitOptions:
    """Options that take the stated tolerances of the lengths as they are, where nothing that was measured tells the size.

    The residuals of a ball in its sockets are as small as the robot is. Where the scale of the tolerances is estimated beside
    the model error, the fit that explains all is a robot of no size, which no tolerance then forbids.

    Raises:
        CampaignError: lengths are to be fitted without a prior, or with one that is too wide.
    """
    if not scale_is_unobservable(campaign):
        return options
    kept = range(len(model)) if options.keep is None else model.indices(options.keep)
    lengths = [model.parameters[i].name for i in kept if model.parameters[i].unit == "m"]
    if not lengths:
        return options
    if options.prior is None or (options.prior_scale != "estimate" and options.prior_scale > MAX_SCALE):
        raise CampaignError(
            f"{named_file(campaign)}has no length that was measured or stated, so that a robot of any size fits it, the smallest "
            "best; state a distance between two sockets (--distances FILE), touch opposite faces of a cube, hold the lengths "
            f"({lengths[0]} and others) by a prior of at most {MAX_SCALE:g} tolerances, or keep none of them"
        )
    return replace(options, prior_scale=1.0) if options.prior_scale == "estimate" else options


def scale_is_unobservable(campaign: Campaign) -> bool:
    """Whether a smaller robot leaves smaller residuals of all that was measured."""
    return all(kind.shrinks for kind in campaign.observations)


CONTRADICTING = 3.0
"""Standard deviations of what the tolerances make of the tool's position, beyond which an unexplained error is the rows' and not
the robot's: 3σ, as for a single gross error."""


def checked_by_tolerances(fit: Fit) -> Fit:
    """The same, unless what it leaves is more than an error of the robot.

    Raises:
        FitError: no parameter was estimated, and the rows are farther off than the robot's tolerances allow.
    """
    if fit.refusal is not None and fit.model_error[0] > CONTRADICTING * error_by_tolerances(fit.calibration):
        raise fit.refusal
    return fit


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
    fit = checked_by_tolerances(attempt(model, campaign, chosen))
    return with_checks(fit.with_growth(), campaign, chosen)


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
    options = options.without_exact(model)
    try:
        return _identify(model, campaign, options)
    except FitError as refusal:
        if options.prior is None:
            raise
        # the robot stays nominal, and varies by its tolerances all the same
        alone = replace(options, keep=(), prior_scale=1.0 if options.prior_scale == "estimate" else options.prior_scale)
        try:
            frames = _identify(model, campaign, replace(alone, prior="tolerances", like=None))
        except FitError:
            raise refusal from None
        what = str(refusal).partition(". ")[0] if isinstance(refusal, NothingLearntError) else str(refusal)
        remark = Said("{what}. Only tracker frame and targets were fitted: the robot stays nominal", what=what)
        return replace(frames, refusal=refusal, remarks=(*frames.remarks, remark))


def _identify(model: ErrorModel, campaign: Campaign, chosen: FitOptions) -> Fit:
    """Identify a model.

    Raises:
        NothingLearntError: it took everything that was measured for error.
    """
    kept = np.arange(len(model)) if chosen.keep is None else model.indices(chosen.keep)
    check_rows(campaign)
    if chosen.frames == "fixed" and campaign.stations is not None and len(campaign.stations.names) > 1:
        raise CampaignError(
            f"{named_file(campaign)}frames of several stations ({', '.join(campaign.stations.names)}) are fitted, and cannot be "
            "held: leave out frames='fixed' (--frames fixed), or fit one station"
        )
    chosen = hold_scale(model, campaign, chosen)
    if chosen.like is not None:
        check_sibling(model, chosen.like, effects=False)
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
    _check_worth(fit)
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
    if alone and len(kept) == len(model) and _hides_error(by, chosen):
        typical = replace(by.hyper, variances=np.full(len(by.hyper.variances), TYPICAL**2))
        fit = replace(consider(by, whole, by.prior, typical, campaign, chosen), typical=True, help=by.help)
    elif alone:
        fit = fitted_alone(by, whole, campaign, chosen)
    else:
        prior = prior_of(whole.layout, chosen.prior, chosen.target_within)
        try:
            all_fitted = fit_with_hyperparameters(whole, prior, chosen)
        except FitError:
            if len(kept):
                raise
            all_fitted = by  # of tracker frame and targets alone, whose errors of single poses are the larger
        fit = replace(consider(by, whole, prior, all_fitted.hyper, campaign, chosen), help=all_fitted.help)
    _check_rotation(by, fit)
    return replace(fit, remarks=_remarks(by, fit))


def _checked(registration: Registration, model: ErrorModel, campaign: Campaign, target_within: float) -> Registration:
    """The registration that the data give.

    Raises:
        CampaignError: joints and points do not belong together, rotations do not though positions do, or a target is found where
            none can be.
    """
    refuse_wrong_rotations(model, campaign)
    check_plausible(registration, model, campaign)
    check_targets(registration, campaign, target_within)
    return registration


FEW_NUMBERS = 2.0 / 3.0
"""Measured numbers over unknowns, below which no fit tells a model error, however large. Of virtual robots with one of 0.05 mm, 8
to 10 rows (24 to 30 numbers, 51 unknowns) had 67 to 85 % of the errors inside of the 95 % regions without it, 12 rows all."""


def _hides_error(fit: Weighed, options: FitOptions) -> bool:
    """Whether a fit found no model error only because its rows are so few that it explains any."""
    few = fit.problem.measured_numbers < FEW_NUMBERS * len(fit.solution.z)
    found = options.model_error == "estimate" and not fit.hyper.variances.any()
    return few and found and fit.prior.parameters is not None


def _check_worth(fit: Fit) -> None:
    """Refuse a fit from which nothing was learnt, and which called all that was measured error.

    Its own posterior is judged: parameters that it does not estimate, but are considered, make others uncertain that fit well.

    Raises:
        NothingLearntError: no parameter is told.
    """
    by = fit.by
    if by is None or fit.options.prior_scale != "estimate" or by.prior.parameters is None:
        return
    layout, scale, error = by.problem.layout, by.hyper.prior_scale, by.hyper.model_error[0]
    k = len(layout.estimated)
    likeliest = scale if by.likeliest_factor is None else float(np.sqrt(by.likeliest_factor))
    own = np.sqrt(np.maximum(np.diag(by.posterior)[:k], 0.0))
    if tells_nothing(own, layout.model.tolerances[layout.estimated], scale, likeliest, error):
        raise NothingLearntError(
            f"no parameter is determined by these rows: none explains them, and {error * 1e3:.2f} mm per axis were "
            "taken for error. Some rows contradict the others: "
            f"check joints and points ({DOCTOR}), or compare with the nominal robot alone (keep=[], --keep none)"
        )


OPEN_ROTATION = 0.3
"""Standard deviation of a tracker frame's rotation, radians, from which on it is open: a linear covariance says what it should of
smaller turns only (a turn by 0.3 moves points by 4 % along, beside 30 % across)."""


def _check_rotation(by: Weighed, fit: Fit) -> None:
    """Refuse a fit whose rows leave the rotation of the tracker frame open.

    It is judged by all that the tolerances allow; under another prior, which may allow anything, for the parameters as they are.

    Raises:
        OpenFrameError: they do.
    """
    C, layout, campaign, k = fit.covariance, fit.problem.layout, fit.campaign, 0
    if fit.options.prior != "tolerances":
        k = len(by.problem.layout.estimated)
        C = invert_positive((by.solution.information + by.prior.precision(by.hyper.prior_factor))[k:, k:])
        k = len(layout.estimated)
    for base in layout.bases:
        columns = base.columns[3:] - k
        turn = float(np.sqrt(np.linalg.eigvalsh(C[np.ix_(columns, columns)]).max(initial=0.0)))
        if turn > OPEN_ROTATION:
            raise OpenFrameError(
                f"{named_file(campaign)}these rows do not determine the tracker frame: its rotation is open by "
                f"{min(np.degrees(turn), 180.0):.0f}° (1σ), where {np.degrees(OPEN_ROTATION):.0f}° can be calibrated; "
                f"{_describe_motion(campaign, layout.model.robot.joint_names)}. Measure poses in which at least three joints move, "
                "the tool turns about two axes, and the points spread over some hundred millimetres"
            )


def _describe_motion(campaign: Campaign, joints: tuple[str, ...]) -> str:
    """Which joints move, and how far the points spread."""
    names = name_moving(campaign, joints)
    said = f"only {names[0]} moves" if len(names) == 1 else f"{', '.join(names) or 'no joints'} move"
    points = campaign.points[campaign.valid]
    along = (points - points.mean(axis=0)) @ np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2].T
    return f"{said}, and the points lie within {' × '.join(f'{size * 1e3:.0f}' for size in np.ptp(along, axis=0))} mm"


def _remarks(by: Weighed, fit: Fit) -> tuple[str, ...]:
    """List what is unusual about a fit, in words."""
    out: list[str] = []
    campaign, unknowns = fit.campaign, len(by.solution.z)
    if not any(kind.tells_scale for kind in campaign.observations):
        alone = Said("its nominal lengths alone")
        if scale_is_unobservable(campaign):
            alone = Said("its nominal lengths alone within its tolerances as they are stated")
        out.append(
            Said(
                "no length that is known was measured or stated: how large the robot is comes from {alone}; state a distance of "
                "two sockets (--distances), trust the wire's scale, or touch opposite faces of a cube",
                alone=alone,
            )
        )
    measured = fit.problem.measured_numbers
    if measured < 2 * unknowns:
        out.append(
            Said(
                "{measured} measured numbers for {unknowns} unknowns: residuals of the fitted rows say little, those of "
                "held-out rows more",
                measured=measured,
                unknowns=unknowns,
            )
        )
    if fit.rounds > MAX_ROUNDS:
        out.append(Said("model error and prior scale had not settled when the search for them ended"))
    if fit.model_error[0] == 0.0 and measured < 2 * unknowns:
        out.append(Said("no model error could be told from so few rows, so the stated uncertainty leaves it out"))
    if fit.typical:
        out.append(
            Said(
                "no model error could be told from so few rows, so the stated uncertainty takes {typical:.2g} mm per axis, as of "
                "any robot",
                typical=TYPICAL * 1e3,
            )
        )
    return (*out, *effects_remarks(fit), *remark_on(fit.help))


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
