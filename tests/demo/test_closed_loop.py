"""The closed loop on virtual robots."""

import numpy as np
import pytest

from taskcal.demo.closed_loop import largest_errors, prepare_closed_loop, run_closed_loop


@pytest.fixture(scope="module")
def loop(robot):
    return prepare_closed_loop(robot, poses=60, rows=3)


@pytest.fixture(scope="module")
def runs(loop):
    return [run_closed_loop(loop, seed) for seed in range(3)]


def test_two_millimetres_become_a_tenth(runs):
    found = largest_errors(runs)
    assert np.median(found["before"]) > 1.5e-3
    assert np.median(found["after"]) < 1e-4
    assert all(not run.correction.refused for run in runs)


def test_the_true_errors_are_as_large_as_stated(runs):
    """The stated uncertainty is a root mean square; over three robots the true one is not far from it."""
    true = np.sqrt(np.mean([(run.after.length**2).mean() for run in runs]))
    stated = np.sqrt(np.mean([(run.correction.uncertainty[np.unique(run.after.move)] ** 2).mean() for run in runs]))
    assert 0.3 * stated < true < 2.0 * stated


def test_the_correction_does_not_know_the_truth(loop, runs):
    """What it predicts of the program as written is near the truth, not the truth."""
    for run in runs:
        predicted = run.correction.before.of_moves(np.array([move.kind != "axes" for move in loop.program.moves]))
        np.testing.assert_array_equal(predicted.q, run.before.q)
        off = np.linalg.norm(predicted.error - run.before.error, axis=1)
        assert 1e-6 < off.max() < 2e-4
