"""The closed loop on virtual robots."""

import numpy as np
import pytest

from taskcal.demo.closed_loop import LINES, largest_errors, prepare_closed_loop, run_closed_loop, summarise_runs
from taskcal.demo.closed_loop_report import draw_closed_loop, tabulate_closed_loop
from taskcal.demo.true_robot import Sizes
from taskcal.identification.identify import identify
from taskcal.robot.effects import SOFT, Backlash, Harmonics, WarmUp

pytestmark = pytest.mark.slow


def named_effects(model, campaign):
    """What the search finds on such robots, without the search."""
    expansion = WarmUp().referred(campaign.conditions)
    return identify(model + SOFT + Harmonics(tolerance=5e-5) + Backlash() + expansion, campaign)


@pytest.fixture(scope="module")
def loop(robot):
    return prepare_closed_loop(robot, poses=60, rows=3)


@pytest.fixture(scope="module")
def runs(loop):
    return [run_closed_loop(loop, seed, fit=named_effects) for seed in range(2)]


def test_the_corrected_program_is_several_times_better_than_the_touched_off_one(runs):
    found = largest_errors(runs)
    assert (found["as programmed"] > 1e-3).all()
    assert (found["touched off"] < 0.5 * found["as programmed"]).all()
    assert (found["corrected"] < 0.5 * found["touched off"]).all()
    assert (found["corrected"] < 0.15e-3).all()
    assert all(not run.correction.rejected for run in runs)


def test_the_truth_is_not_fitted_away(runs):
    """The tracker's noise alone would leave under 0.03 mm; what no effect describes stays."""
    found = largest_errors(runs)
    assert (found["corrected"] > 0.02e-3).all()


def test_the_true_errors_are_as_large_as_stated(runs):
    """The stated uncertainty is a root mean square; over two robots the true one is not far from it."""
    true = np.sqrt(np.mean([(run.after.length**2).mean() for run in runs]))
    stated = np.sqrt(np.mean([(run.correction.uncertainty[np.unique(run.after.move)] ** 2).mean() for run in runs]))
    assert 0.3 * stated < true < 2.0 * stated


def test_the_correction_does_not_know_the_truth(loop, runs):
    """What it predicts of the program as written is near the truth, not the truth."""
    for run in runs:
        predicted = run.correction.before.of_moves(np.array([move.kind != "axes" for move in loop.program.moves]))
        np.testing.assert_array_equal(predicted.q, run.before.q)
        off = np.linalg.norm(predicted.error - run.before.error, axis=1)
        assert 1e-5 < off.max() < 0.3e-3


def test_defects_of_geometry_alone_are_corrected_to_the_noise(loop):
    """The kindest case: the truth is in the class that is fitted."""
    nothing = Sizes(links=0.0, drives=0.0, gears=0.0, lost_motion=0.0, expansion=0.0)
    run = run_closed_loop(loop, 0, sizes=nothing, fit=identify)
    assert run.touched_off.length.max() > 4 * run.after.length.max()
    assert run.after.length.max() < 0.06e-3


def test_tables_figure_and_json_tell_the_same(runs):
    found = largest_errors(runs)
    table = tabulate_closed_loop(runs)
    for line, row in zip(LINES, table.groups[0][1], strict=False):
        assert line in str(row[0])
        assert float(str(row[1])) == pytest.approx(np.median(found[line]) * 1e3, abs=1e-4)
    marks = {trace.name: np.sort(trace.y) for trace in draw_closed_loop(found).data}
    assert len(marks) == 4
    for line in LINES:
        np.testing.assert_allclose(marks[line], np.sort(found[line]) * 1e3)
    for k, (row, run) in enumerate(zip(summarise_runs(runs), runs, strict=True)):
        for name, line in (("before", LINES[0]), ("touched_off", LINES[1]), ("after", LINES[2])):
            assert row[f"{name}_max_mm"] == pytest.approx(found[line][k] * 1e3)
        assert row["stated_mm"] == pytest.approx(found["stated"][k] * 1e3)
        assert len(row["effects"]) == len(run.calibration.model.effects) == 4
