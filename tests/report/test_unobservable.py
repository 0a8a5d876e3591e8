"""The sentence says where the target was taken, and holds for the place that the fit gives it."""

import numpy as np
import pytest

from taskcal.demo.procedure import reference_task
from taskcal.geometry import se3
from taskcal.identification.identify import identify
from taskcal.report.calibration import Beside, calibration_page, describe_unobservable
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import reach_task
from taskcal.virtual.cell import simulate

MODEL = ErrorModel(load_robot("abb-irb6660-205-1.9"))
FAR = {"a": np.array([0.6, -0.7, 0.4]), "b": np.array([0.65, -0.7, 0.4]), "c": np.array([0.6, -0.6, 0.45])}


def fitted(q, targets):
    campaign, _ = simulate(MODEL, q, rng=np.random.default_rng(0), targets=targets)
    return identify(MODEL, campaign, target_within=2.0)


def said(calibration):
    return describe_unobservable(calibration.layout.registration)


def one_orientation():
    return reach_task(MODEL, reference_task(), 40).q


def about_one_axis():
    """The tool turns about its own axis alone."""
    q = one_orientation()
    q[:, 5] += np.linspace(-1.5, 1.5, len(q))
    return q


def turning_axis(q):
    """The direction in the tool frame that no pose turns."""
    R = MODEL.poses(q)[:, :3, :3]
    turns = se3.log(R[0].T @ R[1:])
    return np.linalg.svd(turns)[2][0]


def test_nothing_is_said_where_the_poses_turn_every_way():
    calibration = fitted(reach_task(MODEL, reference_task(np.radians(20.0)), 40).q, {"a": FAR["a"]})
    assert said(calibration) == ("",)
    assert calibration.T_tool_target[0, :3, 3] == pytest.approx(FAR["a"], abs=5e-3)


def test_a_target_that_no_direction_locates_is_taken_at_the_tool_point():
    calibration = fitted(one_orientation(), {"a": FAR["a"]})
    assert said(calibration) == ("offset not identifiable from these poses; held at the tool point",)
    assert np.linalg.norm(calibration.T_tool_target[0, :3, 3]) < 1e-5


def test_a_target_a_metre_away_is_at_the_tool_point_in_the_one_direction_that_is_named():
    q = about_one_axis()
    calibration = fitted(q, {"a": FAR["a"]})
    (sentence,) = said(calibration)
    assert sentence.endswith("held at the tool point there")
    axis = turning_axis(q)
    place = calibration.T_tool_target[0, :3, 3]
    assert np.linalg.norm(place) > 0.5
    assert abs(axis @ place) < 2e-3
    named = sentence.split("along ")[1].split(" of the tool")[0]
    direction = np.eye(3)["xyz".index(named)] if named in "xyz" else np.array(named.strip("()").split(), dtype=float)
    assert abs(direction @ axis) > 0.999


def test_of_several_targets_only_the_middle_is_taken_at_the_tool_point():
    calibration = fitted(one_orientation(), FAR)
    (sentence,) = set(said(calibration))
    assert sentence == "common offset of all targets not identifiable from these poses; held at the tool point"
    places = calibration.T_tool_target[:, :3, 3]
    assert np.linalg.norm(places.mean(axis=0)) < 1e-5
    expected = np.array(list(FAR.values()))
    assert np.linalg.norm(places[1] - places[0]) == pytest.approx(np.linalg.norm(expected[1] - expected[0]), abs=5e-4)


def test_the_page_says_it_of_each_target():
    calibration = fitted(one_orientation(), FAR)
    page = calibration_page(calibration, Beside(), version="0").html()
    assert all(f"Target {name}: common offset of all targets not identifiable" in page for name in FAR)
    assert ": offset not identifiable" not in page
