"""Which rows of a campaign agree with each other on where tracker and targets are, seen by the nominal robot.

Least trimmed squares (Rousseeuw 1984) with concentration steps (Rousseeuw and Van Driessen 2006): the registration that
leaves the smallest sum of squares on the best three quarters of the rows. What the other rows say is then judged by it.
"""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import CampaignError
from taskcal.estimation.blas import single_threaded
from taskcal.geometry import se3
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.enough_rows import named_file
from taskcal.measurement.registration import Registration, register_cloud, register_observations, serves
from taskcal.measurement.registration_cloud import Cloud
from taskcal.robot.error_model import ErrorModel

TRUSTED_SHARE = 0.75
"""Of the rows, that the trimmed sum counts."""

SUBSETS = 24
"""Subsets from which the search starts where the whole campaign does not agree: with a tenth of the rows wrong, eight rows are
all right with a chance of 0.43, and not once in 24 times with one of 10⁻⁶."""

SUBSET_ROWS = 8

MANY, SOME = 3000, 1000
"""Rows from which on the subsets are drawn of so many of them, as of a large sample (Rousseeuw and Van Driessen 2006)."""

FAR_SIGMAS = 10.0
"""Times the median distance: on measured robots the nominal geometry leaves at most 8.4 times the median."""

TRACKER_NOISE = 1e-4
"""Metres; nearer than that no row is far, however well the others agree."""

MAX_STEPS, MANY_STEPS = 10, 2
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
    seen, cloud = np.flatnonzero(campaign.seen), Cloud.of(poses, campaign)
    best: Consensus | None = None
    if len(seen) <= MANY:
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
    if len(seen) > MANY:
        some = np.sort(rng.choice(seen, size=SOME, replace=False))
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
    for _ in range(MAX_STEPS if len(rows) <= MANY else MANY_STEPS):
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


def _distances(registration: Registration, cloud: Cloud, rows: int, model: ErrorModel) -> Float[np.ndarray, " n"]:
    """How far the farthest target of every row is off, metres; a measured pose's rotation counts at the robot's reach."""
    T, targets = registration.T_tracker_base, registration.T_tool_target
    residual = cloud.residual(T[:3, :3], T[:3, 3], targets[:, :3, 3])
    square = np.einsum("ni,ni->n", residual, residual)
    if cloud.Y is not None:
        turned = se3.log(cloud.Y @ np.swapaxes(T[:3, :3] @ cloud.R @ targets[0, :3, :3], 1, 2))
        square += np.sum((model.robot.reach * turned) ** 2, axis=1)
    farthest = np.zeros((rows, cloud.count))
    farthest[cloud.row, cloud.target] = square
    return np.sqrt(farthest.max(axis=1))
