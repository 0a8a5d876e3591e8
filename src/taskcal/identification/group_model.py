"""Geometry, tracker frame and every effect at once, each group's size by marginal likelihood.

About an estimate the residuals are linear in all parameters. Each effect of each joint is a group of its own, and so are the
geometry's lengths and its angles; a group's parameters have the tolerances that are stated for them, times one factor that
the data tell (`group_variances`). What single poses add is found beside it (`PoseNoise`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import FitError
from taskcal.estimation.group_variances import GroupedFit, Groups, find_sizes, reduce_rows
from taskcal.identification.layout import frame_precision
from taskcal.identification.options import FitOptions
from taskcal.identification.problem import Linearisation, Problem, stated_rows
from taskcal.kernels.chunks import in_chunks

# What no parameter explains at a single pose: the tracker's noise, a white error of the target, and one of every
# joint.
#
# A joint that stands a little off turns and shifts all that it carries, so that errors of position and rotation,
# and of several targets, belong together:
#
#     R_i = N_i + σ_p²·1 + σ_r²·1 + Σ_j σ_j² c_ij·c_ijᵀ,   c_ij the movement of all that was measured at pose i by joint j
#
# The variances are those of the largest marginal likelihood, by Fisher scoring on their logarithms in turn with the
# estimate; the information is that of single poses, without what poses have in common through the estimate.

TYPICAL, WIDTH = 5e-5, 3.0
"""Expected standard deviation, metres and radians: what industrial robots repeat to; and that of its square's logarithm."""

FREEDOM = 8.0
"""Degrees of freedom of the t-distribution that single poses' errors are expected to have. A convention: tails longer than a
normal distribution's, as errors of measured robots have."""

MIN_VARIANCE = 1e-14
"""Variance under which there is nothing, m² and rad²."""

MAX_LOG_STEP = 1.5
"""Change of a log variance, at most, in one step of the scoring: a factor of 4.5. A convention that keeps the scoring where its
information holds."""


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

    def parts(self, at: Linearisation) -> list[Float[np.ndarray, "n m m"]]:
        """Covariance of every pose for a unit of each variance."""
        n, m = at.residual.shape
        b = 3 if self.rotation is None else 6
        own = [np.arange(m) % b < 3] if self.rotation is None else [np.arange(m) % b < 3, np.arange(m) % b >= 3]
        parts: list[np.ndarray] = [np.broadcast_to(np.diag(mask.astype(float)), (n, m, m)) for mask in own]
        columns = np.moveaxis(at.by_joint, 2, 0)
        return parts + [c[:, :, None] * c[:, None, :] for c in columns]

    def covariance(self, at: Linearisation, noise: Float[np.ndarray, "n targets b b"]) -> Float[np.ndarray, "n m m"]:
        """Covariance of every pose; the identity where nothing was seen."""
        n, targets, b = noise.shape[:3]
        R = np.zeros((n, targets * b, targets * b))
        for t in range(targets):
            R[:, t * b : (t + 1) * b, t * b : (t + 1) * b] = noise[:, t]
        for variance, part in zip(self.variances, self.parts(at), strict=True):
            R += variance * part
        both = at.seen[:, :, None] & at.seen[:, None, :]
        return np.where(both, R, np.eye(targets * b))


def score_noise(
    errors: PoseNoise,
    at: Linearisation,
    whitener: Float[np.ndarray, "n m m"],
    left: Float[np.ndarray, "n m"],
    explained: Float[np.ndarray, "n m m"],
) -> PoseNoise:
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
    white = [whitener @ part @ np.swapaxes(whitener, 1, 2) for part in errors.parts(at)]
    judged = [own @ part for part in white]
    gradient = np.array([
        0.5 * (np.einsum("ni,nij,nj", left, part, left) - np.trace(seen, axis1=1, axis2=2).sum())
        for part, seen in zip(white, judged, strict=True)
    ])  # fmt: skip
    flat = np.array([seen.reshape(-1) for seen in judged])
    turned = np.array([np.swapaxes(seen, 1, 2).reshape(-1) for seen in judged])
    information = 0.5 * (flat @ turned.T) * np.outer(variances, variances) + np.eye(len(variances)) / WIDTH**2
    gradient = gradient * variances - np.log(variances / TYPICAL**2) / WIDTH**2
    step = np.clip(np.linalg.solve(information, gradient), -MAX_LOG_STEP, MAX_LOG_STEP)
    return errors.with_variances(np.maximum(variances * np.exp(step), MIN_VARIANCE))


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
    return np.linalg.inv(np.linalg.cholesky(R))


GEOMETRY_WIDTH = 3.0
"""Standard deviation of the log variances of the geometry about its tolerances: a factor of 4.5 in size. A convention, as of
the effects (docs/theory/group-model.md)."""

COMMON_WIDTH, EFFECT_WIDTH, JOINT_WIDTH = 4.0, 3.0, 1.0
"""The same of what all effects have in common, of each effect beside that, and of each joint beside the others."""

MAX_ROUNDS = 8
"""Rounds, at most, of linearisation, sizes and pose noise. A convention: what the last rounds change is told in `reason`."""

MAX_SAMPLED_POSES = 300
"""Poses, at most, evenly among all, that pose noise is estimated from. A convention: variances of 300 poses are known to some 8
%."""

POSES_AT_ONCE = 128
"""Poses of a thread."""

SETTLED_ERRORS = 0.1
"""Change of a log variance, in its standard errors, under which it has settled. A convention: a tenth of what the data leave
open."""

FRAME_SCALE = 1e-3
"""Unit of tracker frame and targets in the equations, metres and radians."""

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
    """A problem with all effects, and its groups."""

    problem: Problem
    """In the layout of all parameters."""
    kept: Bool[np.ndarray, " z"]
    """Entries that are estimated; the others are considered."""
    labels: tuple[Group, ...]
    group: Int[np.ndarray, " z"]
    """Number of each entry's group, −1 for tracker frame and targets."""
    scale: Float[np.ndarray, " z"]
    """Standard deviation of each entry where its group's factor is 1."""
    geometry_factor: float | None
    """Given factor of the geometry's variances; None to find it."""

    @cached_property
    def groups(self) -> Groups:
        """Groups, as the equations take them."""
        location, spread = np.zeros(len(self.labels)), expected_spread(self.labels)
        if self.geometry_factor is not None:
            own = [i for i, label in enumerate(self.labels) if label.effect == GEOMETRY]
            location[own], spread[own] = np.log(self.geometry_factor), 0.0
        layout = self.problem.layout
        held = np.zeros((0, 0)) if layout.fixed_frames else frame_precision(layout) * FRAME_SCALE**2
        return Groups(group=self.group, held=held, location=location, spread=spread)

    def of_effect(self, name: str) -> Int[np.ndarray, " k"]:
        """Groups of an effect."""
        return np.flatnonzero([label.effect == name for label in self.labels])


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


def assemble(
    problem: Problem, kept: Sequence[str] | None, options: FitOptions, apart: Mapping[str, tuple[str, float]] = EMPTY
) -> GroupModel:
    """The groups of a problem.

    Args:
        problem: in the layout of all parameters, effects among them.
        kept: names of the geometric parameters to estimate; None for all. Effects are always estimated.
        options: of the fit.
        apart: parameters that have a size of their own, with what those have in common that share it and the tolerance of each.
    """
    model, names = problem.layout.model, problem.layout.names
    owner_of = {name: (name.partition(".")[0], effect) for name, effect in _effects_of(problem)}
    labels: list[Group] = []
    group = np.full(len(names), -1)
    scale = np.full(len(names), FRAME_SCALE)
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
        group[i], scale[i] = labels.index(label), tolerance
    estimated = np.ones(len(names), dtype=bool)
    if kept is not None:
        estimated[: len(model)] = [name in owner_of for name in model.names]
        estimated[model.indices(kept)] = True
    factor = None if isinstance(options.prior_scale, str) else float(options.prior_scale) ** 2
    return GroupModel(
        problem=problem, kept=estimated, labels=tuple(labels), group=group, scale=scale, geometry_factor=factor
    )


def _effects_of(problem: Problem) -> list[tuple[str, str]]:
    """Every parameter of an effect, and the effect's name."""
    model = problem.layout.model
    return [(name, effect.name) for effect in model.effects for name in effect.term(model.robot).names]


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
    whitener: Float[np.ndarray, "n m m"]
    """With the weights in it."""
    A: Float[np.ndarray, "n m z"]
    y: Float[np.ndarray, "n m"]
    """Whitened and scaled rows: y = A·x."""
    stated: tuple[Float[np.ndarray, "k z"], Float[np.ndarray, " k"]]
    """The same for what is known beside the measurements."""
    found: GroupedFit
    rounds: int


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
    z, origin = start, one.problem.layout.start()
    sizes = one.groups.location if sizes is None else sizes
    weights = np.ones(len(one.problem.q)) if weights is None else weights
    rounds, still = 0, False
    while rounds < most_rounds and not still:
        rounds += 1
        fitted = _fit_once(one, z, errors, weights, options, sizes, rounds)
        found, evidence = fitted.found, fitted.found.evidence
        x = found.reduced.mean(evidence.mean(one.groups.own))
        following = origin + one.scale * x
        if not np.isfinite(following).all():
            raise FitError(
                "the fit of geometry and effects ran away; check the campaign with a robust loss (loss=Cauchy())"
            )
        scored, weights = _score(fitted, x) if errors.searched else (errors, weights)
        moved = np.abs(following - z)[one.group >= 0].max() / one.scale[one.group >= 0].max()
        steps = np.abs(evidence.log_variances - sizes).max()
        if errors.searched:
            steps = max(steps, np.abs(np.log(scored.variances / errors.variances)).max())
        still = rounds > 2 and bool(moved < 1.0 and steps < SETTLED_ERRORS)
        z, errors, sizes = following, scored, evidence.log_variances
    return _fit_once(one, z, errors, weights, options, sizes, rounds)


def _fit_once(
    one: GroupModel,
    z: np.ndarray,
    errors: PoseNoise,
    weights: np.ndarray,
    options: FitOptions,
    sizes: np.ndarray,
    rounds: int,
) -> GroupFit:
    at = one.problem.linearise(z)
    W = whiteners(errors.covariance(at, one.problem.noise))
    W = W * np.sqrt(weights[:, None] * _by_loss(at, W, one.problem, options))[:, :, None]
    A, scale = np.empty_like(at.by_entry), np.where(one.kept, one.scale, 0.0)

    def whiten(rows: slice) -> None:
        np.multiply(W[rows] @ at.by_entry[rows], scale, out=A[rows])

    in_chunks(whiten, len(A), POSES_AT_ONCE)
    moved = np.where(one.kept, (z - one.problem.layout.start()) / one.scale, 0.0)
    y = np.einsum("nij,nj->ni", W, at.residual) + A @ moved
    stated = _stated(one, z)
    rows = np.concatenate([A.reshape(-1, A.shape[2]), stated[0]]), np.concatenate([y.reshape(-1), stated[1]])
    reduced = reduce_rows(*rows, one.groups)
    found = find_sizes(reduced, sizes)
    return GroupFit(
        group_model=one,
        z=z,
        at=at,
        errors=errors,
        weights=weights,
        whitener=W,
        A=A,
        y=y,
        stated=stated,
        found=found,
        rounds=rounds,
    )


def _stated(one: GroupModel, z: Float[np.ndarray, " z"]) -> tuple[Float[np.ndarray, "k z"], Float[np.ndarray, " k"]]:
    """Stated knowledge beside the measurements, as rows like theirs."""
    known = stated_rows(one.problem.layout, z, one.problem.seen.kinds)
    A = known.by_entry * one.scale
    return A, known.residual + A @ ((z - one.problem.layout.start()) / one.scale)


def _by_loss(at: Linearisation, W: np.ndarray, problem: Problem, options: FitOptions) -> Float[np.ndarray, "n m"]:
    """Weight of each number under the loss: by the root mean square of its target's whitened residuals."""
    white = np.einsum("nij,nj->ni", W, at.residual)
    n, targets = problem.seen.valid.shape
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


def _score(fitted: GroupFit, x: Float[np.ndarray, " z"]) -> tuple[PoseNoise, Float[np.ndarray, " n"]]:
    """The errors of single poses and the weights of these, one step on."""
    found, A = fitted.found, fitted.A
    S = found.reduced.covariance(found.evidence.spread)
    n, m = fitted.y.shape
    left, judged = fitted.y - A @ x, sampled_poses(n)
    followed = (A[judged].reshape(len(judged) * m, -1) @ S).reshape(len(judged), m, -1)
    explained = followed @ np.swapaxes(A[judged], 1, 2)
    square = (left**2).sum(axis=1) / fitted.weights
    spread = np.trace(explained, axis1=1, axis2=2) / fitted.weights[judged]
    weights = weigh(square + spread_to_all(spread, n), fitted.at.seen.sum(axis=1))
    whitener = fitted.whitener[judged] / np.sqrt(fitted.weights[judged, None, None])
    return score_noise(fitted.errors, fitted.at.take(judged), whitener, left[judged], explained), weights
