"""Optimal experiments: which of many candidate measurements to make (Fedorov 1972, Atkinson and Donev 1992).

A candidate is a block of whitened rows X (b, d); a choice of candidates has the information M = M₀ + ΣXᵀX. Adding a block
changes C = M⁻¹ by −C·Xᵀ·S⁻¹·X·C with S = I + X·C·Xᵀ, removing it by the same with S = I − X·C·Xᵀ and the other sign, so no
matrix larger than a block is ever inverted. A plan starts greedily; then each block in turn is exchanged for the best
candidate until no exchange helps. Where there are few candidates, an exchange easily ends in a poor optimum: there it is
also started from random choices, and the best end counts.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.estimation.criteria import Criterion

# What an information matrix, or a stack of sensitivities, says of its parameters.


@dataclass(frozen=True, kw_only=True)
class Observability:
    """Observability indices of a set of poses (Sun and Hollerbach 2008); larger is better in each."""

    O1: float
    """Geometric mean of the singular values over √n (Borm and Menq 1991)."""
    O2: float
    """Smallest over largest singular value (Driels and Pathre 1990)."""
    O3: float
    """Smallest singular value (Nahvi et al. 1994)."""
    O4: float
    """O3·O2, the noise amplification index (Nahvi and Hollerbach 1996)."""
    O5: float
    """Harmonic mean of the singular values (Sun and Hollerbach 2008)."""


def observability(singular_values: Float[np.ndarray, " p"], poses: int) -> Observability:
    """Observability indices from the singular values of the stacked sensitivities of some poses."""
    s = np.asarray(singular_values, dtype=float)
    if not len(s):
        return Observability(O1=0.0, O2=0.0, O3=0.0, O4=0.0, O5=0.0)
    low, high = float(s.min()), float(s.max())
    if low == 0.0:
        return Observability(O1=0.0, O2=0.0, O3=0.0, O4=0.0, O5=0.0)
    return Observability(
        O1=float(np.exp(np.log(s).mean()) / np.sqrt(poses)),
        O2=low / high,
        O3=low,
        O4=low * low / high,
        O5=float(len(s) / np.sum(1.0 / s)),
    )


SHORTLIST_SIZE = 200
"""Candidates of the largest D-gain among which a criterion of the spectrum is evaluated exactly."""

POOL_SIZE, STEPS_PER_POOL = 500, 8
"""Gains change slowly from one step to the next: all candidates are weighed every few steps, and in between only those
that were best then."""

MAX_STARTS, MAX_EFFORT = 24, 5_000
"""Random starts beside the greedy one: so many, or as many as keep starts × candidates × count below the effort."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Candidates:
    """What could be measured, and what it is for, in coordinates of unit prior variance."""

    rows: Float[np.ndarray, "n b d"]
    """Whitened sensitivities of each candidate; zero rows where nothing would be seen."""
    prior: Float[np.ndarray, "d d"]
    """Information before any of them: the prior's, and that of what is measured already."""
    task: Float[np.ndarray, "d d"]
    """W: the task's mean squared error is tr(W·C)."""
    signal: Float[np.ndarray, "d d"]
    """Of criteria that leave the prior out: information of a measurement as such, zero or that of a campaign."""
    of: Int[np.ndarray, " n"] | None = None
    """Group of each candidate, counted from 0; None where they are one."""
    fewest: int = 0
    """Of each group."""

    def allowed(self, chosen: list[int], left: int) -> Bool[np.ndarray, " n"]:
        """Which may come next beside those chosen, so that those `left` to choose do for every group."""
        every = np.ones(len(self.rows), dtype=bool)
        if self.of is None:
            return every
        lacking = self.fewest - np.bincount(self.of[chosen], minlength=int(self.of.max()) + 1)
        return (lacking > 0)[self.of] if np.maximum(lacking, 0).sum() >= left else every


@dataclass(frozen=True, eq=False, kw_only=True)
class Choice:
    """The candidates chosen."""

    chosen: Int[np.ndarray, " count"]
    """Which; where no random start did better, in the order in which the greedy start found their places."""
    started: Int[np.ndarray, " count"]
    """Those of the greedy start, in its order, before any exchange."""
    greedy: Float[np.ndarray, " count"]
    """Task error (rms) after each step of the greedy start: what so many measurements give."""
    value: float
    """The criterion at the end; smaller is better."""
    exchanges: int
    """How many blocks were exchanged, from the start that did best."""


def _small(a: Float[np.ndarray, "n b d"], b: Float[np.ndarray, "n b d"]) -> Float[np.ndarray, "n b b"]:
    """a·bᵀ of each block, symmetric; one row product at a time is faster than a batch of tiny matrices."""
    rows = a.shape[1]
    out = np.empty((len(a), rows, rows))
    for i in range(rows):
        for j in range(i + 1):
            out[:, i, j] = out[:, j, i] = np.einsum("nd,nd->n", a[:, i], b[:, j])
    return out


def _solve_trace(S: Float[np.ndarray, "n b b"], Y: Float[np.ndarray, "n b b"]) -> Float[np.ndarray, " n"]:
    """Trace of S⁻¹·Y for each block; 3×3 by cofactors, in vectors over the blocks."""
    if S.shape[1] != 3:
        return np.trace(np.linalg.solve(S, Y), axis1=1, axis2=2)
    a, b, c, d, e, f = S[:, 0, 0], S[:, 0, 1], S[:, 0, 2], S[:, 1, 1], S[:, 1, 2], S[:, 2, 2]
    A, B, C = d * f - e * e, c * e - b * f, b * e - c * d
    D, E, F = a * f - c * c, b * c - a * e, a * d - b * b
    determinant = a * A + b * B + c * C
    total = A * Y[:, 0, 0] + D * Y[:, 1, 1] + F * Y[:, 2, 2]
    total += 2.0 * (B * Y[:, 0, 1] + C * Y[:, 0, 2] + E * Y[:, 1, 2])
    return total / determinant


class _State:
    """Covariance of the present choice, and the gain of every candidate over it."""

    def __init__(self, candidates: Candidates, criterion: Criterion):
        self.candidates = candidates
        self.criterion = criterion
        self.C = np.linalg.inv(candidates.prior)
        self.information = candidates.signal.copy()
        self.weight = np.eye(len(self.C)) if criterion == "A" else candidates.task
        values, vectors = np.linalg.eigh(self.weight)
        strong = values > 1e-14 * max(values[-1], 1e-300)
        self.root = vectors[:, strong] * np.sqrt(values[strong])
        self.size = 0
        self.watch(np.zeros(0, dtype=np.int64))

    def watch(self, pool: Int[np.ndarray, " k"]) -> None:
        """Follow what the gains of a pool are made of from one change to the next."""
        self.watched = pool
        self.flat = self.candidates.rows[pool].reshape(-1, len(self.C))
        self.S, self.V = self._parts(self.candidates.rows[pool])

    def change(self, i: int, sign: float) -> None:
        """Add (+1) or remove (−1) a candidate."""
        X = self.candidates.rows[i]
        XC = X @ self.C
        S = np.eye(len(X)) + sign * (XC @ X.T)
        K = sign * np.linalg.solve(S, XC)
        self.C = self.C - XC.T @ K
        self.C = 0.5 * (self.C + self.C.T)
        D = self.flat @ XC.T
        self.S -= _small(D.reshape(self.S.shape), (self.flat @ K.T).reshape(self.S.shape))
        self.V -= (D @ (K @ self.root)).reshape(self.V.shape)
        self.information = self.information + sign * X.T @ X
        self.size += int(sign)

    def task_error(self) -> float:
        return float(np.sqrt(max(np.sum(self.candidates.task * self.C), 0.0)))

    def value(self) -> float:
        """The criterion, smaller is better."""
        if self.criterion == "task":
            return self.task_error()
        if self.criterion == "A":
            return float(np.trace(self.C))
        if self.criterion == "D":
            return float(np.linalg.slogdet(self.C)[1])
        return float(self._spectral(self.information[None])[0])

    def _spectral(self, information: Float[np.ndarray, "n d d"]) -> Float[np.ndarray, " n"]:
        s = np.sqrt(np.maximum(np.linalg.eigvalsh(information), 0.0))
        if self.criterion == "E":
            # ties at zero are broken by what is there already, so that a greedy start knows where to go
            return -(s[:, 0] + 1e-6 * np.minimum(s, 1.0).sum(axis=1))
        poses, s = max(self.size, 1), np.maximum(s, 1e-9)
        return -np.array([getattr(observability(row, poses), self.criterion) for row in s])

    def gains(self, among: Int[np.ndarray, " k"]) -> Float[np.ndarray, " k"]:
        """Gain of each candidate in the criterion, or in D for a criterion of the spectrum."""
        at = np.minimum(np.searchsorted(self.watched, among), max(len(self.watched) - 1, 0))
        followed = len(self.watched) > 0 and bool((self.watched[at] == among).all())
        S, V = (self.S[at], self.V[at]) if followed else self._parts(self.candidates.rows[among])
        if self.criterion not in ("task", "A"):
            return np.linalg.slogdet(S)[1]
        return _solve_trace(S, _small(V, V))

    def _parts(self, rows: Float[np.ndarray, "k b d"]) -> tuple[Float[np.ndarray, "k b b"], Float[np.ndarray, "k b r"]]:
        """1 + R·C·Rᵀ and R·C·√W of candidates with rows R."""
        n, b, d = rows.shape
        U = rows.reshape(n * b, d) @ self.C
        S = _small(U.reshape(rows.shape), rows)
        S[:, range(b), range(b)] += 1.0
        return S, (U @ self.root).reshape(n, b, self.root.shape[1])

    def pool(self, free: Bool[np.ndarray, " n"]) -> Int[np.ndarray, " k"]:
        """The candidates worth weighing for the next few steps."""
        among = np.flatnonzero(free)
        if len(among) <= POOL_SIZE:
            return among
        gain = self.gains(among)
        return np.sort(among[np.argpartition(-gain, POOL_SIZE)[:POOL_SIZE]])

    def pooled(
        self, pool: Int[np.ndarray, " k"], free: Bool[np.ndarray, " n"], chosen: list[int], left: int
    ) -> Int[np.ndarray, " j"]:
        """Free candidates of a pool that may come next; all free ones where the pool has none."""
        allowed = free & self.candidates.allowed(chosen, left)
        among = pool[allowed[pool]]
        return among if len(among) else np.flatnonzero(allowed)

    def best(self, among: Int[np.ndarray, " k"]) -> int:
        """The candidate that improves the criterion most; of equals the first."""
        gain = self.gains(among)
        if self.criterion in ("task", "A", "D"):
            return int(among[int(np.argmax(gain))])
        listed = among[np.argsort(-gain, kind="stable")[:SHORTLIST_SIZE]]
        rows = self.candidates.rows[listed]
        return int(listed[int(np.argmin(self._spectral(self.information + np.swapaxes(rows, 1, 2) @ rows)))])


def choose(
    candidates: Candidates,
    count: int,
    criterion: Criterion = "task",
    *,
    sweeps: int = 4,
    progress: Callable[[str], None] = lambda _: None,
) -> Choice:
    """Choose `count` candidates: greedily, then by exchange.

    Args:
        candidates: what could be measured, and what for.
        count: how many.
        criterion: ``task`` for the task's mean squared error, or D, A, E, O1–O5.
        sweeps: through all chosen, of exchanges at most.
        progress: told what is being done.
    """
    n = len(candidates.rows)
    count = min(count, n)
    state = _State(candidates, criterion)
    chosen, greedy = _start_greedily(state, count)
    started = np.array(chosen, dtype=np.int64)
    progress("exchange")
    value, exchanges = _exchange(state, chosen, sweeps)
    rng = np.random.default_rng(0)
    for _ in range(min(MAX_STARTS, MAX_EFFORT // max(n * count, 1)) if count < n else 0):
        state = _State(candidates, criterion)
        other = choose_at_random(candidates, count, rng)
        for i in other:
            state.change(i, 1.0)
        trial, trial_exchanges = _exchange(state, other, sweeps)
        if trial < value - 1e-9 * abs(value):
            value, exchanges, chosen = trial, trial_exchanges, other
    return Choice(
        chosen=np.array(chosen, dtype=np.int64), started=started, greedy=greedy, value=value, exchanges=exchanges
    )


def choose_at_random(candidates: Candidates, count: int, rng: np.random.Generator) -> list[int]:
    """So many candidates, any, but of each group as many as it needs."""
    drawn = [int(i) for i in rng.permutation(len(candidates.rows))]
    if candidates.of is None:
        return drawn[:count]
    chosen: list[int] = []
    for group in range(int(candidates.of.max()) + 1):
        chosen += [i for i in drawn if candidates.of[i] == group][: candidates.fewest]
    rest = set(drawn) - set(chosen)
    return (chosen + [i for i in drawn if i in rest])[:count]


def _start_greedily(state: _State, count: int) -> tuple[list[int], Float[np.ndarray, " count"]]:
    """One candidate after another, always the best; and the task error after each."""
    free = np.ones(len(state.candidates.rows), dtype=bool)
    chosen: list[int] = []
    errors: list[float] = []
    pool = np.flatnonzero(free)
    for step in range(count):
        if step % STEPS_PER_POOL == 0:
            pool = state.pool(free)
            state.watch(pool)
        i = state.best(state.pooled(pool, free, chosen, count - step))
        state.change(i, 1.0)
        free[i] = False
        chosen.append(i)
        errors.append(state.task_error())
    return chosen, np.array(errors)


def _exchange(state: _State, chosen: list[int], sweeps: int) -> tuple[float, int]:
    """Exchange each of the chosen in turn, in place, until that helps no more; the criterion then, and how many it were."""
    free = np.ones(len(state.candidates.rows), dtype=bool)
    free[chosen] = False
    value, exchanges = state.value(), 0
    for _ in range(sweeps):
        before = value
        pool = np.union1d(state.pool(free), chosen)
        state.watch(pool)
        for k, old in enumerate(chosen):
            state.change(old, -1.0)
            free[old] = True
            new = state.best(state.pooled(pool, free, chosen[:k] + chosen[k + 1 :], 1))
            state.change(new, 1.0)
            trial = state.value()
            if new != old and trial < value - 1e-12 * abs(value):
                value, exchanges, chosen[k] = trial, exchanges + 1, new
            elif new != old:
                state.change(new, -1.0)
                state.change(old, 1.0)
                new = old
            free[new] = False
        if not value < before - 1e-4 * abs(before):
            break
    return value, exchanges
