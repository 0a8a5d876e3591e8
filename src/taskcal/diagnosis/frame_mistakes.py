"""Measurements in another unit, a left-handed frame, quaternions in another order, inverse poses."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from taskcal.diagnosis.supposition import Case, Supposition
from taskcal.geometry import se3
from taskcal.measurement.campaign import Campaign

SWAP = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""x and y exchanged."""

NARROW, WIDE = 0.02, 5.0
"""Spreads of the points, of the reach, beyond which they may be in another unit. Any points fit any robot that hardly moves once
they are made a thousand times smaller."""


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
    """Another unit of the points, where their spread asks for it."""
    names = case.campaign.targets
    spread = float(np.nanstd(case.campaign.points, axis=0).max())
    scales = (
        (1e3, "_m instead of _mm: they hold metres", spread < NARROW * case.model.robot.reach),
        (1e-3, "_mm instead of _m: they hold millimetres", spread > WIDE * case.model.robot.reach),
    )
    for factor, said, possible in scales:
        if possible:
            yield Supposition(
                id="points-in-metres",
                subject=names,
                measured=partial(_scaled, factor=factor),
                fix=f"name the points' columns with {said}",
            )


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


def _scaled(campaign: Campaign, factor: float) -> Campaign:
    fixed = {name: places * factor for name, places in campaign.reference_points.items()}
    return replace(campaign, points=campaign.points * factor, reference_points=fixed)


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
