"""How every figure looks: colours that colour-blind readers tell apart (Okabe and Ito 2008), fonts, margins."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float

BLUE, ORANGE, GREEN, VERMILION, PURPLE, GREY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#AA4499", "#7A7A7A"
INK, GRID = "#1f2933", "#e3e7eb"

AXIS_COLOURS = {"X": BLUE, "Y": ORANGE, "Z": GREEN}
AXIS_SHAPES = {"X": "circle", "Y": "square", "Z": "diamond"}
SERIES = (VERMILION, BLUE, GREEN, PURPLE, ORANGE, GREY)
FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"


def styled(figure: go.Figure, *, height: int, legend: bool = True, top: int = 60) -> go.Figure:
    """The figure with the house's layout: white, with light grids, its legend above."""
    figure.update_layout(
        template="none",
        height=height,
        font={"family": FONT, "size": 14, "color": INK},
        margin={"l": 70, "r": 20, "t": top, "b": 60},
        showlegend=legend,
        legend={"orientation": "h", "yanchor": "bottom", "y": 1.02, "xanchor": "left", "x": 0.0},
        hoverlabel={"font": {"family": FONT, "size": 13}},
        paper_bgcolor="white",
        plot_bgcolor="white",
        bargap=0.25,
    )
    axis: dict[str, Any] = {
        "gridcolor": GRID,
        "zerolinecolor": "#b8c1ca",
        "linecolor": "#b8c1ca",
        "ticks": "outside",
        "ticklen": 4,
    }
    axis["title"] = {"font": {"size": 14}}
    figure.update_xaxes(automargin=True, zeroline=False, **axis)
    figure.update_yaxes(automargin=True, **axis)
    return figure


def with_decades(figure: go.Figure, title: str) -> go.Figure:
    """The figure with a logarithmic vertical axis whose labels are whole numbers, for the digit alone would be misread.

    Args:
        figure: with all its traces, their values in millimetres or micrometres.
        title: of the axis.
    """
    columns = [getattr(trace, "y", None) for trace in figure.data]
    drawn = [np.asarray(column, dtype=float).ravel() for column in columns if column is not None]
    values = np.concatenate([np.empty(0), *drawn])
    ticks = _ticks(values[np.isfinite(values) & (values > 0.0)])
    return figure.update_yaxes(type="log", title_text=title, tickvals=ticks, ticktext=[f"{tick:.7g}" for tick in ticks])


def _ticks(values: Float[np.ndarray, " n"]) -> list[float]:
    """1, 2 and 5 of each decade over 0.01 and 1 of those below, or even steps where fewer than two of them lie among the values."""
    decades = [10.0**k for k in range(-6, -2)] + [m * 10.0**k for k in range(-2, 6) for m in (1, 2, 5)]
    if len(values) == 0 or sum(values.min() <= tick <= values.max() for tick in decades) > 1:
        return decades
    least, most = float(values.min()), float(values.max())
    size = max((most - least) / 3, 0.05 * most)
    step = next(m * 10.0**k for k in range(-9, 7) for m in (1, 2, 5) if m * 10.0**k >= size)
    first = int(0.7 * least / step)
    return [number * step for number in range(max(first, 1), int(1.4 * most / step) + 2)]


def switch(figure: go.Figure, choices: Mapping[str, Sequence[Any]], *, y: float, x: float = 1.0) -> go.Figure:
    """The figure with a row of buttons above it, or a list where they are many; each choice has its update."""
    buttons = [{"label": label, "method": "update", "args": list(arguments)} for label, arguments in choices.items()]
    figure.update_layout(
        updatemenus=[
            {
                "type": "buttons" if len(buttons) < 4 else "dropdown",
                "direction": "right" if len(buttons) < 4 else "down",
                "buttons": buttons,
                "x": x,
                "xanchor": "right",
                "y": y,
                "yanchor": "bottom",
                "pad": {"r": 0, "t": 0, "b": 4},
                "bgcolor": "white",
                "bordercolor": "#b8c1ca",
                "font": {"size": 13},
            }
        ]
    )
    return figure


def label_panels(figure: go.Figure) -> go.Figure:
    """Panel titles of a figure with several panels, set flush left and in the text's size."""
    figure.update_annotations(font={"family": FONT, "size": 14, "color": INK})
    return figure


def styled_space(figure: go.Figure, *, distance: float) -> go.Figure:
    """A figure of points in space: equal scales in millimetres, seen from the front right at this distance."""
    styled(figure, height=620, top=70)
    axis = {"gridcolor": "#d5dbe1", "backgroundcolor": "white", "showbackground": False}
    figure.update_layout(
        scene={
            **{f"{name}axis": {"title": {"text": f"{name.upper()} (mm)"}, **axis} for name in "xyz"},
            "aspectmode": "data",
            "camera": {
                "eye": {"x": distance, "y": -distance, "z": 0.5 * distance},
                "center": {"x": 0.0, "y": 0.0, "z": -0.12},
            },
        },
        margin={"l": 0, "r": 0, "b": 10},
    )
    return figure


# A figure as JSON, in which no name from a file acts as more than text.

_LINK = re.compile(r"((?:^|[^\\])(?:\\\\)*)(?:<|\\u003[cC])(?=(?:/|\\u002[fF])?[aA]\b)")
"""The beginning of a link or its end, written out or as JSON's escape, but not where the escape is itself escaped."""


def figure_json(figure: "go.Figure") -> str:
    """The figure, for the library that draws it.

    Plotly takes some HTML in labels: emphasis, line feeds and links. None of ours is a link; one in the name of a target or a file
    would lead whoever clicks on it elsewhere.
    """
    return _LINK.sub(r"\1&lt;", str(figure.to_json()))
