"""Drift of base or tracker, followed by reference points that were measured beside each pose."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from scipy.linalg import cho_solve_banded, cholesky_banded

from taskcal.campaigns.campaign import Campaign, Stations
from taskcal.errors import listed
from taskcal.geometry import se3
from taskcal.observations.base import TrackerNoise
from taskcal.short_repr import short_repr
from taskcal_groundwork.said import Said

# How the reference points beside a robot moved together from row to row.

COLLINEAR_RATIO = 0.05
"""Second extent of the points over their first under which they are taken for a line, about which nothing is seen to turn."""

MISPLACED_SIGMAS = 10.0
"""Standard deviations by which the distance of two points may differ from the usual one before one of them is taken for lost."""

MIN_DISTANCE_NOISE = 1e-6
"""Smallest standard deviation of that distance, metres."""

MAX_ROUNDS = 20
"""Of reference points placed by the motions and motions by the reference points."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ReferenceMotion:
    """The reference points' common motion in every row, as far as each row tells."""

    centre: Float[np.ndarray, " 3"]
    """Centre of the reference points in their common frame, metres."""
    axes: Float[np.ndarray, "3 3"]
    """Their principal axes, columns."""
    values: Float[np.ndarray, "n components"]
    """Translation of the centre along the axes, metres, and, where three reference points tell it, rotation about them, radians."""
    per_noise: Float[np.ndarray, "n components"]
    """Variance of each value for noise of unit variance."""
    noise: float | None
    """Standard deviation of a reference point's coordinate, by what no common motion explains, metres; None for a single one."""
    freedom: int
    """Degrees of freedom of that estimate."""
    lost: Bool[np.ndarray, "n points"]
    """Reference points that stood out of place."""

    @property
    def rigid(self) -> bool:
        """Whether rotations are seen."""
        return self.values.shape[1] == 6


def observe_reference_points(reference_points: Mapping[str, Float[np.ndarray, "_ 3"]]) -> ReferenceMotion:
    """Find the common motion of reference points.

    Each row's motion is the rigid one that carries the points' usual places nearest to the seen ones (Kabsch 1976), and the usual
    places are those that all rows agree on best; of fewer than three points, or points on a line, the mean movement.

    Args:
        reference_points: the places of each, row by row, metres; NaN where it was not seen. One at least.
    """
    seen = np.stack(list(reference_points.values()), axis=1)
    lost = _misplaced_references(seen)
    seen = np.where(lost[..., None], np.nan, seen)
    there = ~np.isnan(seen[..., 0])
    usual = np.nanmean(seen, axis=0)
    extent = np.linalg.svd(usual - usual.mean(axis=0), compute_uv=False)
    if seen.shape[1] < 3 or extent[1] < COLLINEAR_RATIO * extent[0]:
        return _shift(seen, there, usual, lost)
    R, place = np.broadcast_to(np.eye(3), (len(seen), 3, 3)), np.zeros((len(seen), 3))
    for _ in range(MAX_ROUNDS):
        R, place = _rigid(seen, there, usual)
        usual = np.nanmean(np.einsum("kji,knj->kni", R, seen - place[:, None]), axis=0)
    centre = usual.mean(axis=0)
    axes = np.linalg.svd(usual - centre)[2].T
    resolved = _not_on_a_line(there, usual)
    residual = np.where(
        (there & resolved[:, None])[..., None], seen - place[:, None] - usual @ np.swapaxes(R, 1, 2), 0.0
    )
    freedom = int(3 * there[resolved].sum() - 6 * resolved.sum() - (3 * len(usual) - 6))
    arm = ((usual - centre) @ axes) ** 2
    lever = there @ (arm.sum(axis=1)[:, None] - arm)
    values = np.concatenate([(se3.apply(se3.pose(R, place), centre) - centre) @ axes, se3.log(R) @ axes], 1)
    values[~resolved] = np.nan
    shares = np.concatenate([np.repeat(there.sum(axis=1)[:, None], 3, axis=1), lever], axis=1)
    return ReferenceMotion(
        centre=centre,
        axes=axes,
        values=values,
        per_noise=1.0 / np.maximum(shares, 1e-12),
        noise=float(np.sqrt((residual**2).sum() / max(freedom, 1))),
        freedom=freedom,
        lost=lost,
    )


def _rigid(
    seen: Float[np.ndarray, "n points 3"], there: Bool[np.ndarray, "n points"], usual: Float[np.ndarray, "points 3"]
) -> tuple[Float[np.ndarray, "n 3 3"], Float[np.ndarray, "n 3"]]:
    """Rotation and translation from the usual places to the seen ones, row by row."""
    count = np.maximum(there.sum(axis=1), 1)[:, None]
    here = np.where(there[..., None], seen, 0.0)
    middle, usually = here.sum(axis=1) / count, there @ usual / count
    moment = np.einsum("kni,knj->kij", here - there[..., None] * middle[:, None], usual - usually[:, None])
    R = se3.nearest_rotation(moment)
    return R, middle - np.einsum("kij,kj->ki", R, usually)


def _shift(
    seen: Float[np.ndarray, "n points 3"],
    there: Bool[np.ndarray, "n points"],
    usual: Float[np.ndarray, "points 3"],
    lost: Bool[np.ndarray, "n points"],
) -> ReferenceMotion:
    """Translations alone."""
    count, number = there.sum(axis=1)[:, None], seen.shape[1]
    moved = np.zeros((len(seen), 3))
    for _ in range(MAX_ROUNDS):
        moved = np.where(there[..., None], seen - usual, 0.0).sum(axis=1) / np.maximum(count, 1)
        usual = np.nanmean(seen - moved[:, None], axis=0)
    freedom = int(3 * (there.sum() - (count > 0).sum() - number + 1))
    residual = np.where(there[..., None], seen - usual - moved[:, None], 0.0)
    return ReferenceMotion(
        centre=usual.mean(axis=0),
        axes=np.eye(3),
        values=np.where(count > 0, moved, np.nan),
        per_noise=np.repeat(1.0 / np.maximum(count, 1), 3, axis=1),
        noise=None if number == 1 else float(np.sqrt((residual**2).sum() / max(freedom, 1))),
        freedom=freedom,
        lost=lost,
    )


def _misplaced_references(seen: Float[np.ndarray, "n points 3"]) -> Bool[np.ndarray, "n points"]:
    """Reference points whose distances from all others that were seen are unusual: a beam that met another reflector."""
    distance = np.linalg.norm(seen[:, :, None] - seen[:, None], axis=3)
    off = np.abs(distance - np.nanmedian(distance, axis=0))
    deviation = np.maximum(1.4826 * np.nanmedian(off, axis=0), MIN_DISTANCE_NOISE)
    other = ~np.isnan(distance) & ~np.eye(seen.shape[1], dtype=bool)
    return other.any(axis=2) & ((off > MISPLACED_SIGMAS * deviation) | ~other).all(axis=2)


def _not_on_a_line(there: Bool[np.ndarray, "n points"], usual: Float[np.ndarray, "points 3"]) -> Bool[np.ndarray, " n"]:
    """Rows whose reference points tell a rotation."""
    out = np.zeros(len(there), dtype=bool)
    for kind in np.unique(there, axis=0):
        some = usual[kind]
        extent = np.linalg.svd(some - some.mean(axis=0), compute_uv=False) if kind.sum() > 2 else np.zeros(2)
        out[(there == kind).all(axis=1)] = kind.sum() > 2 and extent[1] >= COLLINEAR_RATIO * extent[0]
    return out


# A local level seen through noise: a random walk and white noise of its own, each of the most probable size, and
# their sum.
#
# y = w + t + e: w a random walk with steps of variance a², t white with variance b², e noise of known variances.
# This is the local level model (Durbin and Koopman 2012, chapter 2) beside a second white part that belongs to what
# is sought. The walk's posterior precision is tridiagonal, so that everything costs a few operations a row.

MIN_SHARE_OF_NOISE = 1e-3
"""Smallest standard deviations that are distinguished from zero, as shares of the noise's."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LocalLevel:
    """The most probable course of a quantity."""

    mean: Float[np.ndarray, " n"]
    """w + t."""
    variance: Float[np.ndarray, " n"]
    """Its posterior variance."""
    step: float
    """Standard deviation of the walk's steps."""
    white: float
    """Standard deviation of the white part."""


def smooth(seen: Float[np.ndarray, " n"], noise: Float[np.ndarray, " n"], *, own_noise: bool = True) -> LocalLevel:
    """Estimate the quantity at every row, with the step and the white noise of the largest marginal likelihood.

    Args:
        seen: what was seen at rows of equal distance; NaN where nothing was.
        noise: variance of its noise.
        own_noise: whether the quantity has white noise of its own; else all that is white belongs to `noise`.
    """
    observed = ~np.isnan(seen)
    size = float(np.sqrt(np.median(noise[observed])))
    largest = max(10.0 * float(np.ptp(seen[observed])), 10.0 * size)
    bounds = [(np.log(MIN_SHARE_OF_NOISE * size), np.log(largest))] * (2 if own_noise else 1)

    def cost(log_sizes: Float[np.ndarray, " k"]) -> float:
        return _Walk.of(seen, noise, *_variances(log_sizes)).cost

    from scipy.optimize import minimize

    starts = [np.log(np.full(len(bounds), size * share)) for share in (0.1, 2.0)]
    trials: list[Any] = [minimize(cost, start, method="Nelder-Mead", bounds=bounds) for start in starts]
    best = min(trials, key=lambda trial: trial.fun).x
    steps, white = _variances(best)
    walk = _Walk.of(seen, noise, steps, white)
    gain = np.where(observed, white / (white + noise), 0.0)
    across = np.where(observed, gain * noise, white)
    return LocalLevel(
        mean=walk.mean + gain * np.where(observed, seen - walk.mean, 0.0),
        variance=(1.0 - gain) ** 2 * walk.variance() + across,
        step=float(np.sqrt(steps)),
        white=float(np.sqrt(white)),
    )


def _variances(log_sizes: Float[np.ndarray, " k"]) -> tuple[float, float]:
    """Variances of step and white noise."""
    a, b = float(log_sizes[0]), float(log_sizes[1]) if len(log_sizes) > 1 else -np.inf
    return float(np.exp(2.0 * a)), float(np.exp(2.0 * b))


@dataclass(frozen=True, eq=False, kw_only=True)
class _Walk:
    """The walk's posterior, of precision DᵀD/a² + V⁻¹ with D the differences of neighbours and V = b² + noise."""

    mean: Float[np.ndarray, " n"]
    factor: Float[np.ndarray, "2 n"]
    """Cholesky factor of the precision: its diagonal, and the elements below."""
    cost: float
    """−2 log likelihood of the two variances, but for a constant."""

    @classmethod
    def of(cls, seen: Float[np.ndarray, " n"], noise: Float[np.ndarray, " n"], step: float, white: float) -> "_Walk":
        observed, n = ~np.isnan(seen), len(seen)
        weight = np.where(observed, 1.0 / (white + noise), 0.0)
        precision = np.zeros((2, n))
        precision[0] = weight + np.r_[1.0, np.full(n - 2, 2.0), 1.0] / step
        precision[1, :-1] = -1.0 / step
        factor = np.asarray(cholesky_banded(precision, lower=True))
        information = np.where(observed, weight * np.nan_to_num(seen), 0.0)
        mean = np.asarray(cho_solve_banded((factor, True), information))
        misfit = float(information @ (np.nan_to_num(seen) - mean))
        determinants = 2.0 * np.log(factor[0]).sum() + (n - 1) * np.log(step) - np.log(weight[observed]).sum()
        return cls(mean=mean, factor=factor, cost=misfit + float(determinants))

    def variance(self) -> Float[np.ndarray, " n"]:
        """Diagonal of the inverse precision, from the last row back (Takahashi et al. 1973)."""
        diagonal, below = self.factor
        out = diagonal**-2.0
        for k in range(len(out) - 2, -1, -1):
            out[k] += (below[k] / diagonal[k]) ** 2 * out[k + 1]
        return out


SIGNIFICANCE = 0.01
"""Chance of following reference points that stand still."""

MAX_NOISE_M = 5e-3
"""Scatter of a point that stands still, metres: a base yields by less from row to row, and no instrument has as much noise."""

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
    if campaign.stations is not None and len(campaign.stations.names) > 1:
        return _by_station(campaign, campaign.stations, noise)
    motion = observe_reference_points(campaign.reference_points)
    observed = ~np.isnan(motion.values[:, 0])
    if observed.sum() < MIN_DRIFT_ROWS:
        remark = Said(
            "the reference points tell their motion in {count} rows, too few to follow it; it takes {least}",
            count=int(observed.sum()),
            least=MIN_DRIFT_ROWS,
        )
        return Drift(campaign=campaign, followed=False, largest=0.0, noise=0.0, probability=1.0, remarks=(remark,))
    deviation, probability = _proof(motion, observed)
    remarks = _misplaced(campaign, motion)
    if probability > SIGNIFICANCE:
        remarks += (
            Said(
                "the reference points ({names}) scatter by {scatter:.1f} mm, as none does that stands still, and were not "
                "followed: name a target on the tool otherwise than base…, or choose the points (--reference-points), and look for "
                "rows in which another one was measured"
                if deviation > MAX_NOISE_M
                else "the reference points moved no more than their noise ({noise:.4f} mm) and were not followed",
                names=", ".join(campaign.reference_points),
                scatter=deviation * 1e3,
                noise=deviation * 1e3,
            ),
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
        Said(
            "the reference points moved by up to {largest:.3f} mm (their noise: {noise:.4f} mm) and were compensated: the "
            "calibration holds in the frame of their mean places",
            largest=largest * 1e3,
            noise=deviation * 1e3,
        ),
    )
    if not motion.rigid:
        why = Said("reference points on a line")
        if len(campaign.reference_points) < 3:
            why = Said("fewer than three reference points")
        remarks += (Said("{why}: their translation was followed, not their rotation", why=why),)
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


def _by_station(campaign: Campaign, stations: Stations, noise: TrackerNoise | None) -> Drift:
    """Every station's rows in the frame of its own reference points; those that it never saw are none of its own."""
    points, rotations = campaign.points.copy(), None if campaign.rotations is None else campaign.rotations.copy()
    stated = np.sqrt(np.trace(campaign.covariances(noise)[..., :3, :3], axis1=2, axis2=3) / 3.0)
    found: list[Drift] = []
    remarks: list[str] = []
    moved = {name: seen.copy() for name, seen in campaign.reference_points.items()}
    for k, name in enumerate(stations.names):
        rows = stations.of == k
        part = replace(campaign.take(rows), stations=None)
        own = {one: seen for one, seen in part.reference_points.items() if not np.isnan(seen).all()}
        one = compensate_drift(replace(part, reference_points=own, uncertainty=stated[rows]), noise)
        found.append(one)
        remarks += [Said("station {name}: {remark}", name=name, remark=remark) for remark in one.remarks]
        points[rows], stated[rows] = one.campaign.points, np.asarray(one.campaign.uncertainty)
        if rotations is not None:
            rotations[rows] = np.asarray(one.campaign.rotations)
        for reference, seen in one.campaign.reference_points.items():
            moved[reference][rows] = seen
    if not any(one.followed for one in found):
        return replace(found[0], campaign=campaign, remarks=tuple(remarks))
    return Drift(
        campaign=replace(campaign, points=points, rotations=rotations, uncertainty=stated, reference_points=moved),
        followed=True,
        largest=max(one.largest for one in found),
        noise=max(one.noise for one in found),
        probability=min(one.probability for one in found),
        remarks=tuple(remarks),
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
            named = listed((campaign.ids[i] for i in rows), MAX_NAMED_ROWS)
            out.append(
                Said(
                    "reference point {name} does not fit the others in {count} rows (id {named}): rejected there",
                    name=name,
                    count=len(rows),
                    named=named,
                )
            )
    return tuple(out)


def _transforms(motion: ReferenceMotion, courses: list[LocalLevel]) -> Float[np.ndarray, "n 4 4"]:
    """Transform from the common frame to the reference points in each row: a rotation about their centre, and a translation."""
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
