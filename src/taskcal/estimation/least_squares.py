"""Levenberg–Marquardt on normal equations, with a Gaussian prior."""

from dataclasses import dataclass
from enum import Enum

import numpy as np
from jaxtyping import Float

from taskcal.estimation.matrices import solve_scaled
from taskcal.kernels.points import WhitenedEquations


@dataclass(frozen=True, kw_only=True)
class Stopping:
    """When a fit is done."""

    decrement: float = 1e-12
    """Newton decrement: half the squared length of the step, in units of the posterior's own standard deviations. Unlike
    the step itself it is meaningful where some direction is hardly determined."""
    decrease: float = 0.0
    """Decrease of the objective relative to itself, below which the fit stops."""
    iterations: int = 100


class Ended(Enum):
    """Why a fit ended."""

    NOTHING_TO_ESTIMATE = "nothing was to be estimated"
    CONVERGED = "the estimate has converged"
    CANNOT_FALL = "converged to rounding"
    HARDLY_FALLS = "the fit improved by less than {decrease:g} of itself"
    TOO_MANY_ITERATIONS = "no convergence in {iterations} iterations"
    NO_STEP_FALLS = "no step improves the fit"

    @property
    def converged(self) -> bool:
        """Whether it ended at a minimum."""
        return self not in (Ended.TOO_MANY_ITERATIONS, Ended.NO_STEP_FALLS)

    def text(self, stopping: Stopping) -> str:
        """In words, with the bounds that the fit had."""
        return self.value.format(**vars(stopping))


@dataclass(frozen=True, eq=False, kw_only=True)
class Solution:
    """Where the fit ended, and why."""

    z: Float[np.ndarray, " p"]
    cost: float
    """Of the data alone: half the sum of squared whitened residuals (of their losses)."""
    objective: float
    """With the prior's share."""
    information: Float[np.ndarray, "p p"]
    """JᵀWJ of the data at the solution, without the prior."""
    gradient: Float[np.ndarray, " p"]
    """JᵀWr there."""
    left: Float[np.ndarray, " p"]
    """The step that was next and is below the bound; zero where the fit ended otherwise."""
    iterations: int
    ended: Ended
    stopping: Stopping

    @property
    def converged(self) -> bool:
        """Whether it is a minimum."""
        return self.ended.converged

    @property
    def reason(self) -> str:
        """Why the fit ended, in words."""
        return self.ended.text(self.stopping)


def fit(
    equations: WhitenedEquations,
    start: Float[np.ndarray, " p"],
    mean: Float[np.ndarray, " p"],
    precision: Float[np.ndarray, "p p"],
    scale: Float[np.ndarray, " p"],
    stopping: Stopping | None = None,
    damping: float = 0.0,
    known: Solution | None = None,
) -> Solution:
    """Minimise cost(z) + ½(z − mean)ᵀ·precision·(z − mean).

    Damping is Levenberg's, λ/scale² on the diagonal, and only as much as makes the objective fall (Nocedal and Wright
    2006, section 10.3). Without a prior it is what keeps undetermined directions where they started.

    Args:
        equations: the data's cost, gradient and information.
        start: first z; where the cost is infinite, the fit goes on from the prior's mean.
        mean: the prior's mean.
        precision: the prior's inverse covariance; zero for none.
        scale: natural size of each parameter.
        stopping: when to stop.
        damping: first λ, below which it never falls.
        known: a solution of the same equations, under another prior, that ended where this fit starts.
    """
    stopping = stopping or Stopping()
    z, floor = np.array(start, dtype=float), damping
    cost, g, H = equations(z) if known is None else (known.cost, known.gradient, known.information)
    objective = cost + 0.5 * (z - mean) @ precision @ (z - mean)
    ended = Ended.TOO_MANY_ITERATIONS if len(z) else Ended.NOTHING_TO_ESTIMATE
    iteration, left = 0, np.zeros(len(z))
    while not ended.converged and iteration < stopping.iterations:
        iteration += 1
        b = g - precision @ (z - mean)
        A = H + precision
        try:
            step = solve_scaled(A + np.diag(damping / scale**2) if damping else A, b)
        except np.linalg.LinAlgError:
            damping = max(10.0 * damping, 1e-9 * float(np.max(np.diag(A) * scale**2)))
            continue
        if np.isfinite(objective) and 0.5 * float(b @ step) < stopping.decrement:
            ended, left = Ended.CONVERGED, step
            break
        predicted = float(b @ step - 0.5 * step @ A @ step)
        trial = z + step
        trial_cost, trial_g, trial_H = equations(trial)
        trial_objective = trial_cost + 0.5 * (trial - mean) @ precision @ (trial - mean)
        fall = objective - trial_objective
        if not fall > 0.0:
            # near the minimum the objective cannot tell rounding from progress
            if predicted < 1e-11 * (1.0 + abs(objective)):
                ended = Ended.CANNOT_FALL
                if np.isfinite(trial_objective):  # the gradient can: the step leads nearer
                    z, cost, g, H, objective = trial, trial_cost, trial_g, trial_H, trial_objective
                break
            damping = max(10.0 * damping, 1e-9 * float(np.max(np.diag(A) * scale**2)))
            if damping > 1e12 * float(np.max(np.diag(A) * scale**2)):
                ended = Ended.NO_STEP_FALLS
                break
            continue
        relative = fall / max(abs(objective), 1e-300) if np.isfinite(objective) else 1.0
        z, cost, g, H, objective = trial, trial_cost, trial_g, trial_H, trial_objective
        damping = max(damping / 10.0, floor)
        if relative < stopping.decrease:
            ended = Ended.HARDLY_FALLS
            break
    return Solution(
        z=z,
        cost=cost,
        objective=float(objective),
        information=H,
        gradient=g,
        left=left,
        iterations=iteration,
        ended=ended,
        stopping=stopping,
    )
