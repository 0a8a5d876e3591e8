"""Fits of many robots in one compiled pass, each with its hyperparameters: `hyperparameters` without Python.

What a single fit does step by step is done here for one robot after another, of a tracker's points, a model that moves the joint
side by a four-bar's lengths at most, independent parameters, and squared residuals. Steps, damping and endings are those of the
single fit. Where it ends otherwise than converged, that is said and nothing else.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.kernels.chain import Layout, Steps
from taskcal.kernels.closure import CoordinateBuffers, Coordinates, Drive, LoopNumbers, Wanted, fill_lanes, lengthened
from taskcal.kernels.compiled import compiled, part
from taskcal.kernels.lanes import LANES, allocate_lanes, as_lanes, square_root, total_of
from taskcal.kernels.points import (
    PointBlock,
    Points,
    SeenPoints,
    WalkArrays,
    conjugate_lanes,
    linearise_point,
    take_points,
)
from taskcal.kernels.products import Products, add_products
from taskcal.kernels.walk import Buffers, axes_of, expand_error_frames, take_lanes, walk_pose

# Positive definite matrices of very different scales inside kernels: factored on unit diagonal, solved and
# inverted.
#
# As `estimation.scaled` does it by LAPACK, which a kernel that runs without Python cannot reach. Inner loops go
# along rows, so that the compiler takes several numbers at a time.


@part
def factor_scaled(A, scale, U):
    """Fill U with the upper factor, Uᵀ·U = scale·A·scale, and `scale` with 1/√diagonal of A; whether A is positive definite.

    Of A only what is on and above the diagonal is read, and only that of U is filled.
    """
    p = A.shape[0]
    for i in range(p):
        scale[i] = 1.0 / np.sqrt(max(A[i, i], 1e-300))
    for i in range(p):
        for j in range(i, p):
            U[i, j] = A[i, j] * scale[i] * scale[j]
    for i in range(p):
        pivot = U[i, i]
        if not pivot > 0.0:
            return False
        inverse = 1.0 / np.sqrt(pivot)
        for j in range(i, p):
            U[i, j] *= inverse
        for k in range(i + 1, p):
            v = U[i, k]
            for j in range(k, p):
                U[k, j] -= v * U[i, j]
    return True


@part
def solve_factored(U, scale, b, x):
    """Fill x with the solution of A·x = b, of the factor that `factor_scaled` leaves of A."""
    p = b.shape[0]
    for i in range(p):
        x[i] = b[i] * scale[i]
    for i in range(p):
        x[i] /= U[i, i]
        v = x[i]
        for j in range(i + 1, p):
            x[j] -= U[i, j] * v
    for i in range(p - 1, -1, -1):
        v = x[i]
        for j in range(i + 1, p):
            v -= U[i, j] * x[j]
        x[i] = v / U[i, i]
    for i in range(p):
        x[i] *= scale[i]


@part
def invert_factored(U, scale, work, out):
    """Fill `out` with the inverse of A; `work` takes a matrix on the way."""
    p = U.shape[0]
    # rows of work: those of the inverse of Uᵀ, which is lower triangular
    for i in range(p):
        for j in range(p):
            work[i, j] = 0.0
    for i in range(p):
        work[i, i] += 1.0
        inverse = 1.0 / U[i, i]
        for j in range(i + 1):
            work[i, j] *= inverse
        for k in range(i + 1, p):
            v = U[i, k]
            for j in range(i + 1):
                work[k, j] -= v * work[i, j]
    for i in range(p):
        for j in range(p):
            out[i, j] = 0.0
    for k in range(p):
        for i in range(k + 1):
            v = work[k, i]
            for j in range(i, k + 1):
                out[i, j] += v * work[k, j]
    for i in range(p):
        for j in range(i, p):
            out[i, j] *= scale[i] * scale[j]
            out[j, i] = out[i, j]


# Measured points about an estimate, cached eight poses at a time: what a fit of few rows weighs and propagates again
# and again.


class PointCache(NamedTuple):
    """Blocks of one target at eight poses each, in the order of the poses; the lanes are along each array's last axis.

    What belongs to a target that was not seen, or to poses beyond the last, weighs nothing.
    """

    residual: Float[np.ndarray, "blocks 3 lanes"]
    """Measured less predicted, metres."""
    by_entry: Float[np.ndarray, "blocks 3 p lanes"]
    """Derivative of what is predicted by the entries of an estimate."""
    noise: Float[np.ndarray, "blocks 3 3 lanes"]
    """Covariance of the measurements, m²."""
    seen: Float[np.ndarray, "blocks lanes"]
    """One where something was measured, else zero."""
    whitener: Float[np.ndarray, "blocks 3 3 lanes"]
    """Lower triangular W with W·(noise + model error)·Wᵀ = 1."""
    explained: Float[np.ndarray, "blocks 3 3 lanes"]
    """Covariance of what is predicted, its lower triangle, m²."""


def allocate_cache(poses: int, targets: int, p: int) -> PointCache:
    """Buffers for so many poses, targets and entries of an estimate."""
    blocks = -(-poses // LANES) * targets
    return PointCache(
        *allocate_lanes((blocks, 3), (blocks, 3, p), (blocks, 3, 3), (blocks,), (blocks, 3, 3), (blocks, 3, 3))
    )


@part
def cache_noise(noise, valid, cache):
    """Copy the covariances of what was measured; where nothing was, one that does not matter."""
    n, targets = valid.shape
    for b in range(cache.seen.shape[0]):
        first, t = b // targets * LANES, b % targets
        for lane in range(LANES):
            i = first + lane
            there = i < n and valid[min(i, n - 1), t]
            cache.seen[b, lane] = 1.0 if there else 0.0
            for c in range(3):
                for d in range(3):
                    other = 1.0 if c == d else 0.0
                    cache.noise[b, c, d, lane] = noise[min(i, n - 1), t, c, d] if there else other


@part
def cache_points(walk, seen, buffers, cache):
    """Walk every pose, and keep the residuals and derivatives."""
    error_frames, n, targets = expand_error_frames(walk.e), walk.s.shape[0], seen.valid.shape[1]
    axes = axes_of(buffers)
    s, factor, y, T = as_lanes(buffers.s), as_lanes(buffers.factor), as_lanes(buffers.y), as_lanes(buffers.T)
    r, J = as_lanes(cache.residual), as_lanes(cache.by_entry)
    for first in range(0, n, LANES):
        take_lanes(walk.s, first, buffers.s)
        take_lanes(walk.factor, first, buffers.factor)
        walk_pose(walk.steps, s, error_frames, axes, T)
        for t in range(targets):
            b = first // LANES * targets + t
            take_points(seen.position, seen.valid, first, t, buffers.y)
            linearise_point(walk.points, walk.layout, factor, y, t, PointBlock(axes, T, r[b], J[b]))


@part
def whiten_cached(cache, variance):
    """Fill the whiteners under a model error of that variance, m²."""
    R, W, seen = as_lanes(cache.noise), as_lanes(cache.whitener), as_lanes(cache.seen)
    for b in range(R.shape[0]):
        C, out = R[b], W[b]
        w00 = 1.0 / square_root(C[0, 0] + variance)
        e10 = w00 * C[1, 0]
        w11 = 1.0 / square_root(C[1, 1] + variance - e10 * e10)
        e20 = w00 * C[2, 0]
        w10 = -w11 * e10 * w00
        e21 = w10 * C[2, 0] + w11 * C[2, 1]
        w22 = 1.0 / square_root(C[2, 2] + variance - e20 * e20 - e21 * e21)
        out[0, 0], out[1, 0], out[1, 1] = seen[b] * w00, seen[b] * w10, seen[b] * w11
        out[2, 0], out[2, 1] = -seen[b] * w22 * (e20 * w00 + e21 * w10), -seen[b] * w22 * e21 * w11
        out[2, 2] = seen[b] * w22


@part
def add_cached(cache, products):
    """Add up the products of whitened columns and residuals, which come last."""
    r, J, W, rows = (
        as_lanes(cache.residual),
        as_lanes(cache.by_entry),
        as_lanes(cache.whitener),
        as_lanes(products.block),
    )
    p, blocks = products.columns, r.shape[0]
    for j in range(products.sums.shape[0]):
        for k in range(products.sums.shape[1]):
            products.sums[j, k] = 0.0
    for b in range(blocks):
        w00, w10, w11 = W[b, 0, 0], W[b, 1, 0], W[b, 1, 1]
        w20, w21, w22 = W[b, 2, 0], W[b, 2, 1], W[b, 2, 2]
        used = 3 * (b % (rows.shape[1] // 3))
        u, v, w = r[b, 0], r[b, 1], r[b, 2]
        rows[p, used], rows[p, used + 1], rows[p, used + 2] = w00 * u, w10 * u + w11 * v, w20 * u + w21 * v + w22 * w
        for k in range(p):
            u, v, w = J[b, 0, k], J[b, 1, k], J[b, 2, k]
            rows[k, used], rows[k, used + 1] = w00 * u, w10 * u + w11 * v
            rows[k, used + 2] = w20 * u + w21 * v + w22 * w
        if used + 3 == rows.shape[1] or b + 1 == blocks:
            add_products(rows, used + 3, products.sums)


@part
def propagate_cached(cache, covariance):
    """Fill the covariance of what is predicted, of that of an estimate."""
    J, out = as_lanes(cache.by_entry), as_lanes(cache.explained)
    for b in range(J.shape[0]):
        conjugate_lanes(J[b], covariance, out[b])


@part
def move_cached(cache, step):
    """Take what a step of the estimate explains, to first order, off the residuals."""
    r, J = as_lanes(cache.residual), as_lanes(cache.by_entry)
    for b in range(r.shape[0]):
        for a in range(3):
            v = r[b, a]
            for k in range(step.shape[0]):
                v -= step[k] * J[b, a, k]
            r[b, a] = v


# The fit.


class Model(NamedTuple):
    """What all robots have in common."""

    steps: Steps
    """The chain from the tracker; its first fixed part is the tracker's frame, another one for each robot."""
    drive: Drive
    loop: LoopNumbers
    lengths: Int[np.ndarray, " lengths"]
    """Entries of an estimate that lengthen the loop's crank, rod and rocker; none where they do not."""
    wanted: Wanted
    layout: Layout
    point_columns: Int[np.ndarray, "targets 3"]
    prior: Float[np.ndarray, " k"]
    """Prior variance of every parameter, m² and rad²."""
    sizes: Float[np.ndarray, " z"]
    """Natural size of every entry of an estimate."""


class Campaigns(NamedTuple):
    """What was measured of each robot."""

    q: Float[np.ndarray, "robots n joints"]
    position: Float[np.ndarray, "robots n targets 3"]
    valid: Bool[np.ndarray, "robots n targets"]
    noise: Float[np.ndarray, "robots n targets 3 3"]
    tracker: Float[np.ndarray, "robots 3 4"]
    """Pose of the registered base in the tracker frame."""
    start: Float[np.ndarray, "robots z"]
    """The registered nominal robot."""
    frames: Float[np.ndarray, "robots f f"]
    """Prior precision of tracker frame and targets."""
    typical: Float[np.ndarray, " robots"]
    """Variance of the tracker's noise."""


class Fits(NamedTuple):
    """Where each fit stands: what it starts from, and what becomes of it."""

    z: Float[np.ndarray, "robots z"]
    left: Float[np.ndarray, "robots z"]
    """Step to where the linearised fit ends."""
    variance: Float[np.ndarray, " robots"]
    """Model error, m²; negative for a tenth of what the start leaves."""
    factor: Float[np.ndarray, " robots"]
    """Of the prior's variances."""
    information: Float[np.ndarray, "robots z z"]
    posterior: Float[np.ndarray, "robots z z"]
    state: Int[np.ndarray, " robots"]


class FitBuffers(NamedTuple):
    """What a pass fills on the way."""

    coordinates: CoordinateBuffers
    point: Buffers
    cache: PointCache
    products: Products


class Work(NamedTuple):
    """Matrices and vectors of a fit."""

    s: Float[np.ndarray, "n coordinates"]
    factor: Float[np.ndarray, "n pairs"]
    loop: Float[np.ndarray, "n 0"]
    e: Float[np.ndarray, "frames 6"]
    fixed: Float[np.ndarray, "parts 3 4"]
    targets: Float[np.ndarray, "targets 3"]
    P: Float[np.ndarray, "z z"]
    H: Float[np.ndarray, "z z"]
    g: Float[np.ndarray, " z"]
    trial_H: Float[np.ndarray, "z z"]
    trial_g: Float[np.ndarray, " z"]
    A: Float[np.ndarray, "z z"]
    U: Float[np.ndarray, "z z"]
    unit: Float[np.ndarray, " z"]
    b: Float[np.ndarray, " z"]
    step: Float[np.ndarray, " z"]
    trial: Float[np.ndarray, " z"]


@part
def allocate_work(model, n, p):
    """For robots of so many poses and entries of an estimate."""
    joints = model.drive.offset.shape[0]
    return Work(
        np.zeros((n, joints)),
        np.zeros((n, model.wanted.which.shape[0])),
        np.zeros((n, 0)),
        np.zeros((model.layout.frames.shape[0], 6)),
        model.steps.fixed.copy(),
        np.zeros((model.point_columns.shape[0], 3)),
        np.zeros((p, p)),
        np.zeros((p, p)),
        np.zeros(p),
        np.zeros((p, p)),
        np.zeros(p),
        np.zeros((p, p)),
        np.zeros((p, p)),
        np.zeros(p),
        np.zeros(p),
        np.zeros(p),
        np.zeros(p),
    )


@part
def _copy(source, out):
    for i in range(out.shape[0]):
        out[i] = source[i]


@part
def copy_matrix(source, out):
    """Number by number: of slices that are assigned, the check of their shapes takes longer to compile than all of this."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = source[i, j]


@part
def _linearise(model, q, seen, z, buffers, work):
    """Keep the rows about an estimate; whether every loop closes there."""
    frames, k = model.layout.frames, model.prior.shape[0]
    for f in range(frames.shape[0]):
        for c in range(6):
            work.e[f, c] = z[frames[f, c]] if frames[f, c] >= 0 else 0.0
    loop, lengths = model.loop, model.lengths
    if lengths.shape[0] > 0:
        loop = lengthened(loop, z[lengths[0]], z[lengths[1]], z[lengths[2]])
    out = Coordinates(work.s, work.factor, work.loop)
    if not fill_lanes(q, model.drive, loop, model.wanted, buffers.coordinates, out):
        return False
    for t in range(work.targets.shape[0]):
        for d in range(3):
            work.targets[t, d] = z[k + 6 + 3 * t + d]
    points = Points(work.targets, model.point_columns)
    steps = Steps(model.steps.kind, model.steps.which, work.fixed)
    cache_points(
        WalkArrays(steps, work.s, work.e, model.layout, work.factor, points),
        seen,
        buffers.point,
        buffers.cache,
    )
    return True


@part
def _gather(buffers, H, g):
    """Fill information and gradient of the cached rows; their cost."""
    add_cached(buffers.cache, buffers.products)
    sums, p = buffers.products.sums, g.shape[0]
    for j in range(p):
        g[j] = sums[j, p]
        for k in range(j, p):
            H[j, k] = sums[j, k]
            H[k, j] = sums[j, k]
    return 0.5 * sums[p, p]


@part
def _pull(P, z, start, k, out):
    """Fill `out` with what the prior pulls an estimate by, and give half its squared distance from the prior's mean."""
    half = 0.0
    for i in range(z.shape[0]):
        v = 0.0
        for j in range(z.shape[0]):
            v += P[i, j] * (z[j] - (start[j] if j >= k else 0.0))
        out[i] = v
        half += 0.5 * v * (z[i] - (start[i] if i >= k else 0.0))
    return half


@part
def _solve_damped(model, damping, most, work):
    """Fill the step, damped as far as it has to be; the damping, its largest scale, and after how many trials, of `most`."""
    H, P, A, p, largest = work.H, work.P, work.A, work.b.shape[0], 0.0
    for i in range(p):
        largest = max(largest, (H[i, i] + P[i, i]) * model.sizes[i] ** 2)
    for tried in range(most):
        for i in range(p):
            for j in range(i, p):
                A[i, j] = H[i, j] + P[i, j]
            A[i, i] += damping / model.sizes[i] ** 2
        if factor_scaled(A, work.unit, work.U):
            solve_factored(work.U, work.unit, work.b, work.step)
            return damping, largest, tried + 1
        damping = max(10.0 * damping, 1e-9 * largest)
    return damping, largest, most + 1


@part
def _gains(work):
    """Twice the step's Newton decrement, and by how much the linearised objective falls with it."""
    gain, curved, p = 0.0, 0.0, work.b.shape[0]
    for i in range(p):
        gain += work.b[i] * work.step[i]
        v = 0.0
        for j in range(p):
            v += (work.H[i, j] + work.P[i, j]) * work.step[j]
        curved += work.step[i] * v
    return gain, gain - 0.5 * curved


@part
def fit_robot(model, campaigns, fits, r, decrement, iterations, buffers, work):
    """Fit one robot from where it stands, whose rows there are cached at last; whether the fit converged."""
    q, start, z, left, trial = campaigns.q[r], campaigns.start[r], fits.z[r], fits.left[r], work.trial
    seen, k = SeenPoints(campaigns.position[r], campaigns.valid[r]), model.prior.shape[0]
    damping, largest, objective, predicted, done, first, ended = 0.0, 0.0, 0.0, 0.0, 0, True, False
    _copy(z, trial)
    for i in range(left.shape[0]):
        left[i] = 0.0
    while True:
        closes = _linearise(model, q, seen, trial, buffers, work)
        if ended or (first and not closes):
            return closes
        if first:
            if fits.variance[r] < 0.0:
                fits.variance[r] = 0.01 * _mean_square(buffers.cache)
            whiten_cached(buffers.cache, fits.variance[r])
        better, reached = False, 0.0
        if closes:
            reached = _gather(buffers, work.trial_H, work.trial_g)
            reached += _pull(work.P, trial, start, k, work.b)
            better = first or objective - reached > 0.0
        if better:
            objective, damping, first = reached, damping / 10.0, False
            _copy(trial, z)
            _copy(work.trial_g, work.g)
            copy_matrix(work.trial_H, work.H)
        elif predicted < 1e-11 * (
            1.0 + abs(objective)
        ):  # the objective cannot tell rounding from progress, the gradient can
            if closes:
                _copy(trial, z)
                copy_matrix(work.trial_H, work.H)
                return True
            ended = True
            _copy(z, trial)
            continue
        else:
            damping = max(10.0 * damping, 1e-9 * largest)
            if damping > 1e12 * largest:
                return False
        _pull(work.P, z, start, k, work.b)
        for i in range(left.shape[0]):
            work.b[i] = work.g[i] - work.b[i]
        damping, largest, tried = _solve_damped(model, damping, iterations - done, work)
        done += tried
        if done > iterations:
            return False
        gain, predicted = _gains(work)
        if 0.5 * gain < decrement:
            _copy(work.step, left)
            if better:
                return True
            ended = True
            _copy(z, trial)
        else:
            for i in range(left.shape[0]):
                trial[i] = z[i] + work.step[i]


@part
def _mean_square(cache):
    total, count = 0.0, 0.0
    for b in range(cache.seen.shape[0]):
        for lane in range(cache.seen.shape[1]):
            if cache.seen[b, lane] > 0.0:
                count += 3.0
                for a in range(3):
                    total += cache.residual[b, a, lane] ** 2
    return total / count


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
def _score_error(cache):
    """Sums of `evidence.score_model_error` over the blocks: |R⁻¹r|², tr Q and tr Q²; and how many were seen."""
    W, C, r = as_lanes(cache.whitener), as_lanes(cache.explained), as_lanes(cache.residual)
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
        for lane in range(cache.seen.shape[1]):
            count += cache.seen[b, lane]
    return square, trace, curvature, count


@part
def _score_scale(prior, posterior, z, left, v, search):
    """`evidence.score_prior_scale` of independent parameters."""
    k, s, t, curvature = prior.shape[0], 0.0, 0.0, 0.0
    for i in range(k):
        deviation = z[i] + left[i]
        s += deviation * deviation / (prior[i] * v * v)
        t += 1.0 / v - posterior[i, i] / (prior[i] * v * v)
        for j in range(k):
            same = 1.0 / v if i == j else 0.0
            m, n = same - posterior[i, j] / (prior[i] * v * v), same - posterior[j, i] / (prior[j] * v * v)
            curvature += m * n
    if curvature <= 0.0:
        return v
    low, high = max(0.1 * v, search.smallest), min(10.0 * v, search.largest)
    return min(max(v + (s - t) / curvature, low), high)


@part
def _fill_precision(prior, frames, factor, P):
    """Fill P with the prior's precision."""
    k = prior.shape[0]
    for i in range(P.shape[0]):
        for j in range(P.shape[0]):
            P[i, j] = frames[i - k, j - k] if i >= k and j >= k else 0.0
    for i in range(k):
        P[i, i] = 1.0 / (prior[i] * factor)


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
def _search_robot(model, campaigns, search, fits, r, buffers, work):
    """Fit one robot, and its hyperparameters in turn; whether it converged."""
    left, posterior, typical = fits.left[r], fits.posterior[r], campaigns.typical[r]
    copy_matrix(campaigns.tracker[r], work.fixed[0])
    cache_noise(campaigns.noise[r], campaigns.valid[r], buffers.cache)
    searching, rounds = search.error or search.scale, 0
    while True:
        rounds += 1
        factor, decrement = fits.factor[r], search.loose if searching else search.last
        _fill_precision(model.prior, campaigns.frames[r], factor, work.P)
        if not fit_robot(model, campaigns, fits, r, decrement, search.iterations, buffers, work):
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
            propagate_cached(buffers.cache, posterior)
            move_cached(buffers.cache, left)
            square, trace, curvature, count = _score_error(buffers.cache)
            own = 3.0 * count
            for i in range(left.shape[0]):
                for j in range(left.shape[0]):
                    own -= posterior[i, j] * work.H[i, j]
            step = (square - trace) / curvature * min(1.0, curvature / (trace * trace / max(own, 1.0)))
            followed = max(max(variance + step, 0.01 * variance), 1e-6 * typical)
            deviation = np.sqrt(2.0 / curvature)
        if search.scale:
            following = _score_scale(model.prior, posterior, fits.z[r], left, factor, search)
        moved = abs(followed - variance) / (variance + typical)
        if (moved < 1e-3 and abs(np.log(following / factor)) < 1e-2) or rounds > search.rounds:
            searching = False
            if search.error and followed < 2.0 * deviation:
                followed = 0.0
        fits.variance[r], fits.factor[r] = followed, following


@compiled
def search_robots(model, campaigns, search, fits, buffers):
    """Fit every robot that was not touched or converged before."""
    robots, p = fits.z.shape
    work = allocate_work(model, campaigns.q.shape[1], p)
    for r in range(robots):
        if fits.state[r] != FAILED:
            fits.state[r] = CONVERGED if _search_robot(model, campaigns, search, fits, r, buffers, work) else FAILED
