"""Theme of the figures: colours that colour-blind readers distinguish (Okabe and Ito 2008), fonts, margins."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float

BLUE, ORANGE, GREEN, VERMILION, PURPLE, GREY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#AA4499", "#7A7A7A"
INK, GRID = "#1f2933", "#e3e7eb"

AXIS_COLOURS = {"X": BLUE, "Y": ORANGE, "Z": GREEN}
SHAPES = ("circle", "square", "diamond", "triangle-up", "cross", "x")
"""Of series, which differ without colour, too."""
SERIES = (VERMILION, BLUE, GREEN, PURPLE, ORANGE, GREY)
FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"


_AXIS = {
    "automargin": True,
    "gridcolor": GRID,
    "zerolinecolor": "#b8c1ca",
    "linecolor": "#b8c1ca",
    "ticks": "outside",
    "ticklen": 4,
    "title": {"font": {"size": 14}},
}

TEMPLATE = go.layout.Template(
    layout={
        "font": {"family": FONT, "size": 14, "color": INK},
        "paper_bgcolor": "white",
        "plot_bgcolor": "white",
        "bargap": 0.25,
        "legend": {"orientation": "h", "yanchor": "bottom", "y": 1.02, "xanchor": "left", "x": 0.0},
        "hoverlabel": {"font": {"family": FONT, "size": 13}},
        "xaxis": {**_AXIS, "zeroline": False},
        "yaxis": _AXIS,
        "coloraxis": {"colorscale": "Viridis"},
    }
)
"""White, with light grids and the legend above."""


def styled(
    figure: go.Figure, *, height: int, x: str = "", y: str = "", zero: bool = False, legend: bool = True, top: int = 60
) -> go.Figure:
    """The figure in the template of all reports.

    Args:
        figure: with its panels.
        height: CSS pixels.
        x: title of the horizontal axes, if all have one.
        y: title of the vertical axes, likewise.
        zero: whether vertical axes begin at zero.
        legend: whether there is one.
        top: margin above the panels, CSS pixels.
    """
    figure.update_layout(
        template=TEMPLATE, height=height, margin={"l": 70, "r": 20, "t": top, "b": 60}, showlegend=legend
    )
    figure.update_annotations(font={"size": 14})  # titles of panels, which are larger otherwise
    if x:
        figure.update_xaxes(title_text=x)
    if y:
        figure.update_yaxes(title_text=y)
    return figure.update_yaxes(rangemode="tozero") if zero else figure


def add_series(
    figure: go.Figure,
    name: str,
    x: Any,
    y: Any,
    colour: Any,
    *,
    hover: str = "",
    mode: str = "markers",
    extra: str = "",
    dash: str = "solid",
    width: float = 2.2,
    **options: Any,
) -> go.Figure:
    """Add points or a line.

    Args:
        figure: to which.
        name: in the legend.
        x: horizontal values.
        y: vertical values.
        colour: of points and line.
        hover: template of the numbers that are shown at a point; nothing is shown without one.
        mode: ``markers``, ``lines`` or both.
        extra: beside the numbers at a point; the name by default.
        dash: of the line.
        width: of the line.
        options: of `go.Scatter`, or of its panel; a dictionary `marker` is added to the colour.
    """
    marker = {"color": colour, **options.pop("marker", {})}
    line = {"line": {"color": colour, "width": width, "dash": dash}} if "lines" in mode else {}
    shown = {"hovertemplate": f"{hover}<extra>{extra or name}</extra>"} if hover else {"hoverinfo": "skip"}
    return figure.add_scatter(x=x, y=y, name=name, mode=mode, marker=marker, **{**line, **shown, **options})


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


def switch(figure: go.Figure, choices: Mapping[str, Sequence[Any]], *, y: float, active: int = 0) -> go.Figure:
    """The figure with a row of buttons above it, or a list where they are many; each choice has its update."""
    buttons = [{"label": label, "method": "update", "args": list(arguments)} for label, arguments in choices.items()]
    few = len(buttons) < 4
    menu = {
        "type": "buttons" if few else "dropdown",
        "direction": "right" if few else "down",
        "buttons": buttons,
        "active": active,
        "x": 1.0,
        "xanchor": "right",
        "y": y,
        "yanchor": "bottom",
        "pad": {"r": 0, "t": 0, "b": 4},
        "bgcolor": "white",
        "bordercolor": "#b8c1ca",
        "font": {"size": 13},
    }
    return figure.update_layout(updatemenus=[menu]) if len(buttons) > 1 else figure


def show_one(owner: Sequence[int], which: int) -> dict[str, list[bool]]:
    """Update of a `switch` that shows the traces of one choice, and those of none (−1), which stay."""
    return {"visible": [o in (which, -1) for o in owner]}


def draw_slices(
    figure: go.Figure,
    maps: Mapping[str, Sequence[np.ndarray]],
    spans: Mapping[str, tuple[float, float, str]],
    *,
    y: float,
) -> go.Figure:
    """Give the heat maps of a figure one scale of colours for each view, and a button for each.

    Args:
        figure: with a heat map of the first view in each panel.
        maps: of each view, one for each panel.
        spans: smallest and largest value of each view, and its unit.
        y: where the buttons are.
    """
    choices: dict[str, Sequence[Any]] = {}
    for label, values in maps.items():
        # JSON has no NaN
        plain = [[[None if np.isnan(v) else v for v in row] for row in each.tolist()] for each in values]
        low, high, unit = spans[label]
        scale = {"coloraxis.cmin": low, "coloraxis.cmax": high, "coloraxis.colorbar.title.text": unit}
        choices[label] = ({"z": plain}, scale)
    low, high, unit = next(iter(spans.values()))
    figure.update_layout(coloraxis={"cmin": low, "cmax": high, "colorbar": {"title": {"text": unit}}})
    figure.update_xaxes(showgrid=False)
    figure.update_yaxes(showgrid=False, zeroline=False)
    return switch(figure, choices, y=y)


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
    would lead whoever clicks on it elsewhere. Python's own encoder takes a file's name that is not text, and orjson does not.
    """
    return _LINK.sub(r"\1&lt;", str(figure.to_json(engine="json")))
