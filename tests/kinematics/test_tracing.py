"""Paths of tool poses: met by the plain forward kinematics, without jumps, or refused with the reason."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from taskcal.kinematics.inverse import JUMP_RAD, conditioning, find_posture, solve_near
from taskcal.kinematics.tracing import MAX_STEEPNESS, STRIDE, Outcome, Traced, TracedPath, rejections, solve_path, trace
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Compliance, Harmonics
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from taskcal_demo.procedure import reference_task
from tests.laws import plain
from tests.laws.robots import generators, industrial, industrial_positions


def retrace(model, T, near, x=None):
    """The path solved from seeds near its postures."""
    return solve_path(TracedPath(model=model, T=T, x=x, tip=np.eye(4)), near)


def motion(T: np.ndarray) -> np.ndarray:
    """From pose to pose, radians and half metres."""
    angle = (Rotation.from_matrix(T[1:, :3, :3]) * Rotation.from_matrix(T[:-1, :3, :3]).inv()).magnitude()
    return np.hypot(2.0 * np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1), angle)


def assert_continuous(traced: Traced, T: np.ndarray) -> None:
    """What `Traced` says of its reached poses, each of which follows a reached one."""
    both = traced.reached[1:] & traced.reached[:-1]
    change, moved = np.abs(np.diff(traced.q, axis=0)).max(axis=1)[both], motion(T)[both]
    assert np.all((change <= MAX_STEEPNESS * moved + 2e-6) | (moved > STRIDE))
    assert np.all((change <= JUMP_RAD + 1e-9) | (moved > STRIDE))


def assert_met(T: np.ndarray, expected: np.ndarray) -> None:
    np.testing.assert_allclose(T[:, :3, 3], expected[:, :3, 3], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(T[:, :3, :3], expected[:, :3, :3], rtol=0.0, atol=2e-9)


def curve(rng: np.random.Generator, start: np.ndarray, n: int) -> np.ndarray:
    """A smooth way in the joints with a few bends, through a starting posture."""
    t = np.linspace(0.0, 1.0, n)[:, None]
    bends = sum(rng.normal(scale=0.15, size=6) * np.sin(k * np.pi * t) for k in (1, 2, 3))
    return start + bends


@given(generators)
@settings(max_examples=8)
def test_path_is_met_with_defects_and_effects(rng):
    """A path is met with defects and effects and without jumps."""
    description = industrial(rng)
    model = ErrorModel(robot_from(description)) + Compliance() + Harmonics()
    x = rng.normal(size=len(model)) * model.tolerances
    q = curve(rng, industrial_positions(rng, 1)[0], 400)
    q[:, 4] = 0.9 + 0.3 * np.sin(q[:, 4])  # away from the wrist's singular posture
    assume(conditioning(model, q, x).min() > 0.02)
    T = model.poses(q, x)
    traced = trace(model, T, q[0] + 0.01, x)
    assert_continuous(traced, T)
    assert traced.reached.all()
    assert_met(model.poses(traced.q, x), T)
    np.testing.assert_allclose(traced.q, q, atol=1e-6)
    again = retrace(model, T, q + rng.uniform(-1e-3, 1e-3, q.shape), x)
    assert again.reached.all()
    np.testing.assert_allclose(again.q, q, atol=1e-6)


def test_sparse_path_is_followed_as_a_dense_one():
    """A sparse path is followed straight from pose to pose as a dense one is."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    middle = reference_task().workspace.middle()[0]
    corners = np.tile(middle, (4, 1, 1))
    corners[1:, :3, 3] += np.array([[0.0, 0.3, 0.0], [0.25, 0.3, -0.2], [-0.2, -0.3, 0.2]])
    start = find_posture(model, middle)
    sparse = trace(model, corners, start)
    dense_T = np.repeat(corners[:1], 601, axis=0)
    for axis in range(3):
        dense_T[:, axis, 3] = np.interp(np.linspace(0.0, 3.0, 601), range(4), corners[:, axis, 3])
    dense = trace(model, dense_T, start)
    assert sparse.reached.all()
    assert dense.reached.all()
    np.testing.assert_allclose(sparse.q, dense.q[::200], atol=1e-7)
    assert_continuous(dense, dense_T)


@given(generators, st.sampled_from([0.0, 1e-6, 1e-4, 1e-3, 1e-2, 0.03, 0.1]))
@settings(max_examples=12)
def test_path_by_a_singular_wrist_has_no_jump(rng, aside):
    """Joint 5 passes through zero; the tool is tilted aside of that by more or less, so that joints 4 and 6 have to turn."""
    description = industrial(rng)
    model = ErrorModel(robot_from(description))
    q = np.tile(industrial_positions(rng, 1)[0], (800, 1))
    q[:, 4] = np.linspace(-0.3, 0.3, 800)
    q[:, 0] += np.linspace(0.0, 0.1, 800)
    T = model.poses(q)
    T[:, :3, :3] = T[:, :3, :3] @ Rotation.from_rotvec([0.0, aside, 0.0]).as_matrix()
    traced = trace(model, T, q[0])
    assert_continuous(traced, T)
    assert_met(plain.poses(description, traced.q[traced.reached][::20]), T[traced.reached][::20])
    assert traced.reached.mean() > 0.8
    assert traced.singularity.min() < 0.02
    assert set(traced.outcome[~traced.reached]) <= {Outcome.SINGULAR, Outcome.OUT_OF_REACH}
    assert all("singular" in reason or "reach" in reason for _, reason in rejections(model.robot, traced))
    if aside == 0.0:
        assert traced.reached.all()
        np.testing.assert_allclose(traced.q[-1], q[-1], atol=1e-6)


@pytest.mark.parametrize(
    ("aside", "passes"), [(0.0, True), (1e-3, False), (1e-2, False), (0.03, True), (0.1, True), (0.2, True)]
)
def test_wrist_joints_turn_no_faster_than_stated(aside, passes):
    """Aside by an angle, they turn by half a turn while the tool turns by about as much: too fast when the angle is small."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = np.tile(np.radians([0.0, 10.0, 30.0, 20.0, 0.0, 10.0]), (2000, 1))
    q[:, 4] = np.linspace(-0.3, 0.3, 2000)
    q[:, 0] += np.linspace(-0.1, 0.1, 2000)
    T = model.poses(q)
    T[:, :3, :3] = T[:, :3, :3] @ Rotation.from_rotvec([0.0, aside, 0.0]).as_matrix()
    traced = trace(model, T, q[0])
    both = traced.reached[1:] & traced.reached[:-1]
    assert np.all((np.abs(np.diff(traced.q, axis=0)).max(axis=1) <= 100.0 * motion(T) + 2e-6)[both])
    assert traced.reached.all() == passes
    assert set(traced.outcome) <= {Outcome.REACHED, Outcome.SINGULAR}
    assert traced.reached.mean() > 0.98
    if passes:
        turn = np.abs(traced.q[-1, 3] - traced.q[0, 3])
        assert turn > 2.0 if aside else turn < 1e-6


def test_path_out_of_reach_is_taken_up_again():
    """A path that leaves the reach names the poses and is taken up again."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    middle = reference_task().workspace.middle()[0]
    T = np.tile(middle, (301, 1, 1))
    T[:, 2, 3] += 2.5 * np.maximum(np.sin(np.linspace(0.0, 2.0 * np.pi, 301)), -0.05)
    traced = trace(model, T, find_posture(model, middle))
    refused = rejections(model.robot, traced)
    out = traced.outcome == Outcome.OUT_OF_REACH
    height = np.hypot(T[:, 2, 3] - 0.8145, T[:, 0, 3] - 0.3)
    assert out[height > 2.6].all()
    assert traced.reached[:10].all()
    assert traced.reached[-100:].all()
    assert [row for row, _ in refused] == np.flatnonzero(~traced.reached).tolist()
    reasons = [(traced.off[row, 0], reason) for row, reason in refused if out[row]]
    near = [(off, reason) for off, reason in reasons if np.isfinite(off)]
    assert near
    assert all("out of reach" in reason and f"{off * 1e3:.3g} mm" in reason and off > 0.1 for off, reason in near)
    beyond = [reason for off, reason in reasons if np.isinf(off)]
    assert all("the four-bar does not close on the way to it" in reason for reason in beyond)
    np.testing.assert_allclose(traced.q[-1], traced.q[0], atol=1e-7)


def test_a_path_that_passes_a_limit_says_which():
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    middle = reference_task().workspace.middle()[0]
    start = find_posture(model, middle)
    q = np.tile(start, (400, 1))
    q[:, 5] = np.radians(np.linspace(300.0, 380.0, 400))
    T = model.poses(q)
    traced = trace(model, T, q[0])
    over = q[:, 5] > np.radians(360.0) + 1e-6
    np.testing.assert_array_equal(traced.outcome == Outcome.OUTSIDE_LIMITS, over)
    assert traced.reached[~over].all()
    first = rejections(model.robot, traced)[0]
    assert first[0] == np.argmax(over)
    assert first[1].startswith("J6 = 360.")
    assert "outside -360 to 360°" in first[1]
    wound = np.diff(trace(model, T, q[0]).q[:, 5])
    assert (wound > 0.0).all()  # never turned back by a whole turn


def test_coupled_limits_and_the_loop_are_reported():
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = np.tile(np.radians([0.0, 0.0, 20.0, 0.0, 60.0, 0.0]), (200, 1))
    q[:, 2] = np.radians(np.linspace(20.0, 85.0, 200))
    traced = trace(model, model.poses(q), q[0])
    over = q[:, 2] > np.radians(70.0) + 1e-6
    np.testing.assert_array_equal(traced.reached, ~over)
    assert "J3 - J2" in rejections(model.robot, traced)[0][1]


def test_seeds_on_two_branches_are_solved_again():
    """The seeds change to the other wrist halfway; the joints must not follow them without a word."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = np.tile(np.radians([0.0, 10.0, 40.0, 10.0, 45.0, 20.0]), (100, 1))
    q[:, 0] = np.linspace(0.0, 0.05, 100)
    near = q.copy()
    near[50:] += [0.0, 0.0, 0.0, np.pi, 0.0, -np.pi]
    near[50:, 4] *= -1.0
    T = model.poses(q)
    traced = retrace(model, T, near)
    assert traced.reached.all()
    np.testing.assert_allclose(traced.q, q, atol=1e-7)
    far = np.concatenate([T[:1], T[-1:]])
    ends = near[[0, -1]] + np.array([[0.0], [0.3]]) * np.eye(6)[0]
    far[1] = model.poses(q[-1:] + 0.3 * np.eye(6)[:1])[0]
    kept = retrace(model, far, ends)
    assert kept.reached.all()  # the tool moves far: what joins the seeds is the caller's
    assert np.abs(np.diff(kept.q, axis=0)).max() > JUMP_RAD


def test_seeds_past_a_limit_are_refused_there():
    """Joint 6 comes to its limit; the seeds go on with the wrist turned over. The limit is named."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = np.tile(np.radians([0.0, 10.0, 40.0, 10.0, 45.0, 0.0]), (100, 1))
    q[:, 5] = np.radians(np.linspace(350.0, 370.0, 100))
    over = q[:, 5] > np.radians(360.0) + 1e-6
    near = q.copy()
    near[over] += [0.0, 0.0, 0.0, np.pi, 0.0, -np.pi]
    near[over, 4] *= -1.0
    traced = retrace(model, model.poses(q), near)
    first = int(np.argmax(over))
    assert np.flatnonzero(~traced.reached).tolist() == [first]
    assert traced.outcome[first] == Outcome.OUTSIDE_LIMITS
    assert rejections(model.robot, traced)[0][1].startswith("J6 = 360.")
    np.testing.assert_allclose(traced.q[first + 1 :], near[first + 1 :], atol=1e-7)


def test_misleading_seed_is_replaced_by_the_straight_path():
    """Far apart a seed that leads elsewhere is replaced by the straight way."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = np.radians([[0.0, 10.0, 40.0, 10.0, 45.0, 20.0], [15.0, 15.0, 40.0, 10.0, 45.0, 20.0]])
    near = q.copy()
    near[1] += [0.0, 0.0, 0.0, 2.0, -1.5, 0.0]
    elsewhere = solve_near(model, model.poses(q), near)
    assert elsewhere.reached.all()  # with the wrist turned over
    assert np.abs(elsewhere.q - near).max() > JUMP_RAD
    assert np.abs(elsewhere.q - q).max() > 3.0
    traced = retrace(model, model.poses(q), near)
    assert traced.reached.all()
    np.testing.assert_allclose(traced.q, q, atol=1e-7)
    first = retrace(model, model.poses(q[::-1]), near[::-1])
    assert first.reached.tolist() == [False, True]  # of the first pose there is nothing to start from


def test_disagreeing_branches_refuse_one_pose(monkeypatch):
    """Where both ways never agree one pose is refused and a new stretch begins."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = np.tile(np.radians([0.0, 10.0, 40.0, 10.0, 45.0, 20.0]), (120, 1))
    q[:, 0] = np.linspace(0.0, 0.06, 120)
    near = q.copy()
    near[50:] += [0.0, 0.0, 0.0, np.pi, 0.0, -np.pi]
    near[50:, 4] *= -1.0
    monkeypatch.setattr("taskcal.kinematics.tracing.MAX_REPAIRED", 10)
    traced = retrace(model, model.poses(q), near)
    assert np.flatnonzero(~traced.reached).tolist() == [59]
    assert traced.outcome[59] == Outcome.BRANCH_LOST
    assert "another branch" in rejections(model.robot, traced)[0][1]
    assert_continuous(traced, model.poses(q))
    np.testing.assert_allclose(traced.q[60:], near[60:], atol=1e-7)
