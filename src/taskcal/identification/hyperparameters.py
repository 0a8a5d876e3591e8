"""Model error and prior scale: what a fit needs beside the measurements, and what the marginal likelihood finds of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float

from taskcal.errors import FitError
from taskcal.estimation.group_variances import STATED_VARIANCE, variance_posterior
from taskcal.estimation.least_squares import Ended, Solution, Stopping, fit
from taskcal.estimation.matrices import invert_positive, pseudo_invert_scaled
from taskcal.estimation.noisy_rows import MIN_VARIANCE, TYPICAL, WIDTH, PoseNoise
from taskcal.identification.calibration import Calibration
from taskcal.identification.group_model import (
    SETTLED_GAIN,
    GroupFit,
    GroupModel,
    Moved,
    fit_group_model,
    geometry_alone,
    region_factor,
)
from taskcal.identification.layout import PriorOfEstimate
from taskcal.identification.options import FitOptions
from taskcal.identification.problem import Problem, whitener
from taskcal.identification.sibling import Help, evidence_under, expecting, expecting_errors
from taskcal.kernels.points import WhitenedEquations
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
    freedom: float = np.inf
    """Degrees of freedom from which the variance of a pose is known; infinite where it was given, or is the instrument's alone."""
    prior_widening: float = 1.0
    """Factor of the prior's part of a covariance, for regions that allow for how well its scale is known. It is 1 where that was
    given, and where no fewer numbers were measured than are unknown: with fewer, the prior alone holds some directions anywhere."""

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

    @property
    def widening(self) -> float:
        """Factor of the variance of a pose, for regions that allow for how well it is known."""
        return region_factor(self.freedom)

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


def stopping_of(problem: Problem) -> Stopping:
    """When a fit of a problem ends."""
    return Stopping() if problem.layout.tracked else SLOW


@dataclass(frozen=True, eq=False, kw_only=True)
class Weighed:
    """A solution under given hyperparameters."""

    problem: Problem
    prior: PriorOfEstimate
    hyper: Hyperparameters
    solution: Solution
    covariance: Float[np.ndarray, "n targets b b"]
    """Of noise and model error."""
    white: Float[np.ndarray, "n targets b b"]
    rounds: int = 0
    log_evidence: float = -np.inf
    """Of the most probable hyperparameters; minus infinity without a prior."""
    help: Help | None = None
    """What came of a sibling, if there is one."""
    likeliest_factor: float | None = None
    """The most probable factor of the prior's covariance, where the fit was made with the expected one."""

    @cached_property
    def posterior(self) -> Float[np.ndarray, "z z"]:
        """Covariance of the estimate."""
        return _invert(self.solution.information + self.prior.precision(self.hyper.prior_factor))

    @property
    def effective_parameters(self) -> float | None:
        """How many parameters the rows determine: k − tr(P·S), P the prior's precision, S the posterior covariance (MacKay 1992).

        None without a prior, where every parameter counts.
        """
        if self.prior.parameters is None:
            return None
        k = len(self.prior.sizes)
        P = self.prior.precision(self.hyper.prior_factor)[:k, :k]
        return float(k - np.sum(P * self.posterior[:k, :k]))

    @cached_property
    def _propagated(self) -> tuple[np.ndarray, np.ndarray]:
        return self.problem.propagate(self.solution.z, self.posterior)

    @property
    def residual(self) -> Float[np.ndarray, "n targets b"]:
        """Measured less predicted; NaN where nothing was measured."""
        return self._propagated[0]

    @property
    def prediction_covariance(self) -> Float[np.ndarray, "n targets b b"]:
        """Covariance of the predictions."""
        return self._propagated[1]

    def evidence(self) -> float:
        """Log p(measurements | hyperparameters) = −objective − ½ log|R| + ½ log|P| − ½ log|H + P|, but for a constant.

        By Laplace's approximation; minus infinity without a prior.
        """
        if self.prior.parameters is None:
            return -np.inf
        precision = self.prior.precision(self.hyper.prior_factor)
        A, left = self.solution.information + precision, self.solution.left
        objective = self.solution.objective - 0.5 * float(left @ A @ left)
        noise = -2.0 * np.log(np.einsum("...ii->...i", self.white)[self.problem.seen.valid]).sum()
        determinants = noise - np.linalg.slogdet(precision)[1] + np.linalg.slogdet(A)[1]
        return float(-objective - 0.5 * determinants)


def fit_weighed(
    problem: Problem,
    prior: PriorOfEstimate,
    hyper: Hyperparameters,
    z: Float[np.ndarray, " z"],
    stopping: Stopping,
    known: Solution | None = None,
    equations: WhitenedEquations | None = None,
) -> Weighed:
    """Fit a campaign under given hyperparameters.

    Args:
        problem: the campaign.
        prior: of its estimate.
        hyper: model error and scale of the prior.
        z: where to start.
        stopping: when to end.
        known: a solution under the same model error that ended at `z`.
        equations: of all rows under this model error, where the problem has some of them only.

    Raises:
        FitError: the fit did not converge.
    """
    covariance = problem.covariance(hyper.variances)
    white = whitener(covariance)
    precision, damping = prior.precision(hyper.prior_factor), 1e-2 if prior.parameters is None else 0.0
    equations = equations or problem.equations(white)
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
            f"check the campaign (taskcal doctor), or {remedy}"
        )
    return Weighed(problem=problem, prior=prior, hyper=hyper, solution=solution, covariance=covariance, white=white)


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

LINEAR_WITHIN = SETTLED_GAIN
"""Newton decrement of an estimate by rows that are linear about the one before, within which these are taken as linear while
hyperparameters are sought: the gain of log posterior at which the search itself has settled."""

MAX_ROUNDS = 60
"""Of fit and hyperparameters in turn, at most."""

SAMPLED_FROM = 5000
"""Rows, at most, that hyperparameters are sought on; of more, so many at random. A variance of 15 000 numbers is known to 1 %."""

UNDAMPED_END = 1e-2
"""Newton decrement at which a fit without prior ends: its next step would be a seventh of a standard deviation. Steps
in undetermined directions are longer but gain nothing; a fit that went on would creep along them without end."""

SIGNIFICANT = 2.0
"""Standard errors from zero from which on there is a model error: half of all sound campaigns suggest a little by chance. Also the
root of twice the gain of log evidence that it needs, which comes to the same where rows are many."""


def fit_with_hyperparameters(problem: Problem, prior: PriorOfEstimate, options: FitOptions) -> Weighed:
    """Fit a campaign under the model error and the prior scale that it shows; the scale is the expected one.

    Raises:
        FitError: the fit did not converge.
    """
    final = stopping_of(problem)
    if prior.parameters is None:
        final = Stopping(decrement=UNDAMPED_END, decrease=1e-6)
    loose = replace(final, decrement=max(final.decrement, LINEAR_WITHIN))
    part = _sample(problem)
    one, errors = geometry_alone(part, prior, options), first_errors(part, options)
    hyper, z, known, rounds, help = _hyper(errors, one.groups.location), part.layout.start(), None, 0, None
    scaled, found = bool(len(one.groups.searched)), None
    if errors.searched or scaled:
        found = _search(part, prior, one, errors, loose)
        if options.like is not None:
            found, help = _with_sibling(found, options.like, part, prior, options, loose)
        one, errors, z, rounds = found.group_model, found.errors, found.to.z, found.rounds
        hyper, known = _hyper(errors, found.found.log_variances), found.to.solution if part is problem else None
    deviations = np.zeros(len(hyper.variances)) if found is None else found.end.deviations
    insignificant = errors.searched & (hyper.variances < SIGNIFICANT * deviations) & ~(np.asarray(errors.width) < WIDTH)
    if not insignificant.all():
        # of an error that is there, images hardly tell position and rotation apart: a part goes only where the rows have none of it
        insignificant &= hyper.variances <= 2.0 * MIN_VARIANCE
    if insignificant.any():
        without = replace(hyper, variances=np.where(insignificant, 0.0, hyper.variances))
        if prior.parameters is None or _is_as_probable(part, prior, without, hyper, z, loose):
            hyper, known = without, None
    hyper = replace(hyper, freedom=np.inf if found is None or not hyper.variances.any() else found.end.freedom)
    fitted = fit_weighed(problem, prior, hyper, z, loose if scaled else final, known)
    fitted = replace(fitted, log_evidence=fitted.evidence(), rounds=rounds + 1, help=help)
    if not scaled:
        return fitted
    before = fitted.solution
    scale = variance_posterior(one.equations(before.z, before.gradient, before.information))
    widening = scale.region_factor if problem.measured_numbers < len(before.z) else 1.0
    hyper_of_mean = replace(hyper, prior_factor=scale.mean, prior_widening=widening)
    again = fit_weighed(problem, prior, hyper_of_mean, before.z, final, before)
    return replace(
        again,
        solution=replace(again.solution, iterations=before.iterations + again.solution.iterations),
        rounds=fitted.rounds,
        log_evidence=fitted.log_evidence,
        likeliest_factor=hyper.prior_factor,
        help=help,
    )


def _search(part: Problem, prior: PriorOfEstimate, one: GroupModel, errors: PoseNoise, loose: Stopping) -> GroupFit:
    """Find model error and prior scale, and the estimate under them."""
    linear, z = part.layout.tracked and prior.parameters is not None, part.layout.start()

    def fit_from(begin: np.ndarray, hyper: Hyperparameters) -> Moved:
        # a fit that is damped, where a step to the posterior mean may lead to lengths that do not close
        solution = fit_weighed(part, prior, hyper, begin, loose).solution
        return Moved(solution.z, stands=np.array_equal(solution.z, begin), solution=solution)

    def move(found: GroupFit) -> Moved:
        # where rows are linear, the fit under the new hyperparameters has its end where theirs have it
        begin = one.estimate_of(found.found.mean) if linear else found.z
        return fit_from(begin, _hyper(found.errors, found.found.log_variances))

    if not linear:
        z = fit_from(z, _hyper(errors, one.groups.location)).z
    return fit_group_model(one, z, errors, most_rounds=MAX_ROUNDS, move=move)


def _with_sibling(
    plain: GroupFit, like: Calibration, part: Problem, prior: PriorOfEstimate, options: FitOptions, loose: Stopping
) -> tuple[GroupFit, Help]:
    """Hyperparameters as expected by a sibling, where the rows are more probable so; else those without.

    What is expected of any robot is that its prior's scale is about 1, and its model error `TYPICAL`.
    """
    groups = plain.group_model.groups
    proper = replace(plain.group_model, groups=replace(groups, spread=np.minimum(groups.spread, STATED_VARIANCE)))
    errors = replace(plain.errors, width=WIDTH)
    at = part.linearise(plain.to.z, joints=False)
    one = expecting(proper, like)
    helped = _search(part, prior, one, expecting_errors(plain.errors, like, at, part), loose)
    without = evidence_under(plain.end, proper.groups, errors)
    gain = evidence_under(helped.end, one.groups, expecting_errors(errors, like, at, part)) - without
    help = Help(like=like, gain=gain)
    return (helped if help.taken else plain), help


def _is_as_probable(
    problem: Problem,
    prior: PriorOfEstimate,
    without: Hyperparameters,
    found: Hyperparameters,
    z: Float[np.ndarray, " z"],
    stopping: Stopping,
) -> bool:
    """Whether rows are about as probable without a model error as with the one found, by their likelihood ratio.

    A variance that d numbers tell has a standard error of √(2/d) times itself. It is within two of zero wherever d is under 8,
    although the rows may be 10¹⁰ times as probable under it.
    """
    with_error, alone = (fit_weighed(problem, prior, hyper, z, stopping).evidence() for hyper in (found, without))
    return with_error - alone < 0.5 * SIGNIFICANT**2


def _hyper(errors: PoseNoise, sizes: Float[np.ndarray, " groups"]) -> Hyperparameters:
    return Hyperparameters(variances=errors.variances, prior_factor=float(np.exp(sizes[0])) if len(sizes) else 1.0)


def _sample(problem: Problem) -> Problem:
    """Rows that hyperparameters are sought on."""
    if len(problem.q) <= SAMPLED_FROM:
        return problem
    return problem.take(np.sort(np.random.default_rng(0).choice(len(problem.q), size=SAMPLED_FROM, replace=False)))


def first_errors(problem: Problem, options: FitOptions) -> PoseNoise:
    """Model error as given; or a tenth of what the registered nominal robot leaves, large, as the prior steers a first fit."""
    groups, found = problem.noise.shape[-1] // 3, isinstance(options.model_error, str)
    first = max(0.1 * problem.layout.registration.rms / np.sqrt(3.0), TYPICAL)
    given = first if isinstance(options.model_error, str) else options.model_error
    variances = np.square(np.resize(np.atleast_1d(np.asarray(given, dtype=float)), groups))
    return PoseNoise(
        position=float(variances[0]),
        rotation=float(variances[1]) if groups > 1 else None,
        joints=np.zeros(0),
        searched=found,
        width=np.inf,
    )
