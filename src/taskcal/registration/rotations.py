"""Whether measured rotations can belong to positions that fit the robot: never measured, of other rows, or written otherwise."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from taskcal.campaigns.campaign import Campaign, named_file
from taskcal.errors import CampaignError, listed
from taskcal.estimation.matrices import single_threaded
from taskcal.geometry import se3
from taskcal.registration.registration import (
    PLAUSIBLE_SHARE,
    nominal_poses,
    register_trimmed,
    trusted_distance,
)
from taskcal.robot.error_model import ErrorModel

MIN_POSES = 6
"""Poses at least: two frames have six unknowns, each pose tells three angles. A convention: three times as many equations as
unknowns."""

MAX_MISFIT_RAD = float(np.radians(5.0))
"""Angle, at most, between a measured rotation and the nominal robot's: it misses by tenths of a degree where they belong together.
A convention far above that, and below what rotations of another pose or convention are off by."""

MAX_WRONG_SHARE = 0.1
"""Share of the rows, at most, whose rotation may be wrong beside right ones: a fit leaves so few rows out. A convention, as
`plausibility.MAX_WRONG_SHARE`."""

SAME = 1e-6
"""Difference, at most, of the entries of one and the same rotation: what is measured differs in the last digits."""

MAX_SHIFT_ROWS = 12
"""Rows, at most, by which rotations are tried against positions. A convention, as for points against joints."""

MAX_MENDED_RATIO = 0.45
"""Median angle with a mistake undone over that as given, at most, where it is believed. A convention: 1/2.2, by which one mistake
has to lower the doctor's error."""

MAX_CANDIDATES = 60
"""Rows, at most, whose rotation of the target is tried for all. A convention that bounds the time."""

NAMED_ROWS = 6
"""Rows that a message names."""


@dataclass(frozen=True, eq=False, kw_only=True)
class RotationFit:
    """How measured rotations fit the nominal robot in the frame in which the positions do."""

    R: Float[np.ndarray, "n 3 3"]
    """Of the nominal tool, in the measuring frame of the positions."""
    seen: Bool[np.ndarray, " n"]
    """Rows in which anything was measured."""
    off: Float[np.ndarray, " n"]
    """Angle by which each rotation is off, radians, with the target's rotation on which most rows agree; 0 where none was seen."""
    constant: Bool[np.ndarray, " n"]
    """Rows that have one and the same rotation although the robot turned between them."""
    shift: int
    """Rows by which the rotations stand below their positions, where they fit those far better; else 0."""
    distance: float
    """Median distance of the positions, metres."""

    @property
    def wrong(self) -> Bool[np.ndarray, " n"]:
        """Rows whose rotation cannot be that of their position."""
        return self.constant | (self.off > MAX_MISFIT_RAD)

    @property
    def few(self) -> bool:
        """Whether so few rows are wrong that they alone may be left out."""
        return not self.shift and bool(self.wrong.sum() <= MAX_WRONG_SHARE * self.seen.sum())

    def said(self, campaign: Campaign) -> str:
        """What is wrong with the rotations, in words."""
        n, wrong = int(self.seen.sum()), np.flatnonzero(self.wrong)
        fit = f"positions fit the robot to {self.distance * 1e3:.2g} mm (median)"
        if self.constant.any():
            assert campaign.rotations is not None
            row = int(np.flatnonzero(self.constant)[0])
            quaternion = " ".join(f"{part:.4g}" for part in se3.to_quaternion(campaign.rotations[row]) + 0.0)
            which = "all" if self.constant[self.seen].all() else f"{int(self.constant.sum())} of {n}"
            named = "" if which == "all" else f" ({name_rows(campaign, self.constant)})"
            return (
                f"{which} rows have one rotation, qx qy qz qw {quaternion}, while the robot turned{named}: it was not measured "
                f"there; {fit}"
            )
        if self.shift:
            where = f"{abs(self.shift)} row{'s' * (abs(self.shift) > 1)} {'below' if self.shift > 0 else 'above'}"
            return f"rotations stand {where} their positions, by what fits, while {fit}"
        off = float(np.degrees(np.median(self.off[wrong])))
        if 2 * len(wrong) < n:
            return f"rotations of {len(wrong)} of {n} rows are off by {off:.0f}° ({name_rows(campaign, self.wrong)}), while {fit}"
        return f"rotations do not fit the robot, by {off:.0f}° (median), while {fit}"


def name_rows(campaign: Campaign, rows: Bool[np.ndarray, " n"]) -> str:
    """Rows by name, the first ones of many."""
    return listed((campaign.row(int(row)) for row in np.flatnonzero(rows)), NAMED_ROWS)


@single_threaded
def fit_rotations(model: ErrorModel, campaign: Campaign) -> RotationFit | None:
    """How the rotations of a tracker's target fit; None where none were measured, or its positions do not fit or give no frame.

    The positions alone give the frame, so that no rotation decides on itself. Of the rotations of the target that single rows give,
    that one is taken from which the median row is least off (a least median of squares, Rousseeuw 1984), and then the mean of the
    nearer half.

    Args:
        model: of the robot.
        campaign: the measurements.
    """
    target = _turned_target(campaign)
    if target is None or campaign.rotations is None or campaign.valid[:, target].sum() < MIN_POSES:
        return None
    points = replace(campaign.of_targets([campaign.targets[target]]), rotations=None)
    try:
        T = nominal_poses(model, points)
        registration, distance = register_trimmed(T, points, model)
    except (CampaignError, np.linalg.LinAlgError):
        return None
    seen = points.seen
    if trusted_distance(distance[seen]) > PLAUSIBLE_SHARE * model.robot.reach or _is_open(points, distance):
        return None
    R = registration.T_tracker_base[:3, :3] @ T[:, :3, :3]
    Y, constant = campaign.rotations, _constant(R, campaign.rotations, seen)
    return RotationFit(
        R=R,
        seen=seen,
        off=misfit(R, Y, seen),
        constant=constant,
        shift=_shift(R, Y, seen & ~constant),
        distance=float(np.median(distance[seen])),
    )


def misfit(
    R: Float[np.ndarray, "n 3 3"], Y: Float[np.ndarray, "n 3 3"], seen: Bool[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Angle by which each rotation Y is off R·X, radians, for the rotation X on which most rows agree; 0 of rows not seen."""
    X = (np.swapaxes(R, 1, 2) @ Y)[seen]
    some = X[np.unique(np.linspace(0, len(X) - 1, min(len(X), MAX_CANDIDATES)).astype(int))]
    agreeing = np.median(np.einsum("kij,mij->km", some, some), axis=1)  # of traces, which fall as angles grow
    traces = np.einsum("ij,nij->n", some[int(np.argmax(agreeing))], X)
    mean = se3.nearest_rotation(X[traces >= np.median(traces)].mean(axis=0))
    off = np.zeros(len(R))
    off[seen] = np.linalg.norm(se3.log(X @ mean.T), axis=1)
    return off


def _shift(R: Float[np.ndarray, "n 3 3"], Y: Float[np.ndarray, "n 3 3"], rows: Bool[np.ndarray, " n"]) -> int:
    """Rows by which rotations have to be moved up to fit far better than they do; 0 where none do."""
    n, medians = len(R), dict[int, float]()
    most = min(MAX_SHIFT_ROWS, int(rows.sum()) // 4)
    for k in range(-most, most + 1):
        there = np.zeros(n, dtype=bool)
        there[max(0, -k) : n - max(0, k)] = True
        there &= rows & np.roll(rows, -k)
        if there.sum() >= MIN_POSES:
            medians[k] = float(np.median(misfit(R, np.roll(Y, -k, axis=0), there)[there]))
    if not medians:
        return 0
    best = min(medians, key=lambda k: medians[k])
    return best if medians[best] <= min(MAX_MISFIT_RAD, MAX_MENDED_RATIO * medians.get(0, 0.0)) else 0


def leave_out_wrong_rotations(model: ErrorModel, campaign: Campaign) -> Campaign:
    """A campaign without rotations, and a note, where more of these are wrong than a fit leaves out; else the campaign as it is."""
    fit = fit_rotations(model, campaign)
    if fit is None or fit.few:
        return campaign
    note = f"{fit.said(campaign)}. All rotations are left out and positions alone used; 'taskcal doctor' looks for what is wrong"
    return replace(campaign, rotations=None, notes=(*campaign.notes, note))


def refuse_wrong_rotations(model: ErrorModel, campaign: Campaign) -> None:
    """Raise a `CampaignError` if more rotations are wrong than a fit leaves out, while positions fit."""
    fit = fit_rotations(model, campaign)
    if fit is not None and not fit.few:
        raise CampaignError(
            f"{named_file(campaign)}{fit.said(campaign)}. Correct the rotations ('taskcal doctor', in Python diagnose, looks "
            "for what is wrong), or leave them out (their columns; in Python replace(campaign, rotations=None)): positions alone do"
        )


def _turned_target(campaign: Campaign) -> int | None:
    """The target whose rotations a tracker measured, if any."""
    of = [t for t, one in enumerate(campaign.observations) if one.in_tracker and one.turned]
    return of[0] if len(of) == 1 else None


def _is_open(points: Campaign, distance: Float[np.ndarray, " n"]) -> bool:
    """Whether positions lie so near to a line that what they are off by may turn their frame."""
    y, off = points.points[points.seen, 0], distance[points.seen]
    across = float(np.linalg.svd(y - y.mean(axis=0), compute_uv=False)[1] / np.sqrt(len(y)))
    return float(np.median(off)) > MAX_MISFIT_RAD / 3.0 * across


def _constant(
    R: Float[np.ndarray, "n 3 3"], Y: Float[np.ndarray, "n 3 3"], seen: Bool[np.ndarray, " n"]
) -> Bool[np.ndarray, " n"]:
    """Rows of the most frequent rotation, if the robot turned between them."""
    rows = np.flatnonzero(seen)
    _, group, count = np.unique(
        np.round(Y[rows].reshape(-1, 9) / SAME), axis=0, return_inverse=True, return_counts=True
    )
    of = rows[group.reshape(-1) == int(count.argmax())]
    turned = np.linalg.norm(se3.log(R[of] @ R[of[0]].T), axis=1)
    out = np.zeros(len(R), dtype=bool)
    out[of] = len(of) > 1 and bool(turned.max() > MAX_MISFIT_RAD)
    return out
