"""What the order of measurement, reference points and time tell on measured robots: mean error on held-out rows, in millimetres."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from taskcal.campaigns.campaign import Campaign
from taskcal.campaigns.drift import compensate_drift
from taskcal.identification.identify import identify
from taskcal.identification.validation import validate
from taskcal.reading.reader import read_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import (
    PERIODIC,
    Backlash,
    Compliance,
    Effect,
    EncoderGain,
    Harmonics,
    Overshoot,
    Settling,
    WarmUp,
)
from taskcal.robot.error_model import ErrorModel
from tests.laws.campaigns import with_conditions

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
    ("name", "count", "beside", "way", "bound_mm", "gain"),
    [
        pytest.param(
            "abb-irb120",
            430,
            (EncoderGain(), Compliance()),
            Settling(),
            0.295,
            0.91,
            id="irb120, 430 rows",
            marks=pytest.mark.long,
        ),
        pytest.param("abb-irb120", 60, (EncoderGain(), Compliance()), Settling(), 0.385, 0.93, id="irb120, 60 rows"),
        pytest.param(
            "abb-irb120",
            430,
            (EncoderGain(), Compliance()),
            Overshoot(),
            0.285,
            0.87,
            id="irb120, overshoot",
            marks=pytest.mark.long,
        ),
        pytest.param("barrett-wam", 151, (), Backlash(), 1.90, 0.85, id="wam"),
        pytest.param(
            "barrett-wam",
            151,
            (Harmonics(orders=(1,)), EncoderGain(), Compliance()),
            Backlash(),
            1.65,
            0.80,
            id="wam, beside other effects",
            marks=pytest.mark.long,
        ),
    ],
)
def test_the_way_to_each_pose_explains_much(data_folder, name, count, beside, way, bound_mm, gain):
    """It does so by the true order of the rows alone: with the ways to other rows nothing is gained."""
    campaign = campaign_of(data_folder, name)
    explained = held_out_mm(campaign, name, (*beside, way), count)
    without = held_out_mm(campaign, name, beside, count)
    assert explained <= bound_mm
    assert explained < gain * without
    mixed = np.random.default_rng(9).permutation(len(campaign))
    elsewhere = with_conditions(campaign, approach=campaign.approach[mixed], move=campaign.move[mixed])
    assert held_out_mm(elsewhere, name, (*beside, way), count) > 0.99 * without


def test_evidence_separates_backlash_from_settling(data_folder):
    """The evidence supports settling on the IRB 120 and lost motion on the WAM."""
    for name, right, wrong in (("abb-irb120", Settling(), Backlash()), ("barrett-wam", Backlash(), Settling())):
        model, campaign = ErrorModel(load_robot(name)) + EncoderGain() + Compliance(), campaign_of(data_folder, name)
        gain = [identify(model + way, campaign).log_evidence for way in (right, wrong)]
        assert gain[0] > gain[1] + 50.0


@pytest.mark.parametrize("name", ["abb-irb120", "barrett-wam"])
def test_evidence_supports_overshoot_over_settling(data_folder, name):
    """The evidence supports an error by speed over one by length of the last move."""
    model, campaign = ErrorModel(load_robot(name)) + EncoderGain() + Compliance(), campaign_of(data_folder, name)
    overshoot, settling = (identify(model + way, campaign).log_evidence for way in (Overshoot(), Settling()))
    assert overshoot > settling + 50.0


def test_the_first_axes_of_the_irb120_keep_a_rest_of_each_move(data_folder):
    model = ErrorModel(load_robot("abb-irb120")) + EncoderGain() + Compliance() + Settling()
    found = identify(model, campaign_of(data_folder, "abb-irb120"))
    first = model.names.index("J1.settling")
    rest, error = found.estimate[first : first + 3] * 1e3, found.standard_errors[first : first + 3] * 1e3
    np.testing.assert_allclose(rest, [0.45, 0.41, 0.35], atol=0.1)
    assert (rest > 5 * error).all()


def test_irb120_reference_points_drift_and_are_followed(data_folder):
    """The reference points of the IRB 120 move with the arm and are followed."""
    campaign = campaign_of(data_folder, "abb-irb120")
    found = compensate_drift(campaign)
    assert found.followed
    assert found.noise == pytest.approx(2.7e-6, rel=0.1)
    assert found.largest == pytest.approx(6.7e-5, rel=0.1)
    assert (
        found.remarks[0] == "reference point base3 does not fit the others in 3 rows (id 50, 399, 720): rejected there"
    )
    effects = (EncoderGain(), Compliance(), Settling())
    ignored, followed = (held_out_mm(c, "abb-irb120", effects, 430) for c in (campaign, found.campaign))
    assert followed < ignored + 1e-3


def test_lengths_of_the_ur5_change_while_it_is_measured(data_folder):
    """In the order of the rows, taken as evenly paced; with the times of other rows nothing is gained."""
    campaign = read_campaign(data_folder / "ur5_tracker" / "measurements.csv", load_robot("ur5"))
    count = len(campaign)
    model = ErrorModel(load_robot("ur5")) + Compliance() + PERIODIC + Backlash()
    warm_up = WarmUp(time_constant=0.1 * count, reference=float(count))
    order = np.random.default_rng(0).permutation(count)

    def fit(effects: ErrorModel, time: np.ndarray):
        timed = with_conditions(campaign, time=time)
        found = identify(effects, timed.take(order[:700]))
        return found, validate(found, timed.take(order[700:])).mean * 1e3

    rows = np.arange(count, dtype=float)
    (without, before), (found, after) = fit(model, rows), fit(model + warm_up, rows)
    assert found.log_evidence > without.log_evidence + 100.0
    assert after < 0.96 * before
    assert after <= 0.048
    expansion = found.names.index("thermal.expansion")
    assert found.estimate[expansion] == pytest.approx(-2.4e-4, abs=1e-4)
    assert found.estimate[expansion] < -5.0 * found.standard_errors[expansion]
    _, mixed = fit(model + warm_up, np.random.default_rng(9).permutation(rows))
    assert mixed > 0.99 * before
