"""Which poses to measure, so that the task becomes accurate."""

from typing import Unpack

import numpy as np
from jaxtyping import Float

from taskcal.adaptation.chosen_poses import PoseChoice
from taskcal.adaptation.comparison_plans import even_plan_error, random_plan_errors
from taskcal.adaptation.expected_error import design
from taskcal.adaptation.observed_plan import plan_observed
from taskcal.adaptation.plan_options import PlanChoices, PlanOptions
from taskcal.adaptation.plan_prior import PlanPrior
from taskcal.adaptation.planned import Plan
from taskcal.arguments import expect_kinds
from taskcal.estimation.blas import single_threaded
from taskcal.measurement.virtual_cell import simulate
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, TaskPoses


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
    planning = PoseChoice.among(model, task, chosen)
    poses = planning.choose(count)
    measurable, experiment, prior = planning.measurable, planning.judged, planning.prior
    q, visible, choice = poses.q, poses.visible, poses.choice
    return Plan(
        rows=tuple(int(measurable.rows[i]) for i in poses.candidate),
        q=q,
        visible=visible,
        expected=experiment.error(q, visible),
        random=random_plan_errors(model, experiment, task, chosen.station, measurable, count, chosen.seed),
        grid=even_plan_error(model, experiment, task, chosen.station, measurable, count),
        by_count=experiment.errors_by_count(measurable.q[choice.started], measurable.visible[choice.started]),
        before=experiment.before if prior.calibration is not None else _before(model, planning.goal, q, chosen, prior),
        criterion=chosen.criterion,
        exchanges=choice.exchanges,
        lost=dict(measurable.lost),
        candidates=len(measurable.q),
        accuracy=task.accuracy,
        extends=prior.calibration is not None,
        model_error=prior.hyper.model_error[0],
        model_error_origin=prior.hyper.origin,
    )


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
