"""The fit's hyperparameters: how large groups of parameters are, and what single poses add, by marginal likelihood.

About an estimate the residuals are linear in all parameters. A group's parameters have the tolerances that are stated for them,
times one factor that the data tell (`group_variances`). What single poses add is found beside it (`PoseNoise`). Geometry alone is
one group, its poses have a white error. With effects, each effect of each joint is a group of its own, and so are the geometry's
lengths and its angles; joints err at single poses, too.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import FitError
from taskcal.estimation.group_variances import Evidence, GroupEquations, Groups
from taskcal.estimation.least_squares import Solution
from taskcal.estimation.noisy_rows import FLAT, MAX_STEPS, NoisyFit, NoisyRows, PoseNoise, maximise
from taskcal.identification.layout import FRAME_SIZE, PriorOfEstimate, frame_precision
from taskcal.identification.options import FitOptions
from taskcal.identification.problem import Linearisation, Problem

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


def of_targets(blocks: Float[np.ndarray, "n m m"], targets: int) -> Float[np.ndarray, "n targets b b"]:
    """The block of each target alone."""
    width = blocks.shape[1] // targets
    parts = [slice(t * width, (t + 1) * width) for t in range(targets)]
    return np.stack([blocks[:, part, part] for part in parts], axis=1)


GEOMETRY_WIDTH = 3.0
"""Standard deviation of the log variances of the geometry about its tolerances: a factor of 4.5 in size. A convention, as of
the effects (docs/theory/group-model.md)."""

COMMON_WIDTH, EFFECT_WIDTH, JOINT_WIDTH = 4.0, 3.0, 1.0
"""The same of what all effects have in common, of each effect beside that, and of each joint beside the others."""

MAX_ROUNDS = 8
"""Rounds, at most, of linearisation, sizes and pose noise. A convention: what the last rounds change is told in `reason`."""

SETTLED_GAIN, SETTLED_GROUPS = 1e-6, 1e-2
"""Gain of log posterior, expected of the next step, at which the search has settled, of geometry and with effects: a thousandth and
a seventh of a standard error of what is sought. Of some fifty sizes, most of which stand for next to nothing, the last steps gain
as little and cost as much as the first."""

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
    """Whether errors of single poses are t-distributed."""

    def of_effect(self, name: str) -> Int[np.ndarray, " k"]:
        """Groups of an effect."""
        return np.flatnonzero([label.effect == name for label in self.labels])

    @property
    def settled(self) -> float:
        """Gain of log posterior, expected of the next step, at which a search has settled."""
        return SETTLED_GROUPS if self.tails else SETTLED_GAIN

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

    def rows(self, z: Float[np.ndarray, " z"], at: Linearisation) -> NoisyRows:
        """The problem's rows, linear about an estimate, in the equations' units."""
        x, known = self.units_of(z), self.problem.stated(z)
        A, beside = self.scaled(at.by_entry), self.scaled(known.by_entry)
        return NoisyRows(
            groups=self.groups,
            A=A,
            y=at.residual + A @ x,
            seen=at.seen,
            noise=self.problem.noise,
            units=at.units_of_noise,
            beside=(beside, known.residual + beside @ x),
            tails=self.tails,
        )

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


def in_units(problem: Problem, deviations: Float[np.ndarray, " z"]) -> GroupModel:
    """No group: every entry in units of its known standard deviation, about its start."""
    z = len(deviations)
    no_group = Groups(group=np.full(z, -1), held=np.eye(z), location=np.zeros(0), spread=np.zeros((0, 0)))
    return GroupModel(
        problem=problem,
        estimated=np.ones(z, dtype=bool),
        labels=(),
        groups=no_group,
        scale=deviations,
        origin=problem.layout.start(),
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
    held = frame_precision(layout) * FRAME_SIZE**2
    return GroupModel(
        problem=problem,
        estimated=estimated,
        labels=tuple(labels),
        groups=Groups(group=group, held=held, location=location, spread=spread),
        scale=scale,
        origin=layout.start(),
        tails=True,
    )


class Moved(NamedTuple):
    """Where an estimate goes from the rows that are linear about it."""

    z: Float[np.ndarray, " z"]
    stands: bool
    """Whether nothing is gained by going there."""
    solution: Solution | None = None
    """The damped fit that ended there, if there was one."""


@dataclass(frozen=True, eq=False, kw_only=True)
class GroupFit:
    """A model under some errors of single poses, sizes of its groups and weights of its poses, on rows linear about an estimate."""

    group_model: GroupModel
    z: Float[np.ndarray, " z"]
    """The estimate."""
    at: Linearisation
    """Rows there …"""
    end: NoisyFit
    """… and what they say."""
    to: Moved
    """Where the estimate goes."""
    rounds: int = 0
    settled: bool = False
    """Whether nothing was to be gained any more when the rounds ended."""

    @property
    def errors(self) -> PoseNoise:
        """Of single poses."""
        return self.end.errors

    @property
    def found(self) -> Evidence:
        """Posterior and evidence."""
        return self.end.found


def fit_about(
    one: GroupModel,
    z: Float[np.ndarray, " z"],
    errors: PoseNoise,
    sizes: Float[np.ndarray, " groups"],
    weights: Float[np.ndarray, " n"] | None = None,
) -> GroupFit:
    """The model on rows that are linear about an estimate, all hyperparameters as they are.

    Args:
        one: the model.
        z: the estimate.
        errors: of single poses.
        sizes: log variances of the groups.
        weights: of the poses, 1 by default.

    Raises:
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    at = one.problem.linearise(z, joints=bool(len(errors.joints)))
    rows = one.rows(z, at)
    return GroupFit(group_model=one, z=z, at=at, end=rows.under(errors, sizes, weights), to=Moved(z, stands=True))


def to_mean(fitted: GroupFit) -> Moved:
    """To the posterior mean."""
    one, mean = fitted.group_model, fitted.found.mean
    return Moved(one.estimate_of(mean), stands=fitted.end.decrement(one.units_of(fitted.z)) < one.settled)


def fit_group_model(
    one: GroupModel,
    start: Float[np.ndarray, " z"],
    errors: PoseNoise,
    sizes: Float[np.ndarray, " groups"] | None = None,
    weights: Float[np.ndarray, " n"] | None = None,
    *,
    most_rounds: int = MAX_ROUNDS,
    move: Callable[[GroupFit], Moved] = to_mean,
) -> GroupFit:
    """Estimate all parameters, the sizes of their groups, and what single poses add.

    Rows are made linear about the estimate, the hyperparameters of largest marginal likelihood found on them, and the estimate goes
    where it is most probable under these, until neither gains.

    Args:
        one: the model.
        start: an estimate to linearise at first.
        errors: of single poses, to start from, or to hold.
        sizes: log variances to start from; those of held groups are not changed.
        weights: of the poses, to start from.
        most_rounds: of linearisation and search in turn, beside the first.
        move: where the estimate goes.

    Raises:
        FitError: the sizes or the estimate ran away.
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    z, rounds = start, 0
    sizes = one.groups.location if sizes is None else sizes
    while True:
        begun = fit_about(one, z, errors, one.groups.starting(sizes), weights)
        end, ended = maximise(begun.end, MAX_STEPS, one.settled)
        fitted, rounds = replace(begun, end=end), rounds + 1
        to = move(fitted)
        settled = ended and to.stands
        if settled or rounds > most_rounds:
            return replace(fitted, to=to, rounds=rounds, settled=settled)
        z, errors, sizes, weights = to.z, end.errors, end.found.log_variances, end.weights
        if not np.isfinite(z).all():
            raise FitError("the fit of geometry and effects ran away; check the campaign (taskcal doctor)")
