"""Placements of a part as a page: the best ones with their expected error, and a map of the region."""

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np

from taskcal.correction.part_placement import PartPlacements, PlacedPart
from taskcal.report.chart import BLUE, GREEN, INK, ORANGE, VERMILION, Axis, Figure, Heatmap, Panel, Series
from taskcal.report.content import Chart, Column, Facts, Section, TextTable
from taskcal.report.page import Report
from taskcal.report.task import span_of

# Expected error in planes through a placement, or along one axis.

AXES = (*(Axis(title=f"along {name}", unit="mm") for name in "XYZ"), Axis(title="turn", unit="°"))

VIEWS: Mapping[str, tuple[str, str]] = {
    "expected": ("expected_mm", "mm"),
    "before": ("before_mm", "mm"),
    "corrected": ("after_mm", "mm"),
    "force": ("compliance_mm", "mm"),
    "joint margin": ("joint_margin_deg", "°"),
    "executed": ("reached", "share"),
}
"""Views of a map: key of a placement's summary, and its unit."""

COLOURS = (BLUE, ORANGE, GREEN, VERMILION)


def varied_axes(found: PartPlacements) -> list[int]:
    """Numbers of the axes along which the part was moved; 3 is its turn."""
    at = np.array([_at(placed) for placed in found.all])
    return [k for k in range(4) if np.ptp(at[:, k]) > 0.0]


def draw_placements(found: PartPlacements, through: PlacedPart) -> Figure | Mapping[str, Figure]:
    """Draw the expected error about a placement: maps where the part was moved along several axes, else curves.

    Args:
        found: placements along one axis or more.
        through: the one through which the maps go.
    """
    axes = varied_axes(found)
    return _curves(found, axes[0]) if len(axes) == 1 else _maps(found, through, axes)


def _at(placed: PlacedPart) -> tuple[float, ...]:
    """Shift and turn as they are shown, mm and degrees."""
    x, y, z = (round(float(v) * 1e3, 6) for v in placed.shift)
    return x, y, z, round(float(np.degrees(placed.turn)), 6)


def _value(placed: PlacedPart, key: str) -> float | None:
    """A number of a placement; for one that cannot be used the errors would be those of the remaining motions."""
    return placed.summary()[key] if placed.possible or key == "reached" else None


def _known_views(placements: Sequence[PlacedPart]) -> dict[str, tuple[str, str]]:
    """Views that have a number somewhere, and that differ from the ones before."""
    seen: list[list[float | None]] = []
    out: dict[str, tuple[str, str]] = {}
    for label, (key, unit) in VIEWS.items():
        values = [_value(placed, key) for placed in placements]
        if any(value is not None for value in values) and values not in seen:
            seen.append(values)
            out[label] = key, unit
    return out


def _maps(found: PartPlacements, through: PlacedPart, axes: Sequence[int]) -> Mapping[str, Figure]:
    """Planes of two axes, a scale of colours for each view, the same in all planes."""
    planes, middle = list(combinations(axes, 2))[:3], _at(through)
    views = _known_views(found.all)
    drawn: dict[str, list[Panel]] = {label: [] for label in views}
    for plane in planes:
        within = [p for p in found.all if all(_at(p)[k] == middle[k] for k in range(4) if k not in plane)]
        u, v = (sorted({_at(placed)[k] for placed in within}) for k in plane)
        by_place = {tuple(_at(placed)[k] for k in plane): placed for placed in within}
        impossible = [at for at, placed in by_place.items() if not placed.possible]
        marks = tuple(
            Series(
                name=name, x=[at[0] for at in places], y=[at[1] for at in places], colour=INK, shape=shape, hollow=True
            )
            for name, places, shape in (
                ("not possible", impossible, "x"),
                ("this placement", [(middle[plane[0]], middle[plane[1]])], "ring"),
            )
            if places
        )
        for label, (key, _) in views.items():
            values = np.array([[_value(by_place[a, b], key) for a in u] for b in v], dtype=float)
            cells = Heatmap(x=np.array(u), y=np.array(v), z=values)
            drawn[label].append(Panel(x=AXES[plane[0]], y=AXES[plane[1]], cells=cells, series=marks))
    return {
        label: Figure(
            panels=tuple(panels),
            columns=3,
            scale=span_of([panel.cells.z for panel in panels if panel.cells is not None], views[label][1]),
        )
        for label, panels in drawn.items()
    }


def _curves(found: PartPlacements, axis: int) -> Figure:
    """Errors along one axis; nothing is drawn where the program cannot be executed whole."""
    placements = sorted(found.all, key=lambda placed: _at(placed)[axis])
    errors = {label: key for label, (key, unit) in _known_views(placements).items() if unit == "mm"}
    at = [_at(placed)[axis] for placed in placements]
    series = tuple(
        Series(
            kind="line",
            name=label,
            x=at,
            y=np.array([_value(placed, key) for placed in placements], dtype=float),
            colour=colour,
            shape="circle",
        )
        for (label, key), colour in zip(errors.items(), COLOURS, strict=False)
    )
    y = Axis(title="3D error, rms", unit="mm", zero=True)
    return Figure(panels=(Panel(x=AXES[axis], y=y, series=series),))


# Placements of a part as tables and sentences, for the terminal and for pages.

SHOWN = 8
"""Placements of the table; the file and the JSON result have all of them."""

COLUMNS = (
    *(Column(f"{axis} mm", f"{axis}_mm", ".0f", optional=True) for axis in "xyz"),
    Column("turn °", "turn_deg", ".1f", optional=True),
    Column("before mm", "before_mm", ".3f", optional=True),
    Column("after mm", "after_mm", ".3f", optional=True),
    Column("force mm", "compliance_mm", ".3f", optional=True),
    Column("expected mm", "expected_mm", ".3f", optional=True),
    Column("least joint margin °", "joint_margin_deg", ".1f", optional=True),
    Column("singular", "smallest_singular_ratio", ".3f", optional=True),
    Column("targets outside range", lambda placed: placed["outside_targets"] or None, "d", optional=True),
)


def tabulate_placements(found: PartPlacements) -> TextTable:
    """Tabulate the best placements; columns in which no placement has a number are left out."""
    title = f"Best of {len(found.all)} placements of {found.name}; {len(found.ranked)} are feasible and clear of singularities"
    return TextTable.of(title, COLUMNS, [placed.summary() for placed in found.ranked[:SHOWN]])


def tabulate_obstacles(found: PartPlacements) -> TextTable | None:
    """Count rejected placements by their reasons; nothing where none is rejected."""
    reasons = Counter(_reason(placed) for placed in found.all if not placed.possible)
    if not reasons:
        return None
    rows = [(reason, str(number)) for reason, number in reasons.most_common()]
    return TextTable.of_rows("Rejected placements", ("first reason", "placements"), rows)


def _reason(placed: PlacedPart) -> str:
    if placed.reached == 1.0:
        return "near a singularity"
    return placed.obstacle or "no motion is reached"


def state_placement(placed: PlacedPart) -> str:
    """State the expected error of a placement."""
    values = placed.summary()
    if values["expected_mm"] is None:
        return f"not feasible: {placed.obstacle}"
    text = f"{values['expected_mm']:.3f} mm expected, {placed.reached:.0%} of the motions executed"
    return f"{text}: {placed.obstacle}" if placed.obstacle else text


def state_trade(found: PartPlacements, placed: PlacedPart) -> str:
    """State the move to a placement, what it gains and costs, and why it is not worth it where it is not."""
    now, distance = found.now, float(np.linalg.norm(placed.shift)) * 1e3
    text = f"move the part by {distance:.0f} mm and turn it by {np.degrees(placed.turn):.1f}°"
    changes: list[str] = []
    if np.isfinite(now.expected) and now.expected > 0.0:
        change = 1.0 - placed.expected / now.expected
        changes.append(f"{abs(change):.0%} {'less' if change >= 0.0 else 'more'} error")
    if np.isfinite(now.margin) and np.isfinite(placed.margin):
        change = float(np.degrees(placed.margin - now.margin))
        changes.append(f"{abs(change):.0f}° {'less' if change < 0.0 else 'more'} joint margin")
    text += f": {', '.join(changes)}" if changes else ""
    objection = found.objection(placed)
    return f"{text}: not worth it, {objection}" if objection else text


def state_recommendation(found: PartPlacements) -> str:
    """State the placement that is recommended, or that the part had better stay."""
    best = found.recommended
    if best is None:
        return f"none: {found.unmet}" if found.unmet else "leave the part where it is"
    return "the best placement" if best is found.ranked[0] else state_trade(found, best)


MEANING = (
    "Expected errors are 3D rms over the targets. Before: predicted error of the robot, uncertainty included. Corrected: that "
    "uncertainty alone, which no correction removes. Force: deflection of the tool by the stated process force. Placements are "
    "ranked by corrected (by before where there is no calibration) and force. One is recommended "
    "if its error is within the task's tolerance and all of its targets lie within what was measured, if its error is at least "
    "10 % smaller than now, unless the part may not stay, and if its joints have 5° left, or as much as now."
)

UNCALIBRATED = (
    "Before is expected from the tolerances, in the base frame; pass --calibration for the error after correction."
)

_MAPS = (
    "Dark is better for errors, bright for margins. Crosses: not feasible as a whole, or near a singularity. Circle: the best "
    "placement, through which the maps go."
)


def placement_sections(found: PartPlacements, *, calibrated: bool) -> list[Section]:
    """Make the sections of the best placements and of the region.

    Args:
        found: the placements.
        calibrated: whether they are based on a calibration, rather than on tolerances.
    """
    ranked, axes = found.ranked, varied_axes(found)
    facts: list[tuple[str, str] | None] = [("feasible", found.obstacle)]
    if ranked:
        worst = ranked[-1].expected * 1e3
        facts = [
            ("best placement", state_placement(ranked[0])),
            ("to reach it", state_trade(found, ranked[0])),
            ("worst feasible", f"{worst:.3f} mm expected") if len(ranked) > 1 else None,
            ("recommended", state_recommendation(found)),
        ]
    best = Section(
        "Best placements",
        tabulate_placements(found),
        Facts(("present placement", state_placement(found.now)), *facts),
        MEANING,
        None if calibrated else UNCALIBRATED,
    )
    if not axes:
        return [best]
    through = ranked[0] if ranked else max(found.all, key=lambda placed: placed.reached)
    chart = Chart(
        "Expected error over the region",
        draw_placements(found, through),
        _MAPS if len(axes) > 1 else "A gap: the program is not feasible as a whole there, or near a singularity.",
    )
    return [best, Section("Region", chart, tabulate_obstacles(found))]


def placement_page(found: PartPlacements, robot: str, *, calibrated: bool) -> Report:
    """Make the page of placements.

    Args:
        found: the placements.
        robot: its name.
        calibrated: whether they are based on a calibration, rather than on tolerances.
    """
    ranked = found.ranked
    source = "calibrated" if calibrated else "by its tolerances, in its own base"
    return Report(
        title=f"Placement of {found.name}",
        sections=placement_sections(found, calibrated=calibrated),
        lead=f"{len(found.all)} placements before the {robot}, {source}. {len(ranked)} are feasible and clear of singularities. "
        "Collisions are not checked.",
    )
