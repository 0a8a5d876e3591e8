"""Which rows of a campaign agree with each other on where tracker and targets are, seen by the nominal robot.

Least trimmed squares (Rousseeuw 1984) with concentration steps (Rousseeuw and Van Driessen 2006): the registration that
leaves the smallest sum of squares on the best three quarters of the rows. What the other rows say is then judged by it.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import CampaignError
from taskcal.estimation.blas import single_threaded
from taskcal.geometry import se3
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.enough_rows import named_file
from taskcal.measurement.registration import Registration, register_closely, register_observations
from taskcal.robot.error_model import ErrorModel

TRUSTED_SHARE = 0.75
"""Of the rows, that the trimmed sum counts."""

SUBSETS = 24
"""Subsets from which the search starts where the whole campaign does not agree: with a tenth of the rows wrong, eight rows are
all right with a chance of 0.43, and not once in 24 times with one of 10⁻⁶."""

SUBSET_ROWS = 8

FAR_SIGMAS = 10.0
"""Times the median distance: on measured robots the nominal geometry leaves at most 8.4 times the median."""

TRACKER_NOISE = 1e-4
"""Metres; nearer than that no row is far, however well the others agree."""

MAX_STEPS = 10
"""Concentration steps; each lowers the trimmed sum."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Consensus:
    """Rows that agree, and the registration that they give."""

    rows: Bool[np.ndarray, " n"]
    """Those seen that agree; all of them where more than a quarter would not."""
    registration: Registration
    """Of the best three quarters of the rows."""
    distance: Float[np.ndarray, " n"]
    """How far each row is from where the registered nominal robot has it, metres; zero where nothing was seen."""

    @property
    def trimmed(self) -> float:
        """Sum of squares of the trusted rows, m²."""
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
    seen = np.flatnonzero(campaign.seen)
    best = _settle(model, campaign, poses, seen, seen)
    if best is None or not best.rows[seen].all():
        rng = np.random.default_rng(seed)
        for _ in range(SUBSETS):
            start = np.sort(rng.choice(seen, size=min(SUBSET_ROWS, len(seen)), replace=False))
            trial = _settle(model, campaign, poses, seen, start)
            if trial is not None and (best is None or trial.trimmed < best.trimmed * (1.0 - 1e-9)):
                best = trial
    if best is None:
        raise CampaignError(f"{named_file(campaign)}no subset of the rows determines tracker frame and targets")
    return best


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
        rows=near if near.sum() >= TRUSTED_SHARE * rows.sum() else rows, registration=registration, distance=distance
    )


def _settle(
    model: ErrorModel, campaign: Campaign, poses: np.ndarray, seen: Int[np.ndarray, " s"], rows: Int[np.ndarray, " k"]
) -> Consensus | None:
    """Register on some rows, then on those that agree best, until these stay the same; None where that cannot be done."""
    count = int(np.ceil(TRUSTED_SHARE * len(seen)))
    reached: Consensus | None = None
    Z: np.ndarray | None = None
    for _ in range(MAX_STEPS):
        try:
            registration = register_closely(campaign.take(rows), poses[rows], Z)
        except CampaignError:
            return reached
        Z = registration.T_tracker_base[:3, :3]
        distance = _distances(registration, campaign, poses, model.robot.reach)
        agreed = campaign.seen
        near = distance <= max(FAR_SIGMAS * float(np.median(distance[seen])), TRACKER_NOISE)
        if near[seen].mean() >= TRUSTED_SHARE:
            agreed = np.asarray(agreed & near)
        reached = Consensus(rows=agreed, registration=registration, distance=distance)
        following = np.sort(seen[np.argsort(distance[seen], kind="stable")[:count]])
        if np.array_equal(following, rows):
            break
        rows = following
    return reached


def _distances(
    registration: Registration, campaign: Campaign, poses: Float[np.ndarray, "n 4 4"], lever: float
) -> Float[np.ndarray, " n"]:
    """How far the farthest target of every row is off, metres; a measured pose's rotation counts at the end of a lever."""
    ends = (registration.T_tracker_base @ poses)[:, None] @ registration.T_tool_target
    square = np.sum((campaign.points - ends[..., :3, 3]) ** 2, axis=2)
    if campaign.rotations is not None:
        seen = campaign.valid[:, 0]
        turned = se3.log(campaign.rotations[seen] @ np.swapaxes(ends[seen, 0, :3, :3], 1, 2))
        square[seen, 0] += np.sum((lever * turned) ** 2, axis=1)
    return np.sqrt(np.where(campaign.valid, square, 0.0).max(axis=1))
