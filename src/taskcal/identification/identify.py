"""The fit: a campaign and a model in, a Calibration out."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np
from jaxtyping import Float
from scipy.linalg import LinAlgError
from scipy.special import chdtri

from taskcal.errors import FitError
from taskcal.estimation import evidence
from taskcal.estimation.blas import single_threaded
from taskcal.estimation.least_squares import Solution, Stopping, fit, solve_scaled
from taskcal.estimation.loss import Loss, Squared
from taskcal.estimation.prior import GaussianPrior
from taskcal.geometry import normal_equations
from taskcal.identification.calibration import Calibration, Outlier, Provenance
from taskcal.identification.problem import FrameLayout, Problem, observe, whitener
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.registration import Registration, check_plausible, check_rows, nominal_poses, register
from taskcal.measurement.tracker import TrackerNoise
from taskcal.robot.error_model import ErrorModel

BASE_PRIOR, TARGET_PRIOR = 10.0, 1.0
"""Standard deviations of tracker frame and targets about their registration, metres and radians: as good as none."""

UNLOCATED_PRIOR = 1e-6
"""The same along directions in which the poses do not locate the targets: there they stay at the tool point."""

Estimate = Literal["estimate"]

WIDE = 5.0
"""A prior scale above this calls for a look at the robot file."""

ROUNDS = 60
"""Of fit and hyperparameters in turn, at most."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Hyperparameters:
    """What the evidence says besides the estimate."""

    variances: Float[np.ndarray, " groups"]
    """Model error of position, m², and of rotation for poses, rad²."""
    prior_factor: float
    """Factor of the prior's covariance."""


@single_threaded
def identify(
    model: ErrorModel,
    campaign: Campaign,
    *,
    keep: Iterable[str] | None = None,
    prior: GaussianPrior | Literal["tolerances"] | None = "tolerances",
    loss: Loss | None = None,
    noise: TrackerNoise | None = None,
    registration: Registration | None = None,
    frames: Literal["fit", "fixed"] = "fit",
    model_error: float | tuple[float, float] | Estimate = "estimate",
    prior_scale: float | Estimate = "estimate",
    outlier_level: float = 0.01,
) -> Calibration:
    """Identify the model's parameters from a campaign, the tracker frame and the targets with them.

    The estimate minimises the whitened residuals with a Gaussian prior on every parameter, so that parameters that
    repeat each other share what is found instead of running away. Real robots deviate from any geometry by far more than
    the tracker's noise, and by their own amounts: a model error beside the noise, and one common scale of the prior, are
    those of the largest marginal likelihood.

    Args:
        model: the model.
        campaign: the measurements.
        keep: names of the parameters to estimate, the others staying nil; all by default.
        prior: ``tolerances`` for the robot's own; a prior over the kept parameters; or None, when only Levenberg's
            damping holds undetermined directions, and the fit ends as soon as the objective falls by less than 10⁻⁶ of
            itself or the Newton decrement is below 10⁻².
        loss: `Squared` (default), `Huber` or `Cauchy`.
        noise: the tracker's, where the campaign does not state uncertainties.
        registration: tracker frame and targets to start from, or to hold; found from the data by default.
        frames: ``fit`` refines tracker frame and targets with the parameters, ``fixed`` holds them as registered.
        model_error: standard deviation of what the model cannot explain, metres (and radians, for poses); or estimated.
        prior_scale: common factor of the prior's standard deviations; or estimated.
        outlier_level: chance of naming any outlier where there is none.

    Returns:
        the calibration: estimate, covariance, residuals, and predictions with their uncertainty.

    Raises:
        CampaignError: too few rows, a row at which the nominal robot's closed loop does not close, joints and points that do
            not belong together, or a model that depends on temperature or time and a row without.
        UnknownName: a name in `keep` that the model does not have.
        FitError: the fit did not converge.
    """
    loss = loss or Squared()
    check_options(prior, frames, model_error, prior_scale)
    kept = np.arange(len(model)) if keep is None else model.indices(keep)
    check_rows(campaign)
    for effect in model.effects:
        campaign.check_told(effect.needs, effect.key)
    poses = nominal_poses(model, campaign)
    if registration is None:
        registration = register(model, campaign, poses)
        check_plausible(registration, model, campaign)
    layout = FrameLayout(
        model=model,
        kept=kept,
        registration=registration,
        targets=campaign.targets,
        pose=campaign.rotations is not None,
        fixed_frames=frames == "fixed",
    )
    problem = Problem(
        frames=layout,
        q=np.ascontiguousarray(campaign.q),
        seen=observe(campaign),
        noise=campaign.covariances(noise),
        conditions=campaign.conditions,
    )
    belief = _belief(layout, prior)
    found = _estimate(problem, belief, loss, model_error, 1.0 if prior is None else prior_scale)
    options = {
        "keep": "all" if len(kept) == len(model) else [model.names[i] for i in kept],
        "prior": "given" if isinstance(prior, GaussianPrior) else prior,
        "loss": {"kind": "squared"}
        if isinstance(loss, Squared)
        else {"kind": type(loss).__name__.lower(), **asdict(loss)},
        "noise": "stated" if campaign.uncertainty is not None else asdict(noise or TrackerNoise()),
        "frames": frames,
        "model_error": model_error,
        "prior_scale": prior_scale,
        "outlier_level": outlier_level,
    }
    # as the file will hold them: lists for tuples
    return _conclude(found, problem, belief, campaign, json.loads(json.dumps(options)))


def check_options(prior: object, frames: object, model_error: object, prior_scale: object) -> None:
    """Refuse what would otherwise silently mean something else."""
    if not (prior is None or prior == "tolerances" or isinstance(prior, GaussianPrior)):
        raise ValueError(f"prior is {prior!r}; give 'tolerances', None, or a GaussianPrior")
    if frames not in ("fit", "fixed"):
        raise ValueError(f"frames is {frames!r}; give 'fit' or 'fixed'")
    errors = model_error if isinstance(model_error, tuple) else (model_error,)
    if model_error != "estimate" and not all(isinstance(e, int | float) and e >= 0.0 for e in errors):
        raise ValueError(f"model_error is {model_error!r}; give 'estimate', or metres, zero or more")
    if prior_scale != "estimate" and not (isinstance(prior_scale, int | float) and prior_scale > 0.0):
        raise ValueError(f"prior_scale is {prior_scale!r}; give 'estimate', or a factor above zero")


@dataclass(frozen=True, eq=False, kw_only=True)
class _Belief:
    """The prior over the kept parameters, and their natural sizes."""

    prior: GaussianPrior | None
    sizes: Float[np.ndarray, " kept"]
    frames: Float[np.ndarray, "frames frames"]
    """Prior precision of tracker frame and targets."""

    def precision(self, factor: float) -> Float[np.ndarray, "z z"]:
        """Of a whole estimate z, frames included."""
        k, count = len(self.sizes), len(self.sizes) + len(self.frames)
        out = np.zeros((count, count))
        if self.prior is not None:
            out[:k, :k] = self.prior.precision / factor
        out[k:, k:] = self.frames
        return out

    def mean(self, start: Float[np.ndarray, " z"]) -> Float[np.ndarray, " z"]:
        out = start.copy()
        out[: len(self.sizes)] = 0.0 if self.prior is None else self.prior.mean
        return out


def frame_precision(layout: FrameLayout) -> Float[np.ndarray, "frames frames"]:
    """Next to nothing is known of tracker frame and targets, but for directions that the poses do not determine."""
    count = len(layout.names) - len(layout.kept)
    out = np.diag(np.where(np.arange(count) < 6, BASE_PRIOR, TARGET_PRIOR) ** -2.0)
    held = layout.registration.unlocated / UNLOCATED_PRIOR**2
    if layout.pose:  # its error frame moves in the axes of the target
        X = layout.registration.T_tool_target[0, :3, :3]
        out[6:9, 6:9] += X.T @ held @ X
    else:
        out[6:, 6:] += held
    return out


def _belief(layout: FrameLayout, prior: GaussianPrior | str | None) -> _Belief:
    frames = np.zeros((0, 0)) if layout.fixed_frames else frame_precision(layout)
    tolerances = layout.model.tolerances[layout.kept]
    if prior is None:
        return _Belief(prior=None, sizes=tolerances, frames=frames)
    if isinstance(prior, GaussianPrior):
        if len(prior.mean) != len(layout.kept):
            raise ValueError(f"the prior has {len(prior.mean)} parameters, {len(layout.kept)} are kept")
        return _Belief(prior=prior, sizes=np.sqrt(np.diag(prior.covariance)), frames=frames)
    return _Belief(prior=GaussianPrior.of_deviations(tolerances), sizes=tolerances, frames=frames)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Found:
    """A fit with its hyperparameters and its linearisation."""

    solution: Solution
    hyper: Hyperparameters
    residual: Float[np.ndarray, "n targets b"]
    spread: Float[np.ndarray, "n targets b b"]
    covariance: Float[np.ndarray, "n targets b b"]
    """Of noise and model error."""
    weights: Float[np.ndarray, "n targets"]
    posterior: Float[np.ndarray, "z z"]
    log_evidence: float
    """Of the hyperparameters, by Laplace's approximation; without a prior, minus infinity."""
    rounds: int


def _estimate(
    problem: Problem,
    belief: _Belief,
    loss: Loss,
    model_error: float | tuple[float, float] | str,
    prior_scale: float | str,
) -> _Found:
    """Alternate between the estimate and its hyperparameters until both stand still."""
    groups = problem.noise.shape[-1] // 3
    tracker = np.array([np.median(problem.noise[..., 3 * g, 3 * g][problem.seen.valid]) for g in range(groups)])
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
    final = _final(belief)
    loose = replace(final, decrement=max(final.decrement, 1e-3))
    searching = search_error or search_scale
    rounds = 0
    while True:
        rounds += 1
        # the first fits need not be converged further than the hyperparameters are
        found = _fit_once(problem, belief, loss, hyper, z, loose if searching else final, rounds)
        z = found.solution.z
        if not searching:
            return found
        following = _rescale(found, problem, belief, tracker, search_error, search_scale)
        moved = np.abs(following.variances - hyper.variances) / (hyper.variances + tracker)
        scale = abs(np.log(following.prior_factor / hyper.prior_factor))
        hyper = following
        if (moved.max() < 1e-3 and scale < 1e-2) or rounds > ROUNDS:
            searching = False
            if search_error:
                hyper = _drop_insignificant(found, hyper, problem, belief)


def _drop_insignificant(found: _Found, hyper: Hyperparameters, problem: Problem, belief: _Belief) -> Hyperparameters:
    """A model error within two standard errors of nil is nil: half of all sound campaigns suggest a little by chance."""
    at, weights = _linearised(found, problem, belief), found.weights[problem.seen.valid]
    errors = [evidence.score_model_error(at, slice(3 * g, 3 * g + 3), weights)[1] for g in range(len(hyper.variances))]
    return replace(hyper, variances=np.where(hyper.variances < 2.0 * np.array(errors), 0.0, hyper.variances))


UNDAMPED_END = 1e-2
"""Newton decrement at which a fit without prior ends: its next step would be a seventh of a standard deviation. Steps
in undetermined directions are longer but gain nothing; a fit that went on would creep along them without end."""


def _final(belief: _Belief) -> Stopping:
    return Stopping(decrement=UNDAMPED_END, decrease=1e-6) if belief.prior is None else Stopping()


def _first_variances(problem: Problem, start: np.ndarray, groups: int) -> np.ndarray:
    """A tenth of what the nominal robot leaves: on the large side, for a first fit that the prior still steers."""
    nothing = np.zeros((len(start), len(start)))
    residual, _ = normal_equations.spread(problem.walked(start), problem.seen, nothing)
    return np.array([0.01 * np.nanmean(residual[..., 3 * g : 3 * g + 3] ** 2) for g in range(groups)])


def _fit_once(
    problem: Problem,
    belief: _Belief,
    loss: Loss,
    hyper: Hyperparameters,
    z: np.ndarray,
    stopping: Stopping,
    rounds: int,
) -> _Found:
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
    residual, spread = normal_equations.spread(problem.walked(solution.z), problem.seen, posterior)
    rms = np.sqrt(np.mean(np.einsum("ntij,ntj->nti", white, np.nan_to_num(residual)) ** 2, axis=2))
    return _Found(
        solution=solution,
        hyper=hyper,
        residual=residual,
        spread=spread,
        covariance=covariance,
        weights=loss.weights(rms),
        posterior=posterior,
        log_evidence=_log_evidence(solution, precision, covariance[problem.seen.valid], belief),
        rounds=rounds,
    )


def _log_evidence(
    solution: Solution, precision: Float[np.ndarray, "z z"], noise: Float[np.ndarray, "blocks b b"], belief: _Belief
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
        scale = 1.0 / np.sqrt(np.maximum(np.diag(A), 1e-300))
        inverse = np.linalg.pinv(A * scale * scale[:, None], rcond=1e-12, hermitian=True) * scale * scale[:, None]
    return 0.5 * (inverse + inverse.T)


def _linearised(found: _Found, problem: Problem, belief: _Belief) -> evidence.Linearised:
    valid, k = problem.seen.valid, len(belief.sizes)
    scaled = np.zeros(len(found.posterior), dtype=bool)
    scaled[:k] = True
    prior = belief.prior or GaussianPrior.of_deviations(belief.sizes)
    return evidence.Linearised(
        residual=found.residual[valid],
        covariance=(found.covariance / found.weights[..., None, None])[valid],
        spread=found.spread[valid],
        information=found.solution.information,
        posterior=found.posterior,
        prior_covariance=prior.covariance,
        deviation=found.solution.z[:k] - prior.mean,
        scaled=scaled,
    )


def _rescale(
    found: _Found, problem: Problem, belief: _Belief, tracker: np.ndarray, search_error: bool, search_scale: bool
) -> Hyperparameters:
    """One scoring step of the marginal likelihood for every hyperparameter that is searched."""
    at = _linearised(found, problem, belief)
    variances = found.hyper.variances.copy()
    if search_error:
        weights = found.weights[problem.seen.valid]
        for g in range(len(variances)):
            step, _ = evidence.score_model_error(at, slice(3 * g, 3 * g + 3), weights)
            # never to nil in one step, from where the scoring could not come back
            variances[g] = max(variances[g] + step, 0.01 * variances[g], 1e-6 * tracker[g])
    factor = found.hyper.prior_factor
    if search_scale and belief.prior is not None:
        factor = evidence.score_prior_scale(at, factor)
    return replace(found.hyper, variances=variances, prior_factor=factor)


def _conclude(
    found: _Found,
    problem: Problem,
    belief: _Belief,
    campaign: Campaign,
    options: Mapping[str, Any],
) -> Calibration:
    """Everything that is reported, from the converged fit."""
    frames, z = problem.frames, found.solution.z
    T_tracker_base, T_tool_target = frames.frames(z)
    studentised, outliers = _studentise(found, problem, campaign, options["outlier_level"])
    deviations = np.sqrt(found.hyper.variances)
    return Calibration(
        model=frames.model,
        layout=frames,
        z=z,
        z_covariance=found.posterior,
        T_tracker_base=T_tracker_base,
        T_tool_target=T_tool_target,
        residuals=found.residual,
        studentised=studentised,
        outliers=outliers,
        ids=campaign.ids,
        model_error=tuple(float(d) for d in deviations),
        prior_scale=float(np.sqrt(found.hyper.prior_factor)) if belief.prior is not None else None,
        log_evidence=found.log_evidence if belief.prior is not None else None,
        field=None,
        iterations=found.solution.iterations,
        rounds=found.rounds,
        reason=found.solution.reason,
        remarks=_remarks(found, frames, campaign, belief.prior is not None),
        provenance=Provenance.of(frames.model, campaign, options),
    )


def _remarks(found: _Found, frames: FrameLayout, campaign: Campaign, has_prior: bool) -> tuple[str, ...]:
    """What is unusual about a fit, in words."""
    out: list[str] = []
    scale = float(np.sqrt(found.hyper.prior_factor))
    if has_prior and len(frames.kept) and scale > WIDE:
        out.append(
            f"the robot deviates {scale:.0f} times as much as its tolerances say: check the joints' order, signs and zero "
            "positions and the lengths in the robot file, or state wider tolerances"
        )
    measured = int(campaign.valid.sum()) * found.residual.shape[2]
    if measured < 2 * len(frames.names):
        out.append(
            f"{measured} measured numbers for {len(frames.names)} unknowns: residuals of the fitted rows say little; hold rows out"
        )
    if found.rounds > ROUNDS:
        out.append("model error and prior scale had not settled when the search for them ended")
    if found.hyper.variances[0] == 0.0 and measured < 2 * len(frames.names):
        out.append("no model error could be told from so few rows, so the stated uncertainty leaves it out")
    errors = np.sqrt(np.diag(found.posterior))
    estimates = {name: (float(z), float(e)) for name, z, e in zip(frames.names, found.solution.z, errors, strict=True)}
    model = frames.model
    return (*out, *(remark for effect in model.effects for remark in effect.remarks(model.robot, estimates)))


def _studentise(
    found: _Found, problem: Problem, campaign: Campaign, level: float
) -> tuple[Float[np.ndarray, "n targets"], tuple[Outlier, ...]]:
    """Length of each residual over its own standard deviation, and the points too long for chance.

    The residual's covariance is R − J·A⁻¹·Jᵀ. The level is shared among all points (Bonferroni), so that a sound campaign
    names any at all with that probability.
    """
    valid = problem.seen.valid
    b = problem.noise.shape[-1]
    out = np.full(valid.shape, np.nan)
    own = (found.covariance - found.spread)[valid]
    values, vectors = np.linalg.eigh(own)
    # directions that the fit follows entirely have no residual to judge
    floor = 1e-6 * np.trace(found.covariance[valid], axis1=1, axis2=2)[:, None] / b
    along = np.einsum("kij,ki->kj", vectors, found.residual[valid])
    square = np.sum(np.where(values > floor, along**2 / np.maximum(values, floor), 0.0), axis=1)
    out[valid] = np.sqrt(square)
    limit = np.sqrt(chdtri(b, level / max(int(valid.sum()), 1)))
    rows = [(float(out[i, t]), int(i), int(t)) for i, t in zip(*np.nonzero(out > limit), strict=True)]
    named = [
        Outlier(
            row=i,
            id=campaign.ids[i],
            target=campaign.targets[t],
            studentised=s,
            residual=float(np.linalg.norm(found.residual[i, t, :3])),
        )
        for s, i, t in sorted(rows, reverse=True)
    ]
    return out, tuple(named)
