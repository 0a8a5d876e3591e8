"""Figures of a plan: the error to be expected from so many poses, and where they are."""

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float

from taskcal.adaptation.planned import Plan
from taskcal.presentation.theme import BLUE, GREEN, GREY, INK, ORANGE, VERMILION, styled, with_decades
from taskcal.task.workspace import Workspace


def draw_by_count(plan: Plan) -> go.Figure:
    """Expected error over the number of poses, with random and even plans of the same size beside it."""
    figure = go.Figure()
    count = len(plan.q)
    numbers = np.arange(1, len(plan.by_count) + 1)
    error = plan.by_count * 1e3
    # the first few poses do not even find the frames; what is worse than before is not worth the room
    shown = error <= 3.0 * plan.before * 1e3
    figure.add_scatter(
        x=numbers[shown],
        y=error[shown],
        mode="lines+markers",
        name="chosen one by one",
        line={"color": BLUE, "width": 2.5},
        marker={"size": 5},
        hovertemplate="%{x} poses: %{y:.3f} mm<extra>chosen one by one</extra>",
    )
    low, mean, high = plan.random.min() * 1e3, plan.random.mean() * 1e3, plan.random.max() * 1e3
    figure.add_scatter(
        x=[count],
        y=[mean],
        error_y={"symmetric": False, "array": [high - mean], "arrayminus": [mean - low], "width": 6, "thickness": 1.8},
        mode="markers",
        name=f"random poses: mean and range of {len(plan.random)} plans",
        marker={"color": ORANGE, "symbol": "square", "size": 10},
        hovertemplate="%{y:.3f} mm<extra>random poses</extra>",
    )
    for value, name, colour, symbol in (
        (plan.grid, "poses spread evenly", GREEN, "triangle-up"),
        (plan.expected, "this plan, after exchange and refinement", VERMILION, "diamond"),
    ):
        figure.add_scatter(
            x=[count],
            y=[value * 1e3],
            mode="markers",
            name=name,
            marker={"color": colour, "symbol": symbol, "size": 12},
            hovertemplate="%{y:.3f} mm<extra>" + name + "</extra>",
        )
    found = "frames" if plan.way is None else f"{plan.way.label}s"
    start = "calibration as it is" if plan.extends else f"nominal robot, {found} found"
    levels = [(plan.before, start, GREY, "dot")]
    if plan.geometry_allowance:
        less = ", less the model error" if plan.model_error else ""
        levels.append((plan.geometry_allowance, f"accuracy that the task needs{less}", INK, "dash"))
    for value, name, colour, dash in levels:
        figure.add_scatter(
            x=[0, count * 1.03],
            y=[value * 1e3] * 2,
            mode="lines",
            name=name,
            line={"color": colour, "dash": dash, "width": 1.5},
            hoverinfo="skip",
        )
    styled(figure, height=480, top=110)
    figure.update_xaxes(title_text="measured poses", range=[0, count * 1.03])
    with_decades(figure, "expected error (mm, rms)")
    return figure
