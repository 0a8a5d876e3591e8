"""Cost of a calibration by each peer, and of Taskcal's passes alone, on logarithmic axes."""

from typing import Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from benchmarks.peers.measure import slope
from benchmarks.peers.scaling import CHAIN_POSES

COLOURS = ("#0072b2", "#e69f00", "#009e73", "#d55e00", "#cc79a7", "#56b4e9", "#000000", "#8c8c8c")
"""Okabe and Ito's, told apart by the colour-blind; markers tell them apart in grey."""
MARKERS = ("circle", "square", "diamond", "cross", "x", "triangle-up", "star", "hexagon")


def draw(result: dict[str, Any]) -> go.Figure:
    """Two panels, a line for each peer."""
    figure = make_subplots(cols=2, horizontal_spacing=0.08)
    for number, name in enumerate(result["peers"]):
        style = {"color": COLOURS[number % len(COLOURS)], "symbol": MARKERS[number % len(MARKERS)]}
        for column, what, size in ((1, "poses", "size"), (2, "parameters", "model_parameters")):
            _line(figure, column, name, result[what].get(name, []), size, style)
    for column, title in enumerate(("poses, 51 unknowns", "parameters, 400 poses"), start=1):
        figure.update_xaxes(type="log", dtick=1, exponentformat="power", title=title, col=column)
        figure.update_yaxes(type="log", dtick=1, exponentformat="power", col=column)
    figure.update_xaxes(tickvals=[10, 20, 50, 100, 200, 400], col=2)
    figure.update_yaxes(title="one calibration, s of processor time", col=1)
    figure.update_layout(
        template="plotly_white",
        margin={"l": 70, "r": 15, "t": 15, "b": 110},
        legend={"orientation": "h", "y": -0.22, "x": 0.0},
    )
    return figure


def draw_scaling(result: dict[str, Any]) -> go.Figure:
    """Three panels of Taskcal alone: its passes against poses and parameters, its studies against robots; slopes at their ends."""
    figure = make_subplots(cols=3, horizontal_spacing=0.07)
    titles = ("poses, 42 parameters", f"parameters, {CHAIN_POSES} poses", "robots, 60 poses each")
    passes = result["scaling"]
    for number, name in enumerate(key for key in passes["poses"][0] if key != "size"):
        style = {"color": COLOURS[number], "symbol": MARKERS[number]}
        for column, what in ((1, "poses"), (2, "parameters")):
            _scaled_line(figure, column, name, passes[what], name, style)
    done = [row for row in result["robots"] if "failed" not in row]
    _scaled_line(figure, 3, "study", done, "warm_s", {"color": COLOURS[2], "symbol": MARKERS[2]})
    for column, title in enumerate(titles, start=1):
        figure.update_xaxes(type="log", dtick=1, exponentformat="power", title=title, col=column)
        figure.update_yaxes(type="log", dtick=1, exponentformat="power", col=column)
    figure.update_xaxes(tickvals=[10, 20, 50, 100, 200, 400], dtick=None, col=2)
    figure.update_yaxes(title="s of processor time", col=1)
    figure.update_layout(
        template="plotly_white",
        margin={"l": 70, "r": 45, "t": 15, "b": 95},
        legend={"orientation": "h", "y": -0.2, "x": 0.0},
    )
    return figure


def _scaled_line(
    figure: go.Figure, column: int, name: str, rows: list[dict[str, Any]], key: str, style: dict[str, str]
) -> None:
    exponent = slope(rows, key)
    figure.add_scatter(
        x=[row["size"] for row in rows],
        y=[row[key] for row in rows],
        text=[""] * (len(rows) - 1) + ["" if exponent is None else f"n<sup>{exponent:.1f}</sup>"],
        textposition="middle right",
        textfont={"color": style["color"], "size": 14},
        cliponaxis=False,
        name=name,
        legendgroup=name,
        showlegend=column in (1, 3),
        mode="lines+markers+text",
        marker={"symbol": style["symbol"], "size": 8},
        line={"color": style["color"]},
        row=1,
        col=column,
    )


def _line(
    figure: go.Figure, column: int, name: str, rows: list[dict[str, Any]], size: str, style: dict[str, str]
) -> None:
    done = [row for row in rows if "failed" not in row]
    figure.add_scatter(
        x=[row[size] for row in done],
        y=[row["warm_s"] for row in done],
        name=name,
        legendgroup=name,
        showlegend=column == 1,
        mode="lines+markers",
        marker={"symbol": style["symbol"], "size": 8},
        line={"color": style["color"]},
        row=1,
        col=column,
    )
