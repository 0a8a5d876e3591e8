"""The classical registration from axis circles, against the truth and against the registration from all rows."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.identification.identify import identify
from taskcal.identification.validation import validate
from taskcal.reading.reader import read_campaign
from taskcal.registration.circles import find_circles, register_from_circles
from taskcal.registration.registration import register
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate

QUIET = np.array([0.3, 0.2, 0.25, 0.4, -0.7, 0.5])
OFFSETS = {"a": np.array([0.1, 0.02, 0.05]), "b": np.array([-0.08, 0.06, 0.0])}


def sweeps(joints=(0, 1), count=6):
    """Rows in which one joint turns at a time, and some in which all do."""
    rows = [QUIET + step * np.eye(6)[joint] for joint in joints for step in np.linspace(-0.4, 0.3, count)]
    rows += list(QUIET + 0.3 * np.random.default_rng(0).normal(size=(10, 6)))
    return np.array(rows)


@pytest.mark.parametrize("name", ["abb-irb6660-205-1.9", "abb-irb120", "ur5"])
def test_circles_of_exact_robot_register_exactly(name):
    """The circles of an exact robot give the exact tracker frame and targets."""
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
    with pytest.raises(CampaignError, match="only one axis turns"):
        register_from_circles(model, campaign)


@pytest.mark.parametrize("name", ["abb-irb6660-205-1.9", "abb-irb120", "ur5", "fanuc-r2000ic-165f"])
def test_sweeps_of_single_motors_give_frame_and_targets_exactly(name):
    """Behind a parallelogram the tool keeps its orientation while motor 2 turns, and still describes a circle."""
    model = ErrorModel(load_robot(name))
    campaign, truth = simulate(
        model, sweeps(range(6)), rng=np.random.default_rng(1), x=np.zeros(len(model)), targets=OFFSETS
    )
    exact = replace(campaign, points=truth.points(campaign.q))
    found = register_from_circles(model, exact)
    np.testing.assert_allclose(found.T_tracker_base, truth.T_tracker_base, atol=1e-10)
    np.testing.assert_allclose(found.T_tool_target[:, :3, 3], np.stack(list(OFFSETS.values())), atol=1e-10)
    circles = find_circles(model, exact)
    assert {(circle.axis, circle.target) for circle in circles} == {(axis, t) for axis in range(6) for t in range(2)}
    assert max(circle.residual for circle in circles) < 1e-10


def test_parallelogram_motor_circle_has_lower_arm_radius():
    """Motor 2 of the parallelogram draws a circle with the radius of the lower arm."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    campaign, _ = simulate(model, sweeps((1,)), rng=np.random.default_rng(1), x=np.zeros(len(model)))
    (circle,) = find_circles(model, campaign)
    assert (circle.axis, circle.radius) == (1, pytest.approx(0.7, abs=2e-4))
    assert circle.arc == pytest.approx(0.7)


def test_inexact_parallelogram_is_compared_with_own_motion():
    """With a rod 2 mm too long the TCP leaves the circle by some tenths of a millimetre: no error of the frame."""
    robot = load_robot("abb-irb6660-205-1.9")
    bar = replace(robot.four_bar.bar, rod=robot.four_bar.bar.rod + 2e-3)
    model = ErrorModel(replace(robot, four_bar=replace(robot.four_bar, bar=bar)))
    campaign, truth = simulate(model, sweeps(range(6)), rng=np.random.default_rng(1), x=np.zeros(len(model)))
    found = register_from_circles(model, replace(campaign, points=truth.points(campaign.q)))
    np.testing.assert_allclose(found.T_tracker_base, truth.T_tracker_base, atol=1e-9)


def test_circles_of_parallel_axes_do_not_turn_the_base():
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    campaign, _ = simulate(model, sweeps((1, 2)), rng=np.random.default_rng(1))
    with pytest.raises(CampaignError, match="only J2, J3 were swept"):
        register_from_circles(model, campaign)


def test_circles_that_leave_the_base_free_name_the_direction():
    """Motor 2 of a parallelogram does not turn the tool: a higher target and a lower base look alike."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    campaign, _ = simulate(model, sweeps((0, 1)), rng=np.random.default_rng(1))
    with pytest.raises(CampaignError, match=r"does not place the base along \(0\.00, 0\.00, 1\.00\)"):
        register_from_circles(model, campaign)


def test_circles_with_lost_beams_use_the_visible_rows():
    """Circles with lost beams are those of the rows with a measured point."""
    model = ErrorModel(load_robot("ur5"))
    campaign, truth = simulate(
        model, sweeps(range(6), 9), rng=np.random.default_rng(1), x=np.zeros(6 * 7), targets=OFFSETS
    )
    points = truth.points(campaign.q)
    points[::4, 1] = np.nan
    found = register_from_circles(model, replace(campaign, points=points))
    np.testing.assert_allclose(found.T_tracker_base, truth.T_tracker_base, atol=1e-10)


@pytest.mark.realdata
def test_circles_of_all_axes_register_nearly_as_all_rows(data_folder):
    """Circles of all axes register a measured robot nearly as accurately as all rows do."""
    model = ErrorModel(load_robot("fanuc-r2000ic-165f"))
    campaign = read_campaign(data_folder / "fanuc_r2000_tracker/measurements.csv", model.robot)
    circles, all_rows = register_from_circles(model, campaign), register(model, campaign)
    assert {circle.axis for circle in find_circles(model, campaign)} == set(range(6))
    assert all_rows.rms < circles.rms < 1e-3
    held = identify(model, campaign, registration=circles, frames="fixed")
    free = identify(model, campaign)
    assert validate(free, campaign).mean <= validate(held, campaign).mean < 6e-4
