"""Plan of the measurement poses that minimise the expected task error."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.arguments import Named, by_name, checked, chosen_options
from taskcal.campaigns.campaign import in_blocks
from taskcal.errors import CampaignError, ReachError
from taskcal.estimation.experiment_design import Candidates, Choice, choose, choose_at_random
from taskcal.estimation.matrices import single_threaded
from taskcal.kinematics.clearance import place_links
from taskcal.kinematics.inverse import closes
from taskcal.observations.base import check_lengths
from taskcal.observations.instrument import BlockedPath, Instrument, Measurable, find_blocked_paths
from taskcal.observations.point import Station, Tracker
from taskcal.planning.expected_error import (
    PlanPrior,
    assumed_hyperparameters,
    prior_from_calibration,
    prior_from_campaign,
)
from taskcal.planning.experiment import Experiment, as_predicted, calibrated_experiments, make_experiment, nominal_error
from taskcal.planning.options import PlanOptions
from taskcal.planning.task_map import allow_geometry
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal.task.task import Task, TaskPoses, enlarge, reach_task

# A plan: poses to measure, and what is expected of them.


@dataclass(frozen=True, eq=False, kw_only=True)
class Plan:
    """Poses to measure, in the order in which to measure them."""

    q: Float[np.ndarray, "count joints"]
    """Radians."""
    rows: tuple[int, ...]
    """Which of the candidates each pose is, or was before it was refined."""
    visible: Bool[np.ndarray, "count targets"]
    """Which reflectors the tracker sees at each; without a tracker, which of the fixtures is measured."""
    expected: float
    """Expected rms error in space over the task after these measurements, metres: in the tracker's frame, or without a tracker
    wherever the robot's base is."""
    random: Float[np.ndarray, " plans"]
    """The same for as many random poses of the task's own workspace, of several plans."""
    grid: float
    """The same for as many space-filling poses over the task's own workspace."""
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
    beside: float = 0.0
    """What else a calibration that is planned on does not tell of a single pose of the task, as it is reached: of the joints and of
    conditions, and the model error's growth beyond the measured range; rms in space, metres."""
    instrument: Instrument = field(default_factory=Tracker)
    """What measures."""
    of: Int[np.ndarray, " count"] | None = None
    """Without a tracker: the fixture that each pose is measured at."""
    stations: int = 1
    """Places that the tracker is moved to."""
    blocked: tuple[BlockedPath, ...] = ()
    """Without a tracker: poses that the robot cannot be driven to from the one before, all joints at once, and stay clear."""
    views: Mapping[str, Float[np.ndarray, " count"]] = field(default_factory=dict[str, np.ndarray])
    """Without a tracker: figures of each pose by name and unit, as the instrument gives them: of images corners, distance, tilt."""

    @property
    def names(self) -> tuple[str, ...]:
        """Without a tracker: name of the fixture that each pose is measured at; with one empty."""
        return () if self.of is None else tuple(self.instrument.fixtures.names[k] for k in self.of)

    @property
    def station(self) -> Int[np.ndarray, " count"]:
        """Station that each pose is measured from, counted from 0."""
        return in_blocks(len(self.q), self.stations)

    @property
    def at_a_pose(self) -> float:
        """What no plan lowers of the error of a single pose of the task, the model error above all; rms in space, metres."""
        return float(np.hypot(np.sqrt(3.0) * self.model_error, self.beside))

    @property
    def expected_at_a_pose(self) -> float:
        """Expected rms error in space of a single pose of the task: the prediction's, and the model error beside it, metres."""
        return float(np.hypot(self.expected, self.at_a_pose))

    def __repr__(self) -> str:
        return (
            f"Plan({len(self.q)} poses: {self.expected * 1e3:.4f} mm expected over the task, random "
            f"{float(np.mean(self.random)) * 1e3:.4f} mm, spread evenly {self.grid * 1e3:.4f} mm, "
            f"before {self.before * 1e3:.4f} mm)"
        )

    @property
    def geometry_allowance(self) -> float | None:
        """Error that the accuracy leaves to the identified geometry, beside the model error of a single pose, metres.

        None if no accuracy is stated; zero if the model error alone takes all of it.
        """
        return allow_geometry(self.accuracy, self.at_a_pose / np.sqrt(3.0))

    @property
    def enough(self) -> int | None:
        """Number of poses that the accuracy needs at a single pose of the task, the model error of that pose included.

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
            "stations": self.stations,
            "criterion": self.criterion,
            "expected_error_mm": self.expected * 1e3,
            "expected_with_model_error_mm": self.expected_at_a_pose * 1e3,
            "model_error_mm": self.model_error * 1e3,
            "model_error_origin": self.model_error_origin,
            "random_expected_error_mm": float(np.mean(self.random)) * 1e3,
            "random_plans": len(self.random),
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
            **self._of_fixtures(),
        }

    def _of_fixtures(self) -> dict[str, Any]:
        """Columns that state what is measured at which fixture, without a tracker."""
        if self.of is None:
            return {}
        names, label = self.names, self.instrument.label
        blocked = [{"pose": path.pose, "way_round": path.via is not None} for path in self.blocked]
        out: dict[str, Any] = {"observe": self.instrument.name, "instructions": self.instrument.instructions}
        out["mounted_mm"] = (self.instrument.T_tool_tip[:3, 3] * 1e3).tolist()
        if label:
            out |= {"fixture": label, label: list(names)}
        out["not_clear_from_the_pose_before"] = blocked
        if self.views:
            out["views"] = {name: values.tolist() for name, values in self.views.items()}
        if label:
            out["poses_each"] = {name: names.count(name) for name in self.instrument.fixtures.names}
        return out


GOAL_POSES = 200
"""Poses that stand for a task: with 50 to 1600 of them its sensitivity to all unknowns is the same within a thousandth."""


# Poses of a plan moved a little, each to the best of some variations. The figures are those of `taskcal.planning.options`.

VARIATIONS = 24
"""Tried of each pose in a round: 20.5 with 12, 20.4 with 24, 20.2 with 48."""

VARIATION_SPREAD = 0.12
"""Standard deviation of every joint in the first round, radians or metres, and 1/k of it in round k: about 7°, some tenths of a
joint's range over a task. A convention."""


def refine(
    model: ErrorModel,
    experiment: Experiment,
    task: Task,
    instrument: Instrument,
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
        instrument: of the plan, one that varies.
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
    able, seen = instrument.check(model, moved[ok], place_links(model, moved[ok]))
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

REVERSAL_RAD = 0.1
"""Cost of a change of direction of one joint, radians of travel: gears settle on the same flank if joints come from the same side.
A convention: a detour of 6° for each."""

MIN_GAIN_RAD = 1e-9
"""Cost by which a tour has to become less, radians: above rounding, so that the search ends."""


def order_visits(robot: Robot, q: Float[np.ndarray, "n joints"]) -> Int[np.ndarray, " n"]:
    """A short tour through all poses, looked for from the one nearest to the middle of the limits.

    The way between two poses costs the largest joint movement, and every reversal of a joint a little more. Nearest
    neighbours first, or the order given where that is shorter, then reversals of parts of the tour while they shorten it
    (2-opt; Croes 1958).
    """
    n = len(q)
    if n < 3:
        return np.arange(n)
    limits = robot.bounded_limits()
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
                shorter = np.flatnonzero(_changes(q[best], i, np.arange(j, n + 1)) < -MIN_GAIN_RAD)
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
    """Cost of every way through n poses; steps from or to a pose that is not a number cost nothing."""
    step = np.diff(q, axis=-2)
    turns = np.count_nonzero(step[..., 1:, :] * step[..., :-1, :] < 0.0, axis=(-2, -1))
    return np.asarray(np.nan_to_num(np.abs(step).max(axis=-1)).sum(axis=-1) + REVERSAL_RAD * turns)


# The poses of plans: what is chosen among, once for all numbers of poses, and the choice itself.


@dataclass(frozen=True, eq=False, kw_only=True)
class ChosenPoses:
    """Poses to measure, in the order in which to measure them."""

    q: Float[np.ndarray, "count joints"]
    """Radians."""
    visible: Bool[np.ndarray, "count targets"]
    """What is seen at each, or measured."""
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
    single: float | None
    """Of a calibration the mean square of what it does not tell of a single pose of the task (`PoseErrors`), metres²."""

    @classmethod
    @single_threaded
    def among(
        cls, model: ErrorModel, task: Task, options: PlanOptions, measurable: Measurable | None = None
    ) -> "PoseChoice":
        """The choice among an instrument's poses.

        Args:
            model: to be identified.
            task: what the robot has to do.
            options: of the plan; of a calibration without a tracker, the instrument has its fixtures in the same order.
            measurable: the poses, where they were looked for before.

        Raises:
            ReachError: no candidate can be reached and seen, or a fixture in too few.
            CampaignError: a campaign or calibration that cannot be extended.
        """
        options.progress("candidates")
        goal = reach_task(model, task, GOAL_POSES, options.seed)
        measurable = measurable or options.instrument.find(model, task, options.candidates, options.seed)
        prior = _prior(model, options)
        judged, weighing = _experiments(model, goal, measurable, prior, options)
        single = None
        if prior.calibration is not None:
            judged, single = as_predicted(judged, prior.calibration, goal)
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
            single=single,
        )

    @single_threaded
    def choose(self, count: int) -> ChosenPoses:
        """So many poses.

        Raises:
            CampaignError: fewer than frames and fixtures need.
        """
        check_count(count, self.options, len(self.weighing.linear.layout.targets))
        options, q = self.options, self.measurable.q
        options.progress(f"choosing {count} of {len(q)}")
        choice = choose(self.candidates, count, options.criterion, progress=options.progress)
        q, visible = self._refined(q[choice.chosen], self.measurable.visible[choice.chosen])
        order = self._order(q, visible)
        return ChosenPoses(q=q[order], visible=visible[order], candidate=choice.chosen[order], choice=choice)

    def _refined(
        self, q: Float[np.ndarray, "count joints"], visible: Bool[np.ndarray, "count targets"]
    ) -> tuple[Float[np.ndarray, "count joints"], Bool[np.ndarray, "count targets"]]:
        """The poses after some rounds of refinement; as they are, where the poses or another criterion are given."""
        options = self.options
        if not options.instrument.varies or options.criterion != "task" or not isinstance(options.candidates, int):
            return q, visible
        for round_ in range(options.refine):
            options.progress(f"refining, round {round_ + 1}")
            scale, seed = VARIATION_SPREAD / (1 + round_), options.seed + round_
            q, visible = refine(
                self.model, self.weighing, self.task, options.instrument, q, visible, scale=scale, seed=seed
            )
        return q, visible

    def _order(
        self, q: Float[np.ndarray, "count joints"], visible: Bool[np.ndarray, "count targets"]
    ) -> Int[np.ndarray, " count"]:
        """The poses of each setup one after another, each by short ways."""
        instrument = self.options.instrument
        stages = instrument.stages[0 if instrument.kind.in_tracker else visible.argmax(axis=1)] + np.zeros(
            len(q), dtype=int
        )
        parts = [np.flatnonzero(stages == stage) for stage in np.unique(stages)]
        return np.concatenate([own[order_visits(self.model.robot, q[own])] for own in parts])

    def random_errors(self, count: int) -> Float[np.ndarray, " plans"]:
        """Expected error of as many poses that nobody chose, of several plans."""
        rng = np.random.default_rng(self.options.seed)
        pool = self._own_poses(max(POOL_FACTOR * count, MIN_POOL_POSES), self.options.seed + POOL_SEED, count)

        def draw() -> list[int]:
            """So many of the pool, as many of each fixture as it needs."""
            if pool is self.measurable:
                return choose_at_random(self.candidates, count, rng)
            return rng.permutation(len(pool.q))[:count].tolist()

        picks = [draw() for _ in range(RANDOM_PLANS)]
        return np.array([self.judged.error(pool.q[pick], pool.visible[pick]) for pick in picks])

    def even_error(self, count: int) -> float:
        """Expected error of as many space-filling poses over the task, or over the fixtures and the postures they allow."""
        pool = self._own_poses(EVEN_FACTOR * count, 0, count)
        pick = np.linspace(0, len(pool.q) - 1, min(count, len(pool.q))).astype(int)
        return self.judged.error(pool.q[pick], pool.visible[pick])

    def _own_poses(self, tried: int, seed: int, needed: int) -> Measurable:
        return self.options.instrument.own_poses(self.model, self.task, self.measurable, tried, seed, needed)


def draw_task_poses(
    model: ErrorModel, task: Task, count: int, *, seed: int = 0, station: Station | None = None
) -> Float[np.ndarray, "count joints"]:
    """Poses of a task that chance chooses among those that can be measured, to judge a calibration by.

    Args:
        model: of the robot.
        task: the task.
        count: how many.
        seed: of the choice.
        station: tracker and keep-out boxes; None for a tracker that sees the reflector everywhere.

    Returns:
        joints, radians.

    Raises:
        ReachError: fewer can be measured.
    """
    own = Tracker(station=station).keep(
        model, reach_task(model, task, max(POOL_FACTOR * count, MIN_POOL_POSES), seed + POOL_SEED)
    )
    if len(own.q) < count:
        raise ReachError(
            f"{len(own.q)} poses of the task can be measured, and {count} are to be kept out; ask for fewer"
        )
    return own.q[np.random.default_rng(seed).permutation(len(own.q))[:count]]


RANDOM_PLANS = 20
"""Random plans whose expected errors are compared with that of a plan: they scatter by 6 % (30 poses of a machining robot),
and their mean by less than 2 %."""

POOL_FACTOR, MIN_POOL_POSES, POOL_SEED = 10, 600, 77
"""Poses that random plans are drawn from, for each of theirs and at least, so that two plans have few in common; and what their
seed is off from that of the candidates. A convention."""

EVEN_FACTOR = 3
"""Poses tried for each of a space-filling plan: a workspace that is reached by a third still gives as many. A convention."""

ADVISED_POSES, ADVISED_POSES_WITHOUT_TRACKER = 30, 60
"""Poses that a message recommends, with a tracker and without one. A convention."""


def _prior(model: ErrorModel, options: PlanOptions) -> PlanPrior:
    """Prior of the plan."""
    if options.campaign is not None:
        return prior_from_campaign(model, options.campaign, options.station, options.noise, options.target_within)
    if options.calibration is not None:
        return prior_from_calibration(model, options.calibration, options.station)
    hyper = assumed_hyperparameters(model, options.model_error, options.prior_scale)
    return PlanPrior(hyper=hyper, registration=options.registration, target_within=options.target_within)


def _experiments(
    model: ErrorModel, goal: TaskPoses, measurable: Measurable, prior: PlanPrior, options: PlanOptions
) -> tuple[Experiment, Experiment]:
    """To judge plans by, and to choose their poses by: there, what geometry does not explain is a smooth field."""
    if prior.calibration is not None and prior.calibration.joint_error:
        return calibrated_experiments(prior.calibration, goal, measurable, options.instrument, options.noise)
    judged, chosen = (
        make_experiment(
            model,
            goal,
            measurable,
            prior,
            options.instrument,
            noise=options.noise,
            smooth=smooth,
            stations=options.stations,
        )
        for smooth in (False, True)
    )
    return judged, chosen


def check_count(count: int, options: PlanOptions, targets: int) -> None:
    """Check that so many poses are enough for frames and fixtures, and that the plan may go on from what is known.

    Raises:
        CampaignError: they are not, or a plan without a tracker would go on from a campaign or calibration.
    """
    instrument = options.instrument
    check_lengths([instrument.kind])
    extends = options.campaign is not None or options.calibration is not None
    if instrument.kind.in_tracker:
        frames = 6 * options.stations + 3 * targets
        fewest = max(frames // (3 * targets) + 1, 3 * options.stations if options.stations > 1 else 1)
        if count < 1 or (not extends and count < fewest):
            raise CampaignError(
                f"{count} poses are too few: tracker frame and targets alone have {frames} unknowns; plan at least {fewest}, "
                f"better {ADVISED_POSES} or more"
            )
        return
    if extends:
        raise CampaignError(f"a plan with a {instrument.name} begins anew; leave the campaign or calibration out")
    fewest = instrument.rows_each * instrument.count
    if count < fewest:
        each = f"each of {instrument.count} {instrument.label}s" if instrument.label else f"the {instrument.name}"
        raise CampaignError(
            f"{count} poses are too few: {each} needs {instrument.rows_each}; plan at least {fewest}, better "
            f"{max(ADVISED_POSES_WITHOUT_TRACKER, 2 * fewest)} or more, or leave fixtures out"
        )


@by_name(PlanOptions)
@checked
@single_threaded
def plan(
    _kind: Callable[Named, PlanOptions],
    model: ErrorModel,
    task: Task,
    count: int = 60,
    options: PlanOptions | None = None,
    *_args: Named.args,
    **_named: Named.kwargs,
) -> Plan:
    """Choose the poses whose measurement leaves the least expected error over the task.

    Args:
        model: the model to be identified.
        task: what the robot has to do.
        count: poses to measure.
        options: all at once; those that are named replace what is in them.

    Raises:
        ReachError: no candidate can be reached and seen, or a fixture cannot be measured.
        CampaignError: fewer poses than frames and fixtures need, or a campaign or calibration that cannot be extended.
    """
    chosen = chosen_options(_kind, options, *_args, **_named)
    targets = 1 if chosen.station is None else len(chosen.station.reflectors)
    check_count(count, chosen, targets)
    planning = PoseChoice.among(model, task, chosen)
    poses = planning.choose(count)
    measurable, experiment, prior = planning.measurable, planning.judged, planning.prior
    q, visible, choice = poses.q, poses.visible, poses.choice
    instrument = chosen.instrument
    of = None if instrument.kind.in_tracker else visible.argmax(axis=1)
    known, white = prior.calibration is not None, 3.0 * prior.hyper.model_error[0] ** 2
    return Plan(
        rows=tuple(int(measurable.rows[i]) for i in poses.candidate),
        q=q,
        visible=visible,
        of=of,
        instrument=instrument,
        expected=experiment.error(q, visible),
        random=planning.random_errors(count),
        grid=planning.even_error(count),
        by_count=experiment.errors_by_count(measurable.q[choice.started], measurable.visible[choice.started]),
        before=experiment.before if known else nominal_error(experiment, planning.goal, q, visible, prior.campaign),
        criterion=chosen.criterion,
        exchanges=choice.exchanges,
        lost=dict(measurable.lost),
        candidates=len(measurable.q),
        accuracy=task.accuracy,
        extends=known,
        stations=chosen.stations,
        model_error=prior.hyper.model_error[0],
        model_error_origin=prior.hyper.origin,
        beside=0.0 if planning.single is None else float(np.sqrt(max(planning.single - white, 0.0))),
        blocked=() if of is None else find_blocked_paths(model.nominal, instrument, q, of),
        views={} if of is None else instrument.views(model.nominal, q, of),
    )


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
    if wanted is not None and extrapolate_poses(len(plan.q), plan.expected, wanted) > plan.candidates > 0:
        raise ReachError(
            f"the task's accuracy of {(plan.accuracy or wanted) * 1e3:g} mm is out of reach: {count} poses are expected to "
            f"leave {plan.expected * 1e3:.3g} mm rms{_allowance(plan)}, and not even all {plan.candidates} that can be "
            "measured would do; state an accuracy that can be had, or leave it out of the task"
        )


def extrapolate_poses(count: int, expected: float, error: float) -> float:
    """Number of poses that lower an expected error of the geometry to another, if it falls with the root of their number.

    Args:
        count: number of poses that leave the expected error.
        expected: that error.
        error: the other one, in the same unit.
    """
    return count * (expected / error) ** 2


def describe_lost(plan: Plan) -> str:
    """State how many candidates were rejected for each reason; empty where none was."""
    return ", ".join(f"{number} {reason}" for reason, number in plan.lost.items() if number)


def _allowance(plan: Plan) -> str:
    """State the share of the accuracy that the model error of a single pose leaves to the geometry."""
    if not plan.geometry_allowance or not plan.at_a_pose:
        return ""
    error = plan.at_a_pose / np.sqrt(3.0)
    return f", the model error of {error * 1e3:.3g} mm per axis allows {plan.geometry_allowance * 1e3:.3g} mm"
