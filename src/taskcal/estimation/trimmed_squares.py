"""Least trimmed squares of linear rows under a prior: which rows agree, whatever a few others say.

A fit of all rows follows a wrong one, where it alone decides a direction entirely, and several hide each other: they raise the
error by which each of them is judged. Here the rows that are followed are sought before (Rousseeuw 1984):

1. From all rows, and from subsets at random, concentration steps (Rousseeuw and Van Driessen 2006) lead to the rows that have the
   smallest sum of squares with what the prior holds against the unknowns. Each is a small linear system.
2. Error of single rows and scale of the prior are those of the best of these rows, the error made consistent: residuals that were
   chosen for being small are too small.
3. The others come back where the residual of their prediction is not too long for its standard deviation, and sound rows of
   long tails with them; and so on, until they stay the same.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.estimation.matrices import invert_positive
from taskcal.estimation.noisy_rows import MIN_VARIANCE, NoisyRows, PoseNoise

STARTS = 24
"""Subsets from which the search starts beside all rows: with a tenth of the rows wrong, twelve rows are all right with a chance of
0.28, and not once in 24 times with one of 4·10⁻⁴."""

SUBSET_ROWS = 12

FIRST_STEPS = 2
"""Concentration steps from every start, before the best goes on (Rousseeuw and Van Driessen 2006)."""

MAX_STEPS = 20
"""Concentration steps at most, each with sizes of error and prior; and rounds of judgement. A convention that bounds the
time."""

NEARLY_SETTLED, SETTLED = 0.1, 0.02
"""Change of the logarithm of a variance at which the sizes have settled: 5 % in size for the trimmed rows, and 1 %."""

MIN_FREEDOM = 10.0
"""Numbers that the unknowns leave to judge by, at least: a variance of ten is known to within 45 % (1σ), a length to 22 %. A
convention."""

UNDETERMINED = 1e-6
"""Share of its variance that a residual at least has, where a row alone decides a direction."""


class Sizes(NamedTuple):
    """Error of single rows, and scale of the prior."""

    errors: PoseNoise
    """Beside the noise."""
    factor: float
    """Of the prior's covariance."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TrimmedRows:
    """Rows of targets with blocks of three or six numbers, about where the unknowns are expected, in whose units they are."""

    rows: NoisyRows
    measured: Bool[np.ndarray, "n targets b"]
    """Numbers that were."""
    limits: Float[np.ndarray, " targets"]
    """Standard deviations from which on a target is wrong."""

    @property
    def numbers(self) -> Int[np.ndarray, "n targets"]:
        """How many were measured of each target."""
        return self.measured.sum(axis=2)

    @property
    def told(self) -> Float[np.ndarray, " z"]:
        """Gradient of what is known beside the measurements."""
        A, y = self.rows.beside
        return A.T @ y

    def weighed(self, sizes: Sizes) -> "_Weighed":
        """In units of noise and error."""
        rows, groups = self.rows, self.rows.groups
        W, A, P = rows.whiteners(sizes.errors), rows.beside[0], groups.prior.copy()
        P[groups.grouped, groups.grouped] /= sizes.factor
        return _Weighed(
            linear=self,
            sizes=sizes,
            residual=(W @ rows.y[..., None])[..., 0],
            by_entry=rows.whitened(W),
            precision=P + A.T @ A,
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class _Weighed:
    """The same rows in units of their standard deviations."""

    linear: TrimmedRows
    sizes: Sizes
    residual: Float[np.ndarray, "n m"]
    by_entry: Float[np.ndarray, "n m z"]
    precision: Float[np.ndarray, "z z"]

    @cached_property
    def _equations(self) -> tuple[Float[np.ndarray, "n zz"], Float[np.ndarray, "n z"]]:
        """Information and gradient of every row."""
        transposed = np.swapaxes(self.by_entry, 1, 2)
        information = transposed @ self.by_entry
        return information.reshape(len(information), -1), (transposed @ self.residual[..., None])[..., 0]

    def concentrate(
        self, rows: Float[np.ndarray, "starts n"], count: int, steps: int
    ) -> tuple[Float[np.ndarray, "starts n"], Float[np.ndarray, " starts"]]:
        """Rows, as many as `count`, that are nearest to what some rows say; and so on; and what is minimised with the last."""
        (n, m, z), (H, g) = self.by_entry.shape, self._equations
        flat, numbers = self.by_entry.reshape(n * m, z), self.linear.numbers
        objective = np.zeros(len(rows))
        for _ in range(steps):
            normal = (rows @ H).reshape(-1, z, z) + self.precision
            d = np.linalg.solve(normal, (rows @ g + self.linear.told)[..., None])[..., 0]
            left = self.residual - (d @ flat.T).reshape(-1, n, m)
            square = np.sum(left.reshape(len(rows), *numbers.shape, -1) ** 2, axis=3)
            following = _nearest(square, numbers, count).astype(float)
            held = np.sum(d @ self.precision * d, axis=1) - 2.0 * d @ self.linear.told
            objective = (following * square.sum(axis=2)).sum(axis=1) + held
            if np.array_equal(following, rows):
                break
            rows = following
        return rows, objective

    def fit(self, rows: Bool[np.ndarray, " n"]) -> "Agreement":
        """What some rows say of all."""
        (H, g), weight, z = self._equations, rows.astype(float), len(self.linear.told)
        covariance = invert_positive((weight @ H).reshape(z, z) + self.precision)
        d = covariance @ (weight @ g + self.linear.told)
        return Agreement(weighed=self, rows=rows, d=d, covariance=covariance, left=self.residual - self.by_entry @ d)


def _nearest(
    square: Float[np.ndarray, "*starts n targets"], numbers: Int[np.ndarray, "n targets"], count: int
) -> Bool[np.ndarray, "*starts n"]:
    """Rows, as many as `count`, whose farthest target has the smallest mean square."""
    farthest = (square / np.maximum(numbers, 1)).max(axis=-1)
    return farthest <= np.partition(farthest, count - 1, axis=-1)[..., [count - 1]]


@dataclass(frozen=True, eq=False, kw_only=True)
class Agreement:
    """What some rows say of all."""

    weighed: _Weighed
    """Under the sizes that were found."""
    rows: Bool[np.ndarray, " n"]
    d: Float[np.ndarray, " z"]
    """Change of the estimate, in units of the prior."""
    covariance: Float[np.ndarray, "z z"]
    left: Float[np.ndarray, "n m"]
    """Residuals in units of their standard deviations."""

    @cached_property
    def _moved(self) -> Float[np.ndarray, "n m z"]:
        A = self.weighed.by_entry
        return (A.reshape(-1, A.shape[2]) @ self.covariance).reshape(A.shape)

    def nearest(self, count: int) -> Bool[np.ndarray, " n"]:
        """Rows, as many as `count`, that are nearest."""
        numbers = self.weighed.linear.numbers
        return _nearest(np.sum(self.left.reshape(*numbers.shape, -1) ** 2, axis=2), numbers, count)

    def agreeing(self) -> Bool[np.ndarray, " n"]:
        """Rows whose residual is not too long for its standard deviation; of rows that were not fitted, their prediction's."""
        n, targets, b = self.weighed.linear.measured.shape
        A, moved = (of.reshape(n, targets, b, -1) for of in (self.weighed.by_entry, self._moved))
        left, sign = self.left.reshape(n, targets, b), np.where(self.rows, -1.0, 1.0)[:, None, None, None]
        own = (1.0 + UNDETERMINED) * np.eye(b) + sign * (moved @ np.swapaxes(A, 2, 3))
        limits, told = self.weighed.linear.limits, self.weighed.linear.measured[self.rows]
        explained = np.sum(self._moved * self.weighed.by_entry, axis=2).reshape(n, targets, b)[self.rows]
        freedom = float((1.0 - explained)[told].sum())
        if freedom < MIN_FREEDOM:  # of so few numbers none can be told from an error
            return np.ones(n, dtype=bool)
        return np.asarray((scaled_lengths(left, own) <= limits).all(axis=1))

    def resized(self, *, trimmed: bool) -> Sizes:
        """Sizes by these rows: a step of the evidence's fixed point (MacKay 1992, Neural Computation 4).

        The prior's factor is expected to be one, as of one parameter more.
        """
        linear, sizes = self.weighed.linear, self.weighed.sizes
        share = float(self.rows.mean()) if trimmed else 1.0
        n, targets, b = linear.measured.shape
        explained = np.sum(self._moved * self.weighed.by_entry, axis=2).reshape(n, targets, b)[self.rows]
        square = self.left.reshape(n, targets, b)[self.rows] ** 2
        noise = np.einsum("ntii->nti", linear.rows.noise)[self.rows]
        factor, variances, groups = sizes.factor, sizes.errors.variances, linear.rows.groups
        for k in range(len(variances) if sizes.errors.searched else 0):
            own = linear.measured[self.rows] & (np.arange(b) // 3 == k)
            if own.any():
                total = (square * (noise + variances[k]))[own].sum() / max((1.0 - explained)[own].sum(), 1.0)
                variances[k] = max(total * _consistency(share, linear.numbers) - noise[own].mean(), MIN_VARIANCE)
        if len(groups.searched) and len(groups.grouped):
            x, C = self.d[groups.grouped], self.covariance[groups.block]
            factor = float((x @ x + 1.0) / (len(x) - np.trace(C) / factor + 1.0))
        return Sizes(sizes.errors.with_variances(variances), factor)


def _consistency(share: float, numbers: Int[np.ndarray, "n targets"]) -> float:
    """Variance over that of the share of all residuals that are shortest (Croux and Haesbroeck 1999)."""
    from scipy.special import chdtr, chdtri

    width = float(np.median(numbers[numbers > 0]))
    return 1.0 if share == 1.0 else share / float(chdtr(width + 2.0, chdtri(width, 1.0 - share)))


def _moved(after: Sizes, before: Sizes) -> float:
    variances = np.abs(np.log(after.errors.variances / before.errors.variances)).max()
    return max(float(variances), abs(np.log(after.factor / before.factor)))


def find_agreeing(linear: TrimmedRows, sizes: Sizes, count: int) -> Agreement:
    """The rows that agree.

    Args:
        linear: the rows.
        sizes: to start from, or to hold where they are not searched; no variance of an error is zero.
        count: of the rows that the trimmed sum counts.
    """
    n, rng = len(linear.measured), np.random.default_rng(0)
    starts = np.ones((1 + STARTS, n))
    if n > SUBSET_ROWS:
        starts[1:] = rng.permuted(np.tile(np.arange(n) < SUBSET_ROWS, (STARTS, 1)), axis=1)
    weighed = linear.weighed(sizes)
    rows, objective = weighed.concentrate(starts, count, FIRST_STEPS)
    found = weighed.fit(rows[objective.argmin()] > 0.0)
    for trimmed, settled in ((True, NEARLY_SETTLED), (False, SETTLED)):
        for _ in range(MAX_STEPS):
            following = found.nearest(count) if trimmed else found.agreeing()
            same = np.array_equal(following, found.rows)
            sizes = (found if same else found.weighed.fit(following)).resized(trimmed=trimmed)
            if same and _moved(sizes, found.weighed.sizes) < settled:
                break
            found = linear.weighed(sizes).fit(following)
    return found


def scaled_lengths(
    residual: Float[np.ndarray, "n targets b"], covariance: Float[np.ndarray, "n targets b b"]
) -> Float[np.ndarray, "n targets"]:
    """Length of each residual in standard deviations."""
    square = np.einsum("nti,nti->nt", residual, np.linalg.solve(covariance, residual[..., None])[..., 0])
    return np.sqrt(np.maximum(square, 0.0))


def student_limits(width: Int[np.ndarray, " k"], freedom: float, chance: float) -> Float[np.ndarray, " k"]:
    """Length that a vector of so many numbers, t-distributed, exceeds by a chance."""
    from scipy.special import fdtri

    return np.sqrt(width * fdtri(width, freedom, 1.0 - chance))
