"""Figures of a task: errors and effects over slices of its workspace, or pose by pose along a list or a path."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float
from plotly.subplots import make_subplots

from taskcal.planning.task_map import Maps, Slice, TaskCurves, TaskMaps
from taskcal.report.content import Block, Chart, Section, Text
from taskcal.report.theme import AXIS_COLOURS, SERIES, label_panels, styled, switch, with_decades
from taskcal.robot.error_model import ErrorModel

COLOURS = "Viridis"


def draw_maps(slices: Sequence[Slice], views: Mapping[str, Maps], *, from_zero: bool = False) -> go.Figure:
    """Heat maps over slices of a workspace, a colour scale for each view, the same in all slices.

    Args:
        slices: planes through the middle of the workspace.
        views: what to choose from, each with a map in metres for every slice.
        from_zero: begin the scales at zero instead of the smallest value.
    """
    figure = make_subplots(
        rows=1,
        cols=len(slices),
        horizontal_spacing=0.14,
        subplot_titles=[f"{at.plane[0].upper()}–{at.plane[1].upper()} through the middle" for at in slices],
    )
    drawn = {label: [_millimetres(values) for values in maps] for label, maps in views.items()}
    ranges = {label: _range(maps, from_zero) for label, maps in drawn.items()}
    first = next(iter(drawn))
    for col, (at, values) in enumerate(zip(slices, drawn[first], strict=True), start=1):
        figure.add_heatmap(
            x=at.u * 1e3,
            y=at.v * 1e3,
            z=values,
            coloraxis="coloraxis",
            zsmooth="best" if np.all(at.reached) else False,
            hovertemplate="%{x:.0f}, %{y:.0f} mm: %{z:.3g} mm<extra></extra>",
            row=1,
            col=col,
        )
        figure.update_xaxes(title_text=f"{at.plane[0].upper()} from the middle (mm)", row=1, col=col)
        figure.update_yaxes(title_text=f"{at.plane[1].upper()} (mm)", row=1, col=col, title_standoff=4)
        anchor = "x" if col == 1 else f"x{col}"
        figure.update_yaxes(scaleanchor=anchor, constrain="domain", row=1, col=col)
        figure.update_xaxes(constrain="domain", row=1, col=col)
    several = len(drawn) > 1
    styled(figure, height=430 + 40 * several, legend=False, top=60 + 50 * several)
    low, high = ranges[first]
    figure.update_layout(
        coloraxis={"colorscale": COLOURS, "colorbar": {"title": {"text": "mm"}, "len": 1.0}, "cmin": low, "cmax": high}
    )
    figure.update_xaxes(showgrid=False)
    figure.update_yaxes(showgrid=False, zeroline=False)
    if several:
        switch(figure, {label: _choice(maps, ranges[label]) for label, maps in drawn.items()}, y=1.12)
    return label_panels(figure)


def _choice(maps: Sequence[np.ndarray], span: tuple[float, float]) -> tuple[dict[str, Any], dict[str, Any]]:
    plain = [[[None if np.isnan(v) else v for v in row] for row in values.tolist()] for values in maps]
    return {"z": plain}, {"coloraxis.cmin": span[0], "coloraxis.cmax": span[1]}


def _millimetres(values: Float[np.ndarray, "v u"]) -> Float[np.ndarray, "v u"]:
    """Rounded to four digits or so, for the size of the page."""
    scaled = values * 1e3
    top = float(np.nanmax(np.abs(scaled), initial=1e-6))
    return np.round(scaled, max(0, 4 - int(np.ceil(np.log10(max(top, 1e-6))))))


def _range(maps: Sequence[np.ndarray], from_zero: bool) -> tuple[float, float]:
    every = np.concatenate([values[~np.isnan(values)] for values in maps])
    if not len(every):
        return 0.0, 1.0
    low, high = 0.0 if from_zero else float(every.min()), float(every.max())
    return (low, high) if high > low else (low, low + 1.0)


def draw_curves(curves: Mapping[str, Float[np.ndarray, " n"]]) -> go.Figure:
    """Errors in space pose by pose, along a path or a list.

    Args:
        curves: values by what they are, metres.
    """
    figure = go.Figure()
    for k, (label, values) in enumerate(curves.items()):
        figure.add_scatter(
            x=np.arange(len(values)),
            y=values * 1e3,
            mode="lines+markers" if len(values) < 60 else "lines",
            name=label,
            line={"color": SERIES[k % len(SERIES)], "width": 2.2},
            hovertemplate="pose %{x}: %{y:.3f} mm<extra>" + label + "</extra>",
        )
    styled(figure, height=420, top=80)
    figure.update_xaxes(title_text="pose of the task")
    with_decades(figure, "error in space (mm)")
    return figure


def draw_bands(bands: Mapping[str, Float[np.ndarray, "n 3"]]) -> go.Figure:
    """Intervals of 95 % about zero on X, Y and Z, pose by pose.

    Args:
        bands: standard deviations per axis by what they are, metres; the widest first. One is shown at a time at first,
            the last: beside the widest the others could not be seen.
    """
    figure = make_subplots(rows=3, cols=1, shared_xaxes=True, vertical_spacing=0.05, row_titles=["X", "Y", "Z"])
    owner: list[int] = []
    last = len(bands) - 1
    fills = ("rgba(122,122,122,0.30)", "rgba(0,114,178,0.45)", "rgba(213,94,0,0.5)")
    for row, axis in enumerate(AXIS_COLOURS, start=1):
        for k, (label, deviation) in enumerate(bands.items()):
            half = 1.96e3 * deviation[:, row - 1]
            x = np.arange(len(half))
            owner += [k, k]
            figure.add_scatter(
                x=np.concatenate([x, x[::-1]]),
                y=np.concatenate([half, -half[::-1]]),
                fill="toself",
                fillcolor=fills[k % 3],
                line={"width": 0.5, "color": fills[k % 3]},
                mode="lines",
                name=label,
                legendgroup=label,
                showlegend=row == 1,
                visible=k == last,
                hoverinfo="skip",
                row=row,
                col=1,
            )
            figure.add_scatter(
                x=x,
                y=half,
                visible=k == last,
                mode="lines",
                line={"width": 0},
                showlegend=False,
                hovertemplate="pose %{x}: ±%{y:.3f} mm<extra>" + f"{axis}, {label}</extra>",
                row=row,
                col=1,
            )
    styled(figure, height=580, top=100)
    figure.update_yaxes(title_text="mm")
    if len(bands) > 1:
        choices = {label: ({"visible": [o == k for o in owner]},) for k, label in reversed(list(enumerate(bands)))}
        switch(figure, choices | {"together": ({"visible": [True] * len(owner)},)}, y=1.04)
    figure.update_xaxes(title_text="pose of the task", row=3, col=1)
    return label_panels(figure)


# The part of a report that says where in a task the errors are.


def task_section(model: ErrorModel, maps: TaskMaps | TaskCurves, identified: str, measured: str) -> Section:
    """Where in the task the errors are.

    Args:
        model: the model.
        maps: maps or curves.
        identified: which parameters are identified, in words.
        measured: at which poses, in words.
    """
    frames = (
        "Before is what remains when the measurements only serve to find the tracker's frame and the targets, after when "
        f"{identified} are identified as well, from {measured}. Both are root mean squares to be expected in the tracker's frame, "
        "in closed form; the tolerances alone are in the robot's own base, where nothing is fitted."
    )
    blocks: tuple[Block, ...]
    if isinstance(maps, TaskCurves):
        curves = {"tolerances alone": maps.tolerance, "before": maps.before, "after": maps.after}
        blocks = (
            Text((frames,)),
            Chart(
                title="Error to be expected, pose by pose",
                figure=draw_curves(curves),
                note="The farther the lowest line lies below the others, the more identification is worth there. "
                "Logarithmic scale.",
            ),
        )
    else:
        shown = "Bright is worse. Drawn in one tool orientation, that of the task's middle. White: out of the robot's reach there."
        labels = {p.name: p.label for p in model.parameters}
        # the strongest first: it is what a reader sees before choosing
        strongest = sorted(
            maps.effects, key=lambda name: -max(float(np.nanmax(m, initial=0.0)) for m in maps.effects[name])
        )
        blocks = (
            Text((frames,)),
            Chart(
                title="Error to be expected before identification and after",
                least_width=700,
                figure=draw_maps(
                    maps.slices, {"after": maps.after, "before": maps.before, "tolerances": maps.tolerance}
                ),
                note=f"{shown} Each view has its own scale of colours.",
            ),
            Chart(
                title="Effect of a single parameter's tolerance in space",
                least_width=700,
                figure=draw_maps(maps.coarse, {labels[name]: maps.effects[name] for name in strongest}, from_zero=True),
                note="One colour all over: the defect moves the whole task alike. Bright corners: it matters there "
                "most. Choose the "
                "parameter in the list, which begins with the strongest. Each has its own scale of colours.",
            ),
        )
    return Section(title="Where in the task", blocks=blocks)
