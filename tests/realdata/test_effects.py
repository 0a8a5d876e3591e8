"""What effects add on measured robots: mean error on held-out rows, in millimetres."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.special import chdtri

from taskcal.campaigns.campaign import Campaign
from taskcal.identification.effects import explain
from taskcal.identification.identify import identify
from taskcal.identification.residual_analysis import analyse_residuals
from taskcal.identification.validation import validate
from taskcal.reading.reader import read_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import PERIODIC, Compliance, Effect, EncoderGain, Harmonics, Settling
from taskcal.robot.error_model import ErrorModel

pytestmark = pytest.mark.realdata

FOLDERS = {
    "ur5": "ur5_tracker",
    "ur10": "ur10_tmac",
    "abb-irb120": "irb120_faro",
    "fanuc-r2000ic-165f": "fanuc_r2000_tracker",
    "barrett-wam": "wam_tracker",
}


@cache
def campaign_of(data: Path, name: str) -> Campaign:
    targets = ["smr1"] if name == "abb-irb120" else None
    return read_campaign(data / FOLDERS[name] / "measurements.csv", load_robot(name), targets=targets)


def model_of(name: str, effects: Sequence[Effect]) -> ErrorModel:
    model = ErrorModel(load_robot(name))
    for effect in effects:
        model = model + effect
    return model


def held_out_mm(data: Path, name: str, effects: Sequence[Effect], rows: float, *, splits: int = 3) -> float:
    campaign, model = campaign_of(data, name), model_of(name, effects)
    count = round(rows * len(campaign)) if rows < 1 else int(rows)

    def left(seed: int) -> float:
        order = np.random.default_rng(seed).permutation(len(campaign))
        fitted = identify(model, campaign.take(order[:count]))
        return validate(fitted, campaign.take(order[count:])).mean * 1e3

    return float(np.median([left(seed) for seed in range(splits)]))


SEVERAL_A_TURN = (PERIODIC, Compliance())


@pytest.mark.parametrize(
    ("name", "effects", "rows", "bound_mm"),
    [
        pytest.param("ur5", SEVERAL_A_TURN, 700, 0.060, id="ur5, 700 rows", marks=pytest.mark.long),
        pytest.param("ur5", SEVERAL_A_TURN, 60, 0.085, id="ur5, 60 rows"),
        pytest.param("abb-irb120", (EncoderGain(), Compliance()), 430, 0.345, id="irb120, 430 rows"),
        pytest.param("abb-irb120", (EncoderGain(), Compliance()), 60, 0.45, id="irb120, 60 rows"),
        pytest.param("ur10", (Harmonics(), *SEVERAL_A_TURN), 0.7, 0.12, id="ur10, 70 %", marks=pytest.mark.long),
    ],
)
def test_effects_explain_what_geometry_leaves(data_folder, name, effects, rows, bound_mm):
    assert held_out_mm(data_folder, name, effects, rows) <= bound_mm


@pytest.mark.slow
def test_effects_predict_each_fanuc_pose_leave_one_out(data_folder):
    """Each pose of the robot with coupled axes is predicted from all other poses, with two effects."""
    name = "fanuc-r2000ic-165f"
    campaign, model = campaign_of(data_folder, name), model_of(name, (Harmonics(), Compliance()))
    errors = []
    for row in range(len(campaign)):
        fitted = identify(model, campaign.take(np.setdiff1d(np.arange(len(campaign)), [row])))
        errors.append(validate(fitted, campaign.take([row])).errors)
    assert np.concatenate(errors).mean() * 1e3 <= 0.26


def test_irb120_residuals_are_unexplained_after_effects(data_folder):
    """With effects, the residuals of the IRB 120 are rigid motion that no regressor explains."""
    name = "abb-irb120"
    campaign = read_campaign(data_folder / FOLDERS[name] / "measurements.csv", load_robot(name))
    plain = analyse_residuals(identify(model_of(name, ()), campaign), campaign, permutations=19)
    assert {"approach of J1", "last move of J1"} == {e.regressor.name for e in plain.explained[:2]}
    effects = (EncoderGain(), Compliance(), Settling())
    found = analyse_residuals(identify(model_of(name, effects), campaign), campaign, permutations=19)
    assert found.non_rigid < 5e-6
    assert 0.2e-3 < found.rigid < 0.24e-3
    assert found.rms < 0.72 * plain.rms
    assert found.explained[0].share < 0.01


def test_wam_residuals_correlate_with_approach_of_joint_1(data_folder):
    """Without effects, the WAM's residuals correlate with the approach direction of its first joint."""
    campaign = campaign_of(data_folder, "barrett-wam")
    found = analyse_residuals(identify(model_of("barrett-wam", ()), campaign), campaign, permutations=19)
    first = found.explained[0]
    assert first.regressor.name == "approach of J1"
    assert first.share > 0.15
    assert first.p_value == pytest.approx(0.05)


TEN = (pytest.mark.long,)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "rows", "splits", "bound_mm"),
    [
        pytest.param("ur5", 60, 1, 0.073, id="ur5, 60 rows"),
        pytest.param("ur5", 60, 10, 0.071, id="ur5, 60 rows, ten splits", marks=TEN),
        pytest.param("ur5", 700, 1, 0.047, id="ur5, 700 rows", marks=TEN),
        pytest.param("abb-irb120", 60, 2, 0.305, id="irb120, 60 rows", marks=TEN),
        pytest.param("abb-irb120", 60, 10, 0.29, id="irb120, 60 rows, ten splits", marks=TEN),
        pytest.param("abb-irb120", 430, 1, 0.26, id="irb120, 430 rows", marks=TEN),
        pytest.param("barrett-wam", 0.7, 3, 1.43, id="wam, 70 %", marks=TEN),
        pytest.param("barrett-wam", 0.7, 10, 1.28, id="wam, 70 %, ten splits", marks=TEN),
        pytest.param("ur10", 0.7, 1, 0.09, id="ur10, 70 %", marks=TEN),
    ],
)
def test_auto_predicts_held_out_rows_with_nominal_coverage(data_folder, name, rows, splits, bound_mm):
    """All effects together predict held-out rows within the bound and with nominal coverage."""
    campaign, model = campaign_of(data_folder, name), ErrorModel(load_robot(name))
    count = round(rows * len(campaign)) if rows < 1 else int(rows)
    means, inside = [], []
    for seed in range(splits):
        order = np.random.default_rng(seed).permutation(len(campaign))
        held = campaign.take(order[count:])
        found = explain(model, campaign.take(order[:count])).calibration
        error = found.residuals_on(held)[held.valid][:, :3]
        C = found.predict_covariance(held.q, held.conditions) + held.covariances()
        solved = np.linalg.solve(C[held.valid][:, :3, :3], error[..., None])[..., 0]
        means.append(np.linalg.norm(error, axis=1).mean() * 1e3)
        inside.append(np.mean(np.einsum("ni,ni->n", error, solved) < chdtri(3, 0.05)))
    assert np.median(means) <= bound_mm
    assert 0.88 <= np.median(inside) <= 0.985


@pytest.mark.long
def test_auto_predicts_half_of_fanuc_poses_leave_one_out(data_folder):
    """All effects together predict every second pose of the coupled robot from all other poses."""
    name = "fanuc-r2000ic-165f"
    campaign, model = campaign_of(data_folder, name), ErrorModel(load_robot(name))
    errors = []
    for row in range(0, len(campaign), 2):
        found = explain(model, campaign.take(np.setdiff1d(np.arange(len(campaign)), [row]))).calibration
        errors.append(validate(found, campaign.take([row])).errors)
    assert np.concatenate(errors).mean() * 1e3 <= 0.14
