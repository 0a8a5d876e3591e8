"""The smooth field of each joint against the Gaussian process that it stands for."""

import numpy as np
import pytest
from sklearn.gaussian_process.kernels import RBF

from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects.gears import JointField
from taskcal.robot.error_model import ErrorModel


def covariance(field, robot, q):
    """Prior covariance of how far joint 2 is turned at some poses, (n, n)."""
    term = field.term(robot)
    own = term.pairs[:, 0] == 1
    scaled = term.prepare(q)[:, own] * np.array(term.tolerances)[term.pairs[own, 1]]
    return scaled @ scaled.T


@pytest.mark.parametrize("length", [0.5, 1.5])
def test_its_covariance_is_scikit_learns_kernel(length):
    robot, q = load_robot("abb-irb120"), np.random.default_rng(0).uniform(-1.0, 1.0, (30, 6))
    field = JointField(joints=("J2",), length=length, features=20_000)
    found = covariance(field, robot, q) / field.tolerance**2
    np.testing.assert_allclose(np.diag(found), 1.0, rtol=1e-12)
    # 20 000 random directions leave 1/√40 000 of what they are to average
    np.testing.assert_allclose(found, RBF(length)(q), atol=5.0 / np.sqrt(40_000))


def test_its_slope_is_its_derivative():
    model = ErrorModel(load_robot("abb-irb120")) + JointField(features=3)
    rng = np.random.default_rng(1)
    q, x, h = rng.uniform(-1.0, 1.0, (4, 6)), 10.0 * rng.normal(size=len(model)) * model.tolerances, 1e-5
    J = model.joint_jacobian(q, x)
    for j in range(6):
        ahead, behind = (model.poses(q + sign * h * np.eye(6)[j], x)[:, :3, 3] for sign in (1.0, -1.0))
        np.testing.assert_allclose(J[:, :3, j], (ahead - behind) / (2.0 * h), atol=1e-8)


def test_no_draw_of_directions_is_better_known_than_another():
    """Of other seeds the directions are others, and the process is the same."""
    robot, q = load_robot("abb-irb120"), np.random.default_rng(2).uniform(-1.0, 1.0, (10, 6))
    draws = [covariance(JointField(joints=("J2",), features=20, seed=seed), robot, q) for seed in range(60)]
    expected = JointField().tolerance ** 2 * RBF(JointField().length)(q)
    np.testing.assert_allclose(np.mean(draws, axis=0), expected, atol=5.0 / np.sqrt(60 * 40) * expected.max())
