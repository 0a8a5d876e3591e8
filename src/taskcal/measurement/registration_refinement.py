"""The rotation from base to tracker that fits measured points best, from a starting one: damped Gauss–Newton."""

import numpy as np
from jaxtyping import Float

from taskcal.measurement.registration_moments import Moments

MAX_STEPS = 40
"""Of the refinement."""

LEAST_DAMPING = 1e-6
"""Holds what the points do not tell, and slows down what they do by a millionth."""


def refine(Z: Float[np.ndarray, "3 3"], moments: Moments) -> tuple[Float[np.ndarray, "3 3"], float]:
    """Damped Gauss–Newton on the rotation, translation and offsets being the best for it; the best point met.

    Args:
        Z: rotation from base to tracker to start from.
        moments: of the points.

    Returns:
        rotation; root mean square of the residual in space, metres.
    """
    squares, M = moments.quadratic, Z.T
    damping = LEAST_DAMPING
    for _ in range(MAX_STEPS):
        K = _by_turn(M)
        H, g = K.T @ squares.Q @ K, K.T @ (squares.q - squares.Q @ M.reshape(-1))
        step = np.linalg.solve(H * (1.0 + damping * np.eye(3)), g)
        turned = _turn(step) @ M
        fall = squares.fall(M.reshape(-1), turned.reshape(-1))
        if fall < 0.0:
            damping = max(damping * 10.0, 1e-3)
            if damping > 1e3:
                break
            continue
        M, damping = turned, max(damping / 10.0, LEAST_DAMPING)
        if step @ step < 1e-18 or fall < 1e-12 * squares(M.reshape(-1)):
            break
    return M.T, float(np.sqrt(moments.squares(M.T) / moments.n))


def _turn(w: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    """A rotation about w by its length to second order (Cayley's), in a few operations: the step is none that has to be exact."""
    x, y, z = 0.5 * w
    A = np.array([[1.0, -z, y], [z, 1.0, -x], [-y, x, 1.0]])
    return np.linalg.solve(A.T, A)


def _by_turn(M: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "9 3"]:
    """Derivative of exp(w)·M by w about zero."""
    K = np.zeros((3, 3, 3))
    K[1, :, 0], K[2, :, 0] = -M[2], M[1]
    K[2, :, 1], K[0, :, 1] = -M[0], M[2]
    K[0, :, 2], K[1, :, 2] = -M[1], M[0]
    return K.reshape(9, 3)


def rms_length(residual: Float[np.ndarray, "n 3"]) -> float:
    """Root mean square length of vectors (n, 3)."""
    return float(np.sqrt(np.einsum("ni,ni->", residual, residual) / len(residual)))
