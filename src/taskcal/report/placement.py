"""Placements of a part as a page: the best ones, what they are worth, and a map of the region."""

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float
from plotly.subplots import make_subplots

from taskcal.correction.part_placement import PartPlacements, PlacedPart
from taskcal.report.content import Block, Chart, Numbers, Section, Table, Text
from taskcal.report.page import Page
from taskcal.report.theme import BLUE, GREEN, INK, ORANGE, VERMILION, label_panels, styled, switch

# Figures of placements of a part: what is to be expected in planes through one of them, or along one axis.

AXES = ("along X (mm)", "along Y (mm)", "along Z (mm)", "turn (°)")

VIEWS: Mapping[str, tuple[str, str]] = {
    "expected": ("expected_mm", "mm"),
    "before": ("before_mm", "mm"),
    "corrected": ("after_mm", "mm"),
    "force": ("compliance_mm", "mm"),
    "joint margin": ("joint_margin_deg", "°"),
    "executed": ("reached", "share"),
}
"""What is shown: where it stands among a placement's numbers, and its unit."""

COLOURS = (BLUE, ORANGE, GREEN, VERMILION)


def varied_axes(found: PartPlacements) -> list[int]:
    """Numbers of the axes along which the part was moved; 3 is its turn."""
    at = np.array([_at(placed) for placed in found.all])
    return [k for k in range(4) if np.ptp(at[:, k]) > 0.0]


def draw_placements(found: PartPlacements, through: PlacedPart) -> go.Figure:
    """What is expected about a placement: maps where the part was moved along several axes, else curves.

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
    """What is shown of a placement; of one that cannot be used the errors would be those of the motions that are left."""
    return placed.summary()[key] if placed.possible or key == "reached" else None


def _known_views(placements: Sequence[PlacedPart]) -> dict[str, tuple[str, str]]:
    """Those of the views that have a number somewhere, and that differ from the ones before."""
    seen: list[list[float | None]] = []
    out: dict[str, tuple[str, str]] = {}
    for label, (key, unit) in VIEWS.items():
        values = [_value(placed, key) for placed in placements]
        if any(value is not None for value in values) and values not in seen:
            seen.append(values)
            out[label] = key, unit
    return out


def _maps(found: PartPlacements, through: PlacedPart, axes: Sequence[int]) -> go.Figure:
    """Planes of two axes, a scale of colours for each view, the same in all planes."""
    planes, middle = list(combinations(axes, 2))[:3], _at(through)
    figure = make_subplots(rows=1, cols=len(planes), horizontal_spacing=0.17)
    views = _known_views(found.all)
    drawn: dict[str, list[Float[np.ndarray, "v u"]]] = {label: [] for label in views}
    for col, plane in enumerate(planes, start=1):
        within = [p for p in found.all if all(_at(p)[k] == middle[k] for k in range(4) if k not in plane)]
        u, v = (sorted({_at(placed)[k] for placed in within}) for k in plane)
        by_place = {tuple(_at(placed)[k] for k in plane): placed for placed in within}
        for label, (key, _) in views.items():
            rows = [[_value(by_place[a, b], key) for a in u] for b in v]
            drawn[label].append(np.array(rows, dtype=float))
        figure.add_heatmap(
            x=u,
            y=v,
            z=drawn[next(iter(views))][-1],
            coloraxis="coloraxis",
            hovertemplate="%{x:.0f}, %{y:.0f}: %{z:.3g}<extra></extra>",
            row=1,
            col=col,
        )
        _mark(figure, [place for place, placed in by_place.items() if not placed.possible], "x-thin", col)
        _mark(figure, [(middle[plane[0]], middle[plane[1]])], "circle-open", col)
        figure.update_xaxes(title_text=AXES[plane[0]], row=1, col=col, showgrid=False)
        figure.update_yaxes(title_text=AXES[plane[1]], row=1, col=col, showgrid=False, title_standoff=4)
    styled(figure, height=460, legend=False, top=100)
    figure.update_yaxes(zeroline=False)
    choices = {label: _choice(drawn[label], unit) for label, (_, unit) in views.items()}
    first = next(iter(choices.values()))[1]
    figure.update_layout(
        coloraxis={"colorscale": "Viridis", "colorbar": {"title": {"text": first["coloraxis.colorbar.title.text"]}}}
    )
    figure.update_layout(coloraxis={"cmin": first["coloraxis.cmin"], "cmax": first["coloraxis.cmax"]})
    return label_panels(switch(figure, choices, y=1.08))


def _mark(figure: go.Figure, places: Sequence[tuple[float, ...]], symbol: str, col: int) -> None:
    """Marks on a map."""
    figure.add_scatter(
        x=[place[0] for place in places],
        y=[place[1] for place in places],
        mode="markers",
        marker={"symbol": symbol, "size": 14, "color": INK, "line": {"color": INK, "width": 2}},
        hoverinfo="skip",
        row=1,
        col=col,
    )


def _choice(maps: Sequence[Float[np.ndarray, "v u"]], unit: str) -> tuple[dict[str, object], dict[str, object]]:
    """How a button shows a view: its maps, and its scale of colours."""
    plain = [[[None if np.isnan(value) else float(value) for value in row] for row in values] for values in maps]
    every = np.concatenate([values[np.isfinite(values)] for values in maps])
    low, high = (float(every.min()), float(every.max())) if len(every) else (0.0, 1.0)
    scale = {"coloraxis.cmin": low, "coloraxis.cmax": high if high > low else low + max(abs(low), 1.0) * 1e-3}
    return {"z": plain}, {**scale, "coloraxis.colorbar.title.text": unit}


def _curves(found: PartPlacements, axis: int) -> go.Figure:
    """Errors along the one axis along which the part was moved."""
    figure = go.Figure()
    placements = sorted(found.all, key=_at)
    views = {label: key for label, (key, unit) in _known_views(placements).items() if unit == "mm"}
    for (label, key), colour in zip(views.items(), COLOURS, strict=False):
        figure.add_scatter(
            x=[_at(placed)[axis] for placed in placements],
            y=[_value(placed, key) for placed in placements],
            mode="lines+markers",
            marker={"size": 9},
            line={"color": colour, "width": 2.2},
            name=label,
            hovertemplate="%{x:.0f}: %{y:.3f} mm<extra>" + label + "</extra>",
        )
    styled(figure, height=420)
    figure.update_xaxes(title_text=AXES[axis])
    return figure.update_yaxes(title_text="error in space (mm, rms)", rangemode="tozero")


# Placements of a part as tables and sentences, for the terminal and for pages.

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


MEANING = (
    "Expected errors are root mean squares in space over the targets. Before is the robot's error as it is known, with its "
    "uncertainty; corrected is that uncertainty alone, which no correction takes away; force is how far the stated force of the "
    "process deflects the tool. What decides is corrected, or before where there is no calibration, and force."
)

_MAPS = (
    "Dark is better for errors, bright for margins. Crosses cannot be executed whole or come near a singular posture; the circle "
    "is the best placement, through which the maps go."
)


def placement_page(found: PartPlacements, robot: str, *, calibrated: bool, version: str) -> Page:
    """The page of placements.

    Args:
        found: the placements.
        robot: its name.
        calibrated: whether a calibration stands behind them, rather than tolerances.
        version: of the package, for the footer.
    """
    ranked = found.ranked
    blocks: list[Block] = [Numbers(_numbers(found))]
    said = [f"As it stands: {state_placement(found.now)}."]
    if ranked:
        said += [f"Best: {state_placement(ranked[0])}.", f"It costs {state_cost(found.now, ranked[0])}."]
    blocks.append(Text((*said, MEANING)))
    if ranked:
        blocks.append(tabulate_placements(found))
    sections = [Section(title="Where to put it", blocks=tuple(blocks))]
    axes = varied_axes(found)
    if axes:
        through = ranked[0] if ranked else max(found.all, key=lambda placed: placed.reached)
        chart = Chart(
            title="What is to be expected over the region",
            least_width=700 if len(axes) > 2 else 0,
            figure=draw_placements(found, through),
            note=_MAPS
            if len(axes) > 1
            else "A gap: the program cannot be executed whole there, or comes near a singular posture.",
        )
        sections.append(Section(title="The region", blocks=(chart, *tabulate_obstacles(found))))
    source = "by its calibration" if calibrated else "by its tolerances, in its own base"
    return Page(
        title=f"Where to put {found.name}",
        sections=tuple(sections),
        lead=f"{len(found.all)} placements before the {robot}, {source}. {len(ranked)} can be executed whole, clear of singular "
        "postures. Collisions are not looked at.",
        footer=f"Taskcal {version}.",
    )


def _numbers(found: PartPlacements) -> tuple[tuple[str, str, str], ...]:
    items = [(f"{len(found.ranked)} of {len(found.all)}", "", "placements can be executed whole")]
    if found.ranked:
        best = found.ranked[0]
        items.append((f"{best.expected * 1e3:.3f}", "mm", "expected at the best"))
        items.append((f"{found.ranked[-1].expected * 1e3:.3f}", "mm", "expected at the worst of them"))
    if found.now.possible:
        items.append((f"{found.now.expected * 1e3:.3f}", "mm", "expected where it stands"))
    return tuple(items)
