"""Linear-Gaussian models whose parameters come in groups, each group's size found by marginal likelihood.

    y = A·x + e,   e ~ N(0, 1),   x_i ~ N(0, v_g) for every i of group g,   log v ~ N(m, Ω)

Parameters without a group have a prior of their own; they are eliminated first, exactly. The log variances are those of the
largest posterior, by Fisher scoring: with P = (1 + A·D·Aᵀ)⁻¹ and M = AᵀPA

    ∂ℓ/∂v_g = ½ (|A_gᵀPy|² − tr M_gg),   E[−∂²ℓ/∂v_g∂v_h] = ½ |M_gh|²

(Harville 1977, Journal of the American Statistical Association 72; MacKay 1992, Neural Computation 4, for the same as
"evidence"). M comes from the normal equations where there are more rows than parameters, else from the rows' covariance.
How uncertain the sizes themselves are is in the covariance, by draws from their Laplace approximation.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from taskcal.estimation.matrices import invert_positive
from taskcal.kernels.chunks import in_chunks

MAX_LOG_STEP = 2.5
"""Of a log variance in one step of the scoring."""

MAX_STEPS = 40
"""Of the scoring."""

MIN_GAIN = 1e-2
"""Expected gain of log posterior by the next step at which the scoring ends."""


ROWS_AT_ONCE = 1024
"""Rows of a thread; whatever the number of threads, so that sums are the same to the bit."""


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
        """Parameters that have a group."""
        return np.flatnonzero(self.group >= 0)

    @cached_property
    def ungrouped(self) -> Int[np.ndarray, " ungrouped"]:
        """Parameters that have none."""
        return np.flatnonzero(self.group < 0)

    @cached_property
    def own(self) -> Int[np.ndarray, " grouped"]:
        """Group of each parameter that has one."""
        return self.group[self.grouped]

    @cached_property
    def searched(self) -> Int[np.ndarray, " searched"]:
        """Groups whose size is to be found."""
        return np.flatnonzero(np.diag(self.spread) > 0.0)

    @cached_property
    def precision(self) -> Float[np.ndarray, "searched searched"]:
        """Prior precision of the log variances that are to be found."""
        return np.linalg.inv(self.spread[np.ix_(self.searched, self.searched)])

    def sums(self, M: Float[np.ndarray, "grouped grouped"]) -> Float[np.ndarray, "groups groups"]:
        """Sums of a matrix over the blocks of the groups."""
        member = np.zeros((len(self.own), len(self.location)))
        member[np.arange(len(self.own)), self.own] = 1.0
        return member.T @ (M @ member)


@dataclass(frozen=True, eq=False, kw_only=True)
class Reduced:
    """The equations of the grouped parameters, those without a group eliminated."""

    groups: Groups
    H: Float[np.ndarray, "k k"]
    b: Float[np.ndarray, " k"]
    """AᵀA and Aᵀy, where there are more rows than parameters; else empty …"""
    A: Float[np.ndarray, "rows grouped"] | None
    y: Float[np.ndarray, " rows"] | None
    """… and the rows themselves."""
    back: Float[np.ndarray, "ungrouped grouped"]
    """What those without a group do for a unit of each grouped one, with the sign turned …"""
    alone: Float[np.ndarray, " ungrouped"]
    """… their values where all grouped ones are zero …"""
    alone_covariance: Float[np.ndarray, "ungrouped ungrouped"]
    """… and their covariance there."""
    log_alone: float
    """Log marginal likelihood where all grouped ones are zero, for rows of unit noise, but for log 2π."""

    def at(self, log_variances: Float[np.ndarray, " groups"]) -> "Evidence":
        """Evidence at some sizes."""
        from scipy.linalg import solve_triangular

        root = np.exp(0.5 * log_variances)[self.groups.own]
        if self.A is None or self.y is None:
            L = np.linalg.cholesky(np.eye(len(root)) + root[:, None] * self.H * root)
            w = solve_triangular(L, root * self.b, lower=True)
            fit = 0.5 * float(w @ w)
        else:
            scaled = self.A * root
            L = np.linalg.cholesky(np.eye(len(self.y)) + scaled @ scaled.T)
            w = solve_triangular(L, self.y, lower=True)
            fit = 0.5 * float(self.y @ self.y - w @ w)
        log = fit - float(np.log(np.diag(L)).sum())
        return Evidence(reduced=self, log_variances=log_variances, log=log, root=root, L=L, w=w)

    def mean(self, x: Float[np.ndarray, " grouped"]) -> Float[np.ndarray, " p"]:
        """All parameters, from the grouped ones."""
        out = np.zeros(len(self.groups.group))
        out[self.groups.grouped] = x
        out[self.groups.ungrouped] = self.alone - self.back @ x
        return out

    def covariance(self, spread: Float[np.ndarray, "grouped m"]) -> Float[np.ndarray, "p p"]:
        """Covariance of all parameters, from B of the grouped ones' covariance B·Bᵀ: a sum of squares, negative nowhere."""
        f, whole = self.groups.ungrouped, np.zeros((len(self.groups.group), spread.shape[1]))
        whole[self.groups.grouped], whole[f] = spread, -self.back @ spread
        out = whole @ whole.T
        out[np.ix_(f, f)] += self.alone_covariance
        return out


@dataclass(frozen=True, eq=False, kw_only=True)
class Evidence:
    """The model at some sizes of its groups."""

    reduced: Reduced
    log_variances: Float[np.ndarray, " groups"]
    log: float
    """Gain of log marginal likelihood at these sizes over groups that are all zero."""
    root: Float[np.ndarray, " grouped"]
    """Standard deviation of every grouped parameter."""
    L: Float[np.ndarray, "k k"]
    """Cholesky factor of 1 + √D·AᵀA·√D or, from rows, of 1 + A·D·Aᵀ …"""
    w: Float[np.ndarray, " k"]
    """… and with it L⁻¹·√D·Aᵀy or L⁻¹·y."""

    @cached_property
    def g(self) -> Float[np.ndarray, " grouped"]:
        """AᵀPy."""
        from scipy.linalg import solve_triangular

        v = solve_triangular(self.L, self.w, lower=True, trans=1)
        A = self.reduced.A
        return self.reduced.b - self.reduced.H @ (self.root * v) if A is None else A.T @ v

    @cached_property
    def M(self) -> Float[np.ndarray, "grouped grouped"]:
        """AᵀPA."""
        from scipy.linalg import solve_triangular

        A = self.reduced.A
        if A is not None:
            U = solve_triangular(self.L, A, lower=True)
            return U.T @ U
        V = solve_triangular(self.L, self.root[:, None] * self.reduced.H, lower=True)
        return self.reduced.H - V.T @ V

    def mean(self, own: Int[np.ndarray, " grouped"]) -> Float[np.ndarray, " grouped"]:
        """Mean of the grouped parameters."""
        return np.exp(self.log_variances)[own] * self.g

    @cached_property
    def spread(self) -> Float[np.ndarray, "grouped grouped"]:
        """B, with B·Bᵀ the covariance of the grouped parameters: √D·L⁻ᵀ, L the Cholesky factor of 1 + √D·AᵀA·√D.

        D − D·AᵀPA·D would lose as many digits as the data know a parameter better than its prior, twice over.
        """
        from scipy.linalg import solve_triangular

        L, A = self.L, self.reduced.A
        if A is not None:
            scaled = A * self.root
            L = np.linalg.cholesky(np.eye(len(self.root)) + scaled.T @ scaled)
        return solve_triangular(L, np.diag(self.root), lower=True).T


@dataclass(frozen=True, eq=False, kw_only=True)
class GroupedFit:
    """Sizes of the groups, and the parameters, with the sizes' uncertainty in their covariance."""

    reduced: Reduced
    evidence: Evidence
    """At the likeliest sizes."""
    information: Float[np.ndarray, "searched searched"]
    """Fisher's, of the log variances that were searched, their prior included."""

    def averaged(self, draws: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Mean (p) of the parameters at the likeliest sizes, and their covariance (p, p) about it over draws of the sizes.

        The sizes are drawn in pairs about the likeliest ones. The mean is not averaged: what is next to nothing may be larger
        by as much as smaller in its logarithm, which draws noise into the mean.
        """
        from scipy.linalg import solve_triangular

        own, searched = self.reduced.groups.own, self.reduced.groups.searched
        likeliest = self.evidence.mean(own)
        if not len(searched) or draws < 2:
            return self.reduced.mean(likeliest), self.reduced.covariance(self.evidence.spread)
        spread = solve_triangular(np.linalg.cholesky(self.information), np.eye(len(searched)), lower=True).T
        S = np.zeros((len(self.reduced.groups.group),) * 2)
        for _ in range(draws // 2):
            step = np.zeros(len(self.evidence.log_variances))
            step[searched] = spread @ rng.standard_normal(len(searched))
            for sign in (1.0, -1.0):
                at = self.reduced.at(self.evidence.log_variances + sign * step)
                apart = at.mean(own) - likeliest
                S += self.reduced.covariance(np.column_stack([at.spread, apart]))
        return self.reduced.mean(likeliest), S / (2 * (draws // 2))


def reduce_rows(A: Float[np.ndarray, "rows p"], y: Float[np.ndarray, " rows"], groups: Groups) -> Reduced:
    """The equations of whitened rows, in the smaller of their two forms."""
    from scipy.linalg import cho_factor, cho_solve

    k, f = groups.grouped, groups.ungrouped
    if len(y) >= len(k):
        H = np.sum(in_chunks(lambda rows: A[rows].T @ A[rows], len(A), ROWS_AT_ONCE), axis=0)
        return reduce_normal(H, A.T @ y, float(y @ y), groups)
    # their priors are rows too, so that what is left is the projection of all rows
    root = np.linalg.cholesky(groups.held).T
    free = np.concatenate([A[:, f], root])
    own = np.concatenate([A[:, k], np.zeros((len(f), len(k)))])
    y = np.concatenate([y, np.zeros(len(f))])
    precision, pull = free.T @ free, free.T @ y
    factor = cho_factor(precision, lower=True)
    back, alone = cho_solve(factor, free.T @ own), cho_solve(factor, pull)
    return Reduced(
        groups=groups,
        H=np.zeros((0, 0)),
        b=np.zeros(0),
        A=own - free @ back,
        y=y - free @ alone,
        back=back,
        alone=alone,
        alone_covariance=invert_positive(precision),
        log_alone=_log_alone(float(y @ y - pull @ alone), precision, groups.held),
    )


def reduce_normal(H: Float[np.ndarray, "p p"], b: Float[np.ndarray, " p"], square: float, groups: Groups) -> Reduced:
    """The equations from AᵀA, Aᵀy and yᵀy of whitened rows."""
    from scipy.linalg import cho_factor, cho_solve

    k, f = groups.grouped, groups.ungrouped
    precision = H[np.ix_(f, f)] + groups.held
    factor = cho_factor(precision, lower=True)
    back, alone = cho_solve(factor, H[np.ix_(f, k)]), cho_solve(factor, b[f])
    own = H[np.ix_(k, k)] - H[np.ix_(k, f)] @ back
    return Reduced(
        groups=groups,
        H=0.5 * (own + own.T),
        b=b[k] - H[np.ix_(k, f)] @ alone,
        A=None,
        y=None,
        back=back,
        alone=alone,
        alone_covariance=invert_positive(precision),
        log_alone=_log_alone(square - float(b[f] @ alone), precision, groups.held),
    )


def _log_alone(square: float, precision: Float[np.ndarray, "f f"], held: Float[np.ndarray, "f f"]) -> float:
    return float(-0.5 * square - 0.5 * (np.linalg.slogdet(precision)[1] - np.linalg.slogdet(held)[1]))


def find_sizes(reduced: Reduced, start: Float[np.ndarray, " groups"], steps: int = MAX_STEPS) -> GroupedFit:
    """The likeliest sizes of the groups, by Fisher scoring.

    Args:
        reduced: the equations.
        start: log variances to start from; those of held groups are not changed.
        steps: of the scoring, at most.
    """
    groups = reduced.groups
    s = groups.searched
    theta = groups.location.copy()
    theta[s] = start[s]
    at = reduced.at(theta)
    for _ in range(steps):
        gradient, information = _scores(at, groups)
        step = np.clip(np.linalg.solve(information, gradient), -MAX_LOG_STEP, MAX_LOG_STEP)
        if step @ gradient < MIN_GAIN:
            break
        following, share = at, 1.0
        while share > 1e-3:
            theta = at.log_variances.copy()
            theta[s] += share * step
            following = reduced.at(theta)
            if _posterior(following, groups) >= _posterior(at, groups):
                break
            share *= 0.5
        else:
            break
        at = following
    return GroupedFit(reduced=reduced, evidence=at, information=_scores(at, groups)[1])


def without(fit: GroupedFit, left_out: Int[np.ndarray, " k"]) -> Evidence:
    """The same model with some of its groups zero, and the others of the sizes that they have."""
    theta = fit.evidence.log_variances.copy()
    theta[left_out] = -np.inf
    return fit.reduced.at(theta)


def log_integrated(fit: GroupedFit, left_out: Sequence[int] | Int[np.ndarray, " k"] = ()) -> float:
    """Gain of log marginal likelihood over groups that are all zero, the sizes integrated out by Laplace's approximation.

    At the likeliest sizes alone, each group that is allowed for would seem to be worth something on every campaign: its size was
    chosen to be.

    Args:
        fit: at its likeliest sizes.
        left_out: groups that are zero instead, the others of the sizes that they have.
    """
    groups = fit.reduced.groups
    at = without(fit, np.asarray(left_out, dtype=int)) if len(left_out) else fit.evidence
    s = np.setdiff1d(groups.searched, left_out)
    if not len(s):
        return at.log
    expected = np.linalg.inv(groups.spread[np.ix_(s, s)])
    off = (at.log_variances - groups.location)[s]
    information = _information(at, groups)[np.ix_(s, s)] + expected
    narrowed = np.linalg.slogdet(information)[1] - np.linalg.slogdet(expected)[1]
    return at.log - 0.5 * float(off @ expected @ off) - 0.5 * float(narrowed)


def _posterior(at: Evidence, groups: Groups) -> float:
    off = (at.log_variances - groups.location)[groups.searched]
    return at.log - 0.5 * float(off @ groups.precision @ off)


def _scores(
    at: Evidence, groups: Groups
) -> tuple[Float[np.ndarray, " searched"], Float[np.ndarray, "searched searched"]]:
    """Gradient and Fisher information of the searched log variances' posterior."""
    s, count = groups.searched, len(groups.location)
    v = np.exp(at.log_variances)
    gained = np.bincount(groups.own, weights=at.g**2 - np.diag(at.M), minlength=count)
    gradient = 0.5 * v * gained
    gradient = gradient[s] - groups.precision @ (at.log_variances - groups.location)[s]
    return gradient, _information(at, groups)[np.ix_(s, s)] + groups.precision


def _information(at: Evidence, groups: Groups) -> Float[np.ndarray, "groups groups"]:
    """Fisher's, of the log variances, without their prior."""
    v = np.exp(at.log_variances)
    return 0.5 * np.outer(v, v) * groups.sums(at.M * at.M)
