"""Starting rotations of a registration in closed form, and many orientations for where they fail."""

import itertools

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.measurement.registration_moments import Moments

NEARLY_NOTHING = 1e-12
"""Of the largest: an eigenvalue of the sum of squares below this says nothing (flat clouds), and its direction stays at zero."""


def closed_form(moments: Moments) -> Float[np.ndarray, "3 3"]:
    """Rotation from base to tracker that fits y = Z·(p + R·o) + t, by a matrix M = Zᵀ of which nothing is asked.

    Args:
        moments: of the points.
    """
    squares = moments.quadratic
    M = np.linalg.pinv(squares.Q, rcond=NEARLY_NOTHING, hermitian=True) @ squares.q
    return se3.nearest_rotation(M.reshape(3, 3)).T


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
    signed = itertools.product(itertools.permutations(np.eye(3)), itertools.product((1.0, -1.0), repeat=3))
    proper = [R for axes, signs in signed if np.linalg.det(R := np.array(axes) * np.array(signs)) > 0.0]
    skew = se3.exp(np.array([0.5, 0.4, 0.45]))
    return proper + [skew @ R for R in proper]
