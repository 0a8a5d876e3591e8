"""Errors of shape: a frame and a TCP that are taught take up what is rigid, and nothing else."""

import numpy as np
import pytest
import scipy.optimize

from taskcal.geometry import se3
from taskcal.planning.study import aligned_errors
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel

MODEL = ErrorModel(load_robot("ur5"))


def poses(seed: int, count: int = 40):
    return np.random.default_rng(seed).uniform(-2.0, 2.0, (count, 6))


def test_aligned_error_ignores_moved_base_and_tcp():
    """A base in another place and another TCP cause no aligned error."""
    T = MODEL.poses(poses(0))
    base = se3.pose(se3.exp(np.array([1e-4, -2e-4, 3e-4])), np.array([0.002, -0.001, 0.003]))
    true = se3.apply(base @ T, np.array([1e-3, 2e-3, -1e-3]))
    assert np.abs(aligned_errors(T, true, np.full(40, 1 / 40))).max() < 5e-6


@pytest.mark.parametrize("seed", range(3))
def test_aligned_error_is_minimum_over_frame_and_tcp(seed):
    """The aligned error is the minimum over all work frames and TCPs."""
    q, rng = poses(seed), np.random.default_rng(seed)
    weights = rng.uniform(0.5, 2.0, 40)
    T, true = MODEL.poses(q), MODEL.poses(q, 1e-3 * rng.normal(size=len(MODEL)))[:, :3, 3]

    def off(y: np.ndarray) -> np.ndarray:
        moved = se3.apply(se3.pose(se3.exp(y[3:6]), y[:3]) @ T, y[6:])
        return (np.sqrt(weights)[:, None] * (true - moved)).ravel()

    least = scipy.optimize.least_squares(off, np.zeros(9), x_scale=1e-3, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    left = aligned_errors(T, true, weights)
    assert np.sqrt(weights @ (left**2).sum(axis=1)) == pytest.approx(np.sqrt(2.0 * least.cost), rel=1e-2)


def test_a_robot_that_is_larger_stays_so():
    T = MODEL.poses(poses(0))
    left = aligned_errors(T, 1.001 * T[:, :3, 3], np.full(40, 1 / 40))
    assert np.linalg.norm(left, axis=1).mean() > 1e-4
