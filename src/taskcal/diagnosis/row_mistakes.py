"""Points that stand some rows below or above their joints."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from taskcal.diagnosis.supposition import Case, Supposition
from taskcal.measurement.campaign import Campaign

MOST_ROWS = 12
"""Shifts that are tried; who loses more rows at the top of a file sees it."""


def row_mistakes(case: Case) -> Iterator[Supposition]:
    """Shifts of the points against the joints, one at a time."""
    most = min(MOST_ROWS, len(case.campaign) // 4)
    for k in [step * sign for step in range(1, most + 1) for sign in (1, -1)]:
        where = "below" if k > 0 else "above"
        rows = f"{abs(k)} row{'s' if abs(k) > 1 else ''}"
        yield Supposition(
            id="rows-shifted",
            subject=(f"{k:+d}",),
            measured=partial(shifted, by=k),
            fix=f"the points stand {rows} {where} their joints: move the points' columns {'up' if k > 0 else 'down'} by {rows}",
            cost=0.02,
        )


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
