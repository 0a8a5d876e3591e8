"""A fit of a campaign: what its rows say of robot, tracker frame and targets, and the calibration that is made of it."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import FitError
from taskcal.estimation.matrices import factor_positive, single_threaded
from taskcal.identification.calibration import Calibration, Provenance, spread_of
from taskcal.identification.held_out import LeftOut, studentise
from taskcal.identification.holdout import growth_of
from taskcal.identification.hyperparameters import Hyperparameters, Weighed
from taskcal.identification.layout import Layout, PriorOfEstimate, errors_by_unlocated
from taskcal.identification.options import FitOptions
from taskcal.identification.problem import Problem
from taskcal.identification.sibling import Help, described_with


@dataclass(frozen=True, eq=False, kw_only=True)
class Fit:
    """What rows say of all parameters, tracker frame and targets.

    How its covariance grows beyond the measured range is judged where a calibration is kept: that takes as long as the fit, and who
    asks for predictions or sizes alone does not need it.
    """

    campaign: Campaign
    """The rows that were fitted, the others as if nothing had been seen."""
    measured: Campaign
    """All rows, those that were left out among them."""
    problem: Problem
    """Of the fitted rows, in the layout of all parameters."""
    options: FitOptions
    """As the fit took them."""
    asked: FitOptions
    """As they were given."""
    by: Weighed | None = None
    """The solution under its hyperparameters; None where effects have sizes of their own."""
    estimated: Int[np.ndarray, " kept"]
    """Model parameters that were estimated."""
    z: Float[np.ndarray, " z"]
    """Zero where not estimated."""
    covariance: Float[np.ndarray, "z z"]
    """Of the error of z, what was not estimated included."""
    unlocated: Float[np.ndarray, "z k"]
    """Errors of z, beside that covariance, by targets that the poses do not locate, of one standard deviation each."""
    residual: Float[np.ndarray, "n targets b"]
    """Measured less predicted; NaN where nothing was measured."""
    residual_covariance: Float[np.ndarray, "n targets b b"]
    """Of every block's residual."""
    row_covariance: Float[np.ndarray, "n targets b b"]
    """Of the measurements, what the model does not explain included."""
    model_error: tuple[float, ...]
    """As of a `Calibration`, and so are the following."""
    joint_error: tuple[float, ...] = ()
    growth: float = 0.0
    prior_scale: float | None
    group_deviations: Float[np.ndarray, " p"] | None = None
    effective_parameters: float | None
    parameter_groups: int | None
    log_evidence: float | None
    iterations: int
    rounds: int
    reason: str
    help: Help | None = None
    """What came of a sibling, if there is one."""
    left_out: tuple[LeftOut, ...] = ()
    refusal: FitError | None = None
    """Why tracker frame and targets alone were fitted; None where the parameters were."""
    remarks: tuple[str, ...] = ()

    @cached_property
    def located(self) -> Calibration:
        """The calibration as if the poses located every target.

        It judges rows: one that alone is turned away from all others would be right for some place of the target, however wrong its
        joints are.

        Raises:
            FitError: the covariance of the fit is none.
        """
        layout = self.problem.layout
        model = layout.model
        T_tracker_base, T_tool_target = layout.frames(self.z)
        studentised, outliers = studentise(
            self.residual, self.residual_covariance, self.row_covariance, self.campaign, self.options.outlier_level
        )
        return Calibration(
            model=model,
            layout=layout,
            estimated=self.estimated,
            z=self.z,
            z_spread=spread_of(self.covariance),
            T_tracker_base=T_tracker_base,
            T_tool_target=T_tool_target,
            model_error=self.model_error,
            joint_error=self.joint_error,
            range_growth=self.growth,
            prior_scale=self.prior_scale,
            group_deviations=self.group_deviations,
            effective_parameters=self.effective_parameters,
            parameter_groups=self.parameter_groups,
            log_evidence=self.log_evidence,
            ids=self.campaign.ids,
            q=self.campaign.q,
            residuals=self.residual,
            studentised=studentised,
            outliers=outliers,
            left_out=self.left_out,
            iterations=self.iterations,
            rounds=self.rounds,
            reason=self.reason,
            remarks=self.remarks,
            provenance=Provenance.of(
                model, self.measured, described_with(self.help, self.options.described(model, self.measured))
            ),
        )

    @cached_property
    def calibration(self) -> Calibration:
        """The calibration that all of it makes, of no growth beyond the measured range unless that was judged.

        Raises:
            FitError: the covariance of the fit is none.
        """
        if not self.unlocated.shape[1]:
            return self.located
        return replace(self.located, z_spread=spread_of(self.located.z_covariance + self.unlocated @ self.unlocated.T))

    @single_threaded
    def with_growth(self) -> Calibration:
        """The calibration with the growth of its covariance beyond the measured range, judged on the rows that it took."""
        return replace(self.calibration, range_growth=growth_of(self.calibration, self.problem, self.options))

    def learnt(self) -> "Fit":
        """The same, for what needs the parameters: tracker frame and targets alone do not serve.

        Raises:
            FitError: they cannot be estimated; as `NothingLearntError`, no parameter explains the rows.
        """
        if self.refusal is not None:
            raise self.refusal
        return self


# What a fit of some parameters says of all of them.
#
# A parameter that is not estimated still varies in the true robot. It is *considered* (Schmidt 1966; Tapley, Schutz
# and Born 2004, section 6.3): it stays at its nominal value, while its prior stays in the covariance of the
# estimate and of every prediction, the consider covariance.
#
# The estimator x̂_K = F·J_Kᵀ·W·y, F = (J_Kᵀ·W·J_K + P_K)⁻¹, may weigh the measurements otherwise than their true
# covariance R says: a reduced model takes what it leaves out for noise. With Σ the prior's covariance and D the
# parameters left out, the error θ − θ̂ of all parameters and frames has the covariance
#
#     C = A·Σ_K·Aᵀ + G·Σ_D·Gᵀ + F·B·F,   A = F·P_K,   G = (−F·J_KᵀWJ_D; 1),   B = J_KᵀW·R·W·J_K
#
# of which F·B·F, what the measurements' errors make of the estimate, counts for as much more as R is uncertain (`region_factor`),
# and Σ for as much more as its scale is (`VariancePosterior`). The residual y − J·θ̂ of one block has the covariance
# R − S·W·R − R·W·S + J·C·Jᵀ, S = J_K·F·J_Kᵀ. R, Σ and the rest of the
# hyperparameters are those of the largest marginal likelihood of the whole model.
#
# Places of targets that the poses do not locate are considered, too: held at the TCP along directions u, they add u − F·J_KᵀWJ_K·u.

ROUNDING = 1e-9
"""Eigenvalues under zero that sums over all rows leave on unit diagonal, at most."""


def fitted_alone(by: Weighed, whole: Problem, campaign: Campaign, options: FitOptions) -> Fit:
    """The fit of all parameters, or of some where the others are taken for zero.

    Args:
        by: the solution.
        whole: its problem, in the layout of all parameters.
        campaign: of the problem.
        options: of the fit.
    """
    F, hyper, some = by.posterior, by.hyper, by.problem.layout
    from_errors = F @ _factor(by.solution.information)  # a square, so that rounding leaves no variance under zero
    C = F + (hyper.widening - 1.0) * from_errors @ from_errors.T
    if by.prior.parameters is not None:
        k = len(by.prior.sizes)
        from_prior = F[:, :k] @ _factor(by.prior.precision(hyper.prior_factor)[:k, :k])
        C += (hyper.prior_widening - 1.0) * from_prior @ from_prior.T
    z, C = (spread_out(values, some, whole.layout) for values in (by.solution.z, C))
    fit = _fit(by, whole, campaign, options, z, C, hyper, by.covariance - by.prediction_covariance)
    return replace(fit, help=by.help)


def consider(
    by: Weighed,
    whole: Problem,
    prior: PriorOfEstimate,
    hyper: Hyperparameters,
    campaign: Campaign,
    options: FitOptions,
) -> Fit:
    """The fit of some parameters, the others considered.

    Args:
        by: the solution.
        whole: its problem, in the layout of all parameters.
        prior: of all of them.
        hyper: hyperparameters of the whole model.
        campaign: of the problem.
        options: of the fit.
    """
    k = _entries(by.problem.layout, whole.layout)
    z = spread_out(by.solution.z, by.problem.layout, whole.layout)
    d = np.setdiff1d(np.arange(len(z)), k)
    R = whole.covariance(hyper.variances)
    W = np.linalg.inv(by.covariance)
    H = whole.information(z, _root(W))
    B = whole.information(z, _root(W @ R @ W))
    Sigma = hyper.prior_widening * prior.covariance(hyper.prior_factor)
    F = by.posterior
    A = F @ by.prior.precision(by.hyper.prior_factor)
    G = np.zeros((len(z), len(d)))
    G[k], G[d] = -F @ H[np.ix_(k, d)], np.eye(len(d))
    # each part as a square, so that rounding leaves no variance under zero
    spread = np.zeros((len(z), 2 * len(k)))
    spread[k, : len(k)] = A @ _factor(Sigma[np.ix_(k, k)])
    spread[k, len(k) :] = np.sqrt(hyper.widening) * F @ _factor(B[np.ix_(k, k)])
    spread = np.concatenate([spread, G @ _factor(Sigma[np.ix_(d, d)])], axis=1)
    C = spread @ spread.T
    followed = by.prediction_covariance @ W @ R
    own = R - followed - np.swapaxes(followed, -1, -2) + whole.propagate(z, C)[1]
    return _fit(by, whole, campaign, options, z, C, hyper, own)


def _fit(
    by: Weighed,
    whole: Problem,
    campaign: Campaign,
    options: FitOptions,
    z: Float[np.ndarray, " z"],
    C: Float[np.ndarray, "z z"],
    hyper: Hyperparameters,
    own: Float[np.ndarray, "n targets b b"],
) -> Fit:
    """What a solution says, its errors those of hyperparameters of the whole model."""
    some, has_prior, u = by.problem.layout, options.prior is not None, by.prior.unlocated
    unlocated = np.zeros((len(z), u.shape[1]))
    unlocated[_entries(some, whole.layout)] = errors_by_unlocated(u, by.posterior, by.solution.information)
    return Fit(
        campaign=campaign,
        measured=campaign,
        problem=whole,
        options=options,
        asked=options,
        by=by,
        estimated=some.estimated,
        z=z,
        covariance=C,
        unlocated=unlocated,
        residual=by.residual,
        residual_covariance=own,
        row_covariance=by.covariance,
        model_error=tuple(float(np.sqrt(hyper.widening)) * error for error in hyper.model_error),
        prior_scale=hyper.prior_scale if has_prior else None,
        effective_parameters=by.effective_parameters,
        parameter_groups=1 if has_prior and options.prior_scale == "estimate" else None,
        log_evidence=by.log_evidence if has_prior else None,
        iterations=by.solution.iterations,
        rounds=by.rounds,
        reason=by.solution.reason,
    )


def spread_out(values: Float[np.ndarray, "..."], some: Layout, whole: Layout) -> Float[np.ndarray, "..."]:
    """A vector or a matrix of a layout's entries among those of all parameters, zero elsewhere."""
    k = _entries(some, whole)
    out = np.zeros((len(whole.names),) * values.ndim)
    out[np.ix_(*[k] * values.ndim)] = values
    return out


def _entries(some: Layout, whole: Layout) -> Int[np.ndarray, " k"]:
    """Positions of a layout's entries in that of all parameters."""
    return np.concatenate([some.estimated, np.arange(len(whole.estimated), len(whole.names))])


def _factor(C: Float[np.ndarray, "k k"]) -> Float[np.ndarray, "k k"]:
    return factor_positive(C, ROUNDING)


def _root(weights: Float[np.ndarray, "n targets b b"]) -> Float[np.ndarray, "n targets b b"]:
    """Lower triangular L with Lᵀ·L = weights."""
    upper = np.linalg.cholesky(weights[..., ::-1, ::-1])[..., ::-1, ::-1]
    return np.ascontiguousarray(np.swapaxes(upper, -1, -2))
