"""A compliance that was identified under one load predicts what another one does."""

import re

import numpy as np
import pytest

from taskcal.errors import TaskcalError
from taskcal.identification.calibration import load_calibration
from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Compliance, Coupling
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from taskcal.robot.statics import Load
from taskcal.virtual.cell import draw_defects, simulate

MASSES = (150.0, 110.0, 90.0, 30.0, 15.0, 5.0)
CENTRES = (
    (100.0, 0.0, -150.0),
    (350.0, 0.0, 80.0),
    (80.0, 120.0, 0.0),
    (0.0, 0.0, -350.0),
    (0.0, 30.0, 0.0),
    (0.0, 0.0, -30.0),
)
TRUE = np.array([0.9, 0.8, 1.1, 6.0, 7.0, 9.0]) * 1e-6
HEAVY = Load(mass=120.0, centre=(0.0, 0.0, 0.25))
CUT = Load(mass=20.0, centre=(0.0, 0.0, 0.15), force=(250.0, -300.0, -150.0))


@pytest.fixture(scope="module")
def robot():
    description = load_robot("fanuc-r2000ic-165f").description
    weighed = zip(description["joint"], MASSES, CENTRES, strict=True)
    joints = [{**joint, "mass_kg": mass, "centre_mm": list(centre)} for joint, mass, centre in weighed]
    tool = [{"tz_mm": 250.0}, {"tx_mm": 120.0}]
    tolerance = {"translation_mm": 0.3, "rotation_mrad": 0.3}
    return robot_from({**description, "joint": joints, "tool": tool, "tolerance": tolerance})


def poses(rng, count):
    return rng.uniform([-1.2, -0.6, -0.6, -1.5, -1.5, -2.0], [1.2, 0.7, 0.6, 1.5, 1.5, 2.0], (count, 6))


def test_calibration_predicts_pose_under_cutting_force(robot, tmp_path):
    """Under a cutting force the robot moves as its calibration under gravity predicts."""
    rng = np.random.default_rng(0)
    model = ErrorModel(robot) + Compliance(load=HEAVY)
    x = draw_defects(model, rng)
    x[-6:] = TRUE
    campaign, truth = simulate(model, poses(rng, 80), rng=rng, x=x)
    calibration = identify(model, campaign)
    found = dict(zip(calibration.names, calibration.estimate, strict=True))
    error = dict(zip(calibration.names, calibration.standard_errors, strict=True))
    for joint, true in zip(("J2", "J3"), TRUE[1:3], strict=True):
        assert abs(found[f"{joint}.compliance"] - true) < 3 * error[f"{joint}.compliance"] < 0.5 * true
    q = poses(rng, 60)
    at_tool = truth.T_tracker_base @ model.under(CUT).poses(q, x)
    unloaded = truth.T_tracker_base @ model.poses(q, x)
    cut = calibration.under(CUT)
    moved = at_tool[:, :3, 3] - unloaded[:, :3, 3]
    predicted = cut.predict(q)[:, 0] - calibration.predict(q)[:, 0]
    # J1 carries no weight, so that nothing is known of its compliance but the tolerance
    sideways = np.cross(
        np.broadcast_to(truth.T_tracker_base[:3, 2], moved.shape), at_tool[:, :3, 3] - truth.T_tracker_base[:3, 3]
    )
    sideways /= np.linalg.norm(sideways, axis=1, keepdims=True)
    left = predicted - moved
    left -= np.sum(left * sideways, axis=1, keepdims=True) * sideways
    assert np.linalg.norm(moved, axis=1).mean() > 2e-3
    assert np.linalg.norm(left, axis=1).mean() < 0.1 * np.linalg.norm(moved, axis=1).mean()
    cut.save(tmp_path / "cut.json")
    again = load_calibration(tmp_path / "cut.json")
    assert again.model.effects == (Compliance(load=CUT),)
    np.testing.assert_array_equal(again.predict(q), cut.predict(q))


def test_a_drive_that_yields_against_its_load_is_remarked(robot):
    rng = np.random.default_rng(3)
    model = ErrorModel(robot) + Compliance(load=HEAVY)
    x = draw_defects(model, rng)
    for sign, remarked in ((1.0, 0), (-1.0, 1)):
        x[-6:] = TRUE * [1, 1, sign, 1, 1, 1]
        campaign, _ = simulate(model, poses(rng, 60), rng=rng, x=x)
        remarks = [text for text in identify(model, campaign).remarks if "compliance" in text]
        assert len(remarks) == remarked
    assert remarks[0].startswith("the compliance of J3 is -1.")
    assert re.search(r" µrad/Nm \(standard error [\d.]+\), but no drive yields against its load", remarks[0])


def test_every_effect_is_kept_in_a_calibrations_file(robot, tmp_path):
    model = ErrorModel(robot) + Compliance(load=CUT) + Coupling(pairs=(("J4", "J5"),))
    rng = np.random.default_rng(1)
    campaign, _ = simulate(model, poses(rng, 40), rng=rng)
    calibration = identify(model, campaign)
    calibration.save(tmp_path / "cal.json")
    again = load_calibration(tmp_path / "cal.json")
    assert again.model.effects == model.effects
    assert again.model.robot.statics.links == robot.statics.links
    np.testing.assert_array_equal(again.predict(campaign.q), calibration.predict(campaign.q))


def test_without_masses_nothing_is_known_of_another_load():
    model = ErrorModel(load_robot("abb-irb120")) + Compliance()
    rng = np.random.default_rng(2)
    campaign, _ = simulate(model, rng.uniform(-0.8, 0.8, (40, 6)), rng=rng)
    with pytest.raises(TaskcalError, match="state mass_kg and centre_mm of every joint"):
        identify(model, campaign).under(CUT)
