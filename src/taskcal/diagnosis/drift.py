"""Drifts and slips during a campaign: a target slipped, the tracker or base moved, or drifted, an encoder jumped, clocks ran apart.

Whether anything happened is decided as for every fit (`identification.checks.course`); here it is about the nominal robot, with
the geometry free within its tolerances, and comes with the campaign without it.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from taskcal.campaigns.campaign import Campaign, Stations
from taskcal.campaigns.drift import compensate_drift
from taskcal.diagnosis.fits import (
    ADDED_PRIOR,
    MIN_NOISE_M,
    LinearFit,
    fit_linearly,
    frame_columns,
    registered,
    target_poses,
)
from taskcal.diagnosis.hypotheses import Case, Finding, looked_for
from taskcal.diagnosis.rows import Local, RowFault, find_row_fault, find_swapped
from taskcal.diagnosis.search import MISTAKE_CHARGE, Candidate, held_out_error, rows_to_register, spread_rows, typical
from taskcal.estimation.ordered_rows import MIN_GAIN, Event, OrderedRows, find_event
from taskcal.geometry import se3
from taskcal.identification.checks.checks import few_digits
from taskcal.identification.checks.course import (
    MAX_COURSE_ROWS,
    describe_event,
    describe_move,
    list_sources,
    lost_motion,
    name_parts,
    slipped_targets,
)
from taskcal.identification.checks.digits import find_few_digits
from taskcal.registration.registration import Registration
from taskcal.robot.conditions import drive_motion

MAX_FOLLOWED_RATIO = 1.1
"""Error with the reference points followed over that without, at most, where they are followed. A convention: as good as equal."""

MAX_MEDIAN_SHARE = 0.1
"""Median distance over the reach beyond which no slip, move or drift is looked for. A convention: then the fit itself is wrong."""

MAX_LARGE_CUTS = 24
"""Cuts between rows at which a large move is tried first; those near the best one are tried as well. A convention that bounds
the time."""

MIN_PART_ROWS = 6
"""Rows at least on either side of a large move, as many as one half of the rows needs to judge the other. A convention."""


def find_drift_or_slip(explanation: Candidate) -> Local | None:
    """The one thing that most likely went wrong in its course, if anything did, and the campaign without it."""
    found = _find_in_course(explanation)
    return _find_two_robots(explanation.case, found) or found


@looked_for("drift", "drift", "encoder-jumped", "clocks-apart", measured_anew=True)
@looked_for("drift", "target-slipped", "station-moved")
def _find_in_course(explanation: Candidate) -> Local | None:
    case = _followed(explanation.case)
    swapped = find_swapped(case)
    if swapped is not None:
        return swapped.local(case.campaign)
    fit = fit_linearly(case, spread_rows(len(case.campaign), MAX_COURSE_ROWS))
    if fit is None or fit.median > MAX_MEDIAN_SHARE * case.reach:
        return None
    fault, event = find_row_fault(case, fit), find_event(ordered_rows(case, fit))
    if fault is None and event is None:
        return _find_few_digits(case, fit)
    of_rows = fault is not None and fault.id in ("duplicate-poses", "rows-shuffled")
    if event is None or of_rows or (fault is not None and event.gain_alone <= _gain_of(fault, fit)):
        assert fault is not None
        return fault.local(case.campaign)
    return found_local(event, explanation.case, fit)


@looked_for("rows", "few-digits", measured_anew=True)
def _find_few_digits(case: Case, fit: LinearFit) -> Local | None:
    """That joints or points were written with few digits, where it explains all that is left; nothing mends it but writing more."""
    q, points = case.campaign.q[np.unique(fit.rows)], case.campaign.points[fit.rows, fit.targets]
    left = float(np.sqrt((fit.distance**2).mean()))
    found = find_few_digits(q, points, fit.joints @ drive_motion(case.robot), left, case.robot)
    if found is None:
        return None
    fix = few_digits.said(found.values)
    finding = Finding(
        id="few-digits", subject=(found.of,), error_before=left, error_after=None, confidence=0.9, fix=fix
    )
    return finding, case.campaign


def ordered_rows(case: Case, fit: LinearFit) -> OrderedRows:
    """A fit's points in their order, and what may have happened to them."""
    joints = fit.joints / fit.noise
    places = [np.where((fit.targets == t)[:, None, None], fit.turned, 0.0) for t in range(len(case.campaign.targets))]
    return OrderedRows(
        row=fit.rows,
        residual=fit.residual / fit.noise,
        unit=np.full(fit.residual.shape, fit.noise),
        known=np.concatenate(
            [fit.columns / fit.noise, lost_motion(case.campaign, case.model.robot, fit.rows, joints)], axis=2
        ),
        q=case.campaign.q[fit.rows],
        joints=joints,
        sources=list_sources(
            case.campaign,
            case.model.robot,
            fit.rows,
            frames=[frame_columns(fit.places) / fit.noise],
            places=[place / fit.noise for place in places],
            joints=joints,
        ),
    )


def found_local(event: Event, case: Case, fit: LinearFit) -> Local:
    """The finding, and the campaign without it; its confidence is 0.63 for the least gain that is significant, up to 0.99."""
    subject, mended = _undone(event, case, fit)
    finding = Finding(
        id=event.id,
        subject=subject,
        error_before=event.before,
        error_after=event.after,
        confidence=float(np.clip(1.0 - np.exp(-event.gain / MIN_GAIN), 0.0, 0.99)),
        fix=describe_event(event, case.campaign, case.robot),
    )
    return finding, mended


def _undone(event: Event, case: Case, fit: LinearFit) -> tuple[tuple[str, ...], Campaign]:
    """What is concerned, and the campaign without it; as it is where nothing mends it but measuring again."""
    campaign = case.campaign
    if event.id == "station-moved":
        motion = event.motion[:, 0]
        turn = se3.exp(motion[3:]).T
        back = se3.pose(turn, fit.centre - turn @ (fit.centre + motion[:3]))
        return (campaign.ids[event.row],), _brought_back(campaign, event.row, back)
    if event.id == "target-slipped":
        chosen = slipped_targets(event)
        return tuple(campaign.targets[t] for t in chosen), _with_slipped(campaign, event.row, list(chosen))
    if event.id == "encoder-jumped":
        return (case.robot.joint_names[event.source.of[0]], campaign.ids[event.row]), campaign
    return (), campaign


def _with_slipped(campaign: Campaign, row: int, chosen: list[int]) -> Campaign:
    """The measurements after the slip as those of other targets; of poses, the longer part alone."""
    after = np.arange(len(campaign)) >= row
    if campaign.rotations is not None:
        keep = ~after if after.mean() <= 0.5 else after
        return campaign.take(np.flatnonzero(keep))
    points = campaign.points.copy()
    moved = np.where(after[:, None, None], points[:, chosen], np.nan)
    points[after[:, None] & np.isin(np.arange(len(campaign.targets)), chosen)] = np.nan
    u = campaign.uncertainty
    return replace(
        campaign,
        targets=(*campaign.targets, *(f"{campaign.targets[t]}_slipped" for t in chosen)),
        points=np.concatenate([points, moved], axis=1),
        observations=(*campaign.observations, *(campaign.observations[t] for t in chosen)),
        uncertainty=None if u is None else np.concatenate([u, u[:, chosen]], axis=1),
    )


def _gain_of(fault: RowFault, fit: LinearFit) -> float:
    """Gain of twice the logarithm of the likelihood, less its price, of three unknowns for each point in some rows."""
    weight = np.ones(len(fit.rows))
    without = np.where(np.isin(fit.rows, fault.rows), 0.0, weight)
    numbers, columns = 3.0 * len(weight), 3.0 * float((without == 0.0).sum())
    freedom = max(numbers - fit.columns.shape[2] / 2.0, 6.0)
    before, after = max(fit.objective(weight), 1e-12), max(fit.objective(without), 1e-12)
    return float(freedom * np.log(before / after) - columns * np.log(numbers))


def _followed(case: Case) -> Case:
    """Compensate the motion of the reference points, unless that increases the error."""
    if not case.campaign.reference_points:
        return case
    followed = replace(case, campaign=compensate_drift(case.campaign).campaign)
    return followed if held_out_error(followed) <= MAX_FOLLOWED_RATIO * held_out_error(case) else case


# Rows of two robots, or of one before and after a crash or a change: another geometry and place from one row on.

MIN_TWO_GAIN = 60.0
"""Of twice the logarithm of the likelihood. What one robot leaves unexplained differs from one part of its workspace to the other,
and two geometries follow that: of 120 campaigns in the order of a joint, of ten robots with gear errors and compliance, they gained
2 at most; of 16 pairs of robots drawn from their tolerances, in 40 and 60 rows, 390 at least."""

MIN_TWO_FACTOR = 3.0
"""Factor at least by which two geometries lower the root mean square error. A convention: two thirds of it are then of the
difference between the robots."""

MIN_TWO_SHARE = 0.1
"""Share of the rows, at least, of either robot. A convention: fewer in one corner of the workspace may lack what all others
explain."""

NOISE_ROUNDS = 3
"""Rounds of two geometries and their noise in turn. A convention that bounds the time."""

MAX_TWO_CUTS = 8
"""Cuts between rows at which two geometries are tried first; where they explain something, those near the best one are tried as
well. A convention that bounds the time."""


class _Parted(NamedTuple):
    """Rows before and after a cut, as of two robots."""

    row: int
    """The first of the second one."""
    gain: float
    """Of twice the logarithm of the likelihood."""
    before: float
    """Root mean square distance of one geometry, metres."""
    after: float
    """That of two."""
    apart: float
    """Median distance between them, metres."""


@looked_for("drift", "two-robots", measured_anew=True)
def _find_two_robots(case: Case, found: Local | None) -> Local | None:
    """Another robot from one row on, where the campaign without what was found instead leaves as much to it."""
    mended = case if found is None or found[1] is case.campaign else replace(case, campaign=found[1])
    parted = [one for left in dict.fromkeys((mended, case)) if (one := _part(left, case.reach)) is not None]
    if not parted:
        return None
    two, least = max(parted, key=lambda one: one.gain), min(one.before for one in parted)
    drifted = least if found is None or found[0].error_after is None else min(found[0].error_after, least)
    if two.gain <= MIN_TWO_GAIN or drifted <= MIN_TWO_FACTOR * two.after:
        return None
    campaign = case.campaign
    fix = (
        f"the rows before {campaign.row(two.row)} and those from there on are not of one robot, which differs by about "
        f"{two.apart * 1e3:.1f} mm: two robots, or one that was changed between; identify the rows before and after by "
        f"themselves: {name_parts(campaign, two.row)}"
    )
    finding = Finding(
        id="two-robots",
        subject=(campaign.ids[two.row],),
        error_before=two.before,
        error_after=two.after,
        confidence=float(np.clip(1.0 - np.exp(-two.gain / MIN_TWO_GAIN), 0.0, 0.99)),
        fix=fix,
    )
    return finding, campaign


def _part(case: Case, reach: float) -> _Parted | None:
    """The likeliest cut between two robots; None where there are too few rows, or the fit itself is wrong."""
    fit = fit_linearly(case, spread_rows(len(case.campaign), MAX_COURSE_ROWS))
    if fit is None or fit.median > MAX_MEDIAN_SHARE * reach:
        return None
    rows, weight = np.unique(fit.rows), np.ones(len(fit.rows))
    least = max(MIN_PART_ROWS, int(np.ceil(MIN_TWO_SHARE * len(rows))))
    places = rows[least : len(rows) - least + 1]
    if not len(places):
        return None

    def best(fit: LinearFit, places: Int[np.ndarray, " k"]) -> int:
        return max(places.tolist(), key=lambda row: _gain_of_another(fit, row))

    before, stride = fit.rms(weight), max(1, len(places) // MAX_TWO_CUTS)
    row = best(fit, places[::stride])
    near = places[np.abs(np.arange(len(places)) - int(np.searchsorted(places, row))) < stride]
    for _ in range(NOISE_ROUNDS):  # the noise that one geometry leaves is the difference of the two
        fit = replace(fit, noise=max(fit.rms(weight, _of_another(fit, row)) / np.sqrt(3.0), MIN_NOISE_M))
        row = best(fit, near)
    columns = _of_another(fit, row)
    moved = np.linalg.norm(columns @ fit.size(weight, columns), axis=1)[fit.rows >= row]
    gain, after = _gain_of_another(fit, row), fit.rms(weight, columns)
    return _Parted(row=row, gain=gain, before=before, after=after, apart=float(np.median(moved)))


def _of_another(fit: LinearFit, row: int) -> Float[np.ndarray, "m 3 b"]:
    """Columns of another geometry, held by its prior, and of another place of the robot, from a row on."""
    geometry = fit.columns[:, :, : fit.held] * np.sqrt(ADDED_PRIOR)
    return np.concatenate([geometry, frame_columns(fit.places)], axis=2) * (fit.rows >= row)[:, None, None]


def _gain_of_another(fit: LinearFit, row: int) -> float:
    """Gain of twice the logarithm of the likelihood by another robot from a row on, less the price of its columns."""
    weight, columns, numbers = np.ones(len(fit.rows)), _of_another(fit, row), 3.0 * len(fit.rows)
    freedom = max(numbers - (fit.columns.shape[2] + columns.shape[2]) / 2.0, 6.0)
    before, after = max(fit.objective(weight), 1e-12), max(fit.objective(weight, columns), 1e-12)
    return float(freedom * np.log(before / after) - columns.shape[2] * np.log(numbers))


def find_large_move(case: Case) -> Local | None:
    """A move of the tracker or the base between two rows that is too large to be linear, and the campaign without it.

    The rows before and after every cut are registered by themselves; the frame of one is brought to that of the other.
    """
    T, usable = case.poses(np.arange(len(case.campaign))), case.usable()[0]
    least = max(MIN_PART_ROWS, rows_to_register(case.campaign))
    places = np.arange(least, len(usable) - least + 1)
    if not len(places):
        return None
    tried: dict[int, tuple[float, Registration, Registration] | None] = {}
    stride = max(1, len(places) // MAX_LARGE_CUTS)
    near = places[::stride].tolist()
    while True:
        tried |= {place: _registered_apart(case.campaign, T, usable, place) for place in near}
        registered = {place: parts for place, parts in tried.items() if parts is not None}
        if not registered:
            return None
        top = min(registered, key=lambda place: registered[place][0])
        stride = max(1, stride // 2)
        near = [k for k in (top - stride, top + stride) if places[0] <= k <= places[-1] and k not in tried]
        if not near and stride == 1:
            break
    _, first, second = registered[top]
    row = int(usable[top])
    back = first.T_tracker_base @ se3.inverse(second.T_tracker_base)
    together = _brought_back(case.campaign, row, back)
    before, after = held_out_error(case), held_out_error(replace(case, campaign=together))
    points = case.campaign.points[usable[usable >= row]]
    move = float(np.nanmedian(np.linalg.norm(points @ back[:3, :3].T + back[:3, 3] - points, axis=-1)))
    # of all that can be tried, this alone brings nearly all rows together
    if not after < before * np.exp(-2.0 * MISTAKE_CHARGE):
        return None
    finding = Finding(
        id="station-moved",
        subject=(case.campaign.ids[row],),
        error_before=before,
        error_after=after,
        confidence=float(np.clip(1.0 - after / before, 0.0, 0.99)),
        fix=describe_move(case.campaign, row, move),
    )
    return finding, together


def _registered_apart(
    campaign: Campaign, T: np.ndarray, usable: np.ndarray, place: int
) -> tuple[float, Registration, Registration] | None:
    """Typical distance of all rows, those before a place and those from there on registered by themselves; and how."""
    distances: list[np.ndarray] = []
    registrations: list[Registration] = []
    for rows in (usable[:place], usable[place:]):
        part = campaign.take(rows)
        registration = registered(part, T[rows])
        if registration is None:
            return None
        registrations.append(registration)
        ends = target_poses(registration, T[rows])[..., :3, 3]
        distances.append(np.nanmedian(np.linalg.norm(part.points - ends, axis=2), axis=1))
    return typical(np.concatenate(distances)), registrations[0], registrations[1]


def _brought_back(campaign: Campaign, row: int, back: np.ndarray) -> Campaign:
    """The campaign with what was measured from a row on as that of a second station, by its pose in the frame of the first."""
    first = "1" if campaign.stations is None else campaign.stations.names[0]
    stations = Stations(
        names=(first, "2" if campaign.stations is None else f"{first} moved"),
        of=(np.arange(len(campaign)) >= row).astype(int),
        T_first_station=np.tile(np.eye(4), (2, 1, 1)),
    )
    return replace(campaign, stations=stations).carried(np.stack([np.eye(4), back]))
