"""The file of a registration: read back exactly, and refused where it does not belong to the robot or the campaign."""

import json
from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import FileError
from taskcal.identification.calibration import load_calibration
from taskcal.identification.identify import identify
from taskcal.registration.registration import register
from taskcal.registration.registration_file import load_registration, save_registration
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate

Q = np.array([0.3, 0.2, 0.25, 0.4, -0.7, 0.5]) + 0.3 * np.random.default_rng(0).normal(size=(12, 6))


@pytest.fixture(scope="module")
def model():
    return ErrorModel(load_robot("ur5"))


@pytest.fixture
def saved(model, tmp_path):
    campaign, _ = simulate(model, Q, rng=np.random.default_rng(1), targets={"a": np.zeros(3), "b": np.full(3, 0.1)})
    registration = register(model, campaign)
    save_registration(tmp_path / "reg.json", registration, model, campaign)
    return tmp_path / "reg.json", registration, campaign


def test_a_registration_comes_back_to_the_last_digit(model, saved):
    path, registration, campaign = saved
    found = load_registration(path, model, campaign)
    for name in ("T_tracker_base", "T_tool_target", "unobservable"):
        np.testing.assert_array_equal(getattr(found, name), getattr(registration, name))
    assert found.rms == registration.rms
    assert (registration.method, registration.file) == ("poses", "")
    assert (found.method, found.file) == ("poses", "reg.json")


def test_a_calibration_says_how_its_registration_was_found(model, saved, tmp_path):
    path, registration, campaign = saved
    save_registration(path, replace(registration, method="circles"), model, campaign)
    known = load_registration(path, model, campaign)
    identify(model, campaign, registration=known, keep=[]).save(tmp_path / "cal.json")
    again = load_calibration(tmp_path / "cal.json").layout.registration
    assert (again.method, again.file) == ("circles", "reg.json")


def test_a_file_from_before_methods_were_written_is_of_poses(model, saved):
    path, _, campaign = saved
    content = json.loads(path.read_text())
    del content["registration"]["method"], content["registration"]["file"]
    path.write_text(json.dumps(content))
    assert load_registration(path, model, campaign, unsealed=True).method == "poses"


def test_another_robot_is_refused(saved):
    path, _, campaign = saved
    with pytest.raises(FileError, match=r"of ur5 with digest .*; this robot is ur10"):
        load_registration(path, ErrorModel(load_robot("ur10")), campaign)


def test_other_targets_are_refused(model, saved):
    path, _, campaign = saved
    with pytest.raises(FileError, match=r"of the targets a, b; the campaign has b"):
        load_registration(path, model, campaign.of_targets(["b"]))


def test_points_do_not_register_poses(model, saved):
    path, _, campaign = saved
    with pytest.raises(FileError, match="of measured points; the campaign has poses"):
        load_registration(path, model, replace(campaign, rotations=np.tile(np.eye(3), (len(Q), 1, 1))))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": "taskcal calibration"}, "not a registration"),
        ({"format_version": 1}, "format version 1"),
        ({"targets": ["a"]}, "T_tool_target"),
        ({"registration": {}}, "T_tracker_base"),
    ],
)
def test_an_edited_file_is_refused(model, saved, change, message):
    path, _, campaign = saved
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(FileError, match=message):
        load_registration(path, model, campaign, unsealed=True)


def test_a_frame_that_shears_is_refused(model, saved):
    path, _, campaign = saved
    content = json.loads(path.read_text())
    content["registration"]["T_tracker_base"][0][0] += 0.01
    path.write_text(json.dumps(content))
    with pytest.raises(FileError, match="not a rigid transform"):
        load_registration(path, model, campaign, unsealed=True)
