"""Which postures to measure in without a tracker, so that the task becomes accurate."""

import numpy as np
from jaxtyping import Float, Int

from taskcal.adaptation.candidates import Measurable
from taskcal.adaptation.comparison_plans import RANDOM_PLANS
from taskcal.adaptation.experiment import Experiment
from taskcal.adaptation.hyperparameters import assumed_hyperparameters
from taskcal.adaptation.measuring_way import MeasuringWay
from taskcal.adaptation.observable import find_observable
from taskcal.adaptation.observed_experiment import make_observed_experiment, nominal_error
from taskcal.adaptation.plan_options import PlanOptions
from taskcal.adaptation.planned import Plan
from taskcal.adaptation.tight_ways import find_tight_ways
from taskcal.adaptation.visiting_order import order_visits
from taskcal.errors import CampaignError, ReachError
from taskcal.estimation.experiment_design import Candidates, choose, choose_at_random
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal.task.task import Task, reach_task


def plan_observed(model: ErrorModel, task: Task, count: int, way: MeasuringWay, options: PlanOptions) -> Plan:
    """Choose the postures whose measurement leaves the least expected error over the task.

    Args:
        model: the model to be identified.
        task: what the robot has to do.
        count: postures to measure in.
        way: of measuring.
        options: of the plan; those of a tracker are of no concern.

    Raises:
        ReachError: something that stands cannot be measured, or in too few postures.
        CampaignError: fewer postures than what stands needs, or a campaign or calibration to go on from.
    """
    _check(count, way, options)
    options.progress("candidates")
    goal = reach_task(model, task, 200, options.seed)
    assert isinstance(options.candidates, int)
    measurable = find_observable(model.nominal, task, way, options.candidates, options.seed)
    _check_found(measurable, way)
    hyper = assumed_hyperparameters(model, options.model_error, options.prior_scale)
    judged, weighing = (
        make_observed_experiment(model, goal, measurable, way, hyper, smooth=smooth) for smooth in (False, True)
    )
    options.progress(f"choosing {count} of {len(measurable.q)}")
    candidates = _candidates(weighing, measurable, way)
    choice = choose(candidates, count, options.criterion, progress=options.progress)
    chosen = choice.chosen
    chosen = chosen[_order(model.robot, measurable.q[chosen], way.stages[measurable.visible[chosen].argmax(axis=1)])]
    q, visible = measurable.q[chosen], measurable.visible[chosen]
    return Plan(
        rows=tuple(int(measurable.rows[i]) for i in chosen),
        q=q,
        visible=visible,
        of=visible.argmax(axis=1),
        way=way,
        expected=judged.error(q, visible),
        random=_random_errors(judged, candidates, measurable, count, options.seed),
        grid=_even_error(judged, measurable, count),
        by_count=judged.errors_by_count(measurable.q[choice.started], measurable.visible[choice.started]),
        before=nominal_error(judged, goal, q, visible),
        criterion=options.criterion,
        exchanges=choice.exchanges,
        lost=dict(measurable.lost),
        candidates=len(measurable.q),
        accuracy=task.accuracy,
        model_error=hyper.model_error[0],
        model_error_origin=hyper.origin,
        tight=find_tight_ways(model.nominal, way, q, visible.argmax(axis=1)),
    )


def _check(count: int, way: MeasuringWay, options: PlanOptions) -> None:
    if options.campaign is not None or options.calibration is not None:
        raise CampaignError(f"a plan with a {way.way} begins anew; leave the campaign or calibration out")
    if not isinstance(options.candidates, int):
        raise CampaignError(
            f"postures for a {way.way} are looked for where things stand; give how many candidates to try"
        )
    fewest = way.fewest * way.things
    if count < fewest:
        raise CampaignError(
            f"{count} poses are too few: each of {way.things} {way.label}s needs {way.fewest}; plan at least {fewest}, better "
            f"{max(60, 2 * fewest)} or more, or let fewer stand"
        )


def _check_found(measurable: Measurable, way: MeasuringWay) -> None:
    found = measurable.visible.sum(axis=0)
    few = int(found.argmin())
    if found[few] < way.fewest:
        raise ReachError(
            f"only {found[few]} postures were found in which {way.label} '{way.standing.names[few]}' can be measured; it needs "
            f"{way.fewest}: try more candidates, move it, or allow more"
        )


def _candidates(weighing: Experiment, measurable: Measurable, way: MeasuringWay) -> Candidates:
    return Candidates(
        rows=weighing.rows(measurable.q, measurable.visible),
        prior=weighing.prior,
        task=weighing.task,
        signal=weighing.signal,
        of=measurable.visible.argmax(axis=1),
        fewest=way.fewest,
    )


def _order(
    robot: Robot, q: Float[np.ndarray, "count joints"], stages: Int[np.ndarray, " count"]
) -> Int[np.ndarray, " count"]:
    """What stands at the same time one behind another, each by short ways."""
    parts: list[np.ndarray] = []
    for stage in np.unique(stages):
        own = np.flatnonzero(stages == stage)
        parts.append(own[order_visits(robot, q[own])])
    return np.concatenate(parts)


def _random_errors(
    judged: Experiment, candidates: Candidates, measurable: Measurable, count: int, seed: int
) -> Float[np.ndarray, " plans"]:
    """Expected error of as many postures that nobody chose."""
    rng = np.random.default_rng(seed)
    picks = [choose_at_random(candidates, count, rng) for _ in range(RANDOM_PLANS)]
    return np.array([judged.error(measurable.q[pick], measurable.visible[pick]) for pick in picks])


def _even_error(judged: Experiment, measurable: Measurable, count: int) -> float:
    """The same of postures taken evenly from all, which are spread over what stands and over what it allows."""
    pick = np.linspace(0, len(measurable.q) - 1, min(count, len(measurable.q))).astype(int)
    return judged.error(measurable.q[pick], measurable.visible[pick])
