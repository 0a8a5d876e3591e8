"""What an observation without a tracker would say: whitened sensitivities to everything unknown."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from taskcal.adaptation.measuring_way import MeasuringWay
from taskcal.adaptation.smooth_field import SmoothField
from taskcal.geometry import se3
from taskcal.identification.linearisation import linearise_rows
from taskcal.identification.observation_layout import ObservationLayout, problem_of
from taskcal.identification.problem import whitener
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.observation import Observation, Point
from taskcal.measurement.registration import Registration
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import TaskPoses


@dataclass(frozen=True, eq=False, kw_only=True)
class ObservedLinearisation:
    """Everything unknown about the nominal robot and what stands where it is stated."""

    way: MeasuringWay
    layout: ObservationLayout
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
        known = self.layout.stated(z, (self.way.observation(np.zeros(0, dtype=np.int64)),))
        if known is None:
            return np.zeros((len(z), len(z)))
        J = known.by_entry * self.deviations
        return J.T @ J

    def _by_entry(
        self, q: Float[np.ndarray, "n joints"], kind: Observation, rotations: Float[np.ndarray, "n 3 3"] | None
    ) -> Float[np.ndarray, "n b z"]:
        problem = problem_of(self.layout, _campaign(q, kind, rotations), None)
        return linearise_rows(problem, self.layout.start()).by_entry[:, : kind.width]


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


def layout_of_way(model: ErrorModel, way: MeasuringWay) -> ObservationLayout:
    """All parameters, the target's place on the tool and what stands, about where they are stated."""
    registration = Registration(
        T_tracker_base=np.eye(4),
        T_tool_target=way.T_tool_tip[None],
        rms=0.0,
        unobservable=np.zeros((3, 3)),
        unknowns=(way.unknown,),
    )
    return ObservationLayout(
        model=model,
        kept=np.arange(len(model)),
        registration=registration,
        targets=("tool",),
        pose=False,
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
