"""How tracker frame and targets are registered before a fit."""

from typing import TYPE_CHECKING, Annotated, Literal

from taskcal_groundwork.options import Option

if TYPE_CHECKING:
    from taskcal.campaigns.campaign import Campaign
    from taskcal.registration.registration import Registration
    from taskcal.robot.error_model import ErrorModel

Method = Literal["poses", "circles"]
"""All poses, or the circles of axes that turn alone."""

TargetWithin = Annotated[
    float,
    Option(
        metavar="MM",
        help="Maximum distance of a target from the TCP; where the poses do not locate it, its standard uncertainty there, "
        "100 mm at most.",
        unit="mm",
        low=0.0,
        high=1e5,
    ),
]
"""Of a fit, and of the plan of its poses. No robot carries a tool that is longer than 100 m."""

TARGET_WITHIN = 1.0
"""How far a target may be from the TCP, metres: tools are no longer, and where joints or points are wrong the target is
the first to be found far away."""


def register_by(method: Method, model: "ErrorModel", campaign: "Campaign") -> "Registration":
    """The registration of a campaign.

    Raises:
        CampaignError: the campaign does not determine it, or is not of this robot.
    """
    from taskcal.registration.circles import register_from_circles
    from taskcal.registration.plausibility import check_plausible
    from taskcal.registration.registration import register

    registered = register_from_circles(model, campaign) if method == "circles" else register(model, campaign)
    check_plausible(registered, model, campaign)
    return registered
