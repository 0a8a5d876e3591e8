"""The closed loop on virtual robots: small, with effects by name; the search for them, and 20 robots, are `taskcal demo --full`."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from taskcal.identification.identify import identify
from taskcal.robot.effects import SOFT, Backlash, Harmonics, WarmUp
from taskcal_demo.closed_loop import (
    LINES,
    RADIUS_95,
    StatedAndTrue,
    errors_by_line,
    largest_errors,
    prepare_closed_loop,
    rms,
    run_closed_loop,
    run_closed_loops,
    share_within,
    stated_errors,
    summarise_runs,
)
from taskcal_demo.closed_loop_report import closed_loop_page, draw_closed_loop, tabulate_closed_loop
from taskcal_demo.true_robot import UNKIND, Sizes
from tests.report.drawn import series


def named_effects(model, campaign, backlash=True):
    """What the search finds on such robots, without the search."""
    growth = WarmUp().referred(campaign.conditions)
    found = model + SOFT + Harmonics(tolerance=5e-5) + growth
    return identify(found + Backlash() if backlash else found, campaign)


@pytest.fixture(scope="module")
def loop(robot):
    return prepare_closed_loop(robot, poses=50, rows=2, candidates=60)


@pytest.fixture(scope="module")
def runs(loop):
    return [run_closed_loop(loop, seed, fit=named_effects) for seed in range(1)]


def test_correction_halves_touch_off_error(runs):
    """The error of the corrected program is less than half that of the touched-off program."""
    found = largest_errors(runs)
    assert (found["as programmed"] > 1e-3).all()
    assert (found["touched off"] < 0.5 * found["as programmed"]).all()
    assert (found["corrected"] < 0.5 * found["touched off"]).all()
    assert (found["corrected"] < 0.15e-3).all()
    assert all(not run.correction.rejected for run in runs)


def test_the_truth_is_not_fitted_away(runs):
    """The tracker's noise alone would leave under 0.03 mm; what no effect describes stays."""
    assert (largest_errors(runs)["corrected"] > 0.02e-3).all()


def test_the_true_errors_are_as_large_as_stated(runs):
    """Root mean square against root mean square, and the points against the radius that is to hold 95 % of them."""
    true = rms(np.concatenate([run.after.length for run in runs]))
    stated = rms(np.concatenate([stated_errors(run) for run in runs]))
    assert 0.3 * stated < true < 1.5 * stated
    assert np.mean([share_within(run) for run in runs]) > 0.85


def test_radius_95_covers_95_percent_of_isotropic_errors():
    """The radius covers 95 % of isotropic normal errors."""
    errors = np.random.default_rng(0).normal(size=(100_000, 3))
    length = np.linalg.norm(errors, axis=1)
    assert (length <= RADIUS_95 * rms(length)).mean() == pytest.approx(0.95, abs=0.003)


def test_the_correction_does_not_know_the_truth(loop, runs):
    """What it predicts of the touched-off program is near the truth, not the truth."""
    for run in runs:
        predicted = run.correction.before.of_moves(np.array([move.kind != "axes" for move in loop.program.motions]))
        np.testing.assert_array_equal(predicted.q, run.touched_off.q)
        off = np.linalg.norm(predicted.error - run.touched_off.error, axis=1)
        assert 1e-5 < off.max() < 0.2e-3


@pytest.mark.long
def test_correction_follows_approach_direction_of_drives(loop):
    """Of a robot with twice the lost motion a good part is taken off, and the middle between both sides is no match."""
    lost = Sizes(links=0.0, drives=0.0, gears=0.0, lost_motion=2.0, expansion=0.0)
    left = {
        backlash: run_closed_loop(loop, 1, sizes=lost, fit=partial(_geometry, backlash=backlash)).after
        for backlash in (True, False)
    }
    assert rms(left[True].length) < 0.7 * rms(left[False].length)


def _geometry(model, campaign, *, backlash):
    return identify(model + Backlash() if backlash else model, campaign)


def test_defects_of_geometry_alone_are_corrected_to_the_noise(loop):
    """The kindest case: the truth is in the class that is fitted."""
    nothing = Sizes(links=0.0, drives=0.0, gears=0.0, lost_motion=0.0, expansion=0.0)
    run = run_closed_loop(loop, 0, sizes=nothing, fit=identify)
    assert run.touched_off.length.max() > 4 * run.after.length.max()
    assert run.after.length.max() < 0.06e-3


@pytest.mark.long
def test_an_interrupted_run_goes_on_with_the_calibrations_it_has(loop, runs, tmp_path, monkeypatch):
    monkeypatch.setattr("taskcal_demo.closed_loop.find_effects", lambda model, campaign: runs[0].calibration)
    whole = run_closed_loops(loop, [0], fits=tmp_path / "robots")
    assert len(list((tmp_path / "robots").iterdir())) == 1

    def never(model, campaign):
        raise AssertionError("fitted again")

    monkeypatch.setattr("taskcal_demo.closed_loop.find_effects", never)
    again = run_closed_loops(loop, [0], fits=tmp_path / "robots")
    for line in LINES:
        np.testing.assert_array_equal(errors_by_line(again[0])[line].error, errors_by_line(whole[0])[line].error)
        np.testing.assert_allclose(errors_by_line(again[0])[line].error, errors_by_line(runs[0])[line].error, atol=1e-8)
    other = replace(loop, q=loop.q[:-1])
    with pytest.raises(AssertionError, match="fitted again"):
        run_closed_loops(other, [0], fits=tmp_path / "robots")


def test_tables_figure_and_json_tell_the_same(runs):
    found = largest_errors(runs)
    table = tabulate_closed_loop(runs)
    for line, row in zip(LINES, table.groups[0][1], strict=False):
        assert line in str(row[0])
        assert float(str(row[1])) == pytest.approx(np.median(found[line]) * 1e3, abs=1e-4)
    marks = {one.name: np.sort(one.y) for one in series(draw_closed_loop(found))}
    assert len(marks) == 4
    for line in LINES:
        np.testing.assert_allclose(marks[line], np.sort(found[line]) * 1e3)
    for k, (row, run) in enumerate(zip(summarise_runs(runs), runs, strict=True)):
        for name, line in (("before", LINES[0]), ("touched_off", LINES[1]), ("after", LINES[2])):
            assert row[f"{name}_max_mm"] == pytest.approx(found[line][k] * 1e3)
        assert (
            row["stated_95_mm"]
            == pytest.approx(found["stated"][k] * 1e3)
            == pytest.approx(RADIUS_95 * row["stated_mm"])
        )
        assert row["within_95"] == share_within(run)
        assert len(row["effects"]) == len(run.calibration.model.effects) == 4


def test_page_says_what_is_kind_and_whether_the_statement_held_for_unkind_truths(loop, runs):
    """Of a robot twice as large, by figures that are computed here from its runs; beside one whose statement is taken away."""
    twice = run_closed_loop(loop, 0, sizes=UNKIND["twice as large"], fit=named_effects)
    assert twice.touched_off.length.max() == pytest.approx(2.0 * runs[0].touched_off.length.max(), rel=0.1)
    found = StatedAndTrue.of([twice])
    assert found.rms == pytest.approx(np.sqrt((twice.after.length**2).mean()))
    assert found.within == pytest.approx(share_within(twice))
    unsure = replace(twice, correction=replace(twice.correction, uncertainty=0.2 * twice.correction.uncertainty))
    assert not StatedAndTrue.of([unsure]).held
    sure = replace(twice, correction=replace(twice.correction, uncertainty=9.0 * twice.correction.uncertainty))
    assert StatedAndTrue.of([sure]).held
    page = closed_loop_page(
        loop, runs, unkind={"twice as large": [unsure], "axis wobble": [sure]}, next_steps=""
    ).html()
    assert "no force of the process" in page
    assert "Twice as large: what was stated did not hold; robot by robot on 0 of 1." in page
    assert "Axis wobble: what was stated held; robot by robot on 1 of 1." in page
    assert "Unkind truths" not in closed_loop_page(loop, runs, next_steps="").html()
