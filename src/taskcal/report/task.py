"""Figures of a task: errors and effects over slices of its workspace, or pose by pose along a list or a path."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float
from plotly.subplots import make_subplots

from taskcal.planning.task_map import Maps, Slice, TaskCurves, TaskMaps
from taskcal.report.content import COVERAGE, NOMINAL, Chart, Section
from taskcal.report.theme import (
    AXIS_COLOURS,
    SERIES,
    add_series,
    draw_slices,
    show_one,
    styled,
    switch,
    with_decades,
)
from taskcal.robot.error_model import ErrorModel

MAX_MARKED = 60
"""Poses up to which a curve has a mark at each; more would run together."""


def draw_maps(slices: Sequence[Slice], views: Mapping[str, Maps], *, from_zero: bool = False) -> go.Figure:
    """Draw heat maps over slices of a workspace, a colour scale for each view, the same in all slices.

    Args:
        slices: planes through the middle of the workspace.
        views: what to choose from, each with a map in metres for every slice.
        from_zero: begin the scales at zero instead of the smallest value.
    """
    titles = [f"{at.plane[0].upper()}–{at.plane[1].upper()} through the middle" for at in slices]
    figure = make_subplots(rows=1, cols=len(slices), horizontal_spacing=0.14, subplot_titles=titles)
    drawn = {label: [_millimetres(values) for values in maps] for label, maps in views.items()}
    several = len(drawn) > 1
    styled(figure, height=430 + 40 * several, legend=False, top=60 + 50 * several)
    for col, (at, values) in enumerate(zip(slices, next(iter(drawn.values())), strict=True), start=1):
        place: dict[str, Any] = {"row": 1, "col": col, "constrain": "domain"}
        figure.add_heatmap(
            x=at.u * 1e3, y=at.v * 1e3, z=values, coloraxis="coloraxis", zsmooth="best" if np.all(at.reached) else False,
            hovertemplate="%{x:.0f}, %{y:.0f} mm: %{z:.3g} mm<extra></extra>", row=1, col=col,
        )  # fmt: skip
        figure.update_xaxes(title_text=f"{at.plane[0].upper()} from the middle (mm)", **place)
        figure.update_yaxes(
            title_text=f"{at.plane[1].upper()} (mm)",
            title_standoff=4,
            scaleanchor="x" if col == 1 else f"x{col}",
            **place,
        )
    return draw_slices(figure, drawn, {label: _span(maps, from_zero) for label, maps in drawn.items()}, y=1.12)


def _millimetres(values: Float[np.ndarray, "v u"]) -> Float[np.ndarray, "v u"]:
    """Rounded to four digits or so, for the size of the page."""
    scaled = values * 1e3
    top = float(np.nanmax(np.abs(scaled), initial=1e-6))
    return np.round(scaled, max(0, 4 - int(np.ceil(np.log10(max(top, 1e-6))))))


def _span(maps: Sequence[np.ndarray], from_zero: bool) -> tuple[float, float, str]:
    every = np.concatenate([values[~np.isnan(values)] for values in maps])
    if not len(every):
        return 0.0, 1.0, "mm"
    low, high = 0.0 if from_zero else float(every.min()), float(every.max())
    return low, high if high > low else low + 1.0, "mm"


def draw_curves(curves: Mapping[str, Float[np.ndarray, " n"]]) -> go.Figure:
    """Draw 3D errors pose by pose, along a path or a list.

    Args:
        curves: values by what they are, metres.
    """
    figure = go.Figure()
    for k, (label, values) in enumerate(curves.items()):
        mode = "lines+markers" if len(values) < MAX_MARKED else "lines"
        add_series(
            figure, label, np.arange(len(values)), values * 1e3, SERIES[k % len(SERIES)], mode=mode, hover="pose %{x}: %{y:.3f} mm"
        )  # fmt: skip
    return with_decades(styled(figure, height=420, x="pose of the task", top=80), "3D error (mm)")


def draw_bands(bands: Mapping[str, Float[np.ndarray, "n 3"]]) -> go.Figure:
    """Draw intervals of 95 % about zero on X, Y and Z, pose by pose.

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
            half = COVERAGE * 1e3 * deviation[:, row - 1]
            x, fill = np.arange(len(half)), fills[k % len(fills)]
            owner += [k, k]
            both_x, both_y = np.concatenate([x, x[::-1]]), np.concatenate([half, -half[::-1]])
            shared: dict[str, Any] = {"mode": "lines", "visible": k == last, "row": row, "col": 1}
            add_series(
                figure, label, both_x, both_y, fill, fill="toself", fillcolor=fill, width=0.5, legendgroup=label,
                showlegend=row == 1, **shared,
            )  # fmt: skip
            hover = "pose %{x}: 95 % interval ±%{y:.3f} mm"
            add_series(
                figure,
                label,
                x,
                half,
                fill,
                hover=hover,
                extra=f"{axis}, {label}",
                width=0.0,
                showlegend=False,
                **shared,
            )
    styled(figure, height=580, y="mm", top=100)
    choices: dict[str, Sequence[Any]] = {label: (show_one(owner, k),) for k, label in reversed(list(enumerate(bands)))}
    figure.update_xaxes(title_text="pose of the task", row=3, col=1)
    return switch(figure, choices | {"together": ({"visible": [True] * len(owner)},)}, y=1.04) if last else figure


# The section of a report on the errors within a task.


def task_section(model: ErrorModel, maps: TaskMaps | TaskCurves, identified: str, measured: str) -> Section:
    """Make the section of expected errors over a task.

    Args:
        model: the model.
        maps: maps or curves.
        identified: which parameters are identified, in words.
        measured: at which poses, in words.
    """
    meaning = (
        "Nominal (registered): the measurements only determine tracker frame and targets. Identified: "
        f"{identified} are estimated as well, from {measured}. Both are expected 3D rms errors in the tracker frame, in closed "
        "form; tolerances alone are in the robot's base, where nothing is fitted."
    )
    if isinstance(maps, TaskCurves):
        curves = {"tolerances alone": maps.tolerance, NOMINAL: maps.before, "identified": maps.after}
        charts = (
            Chart(
                "Expected error, pose by pose",
                draw_curves(curves),
                "The farther the lowest line lies below the others, the more identification reduces the error there. "
                "Logarithmic scale.",
            ),
        )
    else:
        labels = {p.name: p.label for p in model.parameters}
        # the strongest first: it is what a reader sees before choosing
        strongest = sorted(
            maps.effects, key=lambda name: -max(float(np.nanmax(m, initial=0.0)) for m in maps.effects[name])
        )
        views = {"identified": maps.after, NOMINAL: maps.before, "tolerances": maps.tolerance}
        charts = (
            Chart(
                "Expected error before and after identification",
                draw_maps(maps.slices, views),
                "Bright is worse. Drawn in one tool orientation, that of the task's middle. White: out of the robot's reach "
                "there. Each view has its own scale of colours.",
                least_width=700,
            ),
            Chart(
                "3D effect of a single parameter's tolerance",
                draw_maps(maps.coarse, {labels[name]: maps.effects[name] for name in strongest}, from_zero=True),
                "One colour all over: the geometric error moves the whole task equally. Bright corners: it matters there most. "
                "Choose the parameter in the list, which begins with the strongest. Each has its own scale of colours.",
                least_width=700,
            ),
        )
    return Section("Errors over the task", meaning, *charts)
