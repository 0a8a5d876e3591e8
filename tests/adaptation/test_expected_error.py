"""The closed form of the expected task error, against simulation and against itself done the long way."""

import numpy as np
import pytest

from taskcal.adaptation.expected_error import design
from taskcal.adaptation.procedure import reference_task
from taskcal.identification.identify import identify
from taskcal.measurement.virtual_cell import simulate
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import reach_task


@pytest.fixture(scope="module")
def cell():
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    task = reference_task(np.radians(20.0))
    measured, unseen = reach_task(model, task, 40), reach_task(model, task, 60, seed=3)
    campaign, _ = simulate(model, measured.q, rng=np.random.default_rng(0), x=np.zeros(len(model)))
    return model, measured, unseen, design(model, campaign, unseen)


@pytest.mark.parametrize(
    "dropped", [(), ("J2.tz", "J3.tz", "J6"), ("J4.rx", "J3.ry", "J2.tx", "loop"), ("J1", "J2", "J3", "tool", "J5")]
)
def test_the_expected_error_is_the_mean_over_simulated_robots(cell, dropped):
    model, measured, unseen, made = cell
    kept = np.setdiff1d(np.arange(len(model)), model.indices(dropped) if dropped else [])
    squares = []
    for seed in range(200):
        campaign, truth = simulate(model, measured.q, rng=np.random.default_rng(seed))
        keep = [model.names[i] for i in kept]
        found = identify(model, campaign, keep=keep, model_error=0.0, prior_scale=1.0)
        squares.append(np.sum((found.predict(unseen.q) - truth.points(unseen.q)) ** 2, axis=2).mean())
    mean, standard_error = np.mean(squares), np.std(squares) / np.sqrt(len(squares))
    assert abs(mean - made.expected_error(kept) ** 2) < 4.0 * standard_error


def test_every_rung_of_the_ladder_drops_the_parameter_that_is_missed_least(cell):
    model, _, _, made = cell
    order, errors = made.ladder()
    kept = set(range(len(model)))
    for step, gone in enumerate(order):
        assert errors[step] == pytest.approx(made.expected_error(np.array(sorted(kept))), rel=1e-9)
        if step % 7 == 0:
            best = min(made.expected_error(np.array(sorted(kept - {j}), dtype=int)) for j in kept)
            assert made.expected_error(np.array(sorted(kept - {gone}), dtype=int)) <= best * (1 + 1e-6)
        kept.remove(gone)
    assert not kept
    assert errors[-1] == pytest.approx(made.before, rel=1e-9)


def test_with_the_right_prior_the_full_model_is_the_best(cell):
    _, _, _, made = cell
    _, errors = made.ladder()
    assert np.all(errors >= errors[0] * (1 - 1e-9))
    assert np.all(np.diff(errors) >= -1e-9 * errors[0])


def test_the_bound_is_the_posterior_covariance_of_the_fit(cell):
    model, measured, unseen, made = cell
    campaign, _ = simulate(model, measured.q, rng=np.random.default_rng(0), x=np.zeros(len(model)))
    found = identify(model, campaign, model_error=0.0, prior_scale=1.0)
    spread = found.predict_covariance(unseen.q, model_error=False)
    posterior = np.sqrt(np.trace(spread, axis1=2, axis2=3).mean())
    assert posterior == pytest.approx(made.expected_error(np.arange(len(model))), rel=1e-3)
