"""Search for the hypotheses, single or in pairs, that make robot and campaign consistent."""

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from taskcal.campaigns.campaign import Campaign
from taskcal.diagnosis.fits import (
    LEVER_SHARE,
    MIN_ERROR_M,
    QUICK_ROUNDS,
    TRUSTED_SHARE,
    misfits,
    registered,
    registered_trimmed,
    target_poses,
)
from taskcal.diagnosis.hypotheses import Case, Hypothesis, hypotheses_of, nominal_poses
from taskcal.diagnosis.mistakes import scale_mistakes, unit_mistakes
from taskcal.registration.registration import Registration
from taskcal.robot.joint_side import JointMap
from taskcal.robot.robot import TWO_TURNS

Progress = Callable[[str, int, int], None]
"""Told what is being tried, how many of it were, and how many there are."""

MISTAKE_CHARGE = 0.8
"""Natural logarithm of the factor, 2.2, by which one mistake has to lower the typical error to be significant. A convention: less
finds mistakes in sound campaigns, more misses small ones. `python -m tests.diagnosis.shares` counts right answers with it."""

LIMITS_SHARE, LIMITS_SLACK = 0.2, 0.02
"""Share of the rows outside the limits that is charged in full; and what a joint may be beyond its limit, radians or metres. A
convention: limits in data sheets are rounded to degrees."""

LIMITS_CHARGE = 0.5
"""Natural logarithm of the error's factor, 1.6, charged where a fifth of the rows or more lie outside the joint limits. A
convention: below the charge of a mistake, so that it decides between explanations of equal error only."""

MIN_CLOSED_SHARE = 0.7
"""Share of the rows, at least, at which a closed loop closes. A convention: with fewer the joints are not this robot's."""

MAX_TRIED_ROWS = 36
"""Rows, at most, on which all hypotheses are tried. A convention: 18 rows register the robot, 18 judge it; more cost time in
proportion."""

MAX_HELD_OUT_ROWS = 120
"""Rows, at most, on which the best explanations are compared. A convention: more sharpen the comparison by the root of their
number."""

TRAIT_CHARGE = 0.15
"""Natural logarithm of the error's factor, 1.16, charged for each unusual trait: a robot that hangs from the ceiling by a
levelled tracker, a target behind the flange, inside the arm, a joint that stays at its limit. A convention: a fifth of a
mistake's charge, so that it decides between mirrored robots, whose errors are equal."""

MIN_HANGING_COSINE = 0.7
"""Cosine of the angle, 45°, between the base's z axis and minus the tracker's, within which a robot hangs. A convention halfway
between ceiling and wall."""

MIN_BEHIND_M = 5e-3
"""Distance behind the flange along the tool's z axis, metres, from which on a target is inside the arm. A convention that
allows for the registration's error."""

TRAITS_MARGIN = 0.4
"""Natural logarithm of the error's factor, 1.5, over the best within which explanations are looked at for unusual traits, and
beyond it those that would come first without. A convention: more than two traits' charges, less than a mistake's."""

MAX_COMPARED = 24
"""Explanations, at most, that are compared on held-out rows. A convention: more cost time in proportion."""

MIN_JUDGED_ROWS = 6
"""Rows at least; with fewer no half of the rows can be judged by the other, since three points register a frame."""

MAX_ROBUST_FITS = 300
"""Combinations of joint mistakes, at most, that are fitted robustly. A convention: a plain fit ranks the others; more cost time
in proportion."""

SOUND_SHARE = 4e-3
"""Typical error over the robot's reach, below which pairs of mistakes are not looked for. A convention: 8 mm of a reach of 2 m."""

MAX_MISTAKES = 3
"""Mistakes at a time, at most. A convention: the number of combinations grows with its power."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Candidate:
    """Hypotheses that were undone together, and what is left."""

    mistakes: tuple[Hypothesis, ...]
    case: Case
    """Without the mistakes."""
    error: float
    """Median distance on rows that were held out, metres."""
    rank: float
    """Logarithm of the error, and what the mistakes cost; the smallest is the best."""


def silent(step: str, done: int, of: int) -> None:
    """Progress that is not shown."""


def undone(case: Case, mistakes: Iterable[Hypothesis]) -> Case:
    """The case without some mistakes."""
    for mistake in mistakes:
        case = mistake.undo(case)
    return case


def limits_charge(case: Case) -> float:
    """Charge for rows outside the joint limits, natural logarithm of the error."""
    outside = 1.0 - float(case.robot.inside_limits(case.campaign.q, slack=LIMITS_SLACK).mean())
    return LIMITS_CHARGE * min(1.0, outside / LIMITS_SHARE)


def explain_singly(case: Case, progress: Progress = silent) -> list[Candidate]:
    """Explanations by one mistake, the best first; without mistakes among them the campaign as it is."""
    return _compared(case, _tried(case, (), progress, pairs=False), progress)


def has_no_unit(case: Case) -> bool:
    """Whether joints and points may both be in another unit: together they are small, and so is what is left of them."""
    return bool(list(unit_mistakes(case))) and bool(list(scale_mistakes(case)))


def is_sound(explanation: Candidate) -> bool:
    """Whether so little is left that no further mistake needs to be looked for."""
    return explanation.error <= SOUND_SHARE * explanation.case.reach


def explain_in_pairs(case: Case, progress: Progress = silent) -> list[Candidate]:
    """Explanations by two mistakes at a time, and by three where two are too few, the best first."""
    found = _compared(case, _tried(case, (), progress, pairs=True), progress)
    if len(found[0].mistakes) == MAX_MISTAKES - 1 and not is_sound(found[0]):
        two = [e for e in found[:3] if len(e.mistakes) == MAX_MISTAKES - 1]
        more = [m for e in two for m in _tried(e.case, e.mistakes, progress, pairs=False)]
        found = sorted([*found, *_compared(case, more, progress)], key=lambda e: e.rank)
    return found


def spread_rows(rows: int, wanted: int) -> Int[np.ndarray, " k"]:
    """Select at most so many row numbers, evenly distributed."""
    return np.unique(np.linspace(0, rows - 1, min(rows, wanted)).round().astype(int))


Combination = tuple[Hypothesis, ...]


def _tried(case: Case, already: Combination, progress: Progress, *, pairs: bool) -> list[Combination]:
    """The best combinations by a quick fit on some rows."""
    joints = list(hypotheses_of(case, "joints"))
    robots = list(hypotheses_of(case, "robot")) if all(s.robot is None for s in already) else []
    measured = list(hypotheses_of(case, "frames", "order"))
    groups: list[tuple[Combination, list[Combination]]] = [((), [(), *((s,) for s in joints)])]
    others = [(s,) for s in (*robots, *measured)]
    with_joints: list[Combination] = [(), *((s,) for s in joints)] if pairs else [()]
    groups += [(other, with_joints) for other in others]
    if pairs:
        groups[0][1].extend(_joint_pairs(joints))
        groups += [((a, b), [()]) for a, b in itertools.combinations((*robots, *measured), 2) if _together(a, b)]
    scored: list[tuple[float, Combination]] = []
    step = f"mistakes, {len(already) + 1 + pairs} at a time"
    for number, (rest, combinations) in enumerate(groups):
        progress(step, number, len(groups))
        changed = undone(case, rest)
        errors = _errors(changed, combinations)
        for error, combination in zip(errors, combinations, strict=True):
            whole = (*rest, *combination)
            scored.append((_rank(float(error), (*already, *whole)), (*already, *whole)))
    scored.sort(key=lambda item: item[0])
    return [combination for _, combination in scored[:MAX_COMPARED]]


def _joint_pairs(joints: Sequence[Hypothesis]) -> Iterable[Combination]:
    for a, b in itertools.combinations(joints, 2):
        if a.id == b.id and (a.subject == b.subject or a.id == "joint-order"):
            continue
        yield (a, b)
        if "coupling" in (a.id, b.id) or "joint-order" in (a.id, b.id):
            yield (b, a)


def _together(a: Hypothesis, b: Hypothesis) -> bool:
    """Whether both can be: not two robots, nor the same mistake twice."""
    return a.id != b.id and (a.robot is None or b.robot is None)


def _rank(error: float, mistakes: Combination) -> float:
    return float(np.log(max(error, MIN_ERROR_M))) + sum(
        MISTAKE_CHARGE + s.cost - float(np.log(s.size)) for s in mistakes
    )


def _errors(case: Case, combinations: Sequence[Combination]) -> Float[np.ndarray, " h"]:
    """Errors by the quick fit for several combinations of joint mistakes; poor ones among many by a first round alone."""
    if len(combinations) <= 2 * MAX_ROBUST_FITS:
        return _quick_errors(case, combinations)
    out = _quick_errors(case, combinations, rounds=1)
    best = np.argsort(out, kind="stable")[:MAX_ROBUST_FITS]
    out = out + out[best[-1]]
    out[best] = _quick_errors(case, [combinations[i] for i in best])
    return out


def _quick_errors(
    case: Case, combinations: Sequence[Combination], rounds: int = QUICK_ROUNDS
) -> Float[np.ndarray, " h"]:
    rows = spread_rows(len(case.campaign), MAX_TRIED_ROWS)
    campaign = case.campaign.take(rows)
    maps = [_composed(combination, campaign.q.shape[1]) for combination in combinations]
    q = np.stack([m(campaign.q) for m in maps])
    T = nominal_poses(case.model, q.reshape(-1, q.shape[2])).reshape(*q.shape[:2], 4, 4)
    h = len(q)
    rotations = None
    if campaign.rotations is not None:
        rotations = np.broadcast_to(campaign.rotations, (h, *campaign.rotations.shape))
    points = np.broadcast_to(campaign.points, (h, *campaign.points.shape))
    return misfits(T, points, rotations, LEVER_SHARE * case.reach, rounds)


def _composed(combination: Combination, joints: int) -> JointMap:
    out = JointMap(matrix=np.eye(joints), offset=np.zeros(joints))
    for hypothesis in combination:
        assert hypothesis.joints is not None
        out = hypothesis.joints.after(out)
    return out


def _compared(case: Case, combinations: Iterable[Combination], progress: Progress) -> list[Candidate]:
    out: list[Candidate] = []
    compared = ((), *(c for c in combinations if c))
    for number, combination in enumerate(compared):
        progress("the likeliest of them, on rows held out", number, len(compared))
        changed = undone(case, combination)
        distances = held_out_distances(changed)
        error, level = float(np.median(distances)), typical(distances)
        rank = _rank(level, combination) + limits_charge(changed)
        out.append(Candidate(mistakes=combination, case=changed, error=error, rank=rank))
    out.sort(key=lambda e: e.rank)
    margin, best = out[0].rank + TRAITS_MARGIN, np.inf
    for k, e in enumerate(out):
        if e.rank >= max(margin, best):
            break
        out[k] = replace(e, rank=e.rank + _unusual(e.case))
        best = min(best, out[k].rank)
    return sorted(out, key=lambda e: e.rank)


def _unusual(case: Case) -> float:
    """Charge for unusual mounting, target offsets and joint positions."""
    rows, T = case.usable(spread_rows(len(case.campaign), MAX_HELD_OUT_ROWS))
    registration = registered_trimmed(case.campaign.take(rows), T)
    if registration is None:
        return 0.0
    hangs = registration.T_tracker_base[2, 2] < -MIN_HANGING_COSINE
    behind = float(np.median(registration.T_tool_target[:, 2, 3])) < -MIN_BEHIND_M
    limits = np.clip(case.robot.limits, -TWO_TURNS, TWO_TURNS)
    strain = np.abs(np.median(case.campaign.q, axis=0) - limits.mean(axis=1)) / (0.5 * np.ptp(limits, axis=1))
    return TRAIT_CHARGE * (float(hangs) + float(behind) + float(np.clip(strain, 0.0, 2.0).sum()))


def typical(distances: Float[np.ndarray, " n"]) -> float:
    """Geometric mean, metres: a few rows may be off as far as they like, and a mistake that only some rows show still counts."""
    return float(np.exp(np.log(np.maximum(distances, MIN_ERROR_M)).mean()))


def rows_to_register(campaign: Campaign) -> int:
    """Rows that leave something to judge once tracker frame and targets are found."""
    numbers = 6 if campaign.rotations is not None else 3 * len(campaign.targets)
    unknown = 12 if campaign.rotations is not None else 6 + numbers
    return unknown // numbers + 1


def held_out_error(case: Case) -> float:
    """Median distance of points from where the registration of the other half of the rows has them, metres."""
    return float(np.median(held_out_distances(case)))


def held_out_distances(case: Case) -> Float[np.ndarray, " n"]:
    """Distance of each row from where the registration of the other half of the rows has it, metres; infinite without one."""
    looked_at = spread_rows(len(case.campaign), MAX_HELD_OUT_ROWS)
    rows, T = case.usable(looked_at)
    if len(rows) < max(MIN_CLOSED_SHARE * len(looked_at), MIN_JUDGED_ROWS):
        return np.array([np.inf])
    halves = np.array_split(np.random.default_rng(0).permutation(len(rows)), 2)
    distance: list[np.ndarray] = []
    for fitted, tested in (halves, halves[::-1]):
        part = _trimmed_distances(case, rows, T, fitted, tested)
        if part is None:
            return np.array([np.inf])
        distance.append(part)
    return np.concatenate(distance)


def _trimmed_distances(
    case: Case, rows: np.ndarray, T: np.ndarray, fitted: np.ndarray, tested: np.ndarray
) -> Float[np.ndarray, " k"] | None:
    campaign, chosen = case.campaign.take(rows), fitted
    lever = LEVER_SHARE * case.reach
    out = None
    for _ in range(3):
        registration = _registered(campaign, T, chosen, case.reach)
        if registration is None:
            return out
        ends = target_poses(registration, T)
        square = ((campaign.points - ends[..., :3, 3]) ** 2).sum(axis=2)
        if campaign.rotations is not None:
            square = square + lever**2 * 0.5 * ((ends[..., :3, :3] - campaign.rotations[:, None]) ** 2).sum(axis=(2, 3))
        row = np.sqrt(np.nanmedian(square, axis=1))
        out = row[tested]
        chosen = fitted[np.argsort(row[fitted])[: int(np.ceil(TRUSTED_SHARE * len(fitted)))]]
    return out


def _registered(
    campaign: Campaign, T: Float[np.ndarray, "n 4 4"], chosen: Int[np.ndarray, " k"], reach: float
) -> Registration | None:
    """Register on some rows, from where all rows together point as well, if they alone lead to where nothing fits."""
    part = campaign.take(chosen)
    alone = registered(part, T[chosen])
    if alone is None or alone.rms <= SOUND_SHARE * reach:
        return alone
    together = registered(campaign, T)
    again = together and registered(part, T[chosen], together.T_tracker_base[:3, :3])
    return again and min(alone, again, key=lambda registration: registration.rms)
