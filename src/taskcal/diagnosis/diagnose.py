"""What is wrong with a campaign."""

from dataclasses import dataclass, replace

import numpy as np

from taskcal.arguments import expect_kinds
from taskcal.diagnosis.finding import Finding
from taskcal.diagnosis.in_course import Local, find_in_course, find_large_move
from taskcal.diagnosis.observed_mistakes import explain_observed, scope_of
from taskcal.diagnosis.search import (
    LEAST_ROWS,
    PER_MISTAKE,
    Explanation,
    Progress,
    explain_in_pairs,
    explain_singly,
    has_no_unit,
    held_out_distances,
    is_sound,
    rows_to_register,
    typical,
    untold,
)
from taskcal.diagnosis.spread import find_narrowness
from taskcal.diagnosis.supposition import Case
from taskcal.diagnosis.unexplained import at_chance, extent, find_other_order, find_what_is_left
from taskcal.errors import CampaignError
from taskcal.estimation.blas import single_threaded
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.enough_rows import check_rows
from taskcal.measurement.registration import PLAUSIBLE_SHARE
from taskcal.robot.robot import Robot
from taskcal.short_repr import short_repr

ALTERNATIVES = 0.6
"""Logarithm of how much worse an explanation may be that is told beside the best."""

MOST_ALTERNATIVES = 2

SHARPNESS = 3.0
"""How fast an explanation's share falls with the logarithm of its error; chosen, not calibrated against right answers."""

UNEXPLAINED_SHARE = 0.1
"""Of the reach, at which a row that is left out counts."""

IN_NO_FILE = ("drift", "station-moved")
"""What happened in the course of a campaign, and no other file mends."""


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
    scope: str = ""
    """What was examined and what was not, where that is not everything."""


@single_threaded
def diagnose(campaign: Campaign, robot: Robot, *, progress: Progress = untold) -> Diagnosis:
    """Find the mistakes of a campaign: what is written wrong, and what went wrong in its course.

    Every usual mistake of joints, frames, rows and robot is undone, singly and in pairs; half of the rows register the nominal
    robot, the other half say how far off it is. A mistake is believed where undoing it lowers the geometric mean of that by a
    factor of 2.2 at least. Rows that fit in another order alone are shuffled. Then slips, moves of the tracker, drifts and gross
    rows are looked for with the geometry's tolerances free. What lowers the error by less than a factor of 1.05 is not told,
    and of too few rows nothing but that.

    The confidence of a written mistake is its share among all explanations tried, each weighted with the inverse cube of its
    error (its mistakes paid for), so that two explanations that fit alike have one half each; that of slips and drifts grows
    with the gain of the likelihood, 0.63 at the least one believed, that of rows with their distance.

    Args:
        campaign: the measurements; it may lie outside the robot's limits.
        robot: the robot that is said to have been measured.
        progress: told what is being tried, how many of it were, and how many there are.

    What was observed without a tracker (sockets, wires, landmarks, boards) is examined for mistakes of the joints, and where it
    is sockets alone of the robot: `Diagnosis.scope` says so.
    """
    expect_kinds({"campaign": Campaign, "robot": Robot}, campaign=campaign, robot=robot)
    case = Case.of(robot, campaign)
    if lacking := _too_few(campaign):
        return Diagnosis(
            findings=(lacking,), robot=robot, campaign=campaign, unmended=(lacking.id,), scope=scope_of(campaign)
        )
    if scope := scope_of(campaign):
        return _diagnose_observed(case, scope, progress)
    found = explain_singly(case, progress)
    given = next(e for e in found if not e.mistakes)
    before = min(given.error, extent(case))
    if not is_sound(found[0]) or (found[0] is given and has_no_unit(case)):
        moved = _moved(found, given, before)
        if moved is not None:
            return moved
        reordered = find_other_order(case, before) if at_chance(case) else None
        if reordered is not None:
            return Diagnosis(findings=tuple(reordered[0]), robot=robot, campaign=reordered[1], unmended=())
        found = explain_in_pairs(case, progress)
        given = next(e for e in found if not e.mistakes)
    best, local = _chosen(found, given)
    if not best.error <= PLAUSIBLE_SHARE * best.case.model.robot.reach and local is None:
        reordered = find_other_order(case, before)
        if reordered is not None:
            return Diagnosis(findings=tuple(reordered[0]), robot=robot, campaign=reordered[1], unmended=())
        left = find_what_is_left(case, before)
        return Diagnosis(findings=(left,), robot=robot, campaign=campaign, unmended=(left.id,))
    findings = list(_written(found, best, given, before))
    mended, unmended = best.case.campaign, []
    if local is not None:
        finding, without = local
        findings.append(finding)
        if finding.id in IN_NO_FILE:
            unmended.append(finding.id)
        else:
            mended = without
    if not best.mistakes or local is None:
        lacking = _lacking(best, given)
        findings += lacking
        unmended += [finding.id for finding in lacking]
        findings += _alternatives(found, best, given, before)
    return Diagnosis(findings=tuple(findings), robot=best.case.robot, campaign=mended, unmended=tuple(unmended))


def _too_few(campaign: Campaign) -> Finding | None:
    """The only finding where no half of the rows can be judged by the other."""
    fix = ""
    if campaign.observations:
        try:
            check_rows(campaign)
        except CampaignError as refusal:
            fix = str(refusal)
    else:
        seen, least = int(campaign.seen.sum()), max(LEAST_ROWS, 2 * rows_to_register(campaign))
        if seen < least:
            fix = (
                f"{seen} measured rows are too few to look for mistakes: one half of them registers the robot, the other half "
                f"judges it; measure at least {least} poses, better 30 or more"
            )
    if not fix:
        return None
    return Finding(id="too-few-rows", subject=(), error_before=None, error_after=None, confidence=0.99, fix=fix)


def _moved(found: list[Explanation], given: Explanation, before: float) -> Diagnosis | None:
    """The diagnosis, if the tracker or the base made a large move, beside a mistake that holds for all rows or none."""
    for best in dict.fromkeys((found[0], given)):
        local = find_large_move(best.case)
        if local is not None:
            finding = local[0]
            assert finding.error_after is not None
            rest = replace(best, error=finding.error_after)
            findings = (*_written(found, rest, given, before), finding)
            return Diagnosis(
                findings=findings, robot=best.case.robot, campaign=best.case.campaign, unmended=(finding.id,)
            )
    return None


def _diagnose_observed(case: Case, scope: str, progress: Progress) -> Diagnosis:
    """By the joints, and the robot where that is quick."""
    found = explain_observed(case, progress)
    best, given = found[0], next(e for e in found if not e.mistakes)
    reach = best.case.model.robot.reach
    if best.error <= PLAUSIBLE_SHARE * reach:
        findings = (*_written(found, best, given, given.error), *_alternatives(found, best, given, given.error))
        return Diagnosis(
            findings=findings, robot=best.case.robot, campaign=best.case.campaign, unmended=(), scope=scope
        )
    left = Finding(
        id="other-robot",
        subject=(),
        error_before=given.error,
        error_after=None,
        confidence=0.5,
        fix=f"{case.robot.name} does not fit what was observed, whatever is examined: check which socket, anchor or landmark each "
        "row names, the order of the rows, and the lengths in the robot file",
    )
    return Diagnosis(findings=(left,), robot=case.robot, campaign=case.campaign, unmended=(left.id,), scope=scope)


def _lacking(best: Explanation, given: Explanation) -> list[Finding]:
    """What its poses cannot say."""
    return [
        Finding(
            id=lack.id,
            subject=(),
            error_before=given.error,
            error_after=None,
            confidence=float(np.clip(1.0 - 0.5 * lack.share, 0.0, 0.99)),
            fix=lack.said,
        )
        for lack in find_narrowness(best.case)
    ]


def _chosen(found: list[Explanation], given: Explanation) -> tuple[Explanation, Local | None]:
    """The best explanation, and what went wrong in its course; the campaign as it is, if that alone explains as much."""
    best = found[0]
    if best is given:
        return given, find_in_course(given)
    if given.error < 0.2 * given.case.model.robot.reach:
        local = find_in_course(given)
        if local is not None and _rank_without(*local, given.case) < best.rank:
            return given, local
    return best, find_in_course(best)


def _rank_without(finding: Finding, mended: Campaign, case: Case) -> float:
    """As `Explanation.rank` of what went wrong in the course.

    Rows that are left out are not explained, and which row belongs to which has to be said for each of them.
    """
    rows, kept = len(case.campaign), len(mended) / len(case.campaign)
    level = typical(held_out_distances(replace(case, campaign=mended)))
    unexplained = np.log(UNEXPLAINED_SHARE * case.model.robot.reach)
    # a distance in space has three numbers, each of whose likelihood falls as it grows
    pairing = len(finding.subject) * np.log(rows) / (3.0 * rows) if finding.id == "rows-shuffled" else 0.0
    return float(kept * np.log(level) + (1.0 - kept) * unexplained + pairing) + PER_MISTAKE


def _key(explanation: Explanation) -> frozenset[tuple[str, tuple[str, ...]]]:
    return frozenset((s.id, s.subject) for s in explanation.mistakes)


def _written(found: list[Explanation], best: Explanation, given: Explanation, before: float) -> list[Finding]:
    """The mistakes of the best explanation, each with its share among all; the error before in the unit that is right."""
    before *= float(np.prod([mistake.size for mistake in best.mistakes]))
    return [
        Finding(
            id=mistake.id,
            subject=mistake.subject,
            error_before=before,
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


def _alternatives(found: list[Explanation], best: Explanation, given: Explanation, before: float) -> list[Finding]:
    """Other explanations that fit nearly as well."""
    out: list[Finding] = []
    known = set(_key(best))
    for other in found:
        if other is best or not other.mistakes or not best.mistakes:
            continue
        if other.rank > min(best.rank + ALTERNATIVES, given.rank):
            continue
        for finding in _written(found, other, given, before):
            finding = replace(finding, confidence=min(_share(found, best, (finding.id, finding.subject)), 0.49))
            if (finding.id, finding.subject) not in known and len(out) < MOST_ALTERNATIVES:
                known.add((finding.id, finding.subject))
                out.append(finding)
    return sorted(out, key=lambda f: -f.confidence)
