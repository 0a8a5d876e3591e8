"""Model error and prior scale: what a fit needs beside the measurements, and what the marginal likelihood finds of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import FitError
from taskcal.estimation import evidence
from taskcal.estimation.evidence import Linearised
from taskcal.estimation.least_squares import Ended, Solution, Stopping, fit
from taskcal.estimation.matrices import factor_positive, invert_positive, pseudo_invert_scaled
from taskcal.estimation.prior import GaussianPrior, Loss, Squared
from taskcal.identification.layout import Layout, PriorOfEstimate
from taskcal.identification.options import FitOptions
from taskcal.identification.problem import Problem, whitener
from taskcal.observations.base import UNMEASURED
from taskcal.robot.error_model import ErrorModel


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
    """Standard deviation of the pose-to-pose error of each joint, radians (metres where it slides)."""

    def __repr__(self) -> str:
        error = self.model_error
        rotation = "" if len(error) == 1 else f" and {error[1] * 1e3:.3g} mrad"
        return f"Hyperparameters(model error {error[0] * 1e3:.3g} mm{rotation}, prior × {self.prior_scale:.2g}: {self.origin})"

    @classmethod
    def of_deviations(
        cls, model_error: Sequence[float], prior_scale: float | None = None, origin: str = "as given"
    ) -> "Hyperparameters":
        """Make it from standard deviations.

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


# A fit under given hyperparameters, and what it says of every measured block.

SLOW = Stopping(decrement=1e-8, iterations=500)
"""Of a fit whose steps shrink by a constant factor alone, as Gauss–Newton's do in directions that the rows curve as much as the
prior holds them: without a tracker, and with fewer measured numbers than unknowns. The last step is of 10⁻⁴ standard deviations."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Fitted:
    """A fit with its hyperparameters and its linearisation."""

    problem: Problem
    prior: PriorOfEstimate
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
        if self.problem.caches and self.left.any():
            residual = residual - self.problem.cached(self.solution.z).moved(self.left)
        return residual, covariance

    @property
    def residual(self) -> Float[np.ndarray, "n targets b"]:
        """Measured less predicted; NaN where nothing was measured."""
        return self._propagated[0]

    @property
    def prediction_covariance(self) -> Float[np.ndarray, "n targets b b"]:
        """Covariance of the predictions."""
        return self._propagated[1]

    @cached_property
    def weights(self) -> Float[np.ndarray, "n targets"]:
        """Weights of the loss."""
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
        """Hyperparameters of the parameters, without the blocks."""
        k, b = len(self.prior.sizes), self.covariance.shape[-1]
        prior = self.prior.parameters or GaussianPrior.of_deviations(self.prior.sizes)
        return Linearised(
            residual=np.zeros((0, b)),
            inverse=np.zeros((0, b, b)),
            prediction_covariance=np.zeros((0, b, b)),
            information=self.solution.information,
            precision=self.prior.precision(self.hyper.prior_factor),
            posterior=self.posterior,
            prior_covariance=prior.covariance,
            deviation=(self.solution.z + self.left)[:k] - prior.mean,
            scaled=np.arange(len(self.posterior)) < k,
        )

    def evidence(self) -> float:
        """Log p(measurements | hyperparameters) = −objective − ½ log|R| + ½ log|P| − ½ log|H + P|, but for a constant.

        By Laplace's approximation; minus infinity without a prior.
        """
        if self.prior.parameters is None:
            return -np.inf
        precision = self.prior.precision(self.hyper.prior_factor)
        A = self.solution.information + precision
        objective = self.solution.objective - 0.5 * float(self.left @ A @ self.left)
        noise = -2.0 * np.log(np.einsum("...ii->...i", self.white)[self.problem.seen.valid]).sum()
        determinants = noise - np.linalg.slogdet(precision)[1] + np.linalg.slogdet(A)[1]
        return float(-objective - 0.5 * determinants)


def fit_weighed(
    problem: Problem,
    prior: PriorOfEstimate,
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
        prior: of its estimate.
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
    precision, damping = prior.precision(hyper.prior_factor), 1e-2 if prior.parameters is None else 0.0
    equations = problem.equations(white, loss.code, loss.threshold)
    solution = fit(equations, z, prior.mean, precision, prior.scale, stopping, damping, known)
    slowly = solution.ended is Ended.TOO_MANY_ITERATIONS and stopping.iterations < SLOW.iterations
    if slowly and prior.parameters is not None:
        before, slow = solution.iterations, replace(SLOW, decrement=max(stopping.decrement, SLOW.decrement))
        solution = fit(equations, solution.z, prior.mean, precision, prior.scale, slow, damping, solution)
        solution = replace(solution, iterations=before + solution.iterations)
    if not solution.converged:
        remedy = "keep the prior, or fewer parameters" if prior.parameters is None else "keep fewer parameters"
        raise FitError(
            f"the fit did not converge: {solution.reason} ({solution.iterations} iterations, objective {solution.objective:.6g}); "
            f"check the campaign with a robust loss (loss=Cauchy()), or {remedy}"
        )
    return Fitted(
        problem=problem,
        prior=prior,
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


# The fit and its hyperparameters in turn: model error and prior scale are those of the largest marginal likelihood.

LINEAR_WITHIN = 1.0
"""Newton decrement, a step of 1.4 standard deviations, within which rows that are kept are taken as linear while hyperparameters
are sought: what the curvature adds to a residual there is a thousandth of the noise and less."""

STREAMED_WITHIN = 1e-3
"""The same of rows that are streamed, whose residuals stay those of the last estimate."""

MAX_ROUNDS = 60
"""Of fit and hyperparameters in turn, at most."""

SAMPLED_FROM, SAMPLE = 5000, 1000
"""Rows from which on the search starts from what so many of them come to."""

UNDAMPED_END = 1e-2
"""Newton decrement at which a fit without prior ends: its next step would be a seventh of a standard deviation. Steps
in undetermined directions are longer but gain nothing; a fit that went on would creep along them without end."""


@dataclass(frozen=True, kw_only=True)
class _Sought:
    """Which hyperparameters are sought, and how closely fits end meanwhile and at last."""

    error: bool
    scale: bool
    loose: Stopping
    final: Stopping
    linear: bool
    """Whether the last step of a fit that is not converged counts to first order."""

    @classmethod
    def of(cls, problem: Problem, prior: PriorOfEstimate, options: FitOptions) -> "_Sought":
        tracked = problem.layout.tracked
        final = Stopping() if tracked else SLOW
        if prior.parameters is None:
            final = Stopping(decrement=UNDAMPED_END, decrease=1e-6)
        linear = tracked and prior.parameters is not None and isinstance(options.loss, Squared)
        within = LINEAR_WITHIN if linear and problem.caches else max(final.decrement, STREAMED_WITHIN)
        return cls(
            error=options.model_error == "estimate",
            # without a prior there is nothing to scale
            scale=options.prior_scale == "estimate" and prior.parameters is not None,
            loose=replace(final, decrement=within),
            final=final,
            linear=linear,
        )


def fit_with_hyperparameters(problem: Problem, prior: PriorOfEstimate, options: FitOptions) -> Fitted:
    """Alternate between the estimate and its hyperparameters until both stand still."""
    sought, loss = _Sought.of(problem, prior, options), options.loss
    noise = problem.noise[..., ::3, ::3].diagonal(axis1=-2, axis2=-1)[problem.seen.valid]
    tracker = np.array([np.median(own) if (own := v[v < UNMEASURED]).size else UNMEASURED for v in noise.T])
    z, hyper = _beginning(problem, prior, options, sought)
    searching, rounds = sought.error or sought.scale, 0
    while True:
        rounds += 1
        # the first fits need not be converged further than the hyperparameters are, nor the last before the expected scale
        loose = searching or (sought.linear and sought.scale)
        stopping, linear = (sought.loose, sought.linear) if loose else (sought.final, False)
        fitted = fit_weighed(problem, prior, loss, hyper, z, stopping, linear=linear)
        z = fitted.solution.z
        if not searching:
            fitted = replace(fitted, log_evidence=fitted.evidence(), rounds=rounds)
            return _expected(fitted, sought.final) if sought.scale else fitted
        following = _rescale(fitted, tracker, sought)
        moved = np.abs(following.variances - hyper.variances) / (hyper.variances + tracker)
        scale = abs(np.log(following.prior_factor / hyper.prior_factor))
        hyper = following
        if (moved.max() < 1e-3 and scale < 1e-2) or rounds > MAX_ROUNDS:
            searching = False
            if sought.error:
                hyper = _drop_insignificant(fitted, hyper)


def _beginning(
    problem: Problem, prior: PriorOfEstimate, options: FitOptions, sought: _Sought
) -> tuple[Float[np.ndarray, " z"], Hyperparameters]:
    """Start of the search: the nominal robot; for very many rows, the result of a sample of them."""
    if len(problem.q) > SAMPLED_FROM and sought.linear and (sought.error or sought.scale):
        some = np.sort(np.random.default_rng(0).choice(len(problem.q), size=SAMPLE, replace=False))
        fitted = fit_with_hyperparameters(problem.take(some), prior, options)
        factor = fitted.hyper.prior_factor if fitted.likeliest_factor is None else fitted.likeliest_factor
        return fitted.solution.z, replace(fitted.hyper, prior_factor=factor)
    start, groups, model_error, scale = problem.layout.start(), problem.noise.shape[-1] // 3, options.model_error, 1.0
    if isinstance(model_error, str):
        variances = _first_variances(problem, start, groups)
    else:
        variances = np.square(np.resize(np.atleast_1d(np.asarray(model_error, dtype=float)), groups))
    if prior.parameters is not None and not isinstance(options.prior_scale, str):
        scale = float(options.prior_scale)
    return start, Hyperparameters(variances=variances, prior_factor=scale**2)


def _first_variances(problem: Problem, start: Float[np.ndarray, " z"], groups: int) -> Float[np.ndarray, " groups"]:
    """A tenth of what the nominal robot leaves: on the large side, for a first fit that the prior still steers."""
    nothing = np.zeros((len(start), len(start)))
    residual, _ = problem.propagate(start, nothing)
    return np.array([0.01 * np.nanmean(residual[..., 3 * g : 3 * g + 3] ** 2) for g in range(groups)])


def _expected(fitted: Fitted, stopping: Stopping) -> Fitted:
    """The fit under the expected scale of the prior; the evidence is that of the most probable one."""
    hyper = fitted.hyper
    hyper = replace(hyper, prior_factor=evidence.expect_prior_scale(fitted.parameters, hyper.prior_factor))
    found = fitted.solution
    again = fit_weighed(fitted.problem, fitted.prior, fitted.loss, hyper, found.z, stopping, known=found)
    steps = found.iterations + again.solution.iterations
    return replace(
        again,
        solution=replace(again.solution, iterations=steps),
        rounds=fitted.rounds,
        log_evidence=fitted.log_evidence,
        likeliest_factor=fitted.hyper.prior_factor,
    )


def _drop_insignificant(fitted: Fitted, hyper: Hyperparameters) -> Hyperparameters:
    """A model error within two standard errors of zero is zero: half of all sound campaigns suggest a little by chance."""
    weights = fitted.weights[fitted.problem.seen.valid]
    groups = range(len(hyper.variances))
    errors = [evidence.score_model_error(fitted.linearised, slice(3 * g, 3 * g + 3), weights)[1] for g in groups]
    return replace(hyper, variances=np.where(hyper.variances < 2.0 * np.array(errors), 0.0, hyper.variances))


def _rescale(fitted: Fitted, tracker: Float[np.ndarray, " groups"], sought: _Sought) -> Hyperparameters:
    """One scoring step of the marginal likelihood for every hyperparameter that is searched."""
    at = fitted.linearised
    variances = fitted.hyper.variances.copy()
    if sought.error:
        weights = fitted.weights[fitted.problem.seen.valid]
        for g in range(len(variances)):
            components = slice(3 * g, 3 * g + 3)
            step, error = evidence.score_model_error(at, components, weights)
            step *= min(1.0, 2.0 / error**2 / evidence.least_curvature(at, components, weights))
            # never to zero in one step, from where the scoring could not come back
            variances[g] = max(variances[g] + step, 0.01 * variances[g], 1e-6 * tracker[g])
    factor = fitted.hyper.prior_factor
    if sought.scale:
        factor = evidence.score_prior_scale(at, factor)
    return replace(fitted.hyper, variances=variances, prior_factor=factor)


# What a fit of some parameters says of all of them.
#
# A parameter that is not estimated still varies in the true robot. It is *considered* (Schmidt 1966; Tapley, Schutz
# and Born 2004, section 6.3): it stays at its nominal value, while its prior stays in the covariance of the
# estimate and of every prediction.
#
# The estimator x̂_K = F·J_Kᵀ·W·y, F = (J_Kᵀ·W·J_K + P_K)⁻¹, may weigh the measurements otherwise than their true
# covariance R says: a reduced model takes what it leaves out for noise. With Σ the prior's covariance and D the
# parameters left out, the error θ − θ̂ of all parameters and frames has the covariance
#
#     C = A·Σ_K·Aᵀ + G·Σ_D·Gᵀ + F·B·F,   A = F·P_K,   G = (−F·J_KᵀWJ_D; 1),   B = J_KᵀW·R·W·J_K
#
# and the residual y − J·θ̂ of one block R − S·W·R − R·W·S + J·C·Jᵀ, S = J_K·F·J_Kᵀ. R, Σ and the rest of the
# hyperparameters are those of the largest marginal likelihood of the whole model.

ROUNDING = 1e-9
"""Eigenvalues under zero that sums over all rows leave on unit diagonal, at most."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Outcome:
    """What a fit says of all parameters, tracker frame and targets."""

    layout: Layout
    """Of all parameters."""
    estimated: Int[np.ndarray, " kept"]
    """Model parameters that were estimated."""
    z: Float[np.ndarray, " z"]
    """Zero where not estimated."""
    covariance: Float[np.ndarray, "z z"]
    """Of the error of z, what was not estimated included."""
    residual_covariance: Float[np.ndarray, "n targets b b"]
    """Of every block's residual."""
    hyper: Hyperparameters
    """Of the whole model."""


def fitted_alone(fit: Fitted, problem: Problem, whole: Layout) -> Outcome:
    """The outcome of a fit of all parameters, or of some where the others are taken for zero."""
    return Outcome(
        layout=whole,
        estimated=problem.layout.kept,
        z=spread_out(fit.solution.z, problem.layout, whole),
        covariance=spread_out(fit.posterior, problem.layout, whole),
        residual_covariance=fit.covariance - fit.prediction_covariance,
        hyper=fit.hyper,
    )


def consider(fit: Fitted, problem: Problem, whole: Problem, prior: PriorOfEstimate, hyper: Hyperparameters) -> Outcome:
    """The outcome of a fit of some parameters, the others considered.

    Args:
        fit: the fit.
        problem: its problem, in the layout of the parameters that it estimates.
        whole: the same campaign in the layout of all parameters.
        prior: of all of them.
        hyper: hyperparameters of the whole model.
    """
    k = _entries(problem.layout, whole.layout)
    z = spread_out(fit.solution.z, problem.layout, whole.layout)
    d = np.setdiff1d(np.arange(len(z)), k)
    R = whole.covariance(hyper.variances) / fit.weights[..., None, None]
    W = np.linalg.inv(fit.covariance) * fit.weights[..., None, None]
    H = whole.information(z, _root(W))
    B = whole.information(z, _root(W @ R @ W))
    Sigma = prior.covariance(hyper.prior_factor)
    F = fit.posterior
    A = F @ fit.prior.precision(fit.hyper.prior_factor)
    G = np.zeros((len(z), len(d)))
    G[k], G[d] = -F @ H[np.ix_(k, d)], np.eye(len(d))
    # each part as a square, so that rounding leaves no variance under zero
    spread = np.zeros((len(z), 2 * len(k)))
    spread[k, : len(k)] = A @ _factor(Sigma[np.ix_(k, k)])
    spread[k, len(k) :] = F @ _factor(B[np.ix_(k, k)])
    spread = np.concatenate([spread, G @ _factor(Sigma[np.ix_(d, d)])], axis=1)
    C = spread @ spread.T
    followed = fit.prediction_covariance @ W @ R
    own = R - followed - np.swapaxes(followed, -1, -2) + whole.propagate(z, C)[1]
    return Outcome(
        layout=whole.layout,
        estimated=problem.layout.kept,
        z=z,
        covariance=C,
        residual_covariance=own * fit.weights[..., None, None],
        hyper=hyper,
    )


def spread_out(values: Float[np.ndarray, "..."], some: Layout, whole: Layout) -> Float[np.ndarray, "..."]:
    """A vector or a matrix of a layout's entries among those of all parameters, zero elsewhere."""
    k = _entries(some, whole)
    out = np.zeros((len(whole.names),) * values.ndim)
    out[np.ix_(*[k] * values.ndim)] = values
    return out


def _entries(some: Layout, whole: Layout) -> Int[np.ndarray, " k"]:
    """Positions of a layout's entries in that of all parameters."""
    return np.concatenate([some.kept, np.arange(len(whole.kept), len(whole.names))])


def _factor(C: Float[np.ndarray, "k k"]) -> Float[np.ndarray, "k k"]:
    return factor_positive(C, ROUNDING)


def _root(weights: Float[np.ndarray, "n targets b b"]) -> Float[np.ndarray, "n targets b b"]:
    """Lower triangular L with Lᵀ·L = weights."""
    upper = np.linalg.cholesky(weights[..., ::-1, ::-1])[..., ::-1, ::-1]
    return np.ascontiguousarray(np.swapaxes(upper, -1, -2))
