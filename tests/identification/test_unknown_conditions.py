"""What is not told of a pose is in the covariance of its prediction, with the uncertainty of the effects that depend on it."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.conditions import Conditions, conditions_in_order
from taskcal.robot.effects import Backlash, Settling, Thermal, WarmUp
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate

ROBOT = load_robot("abb-irb120")


def positions(rng, count):
    return rng.uniform(-1.2, 1.2, (count, 6))


def reached(rng, *, count=40, pose=False):
    """A calibration with backlash and moves that do not settle."""
    model, q = ErrorModel(ROBOT) + Backlash() + Settling(), positions(rng, count)
    campaign, _ = simulate(model, q, rng=rng, pose=pose, conditions=conditions_in_order(ROBOT, q))
    return identify(model, campaign)


def untold(found, q, told=None):
    """Covariance of the targets by what is not told of the poses, beside the estimate's."""
    alone = replace(found, model_error=(0.0,) * len(found.model_error), joint_error=())
    return alone.predict_covariance(q, told) - alone.predict_covariance(q, told, model_error=False)


@pytest.mark.parametrize("told", [None, 1.0], ids=["nothing is told", "the side is told"])
def test_unknown_approach_covariance_matches_posterior_spread(told):
    """Unknown approach directions spread the targets as all directions and the posterior effects do; of a move whose side is told
    its size alone is unknown."""
    rng = np.random.default_rng(0)
    found = reached(rng)
    q, count = positions(rng, 1), 100
    side = None if told is None else Conditions(approach=np.ones((1, 6)))
    first = found.model.names.index("J1.backlash")
    moved = []
    for deviation in rng.multivariate_normal(np.zeros(12), found.covariance[first:, first:], count):
        x = found.estimate + np.concatenate([np.zeros(first), deviation])
        sides = rng.choice([-1.0, 1.0], (count, 6)) if told is None else np.ones((count, 6))
        ways = Conditions(approach=sides, move=sides * rng.random(sides.shape))
        ends = found.T_tracker_base @ found.model.poses(np.repeat(q, count, axis=0), x, ways) @ found.T_tool_target[0]
        known = found.model.poses(q, x, side)[0] if side is not None else found.tool_in_base(q)[0]
        moved.append(ends[:, :3, 3] - (found.T_tracker_base @ known @ found.T_tool_target[0])[:3, 3])
    moved = np.concatenate(moved)
    expected = moved.T @ moved / len(moved)
    stated = untold(found, q, side)[0, 0]
    np.testing.assert_allclose(stated, expected, atol=0.05 * np.trace(expected))


@pytest.mark.parametrize("pose", [False, True])
def test_each_joint_whose_way_is_not_told_adds_its_own_share(pose):
    """Where a side is told, but no move, only the move is uncertain; of a first row nothing is told."""
    rng = np.random.default_rng(1)
    found, q = reached(rng, pose=pose), positions(rng, 5)
    nothing = untold(found, q)
    told = conditions_in_order(ROBOT, positions(rng, 5))
    row_by_row = untold(found, q, told)
    np.testing.assert_allclose(row_by_row[0], nothing[0])
    np.testing.assert_array_equal(row_by_row[1:], 0.0)
    sides = untold(found, q, Conditions(approach=np.ones((5, 6))))
    some = untold(found, q, Conditions(approach=np.array([[1.0, 1.0, 1.0, 0.0, 0.0, 0.0]] * 5)))
    size = [np.trace(C[:, 0], axis1=1, axis2=2) for C in (sides, some, nothing)]
    assert np.all(size[0] > 0.0)
    assert np.all(size[0] < size[1])
    assert np.all(size[1] < size[2])


def test_unknown_temperature_widens_prediction_by_its_spread():
    """True errors over temperatures as they were in the campaign, which a prediction is not told."""
    rng = np.random.default_rng(2)
    model, temperature = ErrorModel(ROBOT) + Thermal(), rng.normal(24.0, 4.0, 60)
    told = Conditions(temperature=temperature)
    effect = Thermal().referred(told)
    model = ErrorModel(ROBOT) + effect
    campaign, truth = simulate(model, positions(rng, 60), rng=rng, conditions=told)
    found, q = identify(model, campaign), positions(rng, 400)
    others = Conditions(temperature=rng.normal(effect.reference, effect.spread, 400))
    error = (truth.points(q, others) - found.predict(q))[:, 0]
    C = found.predict_covariance(q)[:, 0]
    # all poses share the robot's expansion, so that one direction dominates
    square = np.einsum("ni,ni->n", error, np.linalg.solve(C, error[..., None])[..., 0])
    assert 0.93 < np.mean(square < 7.815) < 0.99
    known = found.predict_covariance(q, others)[:, 0]
    assert np.trace(known, axis1=1, axis2=2).mean() < 0.2 * np.trace(C, axis1=1, axis2=2).mean()
    half = Conditions(temperature=np.where(np.arange(400) < 200, np.nan, others.temperature))
    mixed = found.predict_covariance(q, half)[:, 0]
    np.testing.assert_allclose(mixed[:200], C[:200])
    np.testing.assert_array_equal(mixed[200:], known[200:])


def test_what_is_not_told_spreads_as_in_the_campaign():
    told = Conditions(temperature=np.array([20.0, 24.0, 22.0, 26.0]), time=np.array([0.0, 1800.0, 3600.0, 7200.0]))
    assert Thermal().referred(told).spread == pytest.approx(np.sqrt(5.0), abs=0.01)
    warm = WarmUp(time_constant=3600.0).referred(told)
    rise = warm.rise(told)
    assert warm.spread == pytest.approx(np.sqrt(np.mean(rise**2)), abs=1e-3)
    assert warm.rise(warm.off_reference(1)) == pytest.approx(-warm.spread)
    cold = WarmUp(time_constant=3600.0, reference=0.0)
    assert cold.rise(cold.off_reference(1)) == pytest.approx(0.0)
