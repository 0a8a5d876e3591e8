"""Rows of poses whose noise is known in part, and unknowns whose sizes are: the most probable of both, found together.

    y_i = A_i·x + e_i,   e_i ~ N(0, R_i/w_i),   R_i = N_i + Σ_a v_a·U_ai,   x in groups (`group_variances`)

N_i is the covariance of the instrument's noise. What no parameter explains at a single pose is a white error of the target, and
one of every joint: a joint that stands a little off turns and shifts all that it carries, so that errors of position and rotation,
and of several targets, belong together. U_ai is their covariance for a unit of each variance v_a.

Variances of poses, sizes of groups and weights of poses are those of the largest marginal likelihood, found together
(`maximise`): a search of one while the others stand still swings. With V the derivative of all covariances by the logarithm of a
variance and P what projects the rows on what no estimate explains, the gradient is ½ (yᵀPVPy − tr PV), and the average information
is ½ yᵀPVPV'Py (Gilmour, Thompson and Cullis 1995, Biometrics 51). With δ the step of the logarithms that they ask for,

    v ← v·(1 + (1 − f)·δ) / (1 − f·δ),   f = tr PVPV / tr PV

is exact for errors of one size, of which v is the share f beside noise that is known. Where the rows want less of v, its likelihood
falls as v does, and bends by (1 − f)·|½ (yᵀPVPy − tr PV)| more than the average says; without it, what is next to nothing swings.

A weight follows the others (`weigh`), which makes these bend less: eliminated, with P·V·P·y of its pose for what it is pulled by.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.estimation.group_variances import Evidence, GroupEquations, Groups, unlocked
from taskcal.estimation.matrices import inverse_factors
from taskcal.kernels.chunks import in_chunks

TYPICAL, WIDTH = 5e-5, 3.0
"""Expected standard deviation, metres and radians: what industrial robots repeat to; and that of its square's logarithm."""

FREEDOM = 8.0
"""Degrees of freedom of the t-distribution that single poses' errors are expected to have. A convention: tails longer than a
normal distribution's, as errors of measured robots have."""

MIN_VARIANCE = 1e-14
"""Variance under which there is nothing, m² and rad²."""

MIN_LOG_SIZE = float(np.log(1e-12))
"""Log variance of a group under which there is nothing: a millionth of what is stated."""

CHANGE, CHANGE_OF_SIZE = 100.0, 10.0
"""Factors by which one step of the search changes a variance of single poses, and one of a group, at most."""

TINY = 1e-300
"""Instead of zero in a denominator."""

FLAT = 1e12
"""Variance of a log variance of which nothing is expected."""

MAX_STEPS = 40
"""Of a search."""

LEAST_DAMPING, MOST_DAMPING = 0.1, 1e4
"""Of a step that gains nothing undamped, to begin with and at most: the slope alone decides long before."""

MORE_DAMPED, LESS_DAMPED = 8.0, 4.0
"""Factors of the damping once a step gained nothing, and once it did."""

POSES_AT_ONCE = 128
"""Poses of a thread."""


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

    @classmethod
    def of_deviations(cls, errors: Sequence[float], joints: Sequence[float] = ()) -> "PoseNoise":
        """Known standard deviations: of position, metres, and for poses of rotation, radians, by axis; and of joints."""
        position, *rotation = np.square(np.asarray(errors, dtype=float)).tolist()
        turn = rotation[0] if rotation else None
        return cls(position=position, rotation=turn, joints=np.square(np.array(joints, dtype=float)), searched=False)

    @property
    def variances(self) -> Float[np.ndarray, " k"]:
        """All of them, one behind another."""
        own = [self.position] if self.rotation is None else [self.position, self.rotation]
        return np.array([*own, *self.joints])

    @property
    def precision(self) -> Float[np.ndarray, " k"]:
        """Of the logarithms of the variances about those that are expected."""
        return np.broadcast_to(1.0 / np.square(np.asarray(self.width, dtype=float)), len(self.variances))

    def with_variances(self, variances: Float[np.ndarray, " k"]) -> "PoseNoise":
        """The same with other values."""
        first = 1 if self.rotation is None else 2
        rotation = None if self.rotation is None else float(variances[1])
        return replace(self, position=float(variances[0]), rotation=rotation, joints=variances[first:])

    def covariance(
        self,
        noise: Float[np.ndarray, "n targets b b"],
        units: Sequence[Float[np.ndarray, "n m m"]],
        seen: Bool[np.ndarray, "n m"],
    ) -> Float[np.ndarray, "n m m"]:
        """Covariance of every pose; the identity where nothing was seen.

        Args:
            noise: of the instrument.
            units: covariance of every pose for a unit of each variance.
            seen: which numbers were measured.
        """
        n, targets, b = noise.shape[:3]
        R = np.zeros((n, targets * b, targets * b))
        for t in range(targets):
            R[:, t * b : (t + 1) * b, t * b : (t + 1) * b] = noise[:, t]
        for variance, part in zip(self.variances, units, strict=True):
            R += variance * part
        return np.where(seen[:, :, None] & seen[:, None, :], R, np.eye(targets * b))


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


@dataclass(frozen=True, eq=False, kw_only=True)
class NoisyRows:
    """Rows about an estimate in units of its prior, y = A·x, before they are whitened; zero where nothing was measured."""

    groups: Groups
    A: Float[np.ndarray, "n m p"]
    y: Float[np.ndarray, "n m"]
    seen: Bool[np.ndarray, "n m"]
    noise: Float[np.ndarray, "n targets b b"]
    """Covariance of the instrument's."""
    units: Sequence[Float[np.ndarray, "n m m"]]
    """Covariance of every pose for a unit of each variance of `PoseNoise`."""
    beside: tuple[Float[np.ndarray, "k p"], Float[np.ndarray, " k"]]
    """Whitened rows A and y of what is known beside the poses; they are never left out."""
    tails: bool = False
    """Whether errors of single poses are t-distributed."""

    def take(self, some: Int[np.ndarray, " k"]) -> "NoisyRows":
        """Some of the poses."""
        own = {name: getattr(self, name)[some] for name in ("A", "y", "seen", "noise")}
        return replace(self, units=[unit[some] for unit in self.units], **own)

    def under(
        self, errors: PoseNoise, sizes: Float[np.ndarray, " groups"], weights: Float[np.ndarray, " n"] | None = None
    ) -> "NoisyFit":
        """The model under these errors of single poses, log variances of the groups and weights of the poses, 1 by default."""
        n = len(self.y)
        weights = np.ones(n) if weights is None else weights
        bare = self.whiteners(errors)
        W = bare * np.sqrt(weights)[:, None, None]
        A, y = self.whitened(W), np.einsum("nij,nj->ni", W, self.y)
        found = self.found(A, y, sizes)
        return NoisyFit(rows=self, errors=errors, weights=weights, bare=bare, whitener=W, A=A, y=y, found=found)

    def whiteners(self, errors: PoseNoise) -> Float[np.ndarray, "n m m"]:
        """W with W·R·Wᵀ = 1 at every pose; NaN where a covariance is not positive definite."""
        return inverse_factors(errors.covariance(self.noise, self.units, self.seen))

    def whitened(self, whitener: Float[np.ndarray, "n m m"]) -> Float[np.ndarray, "n m p"]:
        """W·A of every pose."""
        A = np.empty_like(self.A)

        def whiten(rows: slice) -> None:
            np.matmul(whitener[rows], self.A[rows], out=A[rows])

        in_chunks(whiten, len(A), POSES_AT_ONCE)
        return A

    def found(
        self, A: Float[np.ndarray, "n m p"], y: Float[np.ndarray, "n m"], sizes: Float[np.ndarray, " groups"]
    ) -> Evidence:
        """Posterior and evidence of the rows once they are whitened."""
        rows = np.concatenate([A.reshape(y.size, A.shape[2]), self.beside[0]])
        return GroupEquations.of_rows(rows, np.concatenate([y.reshape(-1), self.beside[1]]), self.groups).at(sizes)


@dataclass(frozen=True, eq=False, kw_only=True)
class NoisyFit:
    """The model under some errors of single poses, weights of these, and sizes of groups."""

    rows: NoisyRows
    errors: PoseNoise
    weights: Float[np.ndarray, " n"]
    """How far the errors of single poses are believed to be of the size of most."""
    bare: Float[np.ndarray, "n m m"]
    """W with W·R·Wᵀ = 1 at every pose …"""
    whitener: Float[np.ndarray, "n m m"]
    """… and with the weights of the poses in it."""
    A: Float[np.ndarray, "n m p"]
    y: Float[np.ndarray, "n m"]
    """Whitened rows."""
    found: Evidence
    """At these sizes under these errors."""

    @property
    def log_noise(self) -> float:
        """Part of the log marginal likelihood that is of the size of the errors and of the weights, but for a constant."""
        whitened = np.log(np.abs(np.diagonal(self.whitener, axis1=1, axis2=2))).sum()
        return float(whitened) + log_weights(self.weights[self.rows.seen.any(axis=1)])

    @unlocked
    def log_posterior(self) -> float:
        """Log posterior of errors, sizes and weights."""
        log, errors = self.log_noise + self.found.log_posterior, self.errors
        if not errors.searched:
            return log
        return log - 0.5 * float((errors.precision * np.log(errors.variances / errors.expected) ** 2).sum())

    @property
    def log_evidence(self) -> float:
        """Log marginal likelihood, but for a constant of the rows; sizes integrated out."""
        return self.log_noise + self.found.log_integrated()

    @unlocked
    def left(self) -> Float[np.ndarray, "n m"]:
        """Whitened residuals."""
        return self.y - self.A @ self.found.mean

    @unlocked
    def explained(self) -> Float[np.ndarray, "n m m"]:
        """Covariance of what is predicted of each pose, whitened."""
        return self.found.spread(self.A)

    @unlocked
    def unit_noise(self) -> list[Float[np.ndarray, "n m m"]]:
        """Covariance of every pose for a unit of each variance, whitened; over the weights, as the covariance itself."""
        return [self.bare @ part @ np.swapaxes(self.bare, 1, 2) for part in self.rows.units]

    @unlocked
    def _judged(self) -> list[Float[np.ndarray, "n m m"]]:
        """The same of what no estimate explains."""
        own = np.eye(self.left.shape[1]) - self.explained
        return [own @ part for part in self.unit_noise]

    @unlocked
    def noise_information(self) -> Float[np.ndarray, "k k"]:
        """Fisher information of the log variances of errors by single poses, without what these have in common."""
        flat = np.array([seen.reshape(-1) for seen in self._judged])
        turned = np.array([np.swapaxes(seen, 1, 2).reshape(-1) for seen in self._judged])
        return 0.5 * (flat @ turned.T) * np.outer(self.errors.variances, self.errors.variances)

    @property
    def deviations(self) -> Float[np.ndarray, " k"]:
        """Standard errors of the variances of errors; zero where these are given."""
        if not self.errors.searched:
            return np.zeros(len(self.errors.variances))
        return self.errors.variances / np.sqrt(np.diag(self.noise_information))

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the variance of a pose as a whole, the instrument's noise, which is known, included.

        Twice its square over its own variance (Welch and Satterthwaite, JCGM 100:2008, G.4). Infinite where nothing is estimated.
        """
        if not self.errors.searched:
            return np.inf
        # in whitened units the share of each in the variance of a pose is a mean over all numbers
        traces = np.array([np.trace(part, axis1=1, axis2=2).sum() for part in self.unit_noise])
        share = self.errors.variances * traces / self.rows.seen.sum()
        told = self.noise_information + np.diag(np.maximum(self.errors.precision, 1.0 / FLAT))
        return 2.0 / float(share @ np.linalg.solve(told, share))

    def decrement(self, x: Float[np.ndarray, " p"]) -> float:
        """Half the squared length of the way from an estimate to the posterior mean, in standard deviations of the latter."""
        groups, d = self.rows.groups, self.found.mean - x
        own, free = d[groups.grouped] / self.found.root[groups.grouped], d[groups.group < 0]
        told = np.sum((self.A @ d) ** 2) + np.sum((self.rows.beside[0] @ d) ** 2)
        return 0.5 * float(told + own @ own + free @ groups.held @ free)

    def ascent(self) -> "Ascent":
        """Where errors, sizes and weights go from here."""
        k, found, groups = self._sought, self.found, self.rows.groups
        v, s, member = self.errors.variances[:k], groups.searched, groups.member[:, groups.searched]
        u, determined, A = found.u[groups.grouped], found.determined, self.A.reshape(self.y.size, -1)
        # derivatives of the covariances along what is left, V·P·y; those by sizes are explained but for the prior's part
        T, M = np.zeros((k + len(s), self.y.size)), np.zeros((len(found.u), k + len(s)))
        M[groups.grouped, k:] = (u / found.root[groups.grouped])[:, None] * member
        # yᵀPVPy, what it is expected to be, tr PV, and tr PVPV
        squares, chance, own = (part @ member for part in (u**2, determined, determined**2))
        if k:
            T[:k] = [a * (part @ self.left[..., None]).reshape(-1) for a, part in zip(v, self.unit_noise, strict=True)]
            M[:, :k] = A.T @ T[:k].T
            traces = np.array([np.trace(part, axis1=1, axis2=2).sum() for part in self._judged])
            squares = np.concatenate([T[:k] @ self.left.reshape(-1), squares])
            chance = np.concatenate([v * traces, chance])
            own = np.concatenate([2.0 * np.diag(self.noise_information), own])
        gradient, share = 0.5 * (squares - chance), np.clip(own / np.maximum(chance, TINY), 0.0, 1.0)
        explained = found.times_covariance(M)
        information = 0.5 * M.T @ explained
        information[:k, :k] *= -1.0
        information[k:, k:] *= -1.0
        information += 0.5 * T @ T.T + np.diag(np.where(np.arange(k + len(s)) < k, 0.0, 0.5 * squares))
        information += np.diag((1.0 - share) * np.maximum(-gradient, 0.0))  # of what is next to nothing
        if k:
            gradient[:k] -= self.errors.precision * np.log(v / self.errors.expected)
        gradient[k:] -= groups.precision @ (found.log_variances - groups.location)[s]
        information[:k, :k] += np.diag(self.errors.precision[:k])
        information[k:, k:] += groups.precision
        still = Ascent(
            gradient=gradient,
            information=information,
            share=share,
            nothing=np.concatenate([v <= MIN_VARIANCE, self._sizes <= MIN_LOG_SIZE]),
            most=np.where(np.arange(k + len(s)) < k, CHANGE, CHANGE_OF_SIZE),
            weights=np.zeros(len(self.y)),
            pull=np.zeros((k + len(s), len(self.y))),
            by_weights=0.0,
        )
        if not k or not self.rows.tails:
            return still
        explained[:, :k] *= -1.0
        return self._with_weights(still, (T + (A @ explained).T).reshape(-1, *self.y.shape))

    def _with_weights(self, still: "Ascent", along: Float[np.ndarray, "k n m"]) -> "Ascent":
        """The same where weights follow, from P·V·P·y of each variance."""
        gradient, bend = self.rows.seen.sum(axis=1) - self.squares, self.squares + FREEDOM * self.weights
        gradient = gradient + FREEDOM * (1.0 - self.weights)
        weights, pull = np.log(self.weighed / self.weights), np.einsum("knm,nm->kn", along, self.left) / bend
        return replace(
            still,
            gradient=still.gradient + 0.5 * (pull * bend) @ weights,
            information=still.information - 0.5 * (pull * bend) @ pull.T,
            weights=weights,
            pull=pull,
            by_weights=0.25 * float(weights @ gradient),
        )

    def moved(self, step: Float[np.ndarray, " k"]) -> "NoisyFit":
        """The model a step further."""
        k, sizes = self._sought, self._sizes
        log_variances = self.found.log_variances.copy()
        log_variances[self.rows.groups.searched] = np.maximum(sizes + step[k : k + len(sizes)], MIN_LOG_SIZE)
        if not k:  # rows are whitened as before
            return replace(self, found=self.found.equations.at(log_variances))
        changed = np.maximum(self.errors.variances * np.exp(step[:k]), MIN_VARIANCE)
        weights = self.weights * np.exp(step[k + len(sizes) :])
        return self.rows.under(self.errors.with_variances(changed), log_variances, weights)

    @property
    def _sought(self) -> int:
        """How many variances of errors are sought."""
        return len(self.errors.variances) if self.errors.searched else 0

    @property
    def _sizes(self) -> Float[np.ndarray, " searched"]:
        """Log variances of groups that are sought."""
        return self.found.log_variances[self.rows.groups.searched]

    @unlocked
    def squares(self) -> Float[np.ndarray, " n"]:
        """Squared length of what is left of every pose, expected over what is not known of the estimate."""
        return (self.left**2).sum(axis=1) + np.trace(self.explained, axis1=1, axis2=2)

    @unlocked
    def weighed(self) -> Float[np.ndarray, " n"]:
        """Weights by what is left of the poses."""
        return weigh(self.squares / self.weights, self.rows.seen.sum(axis=1))

    def take(self, some: Int[np.ndarray, " k"], weights: Float[np.ndarray, " n"]) -> "NoisyFit":
        """Some of the poses, of other weights; what is known of their noise is whitened already."""
        rows, weights, by = self.rows.take(some), weights[some], np.sqrt(weights[some] / self.weights[some])[:, None]
        A, y = self.A[some] * by[..., None], self.y[some] * by
        found, whitener = rows.found(A, y, self.found.log_variances), self.whitener[some] * by[..., None]
        return replace(self, rows=rows, weights=weights, bare=self.bare[some], whitener=whitener, A=A, y=y, found=found)

    def without(self, part: Int[np.ndarray, " k"], steps: int, gain: float) -> Evidence:
        """The model without some poses. Sizes follow by some steps, then the weights, and the sizes again; errors of poses stay.

        Sizes that stood still would know the poses that are left out, and flatter what is predicted of them by a tenth. So would
        the weights: poses that disagree with those count less.

        Args:
            part: poses that are left out.
            steps: of each search, at most.
            gain: expected gain of log posterior at which it ends.
        """
        n, held = len(self.y), replace(self, errors=replace(self.errors, searched=False))
        rest = held.take(np.delete(np.arange(n), part), np.ones(n))
        rest = maximise(rest, steps, gain)[0]
        if self.errors.searched:
            rest = maximise(rest.take(np.arange(len(rest.y)), rest.weighed), steps, gain)[0]
        return rest.found


@dataclass(frozen=True, eq=False, kw_only=True)
class Ascent:
    """Slope and bend of the log posterior by logarithms of variances of errors and of sizes, the weights of poses following."""

    gradient: Float[np.ndarray, " k"]
    information: Float[np.ndarray, "k k"]
    share: Float[np.ndarray, " k"]
    """Of each variance in the variance of what it is part of: 1 where it is alone, next to 0 beside larger ones."""
    nothing: Bool[np.ndarray, " k"]
    """Which are too small to matter; they stay so unless the rows want more."""
    most: Float[np.ndarray, " k"]
    """Factor by which a step changes each, at most."""
    weights: Float[np.ndarray, " n"]
    """Step of the logarithms of the weights while all else stands still …"""
    pull: Float[np.ndarray, "k n"]
    """… what they change by with each of the others …"""
    by_weights: float
    """… and the gain expected of that step."""

    @property
    def gain(self) -> float:
        """Expected of the undamped step."""
        return 0.5 * float(self._relative(0.0) @ self.gradient) + self.by_weights

    def step(self, damping: float) -> Float[np.ndarray, " k"]:
        """Step of all logarithms: the more damped, the shorter and the nearer to the slope's direction."""
        relative, least = self._relative(damping), 1.0 / self.most
        grown = np.maximum(1.0 + (1.0 - self.share) * relative, least)
        change = np.log(np.clip(grown / np.maximum(1.0 - self.share * relative, least), least, self.most))
        return np.concatenate([change, self.weights / (1.0 + damping) + change @ self.pull])

    def _relative(self, damping: float) -> Float[np.ndarray, " k"]:
        """Step of the logarithms where the log posterior is a parabola of them."""
        out, free = np.zeros(len(self.gradient)), ~self.nothing | (self.gradient > 0.0)
        information = self.information[np.ix_(free, free)]
        out[free] = np.linalg.solve(information + damping * np.diag(np.diag(information)), self.gradient[free])
        return out


def maximise(at: NoisyFit, steps: int, gain: float) -> tuple[NoisyFit, bool]:
    """Go where errors of single poses, sizes of groups and weights of poses are most probable, by steps damped until they gain.

    Args:
        at: where to start.
        steps: at most.
        gain: of log posterior, expected of the next step, at which the search ends.

    Returns:
        where it ended, and whether no more was to be gained there.
    """
    damping = 0.0
    for _ in range(steps):
        ascent = at.ascent()
        if ascent.gain < gain:
            return at, True
        while not (following := at.moved(ascent.step(damping))).log_posterior >= at.log_posterior:
            damping = max(MORE_DAMPED * damping, LEAST_DAMPING)
            if damping > MOST_DAMPING:
                return at, False
        at, damping = following, damping / LESS_DAMPED if damping > LEAST_DAMPING else 0.0
    return at, False
