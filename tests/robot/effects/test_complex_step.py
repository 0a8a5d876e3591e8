"""Derivatives of what users write in NumPy."""

import numpy as np
import pytest
from hypothesis import given

from taskcal.errors import TaskcalError
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Coupling, EncoderGain, Harmonics
from taskcal.robot.effects.base import differentiate
from tests.laws.robots import NAMED, Case, cases

Q = np.random.default_rng(0).uniform(-1.5, 1.5, (5, 3))


def test_it_is_exact_to_rounding():
    found = differentiate(lambda q: np.stack([np.sin(7.0 * q[:, 0]) * q[:, 2], np.exp(q[:, 1])], axis=1), Q)
    expected = np.zeros((5, 2, 3))
    expected[:, 0, 0] = 7.0 * np.cos(7.0 * Q[:, 0]) * Q[:, 2]
    expected[:, 0, 2] = np.sin(7.0 * Q[:, 0])
    expected[:, 1, 1] = np.exp(Q[:, 1])
    np.testing.assert_allclose(found, expected, rtol=1e-14, atol=1e-15)


def test_a_constant_has_none():
    np.testing.assert_array_equal(differentiate(lambda q: np.ones((len(q), 2)), Q), 0.0)


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (np.abs, "drops the imaginary part of complex positions; give its derivative"),
        (lambda q: np.arctan2(q, 1.0), "cannot be evaluated at complex positions"),
    ],
)
def test_what_is_not_analytic_is_refused(function, words):
    with pytest.raises(TaskcalError, match=words):
        differentiate(function, Q)


ANALYTIC = Harmonics(orders=(1, 5)), EncoderGain(), Coupling()


def assert_derivatives_agree(robot, q):
    for effect in ANALYTIC:
        term = effect.term(robot)
        np.testing.assert_allclose(term.by_joint(q), differentiate(term.basis, q), rtol=1e-13, atol=1e-13)


@given(cases(prismatic=False, min_joints=3))
def test_effects_give_the_derivative_that_complex_steps_find(case: Case):
    assert_derivatives_agree(case.robot, case.q)


def test_effects_of_named_robots_give_that_derivative():
    for robot in map(load_robot, NAMED):
        assert_derivatives_agree(robot, np.random.default_rng(0).uniform(-0.8, 0.8, (6, len(robot.joints))))
