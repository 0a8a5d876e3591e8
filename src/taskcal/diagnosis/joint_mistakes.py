"""Joints in another unit, with other signs, zeros or couplings, or in another order."""

import itertools
from collections.abc import Iterator

import numpy as np

from taskcal.diagnosis.supposition import Case, JointMap, Supposition

DEGREES = 180.0 / np.pi

LARGEST_IN_RADIANS = 0.125
"""Joint positions, radians: no campaign whose joints stay below is of use, and π read as degrees is 0.055."""

SMALLEST_IN_DEGREES = 12.6
"""Joint positions, radians: two turns."""


def joint_mistakes(case: Case) -> Iterator[Supposition]:
    """All that can be wrong with a campaign's joints, one at a time."""
    yield from unit_mistakes(case)
    yield from _signs(case)
    yield from _zeros(case)
    yield from _couplings(case)
    yield from _orders(case)


def unit_mistakes(case: Case) -> Iterator[Supposition]:
    """Another unit of the joints, where their size asks for it."""
    turning = ~np.array(case.robot.prismatic)
    largest = np.abs(case.campaign.q[:, turning]).max(initial=0.0)
    names = tuple(name for name, turns in zip(case.robot.joint_names, turning, strict=True) if turns)
    if 0.0 < largest < LARGEST_IN_RADIANS:
        yield Supposition(
            id="joints-in-radians",
            subject=names,
            joints=_map(np.diag(np.where(turning, DEGREES, 1.0))),
            fix="name the joint columns with _rad instead of _deg: they hold radians",
        )
    elif largest > SMALLEST_IN_DEGREES:
        yield Supposition(
            id="joints-in-radians",
            subject=names,
            joints=_map(np.diag(np.where(turning, 1.0 / DEGREES, 1.0))),
            fix="name the joint columns with _deg instead of _rad: they hold degrees",
        )


def _signs(case: Case) -> Iterator[Supposition]:
    for j, name in enumerate(case.robot.joint_names):
        matrix = np.eye(len(case.robot.joints))
        matrix[j, j] = -1.0
        yield Supposition(
            id="joint-sign",
            subject=(name,),
            joints=_map(matrix),
            fix=f'reverse the sign of {name} in the campaign, or give {name} angle = "-{name}" in the robot file',
        )


def _zeros(case: Case) -> Iterator[Supposition]:
    joints = case.robot.joint_names
    limits = np.clip(case.robot.limits, -1e3, 1e3)
    # of the two ways to half a turn the one that leads towards the middle of the limits
    half_turns = np.where(np.median(case.campaign.q, axis=0) > limits.mean(axis=1), -180.0, 180.0)
    for (j, name), turn in itertools.product(enumerate(joints), (90.0, -90.0, None)):
        if case.robot.prismatic[j]:
            continue
        degrees = float(half_turns[j]) if turn is None else turn
        shift = np.zeros(len(joints))
        shift[j] = np.radians(degrees)
        yield Supposition(
            id="joint-zero",
            subject=(name,),
            joints=_map(np.eye(len(joints)), shift),
            fix=f"add {degrees:g}° to {name} in the campaign, or to its offset_deg in the robot file",
            cost=0.05,
        )


def _couplings(case: Case) -> Iterator[Supposition]:
    names, n = case.robot.joint_names, len(case.robot.joints)
    pairs = [(j, j + 1) for j in range(1, n - 1)] + [(j + 1, j) for j in range(1, n - 1)] + [(3, 5)] * (n >= 6)
    for (source, moved), sign in itertools.product(pairs, (1.0, -1.0)):
        if case.robot.prismatic[source] or case.robot.prismatic[moved]:
            continue
        matrix = np.eye(n)
        matrix[moved, source] = sign
        added = f"{names[moved]} {'+' if sign > 0 else '-'} {names[source]}"
        yield Supposition(
            id="coupling",
            subject=(names[source], names[moved]),
            joints=_map(matrix),
            fix=f"{names[moved]} is counted with {names[source]}: write {added} for {names[moved]} in the campaign, or into "
            f"{names[moved]}'s angle in the robot file",
            cost=0.02 if (source, moved) == (1, 2) else 0.3,
        )


def _orders(case: Case) -> Iterator[Supposition]:
    n = len(case.robot.joints)
    orders = {(*range(n),)}
    for i, j in itertools.combinations(range(n), 2):
        order = list(range(n))
        order[i], order[j] = j, i
        yield from _order(case, tuple(order), orders)
    turned = [(*range(k, n), *range(k)) for k in range(1, n)]
    for order in (tuple(reversed(range(n))), *turned):
        yield from _order(case, order, orders)
    for i, k in itertools.combinations(range(n), 2):
        if k - i > 1:
            part = list(range(i, k + 1))
            for inner in ([*part[1:], part[0]], [part[-1], *part[:-1]], part[::-1]):
                yield from _order(case, (*range(i), *inner, *range(k + 1, n)), orders, 0.1)


def _order(
    case: Case, order: tuple[int, ...], known: set[tuple[int, ...]], cost: float = 0.02
) -> Iterator[Supposition]:
    if order in known:
        return
    known.add(order)
    names = np.array(case.robot.joint_names)
    moved = [k for k, source in enumerate(order) if k != source]
    yield Supposition(
        id="joint-order",
        subject=tuple(str(name) for name in names[moved]),
        joints=_map(np.eye(len(order))[list(order)]),
        fix=f"the columns {', '.join(names[moved])} hold {', '.join(names[[order.index(k) for k in moved]])}: rename them in "
        "this order",
        cost=cost,
    )


def _map(matrix: np.ndarray, shift: np.ndarray | None = None) -> JointMap:
    return JointMap(matrix=matrix, shift=np.zeros(len(matrix)) if shift is None else shift)
