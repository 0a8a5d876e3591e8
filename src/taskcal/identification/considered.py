"""What a fit of some parameters says of all of them.

A parameter that is not estimated still varies in the true robot. It is *considered* (Schmidt 1966; Tapley, Schutz and Born
2004, section 6.3): it stays at its nominal value, while its prior stays in the covariance of the estimate and of every
prediction.

The estimator x̂_K = F·J_Kᵀ·W·y, F = (J_Kᵀ·W·J_K + P_K)⁻¹, may weigh the measurements otherwise than their true covariance R
says: a reduced model takes what it leaves out for noise. With Σ the prior's covariance and D the parameters left out, the
error θ − θ̂ of all parameters and frames has the covariance

    C = A·Σ_K·Aᵀ + G·Σ_D·Gᵀ + F·B·F,   A = F·P_K,   G = (−F·J_KᵀWJ_D; 1),   B = J_KᵀW·R·W·J_K

and the residual y − J·θ̂ of one block R − S·W·R − R·W·S + J·C·Jᵀ, S = J_K·F·J_Kᵀ. R, Σ and the rest of the hyperparameters
are those of the largest marginal likelihood of the whole model.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from taskcal.estimation.scaled import factor_positive
from taskcal.identification.belief import Belief
from taskcal.identification.hyperparameters import Hyperparameters
from taskcal.identification.problem import FrameLayout, Problem
from taskcal.identification.weighed_fit import Fitted

ROUNDING = 1e-9
"""Eigenvalues under zero that sums over all rows leave on unit diagonal, at most."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Outcome:
    """What a fit says of all parameters, tracker frame and targets."""

    layout: FrameLayout
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


def fitted_whole(fit: Fitted, problem: Problem) -> Outcome:
    """The outcome of a fit of all parameters."""
    return Outcome(
        layout=problem.frames,
        estimated=problem.frames.kept,
        z=fit.solution.z,
        covariance=fit.posterior,
        residual_covariance=fit.covariance - fit.prediction_covariance,
        hyper=fit.hyper,
    )


def fitted_alone(fit: Fitted, problem: Problem, whole: FrameLayout) -> Outcome:
    """The outcome of a fit of some parameters where nothing else is believed of the others: they are taken for zero."""
    return Outcome(
        layout=whole,
        estimated=problem.frames.kept,
        z=spread_out(fit.solution.z, problem.frames, whole),
        covariance=spread_out(fit.posterior, problem.frames, whole),
        residual_covariance=fit.covariance - fit.prediction_covariance,
        hyper=fit.hyper,
    )


def consider(
    fit: Fitted, problem: Problem, belief: Belief, whole: Problem, believed: Belief, hyper: Hyperparameters
) -> Outcome:
    """The outcome of a fit of some parameters, the others considered.

    Args:
        fit: the fit.
        problem: its problem, in the layout of the parameters that it estimates.
        belief: what it believes of them.
        whole: the same campaign in the layout of all parameters.
        believed: what is believed of all of them.
        hyper: hyperparameters of the whole model.
    """
    k = _entries(problem.frames, whole.frames)
    z = spread_out(fit.solution.z, problem.frames, whole.frames)
    d = np.setdiff1d(np.arange(len(z)), k)
    R = whole.covariance(hyper.variances) / fit.weights[..., None, None]
    W = np.linalg.inv(fit.covariance) * fit.weights[..., None, None]
    H = whole.information(z, _root(W))
    B = whole.information(z, _root(W @ R @ W))
    prior = believed.covariance(hyper.prior_factor)
    F = fit.posterior
    A = F @ belief.precision(fit.hyper.prior_factor)
    G = np.zeros((len(z), len(d)))
    G[k], G[d] = -F @ H[np.ix_(k, d)], np.eye(len(d))
    # each part as a square, so that rounding leaves no variance under zero
    spread = np.zeros((len(z), 2 * len(k)))
    spread[k, : len(k)] = A @ _factor(prior[np.ix_(k, k)])
    spread[k, len(k) :] = F @ _factor(B[np.ix_(k, k)])
    spread = np.concatenate([spread, G @ _factor(prior[np.ix_(d, d)])], axis=1)
    C = spread @ spread.T
    followed = fit.prediction_covariance @ W @ R
    own = R - followed - np.swapaxes(followed, -1, -2) + whole.propagate(z, C)[1]
    return Outcome(
        layout=whole.frames,
        estimated=problem.frames.kept,
        z=z,
        covariance=C,
        residual_covariance=own * fit.weights[..., None, None],
        hyper=hyper,
    )


def spread_out(values: Float[np.ndarray, "..."], some: FrameLayout, whole: FrameLayout) -> Float[np.ndarray, "..."]:
    """A vector or a matrix of a layout's entries among those of all parameters, zero elsewhere."""
    k = _entries(some, whole)
    out = np.zeros((len(whole.names),) * values.ndim)
    out[np.ix_(*[k] * values.ndim)] = values
    return out


def _entries(some: FrameLayout, whole: FrameLayout) -> Int[np.ndarray, " k"]:
    """Where the entries of a layout stand in that of all parameters."""
    return np.concatenate([some.kept, np.arange(len(whole.kept), len(whole.names))])


def _factor(C: Float[np.ndarray, "k k"]) -> Float[np.ndarray, "k k"]:
    return factor_positive(C, ROUNDING)


def _root(weights: Float[np.ndarray, "n targets b b"]) -> Float[np.ndarray, "n targets b b"]:
    """Lower triangular L with Lᵀ·L = weights."""
    upper = np.linalg.cholesky(weights[..., ::-1, ::-1])[..., ::-1, ::-1]
    return np.ascontiguousarray(np.swapaxes(upper, -1, -2))
