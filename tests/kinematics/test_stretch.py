"""How far arms stretch: no posture of any robot leads beyond, and an outstretched arm comes near to it."""

import time

import numpy as np
import pytest
from hypothesis import given

from taskcal.errors import ReachError
from taskcal.geometry import se3
from taskcal.kinematics.inverse import find_postures, stretch_of
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.laws.robots import Case, cases, irb6660_description, irb6660_positions


def limited(case: Case) -> ErrorModel:
    """The robot of a case whose sliding joints have a travel that holds its positions."""
    joints = [
        {**joint, "limits_mm": [-500, 500]} if joint.get("type") == "prismatic" else joint
        for joint in case.description["joint"]
    ]
    return ErrorModel(robot_from({**case.description, "joint": joints}))


@given(cases(poses=20))
def test_no_posture_leads_beyond(case):
    model = limited(case)
    stretch = stretch_of(model)
    assert stretch.admits(model.poses(case.q)).all()
    if all(joint.get("type") != "prismatic" or "angle" not in joint for joint in case.description["joint"]):
        assert np.isfinite(stretch.longest)


def test_no_posture_of_a_parallelogram_leads_beyond():
    model = ErrorModel(robot_from(irb6660_description()))
    assert stretch_of(model).admits(model.poses(irb6660_positions(np.random.default_rng(0), 2000))).all()


def test_a_joint_that_slides_without_limits_reaches_anywhere():
    joints = [{"name": "J1", "type": "prismatic", "dh": {"alpha_deg": 0, "a_mm": 0, "d_mm": 0}}]
    model = ErrorModel(robot_from({"name": "rail", "joint": joints, "tool": []}))
    assert stretch_of(model).admits(se3.pose(np.eye(3), np.array([1e3, 0.0, 0.0]))[None]).all()


@pytest.mark.parametrize("name", ["abb-irb120", "kuka-kr16-2", "fanuc-m20ia", "staubli-rx160"])
def test_an_outstretched_arm_comes_near_to_it(name):
    """Arms with three axes through the wrist: their wrist's centre is what stretches farthest."""
    model = ErrorModel(load_robot(name))
    stretch = stretch_of(model)
    q = np.zeros((20000, 6))
    q[:, :3] = np.random.default_rng(0).uniform(-np.pi, np.pi, (20000, 3))
    T = model.poses(q)
    distance = np.linalg.norm(T[:, :3, :3] @ stretch.point + T[:, :3, 3] - stretch.centre, axis=1)
    assert 0.98 * stretch.longest < distance.max() <= stretch.longest


def test_what_lies_beyond_is_refused_without_a_search():
    model = ErrorModel(load_robot("abb-irb120"))
    T = se3.pose(np.eye(3), np.array([3.0, 0.0, 0.3]))
    began = time.process_time()
    for _ in range(100):  # a search takes some 20 ms
        with pytest.raises(ReachError, match="does not reach the tool pose at x 3000"):
            find_postures(model, T)
    assert time.process_time() - began < 0.5
