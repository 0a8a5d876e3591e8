"""Points beside what was stated of them, and the decision whether a limit is kept."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import CampaignError
from taskcal.identification.identify import identify
from taskcal.identification.validation import (
    GUARD,
    STATISTICS,
    accept,
    examine,
    fitted_rows,
    off_stored_residuals,
    validate,
)
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from taskcal.virtual.cell import simulate
from tests.laws.campaigns import measure
from tests.laws.robots import industrial, industrial_positions


def case(seed=0, rows=160, **kind):
    calibration, held, _ = whole_case(seed, rows, **kind)
    return calibration, held


def whole_case(seed=0, rows=160, **kind):
    rng = np.random.default_rng(seed)
    model = ErrorModel(robot_from(industrial(rng)))
    x = rng.normal(size=len(model)) * model.tolerances
    campaign, _ = measure(rng, model, industrial_positions(rng, rows), x, sigma=5e-5, uncertainty=5e-5, **kind)
    fitted, held = campaign.split(0.6, rng)
    return identify(model, fitted), held, fitted


def joined(first, second):
    """The rows of both, as measured in one campaign."""
    both = {
        name: None if getattr(first, name) is None else np.concatenate([getattr(first, name), getattr(second, name)])
        for name in ("q", "points", "rotations", "uncertainty")
    }
    return Campaign(ids=tuple(map(str, range(len(both["q"])))), targets=first.targets, **both)


@pytest.mark.parametrize("kind", [{"targets": 3, "lost": 0.1}, {"pose": True, "rotation_sigma": 1e-4}])
def test_examination_repeats_validation_errors_and_coverage(kind):
    """Points have the errors of the validation, and the stated regions have their nominal coverage."""
    calibration, held = case(**kind)
    examined = examine(calibration, held)
    assert examined.validation.summary() == validate(calibration, held).summary()
    assert 0.88 <= examined.inside.mean() <= 0.99
    assert (examined.rotation_inside is not None) == ("pose" in kind)
    assert examined.outliers == ()
    points = examined.points()
    assert [p["error_mm"] for p in points] == pytest.approx(list(examined.validation.errors * 1e3))
    along = np.array([[p[f"{axis}_mm"] for axis in "xyz"] for p in points])
    np.testing.assert_allclose(np.linalg.norm(along, axis=1), [p["error_mm"] for p in points])
    np.testing.assert_allclose(
        1e-3 * along, calibration.residuals_on(held, frame="base")[held.valid][:, :3], atol=1e-12
    )
    turned = calibration.residuals_on(held)[held.valid][:, 3:]
    if turned.size:
        np.testing.assert_allclose([p["error_mrad"] for p in points], 1e3 * np.linalg.norm(turned, axis=1))
    lengths = [p["error_mm"] for p in points]
    assert [lengths[k] for k in examined.worst_first] == sorted(lengths, reverse=True)
    np.testing.assert_allclose(examined.uncertainty, 5e-5)
    assert [p["target"] for p in points] == [held.targets[t] for t in np.nonzero(held.valid)[1]]
    assert examined.summary()["inside_share"] == pytest.approx(np.mean([p["inside"] for p in points]))


def test_some_targets_in_another_order_keep_their_regions():
    calibration, held = case(targets=3)
    whole, some = examine(calibration, held), examine(calibration, held.of_targets(["smr3", "smr1"]))
    of_third = np.nonzero(held.valid)[1] == 2
    np.testing.assert_allclose(whole.studentised[of_third], some.studentised[some.targets == 0])


def test_examination_names_outlier_by_row_of_whole_campaign():
    """A wrong point is an outlier under its row number in the whole campaign."""
    calibration, held = case()
    points = held.points.copy()
    points[4, 0] += 1e-3
    examined = examine(calibration, replace(held, points=points))
    assert [o.row for o in examined.outliers] == [held.row_of(4)]
    assert examined.worst_first[0] == 4
    assert not examined.inside[4]


def test_refitted_frames_have_no_stated_regions():
    calibration, held = case()
    moved = replace(held, points=held.points + 1.0)
    examined = examine(calibration, moved, reregister=True)
    assert examined.inside is examined.studentised is None
    assert examined.validation.rms < 3e-4


def test_nothing_measured_is_refused():
    calibration, held = case()
    with pytest.raises(CampaignError, match="every beam was lost"):
        examine(calibration, replace(held, points=np.full_like(held.points, np.nan)))


@pytest.mark.parametrize("of", STATISTICS)
def test_the_guard_band_parts_pass_undecided_and_fail(of):
    examined = examine(*case())
    middle = accept(examined, 1.0, of)
    band = GUARD * 5e-5
    assert middle.most - middle.value == pytest.approx(band, rel=0.35)
    assert pytest.approx(norm.ppf(0.95), abs=1e-3) == GUARD
    decisions = {
        limit: accept(examined, limit, of)
        for limit in (middle.most * 1.001, middle.value, middle.least * 0.999, middle.most * 0.999)
    }
    assert [d.decision for d in decisions.values()] == ["pass", "undecided", "fail", "undecided"]
    assert [d.accepted for d in decisions.values()] == [True, False, False, False]
    summary = middle.summary()
    assert summary["value_mm"] + summary["guard_band_mm"] == pytest.approx(middle.most * 1e3)


def test_of_robots_right_at_the_limit_one_in_twenty_passes():
    """One point errs: its true error is the limit, its measured one that and the tracker's noise."""
    examined = examine(*case())
    rng = np.random.default_rng(1)
    limit, sigma, passed = 1e-3, 5e-5, 0
    first = np.arange(len(examined.validation)) == 0
    for error in limit + rng.normal(scale=sigma, size=1000):
        one = replace(
            examined,
            validation=replace(examined.validation, errors=np.where(first, error, 0.0)),
            uncertainty=np.where(first, sigma, 0.0),
        )
        passed += accept(one, limit, "max").accepted
    assert passed / 1000 == pytest.approx(0.05, abs=0.02)


KINDS = {"points": {}, "targets": {"targets": 3, "lost": 0.1}, "poses": {"pose": True, "rotation_sigma": 1e-4}}


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_rows_that_were_fitted_are_named_and_decide_nothing(kind):
    """In any order, under any name and written anew; the same poses measured again are others."""
    calibration, held, fitted = whole_case(**kind)
    rng = np.random.default_rng(4)
    mixed, order = joined(fitted, held), rng.permutation(len(fitted) + len(held))
    mixed = replace(
        mixed,
        ids=tuple(f"p{k}" for k in range(len(mixed))),
        q=np.round(mixed.q, 9)[order],
        points=np.round(mixed.points, 7)[order],
        uncertainty=mixed.uncertainty[order],
        rotations=None if mixed.rotations is None else mixed.rotations[order],
    )
    was = order < len(fitted)
    np.testing.assert_array_equal(fitted_rows(calibration, mixed), was)
    examined = examine(calibration, mixed)
    (remark,) = [one for one in examined.validation.remarks if "fitted to" in one]
    assert f"{was.sum()} of {len(mixed)} rows" in remark
    alone = accept(examine(calibration, mixed.take(np.flatnonzero(~was))), 1e-3)
    assert accept(examined, 1e-3).value == pytest.approx(alone.value, rel=1e-12)
    assert not any("fitted to" in one for one in validate(calibration, held).remarks)
    with pytest.raises(CampaignError, match=f"all {len(fitted)} rows are those that the calibration was fitted to"):
        accept(examine(calibration, fitted), 1.0)
    again = replace(fitted, points=fitted.points + rng.normal(scale=1e-5, size=fitted.points.shape))
    assert not fitted_rows(calibration, again).any()
    assert accept(examine(calibration, again), 1.0).accepted


@pytest.mark.parametrize("rows", [5, 8, 40])
def test_what_frames_take_of_the_errors_of_their_rows_is_accounted_for(rows):
    """Independent errors are found as large as they are, in the mean, from however few rows the frames are refitted."""
    rng = np.random.default_rng(0)
    model = ErrorModel(robot_from(industrial(rng)))
    q = industrial_positions(rng, 700)
    campaign, _ = measure(rng, model, q, np.zeros(len(model)), sigma=5e-5, uncertainty=5e-5)
    calibration = identify(model, campaign.take(range(60)))
    squares = []
    for k in range(15):
        chosen = campaign.take(60 + rng.permutation(640)[:rows])
        off = replace(chosen, points=chosen.points + rng.normal(scale=1e-3, size=chosen.points.shape))
        examined = examine(calibration, off, reregister=True)
        decided = accept(examined, 1.0)
        squares.append(decided.most**2)
        assert decided.most >= decided.value
        assert any("found from these" in one for one in examined.validation.remarks) == (rows < 30), k
    assert np.sqrt(np.mean(squares)) == pytest.approx(np.sqrt(3) * 1e-3, rel=0.25)


@pytest.mark.parametrize("limit", [0.0, -1.0, np.nan, np.inf])
def test_a_limit_that_is_none_is_refused(limit):
    with pytest.raises(ValueError, match="limit is"):
        accept(examine(*case()), limit)


MEASURED = {
    "points": {},
    "poses": {"pose": True},
    "wire": {"observe": "socket+wire"},
    "two": {"stations": 2},
    "two with poses": {"stations": 2, "pose": True},
}


@pytest.mark.parametrize("measured", [{}, {"observe": "socket"}, {"observe": "socket+wire"}])
def test_frames_that_were_held_are_examined_as_well(measured):
    """They have no error; what the rows themselves locate is theirs."""
    rng, model = np.random.default_rng(3), ErrorModel(load_robot("ur5"))
    x = 0.5 * rng.normal(size=len(model)) * model.tolerances
    campaign, _ = simulate(model, rng.uniform(-1.2, 1.2, (60, 6)), rng=rng, x=x, **measured)
    fit, held = (examine(identify(model, campaign, frames=frames), campaign) for frames in ("fit", "fixed"))
    assert held.inside.shape == fit.inside.shape
    assert (np.isfinite(held.inside) == np.isfinite(fit.inside)).all()
    assert (held.uncertainty[np.isfinite(fit.uncertainty)] > 0.0).all()


@pytest.mark.parametrize("measured", MEASURED.values(), ids=MEASURED)
def test_fitted_campaign_has_the_stored_residuals(measured):
    """To rounding, however it was measured; of other campaigns nothing is said."""
    rng, model = np.random.default_rng(3), ErrorModel(load_robot("ur5"))
    x = 0.5 * rng.normal(size=len(model)) * model.tolerances
    campaign, _ = simulate(model, rng.uniform(-1.2, 1.2, (40, 6)), rng=rng, x=x, **measured)
    calibration = identify(model, campaign)
    assert off_stored_residuals(calibration, campaign) < 1e-12
    assert off_stored_residuals(calibration, campaign.take(range(30))) is None
    moved = replace(calibration, z=calibration.z + 1e-6)
    assert off_stored_residuals(moved, campaign) > 1e-7
