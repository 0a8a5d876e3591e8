"""Rigid motions nearest to how points move."""

import numpy as np
from jaxtyping import Float

from taskcal.errors import TaskcalError
from taskcal.geometry import se3


def fit_points(
    own: Float[np.ndarray, "k 3"], there: Float[np.ndarray, "k 3"]
) -> tuple[Float[np.ndarray, "4 4"], float]:
    """The motion that brings points nearest to others, and the farthest that one is left, metres.

    Raises:
        TaskcalError: the points lie in a line and do not locate a frame.
    """
    extent = np.linalg.svd(own - own.mean(axis=0), compute_uv=False)
    if extent[1] < 1e-3 * extent[0] or extent[0] < 1e-3:
        raise TaskcalError("the points lie in a line or at one place; three that span a triangle locate a frame")
    T = se3.fit_points(own, there)
    return T, float(np.linalg.norm(se3.apply(T, own) - there, axis=1).max())


def rigid_twists(
    points: Float[np.ndarray, "n k 3"], J: Float[np.ndarray, "n k 3 z"], at: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n 6 z"]:
    """The twists at given points of the rigid motions that come nearest to how some points move."""
    n, k = points.shape[:2]
    return np.linalg.pinv(se3.by_twist(points - at[:, None]).reshape(n, 3 * k, 6)) @ J.reshape(n, 3 * k, -1)


def without_rigid_motion(
    points: Float[np.ndarray, "n 3"], errors: Float[np.ndarray, "n 3 k"]
) -> Float[np.ndarray, "n 3 k"]:
    """Errors less the small rigid motion of all points that comes nearest to them, in least squares.

    Args:
        points: where the errors are, metres.
        errors: k sets of them.
    """
    about = points - points.mean(axis=0)
    size = max(float(np.abs(about).max(initial=0.0)), 1e-9)
    A = (se3.by_twist(about) / np.r_[1.0, 1.0, 1.0, [size] * 3]).reshape(-1, 6)
    flat = errors.reshape(len(A), -1)
    motion = np.linalg.lstsq(A, flat, rcond=1e-9)[0]  # targets on a line leave the turn about it open
    return (flat - A @ motion).reshape(errors.shape)
