"""A Calibration: what was identified, how well, and what the robot does with it."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import CampaignError, TaskcalError
from taskcal.estimation.blas import single_threaded
from taskcal.files import write_whole
from taskcal.geometry import se3, walk
from taskcal.geometry.chain import Chain, ErrorFrame, Fixed
from taskcal.geometry.covariance_propagation import propagate
from taskcal.geometry.observations import Points
from taskcal.identification.calibration_content import describe_calibration
from taskcal.identification.calibration_summary import summarise_calibration
from taskcal.identification.field import ResidualField
from taskcal.identification.held_out import HeldOut
from taskcal.identification.observed_errors import residuals_by_kind
from taskcal.identification.outlier import LeftOut, Outlier, shared_with_neighbours
from taskcal.identification.problem import FrameLayout
from taskcal.identification.provenance import Provenance
from taskcal.identification.untold_conditions import untold_covariance
from taskcal.measurement.campaign import Campaign
from taskcal.robot.conditions import Conditions
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.load import Load


@dataclass(frozen=True, eq=False, kw_only=True)
class Calibration:
    """An identified robot in its measuring frame."""

    model: ErrorModel
    layout: FrameLayout
    """How z is laid out."""
    estimated: Int[np.ndarray, " kept"]
    """Model parameters that were estimated; the others stay zero and are considered."""
    z: Float[np.ndarray, " z"]
    """All parameters, tracker frame and targets, in the order of `all_names`."""
    z_spread: Float[np.ndarray, "z z"]
    """Lower triangular B of the covariance B·Bᵀ of their error, which so is negative nowhere."""
    T_tracker_base: Float[np.ndarray, "4 4"]
    """Pose of the robot's base in the tracker frame."""
    T_tool_target: Float[np.ndarray, "targets 4 4"]
    """Pose of every target in the tool frame; for a point its rotation is the identity."""
    residuals: Float[np.ndarray, "n targets b"]
    """Measured less predicted in the tracker frame, metres (then radians, for poses); NaN for lost beams."""
    studentised: Float[np.ndarray, "n targets"]
    """Length of each residual over its own standard deviation."""
    outliers: tuple[Outlier, ...]
    """Points whose residual is too long for chance, the longest first."""
    left_out: tuple[LeftOut, ...]
    """Rows that cannot be right, and were not fitted."""
    ids: tuple[str, ...]
    """Names of the rows that were fitted."""
    model_error: tuple[float, ...]
    """Standard deviation of what geometry does not explain: metres per axis (and radians, for poses)."""
    joint_error: tuple[float, ...] = ()
    """Standard deviation of how far every joint stands off at a single pose, radians (metres where it slides); empty where it
    was not asked for."""
    prior_scale: float | None
    """Factor of the prior's standard deviations; None where there was no prior."""
    group_deviations: Float[np.ndarray, " p"] | None = None
    """Prior standard deviation of every parameter, metres and radians, where each effect of each joint has a size of its own;
    None where all are the tolerances times `prior_scale`."""
    log_evidence: float | None
    """Logarithm of the marginal likelihood, but for a constant of the campaign; None where there was no prior."""
    field: ResidualField | None
    """What was learned of the residuals, if asked for."""
    iterations: int
    """Of the last fit."""
    rounds: int
    """Of fit and hyperparameters in turn."""
    reason: str
    """Why the fit ended."""
    remarks: tuple[str, ...]
    """What a user should look at before believing the result."""
    provenance: Provenance
    q: Float[np.ndarray, "n joints"] | None = None
    """Joint positions of the rows that were fitted, radians; None where a file of an older version does not tell them."""
    held_out: HeldOut | None = None
    """What the fit predicted of rows that it had not seen, if any were held out."""

    def __repr__(self) -> str:
        scale = "" if self.prior_scale is None else f", prior × {self.prior_scale:.2g}"
        return (
            f"Calibration({self.model.robot.name}: {len(self.estimated)} parameters from {len(self.residuals)} rows, "
            f"model error {self.model_error[0] * 1e3:.3f} mm{scale})"
        )

    @property
    def targets(self) -> tuple[str, ...]:
        """Names of the targets."""
        return self.layout.targets

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the model's parameters."""
        return self.model.names

    @property
    def kept(self) -> tuple[str, ...]:
        """Names of the parameters that were estimated."""
        return tuple(self.model.names[i] for i in self.estimated)

    @property
    def all_names(self) -> tuple[str, ...]:
        """Names of the entries of z: parameters, ``base.*``, targets."""
        return self.layout.names

    @cached_property
    def shared_outliers(self) -> tuple[bool, ...]:
        """Whether neighbouring rows or poses have much the same error as each outlier; none where the poses are not known."""
        if self.q is None or len(self.q) != len(self.residuals):
            return (False,) * len(self.outliers)
        return shared_with_neighbours(self.outliers, self.residuals, self.studentised, self.q)

    @cached_property
    def estimate(self) -> Float[np.ndarray, " p"]:
        """Every parameter of the model, zero where not kept, metres and radians."""
        return self.layout.parameters(self.z)

    @cached_property
    @single_threaded
    def z_covariance(self) -> Float[np.ndarray, "z z"]:
        """Covariance of the error of z; of a parameter that was not estimated its prior's."""
        return self.z_spread @ self.z_spread.T

    @cached_property
    def covariance(self) -> Float[np.ndarray, "p p"]:
        """Covariance of the model's parameters; of one that was not estimated its prior's."""
        p = len(self.model)
        return self.z_covariance[:p, :p]

    @cached_property
    def standard_errors(self) -> Float[np.ndarray, " p"]:
        """Posterior standard deviation of every parameter, metres and radians."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @cached_property
    def correlation(self) -> Float[np.ndarray, "z z"]:
        """Posterior correlation of the entries of z."""
        deviation = np.sqrt(np.maximum(np.diag(self.z_covariance), 1e-300))
        return self.z_covariance / deviation / deviation[:, None]

    def predict(
        self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None
    ) -> Float[np.ndarray, "n targets 3"] | Float[np.ndarray, "n 4 4"]:
        """Where the targets will be in the tracker frame: points (n, targets, 3), metres, or poses (n, 4, 4).

        Args:
            q: joint positions, radians.
            conditions: how the poses are reached, for effects that depend on it; as in the middle by default.

        Raises:
            ClosureError: a closed loop cannot be assembled at some pose.
        """
        T = self.predict_tool(q, conditions)
        if self.layout.pose:
            return T @ self.T_tool_target[0]
        return np.stack([se3.apply(T, target[:3, 3]) for target in self.T_tool_target], axis=1)

    def target_poses(
        self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None
    ) -> Float[np.ndarray, "n targets 4 4"]:
        """Poses of the targets in the tracker frame; where points were measured, with the tool's rotation.

        Args:
            q: joint positions, radians.
            conditions: how the poses are reached, for effects that depend on it; as in the middle by default.

        Raises:
            ClosureError: a closed loop cannot be assembled at some pose.
        """
        return self.predict_tool(q, conditions)[:, None] @ self.T_tool_target

    def residuals_on(
        self, campaign: Campaign, *, frame: Literal["tracker", "base"] = "tracker"
    ) -> Float[np.ndarray, "n targets b"]:
        """Measured less predicted, metres, and radians where both the campaign and the calibration are of poses.

        Args:
            campaign: measurements of the calibration's targets, or of some of them.
            frame: whose axes the residuals are in: the ``tracker``'s or those of the robot's ``base``.

        Returns:
            b = 3 numbers for points, 6 for poses; NaN where a beam was lost.

        Raises:
            CampaignError: a target that the calibration does not know.
            ClosureError: a closed loop cannot be assembled at some pose.
        """
        if campaign.observations:
            return residuals_by_kind(self, campaign, frame)
        ends = self.target_poses(campaign.q, campaign.conditions)[:, self.rows_of(campaign.targets)]
        residual = campaign.points - ends[..., :3, 3]
        R = self.T_tracker_base[:3, :3] if frame == "base" else np.eye(3)
        if campaign.rotations is None or not self.layout.pose:
            return residual @ R
        turn = np.full_like(residual, np.nan)
        seen = campaign.valid[:, 0]
        ends_turned = se3.exp(self.layout.turn(self.z)) @ ends[seen, 0, :3, :3]
        turn[seen, 0] = se3.log(campaign.rotations[seen] @ np.swapaxes(ends_turned, 1, 2))
        return np.concatenate([residual @ R, turn @ R], axis=2)

    def rows_of(self, targets: Sequence[str]) -> list[int]:
        """Which of the calibration's targets each of some is."""
        unknown = [name for name in targets if name not in self.targets]
        if unknown:
            raise CampaignError(
                f"the campaign's target '{unknown[0]}' is not in the calibration, which knows {', '.join(self.targets)}; choose "
                "among its targets, or refit tracker frame and targets (--reregister)"
            )
        return [self.targets.index(name) for name in targets]

    def predict_covariance(
        self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None, *, model_error: bool = True
    ) -> Float[np.ndarray, "n targets b b"]:
        """Covariance of the targets' true positions about the predicted ones, in the tracker frame.

        Args:
            q: joint positions, radians.
            conditions: how the poses are reached, for effects that depend on it. What is not told, the side from which a
                joint comes, its last move, the temperature, counts by its expectation and adds its variance.
            model_error: add what the model cannot explain at a new pose (with a residual field, what the field says of
                its own uncertainty); without it, the covariance says how well the fitted model itself is known there.

        Returns:
            b = 3 rows for points, metres²; 6 for poses, then radians².
        """
        q = np.asarray(q, dtype=float)
        at = self.layout.walked(q, self.z, self.model.prepare(q, conditions))
        nowhere = self.layout.nowhere(at, self.z)
        # how the instrument's own axes stand is nothing to the true rotations
        told = replace(at, points=_held(at.points)) if self.layout.turned else at
        _, covariance = propagate(told, nowhere, self.z_covariance)
        if self.model.conditioned:
            covariance = covariance + untold_covariance(self, q, conditions)
        if not model_error:
            return covariance
        if any(self.joint_error):
            joints = replace(
                at, layout=walk.Columns.of_joints(at.chain), factor=np.ones_like(at.s), points=_held(at.points)
            )
            variances = np.zeros(at.chain.joints)
            variances[: len(self.joint_error)] = np.square(self.joint_error)
            covariance = covariance + propagate(joints, nowhere.held(), np.diag(variances))[1]
        if self.field is None:
            return covariance + np.diag(np.repeat(np.square(self.model_error), 3)[: covariance.shape[2]])
        R = self.T_tracker_base[:3, :3]
        variance = self.field.variance(q)
        for first in range(0, covariance.shape[2], 3):
            part = slice(first, first + 3)
            covariance[:, :, part, part] += (R * variance[:, None, part] @ R.T)[:, None]
        return covariance

    def predict_tool(
        self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None
    ) -> Float[np.ndarray, "n 4 4"]:
        """Poses of the tool itself in the tracker frame.

        Raises:
            ClosureError: a closed loop cannot be assembled at some pose.
        """
        return self.T_tracker_base @ self.tool_in_base(q, conditions)

    def tool_in_base(
        self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None
    ) -> Float[np.ndarray, "n 4 4"]:
        """Poses of the tool in the robot's base, the residual field included.

        Raises:
            ClosureError: a closed loop cannot be assembled at some pose.
        """
        q = np.asarray(q, dtype=float)
        T = self.model.poses(q, self.estimate, conditions)
        if self.field is None:
            return T
        learned = self.field.mean(q)
        T[:, :3, 3] += learned[:, :3]
        if learned.shape[1] == 6:
            T[:, :3, :3] = se3.exp(learned[:, 3:]) @ T[:, :3, :3]
        return T

    def tool_covariance(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 6 6"]:
        """Covariance of the tool's true pose about the predicted one: position, then rotation, in tracker axes.

        It includes what the measured targets do not tell of the tool, as far as the tolerances allow, but not the model
        error of a single new pose (`model_error`).

        Args:
            q: joint positions, radians.

        Returns:
            metres² and radians².
        """
        J = self.tool_jacobian(q)
        return J @ self.z_covariance @ np.swapaxes(J, 1, 2)

    def tool_jacobian(
        self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None
    ) -> Float[np.ndarray, "n 6 z"]:
        """Derivative of the tool's pose by the entries of z: rows vx vy vz wx wy wz at the tool point, in tracker axes.

        Args:
            q: joint positions, radians.
            conditions: how the poses are reached, for effects that depend on it; as in the middle by default.
        """
        q = np.asarray(q, dtype=float)
        at = self.layout.walked(q, self.z, self.model.prepare(q, conditions))
        chain, e, layout = at.chain, at.e, at.layout
        if self.layout.pose:  # stop at the tool: leave out the steps from the tool to the measured pose
            chain = Chain.of([Fixed(self.layout.registration.T_tracker_base), ErrorFrame(), *self.model.steps])
            e, layout = e[:-1], replace(layout, frames=np.ascontiguousarray(layout.frames[:-1]))
        return walk.columns(chain, at.s, e, layout, at.factor, angular=True)

    def under(self, load: Load) -> "Calibration":
        """The calibrated robot under another load; residuals and outliers stay those of the load it was measured under.

        Args:
            load: payload, force and moment.

        Raises:
            TaskcalError: the model has no `Compliance`, or the robot file states no masses.
        """
        model = self.model.under(load)
        return replace(self, model=model, layout=replace(self.layout, model=model))

    def summary(self) -> dict[str, Any]:
        """The report, in millimetres and milliradians."""
        return summarise_calibration(self)

    def save(self, path: str | Path) -> None:
        """Write a versioned JSON file, all at once; `load_calibration` reads it back exactly.

        Raises:
            FileError: the folder is missing or not writable.
            TaskcalError: as `to_text`; nothing is written then.
        """
        write_whole(path, self.to_text())

    def to_text(self) -> str:
        """The text of the file that `save` writes, once it was read back.

        Raises:
            TaskcalError: the file would be refused on reading, or hold another calibration.
        """
        from taskcal.identification.calibration_file import expect_readable

        try:
            text = json.dumps(self.to_json(), indent=1, allow_nan=False) + "\n"
        except ValueError as error:
            raise TaskcalError(f"the calibration is not written, as it holds what is no number: {error}") from error
        expect_readable(text, self)
        return text

    def to_json(self) -> dict[str, Any]:
        """The content of the file."""
        return describe_calibration(self)


def _held(points: Points) -> Points:
    """Targets none of whose coordinates is a column, and no turn of what was measured."""
    return Points(position=points.position, columns=np.full_like(points.columns, -1))
