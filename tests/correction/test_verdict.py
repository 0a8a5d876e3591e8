"""A verdict's interval holds the error that a robot turns out to have, and its decision follows from it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robot_programs.core.program import Frame
from robot_programs.core.source import Source
from robot_programs.reading import parse_program
from taskcal.correction import frames
from taskcal.correction.cell import Cell, Measured
from taskcal.correction.correct import correct
from taskcal.correction.correction import ErrorBudget
from taskcal.correction.frames import calibrate_frames
from taskcal.correction.part_placement import Region, place
from taskcal.correction.tool_poses import locate_tool
from taskcal.correction.verdict import Judgement, judge
from taskcal.geometry import se3
from taskcal.identification.effects import explain
from taskcal.identification.held_out import HeldOut
from taskcal.identification.identify import identify
from taskcal.identification.uncertainty_budget import budget_at
from taskcal.planning.plan import plan
from taskcal.planning.task_map import uncertainty_over
from taskcal.robot.catalogue import load_robot
from taskcal.robot.conditions import Conditions, conditions_in_order
from taskcal.robot.effects import Backlash, EncoderGain
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, reach_task
from taskcal.virtual.cell import simulate
from taskcal_demo.procedure import reference_task
from tests.realdata.test_effects import FOLDERS, campaign_of


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


def test_beyond_the_measured_range_no_error_is_stated_that_may_not_be_there():
    """Robots that were measured in one posture: none is farther off, nor nearer, than the interval over a task elsewhere has it."""
    model, task = ErrorModel(load_robot("abb-irb120")), list_of_poses()
    poses = reach_task(model, task)
    for seed in range(8):
        rng = np.random.default_rng(seed)
        q = np.radians(4.0) * rng.uniform(-1.0, 1.0, (60, 6))
        campaign, truth = simulate(model, q, rng=rng)
        calibration = identify(model, campaign)
        low, high = judge(calibration, task).judgements[0].budget.interval
        level = judge(replace(calibration, range_growth=0.0), task).judgements[0].budget.interval
        assert calibration.growth_at(poses.q).min() > 4.0
        assert low == pytest.approx(level[0], rel=0.1)
        assert high > 2.0 * level[1]
        off = np.linalg.norm(calibration.predict(poses.q) - truth.points(poses.q), axis=2)[:, 0]
        assert low < np.sqrt(poses.weights @ off**2) < high


def list_of_poses():
    """A task of some poses of an IRB 120 that points down."""
    down = np.diag([1.0, -1.0, -1.0])
    places = np.array([[x, y, z] for x in (0.25, 0.45) for y in (-0.1, 0.1) for z in (0.25, 0.45)])
    return Task(name="box", poses=se3.pose(np.tile(down, (len(places), 1, 1)), places))


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


def explained(model, campaign):
    """With all effects that the rows show."""
    return explain(model, campaign).calibration


def scattering(seed, count=200):
    """A robot with lost motion whose joints scatter from pose to pose, found by its effects; a task, and its true errors there."""
    robot, rng = load_robot("abb-irb120"), np.random.default_rng(seed)
    q, at = rng.uniform(-1.2, 1.2, (60, 6)), rng.uniform(-1.2, 1.2, (count, 6))
    effects, scatter = (Backlash(), EncoderGain()), 1e-4
    model = ErrorModel(robot, effects=effects)
    campaign, truth = simulate(model, q, rng=rng, joint_error=scatter, conditions=conditions_in_order(robot, q))
    calibration = explain(ErrorModel(robot), campaign, candidates=effects).calibration
    off = at + scatter * rng.normal(size=at.shape)
    error = (truth.points(off, conditions_in_order(robot, at)) - calibration.predict(at))[:, 0]
    return calibration, Task(name="scattered", poses=ErrorModel(robot).poses(at), joints=at), error


@pytest.mark.parametrize(
    "robots", [pytest.param(10, marks=pytest.mark.slow), pytest.param(100, marks=pytest.mark.long)]
)
def test_interval_holds_the_errors_of_robots_whose_joints_scatter(robots):
    """What is expected of the measured target is what robots with effects turn out to err there, in the mean square."""
    inside, squares = [], []
    for seed in range(robots):
        calibration, task, error = scattering(seed)
        assert any(calibration.joint_error)
        budget = judge(calibration, task).judgements[0].budget
        rms = np.sqrt((error**2).sum(axis=1).mean())
        inside.append(budget.interval[0] < rms < budget.interval[1])
        squares.append((rms / budget.after) ** 2)
    assert np.mean(inside) > 0.95 - 3.0 * np.sqrt(0.05 * 0.95 / robots)
    assert 0.8 < np.mean(squares) < 1.2


@pytest.fixture(scope="module")
def loose(lost_motion):
    """A robot with lost motion, of which every source counts."""
    joints = tuple(np.full(len(lost_motion.model.robot.joints), 3e-5))
    return replace(lost_motion, model_error=(5e-5,), joint_error=joints, range_growth=1.5)


def rms_of(covariance, weights):
    return np.sqrt(weights @ np.trace(covariance[..., :3, :3], axis1=1, axis2=2))


def test_one_number_is_stated_of_the_target_and_of_the_tool(loose):
    """By the verdict, the report, a plan, and beside single poses: the rms of what predictions state over the task."""
    task = reference_task(np.radians(40.0))
    poses = reach_task(loose.model, task, known=loose.q)
    target, tool, _ = judge(loose, task).judgements
    expected = rms_of(loose.predict_covariance(poses.q)[:, 0], poses.weights)
    assert rms_of(loose.predict_covariance(poses.q, model_error=False)[:, 0], poses.weights) < 0.9 * expected
    assert target.budget.after == pytest.approx(expected, rel=1e-6)
    over = uncertainty_over(loose, task)
    assert over.target == pytest.approx(expected, rel=1e-6)
    expected_tool = rms_of(loose.tool_covariance(poses.q), poses.weights)
    assert tool.budget.after == pytest.approx(expected_tool, rel=1e-6)
    assert over.after == pytest.approx(expected_tool, rel=1e-6)
    located = locate_tool(loose, poses.q).uncertainty
    assert np.sqrt(poses.weights @ located**2) == pytest.approx(expected_tool, rel=1e-6)
    budget = budget_at(loose, poses.q)
    at_rows = np.sqrt(np.trace(loose.predict_covariance(poses.q)[:, 0], axis1=1, axis2=2).mean())
    assert budget.combined == pytest.approx(at_rows, rel=1e-6)


def test_a_plan_begins_with_what_is_stated():
    """Of the robot that is planned on, beyond its measured range, too; what a single pose errs by no plan lowers."""
    found, task, _ = scattering(0)
    found = replace(found, range_growth=1.5)
    q = task.joints * [1.3, 1.3, 0.9, 1.3, 1.3, 1.3]
    wide = replace(task, joints=q, poses=found.model.nominal.poses(q))
    chosen = plan(found.model, wide, 3, calibration=found, candidates=task.joints[:50])
    stated = rms_of(found.predict_covariance(q)[:, 0], np.full(len(q), 1.0 / len(q)))
    assert np.hypot(chosen.before, chosen.at_a_pose) == pytest.approx(stated, rel=0.01)
    assert chosen.at_a_pose > 1.1 * np.sqrt(3.0) * chosen.model_error


def test_a_program_in_the_base_is_as_uncertain_as_the_tool_there(loose, robot, measured, make_moves):
    """With the robot's own tool; and where the tracker sees its part, as uncertain as in the tracker's frame."""
    move = make_moves([np.eye(4)])[0]
    seen = Cell(parts={"base": Measured(name="base", in_tracker=loose.T_tracker_base)})
    ways = Conditions(approach=np.where(np.arange(6) < 4, 1.0, 0.0) * np.ones((len(measured), 1)))
    for cell, frame in ((Cell(), "base"), (seen, "tracker")):
        for conditions in (None, ways):
            found = calibrate_frames(loose, move, cell).variances(measured, conditions).sum(axis=1)
            stated = loose.tool_covariance(measured, conditions, frame=frame)
            np.testing.assert_allclose(found, np.trace(stated[:, :3, :3], axis1=1, axis2=2), rtol=1e-6)


def test_the_mean_square_spreads_as_errors_do_that_go_together_and_that_do_not(
    loose, measured, make_moves, monkeypatch
):
    """Drawn: causes that are the same at all targets, and what errs at each alone, along its own directions."""
    monkeypatch.setattr(frames, "RELATIVE_UNCERTAINTY", 0.0)
    loose = replace(loose, joint_error=(1e-3,) * 6)
    seen = Cell(parts={"base": Measured(name="base", in_tracker=loose.T_tracker_base)})
    frame, q, rng = calibrate_frames(loose, make_moves([np.eye(4)])[0], seen), measured[:12], np.random.default_rng(7)
    found = frames.uncertainty_at([frame], np.zeros(len(q), dtype=np.int64), q)
    causes, L = frame.causes(q), np.linalg.cholesky(frame.moved(q).errors.single[:, 0])
    together = np.einsum("nik,dk->dni", causes, rng.normal(size=(20_000, causes.shape[2])))
    alone = np.einsum("nij,dnj->dni", L, rng.normal(size=(20_000, len(q), 3)))
    squares = ((together + alone) ** 2).sum(axis=2).mean(axis=1)
    assert squares.mean() == pytest.approx(found.mean.sum(), rel=0.03)
    assert squares.var() == pytest.approx(found.variance_of_mean_square, rel=0.08)


def test_a_placement_expects_what_the_correction_does(loose, robot, middle):
    """With the sides from which the drives come in the program, which are not unknown of its targets either."""
    rows = ["x_mm,y_mm,z_mm,qx,qy,qz,qw,move"]
    rows += [
        f"{x},{y},0,0,0,0,1,{'joint' if x == y == 0 else 'linear'}" for x, y in ((0, 0), (60, 0), (60, 60), (0, 60))
    ]
    source = Source.of(Path("square.csv"), "\n".join(rows).encode())
    program = parse_program((source,), robot=robot, part=Frame(name="part", T=middle))
    now = place(loose, program, Region(low=np.zeros(3), high=np.zeros(3))).now
    corrected = correct(loose, program)
    assert now.after == pytest.approx(corrected.budget.uncertainty, rel=1e-6)
    assert now.before == pytest.approx(corrected.budget.before, rel=1e-6)
    target = judge(loose, correction=corrected).judgements[0].budget
    q = corrected.after.q[corrected.after.at_target]
    assert target.after < rms_of(loose.predict_covariance(q)[:, 0], np.full(len(q), 1.0 / len(q)))
    still = place(replace(loose, joint_error=()), program, Region(low=np.zeros(3), high=np.zeros(3))).now
    assert now.after**2 - still.after**2 > (3e-5 * 1.0) ** 2  # a metre from the first axes


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
    assert again.reasons if decision == "not known" else not again.reasons


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
    one = Judgement(subject="tool point", budget=budget(geometry=1e-8, spread=2e-16), tolerance=1e-3)
    low, high = one.budget.interval
    assert high / low > 10.0  # a single normal number's size is hardly known beforehand
    assert one.decision == "met"


def test_held_out_rows_that_are_farther_off_contradict_it(calibration):
    """What held-out rows show outweighs a smaller expectation."""
    task = replace(reference_task(), accuracy=1e-3)
    assert judge(calibration, task).judgements[0].decision == "met"
    residuals = np.full((4, len(calibration.targets), 3), 2e-3)
    rows = np.arange(4)
    held_out = HeldOut(
        by="rows",
        folds=2,
        rows=rows,
        part=rows % 2,
        residuals=residuals,
        nominal=residuals,
        kinds=calibration.layout.observed,
    )
    judgement = judge(replace(calibration, held_out=held_out), task).judgements[0]
    assert judgement.decision == "not known"
    assert judgement.reasons


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


LONG = (pytest.mark.long,)


@pytest.mark.realdata
@pytest.mark.parametrize(
    ("name", "rows", "fit"),
    [
        *(pytest.param(name, 0.7, identify, id=f"{name}, geometry") for name in FOLDERS),
        pytest.param("abb-irb120", 60, explained, id="irb120, 60 rows, effects", marks=pytest.mark.slow),
        pytest.param("abb-irb120", 0.7, explained, id="irb120, effects", marks=LONG),
        pytest.param("ur5", 0.7, explained, id="ur5, effects", marks=LONG),
        pytest.param("ur10", 0.7, explained, id="ur10, effects", marks=LONG),
        pytest.param("fanuc-r2000ic-165f", 0.7, explained, id="fanuc, effects", marks=LONG),
        pytest.param("barrett-wam", 0.7, explained, id="wam, effects", marks=LONG),
    ],
)
def test_what_is_expected_of_measured_robots_is_what_predictions_state(data_folder, name, rows, fit):
    """At poses of which nothing is told; there, rows that were not fitted err no more than the interval says."""
    campaign, model = campaign_of(data_folder, name), ErrorModel(load_robot(name))
    count = round(rows * len(campaign)) if rows < 1 else rows
    order = np.random.default_rng(0).permutation(len(campaign))
    calibration, unseen = fit(model, campaign.take(np.sort(order[:count]))), campaign.take(order[count:])
    task = Task(name="unseen", poses=model.poses(unseen.q), joints=unseen.q)
    target, tool, _ = judge(calibration, task).judgements
    even = np.full(len(unseen), 1.0 / len(unseen))
    stated = rms_of(calibration.predict_covariance(unseen.q)[:, 0], even)
    assert target.budget.after == pytest.approx(stated, rel=0.02)
    assert tool.budget.after == pytest.approx(rms_of(calibration.tool_covariance(unseen.q), even), rel=0.02)
    error = calibration.residuals_on(replace(unseen, conditions=Conditions()))[unseen.valid][:, :3]
    assert np.sqrt((error**2).sum(axis=1).mean()) < target.budget.interval[1]
