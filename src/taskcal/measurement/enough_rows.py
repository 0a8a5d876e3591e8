"""Whether a campaign has enough rows for what stands and what is on the tool."""

from taskcal.errors import CampaignError
from taskcal.measurement.campaign import Campaign


def named_file(campaign: Campaign) -> str:
    """The file a message is about, in front of it."""
    return f"{campaign.source}: " if campaign.source else ""


def check_rows(campaign: Campaign, parameters: int = 0) -> None:
    """Raise a `CampaignError` unless there are enough measurements for the frames alone."""
    if campaign.observations:
        _check_observed_rows(campaign, parameters)
        return
    per_row = 3 if campaign.rotations is None else 6
    needed_per_target = 3 if campaign.rotations is None else 6
    for t, name in enumerate(campaign.targets):
        seen = int(campaign.valid[:, t].sum())
        if seen == 0:
            others = ", ".join(other for other in campaign.targets if other != name)
            remedy = f"leave it out: choose among {others}" if others else "measure again, or read another target"
            raise CampaignError(f"{named_file(campaign)}target '{name}' was never seen; {remedy}")
    seen = int(campaign.valid.sum())
    unknown = 6 + needed_per_target * len(campaign.targets) + parameters
    if per_row * seen <= unknown:
        rows = unknown // (per_row * len(campaign.targets)) + 1
        what = "points" if per_row == 3 else "poses"
        targets = f"{len(campaign.targets)} target{'s' if len(campaign.targets) > 1 else ''}"
        raise CampaignError(
            f"{named_file(campaign)}{seen} measured {what} in {len(campaign)} rows are too few: the tracker frame and {targets} "
            f"alone need more than {unknown} numbers; measure at least {rows} poses, better 30 or more"
        )


def _check_observed_rows(campaign: Campaign, parameters: int) -> None:
    unknown, measured = parameters + 6 * any(one.in_tracker for one in campaign.observations), 0
    for t, one in enumerate(campaign.observations):
        seen = int(campaign.valid[:, t].sum())
        if seen == 0:
            raise CampaignError(f"{named_file(campaign)}'{campaign.targets[t]}' was never measured; measure again")
        unknown += (6 if one.turned else 3) + len(one.unknowns)
        measured += one.width * seen
    if measured <= unknown:
        raise CampaignError(
            f"{named_file(campaign)}{measured} measured numbers in {len(campaign)} rows are too few: what stands, and what is on "
            f"the tool, alone need more than {unknown}; measure more postures, better 30 or more"
        )
