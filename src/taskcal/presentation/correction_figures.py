"""Figures of a corrected program: its error along the way, and where it goes."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float

from taskcal.correction.assessment import Deviations
from taskcal.correction.correction import Correction
from taskcal.presentation.content import Scene
from taskcal.presentation.space import coloured_points, spread_rows, to_mm
from taskcal.presentation.theme import BLUE, GREY, ORANGE, VERMILION, styled, with_decades
from taskcal.programs.program import Program

FLOOR = 1e-5
"""Smaller errors are drawn as this, millimetres: what is left there is the rounding of the program's numbers."""

MOST = 20_000
"""Points of a curve; more are thinned out."""

MOST_IN_SPACE = 4000
"""Points in space; more would only hide each other."""


def draw_errors_along(correction: Correction) -> go.Figure:
    """Predicted error in space along the program, before and after."""
    lines = {"before": correction.before, "after": correction.after}
    return draw_errors(correction.program, lines, "predicted error (mm)")


def draw_errors(program: Program, lines: Mapping[str, Deviations], title: str) -> go.Figure:
    """Error in space along a program, in two or three lines by what they are called, on a logarithmic scale."""
    figure = go.Figure()
    colours = (VERMILION, ORANGE, BLUE) if len(lines) > 2 else (VERMILION, BLUE)
    for (label, deviations), colour in zip(lines.items(), colours, strict=True):
        rows = _thinned(len(deviations.error))
        line = [program.moves[i].place.line for i in deviations.move[rows]]
        figure.add_trace(
            go.Scatter(
                x=deviations.move[rows] + deviations.share[rows],
                y=np.maximum(deviations.length[rows] * 1e3, FLOOR),
                mode="lines",
                name=label,
                line={"color": colour, "width": 1.2},
                customdata=line,
                hovertemplate="line %{customdata}: %{y:.3f} mm<extra>" + label + "</extra>",
            )
        )
    figure.update_xaxes(title_text="motion, in the order of the program")
    return with_decades(styled(figure, height=420), title)


def draw_errors_per_axis(correction: Correction) -> go.Figure:
    """Distribution of the errors along the part's axes at targets, before and after."""
    figure = go.Figure()
    for label, deviations, colour in (("before", correction.before, VERMILION), ("after", correction.after, BLUE)):
        rows = np.flatnonzero(deviations.at_target)
        for axis, name in enumerate("XYZ"):
            figure.add_trace(
                go.Box(
                    x=[name] * len(rows),
                    y=deviations.error[rows, axis] * 1e3,
                    name=label,
                    legendgroup=label,
                    showlegend=axis == 0,
                    offsetgroup=label,
                    marker={"color": colour, "size": 3},
                    line={"width": 1.2},
                    boxpoints=False,
                )
            )
    figure.update_layout(boxmode="group")
    figure.update_yaxes(title_text="true less wanted (mm)")
    figure.update_xaxes(title_text="axis of the part")
    return styled(figure, height=380)


def draw_program(correction: Correction) -> Scene:
    """Where the program takes the tool, coloured by its error before; in each part's own frame."""
    deviations = correction.before
    position = _positions(correction, deviations)
    moves = correction.program.moves
    own = np.array([moves[i].part.name for i in deviations.move])
    top = float(deviations.length.max() * 1e3) if len(deviations.error) else 1.0
    layers: list[Mapping[str, Any]] = []
    for name in dict.fromkeys(own.tolist()):
        rows = np.flatnonzero((own == name) & np.isfinite(position[:, 0]))
        rows = rows[spread_rows(len(rows), MOST_IN_SPACE)]
        if len(rows):
            length = deviations.length[rows] * 1e3
            lines = [moves[i].place.line for i in deviations.move[rows]]
            tips = [f"line {line}: {error:.3f} mm" for line, error in zip(lines, length, strict=True)]
            label = f"{name or 'base'}: error before, dark 0 to bright {top:.3f} mm"
            way = {"kind": "strokes", "label": f"{name or 'base'}: way", "colour": GREY, "width": 2}
            layers.append({**way, "at": [to_mm(position[rows])]})
            layers.append(coloured_points(label, position[rows], length, (0.0, top), tips))
    return Scene(
        title="Where the program goes",
        layers=tuple(layers),
        note="Bright points are those that the robot misses most without the correction; a bright corner is where the part "
        "would be worst. Every part in its own frame.",
    )


def _positions(correction: Correction, deviations: Deviations) -> Float[np.ndarray, "k 3"]:
    """Wanted tool points in the part."""
    return correction.wanted.at(deviations.move, deviations.share)[:, :3, 3]


def _thinned(count: int) -> np.ndarray:
    return np.unique(np.linspace(0, count - 1, min(count, MOST)).astype(int)) if count else np.zeros(0, dtype=int)
