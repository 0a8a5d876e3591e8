"""What went wrong in a campaign's course, as a finding, and the campaign without it."""

from dataclasses import replace

import numpy as np

from taskcal.diagnosis.course_mistakes import CourseMistake, find_course_mistake, gain
from taskcal.diagnosis.finding import Finding
from taskcal.diagnosis.linear_fit import LinearFit, fit_linearly
from taskcal.diagnosis.row_faults import RowFault, find_row_fault, find_swapped
from taskcal.diagnosis.search import Explanation, held_out_error
from taskcal.diagnosis.supposition import Case
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.drift import compensate_drift

IN_COURSE_SHARE = 0.1
"""Of the reach: with more left than this, nothing that happened in a campaign's course is told."""

LOCAL_ROWS = 240
"""Rows on which slips, drifts and gross errors are looked for; a longer campaign is looked at in every second row, or third."""

Local = tuple[Finding, Campaign]


def find_in_course(explanation: Explanation) -> Local | None:
    """The one thing that most likely went wrong in its course, if anything did, and the campaign without it."""
    case = _followed(explanation.case)
    swapped = find_swapped(case)
    if swapped is not None:
        return _of_rows(swapped, case)
    step = max(1, int(np.ceil(len(case.campaign) / LOCAL_ROWS)))
    fit = fit_linearly(case, np.arange(0, len(case.campaign), step))
    if fit is None or fit.median > IN_COURSE_SHARE * case.model.robot.reach:
        return None
    fault = find_row_fault(case, fit)
    weight = np.ones(len(fit.rows))
    without = weight if fault is None else (~np.isin(fit.rows, fault.rows)).astype(float)
    plain = find_course_mistake(fit, weight, len(case.campaign.targets))
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
    if mistake.id == "drift":
        fix = (
            f"tracker or base moved by about {mistake.move * 1e3:.1f} mm from the first row to the last: measure again, with "
            "fixed reference points beside each pose, which are followed"
        )
        subject, mended, after = (), campaign, fit.median
    else:
        names = tuple(campaign.targets[t] for t in mistake.targets)
        row = campaign.row(mistake.row)
        slipped = f"{', '.join(names)} slipped by {mistake.move * 1e3:.1f} mm on the robot"
        fix = f"{slipped} before {row}: give it another name from there on"
        subject = names
        mended = _apart(campaign, mistake)
        after = held_out_error(replace(explanation.case, campaign=mended))
    finding = Finding(
        id=mistake.id,
        subject=subject,
        error_before=explanation.error,
        error_after=after,
        confidence=mistake.confidence,
        fix=fix,
    )
    return finding, mended


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
