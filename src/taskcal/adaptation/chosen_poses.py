"""The poses of plans: what is chosen among, once for all numbers of poses, and the choice itself."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.adaptation.calibrated_experiment import calibrated_experiments
from taskcal.adaptation.candidates import Measurable, find_measurable, keep_measurable
from taskcal.adaptation.experiment import Experiment, make_experiment
from taskcal.adaptation.hyperparameters import assumed_hyperparameters
from taskcal.adaptation.plan_options import PlanOptions
from taskcal.adaptation.plan_prior import PlanPrior, prior_from_calibration, prior_from_campaign
from taskcal.adaptation.refinement import refine
from taskcal.adaptation.visiting_order import order_visits
from taskcal.errors import CampaignError
from taskcal.estimation.blas import single_threaded
from taskcal.estimation.experiment_design import Candidates, Choice, choose
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, TaskPoses, reach_task


@dataclass(frozen=True, eq=False, kw_only=True)
class ChosenPoses:
    """Poses to measure, in the order in which to measure them."""

    q: Float[np.ndarray, "count joints"]
    """Radians."""
    visible: Bool[np.ndarray, "count targets"]
    """Which reflectors the tracker sees at each."""
    candidate: Int[np.ndarray, " count"]
    """Which candidate each is, or was before it was refined."""
    choice: Choice


@dataclass(frozen=True, eq=False, kw_only=True)
class PoseChoice:
    """Everything that does not depend on how many poses are chosen."""

    model: ErrorModel
    task: Task
    options: PlanOptions
    goal: TaskPoses
    measurable: Measurable
    prior: PlanPrior
    judged: Experiment
    """To judge plans by."""
    weighing: Experiment
    """To choose their poses by: what geometry does not explain is a smooth field there."""
    candidates: Candidates

    @classmethod
    @single_threaded
    def among(cls, model: ErrorModel, task: Task, options: PlanOptions) -> "PoseChoice":
        """Of a tracker's poses.

        Raises:
            ReachError: no candidate can be reached and seen.
            CampaignError: a campaign or calibration that cannot be extended.
        """
        options.progress("candidates")
        goal = reach_task(model, task, 200, options.seed)
        measurable = _measurable(model, task, options)
        prior = _prior(model, options)
        judged, weighing = _experiments(model, goal, measurable, prior, options)
        return cls(
            model=model,
            task=task,
            options=options,
            goal=goal,
            measurable=measurable,
            prior=prior,
            judged=judged,
            weighing=weighing,
            candidates=weighing.candidates(measurable),
        )

    @single_threaded
    def choose(self, count: int) -> ChosenPoses:
        """So many poses.

        Raises:
            CampaignError: fewer than tracker frame and targets need.
        """
        _check_count(count, self.weighing, self.prior)
        options, q = self.options, self.measurable.q
        options.progress(f"choosing {count} of {len(q)}")
        choice = choose(self.candidates, count, options.criterion, progress=options.progress)
        q, visible = self._refined(q[choice.chosen], self.measurable.visible[choice.chosen])
        order = order_visits(self.model.robot, q)
        return ChosenPoses(q=q[order], visible=visible[order], candidate=choice.chosen[order], choice=choice)

    def _refined(
        self, q: Float[np.ndarray, "count joints"], visible: Bool[np.ndarray, "count targets"]
    ) -> tuple[Float[np.ndarray, "count joints"], Bool[np.ndarray, "count targets"]]:
        """The poses after some rounds of refinement; as they are, where the poses or another criterion are given."""
        options = self.options
        if options.criterion != "task" or not isinstance(options.candidates, int):
            return q, visible
        for round_ in range(options.refine):
            options.progress(f"refining, round {round_ + 1}")
            scale, seed = 0.12 / (1 + round_), options.seed + round_
            q, visible = refine(
                self.model, self.weighing, self.task, options.station, q, visible, scale=scale, seed=seed
            )
        return q, visible


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
