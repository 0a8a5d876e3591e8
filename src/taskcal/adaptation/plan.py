"""Which poses to measure, so that the task becomes accurate."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.adaptation.candidates import (
    Experiment,
    Measurable,
    check,
    enlarge,
    find_measurable,
    keep_measurable,
    make_experiment,
)
from taskcal.adaptation.expected_error import design
from taskcal.adaptation.plan_prior import PlanPrior, prior_from_calibration, prior_from_campaign
from taskcal.adaptation.visiting_order import order_visits
from taskcal.arguments import expect_kinds
from taskcal.errors import CampaignError, ReachError, UnknownName
from taskcal.estimation.blas import single_threaded
from taskcal.estimation.experiment_design import CRITERIA, Criterion, choose
from taskcal.identification.calibration import Calibration
from taskcal.kinematics.clearance import place_links
from taskcal.kinematics.inverse import closes
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.registration import Registration
from taskcal.measurement.station import Station
from taskcal.measurement.tracker import TrackerNoise
from taskcal.measurement.virtual_cell import simulate
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.model_error import model_error_of
from taskcal.task.task import Task, TaskPoses, reach_task

CANDIDATES = 10_000
RANDOM_PLANS = 20
NEARBY = 24
"""Variations tried of each pose in a round of refinement."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Plan:
    """Poses to measure, in the order in which to measure them."""

    q: Float[np.ndarray, "count joints"]
    """Radians."""
    rows: tuple[int, ...]
    """Which of the candidates each pose is, or was before it was refined."""
    visible: Bool[np.ndarray, "count targets"]
    """Which reflectors the tracker sees at each."""
    expected: float
    """Expected rms error in space over the task after these measurements, tracker frame, metres."""
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
    def enough(self) -> int | None:
        """How many poses the accuracy needs; None if these do not reach it or none is stated."""
        if self.accuracy is None:
            return None
        met = np.flatnonzero(self.by_count <= self.accuracy)
        return int(met[0]) + 1 if len(met) else None

    def to_json(self) -> dict[str, Any]:
        """Machine-readable, in millimetres."""
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
            "poses_needed": self.enough,
            "candidates": self.candidates,
            "lost": self.lost,
            "exchanges": self.exchanges,
        }


@single_threaded
def plan(
    model: ErrorModel,
    task: Task,
    count: int = 60,
    *,
    seed: int = 0,
    station: Station | None = None,
    criterion: Criterion = "task",
    campaign: Campaign | None = None,
    calibration: Calibration | None = None,
    candidates: int | Float[np.ndarray, "n joints"] = CANDIDATES,
    refine: int = 2,
    registration: Registration | None = None,
    noise: TrackerNoise | None = None,
    model_error: float | None = None,
    prior_scale: float = 1.0,
    progress: Callable[[str], None] = lambda _: None,
) -> Plan:
    """Choose the poses whose measurement leaves the least expected error over the task.

    Args:
        model: the model to be identified.
        task: what the robot has to do.
        count: poses to measure.
        seed: of the candidates and of the refinement; the same seed gives the same plan.
        station: tracker, reflectors and keep-out boxes; without it one reflector at the tool point is always seen.
        criterion: ``task`` for the expected task error, or D, A, E, O1–O5.
        campaign: already measured, with points; the plan extends it, with its own model error and prior scale.
        calibration: of this model from points; the plan adds what lowers its uncertainty over the task the most, with its own
            model error and prior scale. It stands for its campaign, so that only one of the two is given.
        candidates: how many poses to choose among; or the joint positions themselves, which are then not refined.
        refine: rounds of continuous refinement after the exchange.
        registration: where tracker and targets are, if known; a campaign or a calibration brings its own.
        noise: the tracker's.
        model_error: standard deviation per axis of what geometry does not explain, metres; by default that of the robot's file,
            or of a typical robot (`model_error_of`). A campaign or a calibration brings its own.
        prior_scale: factor of the tolerances.
        progress: told what is being done.

    Raises:
        ReachError: no candidate can be reached and seen.
        CampaignError: fewer poses than tracker frame and targets need, or a campaign or calibration that cannot be extended.
    """
    expect_kinds({"model": ErrorModel, "task": Task}, model=model, task=task)
    if campaign is not None and calibration is not None:
        raise ValueError("give the campaign or the calibration from it; together they would count it twice")
    if criterion not in CRITERIA:
        raise UnknownName("criterion", criterion, CRITERIA)
    progress("candidates")
    goal = reach_task(model, task, 200, seed)
    if isinstance(candidates, int):
        found = find_measurable(model, task, station, candidates, seed)
    else:
        found, refine = keep_measurable(model, _as_reached(model, candidates), station), 0
    if campaign is not None:
        prior = prior_from_campaign(model, campaign, station, noise)
    elif calibration is not None:
        prior = prior_from_calibration(model, calibration, station)
    else:
        assumed = model_error_of(model.robot, model_error)
        prior = PlanPrior(
            model_error=assumed.position,
            model_error_origin=assumed.source,
            prior_scale=prior_scale,
            registration=registration,
        )
    experiment, weighing = (
        make_experiment(
            model,
            goal,
            found,
            station,
            campaign=prior.campaign,
            calibration=calibration,
            registration=prior.registration,
            noise=noise,
            model_error=prior.model_error,
            prior_scale=prior.prior_scale,
            smooth=smooth,
        )
        for smooth in (False, True)
    )
    _check_count(count, experiment, prior)
    progress(f"choosing {count} of {len(found.q)}")
    chosen = choose(weighing.candidates(found), count, criterion, progress=progress)
    q, visible = found.q[chosen.chosen], found.visible[chosen.chosen]
    if criterion == "task":
        for round_ in range(refine):
            progress(f"refining, round {round_ + 1}")
            scale = 0.12 / (1 + round_)
            q, visible = _refine(model, weighing, task, station, q, visible, scale=scale, seed=seed + round_)
    order = order_visits(model.robot, q)
    q, visible = q[order], visible[order]
    return Plan(
        rows=tuple(int(found.rows[i]) for i in chosen.chosen[order]),
        q=q,
        visible=visible,
        expected=experiment.error(q, visible),
        random=_random_plans(model, experiment, task, station, found, count, seed),
        grid=_even_plan(model, experiment, task, station, found, count),
        by_count=_errors_by_count(experiment, found, chosen.started),
        before=experiment.before
        if calibration is not None
        else _before(model, goal, station, _with_measured(prior.campaign, q), noise, prior),
        criterion=criterion,
        exchanges=chosen.exchanges,
        lost=dict(found.lost),
        candidates=len(found.q),
        accuracy=task.accuracy,
        extends=calibration is not None,
        model_error=prior.model_error,
        model_error_origin=prior.model_error_origin,
    )


def _as_reached(model: ErrorModel, q: Float[np.ndarray, "n joints"]) -> TaskPoses:
    n = len(q)
    nothing = np.zeros(n, dtype=bool)
    return TaskPoses(T=model.poses(q), q=np.asarray(q, dtype=float), weights=np.full(n, 1.0 / n), unreachable=nothing)


def _check_count(count: int, experiment: Experiment, prior: PlanPrior) -> None:
    frames = len(experiment.layout.names) - len(experiment.layout.kept)
    fewest = frames // (3 * len(experiment.layout.targets)) + 1
    nothing = prior.campaign is None and prior.calibration is None
    if count < 1 or (nothing and count < fewest):
        raise CampaignError(
            f"{count} poses are too few: tracker frame and targets alone have {frames} unknowns; plan at least {fewest}, "
            "better 30 or more"
        )


def _refine(
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
    moved = (q[:, None] + scale * rng.normal(size=(len(q), NEARBY, q.shape[1]))).reshape(-1, q.shape[1])
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
        near = k * NEARBY + np.flatnonzero(ok[k * NEARBY : (k + 1) * NEARBY])
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


def _errors_by_count(
    experiment: Experiment, found: Measurable, started: Int[np.ndarray, " count"]
) -> Float[np.ndarray, " count"]:
    """Expected error after the first 1, 2, … poses of the greedy start."""
    rows = experiment.rows(found.q[started], found.visible[started])
    information = experiment.prior + np.cumsum(np.swapaxes(rows, 1, 2) @ rows, axis=0)
    return np.sqrt(np.einsum("ij,nij->n", experiment.task, np.linalg.inv(information)))


def _random_plans(
    model: ErrorModel,
    experiment: Experiment,
    task: Task,
    station: Station | None,
    found: Measurable,
    count: int,
    seed: int,
) -> Float[np.ndarray, " plans"]:
    """Expected error of random poses from the task's own workspace."""
    pool = _own_poses(model, task, station, found, max(10 * count, 600), seed + 77, count)
    rng = np.random.default_rng(seed)
    picks = [rng.permutation(len(pool.q))[:count] for _ in range(RANDOM_PLANS)]
    return np.array([experiment.error(pool.q[pick], pool.visible[pick]) for pick in picks])


def _even_plan(
    model: ErrorModel, experiment: Experiment, task: Task, station: Station | None, found: Measurable, count: int
) -> float:
    """Expected error of as many poses spread evenly over the task's own workspace."""
    pool = _own_poses(model, task, station, found, 3 * count, 0, count)
    pick = np.linspace(0, len(pool.q) - 1, min(count, len(pool.q))).astype(int)
    return experiment.error(pool.q[pick], pool.visible[pick])


def _own_poses(
    model: ErrorModel, task: Task, station: Station | None, found: Measurable, tried: int, seed: int, needed: int
) -> Measurable:
    """Measurable poses of the task itself; of the candidates, where the tracker does not see enough of the task."""
    try:
        own = keep_measurable(model, reach_task(model, task, tried, seed), station)
    except ReachError:
        return found
    return own if len(own.q) >= needed else found


def _with_measured(campaign: Campaign | None, q: Float[np.ndarray, "count joints"]) -> Float[np.ndarray, "n joints"]:
    return q if campaign is None else np.concatenate([campaign.q, q])


def _before(
    model: ErrorModel,
    goal: TaskPoses,
    station: Station | None,
    q: Float[np.ndarray, "n joints"],
    noise: TrackerNoise | None,
    prior: PlanPrior,
) -> float:
    """Expected error when the measurements only serve to find tracker frame and targets."""
    targets = None if station is None else {r.name: r.position for r in station.reflectors}
    rng, x = np.random.default_rng(0), np.zeros(len(model))
    nominal, _ = simulate(model, q, rng=rng, x=x, targets=targets, noise=noise)
    return design(
        model, nominal, goal, noise=noise, model_error=(prior.model_error,), prior_scale=prior.prior_scale
    ).before
