"""Plans: what they promise is what simulated robots give, and every pose can be measured."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import CampaignError, ReachError
from taskcal.identification.hyperparameters import Hyperparameters
from taskcal.identification.identify import identify
from taskcal.observations.base import TrackerNoise
from taskcal.observations.point import Tracker
from taskcal.planning.expected_error import PlanPrior, design
from taskcal.planning.experiment import make_experiment
from taskcal.planning.plan import Plan, plan
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from taskcal.task.task import Task, reach_task
from taskcal.virtual.cell import draw_defects, simulate
from tests.laws.robots import irb6660_description
from tests.planning.measuring_cell import TASK


@pytest.fixture(scope="module")
def assumed(model, listed, pool) -> Plan:
    """By the model error of the robot's file."""
    return plan(model, listed, 12, candidates=pool)


@pytest.fixture(scope="module")
def exact(model, listed, pool) -> Plan:
    """Of a robot without model error."""
    return plan(model, listed, 12, candidates=pool, model_error=0.0)


@pytest.fixture(scope="module")
def nine(model, listed, pool) -> Plan:
    """For the task, without model error: with a smooth one the choice is not the best against a white one."""
    return plan(model, listed, 9, candidates=pool[:150], model_error=0.0)


def test_a_task_out_of_reach_is_refused(model):
    far = replace(TASK, workspace=replace(TASK.workspace, center=np.array([6.0, 0.0, 1.0])))
    with pytest.raises(ReachError, match="does not reach"):
        plan(model, far, 12, candidates=100)


def test_the_same_seed_gives_the_same_plan(model, small):
    again = plan(model, TASK, 12, candidates=400)
    np.testing.assert_array_equal(again.q, small.q)
    assert again.rows == small.rows
    assert (again.expected, again.grid) == (small.expected, small.grid)
    assert np.abs(plan(model, TASK, 12, candidates=400, seed=1).q - small.q).max() > 1e-3


def test_plan_beats_random_and_states_gain_of_each_pose(small):
    """A plan is better than random poses and states the gain of each pose."""
    assert small.expected < small.grid < small.before
    assert small.expected < small.random.min()
    assert np.all(np.diff(small.by_count) <= 1e-12)
    assert small.expected <= small.by_count[-1] * (1 + 1e-9)
    assert len(set(small.rows)) == len(small.q) == 12


def test_what_a_plan_says_is_in_millimetres_what_it_has(small):
    said = small.summary()
    metres = {"expected_error": small.expected, "grid_expected_error": small.grid, "before": small.before}
    metres |= {"model_error": small.model_error, "accuracy": small.accuracy, "by_count": small.by_count}
    metres |= {"random_expected_error": small.random.mean(), "geometry_allowance": small.geometry_allowance}
    metres |= {"random_expected_error_range": [small.random.min(), small.random.max()]}
    for name, value in metres.items():
        np.testing.assert_allclose(said[f"{name}_mm"], np.multiply(value, 1e3), rtol=1e-12, err_msg=name)
    assert (said["count"], said["poses_needed"]) == (12, small.enough)
    assert replace(small, accuracy=None).summary()["geometry_allowance_mm"] is None


def test_plan_expected_error_equals_that_of_campaign(model, small):
    """The expected error is that of a campaign at the planned poses."""
    exact = TrackerNoise(range_m=1e-12, range_per_m=0.0, transverse_m=1e-12, transverse_per_m=0.0)
    campaign, _ = simulate(model, small.q, rng=np.random.default_rng(0), x=np.zeros(len(model)), noise=exact)
    goal = reach_task(model, TASK, 200, 0)
    assert small.model_error == pytest.approx(5e-5)  # of the robot's file
    made = design(model, campaign, goal, model_error=(small.model_error,))
    assert small.expected == pytest.approx(made.expected_error(np.arange(len(model))), rel=1e-3)
    assert small.before == pytest.approx(made.before, rel=1e-9)


def test_what_a_plan_assumes_of_the_model_error_is_said(model, assumed, exact):
    assert exact.model_error_origin == "as given"
    assert assumed.model_error_origin == model.robot.model_error.source
    assert assumed.expected > 2.0 * exact.expected
    assert exact.expected_at_a_pose == exact.expected
    said = assumed.summary()
    assert said["model_error_mm"] == pytest.approx(0.05)
    assert said["expected_with_model_error_mm"] == pytest.approx(np.hypot(said["expected_error_mm"], np.sqrt(3) * 0.05))
    assert (assumed.enough or 99) > exact.enough


@pytest.mark.parametrize("criterion", ["D", "E"])
def test_other_criteria_plan_as_well_but_not_better_for_the_task(model, listed, pool, nine, criterion):
    other = plan(model, listed, 9, candidates=pool[:150], criterion=criterion, model_error=0.0)
    assert other.criterion == criterion
    assert nine.expected <= other.expected * 1.01
    assert other.expected < other.before


def test_plan_rejects_too_few_poses_and_states_minimum(model):
    """Too few poses are rejected, and the number in the message is enough for a plan."""
    with pytest.raises(CampaignError, match=r"3 poses are too few.*9 unknowns; plan at least 4"):
        plan(model, TASK, 3, candidates=100)
    assert len(plan(model, TASK, 4, candidates=100, refine=0).q) == 4


def test_extended_campaign_lowers_expected_error(model, listed, pool, assumed):
    """Extending a campaign lowers the expected error, with poses where they reduce it most."""
    campaign, _ = simulate(model, assumed.q, rng=np.random.default_rng(4))
    more = plan(model, listed, 6, candidates=pool, campaign=campaign)
    fitted = identify(model, campaign)
    scales = {"model_error": fitted.model_error, "prior": fitted.prior_scale * model.tolerances}
    alone = design(model, campaign, reach_task(model, listed), **scales).expected_error(np.arange(len(model)))
    assert more.by_count[0] < alone
    assert more.expected < more.random.min() < alone
    # a single pose may follow where a campaign exists already
    assert plan(model, listed, 1, candidates=pool, campaign=campaign).expected == pytest.approx(
        more.by_count[0], rel=0.02
    )
    # what the extension promises is what both campaigns together are expected to give
    again, _ = simulate(
        model, np.concatenate([assumed.q, more.q]), rng=np.random.default_rng(0), x=np.zeros(len(model))
    )
    together = design(model, again, reach_task(model, listed), **scales).expected_error(np.arange(len(model)))
    assert more.expected == pytest.approx(together, rel=0.01)


def test_a_plan_among_given_joints_takes_these(model):
    q = reach_task(model, TASK, 30, 5).q
    made = plan(model, TASK, 10, candidates=q)
    np.testing.assert_array_equal(made.q, q[list(made.rows)])
    everything = plan(model, TASK, 30, candidates=q)
    assert everything.expected < made.expected < made.random.mean()


def test_a_model_error_spreads_the_poses_over_the_task(model, listed, pool):
    """Against a smooth model error, poses crowded at the extremes are worth less than poses where the task is."""
    rng = np.random.default_rng(0)
    goal = reach_task(model, listed)
    found = Tracker().find(model, listed, pool, 0)
    prior = PlanPrior(hyper=Hyperparameters.of_deviations((1e-4,)))
    smooth = make_experiment(model, goal, found, prior, Tracker(), smooth=True)
    sharp, broad = (plan(model, listed, 20, candidates=pool, model_error=e).q for e in (0.0, 1e-4))
    seen = np.ones((20, 1), dtype=bool)
    assert smooth.error(broad, seen) < smooth.error(sharp, seen)
    # the field's covariance with itself is what was asked for, at any pose
    at = found.q[rng.permutation(len(found.q))[:30]]
    columns, white = smooth.linear.field.columns(at)
    variance = (columns**2).sum(axis=2) + white[:, None]
    np.testing.assert_allclose(variance, 1e-8, rtol=1e-3)


def test_the_accuracy_says_how_many_poses_are_needed(exact):
    assert exact.enough is not None
    assert exact.by_count[exact.enough - 1] <= 5e-5 < exact.by_count[exact.enough - 2]
    assert replace(exact, accuracy=1e-9).enough is None
    assert replace(exact, accuracy=None).enough is None


def test_required_pose_count_reaches_single_pose_accuracy(small):
    """Model error included: a plan judged by its geometry alone promised an accuracy that no single pose has."""
    deviation = 5e-5
    for n in (4, 7, 11):
        accuracy = float(np.hypot(small.by_count[n - 1], np.sqrt(3.0) * deviation)) * (1 + 1e-9)
        made = replace(small, accuracy=accuracy, model_error=deviation)
        assert made.enough == 1 + int(np.argmax(small.by_count <= small.by_count[n - 1]))
        assert made.summary()["poses_needed_without_model_error"] <= made.enough
    hopeless = replace(small, accuracy=8e-5, model_error=deviation)
    assert hopeless.geometry_allowance == 0.0
    assert hopeless.enough is None


def test_a_list_of_poses_is_planned_for_too(model):
    reached = reach_task(model, TASK, 30)
    made = plan(model, Task(name="listed", poses=reached.T), 10, candidates=200, refine=0)
    assert made.expected < made.before
    assert made.expected < made.random.mean()


@pytest.mark.long
def test_plan_halves_error_of_random_poses_and_promises_it(model):
    """Over 200 true robots: 60 planned poses against 60 random ones, and 30 against 60."""
    goal, pool = reach_task(model, TASK, 200, 0), reach_task(model, TASK, 2000, 1).q
    plans = [plan(model, TASK, count, model_error=0.0) for count in (60, 30)]
    squares = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        x = draw_defects(model, rng)
        squares.append([])
        for q in (plans[0].q, plans[1].q, pool[rng.permutation(len(pool))[:60]]):
            campaign, truth = simulate(model, q, rng=rng, x=x)
            error = identify(model, campaign, gross_errors="keep").predict(goal.q) - truth.points(goal.q)
            squares[-1].append(np.mean((error**2).sum(axis=2)))
    sixty, thirty, random = np.sqrt(np.mean(squares, axis=0))
    assert sixty / random < 0.65, (sixty, random)
    assert thirty / random < 1.0, (thirty, random)
    assert sixty == pytest.approx(plans[0].expected, rel=0.06)
    assert thirty == pytest.approx(plans[1].expected, rel=0.08)
    assert random == pytest.approx(plans[0].random.mean(), rel=0.06)


def test_pose_count_forecast_agrees_with_plan_under_model_error():
    """The forecast for a number of poses agrees with the plan in the presence of model error."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    made = plan(model, TASK, 20, candidates=400, refine=0, model_error=5e-5)
    assert made.by_count[-1] == pytest.approx(made.expected, rel=0.3)


@pytest.mark.parametrize(
    "lengths",
    [
        (500.0, 1300.0, 400.0, 700.0),
        *(
            pytest.param(lengths, marks=pytest.mark.long)
            for lengths in ((500.0, 700.0, 500.0, 700.0), (734.0, 288.0, 664.0, 385.0))
        ),
    ],
)
def test_plan_stays_before_singularity_of_loop(lengths):
    """Of a robot that nothing but its loop keeps from there, around poses near the end of the loop's range."""
    description = irb6660_description()
    bar = {**description["four_bar"], **dict(zip(("crank_mm", "rod_mm", "rocker_mm", "arm_mm"), lengths, strict=True))}
    joints = [{**joint, "limits_deg": [-180.0, 180.0]} for joint in description["joint"]]
    free = {key: value for key, value in description.items() if key not in ("coupled_limit", "link_radii_mm")}
    model = ErrorModel(robot_from({**free, "joint": joints, "four_bar": bar}))
    apart = np.radians(np.arange(-180.0, 180.0, 0.5))
    closing = model.robot.four_bar.closes(np.c_[np.zeros((720, 2)), apart, np.zeros((720, 3))], np.zeros(3))
    low, high = apart[closing].min(), apart[closing].max()
    assert closing.sum() == round(np.degrees(high - low) / 0.5) + 1
    rng = np.random.default_rng(0)
    q = rng.uniform(-0.2, 0.2, (60, 6)) + np.array([0.0, 0.1, 0.1, 0.2, 1.2, 0.0])
    q[:, 2] = q[:, 1] + rng.uniform(high - 0.15, high - 0.01, len(q))
    task = Task(name="near the end", poses=model.poses(q), joints=q, accuracy=1e-4)
    made = plan(model, task, 8, candidates=150)
    turn = made.q[:, 2] - made.q[:, 1] - 0.5 * (low + high)
    assert (np.abs(np.angle(np.exp(1j * turn))) < 0.5 * (high - low) + 0.01).all()
    assert np.isfinite(model.poses(made.q)).all()
