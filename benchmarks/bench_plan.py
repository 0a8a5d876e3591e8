"""Choosing 60 measuring poses of 10 000, and the ladder of a model's sizes, against the same done without updates."""

import numpy as np
import pytest

from taskcal.estimation.experiment_design import Candidates, choose
from taskcal.observations.point import Tracker
from taskcal.planning.expected_error import PlanPrior, assumed_hyperparameters, design
from taskcal.planning.experiment import make_experiment
from taskcal.task.task import reach_task
from taskcal_demo.procedure import reference_task


@pytest.fixture(scope="module")
def candidates(model, request) -> Candidates:
    count = 400 if request.config.getoption("benchmark_disable") else 10_000
    task = reference_task()
    tracker = Tracker()
    found = tracker.find(model, task, count, 0)
    prior = PlanPrior(hyper=assumed_hyperparameters(model, 0.0))
    return make_experiment(model, reach_task(model, task, 200), found, prior, tracker).candidates(found)


def one_greedy_step_by_inverses(candidates: Candidates) -> int:
    """The next pose by the inverse of every candidate's own information, in one batch for all."""
    information = candidates.prior + np.swapaxes(candidates.rows, 1, 2) @ candidates.rows
    return int(np.argmin(np.einsum("ij,nij->n", candidates.task, np.linalg.inv(information))))


def test_sixty_poses_against_one_greedy_step_without_updates(race, candidates):
    """The whole plan, greedy start and exchange, over a single one of its first 60 steps done by inverses."""
    race(
        "plan of 60",
        lambda: choose(candidates, 60),
        {"one step by inverses": lambda: one_greedy_step_by_inverses(candidates)},
        rounds=3,
    )


def test_ladder_against_one_error_of_each_size(race, model, campaign):
    """All sizes from 45 to none, over the closed form evaluated once for every size."""
    goal = reach_task(model, reference_task(), 200)
    made = design(model, campaign, goal)
    order, _ = made.ladder()
    sets = [np.setdiff1d(np.arange(len(model)), order[:k]) for k in range(len(model) + 1)]
    race(
        "ladder",
        made.ladder,
        {"expected error of each size": lambda: [made.expected_error(kept) for kept in sets]},
        rounds=5,
    )
