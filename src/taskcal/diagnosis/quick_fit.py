"""Tracker frame and targets for many suppositions at once, and how far off the measurements are then.

The closed form of `registration_start.closed_form`, by normal equations over a batch: M·y + m = p + R·o is linear in the
unconstrained matrix M, the vector m and the offsets o. Concentration steps (Rousseeuw and Van Driessen 2006) keep the best
three quarters.
"""

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3

TRUSTED_SHARE = 0.75
"""Of the points, that the fit follows; the others may be wrong."""

CHUNK = 400
"""Suppositions fitted together: what they need stays in the cache and below 100 MB."""

ROUNDS = 3
"""Fits, the first to all points, the others to the best of them."""

RIDGE = 1e-10
"""Of the normal equations' mean diagonal: columns that hardly matter stay at zero."""

LEVER_SHARE = 0.25
"""Of the reach, at which a measured rotation's error counts as a distance."""


SMALLEST_ERROR = 2e-4
"""Metres; nearer than that nothing is told apart."""


def misfits(
    T: Float[np.ndarray, "h n 4 4"],
    points: Float[np.ndarray, "h n targets 3"],
    rotations: Float[np.ndarray, "h n 3 3"] | None,
    lever: float,
    rounds: int = ROUNDS,
) -> Float[np.ndarray, " h"]:
    """Typical distance of the measured points from the registered poses, metres; infinite where poses are not finite.

    It is a geometric mean: a few rows may be off as far as they like, and a mistake that only some rows show still counts.

    Args:
        T: tool poses of every supposition.
        points: measured points, NaN where the beam was lost.
        rotations: measured orientations, if there are.
        lever: metres at which the error of a rotation counts.
        rounds: fits to what the one before leaves nearest; the first one is to all points.
    """
    parts = [slice(i, i + CHUNK) for i in range(0, len(T), CHUNK)]
    return np.concatenate(
        [
            _misfit(T[part], points[part], None if rotations is None else rotations[part], lever, rounds)
            for part in parts
        ]
    )


def _misfit(
    T: np.ndarray, points: np.ndarray, rotations: np.ndarray | None, lever: float, rounds: int
) -> Float[np.ndarray, " h"]:
    closes = np.isfinite(T[..., 0, 3])
    usable = closes.mean(axis=1) >= TRUSTED_SHARE
    T = np.where(closes[..., None, None], T, np.eye(4))
    seen = ~np.isnan(points[..., 0]) & closes[..., None]
    y = np.where(seen[..., None], points, 0.0)
    weight = seen.astype(float)
    distance = np.zeros(seen.shape)
    for _ in range(rounds):
        Z = _rotation(T, y, weight)
        distance = _distances(Z, T, y, weight, rotations, lever)
        distance = np.where(seen, distance, np.inf)
        count = np.maximum(np.ceil(TRUSTED_SHARE * seen.sum(axis=(1, 2))).astype(int) - 1, 0)
        flat = np.sort(distance.reshape(len(T), -1), axis=1)
        bound = flat[np.arange(len(T)), count]
        weight = (distance <= bound[:, None, None]).astype(float)
    return np.where(usable, _typical(distance, seen), np.inf)


def _typical(distance: np.ndarray, seen: np.ndarray) -> Float[np.ndarray, " h"]:
    """Geometric mean of what was seen, metres."""
    log = np.log(np.maximum(np.where(seen, distance, 1.0), SMALLEST_ERROR)) * seen
    return np.exp(log.sum(axis=(1, 2)) / np.maximum(seen.sum(axis=(1, 2)), 1))


def _rotation(T: np.ndarray, y: np.ndarray, weight: np.ndarray) -> Float[np.ndarray, "h 3 3"]:
    """From base to tracker: nearest to the inverse of the unconstrained matrix."""
    h, n, count = weight.shape
    centre = (weight[..., None] * y).sum(axis=(1, 2)) / np.maximum(weight.sum(axis=(1, 2)), 1.0)[:, None]
    centred = np.where(weight[..., None] > 0, y - centre[:, None, None], 0.0)
    unknowns = 12 + 3 * count
    A = np.zeros((h, n, count, 3, unknowns))
    for i in range(3):
        A[..., i, 3 * i : 3 * i + 3] = centred
        A[..., i, 9 + i] = 1.0
    for t in range(count):
        A[:, :, t, :, 12 + 3 * t : 15 + 3 * t] = -T[..., :3, :3]
    A *= weight[..., None, None]
    b = np.broadcast_to(T[:, :, None, :3, 3], (h, n, count, 3)) * weight[..., None]
    A, b = A.reshape(h, -1, unknowns), b.reshape(h, -1, 1)
    M = _solve(A, b)[:, :9, 0].reshape(h, 3, 3)
    return np.swapaxes(se3.nearest_rotation(M), 1, 2)


def _distances(
    Z: np.ndarray, T: np.ndarray, y: np.ndarray, weight: np.ndarray, rotations: np.ndarray | None, lever: float
) -> Float[np.ndarray, "h n targets"]:
    """Of every point, from where translation and offsets that fit the weighted ones best have it, metres."""
    h, n, count = weight.shape
    A = np.zeros((h, n, count, 3, 3 + 3 * count))
    A[..., :3] = np.eye(3)
    turned = Z[:, None] @ T[..., :3, :3]
    for t in range(count):
        A[:, :, t, :, 3 + 3 * t : 6 + 3 * t] = turned
    b = y - (Z[:, None] @ T[..., :3, 3:])[..., 0][:, :, None]
    w = weight[..., None, None]
    solution = _solve((w * A).reshape(h, -1, 3 + 3 * count), (w[..., 0] * b).reshape(h, -1, 1))
    residual = b - (A.reshape(h, -1, 3 + 3 * count) @ solution).reshape(b.shape)
    square = (residual**2).sum(axis=-1)
    if rotations is not None:
        relative = np.swapaxes(turned, -1, -2) @ rotations
        X = se3.nearest_rotation((w[:, :, 0] * relative).sum(axis=1))
        chord = ((turned @ X[:, None] - rotations) ** 2).sum(axis=(-1, -2))
        square = square + lever**2 * 0.5 * chord[..., None]
    return np.sqrt(square)


def _solve(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    At = np.swapaxes(A, 1, 2)
    H = At @ A
    k = np.arange(H.shape[1])
    H[:, k, k] += RIDGE * np.maximum(H[:, k, k].mean(axis=1), 1e-12)[:, None] + 1e-300
    return np.linalg.solve(H, At @ b)
