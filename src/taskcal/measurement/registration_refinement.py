"""The tracker frame and the targets that fit measured points best, from a starting rotation: damped Gauss–Newton."""

import numpy as np

from taskcal.geometry import se3

OFFSET_PULL = 1e-9
"""Weight of a target's offset from the tool point against one measured point."""

MAX_STEPS = 40
"""Of the refinement."""


def refine(
    Z: np.ndarray, R: np.ndarray, p: np.ndarray, y: np.ndarray, target: np.ndarray, count: int
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray], float]:
    """Damped Gauss–Newton on rotation, translation and offsets together; the best point met.

    Args:
        Z: rotation from base to tracker to start from.
        R: rotation of the tool at every point (n, 3, 3).
        p: position of the tool there (n, 3), metres.
        y: measured points (n, 3), metres.
        target: number of each point's target (n,).
        count: of targets.

    Returns:
        rotation; translation and offsets (targets, 3), metres; root mean square of the residual in space, metres.
    """
    n = len(y)
    t, offsets, residual = place(Z, R, p, y, target, count)
    damping = 1e-6
    for _ in range(MAX_STEPS):
        arm = (p + (R @ offsets[target][:, :, None])[:, :, 0]) @ Z.T
        A = np.zeros((n, 3, 6 + 3 * count))
        A[:, 0, 1], A[:, 0, 2] = arm[:, 2], -arm[:, 1]
        A[:, 1, 0], A[:, 1, 2] = -arm[:, 2], arm[:, 0]
        A[:, 2, 0], A[:, 2, 1] = arm[:, 1], -arm[:, 0]
        A[:, :, 3:6] = np.eye(3)
        for k in range(count):
            A[target == k, :, 6 + 3 * k : 9 + 3 * k] = Z @ R[target == k]
        A = A.reshape(3 * n, -1)
        H, g = A.T @ A, A.T @ residual.reshape(-1)
        step = np.linalg.lstsq(H + damping * np.diag(np.diag(H)), g, rcond=1e-12)[0]
        turned = se3.exp(step[:3]) @ Z
        trial = place(turned, R, p, y, target, count)
        if (trial[2] ** 2).sum() > (residual**2).sum():
            damping = max(damping * 10.0, 1e-3)
            if damping > 1e3:
                break
            continue
        gain = 1.0 - (trial[2] ** 2).sum() / max((residual**2).sum(), 1e-300)
        Z, (t, offsets, residual), damping = turned, trial, damping / 10.0
        if np.linalg.norm(step[:3]) < 1e-9 or gain < 1e-12:
            break
    return Z, (t, offsets), rms_length(residual)


def place(
    Z: np.ndarray,
    R: np.ndarray,
    p: np.ndarray,
    y: np.ndarray,
    target: np.ndarray,
    count: int,
    held: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Translation and target offsets for a rotation Z, and the residuals: y = Z·(p + R·o) + t is linear in both.

    Along the directions of the projector `held` the offsets stay zero.
    """
    A = placing_jacobian(Z, R, target, count)
    b = y - p @ Z.T
    flat = A.reshape(3 * len(y), -1)
    H = flat.T @ flat
    # in one orientation only the sum of translation and offset is seen: a slight pull leaves the target at the tool point
    H[range(3, len(H)), range(3, len(H))] += OFFSET_PULL
    if held is not None:
        H[3:, 3:] += 1e12 * held
    solution = np.linalg.solve(H, flat.T @ b.reshape(-1))
    residual = b - (A @ solution)
    return solution[:3], solution[3:].reshape(count, 3), residual


def placing_jacobian(Z: np.ndarray, R: np.ndarray, target: np.ndarray, count: int) -> np.ndarray:
    """Derivative of the points with respect to translation and offsets."""
    A = np.zeros((len(R), 3, 3 + 3 * count))
    A[:, :, :3] = np.eye(3)
    for t in range(count):
        A[target == t, :, 3 + 3 * t : 6 + 3 * t] = Z @ R[target == t]
    return A


def rms_length(residual: np.ndarray) -> float:
    """Root mean square length of vectors (n, 3)."""
    return float(np.sqrt((residual**2).sum(axis=1).mean()))
