"""Linear-Gaussian models whose parameters come in groups, each group's size found by marginal likelihood.

    y = A·x + e,   e ~ N(0, 1),   x_i ~ N(0, v_g) for every i of group g,   log v ~ N(m, Ω)

Parameters without a group have a prior of their own. The log variances are those of the largest posterior (`noisy_rows`). With D
the prior's variances, K = (1 + √D·AᵀA·√D)⁻¹ and u = K·√D·Aᵀy, posterior covariance and mean in units of the prior's deviations,

    ∂ℓ/∂log v_g = ½ Σ_i (u_i² − 1 + K_ii),   E[−∂²ℓ/∂log v_g ∂log v_h] = ½ Σ_ij (δ_ij − K_ij)²,   i of g, j of h

(Harville 1977, Journal of the American Statistical Association 72; MacKay 1992, Neural Computation 4, for the same as "evidence").
Where there are fewer rows than parameters, the same follows from the covariance S = 1 + A·D·Aᵀ of the rows, in a part of the time:
1 − K = √D·Aᵀ·S⁻¹·A·√D. Parameters without a group are projected out of the rows before (`FewRows`).
How uncertain the sizes themselves are is in the covariance, by draws from their Laplace approximation.
"""

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float, Int

from taskcal.estimation.matrices import (
    factor_lower,
    invert_factored,
    invert_triangular,
    solve_factored,
    solve_triangular,
    turn_to_triangle,
)
from taskcal.kernels.chunks import in_chunks

SCALE_RANGE = 1e-4, 1e4
"""Bounds of a single group's variance: a hundred times tighter or wider than stated."""

STATED_WITHIN = 3.0
"""Factor (1σ) within which stated deviations are expected where the data say nothing of their scale."""

STATED_VARIANCE = float((2.0 * np.log(STATED_WITHIN)) ** 2)
"""The same as the variance of a log variance."""

GRID_POINTS = 201
"""Variances, evenly in their logarithm, over which their posterior is integrated."""

ROWS_AT_ONCE = 1024
"""Rows of a thread; whatever the number of threads, so that sums are the same to the bit."""

DRAWS_AT_ONCE = 3
"""Draws of a thread; whatever the number of threads, so that sums are the same to the bit."""

PARAMETERS_AT_ONCE = 64
"""Of the information of sizes: a block of 64 rows of 1 − K stays in a core's cache, and all of them do not."""


Value = TypeVar("Value")


class unlocked(cached_property[Value]):  # noqa: N801 - it is used as a decorator
    """A cached property of which threads compute several at once, as any does from Python 3.12 on: before, it held one lock."""

    def __init__(self, function: Callable[[Any], Value]):
        super().__init__(function)
        self.lock = nullcontext()


@dataclass(frozen=True, eq=False, kw_only=True)
class Groups:
    """Which group each parameter belongs to, and what is expected of the groups' sizes."""

    group: Int[np.ndarray, " p"]
    """Number of each parameter's group; −1 where it has none."""
    held: Float[np.ndarray, "ungrouped ungrouped"]
    """Prior precision of those without a group."""
    location: Float[np.ndarray, " groups"]
    """Expected log variances."""
    spread: Float[np.ndarray, "groups groups"]
    """Their covariance: what one group is tells of those it is correlated with. A variance of zero holds a group."""

    @cached_property
    def grouped(self) -> Int[np.ndarray, " grouped"]:
        """Parameters that have a group, one group after another."""
        return np.argsort(self.group, kind="stable")[(self.group < 0).sum() :]

    @cached_property
    def block(self) -> tuple[np.ndarray, ...]:
        """Indices of the block of a matrix that belongs to parameters with a group."""
        return np.ix_(self.grouped, self.grouped)

    @cached_property
    def prior(self) -> Float[np.ndarray, "p p"]:
        """Prior precision where every group's variance is 1."""
        out, f = np.eye(len(self.group)), np.flatnonzero(self.group < 0)
        out[np.ix_(f, f)] = self.held
        return out

    @cached_property
    def log_held(self) -> float:
        """Logarithm of the determinant of the precision of parameters without a group."""
        return float(np.linalg.slogdet(self.held)[1])

    @cached_property
    def own(self) -> Int[np.ndarray, " grouped"]:
        """Group of each parameter that has one."""
        return self.group[self.grouped]

    @cached_property
    def searched(self) -> Int[np.ndarray, " searched"]:
        """Groups whose size is to be found."""
        return np.flatnonzero(np.diag(self.spread) > 0.0)

    def starting(self, log_variances: Float[np.ndarray, " groups"]) -> Float[np.ndarray, " groups"]:
        """Log variances to start a search from: these, where they are to be found, and elsewhere those that are held."""
        out = self.location.copy()
        out[self.searched] = log_variances[self.searched]
        return out

    @cached_property
    def precision(self) -> Float[np.ndarray, "searched searched"]:
        """Prior precision of the log variances that are to be found."""
        return np.linalg.inv(self.spread[np.ix_(self.searched, self.searched)])

    @cached_property
    def member(self) -> Float[np.ndarray, "grouped groups"]:
        """One where a parameter belongs to a group."""
        return (self.own[:, None] == np.arange(len(self.location))).astype(float)


@dataclass(frozen=True, eq=False, kw_only=True)
class FewRows:
    """Rows without what parameters without a group explain.

    The columns of these parameters, and beneath them the rows of their prior, are Q·R. The last n rows of Qᵀ·[A, y] know nothing
    of them.
    """

    A: Float[np.ndarray, "n grouped"]
    y: Float[np.ndarray, " n"]
    free: tuple[Float[np.ndarray, "free free"], Float[np.ndarray, "free grouped"], Float[np.ndarray, " free"]]
    """R, and the first rows of Qᵀ·[A, y]: R·x is what y leaves of A·x of parameters with a group."""

    @classmethod
    def of(cls, A: Float[np.ndarray, "n p"], y: Float[np.ndarray, " n"], groups: Groups) -> "FewRows":
        """Rows as they were measured."""
        own = np.flatnonzero(groups.group < 0)
        k = len(own)
        known = np.concatenate([A[:, own], np.linalg.cholesky(groups.held).T]) if k else A[:, own]
        rows = np.zeros((len(known), 1 + len(groups.grouped)), order="F")
        rows[: len(A), :-1], rows[: len(A), -1] = A[:, groups.grouped], y
        R, turned = turn_to_triangle(known, rows)
        return cls(A=turned[k:, :-1], y=turned[k:, -1], free=(R, turned[:k, :-1], turned[:k, -1]))


@dataclass(frozen=True, eq=False, kw_only=True)
class GroupEquations:
    """Normal equations of whitened rows."""

    groups: Groups
    b: Float[np.ndarray, " p"]
    """Aᵀy."""
    square: float
    """yᵀy."""
    given: Float[np.ndarray, "p p"] | None = None
    """AᵀA; None where it follows from the rows."""
    rows: tuple[Float[np.ndarray, "n p"], Float[np.ndarray, " n"]] | None = None
    """A and y, fewer than parameters; else None."""

    @classmethod
    def of_rows(cls, A: Float[np.ndarray, "rows p"], y: Float[np.ndarray, " rows"], groups: Groups) -> "GroupEquations":
        """Equations of whitened rows."""
        n, p = A.shape
        if n < p:
            return cls(groups=groups, b=A.T @ y, square=float(y @ y), rows=(A, y))
        H = np.sum(in_chunks(lambda rows: A[rows].T @ A[rows], n, ROWS_AT_ONCE), axis=0)
        return cls(groups=groups, b=A.T @ y, square=float(y @ y), given=H)

    @unlocked
    def H(self) -> Float[np.ndarray, "p p"]:
        """AᵀA."""
        if self.given is not None:
            return self.given
        assert self.rows is not None
        return self.rows[0].T @ self.rows[0]

    @unlocked
    def few(self) -> FewRows | None:
        """The rows, where they are fewer than parameters."""
        return None if self.rows is None else FewRows.of(*self.rows, self.groups)

    def at(self, log_variances: Float[np.ndarray, " groups"]) -> "Evidence":
        """Evidence at some sizes."""
        groups = self.groups
        root = np.ones(len(self.b))
        root[groups.grouped] = np.exp(0.5 * log_variances)[groups.own]
        if self.few is None:
            L = factor_lower(groups.prior + root[:, None] * self.H * root)
            u = solve_factored(L, root * self.b)
            fit, logs, B = float(u @ (root * self.b)) - self.square, np.log(np.diag(L)), None
        else:
            R, A, y = self.few.free
            B = self.few.A * root[groups.grouped]
            L = factor_lower(np.eye(len(B)) + B @ B.T)
            u, weights = np.empty(len(self.b)), solve_factored(L, self.few.y)
            u[groups.grouped] = B.T @ weights
            u[groups.group < 0] = np.linalg.solve(R, y - A @ (root * u)[groups.grouped])
            fit = -float(self.few.y @ weights)
            logs = np.log(np.abs(np.concatenate([np.diag(L), np.diag(R)])))
        log = 0.5 * (fit + groups.log_held) - float(logs.sum())
        return Evidence(equations=self, log_variances=log_variances, log=log, root=root, u=u, factor=L, columns=B)


@dataclass(frozen=True, eq=False, kw_only=True)
class Evidence:
    """The model at some sizes of its groups."""

    equations: GroupEquations
    log_variances: Float[np.ndarray, " groups"]
    log: float
    """Log marginal likelihood, for rows of unit noise, but for log 2π."""
    root: Float[np.ndarray, " p"]
    """Standard deviation of every parameter that has a group, 1 for others."""
    u: Float[np.ndarray, " p"]
    """Posterior mean in units of these."""
    factor: Float[np.ndarray, "k k"]
    """Cholesky factor of the posterior information in these units; of few rows that of their covariance S."""
    columns: Float[np.ndarray, "n grouped"] | None = None
    """Of few rows A·√D, else None."""

    @unlocked
    def K(self) -> Float[np.ndarray, "p p"]:
        """Posterior covariance in these units."""
        few, groups = self.equations.few, self.equations.groups
        if few is None:
            return invert_factored(self.factor)
        R, along, _ = few.free
        follow = np.linalg.solve(R, along * self.root[groups.grouped])
        own = np.eye(len(groups.grouped)) - self._white.T @ self._white
        f, both = np.flatnonzero(groups.group < 0), follow @ own
        K = np.empty((len(self.u),) * 2)
        K[groups.block], K[np.ix_(f, groups.grouped)], K[np.ix_(groups.grouped, f)] = own, -both, -both.T
        K[np.ix_(f, f)] = np.linalg.inv(R.T @ R) + both @ follow.T
        return K

    @unlocked
    def determined(self) -> Float[np.ndarray, " grouped"]:
        """Diagonal of 1 − K: how far the rows determine each parameter with a group."""
        if self.columns is None:
            return 1.0 - np.diag(self.K)[self.equations.groups.grouped]
        return np.einsum("ni,ni->i", self._white, self._white)

    @unlocked
    def _white(self) -> Float[np.ndarray, "n grouped"]:
        """Of few rows F⁻¹·A·√D with F·Fᵀ = S, so that 1 − K is its square."""
        assert self.columns is not None
        return invert_triangular(self.factor) @ self.columns

    @property
    def mean(self) -> Float[np.ndarray, " p"]:
        """Posterior mean."""
        return self.root * self.u

    @property
    def covariance(self) -> Float[np.ndarray, "p p"]:
        """Posterior covariance."""
        return self.root[:, None] * self.K * self.root

    def spread(self, A: Float[np.ndarray, "n m p"]) -> Float[np.ndarray, "n m m"]:
        """Covariance of what is predicted for some rows, block by block."""
        n, m, p = A.shape
        few, groups = self.equations.few, self.equations.groups
        if few is None:
            own = solve_triangular(self.factor, (A.reshape(n * m, p) * self.root).T).T.reshape(n, m, p)
            return own @ np.swapaxes(own, 1, 2)
        R, along, _ = few.free
        free = np.linalg.solve(R.T, A.reshape(n * m, p)[:, groups.group < 0].T).T
        own = (A.reshape(n * m, p)[:, groups.grouped] - free @ along) * self.root[groups.grouped]
        free, own, known = (part.reshape(n, m, -1) for part in (free, own, own @ self._white.T))
        return free @ np.swapaxes(free, 1, 2) + own @ np.swapaxes(own, 1, 2) - known @ np.swapaxes(known, 1, 2)

    def times_covariance(self, M: Float[np.ndarray, "p k"]) -> Float[np.ndarray, "p k"]:
        """Posterior covariance times a matrix."""
        few, groups = self.equations.few, self.equations.groups
        if few is None:
            return self.root[:, None] * solve_factored(self.factor, self.root[:, None] * M)
        R, along, _ = few.free
        f, k, root = groups.group < 0, groups.grouped, self.root[groups.grouped, None]
        follow = np.linalg.solve(R, along) * root.T
        own = root * M[k] - follow.T @ M[f]
        own -= self._white.T @ (self._white @ own)
        out = np.empty(M.shape)
        out[k], out[f] = root * own, np.linalg.solve(R, np.linalg.solve(R.T, M[f])) - follow @ own
        return out

    @property
    def effective_parameters(self) -> float:
        """How many parameters with a group the data determine: γ = Σ(1 − K_ii), each between 0 and 1 (MacKay 1992, eq. 4.9)."""
        return float(self.determined.sum())

    @unlocked
    def information(self) -> Float[np.ndarray, "groups groups"]:
        """Fisher information of the log variances, without their prior."""
        member = self.equations.groups.member
        out = np.zeros((member.shape[1],) * 2)
        for first in range(0, len(member), PARAMETERS_AT_ONCE):
            own = slice(first, min(first + PARAMETERS_AT_ONCE, len(member)))
            squares = np.square(self._determined_from(own))
            squares[:, : own.stop - first] *= 0.5  # which are there twice once all is added to its transpose
            out += member[own].T @ (squares @ member[first:])
        return 0.5 * (out + out.T)

    def _determined_from(self, own: slice) -> Float[np.ndarray, "some rest"]:
        """Rows of 1 − K of some parameters with a group, from their own diagonal on."""
        if self.columns is not None:
            return self._white[:, own].T @ self._white[:, own.start :]
        k = self.equations.groups.grouped
        return np.eye(own.stop - own.start, len(k) - own.start) - self.K[np.ix_(k[own], k[own.start :])]

    @property
    def log_posterior(self) -> float:
        """Log posterior of the sizes."""
        groups = self.equations.groups
        off = (self.log_variances - groups.location)[groups.searched]
        return self.log - 0.5 * float(off @ groups.precision @ off)

    @property
    def _searched_information(self) -> Float[np.ndarray, "searched searched"]:
        """Fisher information of the log variances that are to be found, with their prior."""
        groups = self.equations.groups
        return self.information[np.ix_(groups.searched, groups.searched)] + groups.precision

    def draws(self, count: int, rng: np.random.Generator) -> "Sequence[Evidence]":
        """The model at sizes drawn in pairs about the likeliest ones; at these alone where no size is sought."""
        searched = self.equations.groups.searched
        if not len(searched) or count < 2:
            return [self]
        spread = invert_triangular(np.linalg.cholesky(self._searched_information)).T
        out: list[Evidence] = []
        for _ in range(count // 2):
            step = np.zeros(len(self.log_variances))
            step[searched] = spread @ rng.standard_normal(len(searched))
            out += [self.equations.at(self.log_variances + sign * step) for sign in (1.0, -1.0)]
        return out

    def averaged(self, draws: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Mean (p) of the parameters at the likeliest sizes, and their covariance (p, p) about it over draws of the sizes.

        The mean is not averaged: what is next to nothing may be larger by as much as smaller in its logarithm, which draws noise
        into the mean.
        """
        drawn = self.draws(draws, rng)

        def added(some: slice) -> np.ndarray:
            S = np.zeros((len(self.root),) * 2)
            for one in drawn[some]:
                apart = one.mean - self.mean
                S += one.covariance + np.outer(apart, apart)
            return S

        return self.mean, np.sum(in_chunks(added, len(drawn), DRAWS_AT_ONCE), axis=0) / len(drawn)

    def averaged_spread(
        self, A: Float[np.ndarray, "n m p"], draws: int, rng: np.random.Generator
    ) -> Float[np.ndarray, "n m m"]:
        """The same of what is predicted for some rows, block by block."""
        drawn = self.draws(draws, rng)
        apart = [(A @ (one.mean - self.mean))[..., None] for one in drawn]
        parts = [one.spread(A) + off @ np.swapaxes(off, 1, 2) for one, off in zip(drawn, apart, strict=True)]
        return np.mean(parts, axis=0)

    def without(self, left_out: Sequence[int] | Int[np.ndarray, " k"]) -> "Evidence":
        """The same model with some of its groups zero, and the others of the sizes that they have."""
        theta = self.log_variances.copy()
        theta[np.asarray(left_out, dtype=int)] = -np.inf
        return self.equations.at(theta)

    def log_integrated(self, left_out: Sequence[int] | Int[np.ndarray, " k"] = ()) -> float:
        """Log marginal likelihood, the sizes integrated out by Laplace's approximation about the likeliest ones.

        At the likeliest sizes alone, each group that is allowed for would seem to be worth something on every campaign: its size
        was chosen to be.

        Args:
            left_out: groups that are zero instead, the others of the sizes that they have.
        """
        groups = self.equations.groups
        at = self.without(left_out) if len(left_out) else self
        s = np.setdiff1d(groups.searched, left_out)
        if not len(s):
            return at.log
        expected = np.linalg.inv(groups.spread[np.ix_(s, s)])
        off = (at.log_variances - groups.location)[s]
        narrowed = np.linalg.slogdet(at.information[np.ix_(s, s)] + expected)[1] - np.linalg.slogdet(expected)[1]
        return at.log - 0.5 * float(off @ expected @ off) - 0.5 * float(narrowed)


@dataclass(frozen=True, eq=False, kw_only=True)
class VariancePosterior:
    """What the data say of the variance of a single group."""

    variances: Float[np.ndarray, " v"]
    """Ascending, evenly in their logarithm."""
    weights: Float[np.ndarray, " v"]
    """Their densities, not normalised."""

    @property
    def mean(self) -> float:
        """Expectation of the variance.

        What the data do not tell of a parameter varies by it, not by the variance that is most probable. That one is too small
        on average: few parameters that are well seen say what the size of the others is as a few draws say what a variance is (for
        d of them and Jeffreys' prior by d/(d − 2)).
        """
        return float(self.weights @ self.variances / self.weights.sum())

    @property
    def region_factor(self) -> float:
        """Factor of a covariance, scaled by the expectation, that gives 95 % regions in three dimensions their coverage.

        An error of the prior alone is a mixture of normal distributions of all variances. It has longer tails than the one of their
        expectation.
        """
        from scipy.optimize import root_scalar
        from scipy.special import chdtr, chdtri

        share, relative = self.weights / self.weights.sum(), self.variances / self.mean

        def beyond(logarithm: float) -> float:
            return float(share @ chdtr(3.0, chdtri(3.0, 0.05) * np.exp(logarithm) / relative)) - 0.95

        # regions of the smallest variance are too small, and of the largest too large
        found = root_scalar(beyond, bracket=(np.log(relative[0]), np.log(relative[-1])))
        return float(np.exp(found.root))


def variance_posterior(equations: GroupEquations) -> VariancePosterior:
    """Posterior of the variance of a single group, where `noisy_rows.maximise` finds the one that is most probable."""
    k = equations.groups.grouped
    f = np.setdiff1d(np.arange(len(equations.b)), k)
    H, b = equations.H, equations.b
    free = np.linalg.solve(H[np.ix_(f, f)] + equations.groups.held, np.column_stack([H[np.ix_(f, k)], b[f]]))
    values, vectors = np.linalg.eigh(H[np.ix_(k, k)] - H[np.ix_(k, f)] @ free[:, :-1])
    values, along = np.maximum(values, 0.0), vectors.T @ (b[k] - H[np.ix_(k, f)] @ free[:, -1])
    logarithm = np.linspace(np.log(SCALE_RANGE[0]), np.log(SCALE_RANGE[1]), GRID_POINTS)
    v = np.exp(logarithm)
    spread = 1.0 + v[:, None] * values
    likelihood = 0.5 * (v[:, None] * along**2 / spread - np.log(spread)).sum(axis=1)
    off = logarithm - equations.groups.location[0]
    expected = likelihood - 0.5 * off**2 / min(float(equations.groups.spread[0, 0]), STATED_VARIANCE)
    return VariancePosterior(variances=v, weights=np.exp(expected - expected.max()))
