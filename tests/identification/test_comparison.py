"""What changed between two calibrations: the robot, not frames, targets or the choice of parameters."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import TaskcalError
from taskcal.identification.comparison import compare
from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import EncoderGain
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.laws.campaigns import measure
from tests.laws.robots import industrial

RNG = np.random.default_rng(0)
MODEL = ErrorModel(robot_from(industrial(RNG)))
TRUE = RNG.normal(size=len(MODEL)) * MODEL.tolerances


def calibrated(seed, x=TRUE, model=MODEL, rows=60, **kind):
    """Another tracker, other targets and other poses each time."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-1.2, 1.2, (rows, 6))
    campaign, _ = measure(rng, MODEL, q, x, sigma=3e-5, uncertainty=3e-5, **kind)
    return identify(model, campaign, model_error=0.0, prior_scale=1.0)


def changed(name, amount):
    x = TRUE.copy()
    x[MODEL.names.index(name)] += amount
    return x


@pytest.mark.parametrize("second", [{}, {"targets": 3}, {"pose": True, "rotation_sigma": 5e-5}])
def test_compare_reports_unchanged_robot_for_any_setup(second):
    """A robot without changes is reported as unchanged, whatever the tracker frame, targets and poses."""
    first = calibrated(1)
    for one, other in ((first, calibrated(2, **second)), (calibrated(2, **second), first)):
        compared = compare(one, other)
        assert compared.verdict == "unchanged"
        assert compared.rms < 2.0 * compared.expected
        assert not compared.is_due(1e-6)


@pytest.mark.parametrize(
    "model", [MODEL, MODEL + EncoderGain(), ErrorModel(MODEL.robot, lengths_only=False)], ids=["same", "gains", "again"]
)
@pytest.mark.parametrize(("name", "amount"), [("J2.rz", 4e-4), ("J5.tx", 3e-4)])
def test_what_was_hit_is_found_in_size_and_place(model, name, amount):
    before, after = calibrated(1), calibrated(2, changed(name, amount), model)
    compared = compare(before, after)
    assert compared.verdict == "changed"
    assert compared.chance < 1e-6
    moved = MODEL.jacobian(compared.q)[:, :3, MODEL.names.index(name)] * amount
    assert 0.2 < compared.rms / np.sqrt(np.mean(np.sum(moved**2, axis=1))) < 1.2
    assert compared.resembles[0].share > 0.8
    named = {r.name: r for r in compared.resembles}
    assert name not in named or named[name].amount == pytest.approx(amount, rel=0.3)
    assert compared.is_due(0.3 * compared.rms)
    assert not compared.is_due(2.0 * compared.rms)


def test_a_calibration_is_itself():
    one = calibrated(1)
    compared = compare(one, one)
    assert compared.rms < 1e-12
    assert compared.chance == pytest.approx(1.0)
    assert all(p.over_sigma == 0.0 for p in compared.parameters)
    assert compared.resembles == ()


def test_frames_that_moved_far_do_not_count():
    """Base and tool differ by parameters that frames can stand for: lift the robot, lengthen the tool."""
    one = calibrated(1)
    z = one.z.copy()
    for name, amount in (("J1.tz", 5e-3), ("tool.tx", 3e-3), ("tool.tz", -8e-3)):
        z[one.names.index(name)] += amount
    compared = compare(one, replace(one, z=z))
    assert compared.rms < 1e-9
    moved = {p.name: p for p in compared.parameters}
    assert moved["J1.tz"].second - moved["J1.tz"].first == pytest.approx(5e-3)


def test_chance_is_as_often_small_as_it_says_or_more_seldom():
    low = [compare(calibrated(2 * k, rows=30), calibrated(2 * k + 1, rows=30)).chance < 0.2 for k in range(1, 7)]
    assert np.mean(low) <= 0.5


def test_compare_reports_small_change_below_model_error():
    """A difference below the model error of the two calibrations is reported as small."""
    before, after = calibrated(1), calibrated(2, changed("J2.rz", 4e-4))
    vague = replace(after, model_error=(1e-3,))
    assert compare(before, vague).verdict == "small"
    assert compare(before, vague).summary()["verdict"] == "small"


def test_compare_rejects_other_joints_and_nominal_geometry():
    """Robots with other joints are rejected; robots with other nominal geometry share no parameters."""
    one = calibrated(1)
    seven = replace(one, model=ErrorModel(load_robot("barrett-wam")))
    with pytest.raises(TaskcalError, match="calibrations of one robot can be compared"):
        compare(one, seven)
    description = industrial(np.random.default_rng(5))
    other = ErrorModel(robot_from(description))
    elsewhere = compare(one, replace(one, model=other, layout=replace(one.layout, model=other)))
    assert elsewhere.parameters == ()
    assert "nominal robots differ" in elsewhere.remarks[0]


def test_a_comparison_is_summarised_in_the_units_that_its_keys_name():
    compared = compare(calibrated(1), calibrated(2, changed("J2.rz", 4e-4)))
    said = compared.summary()
    length = np.linalg.norm(compared.difference, axis=2)
    assert said["max_mm"] == pytest.approx(1e3 * length.max())
    assert said["rms_mm"] == pytest.approx(1e3 * np.sqrt(np.mean(length**2)))
    assert said["expected_mm"] == pytest.approx(1e3 * compared.expected)
    assert said["unexplained_mm"] == pytest.approx(1e3 * compared.unexplained)
    assert compared.excess**2 == pytest.approx(compared.rms**2 - compared.expected**2)
    assert (said["poses"], said["chance"]) == (len(compared.q), compared.chance)
    per = {"mm": 1e3, "mrad": 1e3}
    for told, one in zip(said["parameters"], compared.parameters, strict=True):
        factor = per[told["unit"]]
        assert told["unit"] == ("mm" if one.name.split(".")[1].startswith("t") else "mrad")
        assert (told["first"], told["second"]) == pytest.approx((factor * one.first, factor * one.second))
        assert told["standard_error"] == pytest.approx(factor * one.standard_error)
        assert told["over_sigma"] == pytest.approx((one.second - one.first) / one.standard_error)
    for told, other in zip(said["resembles"], compared.resembles, strict=True):
        assert (told["name"], told["share"]) == (other.name, other.share)
        assert told["amount"] == pytest.approx(per[told["unit"]] * other.amount)
    sigmas = [abs(one.over_sigma) for one in compared.parameters]
    assert sigmas == sorted(sigmas, reverse=True)
