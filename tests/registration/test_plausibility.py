"""Joints and points that do not belong together are refused with likely causes."""

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import CampaignError
from taskcal.registration.plausibility import _few_wrong_rows, check_plausible
from taskcal.registration.registration import register
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.laws.campaigns import measure
from tests.laws.robots import generators, industrial, industrial_positions


def arm(rng):
    return ErrorModel(robot_from(industrial(rng)))


WRONG = {
    "other variant": lambda q, points: (q, points, "abb-irb6660-130-3.1"),
    "other robot": lambda q, points: (q, points, "abb-irb120"),
    "other order of joints": lambda q, points: (q[:, ::-1], points, "ur5"),
    "other sign": lambda q, points: (q * [1, -1, 1, 1, 1, 1], points, "ur5"),
    "inches for millimetres": lambda q, points: (q, points / 25.4, "ur5"),
    "rows that do not belong together": lambda q, points: (q, points[::-1], "ur5"),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", WRONG)
def test_joints_and_points_of_other_robot_name_likely_causes(case):
    """Joints and points that do not belong to the robot are rejected with likely causes."""
    rng = np.random.default_rng(0)
    model = ErrorModel(load_robot("ur5"))
    sound, _ = measure(rng, model, industrial_positions(rng, 40), sigma=1e-4)
    check_plausible(register(model, sound), model, sound)
    q, points, name = WRONG[case](sound.q, sound.points)
    wrong = ErrorModel(load_robot(name))
    q = np.clip(q, -0.9, 0.9) if "6660" in name else q
    campaign = replace(sound, q=np.ascontiguousarray(q), points=points)
    with pytest.raises(
        CampaignError,
        match=rf"inconsistent with {name}: registration residual \d+\.\d mm rms.*Likely causes: another robot",
    ):
        check_plausible(register(wrong, campaign), wrong, campaign)


@settings(max_examples=6)
@given(generators)
def test_a_few_wrong_rows_are_named_instead_of_the_robot(rng):
    model = arm(rng)
    campaign, _ = measure(rng, model, industrial_positions(rng, 40), sigma=1e-4)
    points = campaign.points.copy()
    points[7] += 3.0
    points[21, :, 0] -= 2.0
    spoilt = replace(campaign, points=points)
    with pytest.raises(CampaignError, match=rf"2 of 40 rows cannot be right: row 7 \(id {campaign.ids[7]}\).*row 21"):
        check_plausible(register(model, spoilt), model, spoilt)


@pytest.mark.parametrize("seed", range(2))
def test_one_wrong_reflector_of_three_names_its_row(seed):
    rng = np.random.default_rng(seed)
    model = arm(rng)
    campaign, _ = measure(rng, model, industrial_positions(rng, 40), targets=3, sigma=1e-4)
    points = campaign.points.copy()
    points[11, 1] += [4.0, 0.0, 0.0]
    points[30, 2] -= [0.0, 3.5, 0.0]
    spoilt = replace(campaign, points=points)
    wrong = _few_wrong_rows(model, spoilt)
    assert [row for row, _ in wrong] == [11, 30]
    assert [distance for _, distance in wrong] == pytest.approx([4.0, 3.5], abs=0.02)


@pytest.mark.parametrize("noise", [0.0, 1e-6])
def test_positions_that_a_controller_calculates_are_refused(noise):
    rng = np.random.default_rng(3)
    model = arm(rng)
    campaign, _ = measure(rng, model, industrial_positions(rng, 30), targets=2, sigma=1e-4)
    points = campaign.points.copy()
    points[:, 1] = model.poses(campaign.q)[:, :3, 3] + noise * rng.normal(size=(30, 3))
    shown = replace(campaign, points=points, lines=np.arange(2, 32))
    with pytest.raises(CampaignError, match="target 'smr2' was calculated, not measured: the nominal robot fits it to"):
        check_plausible(register(model, shown), model, shown)


def test_a_nominal_robot_with_a_trackers_noise_is_accepted():
    rng = np.random.default_rng(4)
    model = arm(rng)
    campaign, _ = measure(rng, model, industrial_positions(rng, 30), sigma=2e-5)
    campaign = replace(campaign, lines=np.arange(2, 32))
    check_plausible(register(model, campaign), model, campaign)


@pytest.mark.parametrize(("measured", "digits"), [(False, 2), (False, 3), (True, 2), (True, 9)])
def test_check_plausible_refuses_what_only_digits_part(measured, digits):
    robot = load_robot("kuka-kr6-r900-sixx")
    model, rng = ErrorModel(robot), np.random.default_rng(5)
    q = np.radians(np.degrees(industrial_positions(rng, 30)).round(digits))
    exact = np.radians(np.degrees(q) + rng.uniform(-0.5, 0.5, q.shape) * 10.0**-digits)
    x = 0.3 * rng.normal(size=len(model.names)) * [p.tolerance for p in model.parameters] if measured else None
    points = model.poses(exact, x)[:, None, :3, 3]
    campaign = Campaign(ids=tuple(map(str, range(30))), q=q, targets=("tool",), points=points, lines=np.arange(2, 32))
    frame = register(model, campaign).T_tracker_base  # as points are fitted to the controller's own
    aligned = (points - frame[:3, 3]) @ frame[:3, :3]
    campaign = replace(campaign, points=np.round(aligned * 1e3, 2) * 1e-3)
    with nullcontext() if measured else pytest.raises(CampaignError, match="was calculated, not measured"):
        check_plausible(register(model, campaign), model, campaign)
