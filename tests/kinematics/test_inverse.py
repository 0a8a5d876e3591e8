"""Inverse kinematics of random robots, judged by the plain forward kinematics."""

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from taskcal.errors import ReachError
from taskcal.kinematics.inverse import JUMP_RAD, closes, find_posture, follow, solve_near
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Compliance, EncoderGain, Harmonics
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from taskcal.task.task import reach_task
from taskcal_demo.procedure import reference_task
from tests.laws import plain
from tests.laws.robots import generators, industrial, industrial_positions, irb6660_description, irb6660_positions

LIMITS = (-170, -100, -90, -200, -120, -250), (170, 100, 100, 200, 120, 250)


def limited(rng: np.random.Generator) -> dict:
    """A random six-axis arm with limits."""
    description = industrial(rng)
    joints = [{**j, "limits_deg": [low, high]} for j, low, high in zip(description["joint"], *LIMITS, strict=True)]
    return {**description, "joint": joints}


def away(T: np.ndarray, expected: np.ndarray) -> tuple[float, float]:
    """Largest distance and angle between poses."""
    turned = T[:, :3, :3] @ np.swapaxes(expected[:, :3, :3], 1, 2)
    sine = np.linalg.norm(turned - np.eye(3), axis=(1, 2)) / np.sqrt(2)
    return float(np.linalg.norm(T[:, :3, 3] - expected[:, :3, 3], axis=1).max()), float(sine.max())


def smallest_singular_value(model: ErrorModel, q: np.ndarray) -> np.ndarray:
    return np.linalg.svd(model.joint_jacobian(q), compute_uv=False)[:, -1]


@given(generators)
def test_joints_near_a_known_solution_lead_back_to_it(rng):
    description = limited(rng)
    model = ErrorModel(robot_from(description))
    q = industrial_positions(rng, 30)
    q = q[smallest_singular_value(model, q) > 0.05]
    T = plain.poses(description, q)
    found = solve_near(model, T, q + rng.uniform(-0.03, 0.03, q.shape))
    assert found.reached.all()
    assert max(away(plain.poses(description, found.q), T)) < 1e-9
    np.testing.assert_allclose(found.q, q, atol=1e-6)  # the seed's branch, not another


@given(generators)
def test_a_calibrated_robot_is_solved_as_well(rng):
    description = limited(rng)
    model = ErrorModel(robot_from(description))
    x = 5.0 * rng.normal(size=len(model)) * model.tolerances
    q = industrial_positions(rng, 20)
    q = q[smallest_singular_value(model, q) > 0.05]
    T = plain.poses(description, q, x)
    found = solve_near(model, T, q + rng.uniform(-0.02, 0.02, q.shape), x)
    assert found.reached.all()
    assert max(away(plain.poses(description, found.q, x), T)) < 1e-9
    nominal = solve_near(model, T, q)
    assert nominal.reached.all()
    assert np.abs(nominal.q - found.q).max() > 1e-5  # the defects matter


@given(generators)
@settings(max_examples=15)
def test_the_parallelogram_is_solved_through_its_closure(rng):
    description = irb6660_description()
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    x = rng.normal(size=len(model)) * model.tolerances
    q = irb6660_positions(rng, 20)
    q = q[smallest_singular_value(model, q) > 0.05]
    T = plain.poses(description, q, x)
    found = solve_near(model, T, q + rng.uniform(-0.02, 0.02, q.shape), x)
    # limits are judged apart: the nominal pose may lie a hair outside them
    assert np.all(found.reached | ~model.robot.inside_limits(found.q))
    assert max(away(plain.poses(description, found.q, x), T)) < 1e-9
    np.testing.assert_allclose(found.q, q, atol=1e-6)


@given(generators)
def test_solve_near_knows_the_effects(rng):
    """The joints' deflections are added by hand, and far larger than real ones."""
    description = limited(rng)
    robot = robot_from(description)
    plain_model, model = ErrorModel(robot), ErrorModel(robot) + Harmonics(orders=(1, 3)) + EncoderGain()
    x = rng.normal(size=len(model)) * np.where(np.arange(len(model)) < len(plain_model), model.tolerances, 3e-3)
    q = industrial_positions(rng, 20)
    q = q[smallest_singular_value(model, q) > 0.05]
    harmonics, gain = x[len(plain_model) : -6].reshape(6, 2, 2), x[-6:]
    angle = q + robot.joint_map(np.zeros((1, 6)))
    stands = q + gain * q
    for k, order in enumerate((1, 3)):
        stands = stands + harmonics[:, k, 0] * np.cos(order * angle) + harmonics[:, k, 1] * np.sin(order * angle)
    T = plain.poses(description, stands, x[: len(plain_model)])
    found = solve_near(model, T, q + rng.uniform(-0.02, 0.02, q.shape), x)
    assert found.reached.all()
    np.testing.assert_allclose(found.q, q, atol=1e-6)
    nominal = solve_near(model, T, q)
    assert np.abs(nominal.q - found.q).max() > 1e-4  # the effects matter


@pytest.mark.parametrize("name", ["abb-irb6660-205-1.9", "fanuc-r2000ic-165f", "ur5", "barrett-wam"])
def test_poses_of_robots_with_all_effects_are_met_to_a_nanometre(name):
    """Through a parallelogram, a coupling in the controller, and with a joint more than needed."""
    model = ErrorModel(load_robot(name)) + Compliance() + Harmonics(orders=(1, 2, 14)) + EncoderGain()
    rng = np.random.default_rng(0)
    x = 3.0 * rng.normal(size=len(model)) * model.tolerances
    low, high = (0.6 * np.clip(model.robot.limits, -2.5, 2.5)).T
    q = rng.uniform(low, high, (200, len(low)))
    q = q[model.robot.inside_limits(q)]
    q = q[closes(model, q, x)]
    q = q[smallest_singular_value(model, q) > 0.05]
    assert len(q) > 20
    T = model.poses(q, x)
    found = solve_near(model, T, q + rng.uniform(-0.01, 0.01, q.shape), x)
    inside = model.robot.inside_limits(found.q)
    assert inside.mean() > 0.9
    assert np.all(found.reached == inside)
    assert max(away(model.poses(found.q, x), T)) < 1e-9


def test_seven_joints_work_too():
    model = ErrorModel(load_robot("barrett-wam"))
    rng = np.random.default_rng(0)
    low, high = 0.6 * model.robot.limits.T
    q = rng.uniform(low, high, (50, 7))
    T = model.poses(q)
    found = solve_near(model, T, np.clip(q + rng.uniform(-0.05, 0.05, q.shape), low, high))
    assert found.reached.mean() > 0.9
    assert max(away(model.poses(found.q[found.reached]), T[found.reached])) < 1e-9
    posture = find_posture(model, T[0])
    assert max(away(model.poses(posture[None]), T[:1])) < 1e-9
    assert model.robot.inside_limits(posture[None])[0]


@given(generators)
@settings(max_examples=5)
def test_poses_beyond_the_arm_are_not_reached(rng):
    description = limited(rng)
    model = ErrorModel(robot_from(description))
    T = np.tile(np.eye(4), (10, 1, 1))
    direction = rng.normal(size=(10, 3))
    T[:, :3, 3] = 1.01 * model.robot.reach * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    found = solve_near(model, T, industrial_positions(rng, 10))
    assert not found.reached.any()
    assert np.isfinite(found.q).all()
    with pytest.raises(ReachError, match=r"does not reach the tool pose at x .*mm.*limits"):
        find_posture(model, T[0])


@given(generators)
@settings(max_examples=20)
def test_a_pose_outside_a_limit_is_not_reached_and_inside_it_is(rng):
    """The same pose, once with the limit beyond the joint's position, once before it."""
    description = limited(rng)
    model = ErrorModel(robot_from(description))
    q = industrial_positions(rng, 8)
    q = q[smallest_singular_value(model, q) > 0.05][:1]
    if not len(q):
        return
    k = int(rng.integers(6))
    T = model.poses(q)
    for margin, expected in ((1e-3, True), (-1e-3, False)):
        end = float(np.degrees(q[0, k] + margin))
        joints = [
            {**j, "limits_deg": [-400.0, end]} if i == k else {**j, "limits_deg": [-400.0, 400.0]}
            for i, j in enumerate(description["joint"])
        ]
        narrow = ErrorModel(robot_from({**description, "joint": joints}))
        assert solve_near(narrow, T, q).reached[0] == expected
        names = description["joint"][k]["name"], description["joint"][(k + 1) % 6]["name"]
        other = float(np.degrees(q[0, (k + 1) % 6]))
        coupled = {**description, "coupled_limit": [{"of": " - ".join(names), "range_deg": [-900.0, end - other]}]}
        assert solve_near(ErrorModel(robot_from(coupled)), T, q).reached[0] == expected


def test_found_postures_are_inside_all_limits_and_coupled_limits():
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    for k, T in enumerate(reference_task(np.radians(20.0)).workspace.sample(6)):
        q = find_posture(model, T)
        np.testing.assert_array_equal(find_posture(model, T), q)  # deterministic
        assert max(away(model.poses(q[None]), T[None])) < 1e-9, k
        assert not model.robot.outside_limits(q[None])
        assert abs(q[2] - q[1]) <= np.radians(70.0) + 1e-6


@given(generators)
@settings(max_examples=8)
def test_followed_poses_stay_on_the_branch(rng):
    """Poses of a small ball are neighbours of each other in the joints as well."""
    description = limited(rng)
    model = ErrorModel(robot_from(description))
    q = industrial_positions(rng, 20)
    start = q[np.argmax(smallest_singular_value(model, q))]
    home = model.poses(start[None])[0]
    T = np.tile(home, (40, 1, 1))
    T[:, :3, 3] += rng.uniform(-0.1, 0.1, (40, 3))
    found = follow(model, T, start)
    assert max(away(plain.poses(description, found.q[found.reached]), T[found.reached])) < 1e-9
    assert model.robot.inside_limits(found.q[found.reached]).all()
    # a fine way from the start keeps the branch by construction; both agree
    mine = np.flatnonzero(found.reached)
    at, step = np.tile(start, (len(mine), 1)), T[mine].copy()
    for share in np.linspace(0, 1, 61)[1:]:
        step[:, :3, 3] = home[:3, 3] + share * (T[mine, :3, 3] - home[:3, 3])
        at = solve_near(model, step, at).q
    np.testing.assert_allclose(found.q[mine], at, atol=1e-6)


def test_the_way_through_the_reference_workspace_never_jumps():
    """Neighbouring poses of a fine grid, each followed from the middle on its own, differ by little."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    middle = reference_task().workspace.middle()[0]
    steps = np.linspace(-0.25, 0.25, 41)
    T = np.tile(middle, (41, 1, 1))
    T[:, 1, 3] += steps
    found = follow(model, T, find_posture(model, middle))
    assert found.reached.all()
    assert np.abs(np.diff(found.q, axis=0)).max() < 0.05 < JUMP_RAD


def test_a_followed_way_past_the_reach_is_reported():
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    middle = reference_task().workspace.middle()[0]
    T = np.tile(middle, (2, 1, 1))
    T[1, 0, 3] += 2.5
    found = follow(model, T, find_posture(model, middle))
    assert found.reached.tolist() == [True, False]
    assert np.isfinite(found.q).all()


def test_a_task_in_one_orientation_stays_on_one_branch():
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    found = reach_task(model, reference_task(), 200)
    assert not found.unreachable.any()
    assert max(away(model.poses(found.q), found.T)) < 1e-9
    assert np.ptp(found.q, axis=0).max() < np.pi


@given(generators)
@settings(max_examples=10)
def test_an_independent_solver_finds_the_same_joints(rng):
    """SciPy's least squares on the plain forward kinematics, without a derivative of Taskcal's."""
    description = limited(rng)
    model = ErrorModel(robot_from(description))
    x = 5.0 * rng.normal(size=len(model)) * model.tolerances
    q = industrial_positions(rng, 10)
    q = q[smallest_singular_value(model, q) > 0.05][:2]
    T = plain.poses(description, q, x)
    seed = q + rng.uniform(-0.02, 0.02, q.shape)
    found = solve_near(model, T, seed, x)

    def miss(joints: np.ndarray, target: np.ndarray) -> np.ndarray:
        at = plain.pose(description, joints, x)
        return np.concatenate([at[:3, 3] - target[:3, 3], (at[:3, :3] - target[:3, :3]).ravel()])

    for row in range(len(q)):
        other = least_squares(miss, seed[row], args=(T[row],), xtol=1e-14, ftol=1e-14, gtol=1e-14)
        np.testing.assert_allclose(found.q[row], other.x, atol=1e-6)


@given(generators)
@settings(max_examples=15)
def test_a_tip_in_the_tool_is_brought_to_the_pose(rng):
    description = limited(rng)
    model = ErrorModel(robot_from(description))
    q = industrial_positions(rng, 10)
    q = q[smallest_singular_value(model, q) > 0.05]
    tip = np.eye(4)
    tip[:3, :3] = Rotation.from_rotvec(rng.normal(size=3)).as_matrix()
    tip[:3, 3] = rng.uniform(-0.2, 0.2, 3)
    T = plain.poses(description, q) @ tip
    found = solve_near(model, T, q + rng.uniform(-0.02, 0.02, q.shape), tip=tip)
    assert found.reached.all()
    assert max(away(plain.poses(description, found.q) @ tip, T)) < 1e-9


@given(generators)
@settings(max_examples=15)
def test_free_spin_reaches_beyond_a_limit(rng):
    """Only point and axis are met, near the seed; the same pose with its spin is outside the last joint's limits."""
    description = limited(rng)
    model = ErrorModel(robot_from(description))
    q = industrial_positions(rng, 10)
    q = q[smallest_singular_value(model, q) > 0.05]
    q[:, 5] = np.radians(249.9)
    tip = np.linalg.inv(model.robot.T_flange_tool)  # the flange: its z axis is the last joint's
    spun = q + np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.5])
    T = plain.poses(description, spun) @ tip
    assert not solve_near(model, T, q, tip=tip).reached.any()
    found = solve_near(model, T, q, tip=tip, spin="free")
    assert found.reached.all()
    np.testing.assert_allclose(found.q, q, atol=1e-9)  # nothing had to move
    moved = T.copy()
    moved[:, :3, 3] += rng.uniform(-0.005, 0.005, (len(q), 3))
    found = solve_near(model, moved, q - np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.3]), tip=tip, spin="free")
    at = plain.poses(description, found.q) @ tip
    assert found.reached.all()
    np.testing.assert_allclose(at[:, :3, 3], moved[:, :3, 3], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(at[:, :3, 2], moved[:, :3, 2], rtol=0.0, atol=1e-9)


def test_threads_solve_the_same_poses():
    """Poses solved on threads equal those solved a few at a time."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = irb6660_positions(np.random.default_rng(0), 20_000)
    q[::7, 2] = q[::7, 1] + np.radians(95.0)  # where the loop does not close
    T = model.poses(np.where(closes(model, q)[:, None], q, 0.1))
    many = solve_near(model, T, q + 1e-3)
    assert many.reached.mean() > 0.7
    for rows in (slice(0, 50), slice(8180, 8230), slice(19_950, 20_000)):
        few = solve_near(model, T[rows], q[rows] + 1e-3)
        np.testing.assert_array_equal(few.q, many.q[rows])
        np.testing.assert_array_equal(few.reached, many.reached[rows])


@pytest.mark.parametrize("spin", ["fixed", "free"])
def test_no_poses_need_no_solution(spin):
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    assert solve_near(model, np.zeros((0, 4, 4)), np.zeros((0, 6)), spin=spin).reached.shape == (0,)
