"""Starting rotations of a registration in closed form, and many orientations for where they fail."""

import itertools

import numpy as np
from scipy.spatial.transform import Rotation

from taskcal.geometry import se3


def closed_form(R: np.ndarray, p: np.ndarray, y: np.ndarray, target: np.ndarray, count: int) -> np.ndarray:
    """Rotation from base to tracker that fits y = Z·(p + R·o) + t, by a matrix M = Zᵀ of which nothing is asked.

    Args:
        R: rotation of the tool at every point (n, 3, 3).
        p: position of the tool there (n, 3), metres.
        y: measured points (n, 3), metres.
        target: number of each point's target (n,).
        count: of targets.
    """
    n = len(y)
    A = np.zeros((n, 3, 9 + 3 + 3 * count))
    centred = y - y.mean(axis=0)
    for i in range(3):
        A[:, i, 3 * i : 3 * i + 3] = centred
        A[:, i, 9 + i] = 1.0
    for t in range(count):
        A[target == t, :, 12 + 3 * t : 15 + 3 * t] = -R[target == t]
    # columns that hardly matter (flat clouds, one orientation) are left at zero rather than blown up
    solution = np.linalg.lstsq(A.reshape(3 * n, -1), p.reshape(-1), rcond=1e-6)[0]
    return se3.nearest_rotation(solution[:9].reshape(3, 3)).T


def closed_form_rotations(R: np.ndarray, Y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Z and X of Z·R·X = Y: with vec(Z) and vec(Xᵀ) as unknowns Z·R = Y·Xᵀ is linear and homogeneous."""
    n = len(R)
    A = np.zeros((n, 9, 18))
    for i, j in itertools.product(range(3), repeat=2):
        # (Z R)_ij = Σ_k Z_ik R_kj and (Y Xᵀ)_ij = Σ_k Y_ik Xᵀ_kj
        A[:, 3 * i + j, 3 * i : 3 * i + 3] = R[:, :, j]
        for k in range(3):
            A[:, 3 * i + j, 9 + 3 * k + j] -= Y[:, i, k]
    A = A.reshape(9 * n, 18)
    null = np.linalg.eigh(A.T @ A)[1][:, 0]
    Z, Xt = null[:9].reshape(3, 3), null[9:].reshape(3, 3)
    if np.linalg.det(Z) < 0:
        Z, Xt = -Z, -Xt
    return alternate(se3.nearest_rotation(Z), R, Y, rounds=10)


def alternate(Z: np.ndarray, R: np.ndarray, Y: np.ndarray, rounds: int = 30) -> tuple[np.ndarray, np.ndarray]:
    """Each of Z and X in turn from the other, as the rotation nearest to the mean."""
    X = np.eye(3)
    for _ in range(rounds):
        X = target_rotation(Z, R, Y)
        Z = se3.nearest_rotation((Y @ np.swapaxes(R @ X, 1, 2)).mean(axis=0))
    return Z, X


def target_rotation(Z: np.ndarray, R: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """Rotation X of the target in the tool that fits Z·R·X = Y best, for a rotation Z from base to tracker."""
    return se3.nearest_rotation((np.swapaxes(Z @ R, 1, 2) @ Y).mean(axis=0))


def orientations() -> list[np.ndarray]:
    """The 24 rotations of a cube, and the same turned by 45° about a skew axis."""
    proper = list(Rotation.create_group("O").as_matrix().round())
    skew = se3.exp(np.array([0.5, 0.4, 0.45]))
    return proper + [skew @ R for R in proper]
