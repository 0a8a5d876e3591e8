"""From a geometric calibration to the one model: which effects take part, the orders that are sharp, and what each is worth."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from taskcal.campaigns.campaign import Campaign
from taskcal.estimation.noisy_rows import MIN_VARIANCE, PoseNoise
from taskcal.identification.calibration import Calibration
from taskcal.identification.checks.checks import OF_ONE_MODEL, said_of
from taskcal.identification.fit import Fit
from taskcal.identification.group_model import (
    EMPTY,
    GEOMETRY,
    MAX_ROUNDS,
    GroupFit,
    GroupModel,
    assemble,
    fit_group_model,
    of_targets,
    region_factor,
)
from taskcal.identification.holdout import LeftOutErrors, validate_groups
from taskcal.identification.layout import errors_by_unlocated, layout_of, unlocated_directions
from taskcal.identification.options import FitOptions
from taskcal.identification.problem import Problem, problem_of
from taskcal.identification.sibling import (
    Help,
    evidence_under,
    expecting,
    expecting_errors,
    has_own_sizes,
    untold_effects,
)
from taskcal.robot.effects import SPECTRUM, Effect
from taskcal.robot.effects.gears import Harmonics
from taskcal.robot.error_model import ErrorModel

# The calibration that the one model gives: estimate, covariance with the sizes' own uncertainty, residuals.

DRAWS = 12
"""Draws of the sizes of the groups, over which the covariance is averaged. A convention: more cost time in proportion
(docs/theory/group-model.md)."""


def posterior_of(
    fitted: GroupFit,
    campaign: Campaign,
    options: FitOptions,
    stretch: float,
    growth: float,
    rng: np.random.Generator,
    help: Help | None = None,
) -> Fit:
    """What the one model says of all parameters.

    Args:
        fitted: the model.
        campaign: what was fitted.
        options: how.
        stretch: factor of all covariances but the instrument's.
        growth: of it beyond the measured range.
        rng: for the draws of the sizes.
        help: what came of a sibling, if there is one.
    """
    one, errors = fitted.group_model, fitted.errors
    layout, model = one.problem.layout, one.problem.layout.model
    x, S = fitted.found.averaged(DRAWS, rng)
    u = unlocated_directions(layout, options.target_within) / one.scale[:, None]
    rows = fitted.end.A.reshape(-1, len(u))
    held = one.scale[:, None] * errors_by_unlocated(u, S, rows.T @ rows)
    S = _considered(fitted, S) * np.outer(one.scale, one.scale)
    z = layout.start() + one.scale * x
    at = one.problem.linearise(z)
    n, targets = one.problem.seen.valid.shape
    residual = at.residual.reshape(n, targets, -1).copy()
    residual[~one.problem.seen.valid] = np.nan
    R = at.covariance(errors, one.problem.noise)
    followed = at.by_entry @ S @ np.swapaxes(at.by_entry, 1, 2)
    single, tracker = of_targets(R, targets), one.problem.noise
    # stretched beside the tracker's noise; where there is more than was predicted, all of it, so that none is negative
    known = max(1.0 - stretch, 0.0) * tracker
    white = [errors.position] if errors.rotation is None else [errors.position, errors.rotation]
    scales = [v for label, v in zip(one.labels, fitted.found.log_variances, strict=True) if label.effect == GEOMETRY]
    fit = Fit(
        campaign=campaign,
        measured=campaign,
        problem=one.problem,
        options=options,
        asked=options,
        estimated=np.flatnonzero(one.estimated[: len(model)]),
        z=z,
        covariance=0.5 * stretch * (S + S.T) + held @ held.T,
        unlocated=np.zeros((len(z), 0)),
        residual=residual,
        residual_covariance=known + stretch * (single - of_targets(followed, targets)),
        row_covariance=known + stretch * single,
        model_error=tuple(float(d) for d in np.sqrt(stretch * np.array(white))),
        joint_error=tuple(float(d) for d in np.sqrt(stretch * errors.joints)),
        growth=growth,
        prior_scale=float(np.exp(0.5 * np.mean(scales))) if scales else 1.0,
        group_deviations=_group_deviations(fitted),
        effective_parameters=fitted.found.effective_parameters,
        parameter_groups=len(one.labels),
        log_evidence=fitted.end.log_evidence,
        iterations=fitted.rounds,
        rounds=fitted.rounds,
        reason="geometry, effects and their sizes have converged"
        if fitted.settled
        else "geometry, effects and their sizes hardly move",
        help=help,
    )
    return replace(fit, remarks=said_of(fit, OF_ONE_MODEL))


def _group_deviations(fitted: GroupFit) -> Float[np.ndarray, " p"]:
    """Prior standard deviation of every parameter at the likeliest sizes."""
    p = len(fitted.group_model.problem.layout.model)
    sizes = np.exp(0.5 * fitted.found.log_variances)
    return fitted.group_model.scale[:p] * sizes[fitted.group_model.groups.group[:p]]


def _considered(fitted: GroupFit, S: Float[np.ndarray, "z z"]) -> Float[np.ndarray, "z z"]:
    """Covariance with what is not estimated, but varies all the same: C + G·Σ·Gᵀ, G what it does to the estimate."""
    left = np.flatnonzero(~fitted.group_model.estimated)
    if not len(left):
        return S
    scale = fitted.group_model.scale[left]
    columns = np.einsum("nij,njk->nik", fitted.end.whitener, fitted.at.by_entry[:, :, left]) * scale
    pull = np.einsum("nip,nik->pk", fitted.end.A, columns)
    G = -S @ pull
    C = S.copy()
    variance = np.diag(S)[left]
    C[:, left] += G * variance
    C[left] += (G * variance).T
    return C + (G * variance) @ G.T


# Orders of gears and motors that the rows prove: found in a spectrum over each joint's angle, at any frequency.
#
# A strain-wave gear errs some hundred times in a turn of the joint, not always a whole number of times. The
# spectrum is that of score tests: for joint j and order f, with a_i = c_ijᵀR_i⁻¹r_i of every pose i,
#
#     χ² = |Σ_i a_i·exp(i·f·q_ij)|² / (½ Σ_i c_ijᵀR_i⁻¹c_ij),
#
# which has two degrees of freedom where nothing recurs (Lomb 1976, Astrophysics and Space Science 39, in the form
# for noise of uneven size). An order is taken where χ² is beyond chance among all orders of all joints
# (Bonferroni).

MAX_ORDER = 640.0
"""Order that is looked for: four times in a turn of the motor behind a gear of 160."""

CHANCE = 0.01
"""Probability of taking any order, over all orders of all joints, where none recurs. A convention: the usual 1 %."""

FINENESS = 0.1
"""Step of the search, in periods over the whole range of a joint. A convention: half a step off loses 0.4 % of an amplitude."""

MIN_SEPARATION_PERIODS = 1.5
"""Periods over the whole range by which orders found at once differ at least."""

MAX_NEW_ORDERS = 3
"""Orders of a joint that are taken before the others are looked at again."""

MIN_RANGE_RAD = 0.2
"""Range at least, radians, of a joint that is searched. A convention: 11° hold a period of orders above 31."""

SHARP_TOLERANCE = 3e-5
"""Amplitude expected of each, radians: six seconds of arc."""


LOWEST_LINE = max(SPECTRUM.orders) + 0.5
"""Order from which on lines are looked for: lower ones are the spectrum's."""


def find_lines(base: Calibration, campaign: Campaign, options: FitOptions) -> list[tuple[str, float]]:
    """Joints and orders above the spectrum's that what geometry leaves proves, before the other effects take part.

    Among few rows the spectrum, whose common size it raises, and the smooth field may follow such a line, so that nothing of it is
    left to be found. Beyond the rows they go on where it does not.

    Args:
        base: a calibration of the geometry.
        campaign: the measurements.
        options: of the fit.
    """
    lines: list[tuple[str, float]] = []
    fitted = _fit(base, campaign, (), options, None, SHARPENING_ROUNDS)
    for _ in range(SHARPENINGS):
        new = [line for line in find_sharp_orders(fitted, LOWEST_LINE, 1) if line not in lines]
        if not new:
            break
        lines += new
        fitted = _fit(base, campaign, as_effects(lines), options, fitted, SHARPENING_ROUNDS)
    return lines


def prove_lines(
    base: Calibration,
    campaign: Campaign,
    lines: list[tuple[str, float]],
    without: "Sharpened",
    options: FitOptions,
    like: Calibration | None,
) -> "Sharpened":
    """Lines that stand beside all other effects, and the fit of the whole model with these.

    What geometry leaves is not white: lines are found in it that the other effects tell as well. Those of a joint stay where the
    model with them is likelier than without. Its sizes go on from those without: fits from the start end where these do, and take
    twice as long.

    Args:
        base: a calibration of the geometry.
        campaign: the measurements.
        lines: joints and orders.
        without: the fit of all other effects.
        options: of the fit.
        like: a sibling whose sizes are expected.
    """

    def with_lines(some: list[tuple[str, float]]) -> Sharpened:
        if not some:
            return without
        effects, before = (*without.others, *as_effects(some)), without.fitted
        fitted = _fit(base, campaign, effects, options, before, SHARPENING_ROUNDS, like=like)
        return replace(without, lines=some, fitted=fitted)

    best = with_lines(lines)
    for joint in dict.fromkeys(joint for joint, _ in reversed(lines)):
        rest = with_lines([line for line in best.lines if line[0] != joint])
        best = rest if rest.log_posterior > best.log_posterior else best
    return best


def orders_tried(fitted: GroupFit, lowest: float) -> float:
    """Orders from the lowest on that the rows tell apart, over all joints."""
    robot = fitted.group_model.problem.layout.model.robot
    ranges = np.ptp(robot.joint_map(fitted.group_model.problem.q), axis=0)
    return float(ranges[~np.array(robot.prismatic) & (ranges > MIN_RANGE_RAD)].sum() * (MAX_ORDER - lowest) / np.pi)


def find_sharp_orders(fitted: GroupFit, lowest: float, most: int = MAX_NEW_ORDERS) -> list[tuple[str, float]]:
    """Joints and orders that the fit's residuals prove, the clearest first.

    Args:
        fitted: the fit.
        lowest: order from which on the search begins.
        most: of a joint.
    """
    robot, at = fitted.group_model.problem.layout.model.robot, fitted.at
    q = robot.joint_map(fitted.group_model.problem.q)
    # the fit was linearised where it ended
    left = np.einsum("nji,nj->ni", fitted.end.whitener, np.einsum("nij,nj->ni", fitted.end.whitener, at.residual))
    weighted = np.einsum("nij,nik->njk", fitted.end.whitener, fitted.end.whitener @ at.by_joint)
    pull = np.einsum("nik,ni->nk", at.by_joint, left)
    size = 0.5 * np.einsum("nik,nik->k", at.by_joint, weighted)
    ranges = np.ptp(q, axis=0)
    joints = [j for j in range(len(ranges)) if not robot.prismatic[j] and ranges[j] > MIN_RANGE_RAD and size[j] > 0.0]
    beyond_chance = 2.0 * np.log(max(orders_tried(fitted, lowest), 1.0) / CHANCE)
    found: list[tuple[float, int, float]] = []
    for j in joints:
        period = 2.0 * np.pi / ranges[j]
        orders = np.arange(lowest, MAX_ORDER, FINENESS * period)
        test = _spectrum(q[:, j], pull[:, j], orders) / size[j]
        for _ in range(most):
            k = int(test.argmax())
            if test[k] < beyond_chance:
                break
            found.append((float(test[k]), j, float(orders[k])))
            test[np.abs(orders - orders[k]) < MIN_SEPARATION_PERIODS * period] = 0.0
    return [(robot.joint_names[j], round(order, 2)) for _, j, order in sorted(found, reverse=True)]


def find_clear_orders(fitted: GroupFit, effect: str) -> dict[str, tuple[str, float]]:
    """Parameters of orders that are far beyond what the others of their joint let expect, with a name and a tolerance for each.

    An estimate x̂ of a parameter of variance v, with the posterior variance s, is itself of variance v − s. Cosine and sine of an
    order are χ²-distributed together, and an order stands out where χ² is beyond chance among all of them (Bonferroni).

    Args:
        fitted: the fit.
        effect: whose orders share a size for each joint.
    """
    one, found = fitted.group_model, fitted.found
    own, k = one.groups.own, one.groups.grouped
    x, S = found.mean[k], found.covariance[k, k]
    v = np.exp(found.log_variances)[own]
    labels, names = [one.labels[g] for g in own], [one.problem.layout.names[i] for i in k]
    chance = x**2 / np.maximum(v - S, 1e-6 * v)
    both: dict[str, list[int]] = {}
    for k, (label, name) in enumerate(zip(labels, names, strict=True)):
        if label.effect == effect and not label.part:
            both.setdefault(name.replace(".cos", ".").replace(".sin", "."), []).append(k)
    beyond = 2.0 * np.log(max(len(both), 1) / CHANCE)
    return {
        names[k]: (order, SHARP_TOLERANCE)
        for order, members in both.items()
        if chance[members].sum() > beyond
        for k in members
    }


def _spectrum(
    angle: Float[np.ndarray, " n"], pull: Float[np.ndarray, " n"], orders: Float[np.ndarray, " k"]
) -> Float[np.ndarray, " k"]:
    """|Σ pull·exp(i·order·angle)|² at evenly spaced orders."""
    out = np.empty(len(orders))
    turned = pull * np.exp(1j * orders[0] * angle)
    step = np.exp(1j * (orders[1] - orders[0]) * angle)
    for k in range(len(orders)):
        total = turned.sum()
        out[k] = total.real**2 + total.imag**2
        turned *= step
    return out


def as_effects(orders: list[tuple[str, float]]) -> list[Harmonics]:
    """One effect for each joint that has such orders."""
    by_joint: dict[str, list[float]] = {}
    for joint, order in orders:
        by_joint.setdefault(joint, []).append(order)
    return [
        Harmonics(joints=(joint,), orders=tuple(sorted(set(own))), tolerance=SHARP_TOLERANCE)
        for joint, own in sorted(by_joint.items())
    ]


TOGETHER = "geometry and all effects"
SHARPENING = "orders of gears and motors"
LEAVING_OUT = "cross-validation"

START_LOG_VARIANCE = 2.0
"""Log variance of every group to start from: from a size that is next to nothing the scoring would hardly come back."""

STARTS = 2
"""From which orders are looked for: what the whole model leaves, and lines that were found in what geometry leaves."""

SHARPENINGS = 4
"""Searches for sharp orders from a start, at most; each finds what stood behind the clearest ones. A convention that bounds the
time."""

SHARPENING_ROUNDS = 2
"""Of a fit between, which need not be at its end."""

MIN_START_DEVIATION = 1e-6
"""Standard deviation of single poses at least to start from, metres and radians. A convention: below all that is measured, so
that the scoring moves off zero."""


@dataclass(frozen=True, eq=False, kw_only=True)
class GroupModelFound:
    """The one model of a campaign."""

    fitted: GroupFit
    calibration: Calibration
    errors: LeftOutErrors
    effects: tuple[Effect, ...]
    """All that take part, beside those of the model it started from."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Sharpened:
    """A fit of the whole model with lines of gears and motors."""

    others: tuple[Effect, ...]
    """All other effects."""
    lines: list[tuple[str, float]]
    """Joints and orders."""
    fitted: GroupFit

    @property
    def effects(self) -> tuple[Effect, ...]:
        """All that take part."""
        return (*self.others, *as_effects(self.lines))

    @property
    def log_posterior(self) -> float:
        """Log evidence; every order was as likely as any other before."""
        each = np.log(max(orders_tried(self.fitted, LOWEST_LINE), 1.0))
        return self.fitted.end.log_evidence - len(self.lines) * float(each)


def sharpen(
    base: Calibration,
    campaign: Campaign,
    start: Sharpened,
    options: FitOptions,
    like: Calibration | None,
) -> Sharpened:
    """Lines and clear orders that are proven in what the whole model leaves, and the fit with them.

    Args:
        base: a calibration of the geometry.
        campaign: the measurements.
        start: a fit, with the lines of which it is known.
        options: of the fit.
        like: a sibling whose sizes are expected.
    """
    fitted, lines = start.fitted, start.lines
    clear: dict[str, tuple[str, float]] = {}
    for _ in range(SHARPENINGS):
        clearer = find_clear_orders(fitted, SPECTRUM.name)
        new = [line for line in find_sharp_orders(fitted, LOWEST_LINE) if line not in lines]
        if not new and not clearer:
            break
        lines, clear = lines + new, clear | clearer
        effects = (*start.others, *as_effects(lines))
        fitted = _fit(base, campaign, effects, options, fitted, SHARPENING_ROUNDS, clear, like)
    if lines != start.lines or clear:
        fitted = _fit(base, campaign, (*start.others, *as_effects(lines)), options, fitted, apart=clear, like=like)
    return replace(start, lines=lines, fitted=fitted)


def find_group_model(
    base: Calibration,
    campaign: Campaign,
    competing: Sequence[Effect],
    instead: Sequence[Effect],
    parts: Sequence[Int[np.ndarray, " _"]],
    options: FitOptions,
    *,
    seed: int,
    progress: Callable[[str], None],
) -> GroupModelFound:
    """Geometry and all effects at once.

    Args:
        base: a calibration of the geometry, and of effects that are certain.
        campaign: the measurements.
        competing: effects that take part, each as far as the data prove it.
        instead: effects that replace those with which they have parameters in common, where the evidence is for them.
        parts: rows of each fold of the cross-validation.
        options: of the fit; `keep` names geometric parameters.
        seed: of draws.
        progress: told what is being done.

    Raises:
        FitError: the fit ran away.
    """
    progress(TOGETHER)
    effects = tuple(competing)
    fitted = _fit(base, campaign, effects, options, None)
    help, like = None, options.like
    if like is not None and has_own_sizes(like):
        groups, errors = fitted.group_model.groups, fitted.errors
        tried = _fit(base, campaign, effects, options, None, like=like)
        gain = evidence_under(tried.end, tried.group_model.groups, tried.errors) - evidence_under(
            fitted.end, groups, errors
        )
        help = Help(like=like, gain=gain, untold=untold_effects(fitted.group_model, like))
        fitted = tried if help.taken else fitted
    like = help.like if help is not None and help.taken else None
    for other in instead:
        progress(other.name)
        replaced = (*(effect for effect in effects if not _share(effect, other, base.model)), other)
        tried = _fit(base, campaign, replaced, options, None, like=like)
        if tried.end.log_evidence > fitted.end.log_evidence:
            effects, fitted = replaced, tried
    if SPECTRUM in effects:
        progress(SHARPENING)
        start = Sharpened(others=effects, lines=[], fitted=fitted)
        best, lines = sharpen(base, campaign, start, options, like), list[tuple[str, float]]()
        if fitted.end.y.size < fitted.end.A.shape[2]:  # more parameters than numbers follow any line
            lines = find_lines(base, campaign, options)
        if set(lines) - set(best.lines):
            progress(SHARPENING)
            first = prove_lines(base, campaign, lines, start, options, like)
            again = sharpen(base, campaign, first, options, like) if first.lines else first
            best = again if again.log_posterior > best.log_posterior else best
        effects, fitted = best.effects, best.fitted
    progress(LEAVING_OUT)
    names = [effect.name for effect in (*base.model.effects, *effects)]
    errors = validate_groups(fitted, parts, names, np.random.default_rng(seed))
    stretch = errors.stretch * region_factor(fitted.end.freedom)
    fit = posterior_of(fitted, campaign, options, stretch, errors.growth, np.random.default_rng(seed), help)
    return GroupModelFound(fitted=fitted, calibration=fit.calibration, errors=errors, effects=effects)


def _fit(
    base: Calibration,
    campaign: Campaign,
    effects: Sequence[Effect],
    options: FitOptions,
    before: GroupFit | None,
    most_rounds: int = MAX_ROUNDS,
    apart: Mapping[str, tuple[str, float]] = EMPTY,
    like: Calibration | None = None,
) -> GroupFit:
    given = base.model
    model = ErrorModel(given.robot, lengths_only=given.lengths_only, effects=(*given.effects, *effects))
    problem = _problem(base, model, campaign, options)
    one = assemble(problem, options.keep, options, apart)
    start, names = problem.layout.start(), problem.layout.names
    held = dict(zip(base.all_names, base.z, strict=True))
    if before is not None:
        held |= dict(zip(before.group_model.problem.layout.names, before.z, strict=True))
    for i, name in enumerate(names):
        start[i] = held.get(name, start[i])
    errors = _first_errors(base, options, len(model.robot.joints)) if before is None else before.errors
    if like is not None:
        one = expecting(one, like)
        errors = expecting_errors(errors, like, problem.linearise(start), problem) if before is None else errors
    weights = None if before is None else before.end.weights
    return fit_group_model(one, start, errors, _first_sizes(one, before), weights, most_rounds=most_rounds)


def _share(one: Effect, other: Effect, model: ErrorModel) -> bool:
    """Whether two effects have a parameter in common."""
    return bool(set(one.term(model.robot).names) & set(other.term(model.robot).names))


def _problem(base: Calibration, model: ErrorModel, campaign: Campaign, options: FitOptions) -> Problem:
    layout = layout_of(model, np.arange(len(model)), base.layout.registration, campaign, fixed=base.layout.fixed_frames)
    return problem_of(layout, campaign, options.noise)


def _first_sizes(one: GroupModel, before: GroupFit | None) -> np.ndarray:
    """Large ones, or those of the fit before."""
    known = {} if before is None else dict(zip(before.group_model.labels, before.found.log_variances, strict=True))
    return np.array([known.get(label, START_LOG_VARIANCE) for label in one.labels])


def _first_errors(base: Calibration, options: FitOptions, joints: int) -> PoseNoise:
    """Half of what geometry alone left, of every kind; or what was given, and nothing else."""
    given = not isinstance(options.model_error, str)
    size = [max(error if given else 0.5 * error, 0.0 if given else MIN_START_DEVIATION) for error in base.model_error]
    return PoseNoise(
        position=max(size[0] ** 2, MIN_VARIANCE),
        rotation=max(size[1] ** 2, MIN_VARIANCE) if base.layout.block_size == 6 else None,
        joints=np.full(joints, MIN_VARIANCE if given else size[0] ** 2),
        searched=not given,
    )
