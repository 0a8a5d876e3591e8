"""Whether joints and points of a campaign can belong together at all, to this robot and to an instrument."""

import numpy as np
from jaxtyping import Float

from taskcal.campaigns.campaign import Campaign, named_file
from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.registration.registration import PLAUSIBLE_SHARE, Registration, nominal_poses, register, register_trimmed
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot

MAX_WRONG_SHARE = 0.1
"""Share of the rows, at most, that may be wrong. A convention: with more, others than these could be the right ones."""

COMPUTED_RESIDUAL_M = 1e-7
"""Residual of joints that nobody read of a robot, metres: a controller shows thousandths of a degree."""

EXACT_SHARE = 1e-5
"""Residual of the nominal robot over the scatter of the points, below which these are calculated: 10 µm over a metre. Robots repeat
to some 20 µm, and a tracker is uncertain by 10 µm and more; a controller's own numbers are rounded to a micrometre or ten."""

EXACT_SHARE_IN_BASE = 2.0 * EXACT_SHARE
"""The same where the points are in the robot's base."""

OF_ROUNDING = 1.5
"""Residual over what the digits of joints and positions leave, below which these are calculated in the robot's base: of eight
points it scatters by a sixth."""

EXACT_SHARE_OF_REACH = 1e-4
"""Largest such residual over the robot's reach: 0.1 mm over a metre. Robots miss their nominal geometry by several tenths."""

MIN_EXACT_POINTS = 8
"""Points whose 24 coordinates nine unknowns of frame and target cannot fit by chance."""

IN_BASE_M, IN_BASE_RAD = 2e-3, 2e-3
"""How far the frame of a controller's own positions is found from the base: its own robot differs a little from the nominal."""


def check_plausible(registration: Registration, model: ErrorModel, campaign: Campaign) -> None:
    """Raise a `CampaignError` if the nominal robot is so far from the measurements that they cannot be its own.

    If all but a few rows fit, the message names these; else it names what is usually wrong. Nor can it fit exactly.
    """
    refuse_calculated(model, campaign, registration)
    if registration.rms < COMPUTED_RESIDUAL_M and all(kind.touched for kind in campaign.observations):
        raise CampaignError(
            f"{named_file(campaign)}contacts agree with the nominal model to {registration.rms * 1e9:.1g} nm, as no real one "
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
        f"{named_file(campaign)}joint values and points are inconsistent with {model.robot.name}: registration residual "
        f"{registration.rms * 1e3:.1f} mm rms ({registration.rms / reach:.1%} of the {reach:.2f} m link length). Likely causes: "
        "another robot or variant; joints in another order, with other signs or zero positions; degrees taken for radians; "
        'an axis coupling that the robot file lacks (angle = "-(J2 + J3)"); metres or inches for millimetres; rows of joints '
        "and points that do not belong together. 'taskcal doctor' (in Python: diagnose) tests these and names the cause"
    )


def refuse_calculated(model: ErrorModel, campaign: Campaign, registration: Registration | None = None) -> None:
    """Raise a `CampaignError` if the nominal robot fits a tracked target of a file as no robot and no instrument would let it.

    Args:
        model: the robot.
        campaign: the measurements.
        registration: of the whole campaign, where it is known.
    """
    if campaign.lines is None:
        # made in memory: a simulation, whose maker knows
        return
    for t, name in enumerate(campaign.targets):
        points = campaign.points[campaign.valid[:, t], t]
        if len(points) < MIN_EXACT_POINTS or not campaign.observations[t].in_tracker:
            continue
        found = registration
        if found is None or len(campaign.targets) > 1:
            try:
                found = register(model, campaign.of_targets([name]))
            except CampaignError:
                continue
        scatter = float(np.sqrt(np.mean(np.sum((points - points.mean(axis=0)) ** 2, axis=1))))
        limit = EXACT_SHARE * scatter
        if is_in_base(found, 0.1):
            rounded = _rounding(model, campaign, t, found.T_tool_target[0, :3, 3])
            limit = max(
                EXACT_SHARE_IN_BASE * scatter, min(OF_ROUNDING * rounded, EXACT_SHARE_OF_REACH * model.robot.reach)
            )
        if found.rms < limit:
            raise CampaignError(
                f"{named_file(campaign)}target '{name}' was calculated, not measured: the nominal robot fits it to "
                f"{found.rms * 1e3:.1g} mm rms, as no real robot lets an instrument measure it. Positions that the controller "
                "shows (or a simulation without noise) cannot calibrate it; give those of an instrument, or choose them with "
                "--targets"
            )


def _rounding(model: ErrorModel, campaign: Campaign, target: int, p: Float[np.ndarray, "3"]) -> float:
    """Root mean square distance that the digits of joints and positions leave of a target to the nominal robot's, metres."""
    rows = campaign.valid[:, target]
    q, points = campaign.q[rows], campaign.points[rows, target]

    def placed(q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 3"]:
        T = model.poses(q)
        return T[:, :3, :3] @ p + T[:, :3, 3]

    at = placed(q)
    variance = 3.0 * _step(points * 1e3, 1e-3) ** 2 / 12.0
    for j, slides in enumerate(model.robot.prismatic):
        scale = 1e-3 if slides else float(np.radians(1.0))
        step = max(_step(q[:, j] / scale, scale), 0.0 if slides else _step(q[:, j], 1.0))
        moved = q.copy()
        moved[:, j] += step
        variance += float(np.mean(np.sum((placed(moved) - at) ** 2, axis=1))) / 12.0
    return float(np.sqrt(variance))


def _step(values: np.ndarray, unit: float) -> float:
    """The last digit that numbers have in common, times their unit; 0 of those with more than four decimals."""
    for decimals in range(5):
        if np.abs(values - values.round(decimals)).max(initial=0.0) < 1e-7:
            return unit * 10.0**-decimals
    return 0.0


def is_in_base(registration: Registration, share: float = 1.0) -> bool:
    """Whether the measuring frame is the robot's base, within a share of `IN_BASE_M` and `IN_BASE_RAD`."""
    T = registration.T_tracker_base
    angle = float(np.linalg.norm(se3.log(T[:3, :3])))
    return float(np.linalg.norm(T[:3, 3])) < share * IN_BASE_M and angle < share * IN_BASE_RAD


def fits_in_base(robot: Robot, campaign: Campaign, target: str) -> bool:
    """Whether the nominal robot fits a tracked target in a frame that is its own base."""
    model = ErrorModel(robot)
    try:
        found = register(model, campaign.of_targets([target]))
    except CampaignError:
        return False
    return found.rms <= PLAUSIBLE_SHARE * robot.reach and is_in_base(found)


def check_targets(registration: Registration, campaign: Campaign, within: float) -> None:
    """Raise a `CampaignError` if a target is found where none can be.

    Args:
        registration: as found.
        campaign: the measurements.
        within: how far from the TCP a target may be, metres.
    """
    distance = np.linalg.norm(registration.T_tool_target[:, :3, 3], axis=1)
    far = int(distance.argmax())
    if distance[far] > within:
        raise CampaignError(
            f"{named_file(campaign)}target '{campaign.targets[far]}' is found {distance[far] * 1e3:.4g} mm from the TCP, "
            f"where at most {within * 1e3:.4g} mm are expected: check the joints of rows in rare orientations, and the tool in the "
            "robot file; if the target really is so far out, allow it (target_within, --target-within-mm)"
        )


def most_wrong_rows(rows: int) -> int:
    """Largest number of rows of so many that may be wrong."""
    return max(1, round(MAX_WRONG_SHARE * rows))


def _few_wrong_rows(model: ErrorModel, campaign: Campaign) -> list[tuple[int, float]]:
    """Rows without which the campaign fits, and how far off each is; none if that is not the trouble."""
    distance = register_trimmed(nominal_poses(model, campaign), campaign, model)[1]
    limit, seen = PLAUSIBLE_SHARE * model.robot.reach, campaign.seen
    wrong = seen & (distance > 3.0 * limit)
    if wrong.sum() > most_wrong_rows(int(seen.sum())) or np.sqrt(np.mean(distance[seen & ~wrong] ** 2)) > limit:
        return []
    return [(int(row), float(distance[row])) for row in np.flatnonzero(wrong)]
