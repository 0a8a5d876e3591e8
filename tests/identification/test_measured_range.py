"""Poses outside of what was measured: which joint, on which side, and by how much."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import CampaignError
from taskcal.identification.calibration import load_calibration
from taskcal.identification.measured_range import MeasuredRange, describe_outside, name_rows
from taskcal.identification.validation import examine
from taskcal.robot.effects import EncoderGain, Harmonics
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal.robot.robot_file import robot_from
from tests.laws.robots import industrial, industrial_positions

STORED = Path(__file__).parent / "stored" / "calibration.json"


def range_of(model: ErrorModel, q: np.ndarray) -> MeasuredRange:
    return MeasuredRange.of_rows(model.robot, q, model.jacobian)


def arm(rng: np.random.Generator, limits: tuple[float, float] | None = None) -> Robot:
    described = industrial(rng)
    if limits is not None:
        described["joint"] = [{**joint, "limits_deg": list(limits)} for joint in described["joint"]]
    return robot_from(described)


@pytest.mark.parametrize("seed", range(3))
def test_beyond_is_the_signed_distance_to_the_measured_interval(seed: int) -> None:
    """Rows that were measured are inside, and clipping a pose by what lies beyond brings it to the nearest measured end."""
    rng = np.random.default_rng(seed)
    q, other = industrial_positions(rng, 30), 2.0 * industrial_positions(rng, 200)
    measured = MeasuredRange.of_rows(arm(rng, (-170.0, 170.0)), q)
    assert not measured.beyond(q).any()
    np.testing.assert_allclose(other - measured.beyond(other), np.clip(other, q.min(axis=0), q.max(axis=0)), atol=1e-12)
    assert (measured.outside(other) == (np.abs(measured.beyond(other)).max(axis=1) > np.radians(0.5))).all()


def test_whole_turn_is_outside_only_if_the_model_tells_it() -> None:
    """Geometry and whole gear orders repeat after a turn; the encoder's gain and a gear order of 1.5 do not."""
    rng = np.random.default_rng(3)
    robot = arm(rng, (-350.0, 350.0))
    q = industrial_positions(rng, 25)
    turned = q + 2.0 * np.pi * np.eye(6)[3] * np.where(q[:, 3] > 0.0, -1.0, 1.0)[:, None]
    for model in (ErrorModel(robot), ErrorModel(robot) + Harmonics(joints=("J4",), orders=(1, 2))):
        assert not range_of(model, q).outside(turned).any()
    gain = range_of(ErrorModel(robot) + EncoderGain(joints=("J4",)), q)
    assert gain.same_after_turn.tolist() == [True, True, True, False, True, True]
    assert gain.outside(turned).all()


def test_joint_without_limits_is_measured_on_the_shortest_arc() -> None:
    """A joint that counts from 0° to 360° and was measured about 0° was not measured at 180°."""
    rng = np.random.default_rng(4)
    robot = arm(rng)
    assert np.isinf(robot.limits).all()
    q = np.radians(rng.uniform(-20.0, 20.0, (40, 6)))
    counted = np.remainder(q, 2.0 * np.pi)
    measured = range_of(ErrorModel(robot), counted)
    np.testing.assert_allclose(measured.low, q.min(axis=0), atol=1e-12)
    np.testing.assert_allclose(measured.high, q.max(axis=0), atol=1e-12)
    assert measured.outside(np.full((1, 6), np.pi)).all()
    assert not measured.outside(counted).any()


def test_sentence_names_joint_amount_and_side() -> None:
    robot = arm(np.random.default_rng(5), (-170.0, 170.0))
    measured = MeasuredRange.of_rows(robot, np.radians([[0, -12, 0, 0, 0, 0], [10, 3.5, 0, 0, 0, 0]]))
    q = np.radians([[5, 0, 0, 0, 0, 0], [5, 4, 0, 0, 0, 0], [12, -23, 0, 0, 0, 0]])
    assert measured.sentence(q[2]) == "J2 lies 11.0° below what was measured (−12.0° to 3.5°)"
    assert measured.sentence(q[0]) == ""
    said = measured.warning(q, name_rows(range(3), ["0", "1", "p30"]))
    assert said.startswith(
        "1 of 3 poses is outside the measured joint range, row 2 (p30) farthest: J2 lies 11.0° below"
    )
    assert measured.warning(q[:2], ["row 0", "row 1"]) == ""
    assert [describe_outside(entry) for entry in measured.farthest(q)] == ["", "", "J2 −11.0°"]
    assert measured.farthest(q)[2] == pytest.approx({"outside_joint": "J2", "outside_deg": -11.0})
    unknown = np.vstack([q, np.full(6, np.nan)])
    assert measured.outside_rows(unknown).tolist() == [2]
    assert measured.warning(unknown, ["a", "b", "c", "d"]).startswith("1 of 4 poses")
    assert measured.summary()[1] == pytest.approx({"joint": "J2", "low_deg": -12.0, "high_deg": 3.5}, abs=1e-12)


def test_stored_calibration_knows_its_range_and_refuses_without_rows() -> None:
    calibration = load_calibration(STORED)
    measured = calibration.measured_range
    assert not measured.beyond(calibration.q).any()
    np.testing.assert_array_equal(measured.low, calibration.q.min(axis=0))
    with pytest.raises(CampaignError, match="no fitted rows"):
        MeasuredRange.of_rows(calibration.model.robot, calibration.q[:0])


def test_examination_divides_errors_by_the_measured_range() -> None:
    """Figures of rows inside and outside make up those of all; a campaign inside alone has neither."""
    calibration = load_calibration(STORED)
    far = calibration.q + np.radians(40.0) * np.eye(6)[0] * (np.arange(len(calibration.q)) % 2)[:, None]
    rng = np.random.default_rng(6)
    points = calibration.predict(far) + 1e-4 * rng.normal(size=(len(far), len(calibration.targets), 3))
    campaign = Campaign(ids=calibration.ids, q=far, targets=calibration.targets, points=points)
    examination = examine(calibration, campaign)
    outside = calibration.measured_range.outside(far)
    assert 0 < outside.sum() < len(far)
    summary = examination.summary()
    inner, outer = summary["inside_range"], summary["outside_range"]
    assert outer["n"] == summary["outside_points"] == int(outside.sum()) * len(calibration.targets)
    assert inner["n"] + outer["n"] == summary["n"]
    assert inner["n"] * inner["mean_mm"] + outer["n"] * outer["mean_mm"] == pytest.approx(
        summary["n"] * summary["mean_mm"]
    )
    share = inner["n"] * inner["inside_share"] + outer["n"] * outer["inside_share"]
    assert share == pytest.approx(summary["n"] * summary["inside_share"])
    assert f"{outside.sum()} of {len(far)} poses" in " ".join(examination.validation.remarks)
    assert {row["outside_joint"] for row in summary["rows"]} == {"", "J1"}
    within = examine(calibration, replace(campaign, q=calibration.q, points=calibration.predict(calibration.q) + 1e-4))
    assert within.by_range() == {}
    assert within.validation.remarks == ()
