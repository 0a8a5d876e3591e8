"""Which poses to measure, so that the task becomes accurate."""

from typing import Unpack

import numpy as np
from jaxtyping import Bool, Float

from taskcal.adaptation.calibrated_experiment import calibrated_experiments
from taskcal.adaptation.candidates import Measurable, find_measurable, keep_measurable
from taskcal.adaptation.comparison_plans import even_plan_error, random_plan_errors
from taskcal.adaptation.expected_error import design
from taskcal.adaptation.experiment import Experiment, make_experiment
from taskcal.adaptation.hyperparameters import assumed_hyperparameters
from taskcal.adaptation.observed_plan import plan_observed
from taskcal.adaptation.plan_options import PlanChoices, PlanOptions
from taskcal.adaptation.plan_prior import PlanPrior, prior_from_calibration, prior_from_campaign
from taskcal.adaptation.planned import Plan
from taskcal.adaptation.refinement import refine
from taskcal.adaptation.visiting_order import order_visits
from taskcal.arguments import expect_kinds
from taskcal.errors import CampaignError
from taskcal.estimation.blas import single_threaded
from taskcal.estimation.experiment_design import choose
from taskcal.measurement.virtual_cell import simulate
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, TaskPoses, reach_task


@single_threaded
def plan(model: ErrorModel, task: Task, count: int = 60, **options: Unpack[PlanChoices]) -> Plan:
    """Choose the poses whose measurement leaves the least expected error over the task.

    Args:
        model: the model to be identified.
        task: what the robot has to do.
        count: poses to measure.
        **options: those of `PlanOptions`, each by its name, and all at once as ``options``; names replace what is in those.

            ``seed``: of the candidates and of the refinement; the same seed gives the same plan.

            ``station``: tracker, reflectors and keep-out boxes; without it one reflector at the tool point is always seen.

            ``criterion``: ``task`` for the expected task error, or D, A, E, O1–O5.

            ``campaign``: already measured, with points; the plan extends it, with its own model error and prior scale.

            ``calibration``: of this model from points; the plan adds what lowers its uncertainty over the task the most, with
            its own model error and prior scale. It stands for its campaign, so that only one of the two is given.

            ``candidates``: how many poses to choose among; or the joint positions themselves, which are then not refined.

            ``refine``: rounds of continuous refinement after the exchange.

            ``registration``: where tracker and targets are, if known; a campaign or a calibration brings its own.

            ``noise``: the tracker's.

            ``model_error``: standard deviation per axis of what geometry does not explain, metres; by default that of the
            robot's file, or of a typical robot (`model_error_of`). A campaign or a calibration brings its own.

            ``prior_scale``: factor of the tolerances.

            ``progress``: told what is being done.

            ``observe``: how to measure without a tracker: a `SocketWay`, `WireWay` or `CameraWay` with what stands where. Station,
            registration and noise are a tracker's, and of no concern then.

    Raises:
        ReachError: no candidate can be reached and seen, or something that stands cannot be measured.
        CampaignError: fewer poses than tracker frame and targets need, or a campaign or calibration that cannot be extended.
    """
    expect_kinds({"model": ErrorModel, "task": Task}, model=model, task=task)
    chosen = PlanOptions.of(**options)
    if chosen.observe is not None:
        return plan_observed(model, task, count, chosen.observe, chosen)
    station = chosen.station
    chosen.progress("candidates")
    goal = reach_task(model, task, 200, chosen.seed)
    measurable = _measurable(model, task, chosen)
    prior = _prior(model, chosen)
    experiment, weighing = _experiments(model, goal, measurable, prior, chosen)
    _check_count(count, experiment, prior)
    chosen.progress(f"choosing {count} of {len(measurable.q)}")
    choice = choose(weighing.candidates(measurable), count, chosen.criterion, progress=chosen.progress)
    q, visible = _refined(model, weighing, task, chosen, measurable.q[choice.chosen], measurable.visible[choice.chosen])
    order = order_visits(model.robot, q)
    q, visible = q[order], visible[order]
    return Plan(
        rows=tuple(int(measurable.rows[i]) for i in choice.chosen[order]),
        q=q,
        visible=visible,
        expected=experiment.error(q, visible),
        random=random_plan_errors(model, experiment, task, station, measurable, count, chosen.seed),
        grid=even_plan_error(model, experiment, task, station, measurable, count),
        by_count=experiment.errors_by_count(measurable.q[choice.started], measurable.visible[choice.started]),
        before=experiment.before if prior.calibration is not None else _before(model, goal, q, chosen, prior),
        criterion=chosen.criterion,
        exchanges=choice.exchanges,
        lost=dict(measurable.lost),
        candidates=len(measurable.q),
        accuracy=task.accuracy,
        extends=prior.calibration is not None,
        model_error=prior.hyper.model_error[0],
        model_error_origin=prior.hyper.origin,
    )


def _measurable(model: ErrorModel, task: Task, options: PlanOptions) -> Measurable:
    """The candidates: spread over the enlarged task, or those given."""
    if isinstance(options.candidates, int):
        return find_measurable(model, task, options.station, options.candidates, options.seed)
    q = np.asarray(options.candidates, dtype=float)
    n = len(q)
    given = TaskPoses(T=model.poses(q), q=q, weights=np.full(n, 1.0 / n), unreachable=np.zeros(n, dtype=bool))
    return keep_measurable(model, given, options.station)


def _prior(model: ErrorModel, options: PlanOptions) -> PlanPrior:
    """What is known beforehand."""
    if options.campaign is not None:
        return prior_from_campaign(model, options.campaign, options.station, options.noise)
    if options.calibration is not None:
        return prior_from_calibration(model, options.calibration, options.station)
    hyper = assumed_hyperparameters(model, options.model_error, options.prior_scale)
    return PlanPrior(hyper=hyper, registration=options.registration)


def _experiments(
    model: ErrorModel, goal: TaskPoses, measurable: Measurable, prior: PlanPrior, options: PlanOptions
) -> tuple[Experiment, Experiment]:
    """To judge plans by, and to choose their poses by: there, what geometry does not explain is a smooth field."""
    if prior.calibration is not None and prior.calibration.joint_error:
        return calibrated_experiments(prior.calibration, goal, measurable, options.noise)
    station, noise = options.station, options.noise
    judged, chosen = (
        make_experiment(model, goal, measurable, prior, station=station, noise=noise, smooth=smooth)
        for smooth in (False, True)
    )
    return judged, chosen


def _check_count(count: int, experiment: Experiment, prior: PlanPrior) -> None:
    layout = experiment.linear.layout
    frames = len(layout.names) - len(layout.kept)
    fewest = frames // (3 * len(layout.targets)) + 1
    nothing = prior.campaign is None and prior.calibration is None
    if count < 1 or (nothing and count < fewest):
        raise CampaignError(
            f"{count} poses are too few: tracker frame and targets alone have {frames} unknowns; plan at least {fewest}, "
            "better 30 or more"
        )


def _refined(
    model: ErrorModel,
    experiment: Experiment,
    task: Task,
    options: PlanOptions,
    q: Float[np.ndarray, "count joints"],
    visible: Bool[np.ndarray, "count targets"],
) -> tuple[Float[np.ndarray, "count joints"], Bool[np.ndarray, "count targets"]]:
    """The poses after some rounds of refinement; as they are, where the poses or another criterion are given."""
    if options.criterion != "task" or not isinstance(options.candidates, int):
        return q, visible
    for round_ in range(options.refine):
        options.progress(f"refining, round {round_ + 1}")
        scale, seed = 0.12 / (1 + round_), options.seed + round_
        q, visible = refine(model, experiment, task, options.station, q, visible, scale=scale, seed=seed)
    return q, visible


def _before(
    model: ErrorModel, goal: TaskPoses, q: Float[np.ndarray, "count joints"], options: PlanOptions, prior: PlanPrior
) -> float:
    """Expected error when the measurements only serve to find tracker frame and targets."""
    measured = q if prior.campaign is None else np.concatenate([prior.campaign.q, q])
    station, hyper = options.station, prior.hyper
    targets = None if station is None else {r.name: r.position for r in station.reflectors}
    rng, x = np.random.default_rng(0), np.zeros(len(model))
    nominal, _ = simulate(model, measured, rng=rng, x=x, targets=targets, noise=options.noise)
    return design(
        model, nominal, goal, noise=options.noise, model_error=hyper.model_error, prior=hyper.deviations(model)
    ).before
