"""Refined plans are better, and can be measured."""

import numpy as np

from taskcal.identification.hyperparameters import Hyperparameters
from taskcal.kinematics.clearance import place_links
from taskcal.observations.point import Tracker
from taskcal.planning.expected_error import PlanPrior
from taskcal.planning.experiment import make_experiment
from taskcal.planning.plan import plan, refine
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import enlarge, reach_task
from tests.planning.measuring_cell import TASK, cell


def test_refinement_keeps_what_the_station_sees(model):
    """Every variation tried is checked; a pose whose variations are all hidden stays."""
    station = cell()
    made = plan(model, TASK, 8, candidates=200, station=station, refine=0)
    links = place_links(model, made.q)
    seen = station.visible(model.poses(made.q), links)
    np.testing.assert_array_equal(seen, made.visible)
    prior = PlanPrior(hyper=Hyperparameters.of_deviations((0.0,)))
    tracker = Tracker(station=station)
    goal, found = reach_task(model, TASK, 50), tracker.find(model, TASK, 200, 0)
    experiment = make_experiment(model, goal, found, prior, tracker)
    q, visible = refine(model, experiment, TASK, tracker, made.q, made.visible, scale=0.3, seed=1)
    np.testing.assert_array_equal(station.visible(model.poses(q), place_links(model, q)), visible)
    assert visible.any(axis=1).all()
    assert experiment.error(q, visible) < experiment.error(made.q, made.visible)
    assert np.any(q != made.q)


def test_refinement_never_makes_a_plan_worse(model, listed):
    expected = [plan(model, listed, 6, candidates=80, refine=rounds).expected for rounds in (0, 1, 2)]
    assert np.all(np.diff(expected) <= 1e-12)
    assert expected[2] < expected[0]


def test_refined_poses_stay_in_the_room_that_measuring_may_take():
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    made = plan(model, TASK, 20, candidates=400, refine=3)
    assert enlarge(TASK, model).workspace.contains(model.poses(made.q)).all()
