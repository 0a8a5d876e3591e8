"""Figures of a corrected program: its error along the way, and where it goes."""

from collections.abc import Mapping

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float

from taskcal.correction.assessment import Deviations
from taskcal.correction.correction import Correction
from taskcal.presentation.theme import BLUE, ORANGE, VERMILION, styled, styled_space
from taskcal.programs.program import Program

FLOOR = 1e-5
"""Smaller errors are drawn as this, millimetres: what is left there is the rounding of the program's numbers."""

LEAST_ROOM = 5.0
"""Half of what a figure in space shows at least along each axis, millimetres."""

MOST = 20_000
"""Points of a curve; more are thinned out."""


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


def with_decades(figure: go.Figure, title: str) -> go.Figure:
    """The figure with a logarithmic vertical axis in millimetres, labelled at 1, 2 and 5 of each decade over 0.01."""
    ticks = [10.0**k for k in range(-6, -2)] + [m * 10.0**k for k in range(-2, 3) for m in (1, 2, 5)]
    figure.update_yaxes(type="log", title_text=title, tickvals=ticks, ticktext=[f"{tick:.7g}" for tick in ticks])
    return figure


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


def draw_program(correction: Correction) -> go.Figure:
    """Where the program takes the tool, coloured by its error before; in each part's own frame."""
    deviations = correction.before
    position = _positions(correction, deviations)
    figure = go.Figure()
    moves = correction.program.moves
    own = np.array([moves[i].part.name for i in deviations.move])
    top = float(deviations.length.max() * 1e3) if len(deviations.error) else 1.0
    for name in dict.fromkeys(own.tolist()):
        rows = np.flatnonzero((own == name) & np.isfinite(position[:, 0]))
        rows = rows[_thinned(len(rows))]
        if not len(rows):
            continue
        p = position[rows] * 1e3
        figure.add_trace(
            go.Scatter3d(
                x=p[:, 0],
                y=p[:, 1],
                z=p[:, 2],
                mode="markers",
                name=name or "base",
                marker={
                    "size": 2.5,
                    "color": deviations.length[rows] * 1e3,
                    "cmin": 0.0,
                    "cmax": top,
                    "colorscale": "Cividis",
                    "showscale": not figure.data,
                    "colorbar": {"title": {"text": "error before (mm)"}, "len": 0.7},
                },
                hovertemplate="%{marker.color:.3f} mm<extra></extra>",
            )
        )
    styled_space(figure, distance=1.6)
    figure.update_scenes(
        {f"{axis}axis_range": list(limits) for axis, limits in zip("xyz", _room(position), strict=True)}
    )
    return figure


def _room(position: Float[np.ndarray, "k 3"]) -> Float[np.ndarray, "3 2"]:
    """Limits of axes about some points, millimetres; a scene whose axes are drawn to scale needs some depth in each."""
    p = position[np.isfinite(position[:, 0])] * 1e3
    low, high = p.min(axis=0), p.max(axis=0)
    half = np.maximum(0.5 * (high - low), max(0.1 * float((high - low).max()), LEAST_ROOM))
    middle = 0.5 * (low + high)
    return np.stack([middle - 1.05 * half, middle + 1.05 * half], axis=1)


def _positions(correction: Correction, deviations: Deviations) -> Float[np.ndarray, "k 3"]:
    """Wanted tool points in the part; a target is known where the start of its way is not."""
    wanted = correction.wanted
    return np.where(
        deviations.at_target[:, None],
        wanted.end[deviations.move, :3, 3],
        wanted.at(deviations.move, deviations.share)[:, :3, 3],
    )


def _thinned(count: int) -> np.ndarray:
    return np.unique(np.linspace(0, count - 1, min(count, MOST)).astype(int)) if count else np.zeros(0, dtype=int)
