"""Points that stand some rows below or above their joints."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from jaxtyping import Int

from taskcal.diagnosis.supposition import Case, Supposition
from taskcal.measurement.campaign import Campaign

MOST_ROWS = 12
"""Shifts that are tried; who loses more rows at the top of a file sees it."""


SHIFTED_ALIKE = 0.8
"""Of the rows that are not where they belong, that make it a shift."""

LEAST_SHIFTED = 4
"""Rows."""


def row_mistakes(case: Case) -> Iterator[Supposition]:
    """Shifts of the points against the joints, one at a time."""
    most = min(MOST_ROWS, len(case.campaign) // 4)
    for k in [step * sign for step in range(1, most + 1) for sign in (1, -1)]:
        yield Supposition(
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
    """By how many rows nearly all measurements that stand in a wrong row are off; None if they are off by different numbers."""
    offset = source - np.arange(len(source))
    values, counts = np.unique(offset[offset != 0], return_counts=True)
    if not len(values) or counts.max() < SHIFTED_ALIKE * counts.sum() or counts.max() < LEAST_SHIFTED:
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
