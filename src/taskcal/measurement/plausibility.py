"""Whether joints and points can belong to each other at all."""

from dataclasses import replace

import numpy as np

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.consensus import find_consensus
from taskcal.measurement.enough_rows import named_file
from taskcal.measurement.registration import PLAUSIBLE_SHARE, Registration, nominal_poses, register
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot

LARGEST_SHARE = 0.1
"""Of the rows, that may be wrong: with more, others than these could be the right ones."""

COMPUTED = 1e-7
"""Residual of joints that nobody read of a robot, metres: a controller shows thousandths of a degree."""

EXACT = 1e-5
"""Residual of the nominal robot over the scatter of the points, below which these are calculated: 10 µm over a metre. Robots repeat
to some 20 µm, and a tracker is uncertain by 10 µm and more; a controller's own numbers are rounded to a micrometre or ten."""

EXACT_IN_BASE = 2.0 * EXACT
"""The same where the points are in the robot's base."""

MIN_EXACT = 8
"""Points whose 24 coordinates nine unknowns of frame and target cannot fit by chance."""

IN_BASE_M, IN_BASE_RAD = 2e-3, 2e-3
"""How far the frame of a controller's own positions is found from the base: its own robot differs a little from the nominal."""

TARGET_WITHIN = 1.0
"""How far a target may be from the tool point, metres: tools are no longer, and where joints or points are wrong the target is
the first to be found far away."""


def check_plausible(registration: Registration, model: ErrorModel, campaign: Campaign) -> None:
    """Raise a `CampaignError` if the nominal robot is so far from the measurements that they cannot be its own.

    If all but a few rows fit, the message names these; else it names what is usually wrong. Nor can it fit exactly.
    """
    _refuse_calculated(registration, model, campaign)
    if registration.rms < COMPUTED and campaign.observations and all(kind.touched for kind in campaign.observations):
        raise CampaignError(
            f"{named_file(campaign)}by the nominal robot everything touches to {registration.rms * 1e9:.1g} nm, as no real one "
            "lets it: these joints were computed, as a plan's are; write down what the controller shows where it touches"
        )
    reach = model.robot.reach
    if registration.rms <= PLAUSIBLE_SHARE * reach:
        return
    wrong = _few_wrong_rows(model, campaign)
    if wrong:
        named = ", ".join(f"{campaign.row(row)}, off by {distance * 1e3:.0f} mm" for row, distance in wrong)
        raise CampaignError(
            f"{named_file(campaign)}{len(wrong)} of {len(campaign)} rows cannot be right: {named}; all others fit. Correct them, "
            "or leave them out"
        )
    raise CampaignError(
        f"{named_file(campaign)}these joints and points do not fit {model.robot.name}: after registration the nominal robot is off "
        f"by {registration.rms * 1e3:.1f} mm rms, {registration.rms / reach:.1%} of its {reach:.2f} m of links. Likely causes: "
        "another robot or variant; joints in another order, with other signs or zero positions; degrees taken for radians; "
        'an axis coupling that the robot file lacks (angle = "-(J2 + J3)"); metres or inches for millimetres; rows of joints '
        "and points that do not belong together. 'taskcal doctor' (in Python: diagnose) tries these and says which"
    )


def _refuse_calculated(registration: Registration, model: ErrorModel, campaign: Campaign) -> None:
    """Raise a `CampaignError` if the nominal robot fits a tracked target of a file as no robot and no instrument would let it."""
    if campaign.lines is None:
        # made in memory: a simulation, whose maker knows
        return
    for t, name in enumerate(campaign.targets):
        points = campaign.points[campaign.valid[:, t], t]
        if len(points) < MIN_EXACT or (campaign.observations and not campaign.observations[t].in_tracker):
            continue
        found = registration
        if len(campaign.targets) > 1:
            try:
                found = register(model, replace(campaign.of_targets([name]), observations=()))
            except CampaignError:
                continue
        scatter = float(np.sqrt(np.mean(np.sum((points - points.mean(axis=0)) ** 2, axis=1))))
        if found.rms < (EXACT_IN_BASE if is_in_base(found, 0.1) else EXACT) * scatter:
            raise CampaignError(
                f"{named_file(campaign)}target '{name}' was calculated, not measured: the nominal robot fits it to "
                f"{found.rms * 1e3:.1g} mm rms, as no robot repeats and no instrument measures. Positions that the controller "
                "shows (or a simulation without noise) cannot calibrate it; give those of an instrument, or choose them with "
                "--targets"
            )


def is_in_base(registration: Registration, share: float = 1.0) -> bool:
    """Whether the measuring frame is the robot's base, within a share of `IN_BASE_M` and `IN_BASE_RAD`."""
    T = registration.T_tracker_base
    angle = float(np.linalg.norm(se3.log(T[:3, :3])))
    return float(np.linalg.norm(T[:3, 3])) < share * IN_BASE_M and angle < share * IN_BASE_RAD


def fits_in_base(robot: Robot, campaign: Campaign, target: str) -> bool:
    """Whether the nominal robot fits a tracked target in a frame that is its own base."""
    model = ErrorModel(robot)
    try:
        found = register(model, replace(campaign.of_targets([target]), observations=()))
    except CampaignError:
        return False
    return found.rms <= PLAUSIBLE_SHARE * robot.reach and is_in_base(found)


def check_targets(registration: Registration, campaign: Campaign, within: float) -> None:
    """Raise a `CampaignError` if a target is found where none can be.

    Args:
        registration: as found.
        campaign: the measurements.
        within: how far from the tool point a target may be, metres.
    """
    distance = np.linalg.norm(registration.T_tool_target[:, :3, 3], axis=1)
    far = int(distance.argmax())
    if distance[far] > within:
        raise CampaignError(
            f"{named_file(campaign)}target '{campaign.targets[far]}' is found {distance[far] * 1e3:.0f} mm from the tool point, "
            f"where at most {within * 1e3:.0f} mm are expected: check the joints of rows in rare orientations, and the tool in the "
            "robot file; if the target really is so far out, allow it (target_within, --target-within-mm)"
        )


def most_wrong_rows(rows: int) -> int:
    """How many rows of so many may be wrong."""
    return max(1, round(LARGEST_SHARE * rows))


def _few_wrong_rows(model: ErrorModel, campaign: Campaign) -> list[tuple[int, float]]:
    """Rows without which the campaign fits, and how far off each is; none if that is not the trouble."""
    consensus = find_consensus(model, campaign, nominal_poses(model, campaign))
    seen = campaign.seen
    wrong = np.flatnonzero(seen & (consensus.distance > 3.0 * PLAUSIBLE_SHARE * model.robot.reach))
    if consensus.registration.rms > PLAUSIBLE_SHARE * model.robot.reach or len(wrong) > most_wrong_rows(
        int(seen.sum())
    ):
        return []
    return [(int(row), float(consensus.distance[row])) for row in wrong]
