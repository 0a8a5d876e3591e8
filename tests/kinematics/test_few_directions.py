"""Robots that command fewer than six directions meet a pose as far as they can, judged by the plain forward kinematics."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from taskcal.errors import ReachError
from taskcal.geometry import se3
from taskcal.kinematics.inverse import ANY_MISS, freedom_of, solve_near
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from taskcal.task.default_task import default_task, task_text
from taskcal.task.task import Task, enlarge, load_task, reach_task
from taskcal.task.workspace import Orientation, Workspace
from tests.laws import plain
from tests.laws.robots import FEW_DIRECTIONS, cases, generators

FEW = {"denso-hsr065a1": load_robot("denso-hsr065a1"), **{name: robot_from(d) for name, d in FEW_DIRECTIONS.items()}}

RANKS = {"denso-hsr065a1": (3, 1), "gantry": (3, 1), "palletizer": (3, 1), "five-axis": (3, 2)}


@given(cases(poses=4, max_joints=5))
@settings(max_examples=15)
def test_directions_are_the_rank_of_the_plain_derivative(case):
    """That of the posture which has the most, and the position's alone."""
    description, found = case.description, freedom_of(case.model)
    J = [
        plain.twists(plain.pose(description, q), plain.derivatives(lambda q: plain.pose(description, q), q))
        for q in case.q
    ]
    rank, position = (max(np.linalg.matrix_rank(j[:rows], tol=1e-6) for j in J) for rows in (6, 3))
    assert (found.rank, found.position) == (rank, position)


@given(cases(poses=3, min_joints=2, max_joints=5), generators)
@settings(max_examples=6)
def test_the_nearest_pose_is_the_least_turned_of_those_in_place(case, rng):
    """SciPy's constrained minimum on the plain kinematics, for poses that are off by some degrees and millimetres."""
    model, description = case.model, case.description
    freedom = freedom_of(model)
    s = np.linalg.svd(model.joint_jacobian(case.q)[:, :3], compute_uv=False)
    assume(freedom.position == 3 and freedom.rank < 6 and (s[:, 2] > 0.05).all())
    T = plain.poses(description, case.q)
    T[:, :3, :3] = Rotation.from_rotvec(0.1 * rng.normal(size=(3, 3))).as_matrix() @ T[:, :3, :3]
    T[:, :3, 3] += 0.005 * rng.normal(size=(3, 3))
    found = solve_near(model, T, case.q, iterations=60, miss=ANY_MISS)
    assert found.reached.any()
    for q, start, goal in zip(found.q[found.reached], case.q[found.reached], T[found.reached], strict=True):

        def turned(q, goal=goal):
            R = plain.pose(description, q)[:3, :3] @ goal[:3, :3].T
            return float(np.sum(Rotation.from_matrix(R).as_rotvec() ** 2))

        def away(q, goal=goal):
            return plain.pose(description, q)[:3, 3] - goal[:3, 3]

        assert np.abs(away(q)).max() < 1e-8
        best = minimize(
            turned,
            start,
            method="SLSQP",
            constraints={"type": "eq", "fun": away},
            options={"ftol": 1e-14, "maxiter": 500},
        )
        assert turned(q) <= best.fun + 1e-6 or np.abs(away(best.x)).max() > 1e-8


@pytest.mark.parametrize("name", FEW)
def test_defects_that_no_joint_can_take_away_are_left(name):
    """A robot with defects reaches the poses of the nominal one in place; the nominal one does not reach a tilted pose."""
    model, rng = ErrorModel(FEW[name]), np.random.default_rng(0)
    assert (freedom_of(model).position, freedom_of(model).rotation) == RANKS[name]
    low, high = model.robot.bounded_limits().T
    q = low + (high - low) * rng.uniform(0.3, 0.7, (40, len(low)))
    q = q[np.linalg.svd(model.joint_jacobian(q)[:, :3], compute_uv=False)[:, 2] > 0.1]
    assert len(q) > 10
    T, x = model.poses(q), rng.normal(size=len(model)) * model.tolerances
    found = solve_near(model, T, q, x)
    assert found.reached.mean() > 0.9
    at = model.poses(found.q[found.reached], x)
    np.testing.assert_allclose(at[:, :3, 3], T[found.reached, :3, 3], atol=1e-9)
    assert (
        1e-6 < np.linalg.norm(se3.log(at[:, :3, :3] @ np.swapaxes(T[found.reached, :3, :3], 1, 2)), axis=1).max() < 0.02
    )
    side = T.copy()
    side[:, :3, :3] = Rotation.from_rotvec([0.02, 0.0, 0.0]).as_matrix() @ T[:, :3, :3]
    side[:, :3, :3] = Rotation.from_rotvec([0.0, 0.02, 0.0]).as_matrix() @ side[:, :3, :3]
    missed = solve_near(model, side, q)
    assert missed.reached.mean() < 0.1
    assert solve_near(model, side, q, miss=ANY_MISS).reached.mean() > 0.9


@pytest.mark.parametrize(
    "name", [name if name == "denso-hsr065a1" else pytest.param(name, marks=pytest.mark.long) for name in FEW]
)
def test_a_task_to_begin_with_and_the_poses_about_it_are_reached(tmp_path, name):
    """By poses of the workspace itself, however few of the asked ones the robot can take."""
    model = ErrorModel(FEW[name])
    (tmp_path / "task.toml").write_text(task_text(default_task(model)))
    task = load_task(tmp_path / "task.toml")
    for asked, least in ((task, 0.9), (enlarge(task, model), 0.7)):
        found = reach_task(model, asked, 200)
        assert asked.workspace is not None
        assert 1.0 - found.unreachable.mean() >= least
        assert model.robot.inside_limits(found.q).all()
        np.testing.assert_allclose(found.T, model.poses(found.q), atol=1e-12)
        assert asked.workspace.contains(found.T).all()
        assert (np.ptp(found.T[:, :3, 3], axis=0) > 0.8 * asked.workspace.size).all()


def test_an_arm_on_a_rail_works_where_the_rail_is():
    """Far from the base, and with limits of metres."""
    description = dict(load_robot("ur5").description)
    rail = {"name": "E1", "type": "prismatic", "steps": [{"ry_deg": 90.0}], "limits_mm": [4000.0, 10000.0]}
    first = {**description["joint"][0], "name": "J1"}
    arm = {"name": "turn", "steps": [{"ry_deg": -90.0}], "driven": True, "angle": "0*E1"}
    model = ErrorModel(
        robot_from({**description, "joint": [rail, arm, first, *description["joint"][1:]], "link_radii_mm": None})
    )
    task = default_task(model)
    assert task.workspace is not None
    assert abs(task.workspace.center[0] - 7.0) < 1.0
    assert reach_task(model, enlarge(task, model), 100).unreachable.mean() < 0.2


def test_an_orientation_that_a_robot_cannot_take_is_stated_with_the_nearest():
    model = ErrorModel(FEW["palletizer"])
    tilted = Rotation.from_rotvec([np.pi, 0.0, 0.0]) * Rotation.from_rotvec([0.3, 0.0, 0.0])
    space = Workspace(
        T_base_frame=np.eye(4),
        shape="box",
        center=np.array([1.7, 0.0, 0.6]),
        size=np.full(3, 0.2),
        turned=np.eye(3),
        orientations=(Orientation(rotation=tilted.as_matrix()),),
    )
    with pytest.raises(
        ReachError, match=r"moves its tool in 4 of six directions, .* than \S+ mm and 17\.2°; .*cone_deg"
    ):
        reach_task(model, Task(name="tilted", workspace=space))
