"""Registration: tracker frame and targets from raw measurements and the nominal robot alone."""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.arguments import checked
from taskcal.campaigns.campaign import Campaign, check_rows, named_file
from taskcal.errors import CampaignError, ClosureError
from taskcal.estimation.matrices import single_threaded
from taskcal.geometry import se3
from taskcal.geometry.point_registration import (
    Moments,
    alternate,
    closed_form,
    closed_form_rotations,
    offset_information,
    orientations,
    products,
    refine,
    rms_length,
    target_rotation,
)
from taskcal.geometry.se3 import RIGID
from taskcal.io.codec import LACKS, NOT_IN_FILE
from taskcal.io.toml_file import NotNegative
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr

# Measured points beside the tool poses at which they were measured: what a registration is found from.


@dataclass(frozen=True, eq=False, kw_only=True)
class Cloud:
    """Every target that was seen at a row is a point."""

    R: Float[np.ndarray, "n 3 3"]
    """Rotation of the tool."""
    p: Float[np.ndarray, "n 3"]
    """Position of the tool, metres."""
    y: Float[np.ndarray, "n 3"]
    """The point as measured, metres."""
    target: Int[np.ndarray, " n"]
    """Number of its target."""
    row: Int[np.ndarray, " n"]
    """Row of the campaign."""
    count: int
    """Of targets."""
    Y: Float[np.ndarray, "n 3 3"] | None = None
    """Measured rotations, for poses."""

    @classmethod
    def of(cls, T: Float[np.ndarray, "rows 4 4"], campaign: Campaign) -> "Cloud":
        """All that was seen, with poses T of the tool in the base."""
        row, target = np.nonzero(campaign.valid)
        at = T if len(row) == len(T) and campaign.valid.shape[1] == 1 else T[row]
        return cls(
            R=np.ascontiguousarray(at[:, :3, :3]),
            p=np.ascontiguousarray(at[:, :3, 3]),
            y=campaign.points[row, target],
            target=target,
            row=row,
            count=len(campaign.targets),
            Y=None if campaign.rotations is None else campaign.rotations[row],
        )

    def take(self, points: Bool[np.ndarray, " n"]) -> "Cloud":
        """Some of the points."""
        if points.all():
            return self
        return Cloud(
            R=self.R[points],
            p=self.p[points],
            y=self.y[points],
            target=self.target[points],
            row=self.row[points],
            count=self.count,
            Y=None if self.Y is None else self.Y[points],
        )

    @property
    def shows_all(self) -> bool:
        """Whether every target was seen."""
        return bool(np.bincount(self.target, minlength=self.count).all())

    @cached_property
    def moments(self) -> Moments:
        """Sums that say all of how a tracker frame and targets fit."""
        return Moments.of(self.R, self.p, self.y, self.target, self.count)

    @property
    def extent(self) -> float:
        """Root mean square distance of the measured points from their middle, metres."""
        return float(np.sqrt(np.trace(self.moments.yy) / len(self.y)))

    def residual(
        self, Z: Float[np.ndarray, "3 3"], t: Float[np.ndarray, " 3"], offsets: Float[np.ndarray, "targets 3"]
    ) -> Float[np.ndarray, "n 3"]:
        """Residual of the points for a tracker frame and targets: y − Z·(p + R·o) − t, metres."""
        local = self.R @ offsets[0] if self.count == 1 else (self.R @ offsets[self.target][:, :, None])[:, :, 0]
        return self.y - (self.p + local) @ Z.T - t


Method = Literal["poses", "circles"]

PLAUSIBLE_SHARE = 0.02
"""Nominal residual over the reach, beyond which joints and points do not belong together. A convention: 40 mm of a reach of 2 m."""

STRAIGHT_SHARE = 1e-3
"""Extent across one line over the reach, below which points lie along it. A convention: 2 mm of a reach of 2 m."""

SMALL_SHARE = 0.05
"""Residual over the extent of the points, beyond which the best rotation is sought from many. A convention: where a robot's
errors are a twentieth of what it moved, the closed form may end half a turn away."""

LOCATED_WITHIN = 0.02
"""Standard deviation, metres, below which a direction of the target offsets counts as determined. Decision 0005: poses spread by
a few degrees tell an offset to millimetres, poses of one orientation not at all."""

MINORITY_SHARE = 0.1
"""Share of the points, at most, that may be wrong: what so few alone say of a target is not believed. A convention, as
`plausibility.MAX_WRONG_SHARE`."""

TRUSTED_SHARE = 0.75
"""Share of the rows that a trimmed registration follows. A convention between the share of wrong rows that is borne and the use of
right ones."""

MAX_STEPS = 10
"""Concentration steps, at most: each lowers the trimmed sum, and a few are enough as a rule."""

FAR_MEDIANS = 10.0
"""Times the median distance from where the registered nominal robot has the rows, from which on one is far: on measured robots its
geometry leaves at most 8.4 times the median."""

MIN_GAIN = 0.1
"""Share by which a step has to lower the trimmed distance for another one. A convention: it is a start, to be refined."""

SUBSETS, SUBSET_ROWS = 24, 8
"""Subsets from which a trimmed registration starts where all rows together lead nowhere: with a tenth of the rows wrong, eight rows
are all right with a chance of 0.43, and not once in 24 times with one of 10⁻⁶."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Registration:
    """The tracker's frame and the targets, as found."""

    method: Annotated[Method, LACKS] = "poses"
    """Found from all ``poses``, or from the ``circles`` of axes that turned alone."""
    file: Annotated[str, LACKS] = ""
    """The file it was read from, if it was."""
    T_tracker_base: Annotated[Float[np.ndarray, "4 4"], RIGID]
    """Pose of the robot's base in the tracker frame."""
    T_tool_target: Annotated[Float[np.ndarray, "targets 4 4"], RIGID]
    """Pose of every target in the tool frame; its rotation is the identity where only points were measured."""
    rms: NotNegative
    """Root mean square of the nominal robot's residual in space, metres."""
    unobservable: Float[np.ndarray, "3*targets 3*targets"]
    """Projector onto the directions of all target offsets together, in the tool frame, that the poses do not determine:
    zero in general; in one orientation a common shift of all targets. Along them the targets stay at the TCP."""
    unknowns: Annotated[tuple[Float[np.ndarray, " _"], ...], NOT_IN_FILE] = ()
    """What else each target's observation does not know: sockets, anchors …; empty where a tracker measured."""

    @property
    def located(self) -> tuple[bool, ...]:
        """Whether the poses determine where each target sits."""
        share = np.diag(self.unobservable).reshape(-1, 3).max(axis=1)
        return tuple(bool(s < 1e-6) for s in share)


@checked
@single_threaded
def register(model: ErrorModel, campaign: Campaign, poses: Float[np.ndarray, "n 4 4"] | None = None) -> Registration:
    """Find the tracker frame and every target in closed form, then by a search from many orientations if that fails.

    The closed form solves M·y + m = p + R·o for an unconstrained matrix M, a vector m and the offsets o, which is linear
    in all three, and projects M onto a rotation. For poses the rotations come first, from Z·R = Y·Xᵀ (Shah 2013); where
    they turn about one direction only, or not at all, the positions say the rest.

    Args:
        model: the robot's model.
        campaign: the measurements.
        poses: of the tool in the base at every row; the nominal robot's by default.

    Raises:
        CampaignError: too few rows, or rows that do not determine the frames.
    """
    check_rows(campaign)
    T = nominal_poses(model, campaign) if poses is None else poses
    return register_observations(T, campaign, model)[0]


def register_observations(
    T: Float[np.ndarray, "n 4 4"], campaign: Campaign, model: ErrorModel
) -> tuple[Registration, Float[np.ndarray, " n"]]:
    """Register a tracker's targets first, as without others; then every other target, in the tracker's frame or the base.

    Args:
        T: poses of the tool in the base.
        campaign: the measurements.
        model: the robot's model.

    Returns:
        the registration, and how far each row is off it, metres; zero where nothing was seen.

    Raises:
        CampaignError: rows that do not determine a target.
    """
    tracked = [t for t, one in enumerate(campaign.observations) if one.in_tracker]
    if len(tracked) == len(campaign.targets):
        by_tracker = _register_points if campaign.rotations is None else _register_poses
        first = by_tracker(T, campaign, model.robot.reach)
        return first, np.nan_to_num(distances(first, campaign, T)).max(axis=1)
    base, place, off = np.eye(4), np.tile(np.eye(4), (len(campaign.targets), 1, 1)), np.zeros(campaign.valid.shape)
    hidden = np.zeros((3 * len(campaign.targets), 3 * len(campaign.targets)))
    if tracked:
        seen = campaign.of_targets([campaign.targets[t] for t in tracked])
        first = register(model, seen, T)
        base, place[tracked] = first.T_tracker_base, first.T_tool_target
        off[:, tracked] = np.nan_to_num(distances(first, seen, T))
        at = np.concatenate([3 * t + np.arange(3) for t in tracked])
        hidden[np.ix_(at, at)] = first.unobservable
    unknowns = [np.zeros(len(one.unknowns)) for one in campaign.observations]
    for t, one in enumerate(campaign.observations):
        if not one.in_tracker:
            placed = one.place(base @ T, campaign.read(t))
            place[t], unknowns[t], off[:, t] = placed.T_tool_target, placed.unknown, placed.distance
            hidden[3 * t : 3 * t + 3, 3 * t : 3 * t + 3] = placed.unobservable
    registration = Registration(
        T_tracker_base=base,
        T_tool_target=place,
        rms=float(np.sqrt(np.mean(off[campaign.valid] ** 2))),
        unobservable=hidden,
        unknowns=tuple(unknowns),
    )
    return registration, off.max(axis=1)


def nominal_poses(model: ErrorModel, campaign: Campaign) -> Float[np.ndarray, "n 4 4"]:
    """Poses of the nominal robot at every row.

    Raises:
        CampaignError: a closed loop does not close at a row, which the message names.
    """
    try:
        return model.poses(campaign.q)
    except ClosureError as error:
        row = campaign.row(error.pose)
        raise CampaignError(f"{named_file(campaign)}the four-bar does not close at {row}: {error.detail}") from error


def distances(
    registration: Registration, campaign: Campaign, T: Float[np.ndarray, "n 4 4"]
) -> Float[np.ndarray, "n targets"]:
    """Distance of every target from where tool poses T have it, metres; NaN where it was not seen."""
    ends = (registration.T_tracker_base @ T)[:, None] @ registration.T_tool_target
    return np.linalg.norm(campaign.points - ends[..., :3, 3], axis=2)


def _register_points(T: np.ndarray, campaign: Campaign, reach: float) -> Registration:
    cloud = Cloud.of(T, campaign)
    _check_extent(cloud, campaign, reach)
    return _placed(_search(cloud, reach), np.broadcast_to(np.eye(3), (cloud.count, 3, 3)), cloud)


def _check_extent(cloud: Cloud, campaign: Campaign, reach: float) -> None:
    """See that the points do not lie along one line."""
    p, y = cloud.p, cloud.y
    extent = np.sqrt(np.linalg.eigvalsh(cloud.moments.yy)[::-1].clip(min=0.0) / len(y))
    if extent[1] < STRAIGHT_SHARE * reach:
        nominal = np.linalg.norm(p - p.mean(axis=0), axis=1).max()
        hint = ""
        if np.linalg.norm(y - y.mean(axis=0), axis=1).max() < 0.02 * nominal:
            hint = f"; the robot itself moved by {nominal * 1e3:.0f} mm, so the positions may be in metres: give millimetres"
        raise CampaignError(
            f"{named_file(campaign)}the measured points lie within {extent[1] * 1e3:.2f} mm of one line, which does not fix the "
            f"tracker frame; measure poses spread over a plane at least{hint}"
        )


def _placed(Z: Float[np.ndarray, "3 3"], X: Float[np.ndarray, "targets 3 3"], cloud: Cloud) -> Registration:
    """The registration of a rotation from base to tracker and the rotations of the targets: translation and offsets fit best."""
    t, offsets = cloud.moments.offsets(Z)
    rms = rms_length(cloud.residual(Z, t, offsets))
    unobservable = _unobservable(cloud, rms)
    if unobservable.any():
        t, offsets = cloud.moments.offsets(Z, held=unobservable)
        rms = rms_length(cloud.residual(Z, t, offsets))
    return Registration(
        T_tracker_base=se3.pose(Z, t), T_tool_target=se3.pose(X, offsets), rms=rms, unobservable=unobservable
    )


def place_targets(model: ErrorModel, campaign: Campaign, T_tracker_base: Float[np.ndarray, "4 4"]) -> Registration:
    """The targets, in a tracker frame that is known: each the mean of what its rows say.

    Raises:
        CampaignError: too few rows.
    """
    check_rows(campaign)
    cloud = Cloud.of(model.poses(campaign.q), campaign)
    count = cloud.count
    local = (np.swapaxes(cloud.R, 1, 2) @ (se3.apply(se3.inverse(T_tracker_base), cloud.y) - cloud.p)[:, :, None])[
        :, :, 0
    ]
    offsets = np.stack([local[cloud.target == t].mean(axis=0) for t in range(count)])
    residual = (cloud.R @ (local - offsets[cloud.target])[:, :, None])[:, :, 0]
    return Registration(
        T_tracker_base=T_tracker_base,
        T_tool_target=se3.pose(np.broadcast_to(np.eye(3), (count, 3, 3)), offsets),
        rms=rms_length(residual),
        unobservable=np.zeros((3 * count, 3 * count)),
    )


def register_closely(
    campaign: Campaign, T: Float[np.ndarray, "n 4 4"], start: Float[np.ndarray, "3 3"] | None = None
) -> Registration:
    """Register as `register`, but from one start only: for the many subsets that a search for sound rows looks through.

    Args:
        campaign: the measurements.
        T: poses of the tool in the base.
        start: rotation from base to tracker; in closed form by default.

    Raises:
        CampaignError: a target that these rows do not show.
    """
    cloud = Cloud.of(T, campaign)
    if not cloud.shows_all:
        raise CampaignError(f"{named_file(campaign)}a target is not seen in any of these rows")
    return register_cloud(cloud, start)


def register_cloud(cloud: Cloud, start: Float[np.ndarray, "3 3"] | None = None) -> Registration:
    """Register as `register_closely` points that show every target."""
    if cloud.Y is None:
        Z = refine(closed_form(cloud.moments) if start is None else start, cloud.moments)[0]
        X = np.broadcast_to(np.eye(3), (cloud.count, 3, 3))
    else:
        Z, X = (
            _rotations_at_once(cloud, cloud.Y)
            if start is None
            else alternate(start, products(cloud.R, cloud.Y), rounds=3)
        )
        X = X[None]
    return _placed(Z, X, cloud)


def register_trimmed(
    T: Float[np.ndarray, "n 4 4"], campaign: Campaign, model: ErrorModel
) -> tuple[Registration, Float[np.ndarray, " n"]]:
    """Register in spite of a few wrong rows, however wrong: least trimmed squares of the nominal robot.

    Each concentration step registers on the three quarters of the rows that are nearest to where the registration before had them
    (Rousseeuw and Van Driessen 2006), from all rows on; from subsets at random, where that ends where no robot would be. Kinds of
    observation that need no tracker are placed robustly by themselves.

    Args:
        T: poses of the tool in the base.
        campaign: the measurements.
        model: the robot's model.

    Returns:
        the registration, and how far each row is off it, metres; zero where nothing was seen.

    Raises:
        CampaignError: rows that do not determine the frames.
    """
    tracked = [name for name, one in zip(campaign.targets, campaign.observations, strict=True) if one.in_tracker]
    if len(tracked) == len(campaign.targets):
        return _trimmed(Cloud.of(T, campaign), campaign, model.robot.reach)
    right = campaign.seen
    if tracked:
        alone = campaign.of_targets(tracked)
        distance = register_trimmed(T, alone, model)[1]
        right = np.asarray(right & ((distance <= FAR_MEDIANS * float(np.median(distance[alone.seen]))) | ~alone.seen))
    return register_observations(T, campaign.without(~right), model)


def trusted_distance(distance: Float[np.ndarray, " n"]) -> float:
    """Distance within which the trusted share of the rows are, metres."""
    last = int(np.ceil(TRUSTED_SHARE * len(distance))) - 1
    return float(np.partition(distance, last)[last])


def _trimmed(cloud: Cloud, campaign: Campaign, reach: float) -> tuple[Registration, Float[np.ndarray, " n"]]:
    _check_extent(cloud, campaign, reach)
    seen, rng = np.flatnonzero(campaign.seen), np.random.default_rng(0)
    best = _concentrated(cloud, campaign.seen, campaign, reach)
    if trusted_distance(best[1][seen]) > SMALL_SHARE * cloud.extent:
        best = _concentrated(cloud, campaign.seen, campaign, reach, _search(cloud, reach))
    for _ in range(SUBSETS):
        if trusted_distance(best[1][seen]) <= PLAUSIBLE_SHARE * reach:
            break
        some = np.zeros(len(campaign), dtype=bool)
        some[rng.choice(seen, size=min(SUBSET_ROWS, len(seen)), replace=False)] = True
        if cloud.take(some[cloud.row]).shows_all:
            best = min(
                best, _concentrated(cloud, some, campaign, reach), key=lambda one: trusted_distance(one[1][seen])
            )
    return best


def _concentrated(
    cloud: Cloud,
    rows: Bool[np.ndarray, " n"],
    campaign: Campaign,
    reach: float,
    start: Float[np.ndarray, "3 3"] | None = None,
) -> tuple[Registration, Float[np.ndarray, " n"]]:
    """The registration of some rows that show all targets, and then of those that it is nearest to."""
    seen = campaign.seen
    found = register_cloud(cloud.take(rows[cloud.row]), start)
    distance = _row_distances(found, cloud, len(seen), reach)
    for _ in range(MAX_STEPS):
        farthest = trusted_distance(distance[seen])
        part = cloud.take((seen & (distance <= farthest))[cloud.row])
        if not part.shows_all:
            break
        found = register_cloud(part, found.T_tracker_base[:3, :3])
        distance = _row_distances(found, cloud, len(seen), reach)
        if trusted_distance(distance[seen]) > (1.0 - MIN_GAIN) * farthest:
            break
    return found, distance


def _row_distances(registration: Registration, cloud: Cloud, rows: int, reach: float) -> Float[np.ndarray, " n"]:
    """Distance of the farthest target of every row, metres; a measured pose's rotation counts at the robot's reach."""
    T, targets = registration.T_tracker_base, registration.T_tool_target
    residual = cloud.residual(T[:3, :3], T[:3, 3], targets[:, :3, 3])
    square = np.einsum("ni,ni->n", residual, residual)
    if cloud.Y is not None:
        turned = se3.log(cloud.Y @ np.swapaxes(T[:3, :3] @ cloud.R @ targets[0, :3, :3], 1, 2))
        square += np.sum((reach * turned) ** 2, axis=1)
    farthest = np.zeros((rows, cloud.count))
    farthest[cloud.row, cloud.target] = square
    return np.sqrt(farthest.max(axis=1))


def _search(cloud: Cloud, reach: float) -> Float[np.ndarray, "3 3"]:
    """Search from the closed form, and from many orientations if that ends where no robot would be."""
    moments = cloud.moments
    best = refine(closed_form(moments), moments)
    if best[1] > min(PLAUSIBLE_SHARE * reach, SMALL_SHARE * cloud.extent):
        for Z in orientations():
            candidate = refine(Z, moments)
            if candidate[1] < best[1] * (1.0 - 1e-9):
                best = candidate
    return best[0]


def _unobservable(cloud: Cloud, rms: float) -> Float[np.ndarray, "offsets offsets"]:
    """Projector onto the directions of the offsets that are not determined beside the translation.

    A residual under a millimetre is taken for one: a robot that happens to be exact has not more orientations for it. What only
    a few points say that are turned away from all others nothing confirms: a wrong joint value would say the same.
    """
    confirmed = cloud.take(_confirmed(cloud.R))
    if not confirmed.shows_all:
        confirmed = cloud
    values, vectors = np.linalg.eigh(offset_information(confirmed.R, confirmed.target, cloud.count)[1])
    weak = vectors[:, values < (max(rms, 1e-3) / LOCATED_WITHIN) ** 2]
    return weak @ weak.T


def _confirmed(R: Float[np.ndarray, "n 3 3"]) -> Bool[np.ndarray, " n"]:
    """Points but for the few that are turned farthest away from the middle of all."""
    low, high = (len(R) - 1) // 2, len(R) // 2
    ordered = np.partition(R, (low, high), axis=0)
    middle = se3.nearest_rotation(0.5 * (ordered[low] + ordered[high]))
    turned = 3.0 - np.einsum("ij,nij->n", middle, R)
    few = max(int(MINORITY_SHARE * len(R)), 1)
    return turned <= np.partition(turned, len(R) - few - 1)[max(len(R) - few - 1, 0)] + 1e-12


def _register_poses(T: np.ndarray, campaign: Campaign, reach: float) -> Registration:
    cloud = Cloud.of(T, campaign)
    assert cloud.Y is not None
    R, Y = cloud.R, cloud.Y
    by_points = _search(cloud, reach)

    def cost(ZX: tuple[np.ndarray, np.ndarray]) -> float:
        return reach**2 * _rotation_cost(ZX, R, Y) + cloud.moments.squares(ZX[0])

    mean = products(R, Y)
    starts = [closed_form_rotations(mean), alternate(by_points, mean), (by_points, target_rotation(by_points, mean))]
    best = min(starts, key=cost)
    if cost(best) > len(R) * (PLAUSIBLE_SHARE * reach) ** 2:
        best = min([best, *(alternate(Z, mean) for Z in orientations())], key=cost)
    Z, X = best
    return _placed(Z, X[None], cloud)


def _rotations_at_once(cloud: Cloud, Y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotations of tracker and target in closed form: from the orientations, or from the points where those hardly change."""
    R, y = cloud.R, cloud.y
    by_points = closed_form(cloud.moments)
    extent = float(np.linalg.norm(y - y.mean(axis=0), axis=1).mean())

    def cost(ZX: tuple[np.ndarray, np.ndarray]) -> float:
        return extent**2 * _rotation_cost(ZX, R, Y) + cloud.moments.squares(ZX[0])

    mean = products(R, Y)
    return min(closed_form_rotations(mean), (by_points, target_rotation(by_points, mean)), key=cost)


def _rotation_cost(ZX: tuple[np.ndarray, np.ndarray], R: np.ndarray, Y: np.ndarray) -> float:
    Z, X = ZX
    return float(((Z @ R @ X - Y) ** 2).sum())


# What the nominal robot leaves of the measurements in a registered frame.


@short_repr
@dataclass(frozen=True, eq=False)
class RegistrationResiduals:
    """Distances between the measured targets and where the nominal robot has them; of other observations, their residuals."""

    distances: Float[np.ndarray, "n targets"]
    """Metres; NaN where a target was not seen. A kind that measures angles alone takes them at an arm of 1 m."""

    @property
    def mean(self) -> float:
        """Over all targets seen, metres."""
        return float(np.nanmean(self.distances))

    @property
    def rms(self) -> float:
        """Over all targets seen, metres."""
        return float(np.sqrt(np.nanmean(self.distances**2)))

    @property
    def maximum(self) -> float:
        """Maximum over all targets seen, metres."""
        return float(np.nanmax(self.distances))

    @property
    def by_row(self) -> Float[np.ndarray, " n"]:
        """Distance of the farthest target in each row, metres; zero where none was seen."""
        return np.nan_to_num(self.distances, nan=0.0).max(axis=1)

    def summary(self) -> dict[str, float]:
        """The report in millimetres."""
        return {"mean_mm": self.mean * 1e3, "rms_mm": self.rms * 1e3, "max_mm": self.maximum * 1e3}


def registration_residuals(registration: Registration, model: ErrorModel, campaign: Campaign) -> RegistrationResiduals:
    """Residuals of a registration on its campaign, or on another one of the same targets.

    Args:
        registration: tracker frame and targets.
        model: the robot's model, taken as nominal.
        campaign: the measurements.

    Raises:
        CampaignError: a closed loop does not close at a row, or the registration lacks the unknowns of an observation, as one
            that was read from a file does.
    """
    T = nominal_poses(model, campaign)
    ends, off = registration.T_tracker_base @ T, distances(registration, campaign, T)
    unknowns = registration.unknowns or tuple(np.zeros(0) for _ in campaign.observations)
    for t, one in enumerate(campaign.observations):
        if one.in_tracker:
            continue
        if len(unknowns[t]) != len(one.unknowns):
            raise CampaignError(
                f"{named_file(campaign)}the registration lacks the fixed objects that '{campaign.targets[t]}' was measured "
                "against; register this campaign again"
            )
        seen, place = campaign.valid[:, t], registration.T_tool_target[t]
        left = one.differentiate(ends @ place, unknowns[t], campaign.read(t)).residual[seen]
        off[seen, t] = np.linalg.norm(left[:, : one.width - one.angles or one.width], axis=1)
    return RegistrationResiduals(off)
