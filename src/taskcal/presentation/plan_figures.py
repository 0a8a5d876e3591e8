"""Figures of a plan: the error to be expected from so many poses, and where they are."""

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float

from taskcal.adaptation.plan import Plan
from taskcal.presentation.theme import BLUE, GREEN, GREY, INK, ORANGE, VERMILION, styled, styled_space
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
    start = "calibration as it is" if plan.extends else "nominal robot, frames found"
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
    figure.update_yaxes(title_text="expected error (mm, rms)", type="log", dtick="D2")
    return figure


def draw_plan(points: Float[np.ndarray, "n 3"], axes: Float[np.ndarray, "n 3"], space: Workspace | None) -> go.Figure:
    """Where the planned poses are, in the order in which to measure them, and the task's workspace.

    Args:
        points: tool points in the base, metres.
        axes: z axes of the tool in the base.
        space: the task's workspace; None for a list of poses or a path.
    """
    figure = go.Figure()
    x, y, z = points.T * 1e3
    length = 0.12 * float(np.ptp(points, axis=0).max()) * 1e3
    figure.add_scatter3d(
        x=x, y=y, z=z, mode="lines", name="way", line={"color": "#b8c1ca", "width": 2}, hoverinfo="skip"
    )
    stems = np.full((len(points), 3, 3), np.nan)
    stems[:, 0], stems[:, 1] = points * 1e3, points * 1e3 - axes * length
    sx, sy, sz = stems.reshape(-1, 3).T
    figure.add_scatter3d(
        x=sx,
        y=sy,
        z=sz,
        mode="lines",
        name="tool, seen from its point",
        line={"color": BLUE, "width": 4},
        hoverinfo="skip",
    )
    figure.add_scatter3d(
        x=x,
        y=y,
        z=z,
        mode="markers",
        name="tool points",
        marker={
            "size": 5,
            "color": np.arange(len(points)),
            "colorscale": "Viridis",
            "colorbar": {"title": {"text": "order"}, "len": 0.7},
        },
        hovertemplate="pose %{marker.color}: %{x:.0f} %{y:.0f} %{z:.0f} mm<extra></extra>",
    )
    if space is not None:
        ex, ey, ez = outline(space).T * 1e3
        figure.add_scatter3d(
            x=ex,
            y=ey,
            z=ez,
            mode="lines",
            name="workspace of the task",
            line={"color": INK, "width": 3},
            hoverinfo="skip",
        )
    return styled_space(figure, distance=1.3)


def outline(space: Workspace) -> Float[np.ndarray, "k 3"]:
    """Edges of a workspace in the base, metres; NaN between the strokes."""
    if space.shape == "box":
        corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]) - 0.5
        rings = [np.c_[corners, np.full(5, side)] for side in (-0.5, 0.5)]
        posts = [np.array([[*corner, -0.5], [*corner, 0.5]]) for corner in corners[:4]]
    else:
        angle = np.linspace(0.0, 2.0 * np.pi, 49)
        circle = 0.5 * np.c_[np.cos(angle), np.sin(angle)]
        rings = [np.c_[circle, np.full(49, side)] for side in (-0.5, 0.5)]
        posts = [np.array([[*circle[k], -0.5], [*circle[k], 0.5]]) for k in (0, 12, 24, 36)]
    gap = np.full((1, 3), np.nan)
    local = np.concatenate([part for stroke in (*rings, *posts) for part in (stroke, gap)]) * space.size
    in_frame = space.center + local @ space.turned.T
    return in_frame @ space.T_base_frame[:3, :3].T + space.T_base_frame[:3, 3]
