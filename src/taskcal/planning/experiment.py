"""What measuring a pose would say: whitened sensitivities in the basis that candidates and task see."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from taskcal.campaigns.campaign import Campaign
from taskcal.estimation.experiment_design import Candidates
from taskcal.estimation.matrices import invert_scaled, pseudo_invert_scaled, squared_exponential
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.group_model import whiteners
from taskcal.identification.hyperparameters import Hyperparameters
from taskcal.identification.layout import Layout
from taskcal.identification.problem import joint_columns, problem_of, stated_rows, whitener
from taskcal.kernels import walk
from taskcal.observations import Observation, Point
from taskcal.observations.base import TrackerNoise
from taskcal.planning.candidates import Measurable
from taskcal.planning.expected_error import PlanPrior
from taskcal.planning.instruments import MeasuringWay
from taskcal.registration.registration import Registration
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import TaskPoses
from taskcal.virtual.cell import TRACKER_POSE
from taskcal.virtual.station import Station

# What geometry does not explain, as a smooth random field over the joints instead of white noise.

LANDMARKS, FIELD_LENGTH = 40, 2.0
"""A smooth model error has so many landmarks, and varies over so many standard deviations of each joint's positions."""


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
    return squared_exponential(((a[:, None] - b[None]) ** 2).sum(axis=2))


# What an observation without a tracker would say: whitened sensitivities to everything unknown.


@dataclass(frozen=True, eq=False, kw_only=True)
class ObservedLinearisation:
    """Everything unknown about the nominal robot and what stands where it is stated."""

    way: MeasuringWay
    layout: Layout
    deviations: Float[np.ndarray, " z"]
    """Prior standard deviations of everything unknown."""
    white: float
    """Standard deviation per axis of what geometry does not explain and is white, metres."""
    field: SmoothField | None
    """The rest of that, as a smooth field."""

    def sensitivities(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 3 c"]:
        """Those of the target's place in the base to everything unknown, in units of its prior deviation."""
        J = self._by_entry(q, Point(), None) * self.deviations
        return J if self.field is None else np.concatenate([J, self.field.columns(q)[0]], axis=2)

    def rows(
        self, q: Float[np.ndarray, "n joints"], visible: Bool[np.ndarray, "n things"]
    ) -> Float[np.ndarray, "n b c"]:
        """Sensitivities of what is read over its noise; `visible` says of which of the things that stand."""
        of = visible.argmax(axis=1)
        kind, z = self.way.observation(of), self.layout.start()
        tip = self.layout.model.poses(q) @ self.layout.frames(z)[1][0]
        campaign = _campaign(q, kind, self.way.rotations(tip, of))
        J = self._by_entry(q, kind, campaign.rotations) * self.deviations
        by_place = kind.differentiate(tip, self.way.unknown, campaign.read(0)).by_target[:, :, :3]
        white = np.full(len(q), self.white**2)
        if self.field is not None:
            extra, left = self.field.columns(q)
            white = white + left
            J = np.concatenate([J, by_place @ extra], axis=2)
        noise = campaign.covariances()[:, 0, : kind.width, : kind.width]
        covariance = noise + white[:, None, None] * (by_place @ np.swapaxes(by_place, 1, 2))
        return whitener(covariance[:, None])[:, 0] @ J

    @property
    def stated(self) -> Float[np.ndarray, "z z"]:
        """Information of what is stated beside the measurements, distances of sockets."""
        z = self.layout.start()
        known = stated_rows(self.layout, z, self.layout.kinds)
        J = known.by_entry * self.deviations
        return J.T @ J

    def _by_entry(
        self, q: Float[np.ndarray, "n joints"], kind: Observation, rotations: Float[np.ndarray, "n 3 3"] | None
    ) -> Float[np.ndarray, "n b z"]:
        problem = problem_of(self.layout, _campaign(q, kind, rotations), None)
        return problem.rows(self.layout.start()).linearise().by_entry[:, : kind.width]


def _campaign(
    q: Float[np.ndarray, "n joints"], kind: Observation, rotations: Float[np.ndarray, "n 3 3"] | None
) -> Campaign:
    """Something read in every posture; only where matters here."""
    return Campaign(
        ids=tuple(str(i) for i in range(len(q))),
        q=q,
        targets=("tool",),
        points=np.zeros((len(q), 1, 3)),
        rotations=rotations,
        observations=(kind,),
    )


def layout_of_way(model: ErrorModel, way: MeasuringWay) -> Layout:
    """All parameters, the target's place on the tool and what stands, about where they are stated."""
    registration = Registration(
        T_tracker_base=np.eye(4),
        T_tool_target=way.T_tool_tip[None],
        rms=0.0,
        unobservable=np.zeros((3, 3)),
        unknowns=(way.unknown,),
    )
    return Layout(
        model=model,
        kept=np.arange(len(model)),
        registration=registration,
        targets=("tool",),
        kinds=(way.observation(np.zeros(0, dtype=np.int64)),),
    )


def task_rows(linear: ObservedLinearisation, goal: TaskPoses) -> Float[np.ndarray, "rows c"]:
    """Weighted sensitivities of the target's places over a task, their sum of squares the task's mean squared error.

    Where the robot's base stands, nothing that stands unknown can tell, and no task asks: what would move all places as one
    rigid body is left out.
    """
    root = np.sqrt(goal.weights)[:, None, None]
    J = (linear.sensitivities(goal.q) * root).reshape(3 * len(goal.q), -1)
    position = linear.way.tip(linear.layout.model.nominal, goal.q)[:, :3, 3]
    rigid = (se3.by_twist(position - position.mean(axis=0)) * root).reshape(3 * len(goal.q), 6)
    Q, sizes, _ = np.linalg.svd(rigid, full_matrices=False)
    Q = Q[:, sizes > 1e-9 * sizes[0]]
    return J - Q @ (Q.T @ J)


AT_ONCE = 1000
"""Poses whose sensitivities to everything are held in memory at a time."""

FRAME_DEVIATION = 1.0
"""Prior standard deviation of tracker frame and targets, metres and radians: as good as none beside millimetres."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Linearisation:
    """Everything unknown, about values at which measurements are linear in it."""

    layout: Layout
    about: Float[np.ndarray, " z"]
    """Parameters, tracker frame and targets."""
    deviations: Float[np.ndarray, " z"]
    """Their prior standard deviations."""
    noise: TrackerNoise
    white: float
    """Standard deviation per axis of what geometry does not explain, where it is taken for white, metres."""
    field: SmoothField | None
    """The same as a smooth field."""
    joints: Float[np.ndarray, " joints"] | None = None
    """Variances of how far each joint stands off at a single pose, rad² (m² where it slides); None where nothing is known."""

    def sensitivities(
        self, q: Float[np.ndarray, "n joints"]
    ) -> tuple[Float[np.ndarray, "n targets 3 c"], Float[np.ndarray, "n targets 3"]]:
        """Those of the targets to everything unknown, in units of its prior deviation; and where the targets are."""
        walked = self.layout.walked(q, self.about)
        T = walk.poses(walked.chain, walked.s, walked.e)
        parts: list[np.ndarray] = []
        for t, point in enumerate(walked.points.position):
            J = walk.columns(walked.chain, walked.s, walked.e, walked.layout, walked.factor, angular=False, point=point)
            J[:, :, self.layout.point_columns[t]] = T[:, :3, :3]
            parts.append(J * self.deviations)
        points = np.stack([se3.apply(T, point) for point in walked.points.position], axis=1)
        out = np.stack(parts, axis=1)
        if self.field is not None:
            extra = np.broadcast_to(self.field.columns(q)[0][:, None], (*out.shape[:3], 3 * len(self.field.landmarks)))
            out = np.concatenate([out, extra], axis=3)
        return out, points

    def rows(
        self, q: Float[np.ndarray, "n joints"], visible: Bool[np.ndarray, "n targets"]
    ) -> Float[np.ndarray, "n b c"]:
        """Sensitivities over the noise, a block of rows for each pose; zero for targets that are not seen."""
        J, points = self.sensitivities(q)
        J[~visible] = 0.0
        white = np.full(len(q), self.white**2) if self.field is None else self.field.columns(q)[1]
        covariance = self.noise.covariance(points) + white[:, None, None, None] * np.eye(3)
        if self.joints is None:
            return (whitener(covariance) @ J).reshape(len(q), -1, J.shape[3])
        return whiteners(self._together(q, self.joints, covariance, visible)) @ J.reshape(len(q), -1, J.shape[3])

    def _together(
        self,
        q: Float[np.ndarray, "n joints"],
        joints: Float[np.ndarray, " joints"],
        single: Float[np.ndarray, "n targets 3 3"],
        visible: Bool[np.ndarray, "n targets"],
    ) -> Float[np.ndarray, "n b b"]:
        """Covariance of all targets of a pose: a joint that stands off moves those that are seen together."""
        at = self.layout.walked(q, self.about)
        targets = visible.shape[1]
        moved = np.concatenate([joint_columns(at, offset, angular=False) for offset in at.points.position], axis=1)
        variances = np.zeros(moved.shape[2])
        variances[: len(joints)] = joints
        moved[~np.repeat(visible, 3, axis=1)] = 0.0
        R = (moved * variances) @ np.swapaxes(moved, 1, 2)
        for t in range(targets):
            R[:, 3 * t : 3 * t + 3, 3 * t : 3 * t + 3] += single[:, t]
        return R


@dataclass(frozen=True, eq=False, kw_only=True)
class Experiment:
    """Everything that turns poses into candidates of an experiment."""

    linear: Linearisation | ObservedLinearisation
    basis: Float[np.ndarray, "c d"]
    """Directions of unit prior variance that candidates or task see at all."""
    prior: Float[np.ndarray, "d d"]
    """Information of the prior, and of what was measured already."""
    signal: Float[np.ndarray, "d d"]
    """The measurements' part of it."""
    task: Float[np.ndarray, "d d"]
    """W of the task."""
    left: float = 0.0
    """Mean squared error over the task in directions that are not in the basis, metres²."""

    def rows(
        self, q: Float[np.ndarray, "n joints"], visible: Bool[np.ndarray, "n targets"]
    ) -> Float[np.ndarray, "n b d"]:
        """Whitened sensitivities of poses in the basis; zero for reflectors that are not seen."""
        parts = [slice(first, first + AT_ONCE) for first in range(0, max(len(q), 1), AT_ONCE)]
        return np.concatenate([self.linear.rows(q[part], visible[part]) @ self.basis for part in parts])

    def candidates(self, measurable: Measurable) -> Candidates:
        """Poses as candidates."""
        rows = self.rows(measurable.q, measurable.visible)
        return Candidates(rows=rows, prior=self.prior, task=self.task, signal=self.signal)

    def error(self, q: Float[np.ndarray, "n joints"], visible: Bool[np.ndarray, "n targets"]) -> float:
        """Expected rms error over the task after measuring some poses, metres."""
        X = self.rows(q, visible).reshape(-1, self.basis.shape[1])
        return self._error_with(X.T @ X)

    def errors_by_count(
        self, q: Float[np.ndarray, "count joints"], visible: Bool[np.ndarray, "count targets"]
    ) -> Float[np.ndarray, " count"]:
        """Expected rms error over the task after the first 1, 2, … poses, metres."""
        rows = self.rows(q, visible)
        information = self.prior + np.cumsum(np.swapaxes(rows, 1, 2) @ rows, axis=0)
        return np.sqrt(np.einsum("ij,nij->n", self.task, np.linalg.inv(information)) + self.left)

    @property
    def before(self) -> float:
        """Expected rms error over the task by what is known already, metres."""
        return self._error_with(np.zeros_like(self.prior))

    def _error_with(self, gained: Float[np.ndarray, "d d"]) -> float:
        return float(np.sqrt(np.sum(self.task * np.linalg.inv(self.prior + gained)) + self.left))


def make_experiment(
    model: ErrorModel,
    goal: TaskPoses,
    measurable: Measurable,
    prior: PlanPrior,
    *,
    station: Station | None = None,
    noise: TrackerNoise | None = None,
    smooth: bool = False,
) -> Experiment:
    """Prior, task and basis for choosing measuring poses.

    The error is that of the reflectors' predicted position in the tracker frame, their mean over the task.

    Args:
        model: the model to be identified.
        goal: poses of the task.
        measurable: poses that can be measured.
        prior: what is known of robot and cell; of a calibration parameters, tracker frame and targets as they are, and as far
            as they are, known.
        station: tracker and reflectors.
        noise: the tracker's.
        smooth: take the model error for a smooth field over the joints instead of white noise.
    """
    calibration, campaign, hyper = prior.calibration, prior.campaign, prior.hyper
    layout = calibration.layout if calibration is not None else _layout(model, station, prior)
    frames = np.full(len(layout.names) - len(layout.kept), FRAME_DEVIATION)
    error = hyper.model_error[0]
    field = SmoothField.over(error, goal.q, measurable.q.std(axis=0)) if smooth and error > 0.0 else None
    linear = Linearisation(
        layout=layout,
        about=layout.start() if calibration is None else calibration.z,
        deviations=np.concatenate([hyper.deviations(model)[layout.kept], frames]),
        noise=noise or TrackerNoise(),
        white=0.0 if field else error,
        field=field,
    )
    rows = linear.rows(measurable.q, np.ones_like(measurable.visible))
    J_task, _ = linear.sensitivities(goal.q)
    J_task = J_task * np.sqrt(goal.weights / J_task.shape[1])[:, None, None, None]
    flat, J_task = rows.reshape(-1, rows.shape[2]), J_task.reshape(-1, rows.shape[2])
    basis = span(flat, J_task)
    d = basis.shape[1]
    signal = np.zeros((d, d))
    if campaign is not None:
        done = (linear.rows(campaign.q, campaign.valid) @ basis).reshape(-1, d)
        signal = done.T @ done
    if calibration is not None:
        signal = _information_of(calibration, linear.deviations, basis) - np.eye(d)
    return Experiment(
        linear=linear,
        basis=basis,
        prior=np.eye(d) + signal,
        signal=signal,
        task=basis.T @ (J_task.T @ J_task) @ basis,
    )


def span(measured: Float[np.ndarray, "m c"], task: Float[np.ndarray, "k c"]) -> Float[np.ndarray, "c d"]:
    """Directions of unit length that rows of measurements or of a task see at all."""
    typical = float(np.mean(measured**2) / max(np.mean(task**2), 1e-300))
    values, vectors = np.linalg.eigh(measured.T @ measured / len(measured) + typical * task.T @ task / len(task))
    return vectors[:, values > 1e-13 * values[-1]]


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


def _layout(model: ErrorModel, station: Station | None, prior: PlanPrior) -> Layout:
    registration = prior.registration
    if registration is None:
        offsets = np.zeros((1, 3)) if station is None else station.offsets
        T = np.tile(np.eye(4), (len(offsets), 1, 1))
        T[:, :3, 3] = offsets
        base = TRACKER_POSE if station is None else station.T_tracker_base
        registration = Registration(
            T_tracker_base=base, T_tool_target=T, rms=0.0, unobservable=np.zeros((3 * len(offsets),) * 2)
        )
    if prior.campaign is not None:
        names = prior.campaign.targets
    else:
        names = ("tool",) if station is None else tuple(reflector.name for reflector in station.reflectors)
    kinds = (Point(),) * len(names)
    return Layout(model=model, kept=np.arange(len(model)), registration=registration, targets=names, kinds=kinds)


# What measuring more poses would add to a calibration by the one model.
#
# In z − ẑ = L·u, with L·Lᵀ the calibration's covariance, every direction of u has unit variance, and what
# candidates and task see of hundreds of them is spanned by few. Plans are chosen and judged in those; of the
# others, what a measurement sees counts as noise, and what the task sees as an error that stays. What no pose has
# in common with others is the calibration's own: a white error of the target, and one of every joint.

JUDGED_BY, CHOSEN_BY = 300, 150
"""Directions in which plans are judged, and in which their poses are chosen."""

SAMPLE = 1000
"""Candidates, evenly among all, that the directions are found from."""


def calibrated_experiments(
    calibration: Calibration, goal: TaskPoses, measurable: Measurable, noise: TrackerNoise | None
) -> tuple[Experiment, Experiment]:
    """Experiments to judge plans by, and to choose their poses by.

    Args:
        calibration: of geometry and all effects at once.
        goal: poses of the task.
        measurable: poses that can be measured.
        noise: the tracker's.
    """
    S = calibration.z_covariance
    deviations = np.sqrt(np.maximum(np.diag(S), 0.0))
    scale = np.where(deviations > 0.0, deviations, 1.0)
    values, vectors = np.linalg.eigh(S / scale / scale[:, None])
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    linear = Linearisation(
        layout=calibration.layout,
        about=calibration.z,
        deviations=scale,
        noise=noise or TrackerNoise(),
        white=calibration.model_error[0],
        field=None,
        joints=np.square(calibration.joint_error),
    )
    sample = np.unique(np.linspace(0, len(measurable.q) - 1, min(SAMPLE, len(measurable.q))).astype(int))
    J_measured, J_task = (linear.sensitivities(q)[0] @ root for q in (measurable.q[sample], goal.q))
    J_task = J_task * np.sqrt(goal.weights / J_task.shape[1])[:, None, None, None]
    measured, task = (J.reshape(-1, J.shape[3]) for J in (J_measured, J_task))
    G = measured.T @ measured / max(np.sum(measured**2), 1e-300) + task.T @ task / max(np.sum(task**2), 1e-300)
    directions = np.linalg.eigh(G)[1][:, ::-1]
    judged, chosen = (
        _in_directions(linear, root, directions[:, :count], measured, task) for count in (JUDGED_BY, CHOSEN_BY)
    )
    return judged, chosen


def _in_directions(
    linear: Linearisation,
    root: Float[np.ndarray, "z z"],
    directions: Float[np.ndarray, "z d"],
    measured: Float[np.ndarray, "rows z"],
    task: Float[np.ndarray, "points z"],
) -> Experiment:
    """The experiment in some directions of the unit variances."""
    in_task = task @ directions
    unseen = (np.sum(measured**2) - np.sum((measured @ directions) ** 2)) / len(measured)
    left = np.sum(task**2) - np.sum(in_task**2)
    d = directions.shape[1]
    return Experiment(
        linear=replace(linear, white=float(np.sqrt(linear.white**2 + max(unseen, 0.0)))),
        basis=root @ directions,
        prior=np.eye(d),
        signal=np.zeros((d, d)),
        task=in_task.T @ in_task,
        left=float(max(left, 0.0)),
    )


# What measuring without a tracker would say of a task, as an experiment that plans are chosen and judged by.

SMOOTH_SHARE = 0.5
"""Of the model error's variance. With all of it smooth, plans of 60 postures are up to 30 % worse where the error is white, and
with none of it up to 15 % worse where it is smooth (two robots; sockets, wire, camera); with half of it 10 % and 2 %."""

OBSERVED_AT_ONCE = 500
"""Postures whose sensitivities to everything are held in memory at a time."""


def make_observed_experiment(
    model: ErrorModel,
    goal: TaskPoses,
    measurable: Measurable,
    way: MeasuringWay,
    hyper: Hyperparameters,
    *,
    smooth: bool = False,
) -> Experiment:
    """Prior, task and basis for choosing postures, the kind's own unknowns and the target's place among what is unknown.

    The error is that of the target's predicted position, its mean over the task, wherever the robot's base may stand.

    Args:
        model: the model to be identified.
        goal: poses of the task.
        measurable: postures that can be measured, and of which thing.
        way: of measuring.
        hyper: model error and prior scale.
        smooth: take half of the model error for a smooth field over the joints instead of white noise.
    """
    layout, error = layout_of_way(model, way), hyper.model_error[0]
    own = [kind.deviations for kind in layout.kinds]
    frames = np.ones(len(layout.names) - len(layout.kept) - sum(map(len, own)))
    share = SMOOTH_SHARE if smooth and error > 0.0 else 0.0
    field = SmoothField.over(error * np.sqrt(share), goal.q, measurable.q.std(axis=0)) if share else None
    linear = ObservedLinearisation(
        way=way,
        layout=layout,
        deviations=np.concatenate([hyper.deviations(model)[layout.kept], frames, *own]),
        white=error * np.sqrt(1.0 - share),
        field=field,
    )
    J_task = task_rows(linear, goal)
    parts = [slice(first, first + OBSERVED_AT_ONCE) for first in range(0, len(measurable.q), OBSERVED_AT_ONCE)]
    rows = np.concatenate([linear.rows(measurable.q[part], measurable.visible[part]) for part in parts])
    basis = span(rows.reshape(-1, rows.shape[2]), J_task)
    known = np.zeros((len(basis), len(basis)))
    z = len(layout.names)
    known[:z, :z] = linear.stated
    signal = basis.T @ known @ basis
    in_task = J_task @ basis
    return Experiment(
        linear=linear,
        basis=basis,
        prior=np.eye(basis.shape[1]) + signal,
        signal=signal,
        task=in_task.T @ in_task,
    )


def nominal_error(
    experiment: Experiment,
    goal: TaskPoses,
    q: Float[np.ndarray, "n joints"],
    visible: Bool[np.ndarray, "n things"],
) -> float:
    """Expected error when the measurements only serve to find what stands and what the tool carries, metres."""
    linear = experiment.linear
    assert isinstance(linear, ObservedLinearisation)
    white = replace(linear, field=None, white=linear.white)
    rows, J_task = white.rows(q, visible), task_rows(white, goal)
    flat = rows.reshape(-1, rows.shape[2])
    A, W = flat.T @ flat + white.stated, J_task.T @ J_task
    m, f = np.split(np.arange(len(A)), [len(linear.layout.kept)])
    # directions that these postures do not see stay where they are stated
    inverse = pseudo_invert_scaled(A[np.ix_(f, f)], rcond=1e-10)
    follow = inverse @ A[np.ix_(f, m)]
    moved = W[np.ix_(m, f)] @ follow
    left = np.trace(W[np.ix_(m, m)] - moved - moved.T + follow.T @ W[np.ix_(f, f)] @ follow)
    return float(np.sqrt(left + np.sum(W[np.ix_(f, f)] * inverse)))
