"""The fit's hyperparameters: how large groups of parameters are, and what single poses add, by marginal likelihood.

About an estimate the residuals are linear in all parameters. A group's parameters have the tolerances that are stated for them,
times one factor that the data tell (`group_variances`). What single poses add is found beside it (`PoseNoise`). Geometry alone is
one group, its poses have a white error. With effects, each effect of each joint is a group of its own, and so are the geometry's
lengths and its angles; joints err at single poses, too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import FitError
from taskcal.estimation.group_variances import MAX_STEPS, MIN_GAIN, Evidence, GroupEquations, Groups, find_sizes
from taskcal.estimation.matrices import inverse_factors
from taskcal.estimation.prior import Squared
from taskcal.identification.layout import FRAME_SIZE, PriorOfEstimate, frame_precision
from taskcal.identification.options import FitOptions
from taskcal.identification.problem import Linearisation, Problem
from taskcal.kernels.chunks import in_chunks

# What no parameter explains at a single pose: the tracker's noise, a white error of the target, and one of every
# joint.
#
# A joint that stands a little off turns and shifts all that it carries, so that errors of position and rotation,
# and of several targets, belong together:
#
#     R_i = N_i + σ_p²·1 + σ_r²·1 + Σ_j σ_j² c_ij·c_ijᵀ,   c_ij the movement of all that was measured at pose i by joint j
#
# The variances are those of the largest marginal likelihood, by Fisher scoring (Harville 1977) in turn with the
# estimate; the information is that of single poses, without what poses have in common through the estimate.

TYPICAL, WIDTH = 5e-5, 3.0
"""Expected standard deviation, metres and radians: what industrial robots repeat to; and that of its square's logarithm."""

FREEDOM = 8.0
"""Degrees of freedom of the t-distribution that single poses' errors are expected to have. A convention: tails longer than a
normal distribution's, as errors of measured robots have."""

MIN_VARIANCE = 1e-14
"""Variance under which there is nothing, m² and rad²."""

CHANGE = 0.01, 100.0
"""Factors between which one step of the scoring changes a variance: never to zero, from where it could not come back."""

FLAT = 1e12
"""Variance of a log variance of which nothing is expected."""

MIN_FREEDOM = 3.0
"""Degrees of freedom, at least, that a pose's variance is taken to be known from. A convention: the fewest, as a whole number, of
which a t-distribution has a covariance."""


def region_factor(freedom: float) -> float:
    """Factor of a covariance, scaled by a variance of so many degrees of freedom, that gives 95 % regions their coverage.

    The 95 % region of a normal distribution with the widened covariance, in three dimensions, is that of the t-distribution with
    the plain one: 3·F(0.95; 3, ν) in place of χ²(0.95; 3), as the coverage factor of JCGM 100:2008, G.3.
    """
    if not np.isfinite(freedom):
        return 1.0
    from scipy.special import chdtri, fdtri

    return float(3.0 * fdtri(3.0, max(freedom, MIN_FREEDOM), 0.95) / chdtri(3.0, 0.05))


@dataclass(frozen=True, eq=False, kw_only=True)
class PoseNoise:
    """Variances of what single poses add."""

    position: float
    """Of each axis, m²."""
    rotation: float | None
    """Of each axis, rad²; None where points were measured."""
    joints: Float[np.ndarray, " joints"]
    """Of every joint, rad² (m² where it slides)."""
    searched: bool = True
    """Whether they are estimated."""
    expected: float | Float[np.ndarray, " k"] = TYPICAL**2
    """Variances that are expected."""
    width: float | Float[np.ndarray, " k"] = WIDTH
    """Standard deviation of the variances' logarithms about those; infinite where nothing is expected."""

    @property
    def variances(self) -> Float[np.ndarray, " k"]:
        """All of them, one behind another."""
        own = [self.position] if self.rotation is None else [self.position, self.rotation]
        return np.array([*own, *self.joints])

    def with_variances(self, variances: Float[np.ndarray, " k"]) -> "PoseNoise":
        """The same with other values."""
        first = 1 if self.rotation is None else 2
        rotation = None if self.rotation is None else float(variances[1])
        return replace(self, position=float(variances[0]), rotation=rotation, joints=variances[first:])

    def covariance(self, at: Linearisation, noise: Float[np.ndarray, "n targets b b"]) -> Float[np.ndarray, "n m m"]:
        """Covariance of every pose; the identity where nothing was seen."""
        n, targets, b = noise.shape[:3]
        R = np.zeros((n, targets * b, targets * b))
        for t in range(targets):
            R[:, t * b : (t + 1) * b, t * b : (t + 1) * b] = noise[:, t]
        for variance, part in zip(self.variances, at.units_of_noise, strict=True):
            R += variance * part
        both = at.seen[:, :, None] & at.seen[:, None, :]
        return np.where(both, R, np.eye(targets * b))


@dataclass(frozen=True, eq=False, kw_only=True)
class NoiseStep:
    """One step of the scoring of what single poses add."""

    errors: PoseNoise
    """Behind the step."""
    gain: float = 0.0
    """Expected gain of the variances' log posterior."""
    deviations: Float[np.ndarray, " k"]
    """Standard errors of the variances, before it."""
    information: Float[np.ndarray, "k k"]
    """Of the logarithms of the variances by the rows alone, before it."""
    freedom: float = np.inf
    """Degrees of freedom of the variance of a pose as a whole, the instrument's noise, which is known, included: twice its square
    over its own variance (Welch and Satterthwaite, JCGM 100:2008, G.4). Infinite where nothing is estimated."""


def score_noise(
    errors: PoseNoise,
    at: Linearisation,
    whitener: Float[np.ndarray, "n m m"],
    left: Float[np.ndarray, "n m"],
    explained: Float[np.ndarray, "n m m"],
) -> NoiseStep:
    """One step of the scoring.

    Args:
        errors: the variances so far.
        at: the rows.
        whitener: W with W·R·Wᵀ = 1 at every pose.
        left: whitened residuals of the estimate, with the weights of the poses.
        explained: covariance of what the estimate predicts of each pose, likewise.
    """
    variances = errors.variances
    own = np.eye(left.shape[1]) - explained
    white = [whitener @ part @ np.swapaxes(whitener, 1, 2) for part in at.units_of_noise]
    judged = [own @ part for part in white]
    traces = np.array([np.trace(seen, axis1=1, axis2=2).sum() for seen in judged])
    gradient = 0.5 * (np.array([np.einsum("ni,nij,nj", left, part, left) for part in white]) - traces)
    flat = np.array([seen.reshape(-1) for seen in judged])
    turned = np.array([np.swapaxes(seen, 1, 2).reshape(-1) for seen in judged])
    information = 0.5 * (flat @ turned.T) * np.outer(variances, variances)
    errors_of = variances / np.sqrt(np.diag(information))
    by_rows = information.copy()
    # in whitened units the share of each in the variance of a pose is a mean over all numbers
    share = variances * np.array([np.trace(part, axis1=1, axis2=2).sum() for part in white]) / at.seen.sum()
    expected = np.eye(len(variances)) / np.square(errors.width)
    told = information + np.maximum(expected, np.eye(len(variances)) / FLAT)
    freedom = 2.0 / float(share @ np.linalg.solve(told, share))
    if not len(errors.joints):
        # correlations of all poses included it is (tr)² over the numbers that are left to judge by, or more: of few poses, what
        # they have each by itself would go too far. How parameters share these among two kinds of numbers is not known
        numbers = float(at.seen.sum()) / len(variances)
        taken = float(np.trace(explained, axis1=1, axis2=2).sum()) if len(variances) == 1 else 0.0
        least = 0.5 * (traces * variances) ** 2 / max(numbers - taken, 1.0)
        np.fill_diagonal(information, np.maximum(np.diag(information), least))
    information += expected
    gradient = gradient * variances - np.log(variances / errors.expected) / np.square(errors.width)
    step = np.linalg.solve(information, gradient)
    changed = np.maximum(variances * np.clip(1.0 + step, *CHANGE), MIN_VARIANCE)
    return NoiseStep(
        errors=errors.with_variances(changed),
        gain=float(step @ gradient),
        deviations=errors_of,
        information=by_rows,
        freedom=freedom,
    )


def weigh(square: Float[np.ndarray, " n"], numbers: Int[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Weight of a pose whose error has this squared length in units of its covariance, made up of so many numbers.

    Errors of real robots have longer tails than normal ones: each pose's covariance is divided by a weight of its own, drawn
    from a gamma distribution of mean 1, so that errors are t-distributed with `FREEDOM` degrees of freedom (Lange, Little and
    Taylor 1989, Journal of the American Statistical Association 84).
    """
    return (FREEDOM + numbers) / (FREEDOM + square)


def log_weights(weights: Float[np.ndarray, " n"]) -> float:
    """Log density of weights, but for what it is where all are 1."""
    return float(0.5 * FREEDOM * (np.log(weights) - weights + 1.0).sum())


def of_targets(blocks: Float[np.ndarray, "n m m"], targets: int) -> Float[np.ndarray, "n targets b b"]:
    """The block of each target alone."""
    width = blocks.shape[1] // targets
    parts = [slice(t * width, (t + 1) * width) for t in range(targets)]
    return np.stack([blocks[:, part, part] for part in parts], axis=1)


def whiteners(R: Float[np.ndarray, "n m m"]) -> Float[np.ndarray, "n m m"]:
    """Lower triangular W with W·R·Wᵀ = 1 at every pose."""
    return inverse_factors(R)


GEOMETRY_WIDTH = 3.0
"""Standard deviation of the log variances of the geometry about its tolerances: a factor of 4.5 in size. A convention, as of
the effects (docs/theory/group-model.md)."""

COMMON_WIDTH, EFFECT_WIDTH, JOINT_WIDTH = 4.0, 3.0, 1.0
"""The same of what all effects have in common, of each effect beside that, and of each joint beside the others."""

MAX_ROUNDS = 8
"""Rounds, at most, of linearisation, sizes and pose noise. A convention: what the last rounds change is told in `reason`."""

MAX_SEARCH_STEPS = 40
"""Steps of sizes and pose noise about one estimate, at most."""

SETTLED_GAIN = 1e-4
"""Expected gain of log posterior by a step about one estimate at which it has settled: a hundredth of a standard error."""

REVERSED_SHARE = 0.5
"""Share of a log variance's last change that a change back may have, at most: steps that alternate shrink, as in a bisection.
Without it, variances of as few numbers as there are parameters swing between two values for ever."""

SETTLED_SIZE = 1e-2
"""Change of a log variance by such a step at which sizes have settled. A convention: 0.5 % in size."""

MAX_SAMPLED_POSES = 300
"""Poses, at most, evenly among all, that pose noise is estimated from. A convention: variances of 300 poses are known to some 8
%."""

POSES_AT_ONCE = 128
"""Poses of a thread."""

SETTLED_ERRORS = 0.1
"""Change of a log variance, in its standard errors, under which it has settled. A convention: a tenth of what the data leave
open."""

NO_PRIOR = 1e3
"""Standard deviation over the tolerance of parameters without a prior where hyperparameters are sought: as good as none."""

GEOMETRY = "geometry"

EMPTY: Mapping[str, tuple[str, float]] = MappingProxyType({})


@dataclass(frozen=True)
class Group:
    """Parameters of one effect that share a size."""

    owner: str
    """The joint, or what else the effect is of."""
    effect: str
    """Name of the effect; ``geometry`` for lengths and angles of the robot."""
    part: str = ""
    """What of the effect it is, where some of it has a size of its own."""


@dataclass(frozen=True, eq=False, kw_only=True)
class GroupModel:
    """A problem, and the groups of its parameters."""

    problem: Problem
    """In the layout of all parameters that are to be estimated or considered."""
    estimated: Bool[np.ndarray, " z"]
    """Entries that are estimated; the others are considered."""
    labels: tuple[Group, ...]
    groups: Groups
    """Groups, as the equations take them."""
    scale: Float[np.ndarray, " z"]
    """Standard deviation of each entry where its group's factor is 1; natural size of those without a group."""
    origin: Float[np.ndarray, " z"]
    """Where the entries are expected."""
    axes: Float[np.ndarray, "z z"] | None = None
    """C with C·Cᵀ the prior's correlation of the entries; None where they are independent."""
    tails: bool = False
    """Whether errors of single poses are t-distributed, and judged by some of the poses where there are many."""

    def of_effect(self, name: str) -> Int[np.ndarray, " k"]:
        """Groups of an effect."""
        return np.flatnonzero([label.effect == name for label in self.labels])

    def judged(self) -> Int[np.ndarray, " k"]:
        """Poses that pose noise is estimated from."""
        n = len(self.problem.q)
        return sampled_poses(n) if self.tails else np.arange(n)

    def units_of(self, z: Float[np.ndarray, " z"]) -> Float[np.ndarray, " z"]:
        """An estimate in the equations' units."""
        x = np.where(self.estimated, (z - self.origin) / self.scale, 0.0)
        return x if self.axes is None else np.linalg.solve(self.axes, x)

    def estimate_of(self, x: Float[np.ndarray, " z"]) -> Float[np.ndarray, " z"]:
        """An estimate from the equations' units."""
        return self.origin + self.scale * (x if self.axes is None else self.axes @ x)

    def scaled(self, rows: Float[np.ndarray, "*n z"]) -> Float[np.ndarray, "*n z"]:
        """Derivatives by the entries in the equations' units; none by those that are considered."""
        own = rows * np.where(self.estimated, self.scale, 0.0)
        return own if self.axes is None else own @ self.axes

    def equations(
        self, z: Float[np.ndarray, " z"], gradient: Float[np.ndarray, " z"], information: Float[np.ndarray, "z z"]
    ) -> GroupEquations:
        """Normal equations about an estimate; the square is left out."""
        H = self.scaled(self.scaled(information).T)
        return GroupEquations(groups=self.groups, given=H, b=self.scaled(gradient) + H @ self.units_of(z), square=0.0)


def expected_spread(labels: Sequence[Group]) -> Float[np.ndarray, "groups groups"]:
    """Covariance of the logarithms of the groups' variances before anything is measured.

    A robot on which most effects are next to nothing has others that are, and the joints of a robot are built alike.
    """
    names, parts = np.array([label.effect for label in labels]), np.array([label.part for label in labels])
    geometric = names == GEOMETRY
    same = (names[:, None] == names) & (parts[:, None] == parts)
    of_effects = np.full((len(names), len(names)), COMMON_WIDTH**2)
    of_effects += EFFECT_WIDTH**2 * same + JOINT_WIDTH**2 * np.eye(len(names))
    of_effects[geometric] = of_effects[:, geometric] = 0.0
    return of_effects + GEOMETRY_WIDTH**2 * np.diag(geometric.astype(float))


def geometry_alone(problem: Problem, prior: PriorOfEstimate, options: FitOptions) -> GroupModel:
    """One group of all parameters, its factor the prior's scale."""
    k, sizes, given = len(prior.sizes), prior.sizes, prior.parameters
    free = k if given is None else 0
    held = np.eye(free + len(prior.frames)) / NO_PRIOR**2
    held[free:, free:] = prior.frames * FRAME_SIZE**2
    axes = None
    if given is not None and (given.covariance - np.diag(sizes**2)).any():
        axes = np.eye(len(prior.scale))
        axes[:k, :k] = np.linalg.cholesky(given.covariance / sizes / sizes[:, None])
    found = isinstance(options.prior_scale, str)
    scale = 1.0 if found else float(options.prior_scale)
    one = () if given is None else (Group("all", GEOMETRY),)
    return GroupModel(
        problem=problem,
        estimated=np.ones(len(prior.scale), dtype=bool),
        labels=one,
        groups=Groups(
            group=np.where(np.arange(len(prior.scale)) < k * len(one), 0, -1),
            held=held,
            location=np.full(len(one), 2.0 * np.log(scale)),
            spread=np.full((len(one),) * 2, FLAT if found else 0.0),
        ),
        scale=prior.scale,
        origin=prior.mean,
        axes=axes,
    )


def assemble(
    problem: Problem, keep: Sequence[str] | None, options: FitOptions, apart: Mapping[str, tuple[str, float]] = EMPTY
) -> GroupModel:
    """The groups of a problem with effects.

    Args:
        problem: in the layout of all parameters, effects among them.
        keep: names of the geometric parameters to estimate; None for all. Effects are always estimated.
        options: of the fit.
        apart: parameters that have a size of their own, with what those have in common that share it and the tolerance of each.
    """
    layout = problem.layout
    model, names = layout.model, layout.names
    rows = problem.q[problem.seen.valid.any(axis=1)]
    owner_of: dict[str, tuple[str, str]] = {}
    share: dict[str, float] = {}
    for effect in model.effects:
        own = effect.term(model.robot).names
        owner_of |= {name: (name.partition(".")[0], effect.name) for name in own}
        share |= dict(zip(own, effect.participation(model.robot, rows).tolist(), strict=True))
    labels: list[Group] = []
    group = np.full(len(names), -1)
    scale = np.full(len(names), FRAME_SIZE)
    for i, name in enumerate(names[: len(model)]):
        unit = model.parameters[i].unit
        part, tolerance = apart.get(name, ("", model.tolerances[i]))
        label = (
            Group(*owner_of[name], part)
            if name in owner_of
            else Group("lengths" if unit == "m" else "angles", GEOMETRY)
        )
        if label not in labels:
            labels.append(label)
        group[i], scale[i] = labels.index(label), tolerance * share.get(name, 1.0)
    estimated = np.ones(len(names), dtype=bool)
    if keep is not None:
        estimated[: len(model)] = [name in owner_of for name in model.names]
        estimated[model.indices(keep)] = True
    location, spread = np.zeros(len(labels)), expected_spread(labels)
    if not isinstance(options.prior_scale, str):
        own = [i for i, label in enumerate(labels) if label.effect == GEOMETRY]
        location[own], spread[own] = 2.0 * np.log(options.prior_scale), 0.0
    held = np.zeros((0, 0)) if layout.fixed_frames else frame_precision(layout) * FRAME_SIZE**2
    return GroupModel(
        problem=problem,
        estimated=estimated,
        labels=tuple(labels),
        groups=Groups(group=group, held=held, location=location, spread=spread),
        scale=scale,
        origin=layout.start(),
        tails=True,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class GroupFit:
    """The model at its likeliest sizes."""

    group_model: GroupModel
    z: Float[np.ndarray, " z"]
    """Where the rows were linearised last."""
    at: Linearisation
    errors: PoseNoise
    weights: Float[np.ndarray, " n"]
    """How far the errors of single poses are believed to be of the size of most."""
    by_loss: Float[np.ndarray, "n m"]
    """Weight of every number under the loss."""
    whitener: Float[np.ndarray, "n m m"]
    """With both weights in it."""
    A: Float[np.ndarray, "n m z"]
    y: Float[np.ndarray, "n m"]
    """Whitened and scaled rows: y = A·x."""
    stated: tuple[Float[np.ndarray, "k z"], Float[np.ndarray, " k"]]
    """The same for what is known beside the measurements."""
    found: Evidence
    """At the likeliest sizes under these errors."""
    rounds: int = 0


def fit_group_model(
    one: GroupModel,
    start: Float[np.ndarray, " z"],
    errors: PoseNoise,
    options: FitOptions,
    sizes: np.ndarray | None = None,
    weights: np.ndarray | None = None,
    most_rounds: int = MAX_ROUNDS,
) -> GroupFit:
    """Estimate all parameters, the sizes of their groups, and what single poses add.

    Args:
        one: the model.
        start: an estimate to linearise at first.
        errors: of single poses, to start from, or to hold.
        options: of the fit; its loss weighs the poses.
        sizes: log variances to start from.
        weights: of the poses, to start from.
        most_rounds: of linearisation, sizes and row errors in turn.

    Raises:
        FitError: the sizes or the estimate ran away.
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    z = start
    sizes = one.groups.location if sizes is None else sizes
    weights = np.ones(len(one.problem.q)) if weights is None else weights
    rounds, still = 0, False
    while rounds < most_rounds and not still:
        rounds += 1
        fitted = _fit_once(one, z, one.problem.linearise(z), errors, weights, options, sizes)
        following = one.estimate_of(fitted.found.mean)
        if not np.isfinite(following).all():
            raise FitError(
                "the fit of geometry and effects ran away; check the campaign with a robust loss (loss=Cauchy())"
            )
        step, weights = score(fitted)
        scored = step.errors
        grouped = one.groups.grouped
        moved = np.abs(following - z)[grouped].max() / one.scale[grouped].max()
        steps = np.abs(fitted.found.log_variances - sizes).max()
        steps = max(steps, np.abs(np.log(scored.variances / errors.variances)).max())
        still = rounds > 2 and bool(moved < 1.0 and steps < SETTLED_ERRORS)
        z, errors, sizes = following, scored, fitted.found.log_variances
    fitted = _fit_once(one, z, one.problem.linearise(z), errors, weights, options, sizes)
    return replace(fitted, rounds=rounds)


def search_about(
    one: GroupModel, z: Float[np.ndarray, " z"], errors: PoseNoise, options: FitOptions, sizes: np.ndarray
) -> tuple[GroupFit, NoiseStep]:
    """Errors of single poses and log variances of the groups on rows that are linear about an estimate, until both settle.

    Args:
        one: the model.
        z: the estimate.
        errors: to start from, or to hold.
        options: of the fit; its loss weighs the poses.
        sizes: log variances to start from.

    Returns:
        the fit under the errors of the last step but one, and that last step.
    """
    at = one.problem.linearise(z, joints=bool(len(errors.joints)))
    weights = np.ones(len(one.problem.q))
    fitted, moved = _fit_once(one, z, at, errors, weights, options, sizes, steps=1), np.inf
    last = np.zeros(len(errors.variances))
    step, weights = score(fitted)
    for _ in range(MAX_SEARCH_STEPS):
        if errors.searched:
            errors, last = _without_cycles(fitted.errors, step.errors, last)
        if (step.gain < SETTLED_GAIN or not last.any()) and moved < SETTLED_SIZE:
            break
        sizes = fitted.found.log_variances
        fitted = _fit_once(one, z, at, errors, weights, options, sizes, steps=1)
        moved = float(np.abs(fitted.found.log_variances - sizes).max(initial=0.0))
        step, weights = score(fitted)
    return fitted, replace(step, errors=errors)


def _without_cycles(
    before: PoseNoise, after: PoseNoise, last: Float[np.ndarray, " k"]
) -> tuple[PoseNoise, Float[np.ndarray, " k"]]:
    """A step of the scoring, shortened where a log variance turns back, and the changes of the log variances by it.

    Args:
        before: where the step starts.
        after: where it ends.
        last: changes of the log variances by the step before.
    """
    change, most = np.log(after.variances / before.variances), REVERSED_SHARE * np.abs(last)
    change = np.where(change * last < 0.0, np.clip(change, -most, most), change)
    return after.with_variances(before.variances * np.exp(change)), change


def fit_about(
    one: GroupModel, z: Float[np.ndarray, " z"], errors: PoseNoise, options: FitOptions, sizes: np.ndarray
) -> GroupFit:
    """The model on rows that are linear about an estimate, with errors of single poses as they are.

    Args:
        one: the model.
        z: the estimate.
        errors: of single poses.
        options: of the fit; its loss weighs the poses.
        sizes: log variances to start from.
    """
    at = one.problem.linearise(z, joints=bool(len(errors.joints)))
    return _fit_once(one, z, at, errors, np.ones(len(one.problem.q)), options, sizes, steps=1)


def _fit_once(
    one: GroupModel,
    z: np.ndarray,
    at: Linearisation,
    errors: PoseNoise,
    weights: np.ndarray,
    options: FitOptions,
    sizes: np.ndarray,
    steps: int = MAX_STEPS,
) -> GroupFit:
    """Sizes under given errors of single poses, or as many steps towards them."""
    W = whiteners(errors.covariance(at, one.problem.noise))
    by_loss = _by_loss(at, W, one.problem, options)
    W = W * np.sqrt(weights[:, None] * by_loss)[:, :, None]
    A = np.empty_like(at.by_entry)

    def whiten(rows: slice) -> None:
        A[rows] = one.scaled(W[rows] @ at.by_entry[rows])

    in_chunks(whiten, len(A), POSES_AT_ONCE)
    x = one.units_of(z)
    y = np.einsum("nij,nj->ni", W, at.residual) + A @ x
    known = one.problem.stated(z)
    stated = one.scaled(known.by_entry)
    told = known.residual + stated @ x
    rows = np.concatenate([A.reshape(y.size, len(z)), stated]), np.concatenate([y.reshape(-1), told])
    return GroupFit(
        group_model=one,
        z=z,
        at=at,
        errors=errors,
        weights=weights,
        by_loss=by_loss,
        whitener=W,
        A=A,
        y=y,
        stated=(stated, told),
        found=find_sizes(GroupEquations.of_rows(*rows, one.groups), sizes, steps, MIN_GAIN if steps > 1 else 0.0),
    )


def _by_loss(at: Linearisation, W: np.ndarray, problem: Problem, options: FitOptions) -> Float[np.ndarray, "n m"]:
    """Weight of each number under the loss: by the root mean square of its target's whitened residuals."""
    n, targets = problem.seen.valid.shape
    if isinstance(options.loss, Squared):
        return np.ones(at.residual.shape)
    white = np.einsum("nij,nj->ni", W, at.residual)
    by_target = np.sqrt((white.reshape(n, targets, -1) ** 2).mean(axis=2))
    return np.repeat(options.loss.weights(by_target), white.shape[1] // targets, axis=1)


def sampled_poses(n: int) -> Int[np.ndarray, " k"]:
    """Poses that stand for all, evenly among them."""
    return np.unique(np.linspace(0, n - 1, min(n, MAX_SAMPLED_POSES)).astype(int))


def spread_to_all(values: Float[np.ndarray, " k"], n: int) -> Float[np.ndarray, " n"]:
    """Values of the sampled poses; for the others, among so many, the mean."""
    out = np.full(n, values.mean())
    out[sampled_poses(n)] = values
    return out


def score(fitted: GroupFit) -> tuple[NoiseStep, Float[np.ndarray, " n"]]:
    """Errors of single poses and weights of these, one step on."""
    one, A, errors, weights = fitted.group_model, fitted.A, fitted.errors, fitted.weights
    if not errors.searched:
        k = len(errors.variances)
        return NoiseStep(errors=errors, deviations=np.zeros(k), information=np.zeros((k, k))), weights
    n = len(A)
    left, judged = fitted.y - A @ fitted.found.mean, one.judged()
    explained = fitted.found.spread(A[judged])
    # covariances of poses are what is found over the weights: the whitener of what is found has none
    whitener = fitted.whitener[judged] / np.sqrt(weights[judged, None] * fitted.by_loss[judged])[:, :, None]
    at = fitted.at if len(judged) == n else fitted.at.take(judged)
    step = score_noise(errors, at, whitener, left[judged], explained)
    if one.tails:
        square = (left**2).sum(axis=1) / weights
        spread = np.trace(explained, axis1=1, axis2=2) / weights[judged]
        weights = weigh(square + spread_to_all(spread, n), fitted.at.seen.sum(axis=1))
    return step, weights


def log_evidence(fitted: GroupFit) -> float:
    """Log marginal likelihood of the fit, but for a constant of the campaign, as of an `identify`; sizes integrated out."""
    whitened = np.log(np.abs(np.diagonal(fitted.whitener, axis1=1, axis2=2))).sum()
    weighed = log_weights(fitted.weights[fitted.at.seen.any(axis=1)])
    return float(whitened + weighed + fitted.found.log_integrated())
