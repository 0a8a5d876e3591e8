"""Which poses to measure, so that the task becomes accurate."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypedDict, Unpack

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.arguments import expect_kinds, with_choices
from taskcal.campaigns.campaign import Campaign
from taskcal.errors import CampaignError, ReachError, UnknownName
from taskcal.estimation.experiment_design import CRITERIA, Candidates, Choice, Criterion, choose, choose_at_random
from taskcal.estimation.matrices import single_threaded
from taskcal.identification.calibration import Calibration
from taskcal.kinematics.clearance import place_links
from taskcal.kinematics.inverse import closes
from taskcal.observations.base import TrackerNoise
from taskcal.planning.candidates import Measurable, check, enlarge, find_measurable, keep_measurable
from taskcal.planning.expected_error import (
    PlanPrior,
    assumed_hyperparameters,
    design,
    prior_from_calibration,
    prior_from_campaign,
)
from taskcal.planning.experiment import (
    Experiment,
    calibrated_experiments,
    make_experiment,
    make_observed_experiment,
    nominal_error,
)
from taskcal.planning.instruments import MeasuringWay, TightWay, find_observable, find_tight_ways
from taskcal.planning.task_map import allow_geometry
from taskcal.registration.registration import Registration
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal.short_repr import short_repr
from taskcal.task.task import Task, TaskPoses, reach_task
from taskcal.virtual.cell import simulate
from taskcal.virtual.station import Station

# A plan: poses to measure, and what is expected of them.


@dataclass(frozen=True, eq=False, kw_only=True)
class Plan:
    """Poses to measure, in the order in which to measure them."""

    q: Float[np.ndarray, "count joints"]
    """Radians."""
    rows: tuple[int, ...]
    """Which of the candidates each pose is, or was before it was refined."""
    visible: Bool[np.ndarray, "count targets"]
    """Which reflectors the tracker sees at each; without a tracker, which of the things that stand is measured."""
    expected: float
    """Expected rms error in space over the task after these measurements, metres: in the tracker's frame, or without a tracker
    wherever the robot's base stands."""
    random: Float[np.ndarray, " plans"]
    """The same for as many random poses of the task's own workspace, of several plans."""
    grid: float
    """The same for as many poses spread evenly over the task's own workspace."""
    by_count: Float[np.ndarray, " count"]
    """Expected error after the first 1, 2, … poses of the greedy start."""
    before: float
    """Expected error of the nominal robot, tracker frame and targets found from the same measurements; or of the calibration
    that is planned on, as it is. Metres."""
    criterion: str
    exchanges: int
    lost: dict[str, int] = field(default_factory=dict[str, int])
    """Candidates that fell away, by reason."""
    candidates: int = 0
    """Candidates that could be measured."""
    accuracy: float | None = None
    """Needed by the task, metres."""
    extends: bool = False
    """Whether it plans on from a calibration."""
    model_error: float = 0.0
    """Standard deviation per axis of what geometry does not explain, with which it was chosen, metres."""
    model_error_origin: str = ""
    """Where that comes from, in words."""
    way: MeasuringWay | None = None
    """How it is measured without a tracker; None with one."""
    of: Int[np.ndarray, " count"] | None = None
    """Without a tracker: which of the things that stand each pose is measured at."""
    tight: tuple[TightWay, ...] = ()
    """Without a tracker: poses that the robot cannot be driven to from the one before, all joints at once, and stay clear."""

    @property
    def names(self) -> tuple[str, ...]:
        """Without a tracker: name of the thing that each pose is measured at; with one empty."""
        return () if self.way is None or self.of is None else tuple(self.way.standing.names[k] for k in self.of)

    @property
    def expected_at_a_pose(self) -> float:
        """Expected rms error in space of a single pose of the task: the prediction's, and the model error beside it, metres."""
        return float(np.hypot(self.expected, np.sqrt(3.0) * self.model_error))

    def __repr__(self) -> str:
        return (
            f"Plan({len(self.q)} poses: {self.expected * 1e3:.4f} mm expected over the task, random "
            f"{float(np.mean(self.random)) * 1e3:.4f} mm, spread evenly {self.grid * 1e3:.4f} mm, "
            f"before {self.before * 1e3:.4f} mm)"
        )

    @property
    def geometry_allowance(self) -> float | None:
        """What the accuracy leaves to the identified geometry, beside the model error of a single pose, metres.

        None if no accuracy is stated; zero if the model error alone takes all of it.
        """
        return allow_geometry(self.accuracy, self.model_error)

    @property
    def enough(self) -> int | None:
        """How many poses the accuracy needs at a single pose of the task, the model error of that pose included.

        None if these do not reach it or none is stated.
        """
        return self._first_within(self.geometry_allowance)

    def _first_within(self, error: float | None) -> int | None:
        """The smallest number of poses expected to leave at most so much to the geometry, metres."""
        if error is None:
            return None
        met = np.flatnonzero(self.by_count <= error)
        return int(met[0]) + 1 if len(met) else None

    def summary(self) -> dict[str, Any]:
        """The report, in millimetres."""
        return {
            "count": len(self.q),
            "criterion": self.criterion,
            "expected_error_mm": self.expected * 1e3,
            "expected_with_model_error_mm": self.expected_at_a_pose * 1e3,
            "model_error_mm": self.model_error * 1e3,
            "model_error_origin": self.model_error_origin,
            "random_expected_error_mm": float(np.mean(self.random)) * 1e3,
            "random_expected_error_range_mm": [float(self.random.min()) * 1e3, float(self.random.max()) * 1e3],
            "grid_expected_error_mm": self.grid * 1e3,
            "before_mm": self.before * 1e3,
            "by_count_mm": (self.by_count * 1e3).tolist(),
            "accuracy_mm": None if self.accuracy is None else self.accuracy * 1e3,
            "geometry_allowance_mm": None if self.accuracy is None else (self.geometry_allowance or 0.0) * 1e3,
            "poses_needed": self.enough,
            "poses_needed_without_model_error": self._first_within(self.accuracy),
            "candidates": self.candidates,
            "lost": self.lost,
            "exchanges": self.exchanges,
            **self._of_way(),
        }

    def _of_way(self) -> dict[str, Any]:
        """What is measured at what, without a tracker."""
        if self.way is None:
            return {}
        names = self.names
        return {
            "observe": self.way.way,
            self.way.label: list(names),
            "not_clear_from_the_pose_before": [
                {"pose": tight.pose, "way_round": tight.via is not None} for tight in self.tight
            ],
            "poses_each": {name: names.count(name) for name in self.way.standing.names},
        }


# How poses are chosen: one frozen value.

CANDIDATES = 10_000


class PlanChoices(TypedDict, total=False):
    """`PlanOptions` by keywords: all of them at once, some of them, or some that replace those of a whole."""

    options: "PlanOptions | None"
    seed: int
    station: Station | None
    criterion: Criterion
    campaign: Campaign | None
    calibration: Calibration | None
    candidates: int | Float[np.ndarray, "n joints"]
    refine: int
    registration: Registration | None
    noise: TrackerNoise | None
    model_error: float | None
    prior_scale: float
    progress: Callable[[str], None]
    observe: MeasuringWay | None


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class PlanOptions:
    """Options of a plan; `dataclasses.replace` gives others.

    Raises:
        UnknownName: a criterion that does not exist.
        ValueError: a campaign and a calibration.
    """

    seed: int = 0
    """Of the candidates and of the refinement; the same seed gives the same plan."""
    station: Station | None = None
    """Tracker, reflectors and keep-out boxes; without it one reflector at the tool point is always seen."""
    criterion: Criterion = "task"
    """``task`` for the expected task error, or D, A, E, O1–O5."""
    campaign: Campaign | None = None
    """Already measured, with points; the plan extends it, with its own model error and prior scale."""
    calibration: Calibration | None = None
    """Of the model, from points; the plan adds what lowers its uncertainty over the task the most, with its own model error
    and prior scale. It stands for its campaign, so that only one of the two is given."""
    candidates: int | Float[np.ndarray, "n joints"] = CANDIDATES
    """How many poses to choose among; or the joint positions themselves, radians, which are then not refined."""
    refine: int = 2
    """Rounds of continuous refinement after the exchange."""
    registration: Registration | None = None
    """Where tracker and targets are, if known; a campaign or a calibration brings its own."""
    noise: TrackerNoise | None = None
    """The tracker's; None for the default."""
    model_error: float | None = None
    """Standard deviation per axis of what geometry does not explain, metres; None for that of the robot's file, or of a typical
    robot (`model_error_of`). A campaign or a calibration brings its own."""
    prior_scale: float = 1.0
    """Factor of the tolerances."""
    progress: Callable[[str], None] = lambda _: None
    """Told what is being done."""
    observe: MeasuringWay | None = None
    """How to measure without a tracker, and what stands where; station, registration and noise are a tracker's."""

    def __post_init__(self) -> None:
        expect_kinds(
            {
                "campaign": Campaign | None,
                "calibration": Calibration | None,
                "station": Station | None,
                "registration": Registration | None,
                "noise": TrackerNoise | None,
                "observe": MeasuringWay | None,
            },
            campaign=self.campaign,
            calibration=self.calibration,
            station=self.station,
            registration=self.registration,
            noise=self.noise,
            observe=self.observe,
        )
        if self.campaign is not None and self.calibration is not None:
            raise ValueError("give the campaign or the calibration from it; together they would count it twice")
        if self.criterion not in CRITERIA:
            raise UnknownName("criterion", self.criterion, CRITERIA)

    @classmethod
    def of(cls, **choices: Unpack[PlanChoices]) -> "PlanOptions":
        """Options by keywords, those not named as in ``options``, or as by default.

        Raises:
            TypeError: an option that does not exist; the message names all.
        """
        return with_choices(choices.pop("options", None) or cls(), choices, "a plan")


# Poses of a plan moved a little, each to the best of some variations.

VARIATIONS = 24
"""Tried of each pose in a round."""


def refine(
    model: ErrorModel,
    experiment: Experiment,
    task: Task,
    station: Station | None,
    q: Float[np.ndarray, "count joints"],
    visible: Bool[np.ndarray, "count targets"],
    *,
    scale: float,
    seed: int,
) -> tuple[Float[np.ndarray, "count joints"], Bool[np.ndarray, "count targets"]]:
    """Move each pose in turn to the best of some variations, if that lowers the expected error.

    Args:
        model: the model.
        experiment: of the plan.
        task: whose enlarged workspace the poses stay in.
        station: of the plan.
        q: the poses, radians.
        visible: which reflectors are seen at each.
        scale: standard deviation of the variations, radians or metres.
        seed: of the variations.
    """
    rng = np.random.default_rng(seed)
    q, visible = q.copy(), visible.copy()
    moved = (q[:, None] + scale * rng.normal(size=(len(q), VARIATIONS, q.shape[1]))).reshape(-1, q.shape[1])
    ok = model.robot.inside_limits(moved) & closes(model, moved)
    room = enlarge(task, model).workspace
    assert room is not None
    ok[ok] = room.contains(model.poses(moved[ok]))
    sees = np.zeros((len(moved), visible.shape[1]), dtype=bool)
    able, seen = check(model, moved[ok], place_links(model, moved[ok]), station)
    ok[np.flatnonzero(ok)] = able
    sees[ok] = seen[able]
    rows = np.zeros((len(moved), experiment.rows(q[:1], visible[:1]).shape[1], experiment.basis.shape[1]))
    rows[ok] = experiment.rows(moved[ok], sees[ok])
    own = experiment.rows(q, visible)
    M = experiment.prior + np.einsum("nbi,nbj->ij", own, own)
    for k in range(len(q)):
        near = k * VARIATIONS + np.flatnonzero(ok[k * VARIATIONS : (k + 1) * VARIATIONS])
        without = np.linalg.inv(M - own[k].T @ own[k])
        trials = np.concatenate([own[k][None], rows[near]])
        U = trials @ without
        S = np.eye(trials.shape[1]) + U @ np.swapaxes(trials, 1, 2)
        gain = np.trace(np.linalg.solve(S, U @ experiment.task @ np.swapaxes(U, 1, 2)), axis1=1, axis2=2)
        best = int(np.argmax(gain))
        if best:
            M = M - own[k].T @ own[k] + trials[best].T @ trials[best]
            own[k], q[k], visible[k] = trials[best], moved[near[best - 1]], sees[near[best - 1]]
    return q, visible


# The order in which to visit poses: short ways, and joints that keep turning the same way.

REVERSAL = 0.1
"""What a change of direction of one joint costs, in radians of travel: gears settle on the same flank if joints come from
the same side."""


def order_visits(robot: Robot, q: Float[np.ndarray, "n joints"]) -> Int[np.ndarray, " n"]:
    """A short tour through all poses, looked for from the one nearest to the middle of the limits.

    The way between two poses costs the largest joint movement, and every reversal of a joint a little more. Nearest
    neighbours first, or the order given where that is shorter, then reversals of parts of the tour while they shorten it
    (2-opt; Croes 1958).
    """
    n = len(q)
    if n < 3:
        return np.arange(n)
    limits = np.clip(robot.limits, -np.pi, np.pi)
    left = set(range(n))
    tour = [int(np.argmin(np.abs(q - limits.mean(axis=1)).max(axis=1)))]
    left.remove(tour[0])
    while left:
        rest = np.array(sorted(left))
        tour.append(int(rest[np.argmin(np.abs(q[rest] - q[tour[-1]]).max(axis=1))]))
        left.remove(tour[-1])
    best = min(np.array(tour), np.arange(n), key=lambda order: _cost(q[order]))
    improved = True
    while improved:
        improved = False
        for i in range(n - 1):
            j = i + 2
            while j <= n:
                shorter = np.flatnonzero(_changes(q[best], i, np.arange(j, n + 1)) < -1e-9)
                if not len(shorter):
                    break
                j += int(shorter[0])
                best[i:j] = best[i:j][::-1].copy()
                improved, j = True, j + 1
    return best


def _changes(q: Float[np.ndarray, "n joints"], i: int, ends: Int[np.ndarray, " k"]) -> Float[np.ndarray, " k"]:
    """By how much the cost changes where the poses from i up to each of some ends are visited the other way round.

    Only the steps into that part and out of it change, and the turns beside them.
    """
    nowhere = np.full((2, q.shape[1]), np.nan)
    around = np.concatenate([nowhere, q, nowhere])
    j, k = ends + 2, np.full(len(ends), i + 2)
    before = np.stack([[k - 2, k - 1, k, k + 1], [j - 2, j - 1, j, j + 1]])
    after = np.stack([[k - 2, k - 1, j - 1, j - 2], [k + 1, k, j, j + 1]])
    first, then = (_cost(around[part.transpose(0, 2, 1)]).sum(axis=0) for part in (before, after))
    return then - first


def _cost(q: Float[np.ndarray, "*ways n joints"]) -> Float[np.ndarray, "*ways"]:
    """Of every way through n poses; steps from or to a pose that is not a number cost nothing."""
    step = np.diff(q, axis=-2)
    turns = np.count_nonzero(step[..., 1:, :] * step[..., :-1, :] < 0.0, axis=(-2, -1))
    return np.asarray(np.nan_to_num(np.abs(step).max(axis=-1)).sum(axis=-1) + REVERSAL * turns)


# The poses of plans: what is chosen among, once for all numbers of poses, and the choice itself.


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


# What poses that nobody chose would give: random ones, and ones spread evenly over the task's own workspace.

RANDOM_PLANS = 20


def random_plan_errors(
    model: ErrorModel,
    experiment: Experiment,
    task: Task,
    station: Station | None,
    measurable: Measurable,
    count: int,
    seed: int,
) -> Float[np.ndarray, " plans"]:
    """Expected error of random poses from the task's own workspace."""
    pool = _own_poses(model, task, station, measurable, max(10 * count, 600), seed + 77, count)
    rng = np.random.default_rng(seed)
    picks = [rng.permutation(len(pool.q))[:count] for _ in range(RANDOM_PLANS)]
    return np.array([experiment.error(pool.q[pick], pool.visible[pick]) for pick in picks])


def even_plan_error(
    model: ErrorModel, experiment: Experiment, task: Task, station: Station | None, measurable: Measurable, count: int
) -> float:
    """Expected error of as many poses spread evenly over the task's own workspace."""
    pool = _own_poses(model, task, station, measurable, 3 * count, 0, count)
    pick = np.linspace(0, len(pool.q) - 1, min(count, len(pool.q))).astype(int)
    return experiment.error(pool.q[pick], pool.visible[pick])


def _own_poses(
    model: ErrorModel, task: Task, station: Station | None, measurable: Measurable, tried: int, seed: int, needed: int
) -> Measurable:
    """Measurable poses of the task itself; of the candidates, where the tracker does not see enough of the task."""
    try:
        own = keep_measurable(model, reach_task(model, task, tried, seed), station)
    except ReachError:
        return measurable
    return own if len(own.q) >= needed else measurable


# Which postures to measure in without a tracker, so that the task becomes accurate.


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


# What is asked of a plan, and whether it gives that: so many poses, and the accuracy that the task states.


def check_demands(plan: Plan, count: int) -> None:
    """See that a plan gives what was asked.

    An accuracy counts as out of reach if not even all candidates that can be measured would be poses enough. Where the
    model error alone takes all of it, the poses are worth measuring all the same, as that may turn out smaller: then only
    what the geometry leaves is held against it.

    Args:
        plan: the plan.
        count: poses that were asked for.

    Raises:
        ReachError: fewer poses can be measured than were asked for, or the task's accuracy is out of reach.
    """
    if len(plan.q) < count:
        raise ReachError(
            f"only {plan.candidates} candidate poses can be measured, {count} were asked for "
            f"({describe_lost(plan) or 'none fell away'}); give more --candidates, or ask for fewer poses"
        )
    wanted = plan.geometry_allowance or plan.accuracy
    if wanted is not None and extrapolate_poses(plan, wanted) > plan.candidates > 0:
        raise ReachError(
            f"the task's accuracy of {(plan.accuracy or wanted) * 1e3:g} mm is out of reach: {count} poses are expected to "
            f"leave {plan.expected * 1e3:.3g} mm rms{_allowance(plan)}, and not even all {plan.candidates} that can be "
            "measured would do; state an accuracy that can be had, or leave it out of the task"
        )


def extrapolate_poses(plan: Plan, error: float) -> float:
    """How many poses would lower the geometry's expected error to `error`, metres, if it falls with the root of their number."""
    return len(plan.q) * (plan.expected / error) ** 2


def describe_lost(plan: Plan) -> str:
    """How many candidates fell away for each reason, in words; empty where none did."""
    return ", ".join(f"{number} {reason}" for reason, number in plan.lost.items() if number)


def describe_accuracy(plan: Plan) -> str:
    """Whether the plan meets the accuracy that the task states, and with how many poses, in words."""
    if plan.accuracy is None:
        return "the task states none"
    stated, allowed = f"the task's {plan.accuracy * 1e3:g} mm", plan.geometry_allowance
    if not allowed:
        alone = float(np.sqrt(3.0)) * plan.model_error
        return (
            f"no number of poses meets {stated}: the model error alone leaves {alone * 1e3:.3g} mm (rms in space); "
            "identifying what causes it, effects above all, is worth more than poses"
        )
    if plan.enough is not None:
        return f"the first {plan.enough} poses chosen meet {stated}, model error included"
    if plan.expected <= allowed:
        return f"the whole plan meets {stated}, model error included"
    return f"the plan does not meet {stated}; about {extrapolate_poses(plan, allowed):.0f} poses would, model error included"


def _allowance(plan: Plan) -> str:
    """How much of the accuracy the model error of a single pose leaves to the geometry, in words."""
    if not plan.geometry_allowance or not plan.model_error:
        return ""
    return (
        f", the model error of {plan.model_error * 1e3:.3g} mm per axis allows {plan.geometry_allowance * 1e3:.3g} mm"
    )
