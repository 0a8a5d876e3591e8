"""What went wrong in a campaign's course, as a finding, and the campaign without it."""

from dataclasses import replace

import numpy as np

from taskcal.diagnosis.course_mistakes import CourseMistake, find_course_mistake, gain
from taskcal.diagnosis.finding import Finding
from taskcal.diagnosis.linear_fit import LinearFit, fit_linearly
from taskcal.diagnosis.row_faults import RowFault, find_row_fault, find_swapped
from taskcal.diagnosis.search import PER_MISTAKE, Explanation, held_out_error, rows_to_register, typical
from taskcal.diagnosis.supposition import Case
from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.drift import compensate_drift
from taskcal.measurement.registration import Registration, register_closely

IN_COURSE_SHARE = 0.1
"""Of the reach: with more left than this, nothing that happened in a campaign's course is told."""

LOCAL_ROWS = 240
"""Rows on which slips, drifts and gross errors are looked for; a longer campaign is looked at in every second row, or third."""

LARGE_CUTS = 24
"""Rows between which a large move is looked for first; those near the best one are looked at as well."""

LEAST_PART = 6
"""Rows on either side of a large move."""

Local = tuple[Finding, Campaign]


def find_in_course(explanation: Explanation) -> Local | None:
    """The one thing that most likely went wrong in its course, if anything did, and the campaign without it."""
    case = _followed(explanation.case)
    swapped = find_swapped(case)
    if swapped is not None:
        return _of_rows(swapped, case)
    step = max(1, int(np.ceil(len(case.campaign) / LOCAL_ROWS)))
    rows = np.arange(0, len(case.campaign), step)
    fit = fit_linearly(case, rows)
    if fit is None or fit.median > IN_COURSE_SHARE * case.model.robot.reach:
        return None
    fault = find_row_fault(case, fit)
    weight = np.ones(len(fit.rows))
    without = weight if fault is None else (~np.isin(fit.rows, fault.rows)).astype(float)
    plain = find_course_mistake(fit, weight, len(case.campaign.targets))
    if plain is not None and plain.id != "drift" and step > 1:  # the rows between those that were looked at
        between = np.arange(max(plain.row - step, 0), plain.row)
        closer = fit_linearly(case, np.union1d(rows, between))
        again = (
            None
            if closer is None
            else find_course_mistake(closer, np.ones(len(closer.rows)), len(case.campaign.targets))
        )
        plain = again or plain
    if fault is None:
        return None if plain is None else _of_course(plain, explanation, fit)
    if fault.id in ("duplicate-poses", "rows-shuffled"):
        return _of_rows(fault, case)
    numbers = 3.0 * len(fit.rows)
    columns = 3 * int((without == 0.0).sum())
    by_rows = gain(fit, fit.objective(weight), fit.objective(without), columns, numbers)
    if plain is not None and plain.gain > by_rows:
        return _of_course(plain, explanation, fit)
    return _of_rows(fault, case)


def _followed(case: Case) -> Case:
    """With the motion of its reference points taken out, where that does not make it worse."""
    if not case.campaign.reference_points:
        return case
    followed = replace(case, campaign=compensate_drift(case.campaign).campaign)
    return followed if held_out_error(followed) <= 1.1 * held_out_error(case) else case


def _of_rows(fault: RowFault, case: Case) -> Local:
    campaign = case.campaign
    ids = tuple(campaign.ids[i] for i in fault.rows)
    shown = ", ".join(ids[:12]) + (f", … ({len(ids)} rows)" if len(ids) > 12 else "")
    names = tuple(campaign.targets[t] for t in fault.targets)
    fixes = {
        "target-swapped": f"exchange {' and '.join(names)} in the rows with id {shown}",
        "gross-rows": f"correct the rows with id {shown}, or leave them out",
        "duplicate-poses": f"the rows with id {shown} have the same joints as others, but other points: correct or leave them out",
        "rows-shuffled": f"the points of the rows with id {shown} belong to each other's joints: pair them again",
    }
    confidence = float(np.clip(1.0 - fault.after / max(fault.before, 1e-9), 0.0, 0.99))
    finding = Finding(
        id=fault.id,
        subject=names or ids,
        error_before=fault.before,
        error_after=fault.after,
        confidence=confidence,
        fix=fixes[fault.id],
    )
    return finding, fault.mended


def _of_course(mistake: CourseMistake, explanation: Explanation, fit: LinearFit) -> Local:
    campaign = explanation.case.campaign
    subject: tuple[str, ...] = ()
    mended = campaign
    if mistake.id == "drift":
        fix = (
            f"tracker or base moved by about {mistake.move * 1e3:.1f} mm from the first row to the last: measure again, with "
            "fixed reference points beside each pose, which are followed"
        )
    elif mistake.id == "station-moved":
        subject, fix = (campaign.ids[mistake.row],), _moved_fix(campaign, mistake.row, mistake.move)
        turn = se3.exp(mistake.motion[3:]).T
        back = se3.pose(turn, fit.centre - turn @ (fit.centre + mistake.motion[:3]))
        mended = _brought_back(campaign, mistake.row, back)
    else:
        subject = tuple(campaign.targets[t] for t in mistake.targets)
        row = campaign.row(mistake.row)
        slipped = f"{', '.join(subject)} slipped by {mistake.move * 1e3:.1f} mm on the robot"
        other = "give it another name from there on, or identify" if campaign.rotations is None else "identify"
        fix = (
            f"{slipped} before {row}: {other} the rows before and after by themselves: {_parts(campaign, mistake.row)}"
        )
        mended = _apart(campaign, mistake)
    finding = Finding(
        id=mistake.id,
        subject=subject,
        error_before=mistake.before,
        error_after=mistake.after,
        confidence=mistake.confidence,
        fix=fix,
    )
    return finding, mended


def find_large_move(case: Case) -> Local | None:
    """A move of the tracker or the base between two rows that is too large to be linear, and the campaign without it.

    The rows before and after every cut are registered by themselves; the frame of one is brought to that of the other.
    """
    T = case.poses(np.arange(len(case.campaign)))
    usable = np.flatnonzero(np.isfinite(T[:, 0, 3]) & case.campaign.seen)
    least = max(LEAST_PART, rows_to_register(case.campaign))
    places = np.arange(least, len(usable) - least + 1)
    if not len(places):
        return None
    tried: dict[int, tuple[float, Registration, Registration] | None] = {}
    stride = max(1, len(places) // LARGE_CUTS)
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
    if not after < before * np.exp(-2.0 * PER_MISTAKE):
        return None
    finding = Finding(
        id="station-moved",
        subject=(case.campaign.ids[row],),
        error_before=before,
        error_after=after,
        confidence=float(np.clip(1.0 - after / before, 0.0, 0.99)),
        fix=_moved_fix(case.campaign, row, move),
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
        try:
            registrations.append(register_closely(part, T[rows]))
        except (CampaignError, np.linalg.LinAlgError):
            return None
        ends = ((registrations[-1].T_tracker_base @ T[rows])[:, None] @ registrations[-1].T_tool_target)[..., :3, 3]
        distances.append(np.nanmedian(np.linalg.norm(part.points - ends, axis=2), axis=1))
    return typical(np.concatenate(distances)), registrations[0], registrations[1]


def _brought_back(campaign: Campaign, row: int, back: np.ndarray) -> Campaign:
    """The campaign with what was measured from a row on brought to the frame of the rows before."""
    points, rotations = campaign.points.copy(), campaign.rotations
    points[row:] = points[row:] @ back[:3, :3].T + back[:3, 3]
    if rotations is not None:
        rotations = np.concatenate([rotations[:row], back[:3, :3] @ rotations[row:]])
    return replace(campaign, points=points, rotations=rotations)


def _moved_fix(campaign: Campaign, row: int, move: float) -> str:
    return (
        f"tracker or base moved by about {move * 1e3:.1f} mm before {campaign.row(row)}: the rows before and after are two "
        f"campaigns, to be identified by themselves: {_parts(campaign, row)}"
    )


def _parts(campaign: Campaign, row: int) -> str:
    """Options that choose the rows before a row, and those from there on."""
    first, cut, last = (campaign.row_of(number) for number in (0, row, len(campaign) - 1))
    return f"--rows {first}:{cut} and --rows {cut}:{last + 1}"


def _apart(campaign: Campaign, mistake: CourseMistake) -> Campaign:
    """With a target's measurements after a slip as those of another target; of poses, those before it alone."""
    after = np.arange(len(campaign)) >= mistake.row
    if campaign.rotations is not None:
        keep = ~after if after.mean() <= 0.5 else after
        return campaign.take(np.flatnonzero(keep))
    points, names = [campaign.points.copy()], list(campaign.targets)
    uncertainty = None if campaign.uncertainty is None else [campaign.uncertainty]
    for t in mistake.targets:
        moved = np.where(after[:, None], campaign.points[:, t], np.nan)
        points[0][after, t] = np.nan
        points.append(moved[:, None])
        names.append(f"{campaign.targets[t]}_slipped")
        if uncertainty is not None and campaign.uncertainty is not None:
            uncertainty.append(campaign.uncertainty[:, t : t + 1])
    return replace(
        campaign,
        targets=tuple(names),
        points=np.concatenate(points, axis=1),
        uncertainty=None if uncertainty is None else np.concatenate(uncertainty, axis=1),
    )
