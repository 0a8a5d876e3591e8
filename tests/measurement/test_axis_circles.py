"""The classical registration from axis circles, against the truth and against the registration from all rows."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.identification.identify import identify
from taskcal.identification.validation import validate
from taskcal.measurement.axis_circles import register_from_circles
from taskcal.measurement.reader import read_campaign
from taskcal.measurement.registration import register
from taskcal.measurement.virtual_cell import simulate
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel

QUIET = np.array([0.3, 0.2, 0.25, 0.4, -0.7, 0.5])
OFFSETS = {"a": np.array([0.1, 0.02, 0.05]), "b": np.array([-0.08, 0.06, 0.0])}


def sweeps(joints=(0, 1), count=6):
    """Rows in which one joint turns at a time, and some in which all do."""
    rows = [QUIET + step * np.eye(6)[joint] for joint in joints for step in np.linspace(-0.4, 0.3, count)]
    rows += list(QUIET + 0.3 * np.random.default_rng(0).normal(size=(10, 6)))
    return np.array(rows)


@pytest.mark.parametrize("name", ["abb-irb6660-205-1.9", "abb-irb120", "ur5"])
def test_circles_of_an_exact_robot_give_frame_and_targets_exactly(name):
    model = ErrorModel(load_robot(name))
    # the forearm of the IRB 6660 keeps its direction while axis 2 turns: its coordinate 3 moves against it
    coupled = np.linalg.inv(model.robot.joint_map.matrix)
    q = sweeps()
    q[6:12] = QUIET + np.linspace(-0.3, 0.3, 6)[:, None] * coupled[:, 1]
    rng = np.random.default_rng(1)
    frame = se3.pose(se3.exp(rng.normal(size=3)), rng.normal(size=3))
    campaign, truth = simulate(model, q, rng=rng, x=np.zeros(len(model)), targets=OFFSETS, T_tracker_base=frame)
    found = register_from_circles(model, replace(campaign, points=truth.points(q)))
    np.testing.assert_allclose(found.T_tracker_base, frame, atol=1e-10)
    np.testing.assert_allclose(found.T_tool_target[:, :3, 3], np.stack(list(OFFSETS.values())), atol=1e-10)
    assert found.rms < 1e-10


def test_a_campaign_without_sweeps_says_what_is_missing():
    model = ErrorModel(load_robot("ur5"))
    q = QUIET + 0.3 * np.random.default_rng(0).normal(size=(20, 6))
    campaign, _ = simulate(model, q, rng=np.random.default_rng(0))
    with pytest.raises(CampaignError, match="only axis 1 turns"):
        register_from_circles(model, campaign)


@pytest.mark.realdata
def test_circles_of_two_axes_place_a_measured_robot_less_well_than_all_rows(data_folder):
    model = ErrorModel(load_robot("fanuc-r2000ic-165f"))
    campaign = read_campaign(data_folder / "fanuc_r2000_tracker/measurements.csv", model.robot)
    circles, all_rows = register_from_circles(model, campaign), register(model, campaign)
    assert 2.0 * all_rows.rms < circles.rms < 8e-3
    held = identify(model, campaign, registration=circles, frames="fixed")
    free = identify(model, campaign)
    assert validate(free, campaign).mean <= validate(held, campaign).mean < 2e-3
