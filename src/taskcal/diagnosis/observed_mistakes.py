"""Mistakes of joints and robot in what was observed without a tracker: sockets, wires, landmarks, boards."""

from collections.abc import Iterable, Sequence

import numpy as np

from taskcal.diagnosis.joint_mistakes import joint_mistakes
from taskcal.diagnosis.quick_fit import SMALLEST_ERROR
from taskcal.diagnosis.robot_mistakes import robot_mistakes
from taskcal.diagnosis.search import (
    OUTSIDE_LIMITS,
    PER_MISTAKE,
    TRIED_ROWS,
    Explanation,
    is_sound,
    spread_rows,
)
from taskcal.diagnosis.supposition import Case, Supposition
from taskcal.errors import CampaignError
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.registration import register_observations

CONTINUED = 4
"""Single mistakes beside which a second is looked for."""


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


def explain_observed(case: Case) -> list[Explanation]:
    """Explanations by one mistake of joints or robot, and by two where one is not enough, the best first.

    Each is ranked by how far the registered nominal robot misses the observations, over how far it moved: joints that are too
    small leave little to miss.
    """
    quick, joints = _is_quick(case.campaign), list(joint_mistakes(case))
    suppositions = [*joints, *robot_mistakes(case)] if quick else [s for s in joints if s.id in _OFTEN]
    found = _ranked(case, [(), *((s,) for s in suppositions)])
    if is_sound(found[0]) or not quick:
        return found
    pairs = [
        (*e.mistakes, s) for e in found[:CONTINUED] for s in suppositions if e.mistakes and _together(e.mistakes[0], s)
    ]
    return sorted([*found, *_ranked(case, pairs)], key=lambda e: e.rank)


def _together(a: Supposition, b: Supposition) -> bool:
    return (a.id, a.subject) != (b.id, b.subject) and (a.robot is None or b.robot is None)


def _ranked(case: Case, combinations: Iterable[Sequence[Supposition]]) -> list[Explanation]:
    out = [_explanation(case, tuple(combination)) for combination in combinations]
    return sorted(out, key=lambda e: e.rank)


def _explanation(case: Case, mistakes: tuple[Supposition, ...]) -> Explanation:
    # the robot first: joints are undone for whichever it is
    for mistake in sorted(mistakes, key=lambda s: s.robot is None):
        case = mistake.undo(case)
    error, moved = _error(case)
    outside = 1.0 - float(case.robot.inside_limits(case.campaign.q, slack=0.02).mean())
    cost = sum(PER_MISTAKE + s.cost for s in mistakes) + OUTSIDE_LIMITS * min(1.0, 5.0 * outside)
    level = max(error, SMALLEST_ERROR) / max(moved, SMALLEST_ERROR)
    return Explanation(mistakes=mistakes, case=case, error=error, rank=float(np.log(level)) + cost)


def _error(case: Case) -> tuple[float, float]:
    """Median distance of the registered nominal robot from what was observed, and how far the tool moved, metres.

    Where it cannot be registered both are the same.
    """
    rows = spread_rows(len(case.campaign), TRIED_ROWS)
    T = case.poses(rows)
    closes = np.isfinite(T[:, 0, 3]) & case.campaign.seen[rows]
    if closes.mean() < 0.7:
        return case.model.robot.reach, case.model.robot.reach
    rows, T = rows[closes], T[closes]
    moved = float(np.sqrt(((T[:, :3, 3] - T[:, :3, 3].mean(axis=0)) ** 2).sum(axis=1).mean()))
    try:
        off = register_observations(T, case.campaign.take(rows), case.model)[1]
    except (CampaignError, np.linalg.LinAlgError):
        return moved, moved
    return float(np.median(off)), moved
