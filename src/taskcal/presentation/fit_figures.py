"""Figures of identified calibrations: what they leave of the measurements, and what they find of the parameters."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float
from plotly.subplots import make_subplots

from taskcal.identification.calibration import Calibration
from taskcal.presentation.effect_figures import MANY
from taskcal.presentation.length_unit import MILLIMETRES, LengthUnit
from taskcal.presentation.theme import AXIS_COLOURS, AXIS_SHAPES, INK, SERIES, VERMILION, label_panels, styled, switch
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.parameter import ShownUnit


def draw_residuals(
    calibrations: Mapping[str, Mapping[str, Calibration]], start: str = "", unit: LengthUnit = MILLIMETRES
) -> go.Figure:
    """Residuals of the first target, pose by pose: in the robot's base axes, the sensor's, or the one number that was read.

    Args:
        calibrations: a panel for each campaign, in it the models to choose from, in the same order in all.
        start: beginning of the name of the model that is shown first; the last by default.
        unit: of the residuals.
    """
    figure = make_subplots(
        rows=len(calibrations),
        cols=1,
        shared_xaxes=True,
        vertical_spacing=0.12,
        subplot_titles=[f"measured in {label}" for label in calibrations] if len(calibrations) > 1 else None,
    )
    models = [list(panel) for panel in calibrations.values()]
    shown = next((m for m, name in enumerate(models[0]) if start and name.startswith(start)), len(models[0]) - 1)
    owner: list[int] = []
    for row, (label, panel) in enumerate(calibrations.items(), start=1):
        for m, (name, calibration) in enumerate(panel.items()):
            values = _residuals(calibration) * unit.factor
            for axis, letter in enumerate("XYZ"[: values.shape[1]]):
                owner.append(m)
                figure.add_scatter(
                    x=np.arange(1, len(values) + 1),
                    y=values[:, axis],
                    name=letter,
                    legendgroup=letter,
                    showlegend=row == 1 and values.shape[1] == 3,
                    visible=m == shown,
                    mode="markers",
                    marker={"color": AXIS_COLOURS[letter], "symbol": AXIS_SHAPES[letter], "size": 7},
                    hovertemplate=f"pose %{{x}}: %{{y:.{unit.digits}f}} {unit.name}<extra>"
                    + f"{f'{letter}, ' if values.shape[1] > 1 else ''}{name}, {label}</extra>",
                    row=row,
                    col=1,
                )
    several = len(calibrations) > 1 or len(models[0]) > 1
    styled(figure, height=260 * len(calibrations) + 120, top=100 if several else 60)
    figure.update_layout(legend={"y": 1.06 if several else 1.02})
    figure.update_yaxes(title_text=f"residual ({unit.name})")
    figure.update_xaxes(title_text="measured pose", row=len(calibrations), col=1)
    if len(models[0]) > 1:
        choices = {
            _choice(names): ({"visible": [o == m for o in owner]},) for m, names in enumerate(zip(*models, strict=True))
        }
        switch(figure, choices, y=1.06)
        figure.layout.updatemenus[0].active = shown  # pyright: ignore[reportAttributeAccessIssue]
    return label_panels(figure)


def _residuals(calibration: Calibration) -> Float[np.ndarray, "n axes"]:
    """Of the first target, metres."""
    residual, kinds = calibration.residuals[:, 0, :3], calibration.layout.observed
    if not kinds or kinds[0].along_axes:
        return residual @ calibration.T_tracker_base[:3, :3]
    return residual[:, : kinds[0].width]


def _choice(names: tuple[str, ...]) -> str:
    """One label for the models of all campaigns, which may differ in their count of parameters."""
    return names[0] if len(set(names)) == 1 else " / ".join(dict.fromkeys(names))


def draw_parameters(calibrations: Mapping[str, Calibration], truth: Float[np.ndarray, " p"] | None = None) -> go.Figure:
    """Estimated parameters with two standard errors, beside the truth where it is known.

    Args:
        calibrations: calibrations of one model to choose from.
        truth: the true parameters, metres and radians.
    """
    model = next(iter(calibrations.values())).model
    panels = _panels(model)
    figure = make_subplots(
        rows=len(panels), cols=1, vertical_spacing=0.4 / len(panels), subplot_titles=[panel.title for panel in panels]
    )
    owner: list[int] = []
    for row, panel in enumerate(panels, start=1):
        columns, unit = panel.columns, panel.unit
        names = [model.parameters[i].symbol or model.parameters[i].name for i in columns]
        ours = [model.parameters[i].name for i in columns]
        for k, (label, calibration) in enumerate(calibrations.items()):
            owner.append(k)
            figure.add_scatter(
                x=names,
                y=calibration.estimate[columns] * unit.factor,
                error_y={
                    "array": 2.0 * calibration.standard_errors[columns] * unit.factor,
                    "thickness": 1.6,
                    "width": 4,
                },
                name="estimate ± 2 standard errors",
                legendgroup="estimate",
                showlegend=row == 1,
                visible=k == 0,
                mode="markers",
                marker={"color": SERIES[1], "size": 8},
                customdata=ours,
                hovertemplate="%{customdata}: %{y:.3f} " + unit.name + f"<extra>{label}</extra>",
                row=row,
                col=1,
            )
        if truth is not None:
            owner.append(-1)
            figure.add_scatter(
                x=names,
                y=truth[columns] * unit.factor,
                name="truth",
                legendgroup="truth",
                showlegend=row == 1,
                mode="markers",
                marker={"color": VERMILION, "symbol": "diamond-open", "size": 11, "line": {"width": 2}},
                customdata=ours,
                hovertemplate="%{customdata}: %{y:.3f} " + unit.name + "<extra>truth</extra>",
                row=row,
                col=1,
            )
        figure.update_yaxes(
            title_text=f"{panel.quantity} ({unit.name})", zeroline=True, zerolinecolor=INK, row=row, col=1
        )
    styled(figure, height=340 * len(panels), top=100)
    figure.update_layout(legend={"y": 1.0 + 0.12 / len(panels)})
    figure.update_xaxes(tickangle=-60, tickfont={"size": 11})
    for row, panel in enumerate(panels, start=1):
        if len(panel.columns) < MANY:
            figure.update_xaxes(dtick=1, row=row, col=1)
    if len(calibrations) > 1:
        choices = {label: ({"visible": [o in (k, -1) for o in owner]},) for k, label in enumerate(calibrations)}
        switch(figure, choices, y=1.06)
    return label_panels(figure)


@dataclass(frozen=True, kw_only=True)
class _Panel:
    """Parameters that are drawn on one scale."""

    title: str
    quantity: str
    unit: ShownUnit
    columns: list[int]


def _panels(model: ErrorModel) -> list[_Panel]:
    """Lengths and angles of the geometry, then the effects, those of one unit together."""
    groups: dict[tuple[bool, ShownUnit], list[int]] = {}
    for i, parameter in enumerate(model.parameters):
        groups.setdefault((parameter.name in model.effect_names, parameter.shown), []).append(i)
    titles = {"mm": "lengths", "mrad": "angles"}
    return [
        _Panel(
            title=f"effects in {unit.name}" if effect else titles[unit.name],
            quantity="effect" if effect else "defect",
            unit=unit,
            columns=columns,
        )
        for (effect, unit), columns in groups.items()
    ]
