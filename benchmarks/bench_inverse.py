"""Inverse kinematics of a calibrated robot from the nominal joints: one pose after another, and all at once."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from benchmarks import plain_walk
from taskcal.kinematics.inverse import solve_near
from taskcal.kinematics.tracing import trace
from taskcal.robot.effects import Compliance, Harmonics
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import draw_defects

MET = 1e-9
"""Metres and radians."""


def misses(T: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Translation and rotation that are left."""
    turn = Rotation.from_matrix(T[:, :3, :3] @ np.swapaxes(at[:, :3, :3], 1, 2)).as_rotvec()
    return np.concatenate([T[:, :3, 3] - at[:, :3, 3], turn], axis=1)


def inside(q: np.ndarray) -> np.ndarray:
    """Drawn to their middle, so that the calibrated robot stays within the limits as well."""
    return q.mean(axis=0) + 0.9 * (q - q.mean(axis=0))


@pytest.fixture
def calibrated(model):
    return draw_defects(model, np.random.default_rng(2))


def test_few_poses_against_solvers_one_pose_at_a_time(race, model, joints, calibrated, smoke):
    n = 2 if smoke else 20
    q = inside(joints(n))
    T = model.poses(q)
    e, xi, steps = model.error_frames(calibrated), calibrated[-3:], list(model.steps)

    def poses(rows: np.ndarray) -> np.ndarray:
        return plain_walk.poses(steps, model.robot, rows, e, xi)

    def newton() -> np.ndarray:
        """Derivatives by differences, all of a pose in one call."""
        out = q.copy()
        nudge = np.concatenate([np.zeros((1, 6)), 1e-7 * np.eye(6)])
        for row, target in zip(out, T, strict=True):
            for _ in range(8):
                left = misses(np.broadcast_to(target, (7, 4, 4)), poses(row + nudge))
                if np.abs(left[0]).max() < MET:
                    break
                row += np.linalg.solve((left[0] - left[1:]).T / 1e-7, left[0])
        return out

    def scipy() -> np.ndarray:
        def left(row: np.ndarray, target: np.ndarray) -> np.ndarray:
            return misses(target[None], poses(row[None]))[0]

        tight = {"xtol": 1e-12, "ftol": 1e-12, "gtol": 1e-12}
        return np.array([least_squares(left, q[i], args=(T[i],), method="lm", **tight).x for i in range(n)])

    found = solve_near(model, T, q, calibrated)
    assert found.reached.all()
    np.testing.assert_allclose(newton(), found.q, rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(scipy(), found.q, rtol=0.0, atol=1e-7)
    race(
        "inverse kinematics, 20",
        lambda: solve_near(model, T, q, calibrated),
        {"NumPy, pose by pose": newton, "SciPy, pose by pose": scipy},
    )


@pytest.mark.guard
def test_many_poses_against_numpy_on_all_at_once(race, model, joints, calibrated, smoke):
    """Both walk compiled; the reference does errors, solutions and bookkeeping in NumPy and SciPy, 2048 poses at a time."""
    q = inside(joints(300 if smoke else 100_000))
    T = model.poses(q)

    def batched() -> np.ndarray:
        out = q.copy()
        for rows in plain_walk.chunks(len(q)):
            for _ in range(8):
                left = misses(T[rows], model.poses(out[rows], calibrated))
                if np.abs(left).max() < MET:
                    break
                J = model.joint_jacobian(out[rows], calibrated)
                out[rows] += np.linalg.solve(J, left[:, :, None])[:, :, 0]
        return out

    found = solve_near(model, T, q, calibrated)
    assert found.reached.all()
    np.testing.assert_allclose(batched(), found.q, rtol=0.0, atol=1e-7)
    race(
        "inverse kinematics, 100000",
        lambda: solve_near(model, T, q, calibrated),
        {"NumPy, all at once": batched},
        rounds=3,
    )


def test_many_poses_of_a_robot_with_effects_against_its_forward_kinematics(race, model, joints, smoke):
    """Four evaluations of the effects lead to a nanometre, and the last of them proves it."""
    q = inside(joints(300 if smoke else 100_000))
    T = model.poses(q)
    bent: ErrorModel = model + Compliance() + Harmonics()
    x = bent.tolerances * np.random.default_rng(2).normal(size=len(bent))
    found = solve_near(bent, T, q, x)
    assert found.reached.all()
    assert np.abs(misses(T, bent.poses(found.q, x))).max() < MET
    race(
        "inverse kinematics with effects, 100000",
        lambda: solve_near(bent, T, q, x),
        {"poses": lambda: bent.poses(q, x)},
        rounds=3,
    )


def test_a_traced_path_against_poses_solved_from_known_joints(race, model, calibrated, smoke):
    """A path of 17 metres: strides, solution, distance to singular postures, and the test of every step."""
    n = 300 if smoke else 100_000
    way = np.linspace(0.0, 1.0, n)
    start = np.radians([0.0, 10.0, 40.0, 10.0, 45.0, 20.0])
    T = np.tile(model.poses(start[None])[0], (n, 1, 1))
    T[:, 0, 3] += 0.2 * np.sin(40.0 * np.pi * way)
    T[:, 1, 3] += 0.3 * np.cos(6.0 * np.pi * way) - 0.3
    traced = trace(model, T, start, calibrated)
    assert traced.reached.all()
    race(
        "path, 100000",
        lambda: trace(model, T, start, calibrated),
        {"known joints": lambda: solve_near(model, T, traced.q, calibrated)},
        rounds=3,
    )
