from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taskcal.errors import CampaignError
from taskcal.identification.identify import identify
from taskcal.identification.validation import reregister_frames, validate
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.laws.campaigns import measure
from tests.laws.robots import industrial, industrial_positions

KINDS = {
    "one target": {},
    "three targets": {"targets": 3, "lost": 0.1},
    "poses": {"pose": True, "rotation_sigma": 1e-4},
}


def calibrated(kind, seed=0):
    rng = np.random.default_rng(seed)
    model = ErrorModel(robot_from(industrial(rng)))
    x = rng.normal(size=len(model)) * model.tolerances
    campaign, truth = measure(rng, model, industrial_positions(rng, 120), x, sigma=5e-5, **KINDS[kind])
    fitted, held = campaign.split(0.5, rng)
    return rng, model, identify(model, fitted), held, truth


@pytest.mark.parametrize("kind", KINDS)
def test_the_report_is_what_the_predictions_say_by_hand(kind):
    _, _, calibration, held, _ = calibrated(kind)
    found = validate(calibration, held)
    predicted = calibration.predict(held.q)
    ends = predicted[:, None, :3, 3] if kind == "poses" else predicted
    error = (held.points - ends)[held.valid]
    length = np.sqrt((error**2).sum(axis=1))
    np.testing.assert_allclose(found.errors, length, atol=1e-12)
    assert found.mean == pytest.approx(length.sum() / len(length))
    assert found.rms == pytest.approx(np.sqrt((length**2).sum() / len(length)))
    assert found.maximum == pytest.approx(length.max())
    below = np.linspace(0.0, 1.0, len(length))  # share of the others that are shorter
    assert found.p95 == pytest.approx(np.interp(0.95, below, np.sort(length)))
    in_base = error @ calibration.T_tracker_base[:3, :3]
    np.testing.assert_allclose(found.per_axis, np.abs(in_base).max(axis=0), atol=1e-12)
    assert found.rows == tuple(np.nonzero(held.valid)[0])
    summary = found.summary()
    assert summary["n"] == held.valid.sum() == len(found)
    for key, value in {
        "mean_mm": found.mean,
        "rms_mm": found.rms,
        "p95_mm": found.p95,
        "max_mm": found.maximum,
    }.items():
        assert summary[key] == pytest.approx(1e3 * value)
    assert [summary[f"max_{a}_mm"] for a in "xyz"] == pytest.approx(list(1e3 * found.per_axis))
    if kind != "poses":
        assert found.rotations is None
        return
    instrument = Rotation.from_rotvec(calibration.z[-3:])
    turned = Rotation.from_matrix(held.rotations) * (instrument * Rotation.from_matrix(predicted[:, :3, :3])).inv()
    np.testing.assert_allclose(found.rotations, turned.magnitude(), atol=1e-9)
    assert summary["max_mrad"] == pytest.approx(1e3 * turned.magnitude().max())


@pytest.mark.parametrize("kind", KINDS)
def test_held_out_rows_are_predicted_to_the_noise(kind):
    _, _, calibration, held, _ = calibrated(kind)
    # three axes of 50 µm, and what the fit itself does not know
    assert 0.8 < validate(calibration, held).rms / (np.sqrt(3) * 5e-5) < 1.6


@pytest.mark.parametrize("kind", KINDS)
def test_validation_reregisters_moved_tracker_and_target(kind):
    """A moved tracker and target need a new registration; the geometry keeps its values."""
    rng, model, calibration, _, truth = calibrated(kind)
    q = industrial_positions(rng, 60)
    moved, _ = measure(rng, model, q, truth.x, sigma=5e-5, **KINDS[kind])
    assert validate(calibration, moved).mean > 0.1
    found = validate(calibration, moved, reregister=True)
    assert found.rms / (np.sqrt(3) * 5e-5) < 1.6
    renamed = replace(moved, targets=tuple(f"other {t}" for t in range(len(moved.targets))))
    np.testing.assert_allclose(validate(calibration, renamed, reregister=True).errors, found.errors)
    one = moved.of_targets(moved.targets[:1])
    frames = reregister_frames(calibration, one)
    shapes = frames.T_tool_target.shape[:1], frames.residuals.shape[1:2], frames.studentised.shape[1:]
    assert shapes == ((1,),) * 3  # of what was measured now; the fit's residuals hold in its own frames
    assert np.isnan(frames.residuals).all()


def test_some_of_the_targets_in_any_order_can_be_validated():
    _, _, calibration, held, _ = calibrated("three targets")
    whole = validate(calibration, held)
    some = validate(calibration, held.of_targets(["smr3", "smr1"]))
    row, target = np.nonzero(held.valid)
    np.testing.assert_allclose(np.sort(some.errors), np.sort(whole.errors[target != 1]))
    assert set(some.rows) <= set(row.tolist())


def test_a_target_the_calibration_does_not_know_is_named():
    _, _, calibration, held, _ = calibrated("three targets")
    other = replace(held, targets=("smr1", "probe", "smr3"))
    with pytest.raises(
        CampaignError, match=r"target 'probe' is not in the calibration, which knows smr1, smr2, smr3; .*--reregister"
    ):
        validate(calibration, other)


def test_a_campaign_without_a_single_point_is_refused():
    _, _, calibration, held, _ = calibrated("one target")
    nothing = replace(held, points=np.full_like(held.points, np.nan))
    with pytest.raises(CampaignError, match="no measured point to compare with: every beam was lost"):
        validate(calibration, nothing)


def test_too_few_rows_to_reregister_are_refused():
    _, _, calibration, held, _ = calibrated("one target")
    with pytest.raises(CampaignError, match="too few"):
        validate(calibration, held.take(slice(0, 3)), reregister=True)


@pytest.mark.parametrize(("rotation_sigma", "turn_mrad"), [(5e-3, 0.0), (1e-4, 2.0)], ids=["noisy", "turned"])
def test_reregistered_positions_are_as_exact_beside_rotations(rotation_sigma, turn_mrad):
    """Rotations that the fit took for inexact, or for turned against the positions, do not shift the positions."""
    rng = np.random.default_rng(0)
    model = ErrorModel(robot_from(industrial(rng)))
    q = industrial_positions(rng, 120)
    x = rng.normal(size=len(model)) * model.tolerances
    campaign, _ = measure(rng, model, q, x, sigma=5e-5, pose=True, rotation_sigma=rotation_sigma)
    turn = Rotation.from_rotvec([turn_mrad * 1e-3, 0.0, -turn_mrad * 1e-3]).as_matrix()
    fitted, held = replace(campaign, rotations=turn @ campaign.rotations).split(0.5, rng)
    calibration = identify(model, fitted)
    both = validate(calibration, held, reregister=True)
    positions = validate(calibration, replace(held, rotations=None), reregister=True)
    assert both.mean == pytest.approx(positions.mean, rel=0.02)
    assert both.rotations.mean() == pytest.approx(validate(calibration, held).rotations.mean(), rel=0.1)
