"""What measuring a pose would say: whitened sensitivities in the basis that candidates and task see."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from taskcal.adaptation.candidates import Measurable
from taskcal.adaptation.observed_linearisation import ObservedLinearisation
from taskcal.adaptation.plan_prior import PlanPrior
from taskcal.adaptation.smooth_field import SmoothField
from taskcal.estimation.experiment_design import Candidates
from taskcal.estimation.scaled import invert_scaled
from taskcal.geometry import se3, walk
from taskcal.identification.calibration import Calibration
from taskcal.identification.linearisation import joint_columns
from taskcal.identification.problem import FrameLayout, whitener
from taskcal.identification.row_errors import whiteners
from taskcal.measurement.registration import Registration
from taskcal.measurement.station import Station
from taskcal.measurement.tracker import TrackerNoise
from taskcal.measurement.virtual_cell import TRACKER_POSE
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import TaskPoses

AT_ONCE = 1000
"""Poses whose sensitivities to everything are held in memory at a time."""

FRAME_DEVIATION = 1.0
"""Prior standard deviation of tracker frame and targets, metres and radians: as good as none beside millimetres."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Linearisation:
    """Everything unknown, about values at which measurements are linear in it."""

    layout: FrameLayout
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


def _layout(model: ErrorModel, station: Station | None, prior: PlanPrior) -> FrameLayout:
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
    return FrameLayout(model=model, kept=np.arange(len(model)), registration=registration, targets=names, pose=False)
