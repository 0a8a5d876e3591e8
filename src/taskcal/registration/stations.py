"""A tracker that is moved during a campaign: what it measured from every station, in the frame of the first."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.arguments import checked, repeated
from taskcal.campaigns.campaign import Campaign, Stations, join, named_file
from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.observations.base import TrackerNoise
from taskcal.registration.registration import MAX_STEPS, STRAIGHT_SHARE, TRUSTED_SHARE, nominal_poses, register_trimmed
from taskcal.robot.error_model import ErrorModel

MOVED_SIGMAS = 10.0
"""Standard deviations of a change of two reference points' distance, from which on one was moved. A convention, as for a gross
error of a row."""

FAR_MEDIANS = 10.0
"""Times the median distance, beyond which a point does not count for a frame: on measured robots the nominal geometry leaves at
most 8.4 times the median."""

TRACKER_NOISE_M = 1e-4
"""Distance, metres, below which no point is far, however well the others agree. A convention: several times the uncertainty of a
laser tracker."""


@checked
def join_stations(model: ErrorModel, parts: Sequence[tuple[str, Campaign]]) -> Campaign:
    """One campaign of what a tracker measured from several stations, carried into the frame of the first.

    The nominal robot tells where the stations are: the one with most points is registered, and the others see the same targets.
    That is a start: a fit estimates the frame of every station, and shares all else.

    Args:
        model: of the robot.
        parts: the name of its station, and what was measured from there, in the order of measurement; parts of one name are
            one station.

    Raises:
        CampaignError: a part has no name, was not measured by a tracker alone, or does not determine where its station is;
            reference points keep no distance; or some parts state uncertainties or rotations and others do not.
    """
    for name, part in parts:
        if not name:
            raise CampaignError(f"{named_file(part)}a station has no name; give each row's in the column station")
        part.refuse_kinds(f"{named_file(part)}a station", ": leave out the column station, or give one file")
    names = tuple(dict.fromkeys(name for name, _ in parts))
    whole = join([part for _, part in parts], alike=True)
    of = np.repeat([names.index(name) for name, _ in parts], [len(part) for _, part in parts])
    named = [(name, number, text) for number, (name, part) in enumerate(parts, 1) for text in part.ids]
    ids = tuple(text for _, _, text in named)
    if repeated(ids):
        ids = tuple(f"{name}:{text}" for name, _, text in named)
    if repeated(ids):  # several parts of one station
        ids = tuple(f"{name}:{number}:{text}" for name, number, text in named)
    stations = Stations(names=names, of=of, T_first_station=np.tile(np.eye(4), (len(names), 1, 1)))
    whole = replace(whole, ids=ids, stations=stations)
    if len(names) == 1:
        return whole
    _refuse_moved_references(whole, stations)
    frames = _frames(model, whole, of, len(names))
    return whole.carried(frames[0] @ se3.inverse(frames))


def _refuse_moved_references(campaign: Campaign, stations: Stations) -> None:
    """See that reference points are as far from each other at every station.

    Raises:
        CampaignError: two are not, since one of them was moved.
    """
    names, noise = list(campaign.reference_points), TrackerNoise()
    place, variance = np.full((2, len(stations.names), len(names), 3), np.nan)
    for k, p in np.ndindex(len(stations.names), len(names)):
        seen = campaign.reference_points[names[p]][stations.of == k]
        seen = seen[~np.isnan(seen[:, 0])]
        if len(seen):
            place[k, p] = seen.mean(axis=0)
            variance[k, p] = seen.var(axis=0).mean() + np.trace(noise.covariance(place[k, p])) / 3.0
    for p, other in combinations(range(len(names)), 2):
        apart = np.linalg.norm(place[:, p] - place[:, other], axis=1)
        sigma = np.sqrt(variance[:, p, 0] + variance[:, other, 0])
        for k, m in combinations(np.flatnonzero(~np.isnan(apart)).tolist(), 2):
            if abs(apart[k] - apart[m]) > MOVED_SIGMAS * np.hypot(sigma[k], sigma[m]):
                raise CampaignError(
                    f"{named_file(campaign)}reference points {names[p]} and {names[other]} are {apart[k] * 1e3:.3f} mm apart from "
                    f"station '{stations.names[k]}' and {apart[m] * 1e3:.3f} mm from '{stations.names[m]}': one of them was moved; "
                    "leave it out (--reference-points)"
                )


def _frames(
    model: ErrorModel, campaign: Campaign, of: Int[np.ndarray, " n"], count: int
) -> Float[np.ndarray, "stations 4 4"]:
    """Pose of the base in the frame of every station, by the nominal robot.

    Raises:
        CampaignError: a station does not see enough of the targets that the one with most points sees.
    """
    poses = nominal_poses(model, campaign)
    seen = np.bincount(of, weights=campaign.valid.sum(axis=1), minlength=count)
    largest = int(np.argmax(seen))
    rows = of == largest
    shared = np.flatnonzero(campaign.valid[rows].any(axis=0))
    part = replace(campaign, stations=None).of_targets([campaign.targets[t] for t in shared]).take(rows)
    registration, _ = register_trimmed(poses[rows], part, model)
    base = (poses[:, None] @ registration.T_tool_target)[..., :3, 3]
    out = np.tile(registration.T_tracker_base, (count, 1, 1))
    for k in range(count):
        if k != largest:
            there = (of == k)[:, None] & campaign.valid[:, shared]
            name = campaign.stations.names[k] if campaign.stations else ""
            said = f"{named_file(campaign)}station '{name}'"
            out[k] = frame_of_points(base[there], campaign.points[:, shared][there], model.robot.reach, said)
    return out


def frame_of_points(
    base: Float[np.ndarray, "k 3"], measured: Float[np.ndarray, "k 3"], reach: float, said: str
) -> Float[np.ndarray, "4 4"]:
    """Pose of the base in a tracker's frame, from points that are known in both, in spite of a few that are wrong.

    Least trimmed squares by concentration steps, as in `register_trimmed`.

    Args:
        base: the points in the base, metres.
        measured: the same as measured.
        reach: of the robot, metres.
        said: whose they are, to begin a message.

    Raises:
        CampaignError: they are too few, or lie on one line.
    """
    extent = np.linalg.svd(base - base.mean(axis=0), compute_uv=False) if len(base) else np.zeros(3)
    if len(base) < 3 or extent[1] < STRAIGHT_SHARE * reach * np.sqrt(len(base)):
        raise CampaignError(
            f"{said} measured {len(base)} points of targets that another station measured too, "
            f"{'on one line' if len(base) > 2 else 'too few'} to determine where it is; measure three or more poses from there, "
            "not on one line"
        )
    near: Bool[np.ndarray, " k"] = np.ones(len(base), dtype=bool)
    off = np.zeros(len(base))
    for _ in range(MAX_STEPS):
        T = se3.fit_points(base[near], measured[near])
        off = np.linalg.norm(measured - se3.apply(T, base), axis=1)
        before, near = near, off <= np.quantile(off, TRUSTED_SHARE, method="higher")
        if near.sum() < 3 or np.array_equal(before, near):
            break
    right = off <= max(FAR_MEDIANS * float(np.median(off)), TRACKER_NOISE_M)
    return se3.fit_points(base[right], measured[right])
