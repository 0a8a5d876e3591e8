"""Consensus of a campaign's rows on tracker frame and targets, by the nominal robot.

Least trimmed squares (Rousseeuw 1984) with concentration steps (Rousseeuw and Van Driessen 2006): the registration that
leaves the smallest sum of squares on the best three quarters of the rows. What the other rows say is then judged by it.
"""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.campaigns.campaign import Campaign, named_file
from taskcal.errors import CampaignError
from taskcal.estimation.matrices import single_threaded
from taskcal.geometry import se3
from taskcal.registration.registration import (
    PLAUSIBLE_SHARE,
    Cloud,
    Registration,
    nominal_poses,
    register,
    register_cloud,
    register_observations,
    serves,
)
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot

TRUSTED_SHARE = 0.75
"""Share of the rows that the trimmed sum counts. A convention between the share of wrong rows that is borne and the use of
right ones."""

SUBSETS = 24
"""Subsets from which the search starts where the whole campaign does not agree: with a tenth of the rows wrong, eight rows are
all right with a chance of 0.43, and not once in 24 times with one of 10⁻⁶."""

SUBSET_ROWS = 8

SAMPLED_FROM, SAMPLE = 3000, 1000
"""Rows from which on the subsets are drawn of so many of them, as of a large sample (Rousseeuw and Van Driessen 2006)."""

FAR_SIGMAS = 10.0
"""Times the median distance: on measured robots the nominal geometry leaves at most 8.4 times the median."""

TRACKER_NOISE = 1e-4
"""Distance, metres, below which no row is far, however well the others agree. A convention: several times the uncertainty of a
laser tracker."""

MAX_STEPS, MAX_STEPS_OF_MANY = 10, 2
"""Concentration steps, and those of very many rows from what a sample of them came to; each lowers the trimmed sum."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Consensus:
    """Rows that agree, and the registration that they give."""

    rows: Bool[np.ndarray, " n"]
    """Those seen that agree; all of them where more than a quarter would not."""
    registration: Registration
    """Of all rows where `of_all`; else of the best three quarters; where a tracker did not measure all, of those that its points
    leave."""
    distance: Float[np.ndarray, " n"]
    """How far each row is from where the registered nominal robot has it, metres; zero where nothing was seen."""
    of_all: bool = False
    """Whether the registration is that of all rows that were seen."""
    first: Registration | None = None
    """Of the rows that the search began with."""

    @property
    def trimmed(self) -> float:
        """Trimmed sum of squared residuals over the trusted rows, m²."""
        square = np.sort(self.distance[self.distance > 0.0] ** 2)
        return float(square[: int(np.ceil(TRUSTED_SHARE * len(square)))].sum())


@single_threaded
def find_consensus(
    model: ErrorModel, campaign: Campaign, poses: Float[np.ndarray, "n 4 4"], seed: int = 0
) -> Consensus:
    """The rows that agree.

    Args:
        model: the robot's model.
        campaign: the measurements.
        poses: of the nominal tool in the base, at every row.
        seed: of the subsets, where any are needed.

    Raises:
        CampaignError: no subset of the rows determines the frames.
    """
    if campaign.observations:
        return _by_kind(model, campaign, poses)
    seen, cloud = np.flatnonzero(campaign.seen), Cloud.of(poses, campaign)
    best: Consensus | None = None
    if len(seen) <= SAMPLED_FROM:
        if cloud.shows_all:
            whole = register_cloud(cloud)
            if serves(whole, cloud, campaign, model.robot.reach) and agrees_throughout(whole, cloud):
                distance = _distances(whole, cloud, len(campaign), model)
                return Consensus(rows=campaign.seen, registration=whole, distance=distance, of_all=True)
        best = _settle(model, campaign, cloud, seen)
        whole = None if best is None or not best.rows[seen].all() else best.first
        if best is not None and whole is not None and serves(whole, cloud, campaign, model.robot.reach):
            return replace(best, registration=whole, of_all=True)
    if best is None or not best.rows[seen].all():
        for start in _starts(model, campaign, poses, cloud, np.random.default_rng(seed)):
            trial = _settle(model, campaign, cloud, start)
            if trial is not None and (best is None or trial.trimmed < best.trimmed * (1.0 - 1e-9)):
                best = trial
    if best is None:
        raise CampaignError(f"{named_file(campaign)}no subset of the rows determines tracker frame and targets")
    return best


def _starts(
    model: ErrorModel, campaign: Campaign, poses: np.ndarray, cloud: Cloud, rng: np.random.Generator
) -> Iterator[Int[np.ndarray, " k"]]:
    """Rows from which the search starts: subsets at random; of very many rows, what those of some of them come to."""
    seen = np.flatnonzero(campaign.seen)
    if len(seen) > SAMPLED_FROM:
        some = np.sort(rng.choice(seen, size=SAMPLE, replace=False))
        with suppress(CampaignError):  # some of the rows need not show every target
            found = find_consensus(model, campaign.take(some), poses[some], int(rng.integers(2**31)))
            yield _nearest(_distances(found.registration, cloud, len(campaign), model), seen)
            return
        yield seen
    for _ in range(SUBSETS):
        yield np.sort(rng.choice(seen, size=min(SUBSET_ROWS, len(seen)), replace=False))


def _nearest(distance: Float[np.ndarray, " n"], seen: Int[np.ndarray, " s"]) -> Int[np.ndarray, " k"]:
    """The trusted share of the rows, those that are least far off."""
    of_seen = distance[seen]
    count = int(np.ceil(TRUSTED_SHARE * len(seen)))
    return seen[of_seen <= np.partition(of_seen, count - 1)[count - 1]]


def _by_kind(model: ErrorModel, campaign: Campaign, poses: Float[np.ndarray, "n 4 4"]) -> Consensus:
    """Every kind of observation is placed in spite of a few wrong rows; a tracker's points agree among themselves."""
    tracked = [name for name, one in zip(campaign.targets, campaign.observations, strict=True) if one.in_tracker]
    rows = campaign.seen
    if tracked:
        alone = replace(campaign.of_targets(tracked), observations=())
        agreed = find_consensus(model, alone, poses)
        rows = np.asarray(rows & (agreed.rows | ~alone.seen))
    registration, distance = register_observations(poses, campaign.without(~rows), model)
    limit = max(FAR_SIGMAS * float(np.median(distance[rows])), TRACKER_NOISE)
    near = np.asarray(rows & (distance <= limit))
    return Consensus(
        rows=near if near.sum() >= TRUSTED_SHARE * rows.sum() else rows,
        registration=registration,
        distance=distance,
        of_all=bool((rows == campaign.seen).all()),
    )


def _settle(model: ErrorModel, campaign: Campaign, cloud: Cloud, rows: Int[np.ndarray, " k"]) -> Consensus | None:
    """Register on some rows, then on those that agree best, until these stay the same; None where that cannot be done."""
    reached: Consensus | None = None
    first: Registration | None = None
    Z: np.ndarray | None = None
    seen = campaign.seen
    for _ in range(MAX_STEPS if len(rows) <= SAMPLED_FROM else MAX_STEPS_OF_MANY):
        chosen = np.zeros(len(campaign), dtype=bool)
        chosen[rows] = True
        part = cloud.take(chosen[cloud.row])
        if not part.shows_all:
            return reached
        registration = register_cloud(part, Z)
        first, Z = first or registration, registration.T_tracker_base[:3, :3]
        distance = _distances(registration, cloud, len(campaign), model)
        agreed = seen
        near = distance <= max(FAR_SIGMAS * float(np.median(distance[seen])), TRACKER_NOISE)
        if near[seen].mean() >= TRUSTED_SHARE:
            agreed = np.asarray(agreed & near)
        reached = Consensus(rows=agreed, registration=registration, distance=distance, first=first)
        following = _nearest(distance, np.flatnonzero(seen))
        if np.array_equal(following, rows):
            break
        rows = following
    return reached


def agrees_throughout(registration: Registration, cloud: Cloud) -> bool:
    """Whether every point is so near to where the registration of all of them has it that none can be found wrong.

    A wrong point pulls a registration towards itself, and its residual falls by its leverage: four fifths of the distance up to
    which rows agree leave room for a leverage of a fifth.
    """
    distance = np.linalg.norm(
        cloud.residual(
            registration.T_tracker_base[:3, :3],
            registration.T_tracker_base[:3, 3],
            registration.T_tool_target[:, :3, 3],
        ),
        axis=1,
    )
    return bool(distance.max() <= 0.8 * max(FAR_SIGMAS * float(np.median(distance)), TRACKER_NOISE))


def _distances(registration: Registration, cloud: Cloud, rows: int, model: ErrorModel) -> Float[np.ndarray, " n"]:
    """Distance of the farthest target of every row, metres; a measured pose's rotation counts at the robot's reach."""
    T, targets = registration.T_tracker_base, registration.T_tool_target
    residual = cloud.residual(T[:3, :3], T[:3, 3], targets[:, :3, 3])
    square = np.einsum("ni,ni->n", residual, residual)
    if cloud.Y is not None:
        turned = se3.log(cloud.Y @ np.swapaxes(T[:3, :3] @ cloud.R @ targets[0, :3, :3], 1, 2))
        square += np.sum((model.robot.reach * turned) ** 2, axis=1)
    farthest = np.zeros((rows, cloud.count))
    farthest[cloud.row, cloud.target] = square
    return np.sqrt(farthest.max(axis=1))


# Whether joints and points can belong to each other at all.

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

TARGET_WITHIN = 1.0
"""How far a target may be from the TCP, metres: tools are no longer, and where joints or points are wrong the target is
the first to be found far away."""


def check_plausible(registration: Registration, model: ErrorModel, campaign: Campaign) -> None:
    """Raise a `CampaignError` if the nominal robot is so far from the measurements that they cannot be its own.

    If all but a few rows fit, the message names these; else it names what is usually wrong. Nor can it fit exactly.
    """
    refuse_calculated(model, campaign, registration)
    if (
        registration.rms < COMPUTED_RESIDUAL_M
        and campaign.observations
        and all(kind.touched for kind in campaign.observations)
    ):
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
        "and points that do not belong together. 'taskcal doctor' (in Python: diagnose) tries these and says which"
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
        if len(points) < MIN_EXACT_POINTS or (campaign.observations and not campaign.observations[t].in_tracker):
            continue
        found = registration
        if found is None or len(campaign.targets) > 1:
            try:
                found = register(model, replace(campaign.of_targets([name]), observations=()))
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
        found = register(model, replace(campaign.of_targets([target]), observations=()))
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
            f"{named_file(campaign)}target '{campaign.targets[far]}' is found {distance[far] * 1e3:.0f} mm from the TCP, "
            f"where at most {within * 1e3:.0f} mm are expected: check the joints of rows in rare orientations, and the tool in the "
            "robot file; if the target really is so far out, allow it (target_within, --target-within-mm)"
        )


def most_wrong_rows(rows: int) -> int:
    """Largest number of rows of so many that may be wrong."""
    return max(1, round(MAX_WRONG_SHARE * rows))


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
