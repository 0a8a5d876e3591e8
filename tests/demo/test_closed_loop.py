"""The closed loop on virtual robots."""

import numpy as np
import pytest

from taskcal.demo.closed_loop import furnish, go_round, largest


@pytest.fixture(scope="module")
def shop(robot):
    return furnish(robot, poses=60, rows=3)


@pytest.fixture(scope="module")
def trips(shop):
    return [go_round(shop, seed) for seed in range(3)]


def test_two_millimetres_become_a_tenth(trips):
    found = largest(trips)
    assert np.median(found["before"]) > 1.5e-3
    assert np.median(found["after"]) < 1e-4
    assert all(not trip.correction.refused for trip in trips)


def test_the_true_errors_are_as_large_as_stated(trips):
    """The stated uncertainty is a root mean square; over three robots the true one is not far from it."""
    true = np.sqrt(np.mean([(trip.after.length**2).mean() for trip in trips]))
    stated = np.sqrt(np.mean([(trip.correction.uncertainty[np.unique(trip.after.move)] ** 2).mean() for trip in trips]))
    assert 0.3 * stated < true < 2.0 * stated


def test_the_correction_does_not_know_the_truth(shop, trips):
    """What it predicts of the program as written is near the truth, not the truth."""
    for trip in trips:
        predicted = trip.correction.before.of_moves(np.array([move.kind != "axes" for move in shop.program.moves]))
        np.testing.assert_array_equal(predicted.q, trip.before.q)
        off = np.linalg.norm(predicted.error - trip.before.error, axis=1)
        assert 1e-6 < off.max() < 2e-4
