"""A verdict's interval holds the error that a robot turns out to have, and its decision follows from it."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.correction import frames
from taskcal.correction.correction import ErrorBudget
from taskcal.correction.verdict import Judgement, judge
from taskcal.demo.procedure import reference_task
from taskcal.identification.held_out import HeldOut
from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, reach_task
from taskcal.virtual.cell import simulate
from tests.realdata.test_effects import campaign_of


def budget(left=0.0, spread=0.0, **variances):
    sources = ("geometry", "model error", "tool", "part")
    return ErrorBudget(
        correction=0.0,
        left=left,
        variances={name: variances.get(name.replace(" ", "_"), 0.0) for name in sources},
        variance_of_mean_square=spread,
    )


def test_interval_holds_the_errors_of_the_posterior(calibration, perturbed, monkeypatch):
    """Of robots drawn from the posterior, 95 % have an error over the task inside the interval, if that is taken at its word."""
    monkeypatch.setattr(frames, "RELATIVE_UNCERTAINTY", 0.0)
    task = reference_task(np.radians(20.0))
    verdict = judge(calibration, task)
    poses = reach_task(calibration.model, task)
    rng = np.random.default_rng(0)
    draws = rng.multivariate_normal(calibration.z, calibration.z_covariance, 300, method="eigh")
    held = {
        "measured target": lambda one: one.target_poses(poses.q)[:, 0],
        "tool point": lambda one: one.predict_tool(poses.q),
    }
    for judgement in verdict.judgements[:2]:
        where, (low, high) = held[judgement.subject], judgement.budget.interval
        about = where(calibration)[:, :3, 3]
        squares = []
        for z in draws:
            error = where(perturbed(calibration, z))[:, :3, 3] - about
            error += rng.normal(size=error.shape) * calibration.model_error[0]
            squares.append(poses.weights @ (error**2).sum(axis=1))
        rms = np.sqrt(squares)
        assert np.sqrt(np.mean(squares)) == pytest.approx(judgement.budget.after, rel=0.06)
        assert 0.91 < np.mean((rms > low) & (rms < high)) < 0.99


@pytest.mark.parametrize(
    "robots", [pytest.param(30, marks=pytest.mark.slow), pytest.param(100, marks=pytest.mark.long)]
)
def test_interval_holds_the_errors_of_robots(robots):
    """Of virtual robots, at least 95 % have an error of the measured target over the task inside the interval."""
    model, task = ErrorModel(load_robot("abb-irb6660-205-1.9")), reference_task(np.radians(20.0))
    measured, poses = reach_task(model, task, 40, seed=3), reach_task(model, task)
    inside = []
    for seed in range(robots):
        campaign, truth = simulate(model, measured.q, rng=np.random.default_rng(seed))
        calibration = identify(model, campaign)
        (low, high) = judge(calibration, task).judgements[0].budget.interval
        error = (truth.points(poses.q) - calibration.predict(poses.q))[:, 0]
        inside.append(low < np.sqrt(poses.weights @ (error**2).sum(axis=1)) < high)
    assert np.mean(inside) > 0.95 - 3.0 * np.sqrt(0.05 * 0.95 / robots), np.mean(inside)


@pytest.mark.parametrize(("tolerance", "decision"), [(2e-4, "met"), (1e-5, "not met"), (None, "not known")])
def test_decision_follows_from_the_interval(calibration, tolerance, decision):
    task = replace(reference_task(), accuracy=tolerance)
    verdict = judge(calibration, task)
    first = verdict.judgements[0]
    low, high = first.budget.interval
    assert low < first.budget.after < high
    wanted = tolerance if tolerance is None else {"met": 1.01 * high, "not met": 0.99 * low}[decision]
    again = judge(calibration, replace(task, accuracy=wanted)).judgements[0]
    assert again.decision == decision
    between = judge(calibration, replace(task, accuracy=first.budget.after)).judgements[0]
    assert between.decision == "not known"
    assert again.reason if decision == "not known" else not again.reason


def test_a_subject_is_no_better_known_than_the_one_before(calibration):
    """The tool adds to the target, in variance."""
    target, tool, program = judge(calibration, reference_task()).judgements
    assert tool.budget.after >= 0.99 * target.budget.after
    assert program.budget is None
    assert program.decision == "not known"


def test_program_counts_what_is_left_of_its_error():
    """An error that is predicted to stay counts in full, at both ends of the interval."""
    free, left = budget(geometry=1e-8, spread=1e-17), budget(left=4e-8, geometry=1e-8, spread=1e-17)
    for one, other in zip(free.interval, left.interval, strict=True):
        assert other**2 == pytest.approx(one**2 + 4e-8)


def test_many_poses_narrow_only_the_model_error():
    """Errors that go together at all poses are not averaged."""
    one = Judgement(subject="tool point", budget=budget(geometry=1e-8, spread=2e-16), tolerance=1e-3, reason="")
    low, high = one.budget.interval
    assert high / low > 10.0  # a single normal number's size is hardly known beforehand
    assert one.decision == "met"


def test_held_out_rows_that_are_farther_off_contradict_it(calibration):
    """What held-out rows show outweighs a smaller expectation."""
    task = replace(reference_task(), accuracy=1e-3)
    assert judge(calibration, task).judgements[0].decision == "met"
    residuals = np.full((4, len(calibration.targets), 3), 2e-3)
    rows = np.arange(4)
    held_out = HeldOut(by="rows", folds=2, rows=rows, part=rows % 2, residuals=residuals, nominal=residuals)
    judgement = judge(replace(calibration, held_out=held_out), task).judgements[0]
    assert judgement.decision == "not known"
    assert judgement.reason


@pytest.mark.realdata
@pytest.mark.parametrize(("name", "rows"), [("ur5", 60), ("abb-irb120", 60), ("barrett-wam", 151)])
def test_interval_holds_the_errors_of_measured_robots(data_folder, name, rows):
    """Rows that were not fitted are as far off as is expected at their poses; their measurement adds little."""
    campaign, model = campaign_of(data_folder, name), ErrorModel(load_robot(name))
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(len(campaign))
        calibration, unseen = identify(model, campaign.take(order[:rows])), campaign.take(order[rows:])
        task = Task(name="unseen", poses=model.poses(unseen.q), joints=unseen.q)
        low, high = judge(calibration, task).judgements[0].budget.interval
        error = calibration.residuals_on(unseen)[unseen.valid][:, :3]
        assert low < np.sqrt((error**2).sum(axis=1).mean()) < high
