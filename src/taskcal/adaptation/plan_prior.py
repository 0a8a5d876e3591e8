"""What is known of robot and cell before poses are chosen."""

from dataclasses import dataclass

from taskcal.adaptation.hyperparameters import known_hyperparameters
from taskcal.errors import CampaignError
from taskcal.identification.calibration import Calibration
from taskcal.identification.hyperparameters import Hyperparameters
from taskcal.identification.identify import identify_parameters
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.registration import Registration, register
from taskcal.measurement.station import Station
from taskcal.measurement.tracker import TrackerNoise
from taskcal.robot.error_model import ErrorModel


@dataclass(frozen=True, eq=False, kw_only=True)
class PlanPrior:
    """From a campaign, from a calibration, or assumed."""

    hyper: Hyperparameters
    """Model error and prior scale."""
    registration: Registration | None = None
    """Where tracker and targets are, if known; a calibration has its own."""
    campaign: Campaign | None = None
    """Measured already, its targets in the station's order."""
    calibration: Calibration | None = None


def prior_from_campaign(
    model: ErrorModel, campaign: Campaign, station: Station | None, noise: TrackerNoise | None
) -> PlanPrior:
    """What a campaign shows of robot and cell.

    Raises:
        CampaignError: a campaign of poses, or targets that are not the station's.
    """
    campaign.refuse_kinds("a plan that goes on from a campaign")
    if campaign.rotations is not None:
        raise CampaignError("a plan extends a campaign of points; this one measured poses")
    _check_targets("campaign", campaign.targets, station)
    if station is not None:
        campaign = campaign.of_targets([r.name for r in station.reflectors])
    fitted = identify_parameters(model, campaign, noise=noise)
    return PlanPrior(
        hyper=known_hyperparameters(fitted, "what the campaign shows"),
        registration=register(model, campaign),
        campaign=campaign,
    )


def prior_from_calibration(model: ErrorModel, calibration: Calibration, station: Station | None) -> PlanPrior:
    """What a calibration knows, its parameters' covariance above all.

    Raises:
        CampaignError: a calibration of another model, of poses, without a prior or with frames held, or targets that are
            not the station's.
    """
    if calibration.model.robot.digest != model.robot.digest or calibration.names != model.names:
        raise CampaignError("the calibration is of another robot or model; plan with the calibration's own model")
    if calibration.layout.pose:
        raise CampaignError("a plan adds points to a calibration from points; this one is from poses")
    if calibration.layout.fixed_frames:
        raise CampaignError("the calibration held tracker frame and targets; identify with frames fitted to plan on")
    if calibration.prior_scale is None:
        raise CampaignError(
            "the calibration has no prior, and does not say how well parameters are known that its data leave open; "
            "identify with a prior to plan on"
        )
    _check_targets("calibration", calibration.targets, station)
    if station is not None and calibration.targets != tuple(r.name for r in station.reflectors):
        raise CampaignError(
            "the station's reflectors stand in another order than the calibration's targets; write "
            f"{', '.join(calibration.targets)}"
        )
    return PlanPrior(
        hyper=known_hyperparameters(calibration),
        calibration=calibration,
    )


def _check_targets(whose: str, targets: tuple[str, ...], station: Station | None) -> None:
    if station is not None and set(targets) != {r.name for r in station.reflectors}:
        raise CampaignError(
            f"the {whose}'s targets are {', '.join(targets)}, the station's reflectors "
            f"{', '.join(r.name for r in station.reflectors)}; name them alike"
        )
    if station is None and len(targets) > 1:
        raise CampaignError(f"the {whose} has several targets; say with a station which reflectors the tool carries")
