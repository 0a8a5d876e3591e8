"""How well a calibration predicts a campaign."""

from dataclasses import fields, replace

import numpy as np
from jaxtyping import Float

from taskcal.arguments import expect_kinds
from taskcal.errors import CampaignError
from taskcal.identification.calibration import Calibration
from taskcal.identification.observation_layout import ObservationLayout
from taskcal.identification.observed_errors import residuals_by_kind, unknowns_of
from taskcal.identification.prediction_errors import Validation
from taskcal.identification.problem import FrameLayout
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.observation import Compared
from taskcal.measurement.plausibility import check_plausible
from taskcal.measurement.registration import PLAUSIBLE_SHARE, register


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


def reregister_frames(calibration: Calibration, campaign: Campaign) -> Calibration:
    """The calibration with tracker frame and targets refitted to a campaign; its covariance stays that of the old ones.

    Raises:
        CampaignError: too few rows, or joints and points that do not belong together.
    """
    registration = register(
        calibration.model, campaign, poses=calibration.tool_in_base(campaign.q, campaign.conditions)
    )
    check_plausible(registration, calibration.model, campaign)
    layout = calibration.layout
    if isinstance(layout, ObservationLayout):  # what stands is found from the campaign
        layout = FrameLayout(**{f.name: getattr(layout, f.name) for f in fields(FrameLayout)})
    return replace(
        calibration,
        T_tracker_base=registration.T_tracker_base,
        T_tool_target=registration.T_tool_target,
        layout=replace(layout, targets=campaign.targets),
    )
