"""Measured points that the fit cannot believe."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.special import chdtri

from taskcal.identification.hyperparameters import Fitted
from taskcal.identification.problem import Problem
from taskcal.measurement.campaign import Campaign


@dataclass(frozen=True, kw_only=True)
class Outlier:
    """A measured point that the fit cannot believe."""

    row: int
    """Row of the campaign, counted from 0."""
    id: str
    target: str
    studentised: float
    """Length of its residual over that residual's standard deviation."""
    residual: float
    """Length of its position residual, metres."""


def studentise(
    found: Fitted, problem: Problem, campaign: Campaign, level: float
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
