"""Mistakes of a campaign: each yields hypotheses that undo it and state the fix in one line."""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.campaigns.campaign import Campaign
from taskcal.diagnosis.fits import LEVER_SHARE
from taskcal.diagnosis.hypotheses import Case, Finding, Hypothesis, looked_for
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.geometry.point_registration import closed_form_rotations, products
from taskcal.registration.rotations import (
    MAX_MENDED_RATIO,
    MAX_MISFIT_RAD,
    MAX_SHIFT_ROWS,
    MIN_POSES,
    fit_rotations,
    misfit,
)
from taskcal.robot.catalogue import catalogue_names, load_robot
from taskcal.robot.joint_side import JointMap
from taskcal.robot.robot import Robot
from taskcal.robot.robot_file import robot_from
from taskcal.tables.table import ANGLES, LENGTHS, PLURALS

# Joints in another unit, with other signs, zeros or couplings, or in another order.

DEGREES = 180.0 / np.pi

MAX_TOO_SMALL_RAD = 0.125
"""Joint positions, radians: no campaign whose joints stay below is of use, and π read as degrees is 0.055."""

MIN_TOO_LARGE_RAD = 12.6
"""Joint positions, radians: two turns."""


@looked_for("joints", "joints-in-radians", without_tracker=True)
def unit_mistakes(case: Case) -> Iterator[Hypothesis]:
    """Another unit of the joints, where their size asks for it."""
    turning = ~np.array(case.robot.prismatic)
    largest = np.abs(case.campaign.q[:, turning]).max(initial=0.0)
    names = tuple(name for name, turns in zip(case.robot.joint_names, turning, strict=True) if turns)
    if 0.0 < largest < MAX_TOO_SMALL_RAD:
        yield Hypothesis(
            id="joints-in-radians",
            subject=names,
            joints=_map(np.diag(np.where(turning, DEGREES, 1.0))),
            fix="name the joint columns with _rad instead of _deg: they hold radians",
        )
    elif largest > MIN_TOO_LARGE_RAD:
        yield Hypothesis(
            id="joints-in-radians",
            subject=names,
            joints=_map(np.diag(np.where(turning, 1.0 / DEGREES, 1.0))),
            fix="name the joint columns with _deg instead of _rad: they hold degrees",
        )


@looked_for("joints", "joints-in-other-unit")
def _other_units_of_joints(case: Case) -> Iterator[Hypothesis]:
    """Gon or turns that were taken for degrees or radians, where their size leaves it open."""
    turning = ~np.array(case.robot.prismatic)
    largest = np.abs(case.campaign.q[:, turning]).max(initial=0.0)
    for taken, (unit, size) in itertools.product(("deg", "rad"), (("gon", ANGLES["gon"]), ("turns", 2.0 * np.pi))):
        factor = size / ANGLES[taken]
        if not MAX_TOO_SMALL_RAD < factor * largest < MIN_TOO_LARGE_RAD:
            continue
        yield Hypothesis(
            id="joints-in-other-unit",
            subject=tuple(name for name, turns in zip(case.robot.joint_names, turning, strict=True) if turns),
            joints=_map(np.diag(np.where(turning, factor, 1.0))),
            fix=f"the joints are in {unit}, not in {PLURALS[taken]}: multiply their columns by {factor:.6g}",
            cost=0.05,
        )


@looked_for("joints", "joint-sign", without_tracker=True)
def _signs(case: Case) -> Iterator[Hypothesis]:
    for j, name in enumerate(case.robot.joint_names):
        matrix = np.eye(len(case.robot.joints))
        matrix[j, j] = -1.0
        yield Hypothesis(
            id="joint-sign",
            subject=(name,),
            joints=_map(matrix),
            fix=f'reverse the sign of {name} in the campaign, or give {name} angle = "-{name}" in the robot file',
        )


@looked_for("joints", "joint-zero", without_tracker=True)
def _zeros(case: Case) -> Iterator[Hypothesis]:
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
        yield Hypothesis(
            id="joint-zero",
            subject=(name,),
            joints=_map(np.eye(len(joints)), shift),
            fix=f"add {degrees:g}° to {name} in the campaign, or to its offset_deg in the robot file",
            cost=0.05,
        )


@looked_for("joints", "coupling")
def _couplings(case: Case) -> Iterator[Hypothesis]:
    names, n = case.robot.joint_names, len(case.robot.joints)
    pairs = [(j, j + 1) for j in range(1, n - 1)] + [(j + 1, j) for j in range(1, n - 1)] + [(3, 5)] * (n >= 6)
    for (source, moved), sign in itertools.product(pairs, (1.0, -1.0)):
        if case.robot.prismatic[source] or case.robot.prismatic[moved]:
            continue
        matrix = np.eye(n)
        matrix[moved, source] = sign
        added = f"{names[moved]} {'+' if sign > 0 else '-'} {names[source]}"
        yield Hypothesis(
            id="coupling",
            subject=(names[source], names[moved]),
            joints=_map(matrix),
            fix=f"{names[moved]} is counted with {names[source]}: write {added} for {names[moved]} in the campaign, or into "
            f"{names[moved]}'s angle in the robot file",
            cost=0.02 if (source, moved) == (1, 2) else 0.3,
        )


@looked_for("joints", "joint-order")
def _orders(case: Case) -> Iterator[Hypothesis]:
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


def _order(case: Case, order: tuple[int, ...], known: set[tuple[int, ...]], cost: float = 0.02) -> Iterator[Hypothesis]:
    if order in known:
        return
    known.add(order)
    names = np.array(case.robot.joint_names)
    moved = [k for k, source in enumerate(order) if k != source]
    yield Hypothesis(
        id="joint-order",
        subject=tuple(str(name) for name in names[moved]),
        joints=_map(np.eye(len(order))[list(order)]),
        fix=f"the columns {', '.join(names[moved])} hold {', '.join(names[[order.index(k) for k in moved]])}: rename them in "
        "this order",
        cost=cost,
    )


def _map(matrix: np.ndarray, shift: np.ndarray | None = None) -> JointMap:
    return JointMap(matrix=matrix, offset=np.zeros(len(matrix)) if shift is None else shift)


SWAP = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""x and y exchanged."""

MIN_SCATTER_SHARE, MAX_SCATTER_SHARE = 0.02, 5.0
"""Spreads of the points, of the reach, beyond which they may be in another unit. Any points fit any robot that hardly moves once
they are made a thousand times smaller."""

OTHER_UNITS = {unit: LENGTHS[unit] for unit in ("mm", "m", "in", "cm", "ft")}
"""In which points are written, and taken for one another; yards cannot be told from metres."""

MAX_SCATTER_RATIO = 2.0
"""Factor, at most, between the scatter of the points and that of the nominal TCP, which a target's place and mistakes of
joints explain; units nearer to each other are not told apart. A convention: below 2.54, the ratio of inches and centimetres."""


@looked_for("frames", "points-in-metres", "points-in-other-unit")
def scale_mistakes(case: Case) -> Iterator[Hypothesis]:
    """Another unit of the points, where their spread asks for it; the likeliest first."""
    names = case.campaign.targets
    spread = float(np.nanstd(case.campaign.points, axis=0).max())
    scales = (
        (1e3, "_m instead of _mm: they hold metres", spread < MIN_SCATTER_SHARE * case.reach),
        (1e-3, "_mm instead of _m: they hold millimetres", spread > MAX_SCATTER_SHARE * case.reach),
    )
    metric = [
        Hypothesis(
            id="points-in-metres",
            subject=names,
            measured=partial(_scaled, factors=np.full(len(names), factor)),
            fix=f"name the points' columns with {said}",
            size=factor,
        )
        for factor, said, possible in scales
        if possible
    ]
    expected = _expected_scatter(case)
    if expected is None:
        yield from metric
        return
    scatter = np.array([_scatter(case.campaign.points[:, t]) for t in range(len(names))])
    others = sorted(_other_units(names, expected / scatter), key=lambda found: found[0])
    metric_off = [abs(np.log(expected / np.nanmedian(scatter) / scale[0])) for scale in scales if scale[2]]
    if others and metric and others[0][0] < metric_off[0]:
        yield from (hypothesis for _, hypothesis in others)
        yield from metric
    else:
        yield from metric
        yield from (hypothesis for _, hypothesis in others)


def _other_units(names: tuple[str, ...], ratio: Float[np.ndarray, " targets"]) -> Iterator[tuple[float, Hypothesis]]:
    """Units that make the scatter of the points what the joints let expect, and the logarithm of what they leave.

    All targets at first; of several, those alone whose scatter asks for it.
    """
    for (taken, as_taken), (unit, size) in itertools.permutations(OTHER_UNITS.items(), 2):
        if {taken, unit} == {"m", "mm"} or abs(np.log(size / as_taken)) < np.log(MAX_SCATTER_RATIO):
            continue
        off = np.abs(np.log(ratio / (size / as_taken)))
        wrong = np.asarray(off < np.log(MAX_SCATTER_RATIO))
        if not wrong.any() or (not wrong.all() and (np.abs(np.log(ratio[~wrong])) > np.log(MAX_SCATTER_RATIO)).any()):
            continue
        subject = tuple(name for name, one in zip(names, wrong, strict=True) if one)
        of = "" if wrong.all() else f" of {', '.join(subject)}"
        factor = size / as_taken
        yield (
            float(off[wrong].max()),
            Hypothesis(
                id="points-in-other-unit",
                subject=subject,
                measured=partial(_scaled, factors=np.where(wrong, factor, 1.0)),
                fix=f"the points{of} are in {PLURALS[unit]}, not {PLURALS[taken]}: name their columns with _{unit} instead of "
                f"_{taken}, such as x_{unit}, or multiply them by {factor:.6g}",
                size=factor if wrong.all() else 1.0,
                cost=0.02,
            ),
        )


def _expected_scatter(case: Case) -> float | None:
    """Scatter of the nominal TCP, joints in their likely unit, metres; None if it hardly moves."""
    for hypothesis in unit_mistakes(case):
        case = hypothesis.undo(case)
    scatter = _scatter(case.poses(np.arange(len(case.campaign)))[:, :3, 3])
    return scatter if scatter > MIN_SCATTER_SHARE * case.reach else None


def _scatter(points: Float[np.ndarray, "n 3"]) -> float:
    """Root mean square distance from the mean, metres."""
    return float(np.sqrt(np.nanvar(points, axis=0).sum()))


@looked_for("frames", "left-handed")
def _left_handed(case: Case) -> Iterator[Hypothesis]:
    fix = "exchange the columns x and y (or reverse one axis): the points are in a left-handed frame"
    names, cost = case.campaign.targets, 0.02
    yield Hypothesis(id="left-handed", subject=names, measured=partial(_turned, both=True), fix=fix, cost=cost)
    if case.campaign.rotations is not None:
        fix, turned = f"{fix}, the rotations are not", partial(_turned, both=False)
        yield Hypothesis(id="left-handed", subject=names, measured=turned, fix=fix, cost=2.0 * cost)


@looked_for("frames", "quaternion-order")
def _quaternion_orders(case: Case) -> Iterator[Hypothesis]:
    orders = {"qw qx qy qz": [1, 2, 3, 0], "qy qz qw qx": [3, 0, 1, 2]}
    for order, taken in orders.items() if case.campaign.rotations is not None else ():
        yield Hypothesis(
            id="quaternion-order",
            subject=case.campaign.targets,
            measured=partial(_reordered, taken=taken),
            fix=f"the four columns of the quaternion hold {order}: rename them so",
        )


@looked_for("frames", "inverse-poses")
def _inverses(case: Case) -> Iterator[Hypothesis]:
    for said, measured, cost in (
        (
            ("poses", _inverted, 0.02),
            ("rotations (reverse the sign of qw)", _transposed, 0.04),
        )
        if case.campaign.rotations is not None
        else ()
    ):
        yield Hypothesis(
            id="inverse-poses",
            subject=case.campaign.targets,
            measured=measured,
            fix=f"invert the {said}: they are those of the tracker in the target's frame",
            cost=cost,
        )


def scaled(campaign: Campaign, factor: float) -> Campaign:
    """The campaign with all points farther from each other by a factor."""
    return _scaled(campaign, np.full(len(campaign.targets), factor))


def _scaled(campaign: Campaign, factors: Float[np.ndarray, " targets"]) -> Campaign:
    points = campaign.points * factors[:, None]
    if np.ptp(factors) > 0.0:  # of some targets alone
        return replace(campaign, points=points)
    fixed = {name: places * factors[0] for name, places in campaign.reference_points.items()}
    return replace(campaign, points=points, reference_points=fixed)


def _transposed(campaign: Campaign) -> Campaign:
    return replace(campaign, rotations=np.swapaxes(_rotations(campaign), 1, 2).copy())


def _rotations(campaign: Campaign) -> np.ndarray:
    assert campaign.rotations is not None
    return campaign.rotations


def _turned(campaign: Campaign, *, both: bool) -> Campaign:
    fixed = {name: places @ SWAP for name, places in campaign.reference_points.items()}
    turned = replace(campaign, points=campaign.points @ SWAP, reference_points=fixed)
    if campaign.rotations is None or not both:
        return turned
    return replace(turned, rotations=SWAP @ campaign.rotations @ SWAP)


def _reordered(campaign: Campaign, taken: list[int]) -> Campaign:
    return replace(campaign, rotations=se3.from_quaternion(se3.to_quaternion(_rotations(campaign))[:, taken]))


def _inverted(campaign: Campaign) -> Campaign:
    T = se3.inverse(se3.pose(_rotations(campaign), campaign.points[:, 0]))
    return replace(campaign, points=T[:, None, :3, 3].copy(), rotations=T[:, :3, :3].copy())


# Rotations that cannot be those of their positions, which fit without them.


@looked_for("poses", "rotations-unmeasured", "rotations-shifted", "rotations-turned", "rotations-unknown")
def find_wrong_rotations(case: Case) -> tuple[Finding, Campaign] | None:
    """What is wrong with rotations of single rows or of all, and the campaign with them right, or else without rotations.

    None where they fit, or the positions do not.
    """
    fit = fit_rotations(case.model, case.campaign)
    if fit is None:
        return None
    Y, looked_at, campaign = _rotations(case.campaign), fit.seen & ~fit.constant, case.campaign
    before = float(np.median(fit.off[fit.wrong if fit.wrong.any() else fit.seen]))
    without = replace(campaign, rotations=None)
    _, inverse = _inverses(case)  # of poses, whose positions would not fit, and of rotations
    if fit.shift:
        mended = _with_rotations_of(campaign, fit.shift)
        after = _left(fit.R, None, mended, looked_at)
        return _of_rotations(
            case, "rotations-shifted", (f"{fit.shift:+d}",), (before, after), _rotations_fix(fit.shift)
        ), mended
    tried = [*_quaternion_orders(case), inverse] if looked_at.sum() >= MIN_POSES else []
    best = min(((_left(fit.R, one, campaign, looked_at), k) for k, one in enumerate(tried)), default=(np.inf, 0))
    given = _left(fit.R, None, campaign, looked_at) if tried else 0.0
    if best[0] <= min(MAX_MISFIT_RAD, MAX_MENDED_RATIO * given):
        one = tried[best[1]]
        assert one.measured is not None
        mended = one.measured(campaign)
        return _of_rotations(case, one.id, one.subject, (before, best[0]), one.fix), mended
    if not fit.wrong.any():
        return None
    said, rows = (
        fit.said(campaign),
        () if fit.wrong[fit.seen].all() else tuple(np.array(campaign.ids)[fit.wrong].tolist()),
    )
    if fit.constant.any():
        remedy = "measure the orientation there, or leave the rotation out of the file"
        return _of_rotations(case, "rotations-unmeasured", rows, (before, None), f"{said}: {remedy}"), without
    Z, X = closed_form_rotations(products(fit.R[looked_at], Y[looked_at]))
    own = np.linalg.norm(se3.log(np.swapaxes(Z @ fit.R[looked_at] @ X, 1, 2) @ Y[looked_at]), axis=1)
    turn = se3.log(Z)
    angle = float(np.linalg.norm(turn))
    if np.median(own) <= MAX_MISFIT_RAD < angle:
        axis = ", ".join(f"{part:.2f}" for part in turn / angle)
        fix = (
            f"rotations are in other axes than the positions, turned by {np.degrees(angle):.0f}° about ({axis}): 120° or 90° are "
            "exchanged axes, 180° mirrored ones; write both in one frame, or leave the rotations out"
        )
        return _of_rotations(case, "rotations-turned", (), (before, float(np.median(own))), fix), without
    remedy = (
        "measure these rows again, or leave them out"
        if len(rows)
        else "neither another order of the quaternion, nor the inverse, other axes or other rows fit; state what the angles mean "
        "(--angles; about z y z is none of them), or leave the rotations out"
    )
    return _of_rotations(case, "rotations-unknown", rows, (before, None), f"{said}: {remedy}"), without


def _left(
    R: Float[np.ndarray, "n 3 3"], one: Hypothesis | None, campaign: Campaign, looked_at: Bool[np.ndarray, " n"]
) -> float:
    """Median angle of rotations, without a mistake if one is named, radians."""
    mended = campaign if one is None or one.measured is None else one.measured(campaign)
    there = looked_at & mended.seen
    return float(np.median(misfit(R, _rotations(mended), there)[there]))


def _of_rotations(
    case: Case, name: str, subject: tuple[str, ...], angles: tuple[float, float | None], fix: str
) -> Finding:
    """A finding whose errors are median angles, radians, at the arm at which a rotation counts."""
    before, after = (None if angle is None else LEVER_SHARE * case.reach * angle for angle in angles)
    return Finding(id=name, subject=subject, error_before=before, error_after=after, confidence=0.95, fix=fix)


def _rotations_fix(by: int) -> str:
    return shift_fix(by).replace("the points", "the rotations").replace("their joints", "their positions")


def _with_rotations_of(campaign: Campaign, by: int) -> Campaign:
    """The campaign with the rotation of row i + by at row i; nothing is seen where there is no such row."""
    other = shifted(campaign, by)
    return replace(campaign, rotations=other.rotations).without(~other.seen)


# Another convention of the robot's table, or another robot of the same number of joints.

_OTHER = {"dh": "mdh", "mdh": "dh"}
_CONVENTION_NAMES = {"dh": "standard", "mdh": "modified"}


@looked_for("robot", "dh-convention")
def _conventions(case: Case) -> Iterator[Hypothesis]:
    exchanged = other_convention(case.robot)
    if exchanged is None:
        return
    robot, other = exchanged
    yield Hypothesis(
        id="dh-convention",
        subject=case.robot.joint_names,
        robot=robot,
        fix=f"the table is a {_CONVENTION_NAMES[other]} Denavit-Hartenberg table: import it with --convention {other}",
        cost=0.05,
    )


@looked_for("robot", "other-robot")
def _other_robots(case: Case) -> Iterator[Hypothesis]:
    own = case.robot
    for name in catalogue_names():
        robot = load_robot(name)
        if name == own.name or robot.prismatic != own.prismatic or robot.description == own.description:
            continue
        yield Hypothesis(
            id="other-robot",
            subject=(name,),
            robot=robot,
            fix=f"--robot {name}: the campaign fits this robot, not {own.name}",
            cost=0.3,
        )


def other_convention(robot: Robot) -> tuple[Robot, str] | None:
    """The robot with its table read by the other Denavit-Hartenberg convention, and which that is; None without such a table."""
    joints = robot.description.get("joint", [])
    stated = {key for joint in joints for key in _OTHER if joint.get(key) is not None}
    if len(stated) != 1:
        return None
    (convention,) = stated
    try:
        return robot_from(_exchanged(robot.description, convention)), _OTHER[convention]
    except TaskcalError:
        return None


def _exchanged(description: Mapping[str, Any], convention: str) -> dict[str, Any]:
    def joint(section: Mapping[str, Any]) -> dict[str, Any]:
        return {_OTHER[convention] if key == convention else key: value for key, value in section.items()}

    # what hangs on parameter names of the other convention says nothing of this one
    kept = {
        key: value
        for key, value in description.items()
        if key in ("name", "title", "source", "joint", "tool", "four_bar")
    }
    return {**kept, "joint": [joint(section) for section in description["joint"]]}


# Points that stand some rows below or above their joints.

MIN_ALIKE_SHARE = 0.8
"""Share of the rows out of place, at least, that lie as many rows off for a shift. A convention: rows shuffled at random agree
in a few only."""

MIN_SHIFTED_ROWS = 4
"""Rows at least that lie as many rows off for a shift. A convention: fewer agree by chance."""


@looked_for("order", "rows-shifted")
def _shifts(case: Case) -> Iterator[Hypothesis]:
    """Shifts of the points against the joints, one at a time."""
    most = min(MAX_SHIFT_ROWS, len(case.campaign) // 4)
    for k in [step * sign for step in range(1, most + 1) for sign in (1, -1)]:
        yield Hypothesis(
            id="rows-shifted",
            subject=(f"{k:+d}",),
            measured=partial(shifted, by=k),
            fix=shift_fix(k),
            cost=0.02,
        )


def shift_fix(by: int) -> str:
    """The line that mends points which stand so many rows below their joints."""
    where, back = ("below", "up") if by > 0 else ("above", "down")
    rows = f"{abs(by)} row{'s' if abs(by) > 1 else ''}"
    return f"the points stand {rows} {where} their joints: move the points' columns {back} by {rows}"


def common_shift(source: Int[np.ndarray, " n"]) -> int | None:
    """Number of rows by which nearly all displaced measurements are shifted; None if the numbers differ."""
    offset = source - np.arange(len(source))
    values, counts = np.unique(offset[offset != 0], return_counts=True)
    if not len(values) or counts.max() < MIN_ALIKE_SHARE * counts.sum() or counts.max() < MIN_SHIFTED_ROWS:
        return None
    return int(values[counts.argmax()])


def shifted(campaign: Campaign, by: int) -> Campaign:
    """The campaign with the points of row i + by at row i; nothing is seen where there is no such row."""
    source = np.arange(len(campaign)) + by
    inside = (source >= 0) & (source < len(campaign))
    taken = np.where(inside, source, 0)
    points = np.where(inside[:, None, None], campaign.points[taken], np.nan)
    return replace(
        campaign,
        points=points,
        rotations=None if campaign.rotations is None else campaign.rotations[taken],
        uncertainty=None if campaign.uncertainty is None else campaign.uncertainty[taken],
        reference_points={name: places[taken] for name, places in campaign.reference_points.items()},
    )
