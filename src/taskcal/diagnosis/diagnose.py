"""Diagnosis of a campaign."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from taskcal.arguments import checked
from taskcal.campaigns.campaign import Campaign, Stations, check_rows, name_moving
from taskcal.diagnosis.drift import find_drift_or_slip, find_large_move
from taskcal.diagnosis.fits import LEVER_SHARE, MIN_ERROR_M, fitted_distances, misfits, registered
from taskcal.diagnosis.hypotheses import MISTAKES as MISTAKES
from taskcal.diagnosis.hypotheses import Case, Finding, Hypothesis, hypotheses_of, looked_for
from taskcal.diagnosis.images import (
    NOT_MENDED_OF_IMAGES,
    NOT_TOLD_BESIDE_FOCUS,
    NOT_TOLD_OF_IMAGES,
    SeenPoses,
)
from taskcal.diagnosis.mistakes import (
    MAX_SCATTER_RATIO,
    common_shift,
    find_wrong_rotations,
    scale_mistakes,
    scaled,
    shift_fix,
    unit_mistakes,
)
from taskcal.diagnosis.rows import Local, Pairing, pair_rows
from taskcal.diagnosis.search import (
    MAX_HELD_OUT_ROWS,
    MAX_TRIED_ROWS,
    MIN_CLOSED_SHARE,
    MIN_JUDGED_ROWS,
    MISTAKE_CHARGE,
    SOUND_SHARE,
    Candidate,
    Progress,
    explain_in_pairs,
    explain_singly,
    has_no_unit,
    held_out_distances,
    is_sound,
    limits_charge,
    rows_to_register,
    silent,
    spread_rows,
    typical,
    undone,
)
from taskcal.errors import CampaignError, TaskcalError, UnitError
from taskcal.estimation.matrices import single_threaded
from taskcal.estimation.ordered_rows import MIN_FACTOR
from taskcal.identification.checks.checks import IN_BASE_SHARE, is_calculated
from taskcal.identification.identify import identify
from taskcal.observations import pictures_of
from taskcal.registration.length_scale import find_length_scale
from taskcal.registration.plausibility import is_in_base, refuse_calculated
from taskcal.registration.registration import PLAUSIBLE_SHARE, register_observations
from taskcal.robot.robot import Robot
from taskcal.short_repr import short_repr

# Whether a campaign's poses are spread enough to tell frames and targets apart.

MIN_SPREAD_SHARE = 0.03
"""Of the reach, standard deviation of the positions along their longest direction: that of a box with edges of a tenth of the
reach, smaller than what campaigns span. What is measured within less is right for a task there, and says little of the robot
elsewhere."""

MIN_TURN = 0.005
"""1 − cos² of the spread of orientations, 4° about each axis: within less a target's place is uncertain by ten times the error of
a measured point."""


def spread_said(case: Case) -> str:
    """How little the positions spread, in words; empty where they span what campaigns do."""
    p = case.usable()[1][:, :3, 3]
    spread = float(np.linalg.svd(p - p.mean(axis=0), compute_uv=False)[0] / np.sqrt(len(p))) if len(p) else 0.0
    if spread >= MIN_SPREAD_SHARE * case.reach:
        return ""
    return (
        f"the positions spread by {spread * 1e3:.0f} mm (1σ): enough for a task in this place; for one that is larger, measure "
        "over its whole workspace"
    )


@looked_for("poses", "few-orientations", measured_anew=True)
def find_narrowness(case: Case, error: float) -> Finding | None:
    """Finding on orientations that hardly differ, with the error as given, metres."""
    T = case.usable()[1]
    if len(T) < 2 or not _can_turn(case):
        return None
    R = T[:, :3, :3].mean(axis=0)
    turn = float(np.linalg.eigvalsh(np.eye(3) - R.T @ R)[0])
    if turn >= MIN_TURN:
        return None
    fix = (
        f"about one axis the orientations spread by {np.degrees(np.sqrt(max(turn, 0.0))):.1f}° only: measure poses that turn "
        "the tool by 10° and more about all axes"
    )
    confidence = float(np.clip(1.0 - 0.5 * turn / MIN_TURN, 0.0, 0.99))
    return Finding(
        id="few-orientations", subject=(), error_before=error, error_after=None, confidence=confidence, fix=fix
    )


def _can_turn(case: Case) -> bool:
    """Whether the robot can turn its tool about all axes at all."""
    q = case.campaign.q.mean(axis=0) + np.random.default_rng(0).uniform(-0.5, 0.5, (50, case.campaign.q.shape[1]))
    T = case.model.poses(q) if case.robot.four_bar is None else np.tile(np.eye(4), (1, 1, 1))
    R = T[:, :3, :3].mean(axis=0)
    return case.robot.four_bar is not None or float(np.linalg.eigvalsh(np.eye(3) - R.T @ R)[0]) > MIN_TURN


# Lengths that are all larger or smaller than the robot's by one factor, which is none of units.


@looked_for("poses", "points-scaled")
def find_scale(case: Case) -> tuple[Finding, float] | None:
    """A scale of the points that robots within their tolerances do not have, and its value.

    It is named where the nominal robot fits beside it, and not mended: the robot tells it to some thousandths only, and may be what
    is wrong. A scale by which units may differ is left to them.
    """
    scale = find_length_scale(case.model, case.campaign)
    if scale is None or not scale.named or scale.left > SOUND_SHARE * case.reach:
        return None
    if not 1.0 / MAX_SCATTER_RATIO < scale.value < MAX_SCATTER_RATIO:
        return None
    finding = Finding(
        id="points-scaled",
        subject=(f"{scale.value:.4f}",),
        error_before=None,
        error_after=None,
        confidence=0.99,
        fix=scale.said(),
    )
    return finding, scale.value


# What is told where no usual mistake explains a campaign: rows in another order, or a robot that is not known.

MIN_ALL_SHARE = 0.9
"""Share of the rows from which on they are called all. A convention."""

MIN_CHANCE_RATIO = 0.7
"""Error over that of points given out at random, from which on rows have nothing to do with each other. A convention: related
rows are far below 1, random orders scatter about it."""


def find_other_order(case: Case, before: float) -> tuple[list[Finding], Campaign] | None:
    """The findings, and the campaign in another order of its measurements, if one fits.

    Args:
        case: robot and campaign as given.
        before: error as given, metres.
    """
    units = [*list(scale_mistakes(case))[:1], *unit_mistakes(case)]
    in_units = undone(case, units)
    paired = pair_rows(in_units)
    if paired is None:
        return None
    before *= extent(in_units) / extent(case)
    confidence = float(np.clip(1.0 - paired.error / paired.next_best, 0.0, 0.99))
    findings = [
        Finding(
            id=mistake.id,
            subject=mistake.subject,
            error_before=before,
            error_after=paired.error,
            confidence=confidence,
            fix=mistake.fix,
        )
        for mistake in [*units, *([_order(case, paired)] if len(paired.moved) else [])]
    ]
    return findings, paired.mended


def find_what_is_left(case: Case, before: float) -> Finding:
    """The finding of last resort, which nothing mends.

    Args:
        case: robot and campaign as given.
        before: error as given, metres.
    """
    if at_chance(case):
        name = "rows-shuffled"
        fix = "joints and points are unrelated, and no order of the rows matches them: pair them again, by name or time"
    else:
        name = "other-robot"
        fix = (
            f"neither {case.robot.name} nor a robot of the catalogue fits, with any usual mistake undone: check the lengths in "
            "the robot file, or give the robot that was measured"
        )
    return Finding(id=name, subject=(), error_before=before, error_after=None, confidence=0.5, fix=fix)


def at_chance(case: Case) -> bool:
    """Whether the rows fit no better than rows that are paired by lot."""
    return _error_at(case, None) > MIN_CHANCE_RATIO * _error_at(case, np.random.default_rng(0))


def _order(case: Case, paired: Pairing) -> Hypothesis:
    by = common_shift(paired.source)
    if by is not None:
        return Hypothesis(id="rows-shifted", subject=(f"{by:+d}",), fix=shift_fix(by))
    rows = paired.moved
    fix = (
        f"the measurements of {len(rows)} rows stand beside the joints of other rows: pair them again by name or time, or take "
        "the order of --fix, the only one that fits"
    )
    return Hypothesis(id="rows-shuffled", subject=_names(case, rows), fix=fix)


def extent(case: Case) -> float:
    """Median distance of the points from their middle: what is off without any robot, metres."""
    points = case.campaign.points
    return float(np.nanmedian(np.linalg.norm(points - np.nanmedian(points, axis=0), axis=2)))


def _names(case: Case, rows: np.ndarray) -> tuple[str, ...]:
    """Ids of some rows; none where they are all."""
    return () if len(rows) > MIN_ALL_SHARE * len(case.campaign) else tuple(case.campaign.ids[i] for i in rows)


def _error_at(case: Case, rng: np.random.Generator | None) -> float:
    """Error of the quick fit as given, or the median error of rows paired at random, metres."""
    rows = spread_rows(len(case.campaign), 60)
    T, campaign = case.poses(rows), case.campaign.take(rows)
    orders = [np.arange(len(rows))] if rng is None else [rng.permutation(len(rows)) for _ in range(15)]
    points: Float[np.ndarray, "h n t 3"] = np.stack([campaign.points[order] for order in orders])
    poses = np.broadcast_to(T, (len(orders), *T.shape))
    return float(np.median(misfits(poses, points, None, LEVER_SHARE * case.reach)))


# Mistakes of joints and robot in what was observed without a tracker: sockets, wires, landmarks, boards.

MAX_CONTINUED = 4
"""Single mistakes, at most, beside which a second is looked for. A convention: more cost time in proportion."""


MIN_ROWS_OF_A_THING = 12
"""Rows of one thing, at least, to find it without a guess: a wire's anchor needs as many (`observations.distance`)."""


def scope_of(campaign: Campaign) -> str:
    """Scope of the diagnosis of a campaign without a tracker, in words; empty for one that a tracker measured."""
    kinds = dict.fromkeys(one.key for one in campaign.observations if not one.in_tracker)
    if not kinds:
        return ""
    if (kind := pictures_of(campaign.observations)) is not None:
        pairs, counts = np.unique(kind.sightings[1:3], axis=1, return_counts=True)
        camera, board = pairs[:, np.argmax(counts)]
        one = "the board" if len(kind.boards) == 1 else f"board {kind.boards[board]}"
        of = "them" if len(kind.cameras) == 1 else f"those of {kind.cameras[camera]}"
        return f"images are examined by the poses of {one} in {of}; other boards and cameras for moves, size and focus alone"
    if _is_quick(campaign):
        examined, left = "the joints (units, signs, zeros, couplings, order) and the robot, in pairs too", "frames"
    else:
        examined, left = (
            "units, signs and zeros of the joints, one at a time",
            "couplings and order of the joints, the robot, frames",
        )
    return (
        f"observed without a tracker ({', '.join(kinds)}), it is examined for mistakes of {examined}; {left}, the order of rows, "
        "slips, drift and single rows are not"
    )


def _is_quick(campaign: Campaign) -> bool:
    return all(one.quick for one in campaign.observations)


def explain_observed(case: Case, progress: Progress = silent) -> list[Candidate]:
    """Explanations by one mistake of joints or robot, and by two where one is not enough, the best first.

    Each is ranked by how far the registered nominal robot misses the observations, over how far it moved: joints that are too
    small leave little to miss.
    """
    quick, joints = _is_quick(case.campaign), list(hypotheses_of(case, "joints"))
    often = [one for one in joints if MISTAKES[one.id].without_tracker]
    hypotheses = [*joints, *hypotheses_of(case, "robot")] if quick else often
    found = _ranked(case, [(), *((s,) for s in hypotheses)], progress)
    if is_sound(found[0]) or not quick:
        return found
    pairs = [
        (*e.mistakes, s)
        for e in found[:MAX_CONTINUED]
        for s in hypotheses
        if e.mistakes and _together(e.mistakes[0], s)
    ]
    return sorted([*found, *_ranked(case, pairs, progress)], key=lambda e: e.rank)


def _together(a: Hypothesis, b: Hypothesis) -> bool:
    return (a.id, a.subject) != (b.id, b.subject) and (a.robot is None or b.robot is None)


def _ranked(case: Case, combinations: Sequence[Sequence[Hypothesis]], progress: Progress) -> list[Candidate]:
    out: list[Candidate] = []
    for number, combination in enumerate(combinations):
        progress(f"mistakes, {max(map(len, combinations))} at a time", number, len(combinations))
        out.append(_explanation(case, tuple(combination)))
    return sorted(out, key=lambda e: e.rank)


def _explanation(case: Case, mistakes: tuple[Hypothesis, ...]) -> Candidate:
    # the robot first: joints are undone for whichever it is
    case = undone(case, sorted(mistakes, key=lambda s: s.robot is None))
    error, moved = _error(case, as_given=not mistakes)
    cost = sum(MISTAKE_CHARGE + s.cost for s in mistakes) + limits_charge(case)
    level = max(error, MIN_ERROR_M) / max(moved, MIN_ERROR_M)
    return Candidate(mistakes=mistakes, case=case, error=error, rank=float(np.log(level)) + cost)


def tried_rows(campaign: Campaign) -> Int[np.ndarray, " k"]:
    """Some of the rows, evenly spread, and enough of every anchor, landmark, plane … to find it."""
    rows = spread_rows(len(campaign), MAX_TRIED_ROWS)
    parts = [rows]
    for kind in campaign.observations:
        if kind.of is not None and not kind.quick:
            for k in range(int(kind.of.max()) + 1):
                own = np.flatnonzero(kind.of == k)
                if (kind.of[rows] == k).sum() < MIN_ROWS_OF_A_THING:
                    parts.append(own[spread_rows(len(own), MIN_ROWS_OF_A_THING)])
    return np.unique(np.concatenate(parts))


def _error(case: Case, *, as_given: bool) -> tuple[float, float]:
    """Median distance of the registered nominal robot from what was observed, and how far the tool moved, metres.

    Where it cannot be registered both are the same.

    Raises:
        UnitError: of the campaign as it is given, lengths in another unit.
    """
    tried = tried_rows(case.campaign)
    rows, T = case.usable(tried)
    if len(rows) < MIN_CLOSED_SHARE * len(tried):
        return case.reach, case.reach
    moved = float(np.sqrt(((T[:, :3, 3] - T[:, :3, 3].mean(axis=0)) ** 2).sum(axis=1).mean()))
    try:
        off = register_observations(T, case.campaign.take(rows), case.model)[1]
    except UnitError:
        if as_given:  # nothing can be said of the joints before that is mended
            raise
        return moved, moved
    except (CampaignError, np.linalg.LinAlgError):
        return moved, moved
    return float(np.median(off)), moved


ALTERNATIVE_MARGIN = 0.6
"""Natural logarithm of the error's factor, 1.8, over the best within which an explanation is told as well. A convention: below
the charge of a mistake, above that of three unusual traits."""

MAX_ALTERNATIVES = 2
"""Alternatives, at most, that are told beside the best explanation. A convention: three answers are read."""

CONFIDENCE_POWER = 3.0
"""Power of the error's ratio by which an explanation's share of the confidence falls. A convention, not calibrated; `python -m
tests.diagnosis.shares` counts the right answers by confidence."""

UNEXPLAINED_SHARE = 0.1
"""Distance over the reach that a row left out is charged as. A convention: far above what an explained row is off by."""

MAX_COURSE_SHARE = 0.2
"""Median distance of the campaign as given over the reach, at most, where a slip, move or drift alone may explain it. A
convention: beyond, joints or frames are wrong."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Diagnosis:
    """Findings, and the campaign without the mistakes."""

    findings: tuple[Finding, ...]
    """The best first; empty for a sound campaign."""
    robot: Robot
    """The campaign's robot, as it seems."""
    campaign: Campaign
    """Mended, as far as a campaign can be."""
    unmended: tuple[str, ...]
    """Ids of the findings that no change of the file can fix."""
    scope: str = ""
    """What was examined and what was not, where that is not everything."""
    held_out: tuple[float, float] | None = None
    """Root mean square error of rows held out, the geometry free within its tolerances, as given and mended, metres; infinite where
    they cannot be registered. None where nothing is mended, or no tracker measured."""

    @property
    def mends(self) -> tuple[Finding, ...]:
        """Findings that the mended campaign, or its robot, is without."""
        return tuple(one for one in self.findings if not one.alternative and one.id not in self.unmended)


@checked
@single_threaded
def diagnose(campaign: Campaign, robot: Robot, *, progress: Progress = silent) -> Diagnosis:
    """Find the mistakes of a campaign, in its file and in the course of the measurement.

    Every usual mistake of joints, frames, rows and robot is undone, singly and in pairs; half of the rows register the nominal
    robot, the other half say how far off it is. A mistake is significant where undoing it lowers the geometric mean of that by a
    factor of 2.2 at least, and one of joints or robot where the geometry within its tolerances does not stand in for it. Rows that
    fit in another order alone are shuffled. Then slips, moves of the tracker, drifts and gross rows are looked for with the
    geometry's tolerances free. What lowers the error by less than a factor of 1.05 is not told, nor what mends nothing on rows
    held out, and of too few rows, or of one joint in motion, nothing but that.

    The confidence of a written mistake is its share among all explanations tried, each weighted with the inverse cube of its
    error (its mistakes paid for), so that two explanations that fit alike have one half each; that of slips and drifts grows
    with the gain of the likelihood, 0.63 at the least one significant, that of rows with their distance.

    Args:
        campaign: the measurements; it may lie outside the robot's limits.
        robot: the robot that is said to have been measured.
        progress: told what is being tried, how many of it were, and how many there are.

    What was observed without a tracker (sockets, wires, landmarks, boards) is examined for mistakes of the joints, and where it
    is sockets alone of the robot; beside a tracker's points it is not examined: `Diagnosis.scope` says so. Of several stations each
    is examined by itself.

    Raises:
        CampaignError: a target of a file was calculated, not measured.
    """
    if campaign.stations is not None and len(campaign.stations.names) > 1:
        return _diagnose_stations(campaign, campaign.stations, robot, progress)
    case = Case.of(robot, campaign)
    refuse_calculated(case.model, campaign)
    part = _of_tracker(campaign)
    if part is not None:
        return _diagnose_part(campaign, part, robot, progress)
    if lacking := _too_few(campaign) or _one_joint(campaign, robot):
        return Diagnosis(
            findings=(lacking,), robot=robot, campaign=campaign, unmended=(lacking.id,), scope=scope_of(campaign)
        )
    if scope := scope_of(campaign):
        pictured = pictures_of(campaign.observations) is not None
        return _diagnose_pictured(case, progress) if pictured else _diagnose_observed(case, scope, progress)
    if (calculated := _calculated(case)) is not None:
        return Diagnosis(findings=(calculated,), robot=robot, campaign=campaign, unmended=(calculated.id,))
    if (first := _of_rotations_or_scale(case, progress)) is not None:
        return first
    return _with_held_out(_diagnose_tracked(case, progress), case)


@looked_for("rows", "calculated-points", measured_anew=True)
def _calculated(case: Case) -> Finding | None:
    """The only finding where the controller's own positions were given for measured ones."""
    rows, T = case.usable()
    found = registered(case.campaign.take(rows), T)
    if found is None or not is_in_base(found, IN_BASE_SHARE):
        return None
    try:
        calibration = identify(case.model, case.campaign.take(rows))
    except TaskcalError:
        return None
    if not is_calculated(calibration):
        return None
    fix = (
        f"the nominal robot fits the points in its own base but for {found.rms * 1e3:.2g} mm rms of scatter: these are positions "
        "that the controller or a simulation calculates; give those that an instrument measured"
    )
    return Finding(
        id="calculated-points", subject=(), error_before=found.rms, error_after=None, confidence=0.99, fix=fix
    )


def _with_held_out(found: Diagnosis, case: Case) -> Diagnosis:
    """The diagnosis with what its mended campaign leaves of rows held out; without what lowers nothing there."""
    if not found.mends:
        return found
    mended = Case.of(found.robot, found.campaign)
    before, after = (float(np.sqrt((_fitted_distances(one) ** 2).mean())) for one in (case, mended))
    before *= extent(mended) / extent(case)  # in the unit that is right
    if after < before or not np.isfinite(after):
        return replace(found, held_out=(before, after))
    left = tuple(one for one in found.findings if one.id in found.unmended)
    return replace(found, findings=left, robot=case.robot, campaign=case.campaign)


def _diagnose_tracked(case: Case, progress: Progress) -> Diagnosis:
    """Diagnose what a tracker measured from one place."""
    found = explain_singly(case, progress)
    given = next(e for e in found if not e.mistakes)
    before = min(given.error, extent(case))
    if not is_sound(found[0]) or (found[0] is given and has_no_unit(case)):
        moved = _moved(found, given, before)
        if moved is not None:
            return moved
        reordered = find_other_order(case, before) if at_chance(case) else None
        if reordered is not None:
            return Diagnosis(findings=tuple(reordered[0]), robot=case.robot, campaign=reordered[1], unmended=())
        found = explain_in_pairs(case, progress)
        given = next(e for e in found if not e.mistakes)
    found = _without_needless(found, case)
    best, local = _chosen(found, given)
    if not best.error <= PLAUSIBLE_SHARE * best.case.reach and local is None:
        return _unexplained(case, before, progress)
    findings = list(_written(found, best, given, before))
    mended, unmended = best.case.campaign, []
    if local is not None:
        finding, without = local
        findings.append(finding)
        if MISTAKES[finding.id].measured_anew:
            unmended.append(finding.id)
        else:
            mended = without
    if not best.mistakes or local is None:
        if (lacking := find_narrowness(best.case, given.error)) is not None:
            findings.append(lacking)
            unmended.append(lacking.id)
        findings += _alternatives(found, best, given, before)
    return Diagnosis(
        findings=tuple(findings),
        robot=best.case.robot,
        campaign=mended,
        unmended=tuple(unmended),
        scope=spread_said(best.case),
    )


def _diagnose_stations(campaign: Campaign, stations: Stations, robot: Robot, progress: Progress) -> Diagnosis:
    """Diagnose the rows of each station by themselves, which share no frame; the longest that is not sound has the findings."""
    examined, short, lacking = list[str](), list[str](), None
    for k in np.argsort(-np.array(stations.rows), kind="stable"):
        part = replace(campaign.take(stations.of == k), stations=None)
        part = part.of_targets([name for name, seen in zip(part.targets, part.valid.T, strict=True) if seen.any()])
        if refusal := _too_few(part) or _one_joint(part, robot):
            lacking = lacking or refusal
            short.append(stations.names[k])
            continue
        found = diagnose(part, robot, progress=progress)
        if found.findings:
            ids = tuple(finding.id for finding in found.findings)
            scope = f"the findings are of station '{stations.names[k]}', examined by itself; no file without them is written"
            return replace(found, campaign=campaign, unmended=ids, scope=scope, held_out=None)
        examined.append(stations.names[k])
    left = f"; too little to examine: {', '.join(short)}" if short else ""
    findings = () if examined or lacking is None else (lacking,)
    return Diagnosis(
        findings=findings,
        robot=robot,
        campaign=campaign,
        unmended=tuple(finding.id for finding in findings),
        scope=f"each station is examined by itself: {', '.join(examined) or 'none'}{left}",
    )


def _of_tracker(campaign: Campaign) -> Campaign | None:
    """Targets and rows that a tracker measured, if others were observed beside them; None if they are too few to judge."""
    names = [name for name, one in zip(campaign.targets, campaign.observations, strict=True) if one.in_tracker]
    if not 0 < len(names) < len(campaign.targets):
        return None
    part = campaign.of_targets(names)
    part = part.take(part.seen)
    return None if _too_few(part) else part


def _diagnose_part(whole: Campaign, part: Campaign, robot: Robot, progress: Progress) -> Diagnosis:
    """Diagnose what the tracker measured alone; mended, a campaign has these targets and rows only."""
    found = diagnose(part, robot, progress=progress)
    others = ", ".join(name for name in whole.targets if name not in part.targets)
    mended = bool(found.mends)
    scope = f"only what a tracker measured ({', '.join(part.targets)}) is examined; {others} and the rows without a tracker are not"
    return replace(
        found,
        campaign=found.campaign if mended else whole,
        scope=f"{scope}, and the mended campaign is without them" if mended else scope,
    )


def _diagnose_pictured(case: Case, progress: Progress) -> Diagnosis:
    """Diagnose poses of the board in images as those of a target in a tracker's frame; of several boards that most images show."""
    seen = SeenPoses.of(case)
    found = diagnose(seen.campaign, case.robot, progress=progress)
    sizes = seen.find_size() if _left(found) > SOUND_SHARE * case.reach else None
    if sizes is not None:
        again = diagnose(sizes[1], case.robot, progress=progress)
        if _left(again) < 0.5 * _left(found):
            found = replace(again, findings=(sizes[0], *again.findings))
    focus = seen.find_focus(replace(case, robot=found.robot, campaign=found.campaign))
    findings = [
        seen.tell(one)
        for one in found.findings
        if one.id not in NOT_TOLD_OF_IMAGES
        and not (focus and one.id in NOT_TOLD_BESIDE_FOCUS)
        and not (one.id == "points-scaled" and seen.has_size_stated(case))
    ]
    findings += [] if focus is None else [focus]
    findings += [] if findings else seen.find_in_others()
    lasting = tuple(one.id for one in findings if one.id in (*found.unmended, *NOT_MENDED_OF_IMAGES))
    mended = seen.mended(case, found.campaign) if len(findings) > len(lasting) else case.campaign
    return Diagnosis(
        findings=tuple(findings), robot=found.robot, campaign=mended, unmended=lasting, scope=scope_of(case.campaign)
    )


def _left(found: Diagnosis) -> float:
    """Error that the findings leave, metres; infinite where nothing explains it."""
    if not found.findings:
        return 0.0
    after = found.findings[0].error_after
    return np.inf if after is None else after


@looked_for("rows", "too-few-rows", measured_anew=True)
def _too_few(campaign: Campaign) -> Finding | None:
    """The only finding where no half of the rows can be judged by the other."""
    fix = ""
    if not campaign.tracked:
        try:
            check_rows(campaign)
        except CampaignError as refusal:
            fix = str(refusal)
    else:
        seen, least = int(campaign.seen.sum()), max(MIN_JUDGED_ROWS, 2 * rows_to_register(campaign))
        if seen < least:
            fix = (
                f"{seen} measured rows are too few to look for mistakes: one half of them registers the robot, the other half "
                f"judges it; measure at least {least} poses, better 30 or more"
            )
    if not fix:
        return None
    return Finding(id="too-few-rows", subject=(), error_before=None, error_after=None, confidence=0.99, fix=fix)


@looked_for("rows", "one-joint-moves", measured_anew=True)
def _one_joint(campaign: Campaign, robot: Robot) -> Finding | None:
    """The only finding where one joint moves, or none: any robot fits points on a circle about an axis."""
    names = name_moving(campaign, robot.joint_names)
    if len(names) > 1:
        return None
    fix = (
        f"{f'only {names[0]} moves' if names else 'no joint moves'}: these rows fit any robot in some frame, and say nothing about "
        "this one; measure poses in which at least three joints move, or, if others moved, put their values into the columns"
    )
    return Finding(
        id="one-joint-moves", subject=tuple(names), error_before=None, error_after=None, confidence=0.99, fix=fix
    )


def _moved(found: list[Candidate], given: Candidate, before: float) -> Diagnosis | None:
    """The diagnosis, if the tracker or the base made a large move, beside a mistake that holds for all rows or none."""
    for best in dict.fromkeys((found[0], given)):
        local = find_large_move(best.case)
        if local is not None:
            finding = local[0]
            assert finding.error_after is not None
            rest = replace(best, error=finding.error_after)
            written, brought = _written(found, rest, given, before), replace(best.case, campaign=local[1])
            also = find_drift_or_slip(replace(best, case=brought))
            if also is not None and also[0].id == "two-robots":
                findings, campaign, unmended = (*written, also[0]), best.case.campaign, (also[0].id,)
            else:
                findings, campaign, unmended = (*written, finding), local[1], ()
            return Diagnosis(findings=findings, robot=best.case.robot, campaign=campaign, unmended=unmended)
    return None


def _of_rotations_or_scale(case: Case, progress: Progress) -> Diagnosis | None:
    """The diagnosis, where rotations or the scale of all lengths are wrong and positions tell so; the rest without these."""
    if (turned := find_wrong_rotations(case)) is not None:
        rest = diagnose(turned[1], case.robot, progress=progress)
        return replace(rest, findings=(turned[0], *rest.findings))
    if (scale := find_scale(case)) is None:
        return None
    finding, value = scale
    rest = diagnose(scaled(case.campaign, 1.0 / value), case.robot, progress=progress)
    campaign, unmended = scaled(rest.campaign, value), (finding.id, *rest.unmended)
    return replace(rest, findings=(finding, *rest.findings), campaign=campaign, unmended=unmended)


def _unexplained(case: Case, before: float, progress: Progress) -> Diagnosis:
    """The diagnosis of what no usual mistake explains: rows in another order, rotations that fit no robot, or none of these."""
    reordered = find_other_order(case, before)
    if reordered is not None:
        return Diagnosis(findings=tuple(reordered[0]), robot=case.robot, campaign=reordered[1], unmended=())
    alone = None if case.campaign.rotations is None else _without_rotations(case, progress)
    left = find_what_is_left(case, before)
    return alone or Diagnosis(findings=(left,), robot=case.robot, campaign=case.campaign, unmended=(left.id,))


def _without_rotations(case: Case, progress: Progress) -> Diagnosis | None:
    """The diagnosis of positions alone, and of the rotations in the robot's joints as mended; None where that explains no more."""
    found = diagnose(replace(case.campaign, rotations=None), case.robot, progress=progress)
    if _left(found) == np.inf or len(found.campaign) != len(case.campaign):
        return None
    mended = replace(found.campaign, rotations=case.campaign.rotations)
    turned = find_wrong_rotations(Case.of(found.robot, mended))
    return turned and replace(found, findings=(*found.findings, turned[0]), campaign=turned[1])


def _diagnose_observed(case: Case, scope: str, progress: Progress) -> Diagnosis:
    """Diagnose by the mistakes of joints, and of the robot if that is quick."""
    found = explain_observed(case, progress)
    best, given = found[0], next(e for e in found if not e.mistakes)
    reach = best.case.reach
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


def _without_needless(found: list[Candidate], case: Case) -> list[Candidate]:
    """Explanations from the first on of which no geometry stands in for a mistake; the campaign as it is among them."""
    for k, explanation in enumerate(found):
        if all(_is_needed(mistake, explanation, case) for mistake in explanation.mistakes):
            return [*found[k:], *(e for e in found[:k] if not e.mistakes)]
    return [e for e in found if not e.mistakes]


def _is_needed(mistake: Hypothesis, explanation: Candidate, case: Case) -> bool:
    """Whether the geometry, free within its tolerances, predicts rows held out worse with a mistake of the joints or the robot."""
    if mistake.measured is not None:  # no geometry stands in for a unit, a frame or an order
        return True
    others = [one for one in explanation.mistakes if one is not mistake]
    return _fitted_error(undone(case, others)) > MIN_FACTOR * _fitted_error(explanation.case)


def _fitted_error(case: Case) -> float:
    """Typical distance of rows held out, the geometry free within its tolerances, metres."""
    return float(np.exp(np.log(_fitted_distances(case)).mean()))


def _fitted_distances(case: Case) -> Float[np.ndarray, " m"]:
    return fitted_distances(case, spread_rows(len(case.campaign), MAX_HELD_OUT_ROWS))


def _chosen(found: list[Candidate], given: Candidate) -> tuple[Candidate, Local | None]:
    """The best explanation, and what went wrong in its course; the campaign as it is, if that alone explains as much."""
    best = found[0]
    if best is given:
        return given, find_drift_or_slip(given)
    if given.error < MAX_COURSE_SHARE * given.case.reach:
        local = find_drift_or_slip(given)
        if local is not None and _rank_without(*local, given.case) < best.rank:
            return given, local
    return best, find_drift_or_slip(best)


def _rank_without(finding: Finding, mended: Campaign, case: Case) -> float:
    """Rank, as of a `Candidate`, of a slip, move, drift or fault of rows.

    Rows that are left out are not explained, and which row belongs to which has to be said for each of them.
    """
    rows, kept = len(case.campaign), len(mended) / len(case.campaign)
    level = typical(held_out_distances(replace(case, campaign=mended)))
    unexplained = np.log(UNEXPLAINED_SHARE * case.reach)
    # a distance in space has three numbers, each of whose likelihood falls as it grows
    pairing = len(finding.subject) * np.log(rows) / (3.0 * rows) if finding.id == "rows-shuffled" else 0.0
    return float(kept * np.log(level) + (1.0 - kept) * unexplained + pairing) + MISTAKE_CHARGE


def _key(explanation: Candidate) -> frozenset[tuple[str, tuple[str, ...]]]:
    return frozenset((s.id, s.subject) for s in explanation.mistakes)


def _written(found: list[Candidate], best: Candidate, given: Candidate, before: float) -> list[Finding]:
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


def _share(found: list[Candidate], best: Candidate, mistake: tuple[str, tuple[str, ...]]) -> float:
    weights = {_key(e): float(np.exp(CONFIDENCE_POWER * (best.rank - e.rank))) for e in reversed(found)}
    total = sum(weights.values())
    with_it = sum(weight for key, weight in weights.items() if mistake in key)
    return float(min(with_it / total, 0.99))


def _alternatives(found: list[Candidate], best: Candidate, given: Candidate, before: float) -> list[Finding]:
    """Other explanations that fit nearly as well."""
    out: list[Finding] = []
    known = set(_key(best))
    for other in found:
        if other is best or not other.mistakes or not best.mistakes:
            continue
        if other.rank > min(best.rank + ALTERNATIVE_MARGIN, given.rank):
            continue
        for finding in _written(found, other, given, before):
            share = min(_share(found, best, (finding.id, finding.subject)), 0.49)
            finding = replace(finding, confidence=share, alternative=True)
            if (finding.id, finding.subject) not in known and len(out) < MAX_ALTERNATIVES:
                known.add((finding.id, finding.subject))
                out.append(finding)
    return sorted(out, key=lambda f: -f.confidence)
