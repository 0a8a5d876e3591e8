"""What is wrong with a campaign."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from taskcal.arguments import expect_kinds
from taskcal.diagnosis.course_mistakes import CourseMistake, find_course_mistake, gain
from taskcal.diagnosis.finding import Finding
from taskcal.diagnosis.linear_fit import LinearFit, fit_linearly
from taskcal.diagnosis.quick_fit import LEVER_SHARE, misfits
from taskcal.diagnosis.row_faults import RowFault, find_row_fault, find_swapped
from taskcal.diagnosis.search import Explanation, explain_misfit, held_out_error, spread_rows
from taskcal.diagnosis.spread import find_narrowness
from taskcal.diagnosis.supposition import Case
from taskcal.estimation.blas import single_threaded
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.drift import compensate_drift
from taskcal.measurement.registration import PLAUSIBLE_SHARE
from taskcal.robot.robot import Robot
from taskcal.short_repr import short_repr

AT_CHANCE = 0.7
"""Of the error of points that were given out at random: rows with as much have nothing to do with each other."""

ALTERNATIVES = 0.6
"""Logarithm of how much worse an explanation may be that is told beside the best."""

MOST_ALTERNATIVES = 2

SHARPNESS = 3.0
"""How fast an explanation's share falls with the logarithm of its error; chosen, not calibrated against right answers."""

IN_COURSE_SHARE = 0.1
"""Of the reach: with more left than this, nothing that happened in a campaign's course is told."""

LOCAL_ROWS = 240
"""Rows on which slips, drifts and gross errors are looked for; a longer campaign is looked at in every second row, or third."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Diagnosis:
    """What was found, and the campaign without it."""

    findings: tuple[Finding, ...]
    """The best first; empty for a sound campaign."""
    robot: Robot
    """The campaign's robot, as it seems."""
    campaign: Campaign
    """Mended, as far as a campaign can be."""
    unmended: tuple[str, ...]
    """Ids of the findings that no file can mend."""


@single_threaded
def diagnose(campaign: Campaign, robot: Robot) -> Diagnosis:
    """Find the mistakes of a campaign: what is written wrong, and what went wrong in its course.

    Every usual mistake of joints, frames, rows and robot is undone, singly and in pairs; half of the rows register the nominal
    robot, the other half say how far off it is, by the median. A mistake is believed where undoing it lowers that by a factor of
    2.2 at least. Then slips, drifts and gross rows are looked for with the geometry's tolerances free.

    The confidence of a written mistake is its share among all explanations tried, each weighted with the inverse cube of its
    error (its mistakes paid for), so that two explanations that fit alike have one half each; that of slips and drifts grows
    with the gain of the likelihood, 0.63 at the least one believed, that of rows with their distance.

    Args:
        campaign: the measurements; it may lie outside the robot's limits.
        robot: the robot that is said to have been measured.
    """
    expect_kinds({"campaign": Campaign, "robot": Robot}, campaign=campaign, robot=robot)
    case = Case.of(robot, campaign)
    found = explain_misfit(case)
    given = next(e for e in found if not e.mistakes)
    best, local = _chosen(found, given)
    if not best.error <= PLAUSIBLE_SHARE * best.case.model.robot.reach and local is None:
        return _unexplained(case, given, best)
    findings = list(_written(found, best, given))
    mended, unmended = best.case.campaign, []
    if local is not None:
        finding, mended = local
        findings.append(finding)
        unmended += [finding.id] if finding.id == "drift" else []
    if not best.mistakes or local is None:
        for lack in find_narrowness(best.case):
            confidence = float(np.clip(1.0 - 0.5 * lack.share, 0.0, 0.99))
            findings.append(
                Finding(
                    id=lack.id,
                    subject=(),
                    error_before=given.error,
                    error_after=best.error,
                    confidence=confidence,
                    fix=lack.said,
                )
            )
            unmended.append(lack.id)
    if not best.mistakes or local is None:
        findings += _alternatives(found, best, given)
    return Diagnosis(findings=tuple(findings), robot=best.case.robot, campaign=mended, unmended=tuple(unmended))


Local = tuple[Finding, Campaign]


def _chosen(found: list[Explanation], given: Explanation) -> tuple[Explanation, Local | None]:
    """The best explanation, and what went wrong in its course; the campaign as it is, if that alone explains as much."""
    best = found[0]
    if best is given:
        return given, _local(given)
    if given.error < 0.2 * given.case.model.robot.reach:
        local = _local(given)
        if local is not None and held_out_error(replace(given.case, campaign=local[1])) < 1.5 * best.error:
            return given, local
    return best, _local(best)


def _local(explanation: Explanation) -> Local | None:
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
        fix = (
            f"{', '.join(names)} moved on the tool by {mistake.move * 1e3:.1f} mm before {row}: take it for another target from "
            "there on"
        )
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


def _key(explanation: Explanation) -> frozenset[tuple[str, tuple[str, ...]]]:
    return frozenset((s.id, s.subject) for s in explanation.mistakes)


def _written(found: list[Explanation], best: Explanation, given: Explanation) -> list[Finding]:
    """The mistakes of the best explanation, each with its share among all."""
    return [
        Finding(
            id=mistake.id,
            subject=mistake.subject,
            error_before=min(given.error, _extent(given.case)),
            error_after=best.error,
            confidence=_share(found, best, (mistake.id, mistake.subject)),
            fix=mistake.fix,
        )
        for mistake in best.mistakes
    ]


def _share(found: list[Explanation], best: Explanation, mistake: tuple[str, tuple[str, ...]]) -> float:
    weights = {_key(e): float(np.exp(SHARPNESS * (best.rank - e.rank))) for e in reversed(found)}
    total = sum(weights.values())
    with_it = sum(weight for key, weight in weights.items() if mistake in key)
    return float(min(with_it / total, 0.99))


def _alternatives(found: list[Explanation], best: Explanation, given: Explanation) -> list[Finding]:
    """Other explanations that fit nearly as well."""
    out: list[Finding] = []
    known = set(_key(best))
    for other in found:
        if other is best or not other.mistakes or not best.mistakes or other.rank > best.rank + ALTERNATIVES:
            continue
        for finding in _written(found, other, given):
            finding = replace(finding, confidence=min(_share(found, best, (finding.id, finding.subject)), 0.49))
            if (finding.id, finding.subject) not in known and len(out) < MOST_ALTERNATIVES:
                known.add((finding.id, finding.subject))
                out.append(finding)
    return sorted(out, key=lambda f: -f.confidence)


def _extent(case: Case) -> float:
    """Median distance of the points from their middle: what is off without any robot, metres."""
    points = case.campaign.points
    return float(np.nanmedian(np.linalg.norm(points - np.nanmedian(points, axis=0), axis=2)))


def _unexplained(case: Case, given: Explanation, best: Explanation) -> Diagnosis:
    """Nothing that was tried fits: rows that have nothing to do with each other, or a robot that is not known."""
    before = min(given.error, _extent(case))
    shuffled = _error_at(case, None) > AT_CHANCE * _error_at(case, np.random.default_rng(0))
    if shuffled:
        name, fix = (
            "rows-shuffled",
            (
                "joints and points have no more to do with each other than rows drawn by lot: pair them again, by name or time"
            ),
        )
    else:
        name, fix = (
            "other-robot",
            (
                f"neither {case.robot.name} nor a robot of the catalogue fits, with any usual mistake undone: check the lengths "
                "in the robot file, or give the robot that was measured"
            ),
        )
    finding = Finding(
        id=name, subject=(), error_before=before, error_after=min(best.error, before), confidence=0.5, fix=fix
    )
    return Diagnosis(findings=(finding,), robot=case.robot, campaign=case.campaign, unmended=(name,))


def _error_at(case: Case, rng: np.random.Generator | None) -> float:
    """Of the quick fit as given, or the median of rows that are paired by lot, metres."""
    rows = spread_rows(len(case.campaign), 60)
    T, campaign = case.poses(rows), case.campaign.take(rows)
    orders = [np.arange(len(rows))] if rng is None else [rng.permutation(len(rows)) for _ in range(15)]
    points: Float[np.ndarray, "h n t 3"] = np.stack([campaign.points[order] for order in orders])
    poses = np.broadcast_to(T, (len(orders), *T.shape))
    return float(np.median(misfits(poses, points, None, LEVER_SHARE * case.model.robot.reach)))
