"""Measurements in another unit, a left-handed frame, quaternions in another order, inverse poses."""

import itertools
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from jaxtyping import Float

from taskcal.diagnosis.joint_mistakes import unit_mistakes
from taskcal.diagnosis.supposition import Case, Supposition
from taskcal.geometry import se3
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.units import LENGTHS

SWAP = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""x and y exchanged."""

NARROW, WIDE = 0.02, 5.0
"""Spreads of the points, of the reach, beyond which they may be in another unit. Any points fit any robot that hardly moves once
they are made a thousand times smaller."""

OTHER_UNITS = {unit: LENGTHS[unit] for unit in ("mm", "m", "in", "cm", "ft")}
"""In which points are written, and taken for one another."""

SCATTER_WINDOW = 2.0
"""Largest factor between the scatter of the points and that of the nominal tool point, which a target's place on the tool and
mistakes of the joints can explain."""

_LONG = {"mm": "millimetres", "m": "metres", "in": "inches", "cm": "centimetres", "ft": "feet"}


def frame_mistakes(case: Case) -> Iterator[Supposition]:
    """All that can be wrong with how a campaign's measurements are written, one at a time."""
    names = case.campaign.targets
    yield from scale_mistakes(case)
    yield Supposition(
        id="left-handed",
        subject=names,
        measured=partial(_turned, both=True),
        fix="exchange the columns x and y (or reverse one axis): the points are in a left-handed frame",
        cost=0.02,
    )
    if case.campaign.rotations is not None:
        yield from _of_poses(names)


def scale_mistakes(case: Case) -> Iterator[Supposition]:
    """Another unit of the points, where their spread asks for it; the likeliest first."""
    names = case.campaign.targets
    spread = float(np.nanstd(case.campaign.points, axis=0).max())
    scales = (
        (1e3, "_m instead of _mm: they hold metres", spread < NARROW * case.model.robot.reach),
        (1e-3, "_mm instead of _m: they hold millimetres", spread > WIDE * case.model.robot.reach),
    )
    metric = [
        Supposition(
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
        yield from (supposition for _, supposition in others)
        yield from metric
    else:
        yield from metric
        yield from (supposition for _, supposition in others)


def _other_units(names: tuple[str, ...], ratio: Float[np.ndarray, " targets"]) -> Iterator[tuple[float, Supposition]]:
    """Units that make the scatter of the points what the joints let expect, and the logarithm of what they leave.

    All targets at first; of several, those alone whose scatter asks for it.
    """
    for (taken, as_taken), (unit, size) in itertools.permutations(OTHER_UNITS.items(), 2):
        if {taken, unit} == {"m", "mm"}:
            continue
        off = np.abs(np.log(ratio / (size / as_taken)))
        wrong = np.asarray(off < np.log(SCATTER_WINDOW))
        if not wrong.any() or (not wrong.all() and (np.abs(np.log(ratio[~wrong])) > np.log(SCATTER_WINDOW)).any()):
            continue
        subject = tuple(name for name, one in zip(names, wrong, strict=True) if one)
        of = "" if wrong.all() else f" of {', '.join(subject)}"
        factor = size / as_taken
        yield (
            float(off[wrong].max()),
            Supposition(
                id="points-in-other-unit",
                subject=subject,
                measured=partial(_scaled, factors=np.where(wrong, factor, 1.0)),
                fix=f"the points{of} are in {_LONG[unit]}, not {_LONG[taken]}: name their columns with _{unit} instead of "
                f"_{taken}, such as x_{unit}, or multiply them by {factor:.6g}",
                size=factor if wrong.all() else 1.0,
                cost=0.02,
            ),
        )


def _expected_scatter(case: Case) -> float | None:
    """Of the nominal tool point, the joints in the unit that their size asks for, metres; None where it hardly moves."""
    for supposition in unit_mistakes(case):
        case = supposition.undo(case)
    scatter = _scatter(case.poses(np.arange(len(case.campaign)))[:, :3, 3])
    return scatter if scatter > NARROW * case.model.robot.reach else None


def _scatter(points: Float[np.ndarray, "n 3"]) -> float:
    """Root mean square distance from the mean, metres."""
    return float(np.sqrt(np.nanvar(points, axis=0).sum()))


def _of_poses(names: tuple[str, ...]) -> Iterator[Supposition]:
    yield Supposition(
        id="left-handed",
        subject=names,
        measured=partial(_turned, both=False),
        fix="exchange the columns x and y (or reverse one axis): the points are in a left-handed frame, the rotations are not",
        cost=0.04,
    )
    orders = {"qw qx qy qz": [1, 2, 3, 0], "qy qz qw qx": [3, 0, 1, 2]}
    for order, taken in orders.items():
        yield Supposition(
            id="quaternion-order",
            subject=names,
            measured=partial(_reordered, taken=taken),
            fix=f"the four columns of the quaternion hold {order}: rename them so",
        )
    yield Supposition(
        id="inverse-poses",
        subject=names,
        measured=_inverted,
        fix="invert the poses: they are those of the tracker in the target's frame",
        cost=0.02,
    )
    yield Supposition(
        id="inverse-poses",
        subject=names,
        measured=_transposed,
        fix="invert the rotations (reverse the sign of qw): they are those of the tracker in the target's frame",
        cost=0.04,
    )


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
