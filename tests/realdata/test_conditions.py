"""What the order of measurement and nests tell on measured robots: mean error on held-out rows, in millimetres."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taskcal.identification.identify import identify
from taskcal.identification.validation import validate
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.drift import follow_nests
from taskcal.measurement.reader import read_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Backlash, Compliance, Effect, EncoderGain
from taskcal.robot.error_model import ErrorModel

pytestmark = pytest.mark.realdata

FOLDERS = {"abb-irb120": "irb120_faro", "barrett-wam": "wam_tracker"}


def campaign_of(data: Path, name: str) -> Campaign:
    targets = ["smr1"] if name == "abb-irb120" else None
    return read_campaign(data / FOLDERS[name] / "measurements.csv", load_robot(name), targets=targets)


def held_out_mm(campaign: Campaign, name: str, effects: Sequence[Effect], count: int) -> float:
    model = ErrorModel(load_robot(name))
    for effect in effects:
        model = model + effect

    def left(seed: int) -> float:
        order = np.random.default_rng(seed).permutation(len(campaign))
        fitted = identify(model, campaign.take(order[:count]))
        return validate(fitted, campaign.take(order[count:])).mean * 1e3

    return float(np.median([left(seed) for seed in range(3)]))


@pytest.mark.parametrize(
    ("name", "count", "beside", "bound_mm", "gain"),
    [
        pytest.param("abb-irb120", 430, (EncoderGain(), Compliance()), 0.315, 0.96, id="irb120"),
        pytest.param("barrett-wam", 151, (), 1.95, 0.85, id="wam"),
        pytest.param(
            "barrett-wam", 151, (EncoderGain(), Compliance()), 1.75, 0.85, id="wam, beside gain and compliance"
        ),
    ],
)
def test_the_side_from_which_the_joints_came_explains_much(data_folder, name, count, beside, bound_mm, gain):
    """It does so by the true order of the rows alone: with the sides of other rows nothing is gained."""
    campaign = campaign_of(data_folder, name)
    with_sides = held_out_mm(campaign, name, (*beside, Backlash()), count)
    without = held_out_mm(campaign, name, beside, count)
    assert with_sides <= bound_mm
    assert with_sides < gain * without
    mixed = replace(campaign, approach=np.random.default_rng(9).permutation(campaign.approach))
    assert held_out_mm(mixed, name, (*beside, Backlash()), count) > 0.99 * without


def test_the_first_axis_of_the_irb120_which_carries_no_load_has_the_most_backlash(data_folder):
    model = ErrorModel(load_robot("abb-irb120")) + EncoderGain() + Compliance() + Backlash()
    found = identify(model, campaign_of(data_folder, "abb-irb120"))
    first = model.names.index("J1.backlash")
    b, error = found.estimate[first:] * 1e3, found.standard_errors[first:] * 1e3
    assert b[0] == pytest.approx(0.49, abs=0.06)
    assert b[0] > 10 * error[0]
    assert (b[1:3] < 0.6 * b[0]).all()


def test_nests_of_the_irb120_move_with_the_arm_and_are_followed(data_folder):
    campaign = campaign_of(data_folder, "abb-irb120")
    found = follow_nests(campaign)
    assert found.followed
    assert found.noise == pytest.approx(2.7e-6, rel=0.1)
    assert found.largest == pytest.approx(6.7e-5, rel=0.1)
    assert found.remarks[0] == "nest base3 does not fit the others in 3 rows (id 50, 399, 720): taken for lost there"
    effects = (EncoderGain(), Compliance(), Backlash())
    ignored, followed = (held_out_mm(c, "abb-irb120", effects, 430) for c in (campaign, found.campaign))
    assert followed < ignored + 1e-3
