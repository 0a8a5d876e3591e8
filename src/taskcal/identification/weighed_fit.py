"""A fit under given hyperparameters, and what it says of every measured block."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float

from taskcal.errors import FitError
from taskcal.estimation.evidence import Linearised
from taskcal.estimation.least_squares import Ended, Solution, Stopping, fit
from taskcal.estimation.loss import Loss, Squared
from taskcal.estimation.prior import GaussianPrior
from taskcal.estimation.scaled import invert_positive, pseudo_invert_scaled
from taskcal.identification.belief import Belief
from taskcal.identification.hyperparameters import Hyperparameters
from taskcal.identification.problem import Problem, whitener

SLOW = Stopping(decrement=1e-8, iterations=500)
"""Of a fit whose steps shrink by a constant factor alone, as Gauss–Newton's do in directions that the rows curve as much as the
prior holds them: without a tracker, and with fewer measured numbers than unknowns. The last step is of 10⁻⁴ standard deviations."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Fitted:
    """A fit with its hyperparameters and its linearisation."""

    problem: Problem
    belief: Belief
    loss: Loss
    hyper: Hyperparameters
    solution: Solution
    left: Float[np.ndarray, " z"]
    """Step to where the linearised fit ends, from the solution about which it is linearised; zero of a fit that converged."""
    covariance: Float[np.ndarray, "n targets b b"]
    """Of noise and model error."""
    white: Float[np.ndarray, "n targets b b"]
    posterior: Float[np.ndarray, "z z"]
    rounds: int
    log_evidence: float = -np.inf
    """Of the hyperparameters; minus infinity without a prior, and of a fit of the search for them."""
    likeliest_factor: float | None = None
    """The most probable factor of the prior's covariance, where the fit was made with the expected one."""

    @cached_property
    def _propagated(self) -> tuple[np.ndarray, np.ndarray]:
        residual, covariance = self.problem.propagate(self.solution.z, self.posterior)
        if self.problem.keeps_rows and self.left.any():
            residual = residual - self.problem.kept_rows(self.solution.z).moved(self.left)
        return residual, covariance

    @property
    def residual(self) -> Float[np.ndarray, "n targets b"]:
        """Measured less predicted; NaN where nothing was measured."""
        return self._propagated[0]

    @property
    def prediction_covariance(self) -> Float[np.ndarray, "n targets b b"]:
        """Of what is predicted."""
        return self._propagated[1]

    @cached_property
    def weights(self) -> Float[np.ndarray, "n targets"]:
        """Of the loss."""
        if isinstance(self.loss, Squared):
            return np.ones(self.problem.seen.valid.shape)
        white = (self.white @ np.nan_to_num(self.residual)[..., None])[..., 0]
        return self.loss.weights(np.sqrt(np.mean(white**2, axis=2)))

    @cached_property
    def linearised(self) -> Linearised:
        """Parameters, and block by block what was seen."""
        valid = self.problem.seen.valid
        W = self.white[valid]
        return replace(
            self.parameters,
            residual=self.residual[valid],
            inverse=np.swapaxes(W, 1, 2) @ W * self.weights[valid][:, None, None],
            prediction_covariance=self.prediction_covariance[valid],
        )

    @property
    def parameters(self) -> Linearised:
        """What is said of the parameters, without the blocks."""
        k, b = len(self.belief.sizes), self.covariance.shape[-1]
        prior = self.belief.prior or GaussianPrior.of_deviations(self.belief.sizes)
        return Linearised(
            residual=np.zeros((0, b)),
            inverse=np.zeros((0, b, b)),
            prediction_covariance=np.zeros((0, b, b)),
            information=self.solution.information,
            precision=self.belief.precision(self.hyper.prior_factor),
            posterior=self.posterior,
            prior_covariance=prior.covariance,
            deviation=(self.solution.z + self.left)[:k] - prior.mean,
            scaled=np.arange(len(self.posterior)) < k,
        )

    def evidence(self) -> float:
        """Log p(measurements | hyperparameters) = −objective − ½ log|R| + ½ log|P| − ½ log|H + P|, but for a constant.

        By Laplace's approximation; minus infinity without a prior.
        """
        if self.belief.prior is None:
            return -np.inf
        precision = self.belief.precision(self.hyper.prior_factor)
        A = self.solution.information + precision
        objective = self.solution.objective - 0.5 * float(self.left @ A @ self.left)
        noise = -2.0 * np.log(np.einsum("...ii->...i", self.white)[self.problem.seen.valid]).sum()
        determinants = noise - np.linalg.slogdet(precision)[1] + np.linalg.slogdet(A)[1]
        return float(-objective - 0.5 * determinants)


def fit_weighed(
    problem: Problem,
    belief: Belief,
    loss: Loss,
    hyper: Hyperparameters,
    z: Float[np.ndarray, " z"],
    stopping: Stopping,
    *,
    linear: bool = False,
    known: Solution | None = None,
) -> Fitted:
    """Fit a campaign under given hyperparameters.

    Args:
        problem: the campaign.
        belief: what is believed beforehand.
        loss: of residuals.
        hyper: model error and scale of the prior.
        z: where to start.
        stopping: when to end.
        linear: whether the step that was next and no longer taken counts, to first order.
        known: a solution under the same model error that ended at `z`.

    Raises:
        FitError: the fit did not converge.
    """
    covariance = problem.covariance(hyper.variances)
    white = whitener(covariance)
    precision = belief.precision(hyper.prior_factor)
    scale = np.concatenate([belief.sizes, np.full(len(z) - len(belief.sizes), 1e-3)])
    damping = 1e-2 if belief.prior is None else 0.0
    equations = problem.equations(white, loss.code, loss.threshold)
    solution = fit(equations, z, belief.mean(problem.frames.start()), precision, scale, stopping, damping, known)
    if (
        solution.ended is Ended.TOO_MANY_ITERATIONS
        and stopping.iterations < SLOW.iterations
        and belief.prior is not None
    ):
        before, slow = solution.iterations, replace(SLOW, decrement=max(stopping.decrement, SLOW.decrement))
        solution = fit(
            equations, solution.z, belief.mean(problem.frames.start()), precision, scale, slow, damping, solution
        )
        solution = replace(solution, iterations=before + solution.iterations)
    if not solution.converged:
        remedy = "keep the prior, or fewer parameters" if belief.prior is None else "keep fewer parameters"
        raise FitError(
            f"the fit did not converge: {solution.reason} ({solution.iterations} iterations, objective {solution.objective:.6g}); "
            f"check the campaign with a robust loss (loss=Cauchy()), or {remedy}"
        )
    return Fitted(
        problem=problem,
        belief=belief,
        loss=loss,
        hyper=hyper,
        solution=solution,
        left=solution.left if linear else np.zeros(len(z)),
        covariance=covariance,
        white=white,
        posterior=_invert(solution.information + precision),
        rounds=1,
    )


def _invert(A: Float[np.ndarray, "z z"]) -> Float[np.ndarray, "z z"]:
    """Inverse of the posterior information; undetermined directions of a fit without prior get no variance at all.

    They cannot be judged, and the predictions do not depend on them.
    """
    try:
        return invert_positive(A)
    except np.linalg.LinAlgError:
        inverse = pseudo_invert_scaled(A, rcond=1e-12)
    return 0.5 * (inverse + inverse.T)
