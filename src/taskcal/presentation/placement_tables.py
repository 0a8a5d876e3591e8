"""Placements of a part as tables and sentences, for the terminal and for pages."""

from collections import Counter

import numpy as np

from taskcal.correction.part_placement import PartPlacements, PlacedPart
from taskcal.presentation.content import Table

SHOWN = 8
"""Placements of the table; the file and the JSON result have all of them."""

COLUMNS = (
    ("x mm", "x_mm", 0),
    ("y mm", "y_mm", 0),
    ("z mm", "z_mm", 0),
    ("turn °", "turn_deg", 1),
    ("before mm", "before_mm", 3),
    ("after mm", "after_mm", 3),
    ("force mm", "compliance_mm", 3),
    ("expected mm", "expected_mm", 3),
    ("least joint margin °", "joint_margin_deg", 1),
    ("singular", "smallest_singular_ratio", 3),
)


def tabulate_placements(found: PartPlacements) -> Table:
    """The best placements; columns in which no placement has a number are left out."""
    ranked = found.ranked
    shown = [placed.summary() for placed in ranked[:SHOWN]]
    columns = [column for column in COLUMNS if any(values[column[1]] is not None for values in shown) or not shown]
    rows = [
        tuple("–" if values[key] is None else f"{values[key]:.{digits}f}" for _, key, digits in columns)
        for values in shown
    ]
    title = f"Best of {len(found.all)} placements of {found.name}; {len(ranked)} can be executed whole, clear of singular postures"
    return Table.of_rows(title, tuple(name for name, _, _ in columns), rows, text_columns=())


def tabulate_obstacles(found: PartPlacements) -> tuple[Table, ...]:
    """Why placements fall away, with how many each reason does; nothing where none does."""
    reasons = Counter(_reason(placed) for placed in found.all if not placed.possible)
    if not reasons:
        return ()
    rows = [(reason, str(number)) for reason, number in reasons.most_common()]
    return (Table.of_rows("Placements that cannot be used", ("first reason", "placements"), rows),)


def _reason(placed: PlacedPart) -> str:
    if placed.reached == 1.0:
        return "comes near a singular posture"
    return placed.obstacle or "nothing of it is reached"


def state_placement(placed: PlacedPart) -> str:
    """What is to be expected at a placement, in words."""
    values = placed.summary()
    if values["expected_mm"] is None:
        return f"cannot be executed: {placed.obstacle}"
    text = f"{values['expected_mm']:.3f} mm expected, {placed.reached:.0%} of the motions executed"
    return f"{text}: {placed.obstacle}" if placed.obstacle else text


def state_cost(now: PlacedPart, best: PlacedPart) -> str:
    """What the best placement costs, and what it gives."""
    way = float(np.linalg.norm(best.shift)) * 1e3
    text = f"to move the part by {way:.0f} mm and turn it by {np.degrees(best.turn):.1f}°"
    if np.isfinite(now.expected) and now.expected > 0.0:
        text += f", for {1.0 - best.expected / now.expected:.0%} less error"
    return text
