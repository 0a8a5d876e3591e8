"""Poses that could be measured: reachable, clear, seen by the tracker; and what each would say."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from taskcal.errors import ReachError
from taskcal.estimation.experiment_design import Candidates
from taskcal.geometry import walk
from taskcal.identification.problem import FrameLayout, whitener
from taskcal.kinematics.clearance import Links, clear_of_boxes, clear_of_itself, place_links
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.registration import Registration
from taskcal.measurement.station import Station
from taskcal.measurement.tracker import TrackerNoise
from taskcal.measurement.virtual_cell import TRACKER_POSE
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, TaskPoses, reach_task
from taskcal.task.workspace import Orientation, Workspace

ROOM, TURN = 1.5, np.radians(45.0)
"""Measured poses may lie in a box 1.5 times the task's, with the tool up to 45° from the task's orientations."""

FRAME_DEVIATION = 1.0
"""Prior standard deviation of tracker frame and targets, metres and radians: as good as none beside millimetres."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Measurable:
    """Poses that can be measured."""

    q: Float[np.ndarray, "n joints"]
    """Radians."""
    visible: Bool[np.ndarray, "n targets"]
    """Which reflectors the tracker sees."""
    lost: Mapping[str, int]
    """How many of the poses tried fell away, by reason."""


def enlarge(task: Task, model: ErrorModel) -> Task:
    """A task's workspace with the room that measuring poses may take; around the poses of a list or a path."""
    if task.workspace is not None:
        space = task.workspace
        turned = tuple(
            Orientation(rotation=o.rotation, cone=max(o.cone, TURN), spin=max(o.spin, TURN)) for o in space.orientations
        )
        return replace(task, workspace=replace(space, size=ROOM * space.size, orientations=turned))
    assert task.poses is not None
    low, high = task.poses[:, :3, 3].min(axis=0), task.poses[:, :3, 3].max(axis=0)
    # a flat or narrow path still needs room in every direction
    size = np.maximum(ROOM * (high - low), 0.1 * model.robot.reach)
    middle = task.poses[len(task.poses) // 2, :3, :3]
    space = Workspace(
        T_base_frame=np.eye(4),
        shape="box",
        center=0.5 * (low + high),
        size=size,
        turned=np.eye(3),
        orientations=(Orientation(rotation=middle, cone=TURN, spin=TURN),),
    )
    return Task(name=task.name, workspace=space, accuracy=task.accuracy)


def find_measurable(model: ErrorModel, task: Task, station: Station | None, count: int, seed: int) -> Measurable:
    """Poses spread over the enlarged task that the robot reaches clear of itself and of boxes, and the tracker sees.

    Raises:
        ReachError: none is left; the message counts why.
    """
    reached = reach_task(model, enlarge(task, model), count, seed)
    return keep_measurable(model, reached, station)


def keep_measurable(model: ErrorModel, reached: TaskPoses, station: Station | None) -> Measurable:
    """Those of some poses that can be measured.

    Raises:
        ReachError: none can; the message counts why.
    """
    links = place_links(model, reached.q)
    ok, seen = check(model, reached.q, links, station)
    apart = clear_of_itself(links)
    boxes = clear_of_boxes(links, station.keep_out) if station else np.ones(len(reached), dtype=bool)
    lost = {
        "not reached": int(reached.unreachable.sum()),
        "links too near each other": int((~apart).sum()),
        "in a keep-out box": int((apart & ~boxes).sum()),
        "no reflector visible": int((apart & boxes & ~seen.any(axis=1)).sum()),
    }
    if not ok.any():
        reasons = ", ".join(f"{number} {reason}" for reason, number in lost.items() if number)
        raise ReachError(
            f"none of {len(reached.unreachable)} candidate poses can be measured: {reasons}; move the tracker, turn the "
            "reflectors or widen their acceptance, or move the keep-out boxes"
        )
    return Measurable(q=reached.q[ok], visible=seen[ok], lost=lost)


def check(
    model: ErrorModel, q: Float[np.ndarray, "n joints"], links: Links, station: Station | None
) -> tuple[Bool[np.ndarray, " n"], Bool[np.ndarray, "n targets"]]:
    """Whether each pose can be measured, and which reflectors are seen there."""
    ok = clear_of_itself(links)
    if station is None:
        return ok, np.ones((len(q), 1), dtype=bool)
    ok &= clear_of_boxes(links, station.keep_out)
    seen = station.visible(model.poses(q), links)
    return ok & seen.any(axis=1), seen


@dataclass(frozen=True, eq=False, kw_only=True)
class Experiment:
    """Everything that turns poses into candidates of an experiment."""

    layout: FrameLayout
    noise: TrackerNoise
    deviations: Float[np.ndarray, " z"]
    """Prior standard deviations of parameters, tracker frame and targets."""
    basis: Float[np.ndarray, "z d"]
    """Directions of unit prior variance that candidates or task see at all."""
    prior: Float[np.ndarray, "d d"]
    """Information of the prior, and of a campaign measured already."""
    signal: Float[np.ndarray, "d d"]
    """The campaign's part of it."""
    task: Float[np.ndarray, "d d"]
    """W of the task."""
    model_error: float

    def rows(
        self, q: Float[np.ndarray, "n joints"], visible: Bool[np.ndarray, "n targets"]
    ) -> Float[np.ndarray, "n b d"]:
        """Whitened sensitivities of poses in the basis; nil for reflectors that are not seen."""
        return whitened_rows(self.layout, self.noise, self.model_error, q, visible, self.deviations) @ self.basis

    def candidates(self, found: Measurable) -> Candidates:
        """Poses as candidates."""
        return Candidates(rows=self.rows(found.q, found.visible), prior=self.prior, task=self.task, signal=self.signal)

    def error(self, q: Float[np.ndarray, "n joints"], visible: Bool[np.ndarray, "n targets"]) -> float:
        """Expected rms error over the task after measuring some poses, metres."""
        X = self.rows(q, visible).reshape(-1, self.basis.shape[1])
        return float(np.sqrt(np.sum(self.task * np.linalg.inv(self.prior + X.T @ X))))


def whitened_rows(
    layout: FrameLayout,
    noise: TrackerNoise,
    model_error: float,
    q: Float[np.ndarray, "n joints"],
    visible: Bool[np.ndarray, "n targets"],
    deviations: Float[np.ndarray, " z"],
) -> Float[np.ndarray, "n b z"]:
    """Sensitivities of the measured points to parameters in units of their deviation, over the noise."""
    z = layout.start()
    walked = layout.walked(q, z)
    T = walk.poses(walked.chain, walked.s, walked.e)
    n, targets = len(q), len(layout.targets)
    out = np.zeros((n, targets, 3, len(z)))
    for t, point in enumerate(walked.points.position):
        J = walk.columns(walked.chain, walked.s, walked.e, walked.layout, walked.factor, angular=False, point=point)
        J[:, :, layout.point_columns[t]] = T[:, :3, :3]
        seen = (T[:, :3, :3] @ point) + T[:, :3, 3]
        covariance = noise.covariance(seen) + model_error**2 * np.eye(3)
        out[:, t] = whitener(covariance[:, None])[:, 0] @ (J * deviations)
    out[~visible] = 0.0
    return out.reshape(n, targets * 3, len(z))


def make_experiment(
    model: ErrorModel,
    goal: TaskPoses,
    found: Measurable,
    station: Station | None,
    *,
    campaign: Campaign | None = None,
    registration: Registration | None = None,
    noise: TrackerNoise | None = None,
    model_error: float = 0.0,
    prior_scale: float = 1.0,
) -> Experiment:
    """Prior, task and basis for choosing measuring poses.

    The error is that of the reflectors' predicted position in the tracker frame, their mean over the task.
    """
    layout = _layout(model, station, registration, campaign)
    noise = noise or TrackerNoise()
    frames = np.full(len(layout.names) - len(model), FRAME_DEVIATION)
    deviations = np.concatenate([model.tolerances * prior_scale, frames])
    everywhere = np.ones_like(found.visible)
    J_task = _task_rows(layout, goal, deviations)
    J_all = whitened_rows(layout, noise, model_error, found.q, everywhere, deviations)
    flat = J_all.reshape(-1, J_all.shape[2])
    gram = flat.T @ flat / len(flat) + J_task.T @ J_task / np.mean(noise.covariance(np.array([[4.0, 0.0, 0.0]])))
    values, vectors = np.linalg.eigh(gram)
    basis = vectors[:, values > 1e-13 * values[-1]]
    d = basis.shape[1]
    signal = np.zeros((d, d))
    if campaign is not None:
        done = whitened_rows(layout, noise, model_error, campaign.q, campaign.valid, deviations) @ basis
        done = done.reshape(-1, d)
        signal = done.T @ done
    W = basis.T @ (J_task.T @ J_task) @ basis
    return Experiment(
        layout=layout,
        noise=noise,
        deviations=deviations,
        basis=basis,
        prior=np.eye(d) + signal,
        signal=signal,
        task=W,
        model_error=model_error,
    )


def _layout(
    model: ErrorModel, station: Station | None, registration: Registration | None, campaign: Campaign | None
) -> FrameLayout:
    if registration is None:
        offsets = np.zeros((1, 3)) if station is None else station.offsets
        T = np.tile(np.eye(4), (len(offsets), 1, 1))
        T[:, :3, 3] = offsets
        base = TRACKER_POSE if station is None else station.T_tracker_base
        registration = Registration(
            T_tracker_base=base, T_tool_target=T, rms=0.0, unlocated=np.zeros((3 * len(offsets),) * 2)
        )
    if campaign is not None:
        names = campaign.targets
    else:
        names = ("tool",) if station is None else tuple(reflector.name for reflector in station.reflectors)
    return FrameLayout(model=model, kept=np.arange(len(model)), registration=registration, targets=names, pose=False)


def _task_rows(
    layout: FrameLayout, goal: TaskPoses, deviations: Float[np.ndarray, " z"]
) -> Float[np.ndarray, "rows z"]:
    """Weighted sensitivities of the targets over the task, so that the mean squared error is the trace of W·C."""
    z = layout.start()
    walked = layout.walked(goal.q, z)
    T = walk.poses(walked.chain, walked.s, walked.e)
    parts: list[np.ndarray] = []
    for t, point in enumerate(walked.points.position):
        J = walk.columns(walked.chain, walked.s, walked.e, walked.layout, walked.factor, angular=False, point=point)
        J[:, :, layout.point_columns[t]] = T[:, :3, :3]
        parts.append(J * deviations * np.sqrt(goal.weights / len(walked.points.position))[:, None, None])
    return np.concatenate(parts).reshape(-1, len(z))
