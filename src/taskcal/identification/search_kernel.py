"""Fits of many robots in one compiled pass, each with its hyperparameters: `hyperparameter_search` without Python.

What a single fit does step by step is done here for one robot after another, of a tracker's points, a model that moves the
joint side by a four-bar's lengths at most, independent parameters, and squared residuals.
"""

from typing import NamedTuple

import numpy as np

from taskcal.geometry.cholesky import factor_scaled, invert_factored
from taskcal.geometry.compiled import compiled, part
from taskcal.geometry.kept_points import keep_noise, move_kept, propagate_kept
from taskcal.geometry.lanes import as_lanes, total_of
from taskcal.identification.fit_kernel import allocate_work, copy_matrix, fit_robot

UNTOUCHED, CONVERGED, FAILED = range(3)
"""How far a robot is."""


class Search(NamedTuple):
    """What is sought, and how closely."""

    error: bool
    """Whether the model error is searched."""
    scale: bool
    """Whether the prior's scale is."""
    loose: float
    """Newton decrement at which fits of the search end."""
    last: float
    """The same of the fit with what was found."""
    linear: bool
    """Whether the step that is left then counts to first order."""
    iterations: int
    """Of a fit, at most."""
    rounds: int
    """Of fit and hyperparameters in turn, at most."""
    smallest: float
    """Factor of the prior's variances …"""
    largest: float
    """… between these bounds."""


@part
def _score_error(kept):
    """Sums of `evidence.score_model_error` over the blocks: |R⁻¹r|², tr Q and tr Q²; and how many were seen."""
    W, C, r = as_lanes(kept.whitener), as_lanes(kept.explained), as_lanes(kept.residual)
    square, trace, curvature, count = 0.0, 0.0, 0.0, 0.0
    for b in range(W.shape[0]):
        w00, w10, w11 = W[b, 0, 0], W[b, 1, 0], W[b, 1, 1]
        w20, w21, w22 = W[b, 2, 0], W[b, 2, 1], W[b, 2, 2]
        i00, i10, i20 = w00 * w00 + w10 * w10 + w20 * w20, w10 * w11 + w20 * w21, w20 * w22
        i11, i21, i22 = w11 * w11 + w21 * w21, w21 * w22, w22 * w22
        c00, c10, c11, c20, c21, c22 = C[b, 0, 0], C[b, 1, 0], C[b, 1, 1], C[b, 2, 0], C[b, 2, 1], C[b, 2, 2]
        m00, m01, m02 = (
            i00 * c00 + i10 * c10 + i20 * c20,
            i00 * c10 + i10 * c11 + i20 * c21,
            i00 * c20 + i10 * c21 + i20 * c22,
        )
        m10, m11, m12 = (
            i10 * c00 + i11 * c10 + i21 * c20,
            i10 * c10 + i11 * c11 + i21 * c21,
            i10 * c20 + i11 * c21 + i21 * c22,
        )
        m20, m21, m22 = (
            i20 * c00 + i21 * c10 + i22 * c20,
            i20 * c10 + i21 * c11 + i22 * c21,
            i20 * c20 + i21 * c21 + i22 * c22,
        )
        q00, q10 = i00 - (m00 * i00 + m01 * i10 + m02 * i20), i10 - (m10 * i00 + m11 * i10 + m12 * i20)
        q20, q11 = i20 - (m20 * i00 + m21 * i10 + m22 * i20), i11 - (m10 * i10 + m11 * i11 + m12 * i21)
        q21, q22 = i21 - (m20 * i10 + m21 * i11 + m22 * i21), i22 - (m20 * i20 + m21 * i21 + m22 * i22)
        u, v, w = r[b, 0], r[b, 1], r[b, 2]
        x, y, z = i00 * u + i10 * v + i20 * w, i10 * u + i11 * v + i21 * w, i20 * u + i21 * v + i22 * w
        square += total_of(x * x + y * y + z * z)
        trace += total_of(q00 + q11 + q22)
        curvature += total_of(q00 * q00 + q11 * q11 + q22 * q22 + 2.0 * (q10 * q10 + q20 * q20 + q21 * q21))
        for lane in range(kept.seen.shape[1]):
            count += kept.seen[b, lane]
    return square, trace, curvature, count


@part
def _score_scale(believed, posterior, z, left, v, search):
    """`evidence.score_prior_scale` of independent parameters."""
    k, s, t, curvature = believed.shape[0], 0.0, 0.0, 0.0
    for i in range(k):
        deviation = z[i] + left[i]
        s += deviation * deviation / (believed[i] * v * v)
        t += 1.0 / v - posterior[i, i] / (believed[i] * v * v)
        for j in range(k):
            same = 1.0 / v if i == j else 0.0
            m, n = same - posterior[i, j] / (believed[i] * v * v), same - posterior[j, i] / (believed[j] * v * v)
            curvature += m * n
    if curvature <= 0.0:
        return v
    low, high = max(0.1 * v, search.smallest), min(10.0 * v, search.largest)
    return min(max(v + (s - t) / curvature, low), high)


@part
def _believe(believed, frames, factor, P):
    """Fill P with the prior's precision."""
    k = believed.shape[0]
    for i in range(P.shape[0]):
        for j in range(P.shape[0]):
            P[i, j] = frames[i - k, j - k] if i >= k and j >= k else 0.0
    for i in range(k):
        P[i, i] = 1.0 / (believed[i] * factor)


@part
def _explain(posterior, work):
    """Fill the posterior covariance; whether there is one."""
    p = posterior.shape[0]
    for i in range(p):
        for j in range(i, p):
            work.A[i, j] = work.H[i, j] + work.P[i, j]
    if not factor_scaled(work.A, work.unit, work.U):
        return False
    invert_factored(work.U, work.unit, work.trial_H, posterior)
    return True


@part
def _search_robot(model, campaigns, search, fits, r, rooms, work):
    """Fit one robot, and its hyperparameters in turn; whether it converged."""
    left, posterior, typical = fits.left[r], fits.posterior[r], campaigns.typical[r]
    copy_matrix(campaigns.tracker[r], work.fixed[0])
    keep_noise(campaigns.noise[r], campaigns.valid[r], rooms.kept)
    searching, rounds = search.error or search.scale, 0
    while True:
        rounds += 1
        factor, decrement = fits.factor[r], search.loose if searching else search.last
        _believe(model.believed, campaigns.frames[r], factor, work.P)
        if not fit_robot(model, campaigns, fits, r, decrement, search.iterations, rooms, work):
            return False
        if not _explain(posterior, work):
            return False
        if not searching:
            copy_matrix(work.H, fits.information[r])
            if not search.linear:
                for i in range(left.shape[0]):
                    left[i] = 0.0
            return True
        variance = fits.variance[r]
        followed, following, deviation = variance, factor, 0.0
        if search.error:
            propagate_kept(rooms.kept, posterior)
            move_kept(rooms.kept, left)
            square, trace, curvature, count = _score_error(rooms.kept)
            own = 3.0 * count
            for i in range(left.shape[0]):
                for j in range(left.shape[0]):
                    own -= posterior[i, j] * work.H[i, j]
            step = (square - trace) / curvature * min(1.0, curvature / (trace * trace / max(own, 1.0)))
            followed = max(max(variance + step, 0.01 * variance), 1e-6 * typical)
            deviation = np.sqrt(2.0 / curvature)
        if search.scale:
            following = _score_scale(model.believed, posterior, fits.z[r], left, factor, search)
        moved = abs(followed - variance) / (variance + typical)
        if (moved < 1e-3 and abs(np.log(following / factor)) < 1e-2) or rounds > search.rounds:
            searching = False
            if search.error and followed < 2.0 * deviation:
                followed = 0.0
        fits.variance[r], fits.factor[r] = followed, following


@compiled
def search_robots(model, campaigns, search, fits, rooms):
    """Fit every robot that was not touched or converged before."""
    robots, p = fits.z.shape
    work = allocate_work(model, campaigns.q.shape[1], p)
    for r in range(robots):
        if fits.state[r] != FAILED:
            fits.state[r] = CONVERGED if _search_robot(model, campaigns, search, fits, r, rooms, work) else FAILED
