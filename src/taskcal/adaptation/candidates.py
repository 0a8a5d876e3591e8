"""Poses that could be measured: reachable, clear, seen by the tracker; and what each would say."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import ReachError
from taskcal.estimation.experiment_design import Candidates
from taskcal.estimation.scaled import invert_scaled
from taskcal.geometry import se3, walk
from taskcal.identification.calibration import Calibration
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

LANDMARKS, FIELD_LENGTH = 40, 2.0
"""A smooth model error has so many landmarks, and varies over so many standard deviations of each joint's positions."""

FRAME_DEVIATION = 1.0
"""Prior standard deviation of tracker frame and targets, metres and radians: as good as none beside millimetres."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Measurable:
    """Poses that can be measured."""

    q: Float[np.ndarray, "n joints"]
    """Radians."""
    rows: Int[np.ndarray, " n"]
    """Which of the reached poses they are."""
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


def measuring_task(model: ErrorModel, task: Task) -> Task:
    """Where to measure without a plan: the task's own workspace; for poses or a path, which may lie on one line, around it."""
    return task if task.workspace is not None else enlarge(task, model)


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
    return Measurable(q=reached.q[ok], rows=np.flatnonzero(ok), visible=seen[ok], lost=lost)


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
class SmoothField:
    """What geometry does not explain, as a smooth random field over the joints instead of white noise.

    The residuals of a real robot are much alike at neighbouring poses (gears, compliance). If they were white, the best
    poses would crowd at the extremes, and there they would teach the geometry what is the field's; as a Gaussian process
    they call for poses that represent the task. Its covariance is approximated on landmarks (Nyström; the remainder stays
    white, as in Snelson and Ghahramani 2006).
    """

    deviation: float
    """Standard deviation per axis, metres."""
    landmarks: Float[np.ndarray, "k joints"]
    """In units of `scale`."""
    scale: Float[np.ndarray, " joints"]
    """Length scale of each joint, radians or metres."""
    root: Float[np.ndarray, "k k"]
    """Inverse Cholesky factor of the landmarks' correlation."""

    @classmethod
    def over(
        cls, deviation: float, q: Float[np.ndarray, "n joints"], spread: Float[np.ndarray, " joints"]
    ) -> "SmoothField":
        """A field whose landmarks are some of the poses q."""
        scale = FIELD_LENGTH * np.maximum(spread, 1e-6)
        landmarks = q[np.linspace(0, len(q) - 1, min(LANDMARKS, len(q))).astype(int)] / scale
        K = _correlation(landmarks, landmarks) + 1e-6 * np.eye(len(landmarks))
        return cls(deviation=deviation, landmarks=landmarks, scale=scale, root=np.linalg.inv(np.linalg.cholesky(K)))

    def columns(self, q: Float[np.ndarray, "n joints"]) -> tuple[Float[np.ndarray, "n 3 c"], Float[np.ndarray, " n"]]:
        """Sensitivities of a point to the field's coefficients, of unit variance; and the variance left white."""
        features = _correlation(q / self.scale, self.landmarks) @ self.root.T
        k = features.shape[1]
        out = np.zeros((len(q), 3, 3 * k))
        for axis in range(3):
            out[:, axis, axis * k : (axis + 1) * k] = self.deviation * features
        white = self.deviation**2 * np.clip(1.0 - (features**2).sum(axis=1), 0.0, 1.0)
        return out, white


def _correlation(a: Float[np.ndarray, "n joints"], b: Float[np.ndarray, "k joints"]) -> Float[np.ndarray, "n k"]:
    return np.exp(-0.5 * ((a[:, None] - b[None]) ** 2).sum(axis=2))


@dataclass(frozen=True, eq=False, kw_only=True)
class Experiment:
    """Everything that turns poses into candidates of an experiment."""

    layout: FrameLayout
    about: Float[np.ndarray, " z"]
    """Parameters, tracker frame and targets about which it is linear."""
    noise: TrackerNoise
    model_error: float
    """Standard deviation per axis of what geometry does not explain, where it is taken for white, metres."""
    field: SmoothField | None
    """The same as a smooth field."""
    deviations: Float[np.ndarray, " z"]
    """Prior standard deviations of parameters, tracker frame and targets."""
    basis: Float[np.ndarray, "c d"]
    """Directions of unit prior variance that candidates or task see at all."""
    prior: Float[np.ndarray, "d d"]
    """Information of the prior, and of what was measured already."""
    signal: Float[np.ndarray, "d d"]
    """The measurements' part of it."""
    task: Float[np.ndarray, "d d"]
    """W of the task."""

    def rows(
        self, q: Float[np.ndarray, "n joints"], visible: Bool[np.ndarray, "n targets"]
    ) -> Float[np.ndarray, "n b d"]:
        """Whitened sensitivities of poses in the basis; zero for reflectors that are not seen."""
        J, p = _sensitivities(self.layout, self.about, q, self.deviations, self.field)
        return _whiten(J, p, q, visible, self.noise, self.model_error, self.field) @ self.basis

    def candidates(self, found: Measurable) -> Candidates:
        """Poses as candidates."""
        return Candidates(rows=self.rows(found.q, found.visible), prior=self.prior, task=self.task, signal=self.signal)

    def error(self, q: Float[np.ndarray, "n joints"], visible: Bool[np.ndarray, "n targets"]) -> float:
        """Expected rms error over the task after measuring some poses, metres."""
        X = self.rows(q, visible).reshape(-1, self.basis.shape[1])
        return self._error_with(X.T @ X)

    @property
    def before(self) -> float:
        """Expected rms error over the task by what is known already, metres."""
        return self._error_with(np.zeros_like(self.prior))

    def _error_with(self, gained: Float[np.ndarray, "d d"]) -> float:
        return float(np.sqrt(np.sum(self.task * np.linalg.inv(self.prior + gained))))


def make_experiment(
    model: ErrorModel,
    goal: TaskPoses,
    found: Measurable,
    station: Station | None,
    *,
    campaign: Campaign | None = None,
    calibration: Calibration | None = None,
    registration: Registration | None = None,
    noise: TrackerNoise | None = None,
    model_error: float = 0.0,
    smooth: bool = False,
    prior_scale: float = 1.0,
) -> Experiment:
    """Prior, task and basis for choosing measuring poses.

    The error is that of the reflectors' predicted position in the tracker frame, their mean over the task.

    Args:
        model: the model to be identified.
        goal: poses of the task.
        found: poses that can be measured.
        station: tracker and reflectors.
        campaign: measured already.
        calibration: of points, with a prior: parameters, tracker frame and targets as they are, and as far as they are, known.
        registration: where tracker and targets are, if known otherwise.
        noise: the tracker's.
        model_error: standard deviation per axis of what geometry does not explain, metres.
        smooth: take it for a smooth field over the joints instead of white noise.
        prior_scale: factor of the tolerances.
    """
    layout = _layout(model, station, registration, campaign) if calibration is None else calibration.layout
    about = layout.start() if calibration is None else calibration.z
    noise = noise or TrackerNoise()
    frames = np.full(len(layout.names) - len(layout.kept), FRAME_DEVIATION)
    deviations = np.concatenate([model.tolerances[layout.kept] * prior_scale, frames])
    field = SmoothField.over(model_error, goal.q, found.q.std(axis=0)) if smooth and model_error > 0.0 else None
    white = 0.0 if field else model_error
    J, points = _sensitivities(layout, about, found.q, deviations, field)
    all_rows = _whiten(J, points, found.q, np.ones_like(found.visible), noise, white, field)
    J_task, _ = _sensitivities(layout, about, goal.q, deviations, field)
    J_task = J_task * np.sqrt(goal.weights / J_task.shape[1])[:, None, None, None]
    flat, J_task = all_rows.reshape(-1, J.shape[3]), J_task.reshape(-1, J.shape[3])
    typical = float(np.mean(flat**2) / max(np.mean(J_task**2), 1e-300))
    values, vectors = np.linalg.eigh(flat.T @ flat / len(flat) + typical * J_task.T @ J_task / len(J_task))
    basis = vectors[:, values > 1e-13 * values[-1]]
    d = basis.shape[1]
    signal = np.zeros((d, d))
    if campaign is not None:
        J_done, points = _sensitivities(layout, about, campaign.q, deviations, field)
        done = (_whiten(J_done, points, campaign.q, campaign.valid, noise, white, field) @ basis).reshape(-1, d)
        signal = done.T @ done
    if calibration is not None:
        signal = _information_of(calibration, deviations, basis) - np.eye(d)
    return Experiment(
        layout=layout,
        about=about,
        noise=noise,
        model_error=white,
        field=field,
        deviations=deviations,
        basis=basis,
        prior=np.eye(d) + signal,
        signal=signal,
        task=basis.T @ (J_task.T @ J_task) @ basis,
    )


def _information_of(
    calibration: Calibration, deviations: Float[np.ndarray, " z"], basis: Float[np.ndarray, "c d"]
) -> Float[np.ndarray, "d d"]:
    """Posterior information in the basis; of a smooth field, whose directions come last, nothing is known."""
    z = len(deviations)
    covariance = np.eye(len(basis))
    covariance[:z, :z] = calibration.z_covariance / deviations / deviations[:, None]
    inner = basis.T @ covariance @ basis
    information = invert_scaled(inner)
    return 0.5 * (information + information.T)


def _layout(
    model: ErrorModel, station: Station | None, registration: Registration | None, campaign: Campaign | None
) -> FrameLayout:
    if registration is None:
        offsets = np.zeros((1, 3)) if station is None else station.offsets
        T = np.tile(np.eye(4), (len(offsets), 1, 1))
        T[:, :3, 3] = offsets
        base = TRACKER_POSE if station is None else station.T_tracker_base
        registration = Registration(
            T_tracker_base=base, T_tool_target=T, rms=0.0, unobservable=np.zeros((3 * len(offsets),) * 2)
        )
    if campaign is not None:
        names = campaign.targets
    else:
        names = ("tool",) if station is None else tuple(reflector.name for reflector in station.reflectors)
    return FrameLayout(model=model, kept=np.arange(len(model)), registration=registration, targets=names, pose=False)


def _sensitivities(
    layout: FrameLayout,
    about: Float[np.ndarray, " z"],
    q: Float[np.ndarray, "n joints"],
    deviations: Float[np.ndarray, " z"],
    field: SmoothField | None,
) -> tuple[Float[np.ndarray, "n targets 3 c"], Float[np.ndarray, "n targets 3"]]:
    """Sensitivities of the targets to everything unknown, in units of its prior deviation; and where the targets are."""
    walked = layout.walked(q, about)
    T = walk.poses(walked.chain, walked.s, walked.e)
    parts: list[np.ndarray] = []
    for t, point in enumerate(walked.points.position):
        J = walk.columns(walked.chain, walked.s, walked.e, walked.layout, walked.factor, angular=False, point=point)
        J[:, :, layout.point_columns[t]] = T[:, :3, :3]
        parts.append(J * deviations)
    points = np.stack([se3.apply(T, point) for point in walked.points.position], axis=1)
    out = np.stack(parts, axis=1)
    if field is not None:
        extra = np.broadcast_to(field.columns(q)[0][:, None], (*out.shape[:3], 3 * len(field.landmarks)))
        out = np.concatenate([out, extra], axis=3)
    return out, points


def _whiten(
    J: Float[np.ndarray, "n targets 3 c"],
    points: Float[np.ndarray, "n targets 3"],
    q: Float[np.ndarray, "n joints"],
    visible: Bool[np.ndarray, "n targets"],
    noise: TrackerNoise,
    model_error: float,
    field: SmoothField | None,
) -> Float[np.ndarray, "n b c"]:
    """Sensitivities over the noise, a block of rows for each pose; zero for targets that are not seen."""
    white = np.full(len(q), model_error**2) if field is None else field.columns(q)[1]
    covariance = noise.covariance(points) + white[:, None, None, None] * np.eye(3)
    out = whitener(covariance) @ J
    out[~visible] = 0.0
    return out.reshape(len(q), -1, J.shape[3])
