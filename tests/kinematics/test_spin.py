"""The rotation about a tool's axis, chosen along paths."""

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.spatial.transform import Rotation

from taskcal.errors import ReachError
from taskcal.geometry import se3
from taskcal.kinematics.spin import GUIDE_STRIDE, choose_spin
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.laws import plain
from tests.laws.robots import generators

ROBOT = load_robot("abb-irb120")
DOWN = Rotation.from_euler("x", 180, degrees=True).as_matrix()


def turned_about_z(T: np.ndarray, angle: np.ndarray) -> np.ndarray:
    out = T.copy()
    out[:, :3, :3] = T[:, :3, :3] @ Rotation.from_euler("z", angle[:, None]).as_matrix()
    return out


def narrowed(**limits: tuple[float, float]) -> ErrorModel:
    """The IRB 120 with some joints' limits in degrees."""
    joints = [{**j, "limits_deg": list(limits.get(j["name"], j["limits_deg"]))} for j in ROBOT.description["joint"]]
    return ErrorModel(robot_from({**ROBOT.description, "joint": joints}))


def arc(n: int, half: float) -> np.ndarray:
    """Around the base, the tool straight down."""
    angle = np.linspace(-half, half, n)
    points = np.stack([0.4 * np.cos(angle), 0.4 * np.sin(angle), np.full(n, 0.25)], axis=1)
    return se3.pose(np.broadcast_to(DOWN, (n, 3, 3)), points)


def check(model: ErrorModel, T: np.ndarray, spun, tip: np.ndarray | None = None) -> None:
    """What every result holds, by the plain forward kinematics."""
    at = plain.poses(model.robot.description, spun.q) @ (np.eye(4) if tip is None else tip)
    np.testing.assert_allclose(at, spun.T, atol=2e-9)
    np.testing.assert_allclose(spun.T[:, :3, 2:], T[:, :3, 2:], atol=1e-12)
    assert model.robot.inside_limits(spun.q).all()
    shift = np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1)
    near = shift < 0.5 * GUIDE_STRIDE
    assert np.abs(np.diff(spun.q, axis=0))[near].max(initial=0.0) < 0.7


@given(generators)
@settings(max_examples=2)
def test_spin_of_the_given_path_does_not_matter(rng):
    """Paths that a robot can follow are followed whatever spin they are given with."""
    model = ErrorModel(ROBOT)
    a = rng.uniform(np.radians([-90, -30, -40, -80, 40, -90]), np.radians([90, 40, 20, 80, 90, 90]))
    b = a + rng.uniform(-0.6, 0.6, 6)
    q = a + np.linspace(0, 1, 25)[:, None] * (b - a)
    q[:, 4] = np.maximum(q[:, 4], 0.3)
    tip = se3.pose(Rotation.random(rng=rng).as_matrix(), rng.uniform(-0.1, 0.1, 3))
    T = plain.poses(ROBOT.description, q) @ tip
    spun = choose_spin(model, turned_about_z(T, rng.uniform(-3, 3, 25)), tip=tip)
    check(model, T, spun, tip)
    again = choose_spin(model, turned_about_z(T, rng.uniform(-3, 3, 25)), tip=tip)
    np.testing.assert_allclose(again.q, spun.q, atol=1e-8)
    np.testing.assert_allclose(again.spin, spun.spin, atol=1e-9)


def test_a_constant_spin_is_preferred():
    model = ErrorModel(ROBOT)
    T = arc(40, 0.4)
    spun = choose_spin(model, T)
    check(model, T, spun)
    assert np.ptp(spun.spin) == 0.0
    np.testing.assert_allclose(spun.T[:, :3, :3], np.broadcast_to(spun.T[0, :3, :3], (40, 3, 3)), atol=1e-12)


def test_turning_spin_reaches_where_a_constant_fails():
    """A spin that turns with the arm reaches where none that stays does."""
    model = narrowed(J4=(-30.0, 30.0), J6=(-25.0, 25.0))
    T = arc(120, 2.0)
    spun = choose_spin(model, T)
    check(model, T, spun)
    assert np.ptp(spun.spin) > np.radians(150)
    steps = np.abs(np.diff(spun.spin))
    assert steps.max() < 3.0 * steps.mean()
    assert np.abs(np.diff(spun.spin, 2)).max() < 0.3 * steps.mean()  # evenly: a grid of spins alone would go by jerks


def test_the_nearest_posture_of_many_joints_serves_too():
    model = ErrorModel(load_robot("barrett-wam"))
    q = np.array([0.2, 0.6, 0.1, 1.4, 0.2, 0.5, 0.3]) + np.linspace(0, 1, 15)[:, None] * 0.3
    T = model.poses(q)
    check(model, T, choose_spin(model, T))


def test_a_single_pose_is_a_path():
    model = ErrorModel(ROBOT)
    T = arc(1, 0.0)
    check(model, T, choose_spin(model, T))


def test_a_path_beyond_the_arm_names_where_it_leaves_the_reach():
    T = arc(60, 0.3)
    T[30:, 0, 3] += np.linspace(0, 1.5, 30)
    with pytest.raises(
        ReachError, match=r"abb-irb120 cannot follow the path beyond pose (3\d|4\d) \(x \d+, .*; move the part"
    ):
        choose_spin(ErrorModel(ROBOT), T)
    T[:, 2, 3] += 3.0
    with pytest.raises(
        ReachError, match=r"does not reach the start of the path, x .* with any rotation about the tool's axis"
    ):
        choose_spin(ErrorModel(ROBOT), T)
