"""Drift of base or tracker, followed by reference points that were measured beside each pose."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from taskcal.estimation.local_level import LocalLevel, smooth
from taskcal.geometry import se3
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.reference_motion import ReferenceMotion, observe_reference_points
from taskcal.measurement.tracker import TrackerNoise
from taskcal.short_repr import short_repr

SIGNIFICANCE = 0.01
"""Chance of following reference points that stand still."""

MIN_DRIFT_ROWS = 5
"""Rows that have to tell a motion."""

MAX_NAMED_ROWS = 6
"""Rows of misplaced reference points that are named."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Drift:
    """A campaign with its reference points followed, as far as they moved."""

    campaign: Campaign
    """The measurements as they would be had the reference points stood still in the middle of their places."""
    followed: bool
    """Whether the reference points moved by more than their noise, and were followed."""
    largest: float
    """Largest movement of a reference point, smoothed, metres; zero where nothing was followed."""
    noise: float
    """Standard deviation of a reference point's coordinate, metres."""
    probability: float
    """Of reference points that stand still to seem to move as much."""
    remarks: tuple[str, ...]
    """What was done, in words."""


def compensate_drift(campaign: Campaign, noise: TrackerNoise | None = None) -> Drift:
    """Carry every row's measurements into the common frame of the reference points.

    The reference points' rigid motion in each row is compared with their own noise, which shows in the distances between
    them. If it is larger than chance allows (F test), it is taken for a random walk over the order of the rows and a white
    part, such as a base that yields under the arm; both have the sizes of the largest marginal likelihood, so that only as much of
    the reference points' noise gets into the points as follows the motion best. Of fewer than three of them the mean translation is
    followed; of a single one, whose noise shows only from row to row, the random walk.

    Args:
        campaign: the measurements; its rows are taken for equally distant in time.
        noise: the tracker's, where the campaign does not state uncertainties.

    Returns:
        the campaign in the frame of the reference points, each point's standard uncertainty enlarged by that of the motion and
        stated, equal in all directions; or the campaign as it was, where the reference points did not move, tell it in too few
        rows, or there are none.
    """
    if not campaign.reference_points:
        return Drift(campaign=campaign, followed=False, largest=0.0, noise=0.0, probability=1.0, remarks=())
    motion = observe_reference_points(campaign.reference_points)
    observed = ~np.isnan(motion.values[:, 0])
    if observed.sum() < MIN_DRIFT_ROWS:
        remark = f"the reference points tell their motion in {observed.sum()} rows, too few to follow it; it takes {MIN_DRIFT_ROWS}"
        return Drift(campaign=campaign, followed=False, largest=0.0, noise=0.0, probability=1.0, remarks=(remark,))
    deviation, probability = _proof(motion, observed)
    remarks = _misplaced(campaign, motion)
    if probability > SIGNIFICANCE:
        remarks += (
            f"the reference points moved no more than their noise ({deviation * 1e3:.4f} mm) and were not followed",
        )
        return Drift(
            campaign=campaign, followed=False, largest=0.0, noise=deviation, probability=probability, remarks=remarks
        )
    variance = deviation**2 * motion.per_noise
    courses = [
        smooth(values, noise_variance, own_noise=motion.noise is not None)
        for values, noise_variance in zip(motion.values.T, variance.T, strict=True)
    ]
    T = _transforms(motion, courses)
    moved = {name: _back(T, points[:, None])[:, 0] for name, points in campaign.reference_points.items()}
    centred = np.stack([np.nanmedian(points, axis=0) for points in moved.values()])
    largest = float(np.linalg.norm(se3.apply(T[:, None], centred[None]) - centred, axis=2).max())
    remarks += (
        f"the reference points moved by up to {largest * 1e3:.3f} mm (their noise: {deviation * 1e3:.4f} mm) and were followed: "
        "the calibration holds in the frame of their mean places",
    )
    if not motion.rigid:
        why = (
            "fewer than three reference points" if len(campaign.reference_points) < 3 else "reference points on a line"
        )
        remarks += (f"{why}: their translation was followed, not their rotation",)
    followed = replace(
        campaign,
        points=_back(T, campaign.points),
        rotations=None if campaign.rotations is None else np.swapaxes(T[:, :3, :3], 1, 2) @ campaign.rotations,
        uncertainty=_uncertainty(campaign, motion, courses, noise),
        reference_points=moved,
    )
    return Drift(
        campaign=followed, followed=True, largest=largest, noise=deviation, probability=probability, remarks=remarks
    )


def _proof(motion: ReferenceMotion, observed: np.ndarray) -> tuple[float, float]:
    """Standard deviation of a reference point's coordinate, and the chance that still reference points seem to move as much."""
    values, per_noise = motion.values[observed], motion.per_noise[observed]
    centred = values - np.average(values, axis=0)
    moved, count = float((centred**2 / per_noise).sum()), centred.size - centred.shape[1]
    if motion.noise is None:
        # what a single reference point does from row to row is its noise (von Neumann 1941); neighbours share rows, hence 2/3
        steps = np.diff(values, axis=0)
        variance, freedom = float(0.5 * (steps**2).mean()), 2.0 / 3.0 * steps.size
    else:
        variance, freedom = motion.noise**2, motion.freedom
    from scipy.special import fdtrc

    variance = max(variance, 1e-24)
    return float(np.sqrt(variance)), float(fdtrc(count, max(freedom, 1), moved / count / variance))


def _misplaced(campaign: Campaign, motion: ReferenceMotion) -> tuple[str, ...]:
    """Reference points out of place, in words."""
    out: list[str] = []
    for name, lost in zip(campaign.reference_points, motion.lost.T, strict=True):
        rows = np.flatnonzero(lost)
        if len(rows):
            named = ", ".join(campaign.ids[i] for i in rows[:MAX_NAMED_ROWS]) + (
                ", …" if len(rows) > MAX_NAMED_ROWS else ""
            )
            out.append(
                f"reference point {name} does not fit the others in {len(rows)} rows (id {named}): taken for lost there"
            )
    return tuple(out)


def _transforms(motion: ReferenceMotion, courses: list[LocalLevel]) -> Float[np.ndarray, "n 4 4"]:
    """From the common frame to the reference points in each row: a turn about their centre, and its translation."""
    values = np.stack([course.mean for course in courses], axis=1)
    shift = values[:, :3] @ motion.axes.T
    R = se3.exp(values[:, 3:] @ motion.axes.T) if motion.rigid else np.broadcast_to(np.eye(3), (len(values), 3, 3))
    return se3.pose(R, motion.centre + shift - R @ motion.centre)


def _back(T: Float[np.ndarray, "n 4 4"], points: Float[np.ndarray, "n k 3"]) -> Float[np.ndarray, "n k 3"]:
    """Points carried into the common frame."""
    return se3.apply(se3.inverse(T)[:, None], points)


def _uncertainty(
    campaign: Campaign, motion: ReferenceMotion, courses: list[LocalLevel], noise: TrackerNoise | None
) -> Float[np.ndarray, "n targets"]:
    """Standard uncertainty of every point, that of the motion at its place included, as the mean of the directions."""
    own = np.trace(campaign.covariances(noise)[..., :3, :3], axis1=2, axis2=3)
    variance = np.stack([course.variance for course in courses], axis=1)
    added = variance[:, None, :3].sum(axis=2)
    if motion.rigid:
        lever = ((campaign.points - motion.centre) @ motion.axes) ** 2
        across = np.nan_to_num(lever.sum(axis=2, keepdims=True) - lever)
        added = added + np.einsum("ntc,nc->nt", across, variance[:, 3:])
    return np.sqrt((own + added) / 3.0)
