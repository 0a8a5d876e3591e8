"""The fit and its hyperparameters in turn: model error and prior scale are those of the largest marginal likelihood."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.linalg import LinAlgError

from taskcal.errors import FitError
from taskcal.estimation import evidence
from taskcal.estimation.least_squares import Solution, Stopping, fit
from taskcal.estimation.loss import Loss
from taskcal.estimation.prior import GaussianPrior
from taskcal.estimation.scaled import pseudo_invert_scaled, solve_scaled
from taskcal.identification.belief import Belief
from taskcal.identification.fit_options import FitOptions
from taskcal.identification.problem import Problem, whitener
from taskcal.measurement.observation.observation import UNMEASURED
from taskcal.robot.error_model import ErrorModel

MAX_ROUNDS = 60
"""Of fit and hyperparameters in turn, at most."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Hyperparameters:
    """Model error and prior scale: found by the evidence, known from a calibration, or assumed."""

    variances: Float[np.ndarray, " groups"]
    """Model error of position, m², and of rotation for poses, rad²."""
    prior_factor: float
    """Factor of the prior's covariance."""
    origin: str = "what the campaign shows"
    """Where the model error comes from, in words."""
    own: Float[np.ndarray, " p"] | None = None
    """Prior standard deviation of every parameter, where each effect of each joint has a size of its own."""
    joint_error: tuple[float, ...] = ()
    """Standard deviation of how far every joint stands off at a single pose, radians (metres where it slides)."""

    def __repr__(self) -> str:
        error = self.model_error
        rotation = "" if len(error) == 1 else f" and {error[1] * 1e3:.3g} mrad"
        return f"Hyperparameters(model error {error[0] * 1e3:.3g} mm{rotation}, prior × {self.prior_scale:.2g}: {self.origin})"

    @classmethod
    def of_deviations(
        cls, model_error: Sequence[float], prior_scale: float | None = None, origin: str = "as given"
    ) -> "Hyperparameters":
        """From standard deviations.

        Args:
            model_error: per axis, metres, and radians for poses.
            prior_scale: factor of the tolerances; None for one, as where a fit had no prior.
            origin: of the model error, in words.
        """
        factor = 1.0 if prior_scale is None else float(prior_scale) ** 2
        return cls(variances=np.square(np.asarray(model_error, dtype=float)), prior_factor=factor, origin=origin)

    @property
    def model_error(self) -> tuple[float, ...]:
        """Standard deviation per axis, metres, and radians for poses."""
        return tuple(float(d) for d in np.sqrt(self.variances))

    @property
    def prior_scale(self) -> float:
        """Factor of the prior's standard deviations."""
        return float(np.sqrt(self.prior_factor))

    def deviations(self, model: ErrorModel) -> Float[np.ndarray, " p"]:
        """Prior standard deviation of every parameter of a model, metres and radians.

        Raises:
            ValueError: they are known of other parameters.
        """
        if self.own is None:
            return model.tolerances * self.prior_scale
        if len(self.own) != len(model):
            raise ValueError(f"sizes are known of {len(self.own)} parameters, the model has {len(model)}")
        return self.own


@dataclass(frozen=True, eq=False, kw_only=True)
class Fitted:
    """A fit with its hyperparameters and its linearisation."""

    solution: Solution
    hyper: Hyperparameters
    residual: Float[np.ndarray, "n targets b"]
    prediction_covariance: Float[np.ndarray, "n targets b b"]
    covariance: Float[np.ndarray, "n targets b b"]
    """Of noise and model error."""
    weights: Float[np.ndarray, "n targets"]
    posterior: Float[np.ndarray, "z z"]
    log_evidence: float
    """Of the hyperparameters, by Laplace's approximation; without a prior, minus infinity."""
    rounds: int


def fit_with_hyperparameters(problem: Problem, belief: Belief, options: FitOptions) -> Fitted:
    """Alternate between the estimate and its hyperparameters until both stand still."""
    loss, model_error = options.loss, options.model_error
    # without a prior there is nothing to scale
    prior_scale = options.prior_scale if belief.prior is not None else 1.0
    groups = problem.noise.shape[-1] // 3
    noise = problem.noise[..., ::3, ::3].diagonal(axis1=-2, axis2=-1)[problem.seen.valid]
    tracker = np.array([np.median(variances[variances < UNMEASURED]) for variances in noise.T])
    start = problem.frames.start()
    search_error = isinstance(model_error, str)
    search_scale = isinstance(prior_scale, str)
    if isinstance(model_error, str):
        variances = _first_variances(problem, start, groups)
    else:
        variances = np.square(np.resize(np.atleast_1d(np.asarray(model_error, dtype=float)), groups))
    hyper = Hyperparameters(
        variances=variances, prior_factor=1.0 if isinstance(prior_scale, str) else float(prior_scale) ** 2
    )
    z = start
    final = _final(belief, problem)
    loose = replace(final, decrement=max(final.decrement, 1e-3))
    searching = search_error or search_scale
    rounds = 0
    while True:
        rounds += 1
        # the first fits need not be converged further than the hyperparameters are
        fitted = _fit_once(problem, belief, loss, hyper, z, loose if searching else final, rounds)
        z = fitted.solution.z
        if not searching:
            return fitted
        following = _rescale(fitted, problem, belief, tracker, search_error, search_scale)
        moved = np.abs(following.variances - hyper.variances) / (hyper.variances + tracker)
        scale = abs(np.log(following.prior_factor / hyper.prior_factor))
        hyper = following
        if (moved.max() < 1e-3 and scale < 1e-2) or rounds > MAX_ROUNDS:
            searching = False
            if search_error:
                hyper = _drop_insignificant(fitted, hyper, problem, belief)


def _drop_insignificant(fitted: Fitted, hyper: Hyperparameters, problem: Problem, belief: Belief) -> Hyperparameters:
    """A model error within two standard errors of zero is zero: half of all sound campaigns suggest a little by chance."""
    at, weights = _linearised(fitted, problem, belief), fitted.weights[problem.seen.valid]
    errors = [evidence.score_model_error(at, slice(3 * g, 3 * g + 3), weights)[1] for g in range(len(hyper.variances))]
    return replace(hyper, variances=np.where(hyper.variances < 2.0 * np.array(errors), 0.0, hyper.variances))


SLOW = Stopping(decrement=1e-8, iterations=500)
"""Of a fit without a tracker: directions in which only the prior says where all that stands is turned are as curved by the rows as
by the prior, and there Gauss–Newton's steps shrink by a constant factor alone. The last step is of 10⁻⁴ standard deviations."""

UNDAMPED_END = 1e-2
"""Newton decrement at which a fit without prior ends: its next step would be a seventh of a standard deviation. Steps
in undetermined directions are longer but gain nothing; a fit that went on would creep along them without end."""


def _final(belief: Belief, problem: Problem) -> Stopping:
    if belief.prior is None:
        return Stopping(decrement=UNDAMPED_END, decrease=1e-6)
    return SLOW if problem.kinds else Stopping()


def _first_variances(problem: Problem, start: np.ndarray, groups: int) -> np.ndarray:
    """A tenth of what the nominal robot leaves: on the large side, for a first fit that the prior still steers."""
    nothing = np.zeros((len(start), len(start)))
    residual, _ = problem.propagate(start, nothing)
    return np.array([0.01 * np.nanmean(residual[..., 3 * g : 3 * g + 3] ** 2) for g in range(groups)])


def _fit_once(
    problem: Problem,
    belief: Belief,
    loss: Loss,
    hyper: Hyperparameters,
    z: np.ndarray,
    stopping: Stopping,
    rounds: int,
) -> Fitted:
    frames = problem.frames
    covariance = problem.covariance(hyper.variances)
    white = whitener(covariance)
    start = frames.start()
    precision = belief.precision(hyper.prior_factor)
    scale = np.concatenate([belief.sizes, np.full(len(z) - len(belief.sizes), 1e-3)])
    damping = 1e-2 if belief.prior is None else 0.0
    solution = fit(
        problem.equations(white, loss.code, loss.threshold), z, belief.mean(start), precision, scale, stopping, damping
    )
    if not solution.converged:
        remedy = "keep the prior, or fewer parameters" if belief.prior is None else "keep fewer parameters"
        raise FitError(
            f"the fit did not converge: {solution.reason} ({solution.iterations} iterations, objective {solution.objective:.6g}); "
            f"check the campaign with a robust loss (loss=Cauchy()), or {remedy}"
        )
    posterior = _invert(solution.information + precision)
    residual, prediction_covariance = problem.propagate(solution.z, posterior)
    rms = np.sqrt(np.mean(np.einsum("ntij,ntj->nti", white, np.nan_to_num(residual)) ** 2, axis=2))
    return Fitted(
        solution=solution,
        hyper=hyper,
        residual=residual,
        prediction_covariance=prediction_covariance,
        covariance=covariance,
        weights=loss.weights(rms),
        posterior=posterior,
        log_evidence=_log_evidence(solution, precision, covariance[problem.seen.valid], belief),
        rounds=rounds,
    )


def _log_evidence(
    solution: Solution, precision: Float[np.ndarray, "z z"], noise: Float[np.ndarray, "blocks b b"], belief: Belief
) -> float:
    """Log p(measurements | hyperparameters) = −objective − ½ log|R| + ½ log|P| − ½ log|H + P|, but for a constant."""
    if belief.prior is None:
        return -np.inf
    determinants = np.linalg.slogdet(noise)[1].sum() - np.linalg.slogdet(precision)[1]
    return float(-solution.objective - 0.5 * (determinants + np.linalg.slogdet(solution.information + precision)[1]))


def _invert(A: Float[np.ndarray, "z z"]) -> Float[np.ndarray, "z z"]:
    """Inverse of the posterior information; undetermined directions of a fit without prior get no variance at all.

    They cannot be judged, and the predictions do not depend on them.
    """
    try:
        inverse = solve_scaled(A, np.eye(len(A)))
    except LinAlgError:
        inverse = pseudo_invert_scaled(A, rcond=1e-12)
    return 0.5 * (inverse + inverse.T)


def _linearised(fitted: Fitted, problem: Problem, belief: Belief) -> evidence.Linearised:
    valid, k = problem.seen.valid, len(belief.sizes)
    scaled = np.zeros(len(fitted.posterior), dtype=bool)
    scaled[:k] = True
    prior = belief.prior or GaussianPrior.of_deviations(belief.sizes)
    return evidence.Linearised(
        residual=fitted.residual[valid],
        covariance=(fitted.covariance / fitted.weights[..., None, None])[valid],
        prediction_covariance=fitted.prediction_covariance[valid],
        information=fitted.solution.information,
        posterior=fitted.posterior,
        prior_covariance=prior.covariance,
        deviation=fitted.solution.z[:k] - prior.mean,
        scaled=scaled,
    )


def _rescale(
    fitted: Fitted, problem: Problem, belief: Belief, tracker: np.ndarray, search_error: bool, search_scale: bool
) -> Hyperparameters:
    """One scoring step of the marginal likelihood for every hyperparameter that is searched."""
    at = _linearised(fitted, problem, belief)
    variances = fitted.hyper.variances.copy()
    if search_error:
        weights = fitted.weights[problem.seen.valid]
        for g in range(len(variances)):
            step, _ = evidence.score_model_error(at, slice(3 * g, 3 * g + 3), weights)
            # never to zero in one step, from where the scoring could not come back
            variances[g] = max(variances[g] + step, 0.01 * variances[g], 1e-6 * tracker[g])
    factor = fitted.hyper.prior_factor
    if search_scale and belief.prior is not None:
        factor = evidence.score_prior_scale(at, factor)
    return replace(fitted.hyper, variances=variances, prior_factor=factor)
