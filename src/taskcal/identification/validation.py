"""How well a calibration predicts a campaign."""

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float

from taskcal.arguments import expect_kinds
from taskcal.errors import CampaignError, FitError
from taskcal.estimation.least_squares import Stopping, fit
from taskcal.estimation.scaled import invert_positive
from taskcal.geometry.normal_equations import SQUARED
from taskcal.geometry.observations import Walked
from taskcal.identification.belief import frame_precision
from taskcal.identification.calibration import Calibration
from taskcal.identification.linearisation import linearise_rows
from taskcal.identification.observation_layout import layout_of, problem_of
from taskcal.identification.observed_errors import residuals_by_kind, unknowns_of
from taskcal.identification.prediction_errors import Validation
from taskcal.identification.problem import Problem, whitener
from taskcal.identification.row_errors import LEAST, RowErrors, of_targets
from taskcal.identification.weighed_fit import SLOW
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.observation import Compared
from taskcal.measurement.plausibility import check_plausible
from taskcal.measurement.registration import PLAUSIBLE_SHARE, Registration, register
from taskcal.measurement.tracker import TrackerNoise


def validate(calibration: Calibration, campaign: Campaign, *, reregister: bool = False) -> Validation:
    """Compare a campaign with the calibration's predictions.

    Args:
        calibration: the calibration.
        campaign: measurements, of the calibration's own targets unless `reregister`.
        reregister: refit tracker frame and targets to this campaign, with the robot's geometry frozen; for a tracker or a
            target that has been moved.

    Raises:
        CampaignError: nothing was measured, or the targets are not the calibration's.
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    expect_kinds({"calibration": Calibration, "campaign": Campaign}, calibration=calibration, campaign=campaign)
    if reregister:
        calibration = reregister_frames(calibration, campaign)
    residual = errors_on(calibration, campaign)
    if not campaign.valid.any():
        raise CampaignError("the campaign has no measured point to compare with: every beam was lost")
    validation = replace(
        Validation.of_residuals(residual, calibration.T_tracker_base[:3, :3], campaign.kinds),
        compared=_compared(calibration, campaign),
    )
    off = float(np.median(validation.errors))
    if off <= PLAUSIBLE_SHARE * calibration.model.robot.reach:
        return validation
    remark = (
        f"the campaign is {off * 1e3:.0f} mm away from what the calibration predicts: if the tracker or the target was moved, "
        "refit them (reregister); else units, joints or the robot are others, which taskcal doctor (in Python: diagnose) tells"
    )
    return replace(validation, remarks=(remark,))


def _compared(calibration: Calibration, campaign: Campaign) -> tuple[Compared, ...]:
    """Lengths that are stated, and as the calibrated robot finds them in a campaign."""
    if not campaign.observations:
        return ()
    found = unknowns_of(calibration, campaign, settled=True)
    return tuple(
        one for kind, unknown in zip(campaign.observations, found, strict=True) for one in kind.compare(unknown)
    )


def errors_on(calibration: Calibration, campaign: Campaign) -> Float[np.ndarray, "n targets b"]:
    """What a validation judges: measured less predicted in the tracker's frame.

    Without a tracker, what stands (sockets, anchors …) is where the calibrated robot finds it in this campaign.

    Raises:
        CampaignError: a target that the calibration does not know.
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    return (
        residuals_by_kind(calibration, campaign, settled=True)
        if campaign.observations
        else calibration.residuals_on(campaign)
    )


def reregister_frames(
    calibration: Calibration, campaign: Campaign, *, noise: TrackerNoise | None = None
) -> Calibration:
    """Refit tracker frame and targets of a calibration to a campaign, with the robot held as calibrated.

    Positions and rotations count by the covariance that they had in the fit: the instrument's noise, and the calibration's own
    errors of position, rotation and joints at a single pose.

    Args:
        calibration: the calibration.
        campaign: measurements.
        noise: the tracker's, where the campaign does not state uncertainties.

    Returns:
        the calibration in its new frames; their covariance is that of these rows, with the robot as calibrated.

    Raises:
        CampaignError: too few rows, or joints and points that do not belong together.
        FitError: the fit of the frames did not converge.
    """
    if not (campaign.observations or calibration.layout.pose):
        campaign = replace(campaign, rotations=None)  # the calibration says nothing of rotations
    registration = register(
        calibration.model, campaign, poses=calibration.tool_in_base(campaign.q, campaign.conditions)
    )
    check_plausible(registration, calibration.model, campaign)
    frames = layout_of(calibration.model, np.arange(0), registration, campaign, fixed=False)
    shown = problem_of(frames, _without_field(calibration, campaign, registration), noise)
    problem = _HeldRobot(**{f.name: getattr(shown, f.name) for f in fields(Problem)}, estimate=calibration.estimate)
    z, covariance = _fit_frames(problem, calibration)
    from scipy.linalg import block_diag

    layout = replace(frames, kept=np.arange(len(calibration.model)))
    T_tracker_base, T_tool_target = frames.frames(z)
    return replace(
        calibration,
        T_tracker_base=T_tracker_base,
        T_tool_target=T_tool_target,
        layout=layout,
        z=np.concatenate([calibration.estimate, z]),
        z_covariance=block_diag(calibration.covariance, covariance),
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class _HeldRobot(Problem):
    """A problem whose unknowns are tracker frame and targets alone, of a robot that is known."""

    estimate: Float[np.ndarray, " p"]
    """Of all parameters of the model, metres and radians."""

    @cached_property
    def _robot(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        model = self.frames.model
        at = model.walk(self.q, self.estimate, self.frames.columns, model.prepare(self.q, self.conditions))
        return at.s, at.factor, at.e

    def walked(self, z: Float[np.ndarray, " z"]) -> Walked:
        """The walk of the known robot between the frames of an estimate."""
        return self.frames.reframed(*self._robot, z)


def _fit_frames(
    problem: _HeldRobot, calibration: Calibration
) -> tuple[Float[np.ndarray, " z"], Float[np.ndarray, "z z"]]:
    """Estimate of tracker frame and targets, and its covariance.

    Raises:
        FitError: the fit did not converge.
    """
    start, targets, width = problem.frames.start(), len(problem.frames.targets), problem.frames.block_size
    position, rotation = np.maximum(np.square(np.resize(calibration.model_error, 2)), LEAST)
    joints = np.zeros(len(calibration.model.robot.joints))
    joints[: len(calibration.joint_error)] = np.square(calibration.joint_error)
    errors = RowErrors(position=float(position), rotation=float(rotation) if width == 6 else None, joints=joints)
    blocks = of_targets(errors.covariance(linearise_rows(problem, start), problem.noise), targets)
    equations = problem.equations(whitener(blocks), SQUARED, 1.0)
    precision = frame_precision(problem.frames)
    found = fit(equations, start, start, precision, np.full(len(start), 1e-3), SLOW if problem.kinds else Stopping())
    if not found.converged:
        raise FitError(f"tracker frame and targets could not be refitted: {found.reason}; check the campaign's rows")
    return found.z, invert_positive(found.information + precision)


def _without_field(calibration: Calibration, campaign: Campaign, registration: Registration) -> Campaign:
    """The campaign as a robot without the calibration's residual field would have shown it to a tracker."""
    if calibration.field is None or campaign.observations:
        return campaign
    ends = [
        (registration.T_tracker_base @ T)[:, None] @ registration.T_tool_target
        for T in (
            calibration.tool_in_base(campaign.q, campaign.conditions),
            calibration.model.poses(campaign.q, calibration.estimate, campaign.conditions),
        )
    ]
    rotations = campaign.rotations
    if rotations is not None:
        rotations = ends[1][:, 0, :3, :3] @ np.swapaxes(ends[0][:, 0, :3, :3], 1, 2) @ rotations
    return replace(campaign, points=campaign.points - (ends[0] - ends[1])[..., :3, 3], rotations=rotations)
