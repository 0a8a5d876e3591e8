"""The Newton step on random chains, against SciPy's rotations, the plain product's derivative, and NumPy's solution."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from taskcal.kernels.chain import Chain, Fixed
from taskcal.kinematics.inverse import MAX_JOINT_STEP, RADIANS_PER_METRE, Conditioned, Goal
from taskcal.robot.error_model import Walk
from tests.laws import plain
from tests.laws.chains import chains, rigid
from tests.laws.robots import generators

STILL = Chain.of([Fixed(np.eye(4))])


def conditioned(goal: Goal, chain: Chain, s: np.ndarray, e: np.ndarray, by_joint: np.ndarray) -> Conditioned:
    return Conditioned.of(chain, Walk(s=s, e=e, factor=np.empty((len(s), 0)), slopes=()), by_joint, goal)


def standing(turn: np.ndarray, *, free_spin: bool = False) -> Goal:
    """Goals that a chain which does not move misses by rotations."""
    T = np.tile(np.eye(4), (len(turn), 1, 1))
    T[:, :3, :3] = Rotation.from_rotvec(turn).as_matrix()
    return Goal(T=T, tip=np.eye(4), free_spin=free_spin)


def angles_off(goal: Goal) -> np.ndarray:
    n = len(goal.T)
    return conditioned(goal, STILL, np.zeros((n, 0)), np.zeros((0, 6)), np.zeros((1, 0, 1))).off


@given(generators)
def test_remaining_angle_is_rotation_angle_up_to_180_deg(rng):
    """The remaining angle is that of the rotation, up to half a turn."""
    axis = rng.normal(size=(40, 3))
    angle = np.concatenate([rng.uniform(0.0, np.pi, 34), [0.0, 1e-12, 1e-7, np.pi - 1e-7, np.pi - 1e-12, np.pi]])
    off = angles_off(standing(axis / np.linalg.norm(axis, axis=1, keepdims=True) * angle[:, None]))
    np.testing.assert_allclose(off[:, 1], angle, rtol=1e-12, atol=1e-14)
    np.testing.assert_array_equal(off[:, 0], 0.0)


@given(generators)
def test_with_free_spin_only_the_tilt_of_the_axis_is_left(rng):
    tilt = rng.uniform(0.0, np.pi, 30)
    tilt[:3] = 0.0, 1e-9, np.pi
    before, after = rng.uniform(-np.pi, np.pi, (2, 30))
    turned = Rotation.from_euler("ZXZ", np.stack([before, tilt, after], axis=1))
    np.testing.assert_allclose(angles_off(standing(turned.as_rotvec(), free_spin=True))[:, 1], tilt, atol=1e-14)


@given(chains(), generators, st.booleans())
def test_conditions_are_the_derivative_of_the_tips_pose(case, rng, free):
    assume(case.s.shape[1] > 0)
    tip = rigid(rng)
    by_joint = rng.normal(size=(len(case.s), case.s.shape[1], 3))
    goal = Goal(T=np.tile(np.eye(4), (len(case.s), 1, 1)), tip=tip, free_spin=free)
    J = conditioned(goal, case.chain, case.s, case.e, by_joint).J
    for i in range(len(case.s)):
        T = case.pose(i) @ tip
        dT = plain.derivatives(lambda s, i=i: case.pose(i, s=s) @ tip, case.s[i])
        expected = plain.twists(T, dT) @ by_joint[i]
        expected[:3] *= RADIANS_PER_METRE
        if free:
            expected = np.concatenate([expected[:3], T[:3, :2].T @ expected[3:]])
        np.testing.assert_allclose(J[i], expected, rtol=0.0, atol=1e-11 * max(1.0, np.abs(expected).max()))


@given(chains(poses=4), generators, st.booleans())
def test_the_step_is_the_damped_least_squares_solution(case, rng, free):
    """Small errors are solved by the shortest step that removes them, as far as the joints can."""
    joints = case.s.shape[1]
    assume(joints > 0)
    by_joint, tip = np.eye(joints)[None], rigid(rng)
    T = np.array([case.pose(i) @ tip for i in range(4)])
    turn = 1e-3 * rng.normal(size=(4, 3))
    goal_T = T.copy()
    goal_T[:, :3, :3] = Rotation.from_rotvec(turn).as_matrix() @ T[:, :3, :3]
    goal_T[:, :3, 3] += 1e-3 * rng.normal(size=(4, 3))
    goal = Goal(T=goal_T, tip=tip, free_spin=free)
    made = conditioned(goal, case.chain, case.s, case.e, by_joint)
    J, step = made.J, made.step(np.ones(len(made.off), dtype=bool))
    for i in range(4):
        error = np.concatenate([RADIANS_PER_METRE * (goal_T[i, :3, 3] - T[i, :3, 3]), turn[i]])
        if free:
            z = np.cross(T[i, :3, 2], goal_T[i, :3, 2])
            error = np.concatenate([error[:3], T[i, :3, :2].T @ (z * np.arcsin(np.linalg.norm(z)) / np.linalg.norm(z))])
            np.testing.assert_allclose(made.off[i, 1], np.linalg.norm(error[3:]), rtol=1e-6)
        damping = 1e-3 * float(error @ error) + 4e-16
        rows = np.concatenate([J[i], np.sqrt(damping) * np.eye(joints)])
        expected = np.linalg.lstsq(rows, np.concatenate([error, np.zeros(joints)]), rcond=None)[0]
        expected *= min(1.0, MAX_JOINT_STEP / np.abs(expected).max()) if expected.any() else 1.0
        np.testing.assert_allclose(step[i], expected, rtol=0.0, atol=1e-3 * max(np.abs(expected).max(), 1e-6))


@pytest.mark.parametrize("free", [False, True])
def test_where_no_joint_can_help_the_step_is_finite(free):
    goal = Goal(T=standing(np.array([[0.1, 0.2, 0.3]])).T, tip=np.eye(4), free_spin=free)
    made = conditioned(goal, STILL, np.zeros((1, 0)), np.zeros((0, 6)), np.zeros((1, 0, 2)))
    np.testing.assert_array_equal(made.step(np.ones(len(made.off), dtype=bool)), 0.0)
