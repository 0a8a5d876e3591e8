"""Errors along a program: those that are predicted, and those to be expected, with where they come from."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.correction.controller import simulate_controller
from taskcal.correction.correction import Deviations, assess, budget_of
from taskcal.correction.frames import SOURCES, Uncertainty
from taskcal.correction.path import PlacedMotions
from taskcal.geometry import se3
from taskcal.identification.measured_range import MeasuredRange


def test_unknown_start_is_assessed_at_the_end_only(robot, make_moves, middle):
    """A way whose start is not known is assessed at its end only."""
    motions = make_moves([middle @ se3.translation(0.05 * k, 0.0, 0.0) for k in range(3)])
    trajectory = simulate_controller(robot, motions)
    placed = PlacedMotions.nominal(robot, motions)
    path = trajectory.path_on(placed, motions)
    start = path.segments.start.copy()
    start[1] = np.nan
    every, found = (
        assess(placed, path, trajectory),
        assess(placed, replace(path, segments=replace(path.segments, start=start)), trajectory),
    )
    assert (every.move == 1).sum() > 1
    assert found.at_target[found.move == 1].tolist() == [True]
    kept = every.at_target | (every.move != 1)
    np.testing.assert_array_equal(found.error, every.error[kept])
    np.testing.assert_array_equal(found.q, every.q[kept])


def test_a_motion_is_judged_where_any_joint_is_farthest_out():
    """Of each motion the row at which the joint that is farthest outside of what was measured is so."""
    rng, rows, motions = np.random.default_rng(1), 40, 6
    measured = MeasuredRange(
        joints=("a", "b"),
        prismatic=(False, False),
        low=-np.ones(2),
        high=np.ones(2),
        same_after_turn=np.zeros(2, dtype=bool),
    )
    q, move = rng.uniform(-3.0, 3.0, (rows, 2)), rng.integers(0, motions - 1, rows)
    every = Deviations(
        move=move,
        share=np.ones(rows),
        at_target=np.ones(rows, dtype=bool),
        q=q,
        error=np.zeros((rows, 3)),
        turn=np.zeros(rows),
    )
    found = every.farthest(measured, motions)
    assert np.isnan(found[-1]).all()
    for k in range(motions - 1):
        out = {tuple(row): max(0.0, *(abs(value) - 1.0 for value in row)) for row in q[move == k]}
        assert out[tuple(found[k])] == max(out.values())


def variances(*micrometres):
    return uncertain(np.array([micrometres, micrometres], dtype=float) ** 2 * 1e-12)


def uncertain(values):
    known = np.isfinite(values).all(axis=1)
    return Uncertainty(
        variances=values,
        weights=known / max(known.sum(), 1),
        common=np.zeros((1, 1)),
        single=values[:, 0],
        growth=np.ones(len(values)),
    )


def test_expected_errors_contain_the_uncertainty():
    """Expected errors contain the uncertainty before and after."""
    found = budget_of(np.array([3e-4, 3e-4]), np.zeros(2), variances(100, 200, 200, 0))
    assert found.uncertainty == pytest.approx(3e-4)
    assert found.after == pytest.approx(3e-4)
    assert found.before == pytest.approx(np.sqrt(2) * 3e-4)
    assert sum(found.shares.values()) == pytest.approx(1.0)
    assert found.shares["tool"] == pytest.approx(4 / 9)


@pytest.mark.parametrize(("correction", "uncertain"), [(2.9e-4, True), (3.1e-4, False)])
def test_a_correction_below_its_uncertainty_is_uncertain(correction, uncertain):
    found = budget_of(np.array([correction]), np.zeros(1), variances(100, 200, 200, 0))
    assert found.uncertain is uncertain


@pytest.mark.parametrize(
    ("source", "words"),
    list(zip(SOURCES, ("measure more poses", "--effects auto", "the tool", "the part"), strict=True)),
)
def test_the_remedy_is_for_the_largest_share(source, words):
    found = budget_of(np.ones(1), np.ones(1), variances(*(200 if name == source else 100 for name in SOURCES)))
    assert words in found.remedy


def test_targets_that_are_not_known_do_not_count():
    some = uncertain(np.array([[100, 200, 200, 0], [np.nan] * 4]) ** 2 * 1e-12)
    assert budget_of(np.ones(1), np.ones(1), some).uncertainty == pytest.approx(3e-4)
    assert budget_of(np.zeros(0), np.zeros(0), uncertain(np.full((2, 4), np.nan))).after == 0.0


@pytest.mark.parametrize("model_error", ["A", "B"])
def test_uncertainty_of_targets_is_the_expected_error(model_error):
    """The uncertainty of targets is what is expected after the correction."""
    found = budget_of(np.full(2, 1e-3), np.full(2, 4e-5), variances(100, 200, 0, 50))
    budget = found.of_targets(model_error)
    assert budget.combined == pytest.approx(found.after)
    assert [(one.evaluation, round(one.deviation * 1e6)) for one in budget.contributions] == [
        ("A", 100), (model_error, 200), ("B", 50), ("B", 40),
    ]  # fmt: skip
