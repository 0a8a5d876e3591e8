"""The fit and its hyperparameters in turn: model error and prior scale are those of the largest marginal likelihood."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from taskcal.estimation import evidence
from taskcal.estimation.least_squares import Stopping
from taskcal.estimation.loss import Squared
from taskcal.identification.belief import Belief
from taskcal.identification.fit_options import FitOptions
from taskcal.identification.hyperparameters import Hyperparameters
from taskcal.identification.problem import Problem
from taskcal.identification.weighed_fit import SLOW, Fitted, fit_weighed
from taskcal.measurement.observation.observation import UNMEASURED

LINEAR_WITHIN = 1.0
"""Newton decrement, a step of 1.4 standard deviations, within which rows that are kept are taken as linear while hyperparameters
are sought: what the curvature adds to a residual there is a thousandth of the noise and less."""

CLOSE = 1e-3
"""The same of rows that are streamed, whose residuals stay those of the last estimate."""

MAX_ROUNDS = 60
"""Of fit and hyperparameters in turn, at most."""

MANY, SOME = 5000, 1000
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
    def of(cls, problem: Problem, belief: Belief, options: FitOptions) -> "_Sought":
        final = SLOW if problem.kinds else Stopping()
        if belief.prior is None:
            final = Stopping(decrement=UNDAMPED_END, decrease=1e-6)
        linear = not problem.kinds and belief.prior is not None and isinstance(options.loss, Squared)
        within = LINEAR_WITHIN if linear and problem.keeps_rows else max(final.decrement, CLOSE)
        return cls(
            error=options.model_error == "estimate",
            # without a prior there is nothing to scale
            scale=options.prior_scale == "estimate" and belief.prior is not None,
            loose=replace(final, decrement=within),
            final=final,
            linear=linear,
        )


def fit_with_hyperparameters(problem: Problem, belief: Belief, options: FitOptions) -> Fitted:
    """Alternate between the estimate and its hyperparameters until both stand still."""
    sought, loss = _Sought.of(problem, belief, options), options.loss
    noise = problem.noise[..., ::3, ::3].diagonal(axis1=-2, axis2=-1)[problem.seen.valid]
    tracker = np.array([np.median(variances[variances < UNMEASURED]) for variances in noise.T])
    z, hyper = _beginning(problem, belief, options, sought)
    searching, rounds = sought.error or sought.scale, 0
    while True:
        rounds += 1
        # the first fits need not be converged further than the hyperparameters are, nor the last before the expected scale
        loose = searching or (sought.linear and sought.scale)
        stopping, linear = (sought.loose, sought.linear) if loose else (sought.final, False)
        fitted = fit_weighed(problem, belief, loss, hyper, z, stopping, linear=linear)
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
    problem: Problem, belief: Belief, options: FitOptions, sought: _Sought
) -> tuple[Float[np.ndarray, " z"], Hyperparameters]:
    """Where the search begins: the nominal robot; of very many rows, what some of them come to."""
    if len(problem.q) > MANY and sought.linear and (sought.error or sought.scale):
        some = np.sort(np.random.default_rng(0).choice(len(problem.q), size=SOME, replace=False))
        fitted = fit_with_hyperparameters(problem.take(some), belief, options)
        factor = fitted.hyper.prior_factor if fitted.likeliest_factor is None else fitted.likeliest_factor
        return fitted.solution.z, replace(fitted.hyper, prior_factor=factor)
    start, groups, model_error, scale = problem.frames.start(), problem.noise.shape[-1] // 3, options.model_error, 1.0
    if isinstance(model_error, str):
        variances = _first_variances(problem, start, groups)
    else:
        variances = np.square(np.resize(np.atleast_1d(np.asarray(model_error, dtype=float)), groups))
    if belief.prior is not None and not isinstance(options.prior_scale, str):
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
    again = fit_weighed(fitted.problem, fitted.belief, fitted.loss, hyper, found.z, stopping, known=found)
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
