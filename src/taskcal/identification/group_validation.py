"""What the one model is worth where it was not fitted: cross-validated errors, and how far its stated regions reach.

Folds are left out of the normal equations, and the sizes of the groups follow by a few steps of the scoring, as do the weights
of the poses; the rows are not linearised again, and what single poses add stays. An effect's worth is the error without its
groups, the others as they are, so that no model is fitted again.

Real errors have longer tails than normal ones, sizes that were fitted are a little too good, and effects that were allowed for
but are not there make what is stated too large: all of it shows in the left-out errors. They are taken for t-distributed with ν
degrees of freedom and the scale N + f·X, N the covariance of the instrument's noise, which is stated, and X what is predicted
beside it; X is stretched so that the 95 % region of N and X is that of this distribution.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int
from scipy.special import chdtri, fdtri, gammaln

from taskcal.estimation.group_variances import (
    GroupedFit,
    Groups,
    Reduced,
    find_sizes,
    reduce_normal,
    reduce_rows,
    without,
)
from taskcal.identification.one_model import OneFit, judged_rows, spread_to_all
from taskcal.identification.row_errors import weigh

STEPS = 2
"""Of the scoring in a fold."""

DRAWS = 2
"""Of the sizes in a fold."""

TAILS = np.array([4.0, 6.0, 9.0, 14.0, 25.0, 60.0, 1000.0])
"""Degrees of freedom that are tried."""

STRETCH = np.exp(np.linspace(np.log(0.05), np.log(9.0), 73))
"""Values of f that are tried."""

MOST_STRETCH = 25.0
"""With the tails."""

STRETCH_WIDTH = 1.0
"""Standard deviation of the logarithm of f, which is expected to be 1, before anything is left out."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LeftOutErrors:
    """Errors where rows were not fitted."""

    whole: Float[np.ndarray, "n targets"]
    """Of the one model, metres; NaN where a beam was lost."""
    without: Mapping[str, Float[np.ndarray, "n targets"]]
    """The same with each effect left out."""
    stretch: float
    """Factor of the covariance, but for the instrument's noise, that makes 95 % regions hold 95 %."""


def validate_groups(
    fitted: OneFit, parts: Sequence[Int[np.ndarray, " _"]], effects: Sequence[str], rng: np.random.Generator
) -> LeftOutErrors:
    """Cross-validate a fit.

    Args:
        fitted: the fit.
        parts: rows of each fold.
        effects: names of those whose worth is asked for.
        rng: for the draws of the sizes.
    """
    n = len(fitted.A)
    targets = fitted.one.problem.seen.valid.shape[1]
    numbers = {name: fitted.one.of_effect(name) for name in effects}
    errors = {name: np.full((n, targets), np.nan) for name in ("", *effects)}
    error, predicted = np.zeros((n, targets, 3)), np.zeros((n, targets, 3, 3))
    # the weights of the fit know the rows that are left out: those that disagree with them count less
    root = np.sqrt(fitted.weights)[:, None]
    even = _Rows(A=fitted.A / root[:, :, None], y=fitted.y / root, stated=fitted.stated, groups=fitted.one.groups)
    numbered = fitted.at.seen.sum(axis=1)
    for part in parts:
        rest = np.ones(n, dtype=bool)
        rest[part] = False
        fold = find_sizes(even.without(part), fitted.found.evidence.log_variances, STEPS)
        if fitted.errors.searched:
            weights = weigh(_squares(even, fold), numbered)
            weighed = np.sqrt(weights[rest])[:, None]
            reduced = even.reduced(even.A[rest] * weighed[:, :, None], even.y[rest] * weighed)
            fold = find_sizes(reduced, fold.evidence.log_variances, STEPS)
        mean, S = fold.averaged(DRAWS, rng)
        error[part], predicted[part] = _judge(fitted, part, mean, S)
        errors[""][part] = np.linalg.norm(error[part], axis=2)
        for name, group in numbers.items():
            errors[name][part] = _lengths(fitted, part, _mean_without(fold, group))
    seen = fitted.one.problem.seen.valid
    for values in errors.values():
        values[~seen] = np.nan
    noise = fitted.one.problem.noise[:, :, :3, :3][seen]
    return LeftOutErrors(
        whole=errors[""],
        without={name: errors[name] for name in effects},
        stretch=stretch_of(error[seen], noise, predicted[seen] - noise),
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class _Rows:
    """Whitened rows that all count alike, and what is known beside them."""

    A: Float[np.ndarray, "n m p"]
    y: Float[np.ndarray, "n m"]
    stated: tuple[Float[np.ndarray, "k p"], Float[np.ndarray, " k"]]
    groups: Groups

    def reduced(self, A: Float[np.ndarray, "r m p"], y: Float[np.ndarray, "r m"]) -> Reduced:
        """The equations of other rows beside what is known."""
        known, known_y = self.stated
        rows = np.concatenate([A.reshape(-1, A.shape[2]), known])
        return reduce_rows(rows, np.concatenate([y.reshape(-1), known_y]), self.groups)

    @cached_property
    def _normal(self) -> tuple[np.ndarray, np.ndarray, float]:
        known, known_y = self.stated
        A, y = self.A.reshape(-1, self.A.shape[2]), self.y.reshape(-1)
        return A.T @ A + known.T @ known, A.T @ y + known.T @ known_y, float(y @ y + known_y @ known_y)

    def without(self, part: Int[np.ndarray, " _"]) -> Reduced:
        """The equations without some of the rows."""
        n, m, p = self.A.shape
        if n * m < p:
            rest = np.setdiff1d(np.arange(n), part)
            return self.reduced(self.A[rest], self.y[rest])
        H, b, square = self._normal
        own, own_y = self.A[part].reshape(-1, p), self.y[part].reshape(-1)
        return reduce_normal(H - own.T @ own, b - own.T @ own_y, square - float(own_y @ own_y), self.groups)


def _squares(rows: _Rows, fold: GroupedFit) -> Float[np.ndarray, " n"]:
    """Expected squares of what a fold's fit leaves."""
    own = fold.reduced.groups.own
    x = fold.reduced.mean(fold.evidence.mean(own))
    S = fold.reduced.covariance(fold.evidence.spread)
    n, m, p = rows.A.shape
    A = rows.A[judged_rows(n)]
    spread = np.einsum("nip,nip->n", (A.reshape(-1, p) @ S).reshape(-1, m, p), A)
    return ((rows.y - rows.A @ x) ** 2).sum(axis=1) + spread_to_all(spread, n)


def _mean_without(fold: GroupedFit, group: Int[np.ndarray, " k"]) -> Float[np.ndarray, " p"]:
    at = without(fold, group)
    return fold.reduced.mean(at.mean(fold.reduced.groups.own))


def _left(fitted: OneFit, part: np.ndarray, mean: np.ndarray) -> Float[np.ndarray, "k m"]:
    """Whitened residuals of some rows; what only they measure, such as a socket of theirs, stands where they say."""
    left = fitted.y[part] - fitted.A[part] @ mean
    frames = np.flatnonzero(fitted.one.group < 0)
    others = np.delete(fitted.A[:, :, frames], part, axis=0)
    lone = frames[~others.any(axis=(0, 1)) & fitted.A[np.ix_(part, np.arange(left.shape[1]), frames)].any(axis=(0, 1))]
    if not len(lone):
        return left
    own = fitted.A[part][:, :, lone].reshape(-1, len(lone))
    return left - (own @ np.linalg.lstsq(own, left.reshape(-1), rcond=None)[0]).reshape(left.shape)


def _lengths(fitted: OneFit, part: np.ndarray, mean: np.ndarray) -> Float[np.ndarray, "k targets"]:
    """Errors of position of some rows, metres."""
    error = np.linalg.solve(fitted.whitener[part], _left(fitted, part, mean)[..., None])[..., 0]
    targets = fitted.one.problem.seen.valid.shape[1]
    return np.linalg.norm(error.reshape(len(part), targets, -1)[:, :, :3], axis=2)


def _judge(
    fitted: OneFit, part: np.ndarray, mean: np.ndarray, S: np.ndarray
) -> tuple[Float[np.ndarray, "k targets 3"], Float[np.ndarray, "k targets 3 3"]]:
    """Errors of position of some rows, and their predicted covariance."""
    A, k, m = fitted.A[part], len(part), fitted.A.shape[1]
    back = np.linalg.inv(fitted.whitener[part])
    error = np.einsum("nij,nj->ni", back, _left(fitted, part, mean))
    # a new pose has a weight of its own, that is told by no residual
    single = np.eye(m) * fitted.weights[part, None, None]
    spread = (A.reshape(k * m, -1) @ S).reshape(A.shape) @ np.swapaxes(A, 1, 2) + single
    covariance = back @ spread @ np.swapaxes(back, 1, 2)
    targets = fitted.one.problem.seen.valid.shape[1]
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
    # in the axes in which noise is 1 and what is predicted diagonal, the scale is 1 + f·v
    root = np.linalg.inv(np.linalg.cholesky(noise))
    v, turn = np.linalg.eigh(root @ predicted @ np.swapaxes(root, 1, 2))
    square = (np.swapaxes(turn, 1, 2) @ (root @ error[..., None]))[..., 0] ** 2
    v = np.maximum(v, 0.0)
    scales = 1.0 + STRETCH[:, None, None] * v
    lengths, volume = (square / scales).sum(axis=2), 0.5 * np.log(scales).sum(axis=(1, 2))
    log = np.array([multivariate_t_log(lengths, nu).sum(axis=1) - volume for nu in TAILS]).T
    log -= 0.5 * (np.log(STRETCH)[:, None] / STRETCH_WIDTH) ** 2
    best, tail = np.unravel_index(int(log.argmax()), log.shape)
    longer = float(3.0 * fdtri(3.0, TAILS[tail], 0.95) / chdtri(3.0, 0.05))
    # longer tails of the whole, the noise's with it, are held by what is predicted alone: in the mean, or as far as that goes
    scale = 1.0 + STRETCH[best] * v

    def held(stretch: float) -> float:
        return float((scale / (1.0 + stretch * v)).mean()) - 1.0 / longer

    if held(MOST_STRETCH) >= 0.0:
        return MOST_STRETCH
    low, high = 0.0, MOST_STRETCH
    for _ in range(60):  # halved down to rounding; SciPy's root finders take longer to import
        middle = 0.5 * (low + high)
        low, high = (middle, high) if held(middle) > 0.0 else (low, middle)
    return low


def multivariate_t_log(squares: Float[np.ndarray, "..."], nu: float) -> Float[np.ndarray, "..."]:
    """Log density of a t-distribution in three dimensions at these squared lengths, but for its scale and log π."""
    return gammaln(0.5 * (nu + 3.0)) - gammaln(0.5 * nu) - 1.5 * np.log(nu) - 0.5 * (nu + 3.0) * np.log1p(squares / nu)
