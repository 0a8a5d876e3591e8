"""Mistakes of joints and robot in what was observed without a tracker: sockets, wires, landmarks, boards."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Int

from taskcal.diagnosis.joint_mistakes import joint_mistakes
from taskcal.diagnosis.quick_fit import SMALLEST_ERROR
from taskcal.diagnosis.robot_mistakes import robot_mistakes
from taskcal.diagnosis.search import (
    OUTSIDE_LIMITS,
    PER_MISTAKE,
    TRIED_ROWS,
    Explanation,
    Progress,
    is_sound,
    spread_rows,
    untold,
)
from taskcal.diagnosis.supposition import Case, Supposition
from taskcal.errors import CampaignError, UnitError
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.registration import register_observations

CONTINUED = 4
"""Single mistakes beside which a second is looked for."""


ENOUGH_ROWS = 12
"""Of one thing, to find it without a guess."""

_QUICK = frozenset({"socket"})
"""Kinds that are placed in a millisecond, so that all mistakes and their pairs can be tried."""

_OFTEN = frozenset({"joints-in-radians", "joint-sign", "joint-zero"})
"""What is tried of the others."""


def scope_of(campaign: Campaign) -> str:
    """What the doctor can say of a campaign without a tracker; nothing of one that a tracker measured."""
    kinds = dict.fromkeys(one.key for one in campaign.observations if not one.in_tracker)
    if not kinds:
        return ""
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
    return all(one.key in _QUICK for one in campaign.observations)


def explain_observed(case: Case, progress: Progress = untold) -> list[Explanation]:
    """Explanations by one mistake of joints or robot, and by two where one is not enough, the best first.

    Each is ranked by how far the registered nominal robot misses the observations, over how far it moved: joints that are too
    small leave little to miss.
    """
    quick, joints = _is_quick(case.campaign), list(joint_mistakes(case))
    suppositions = [*joints, *robot_mistakes(case)] if quick else [s for s in joints if s.id in _OFTEN]
    found = _ranked(case, [(), *((s,) for s in suppositions)], progress)
    if is_sound(found[0]) or not quick:
        return found
    pairs = [
        (*e.mistakes, s) for e in found[:CONTINUED] for s in suppositions if e.mistakes and _together(e.mistakes[0], s)
    ]
    return sorted([*found, *_ranked(case, pairs, progress)], key=lambda e: e.rank)


def _together(a: Supposition, b: Supposition) -> bool:
    return (a.id, a.subject) != (b.id, b.subject) and (a.robot is None or b.robot is None)


def _ranked(case: Case, combinations: Sequence[Sequence[Supposition]], progress: Progress) -> list[Explanation]:
    out: list[Explanation] = []
    for number, combination in enumerate(combinations):
        progress(f"mistakes, {max(map(len, combinations))} at a time", number, len(combinations))
        out.append(_explanation(case, tuple(combination)))
    return sorted(out, key=lambda e: e.rank)


def _explanation(case: Case, mistakes: tuple[Supposition, ...]) -> Explanation:
    # the robot first: joints are undone for whichever it is
    for mistake in sorted(mistakes, key=lambda s: s.robot is None):
        case = mistake.undo(case)
    error, moved = _error(case, as_given=not mistakes)
    outside = 1.0 - float(case.robot.inside_limits(case.campaign.q, slack=0.02).mean())
    cost = sum(PER_MISTAKE + s.cost for s in mistakes) + OUTSIDE_LIMITS * min(1.0, 5.0 * outside)
    level = max(error, SMALLEST_ERROR) / max(moved, SMALLEST_ERROR)
    return Explanation(mistakes=mistakes, case=case, error=error, rank=float(np.log(level)) + cost)


def tried_rows(campaign: Campaign) -> Int[np.ndarray, " k"]:
    """Some of the rows, evenly spread, and enough of every anchor, landmark, plane … to find it."""
    rows = spread_rows(len(campaign), TRIED_ROWS)
    parts = [rows]
    for kind in campaign.observations:
        if kind.of is not None and kind.key not in _QUICK:
            for k in range(int(kind.of.max()) + 1):
                own = np.flatnonzero(kind.of == k)
                if (kind.of[rows] == k).sum() < ENOUGH_ROWS:
                    parts.append(own[spread_rows(len(own), ENOUGH_ROWS)])
    return np.unique(np.concatenate(parts))


def _error(case: Case, *, as_given: bool) -> tuple[float, float]:
    """Median distance of the registered nominal robot from what was observed, and how far the tool moved, metres.

    Where it cannot be registered both are the same.

    Raises:
        UnitError: of the campaign as it is given, lengths in another unit.
    """
    rows = tried_rows(case.campaign)
    T = case.poses(rows)
    closes = np.isfinite(T[:, 0, 3]) & case.campaign.seen[rows]
    if closes.mean() < 0.7:
        return case.model.robot.reach, case.model.robot.reach
    rows, T = rows[closes], T[closes]
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
