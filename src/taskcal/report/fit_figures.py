"""Figures of identified calibrations: what they leave of the measurements, and what they find of the parameters."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Bool, Float
from plotly.subplots import make_subplots

from taskcal.analysis.identifiability import NEGLIGIBLE, Identifiability
from taskcal.analysis.sensitivity import Sensitivity
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.residual_analysis import Regressor, ResidualAnalysis, fit_smooth
from taskcal.identification.validation import MeasuredErrors
from taskcal.report.content import MILLIMETRES, LengthUnit
from taskcal.report.theme import (
    AXIS_COLOURS,
    AXIS_SHAPES,
    BLUE,
    GREY,
    INK,
    SERIES,
    VERMILION,
    label_panels,
    styled,
    switch,
)
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.parameter import ShownUnit

# Figures of single parameters over some poses: how far each moves the tool point.

FOR_TOLERANCE = "effect of its tolerance (mm)"
MANY = 70
"""Parameters whose names are not all written."""

PER_UNIT = "effect per unit (mm/mm, mm/mrad …)"


def draw_effects(sensitivities: Sensitivity) -> go.Figure:
    """Largest and root mean square effect of every parameter on X, Y, Z and in space, for its tolerance or per unit."""
    names = [p.symbol or p.name for p in sensitivities.model.parameters]
    hover = [p.name + (f" ({p.symbol})" if p.symbol else "") for p in sensitivities.model.parameters]
    figure = make_subplots(
        rows=2,
        cols=1,
        shared_xaxes=True,
        vertical_spacing=0.16,
        subplot_titles=["largest over the poses", "root mean square"],
    )
    to_shown = sensitivities.to_shown()
    scaled: list[list[float]] = []
    raw: list[list[float]] = []
    for row, (per_axis, in_space) in enumerate(
        ((sensitivities.maximum, sensitivities.maximum_in_space), (sensitivities.rms_per_axis, sensitivities.rms)),
        start=1,
    ):
        scaled += [*(per_axis(scaled=True) * 1e3).tolist(), (in_space(scaled=True) * 1e3).tolist()]
        raw += [*(per_axis() * to_shown).tolist(), (in_space() * to_shown).tolist()]
        for axis, (letter, colour) in enumerate(AXIS_COLOURS.items()):
            figure.add_bar(
                x=names,
                y=scaled[4 * (row - 1) + axis],
                name=letter,
                legendgroup=letter,
                showlegend=row == 1,
                marker={"color": colour},
                customdata=hover,
                hovertemplate="%{customdata}: %{y:.4g}<extra>" + letter + "</extra>",
                row=row,
                col=1,
            )
        figure.add_scatter(
            x=names,
            y=scaled[4 * (row - 1) + 3],
            mode="markers",
            name="in space",
            legendgroup="space",
            showlegend=row == 1,
            marker={"symbol": "line-ew-open", "size": 14, "color": INK, "line": {"width": 2}},
            customdata=hover,
            hovertemplate="%{customdata}: %{y:.4g}<extra>in space</extra>",
            row=row,
            col=1,
        )
    styled(figure, height=780, top=100)
    figure.update_layout(barmode="group", bargap=0.2, legend={"y": 1.05})
    figure.update_xaxes(
        tickangle=-60, tickfont={"size": 12 if len(names) < 40 else 10}, showticklabels=True, showgrid=False
    )
    if len(names) < MANY:
        figure.update_xaxes(dtick=1)
    figure.update_yaxes(title_text=FOR_TOLERANCE)
    _switch_units(figure, scaled, raw)
    return label_panels(figure)


def _switch_units(figure: go.Figure, scaled: list[list[float]], raw: list[list[float]]) -> None:
    """Buttons for effects of the tolerances, or per unit."""
    axes = ["yaxis.title.text", "yaxis2.title.text"]
    switch(
        figure,
        {
            "for its tolerance": ({"y": scaled}, dict.fromkeys(axes, FOR_TOLERANCE)),
            "per unit": ({"y": raw}, dict.fromkeys(axes, PER_UNIT)),
        },
        y=1.05,
    )


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


# Figures of errors at measured poses: row by row, and over joints, orientation, axes and targets.

SHAPES = ("circle", "square", "diamond", "triangle-up", "cross", "x")
"""Of targets, so that they are told apart without colour."""

PANELS = 3
"""Joints that are drawn side by side."""


def draw_before_after(errors: MeasuredErrors) -> go.Figure:
    """Length of the error at every fitted row, nominal and calibrated; the worst target counts."""
    figure = go.Figure()
    for label, values, colour, shape in (
        ("nominal robot", errors.before, VERMILION, "x-thin-open"),
        ("calibrated", errors.after, BLUE, "circle"),
    ):
        length = _worst(values)
        seen = np.flatnonzero(np.isfinite(length))
        figure.add_scatter(
            x=seen + 1,
            y=length[seen],
            mode="markers",
            name=label,
            marker={
                "color": colour,
                "symbol": shape,
                "size": 8 if len(seen) < 200 else 5,
                "line": {"width": 2, "color": colour},
            },
            hovertemplate="pose %{x}: %{y:.3f} mm<extra>" + label + "</extra>",
        )
    styled(figure, height=400, top=70)
    figure.update_xaxes(title_text="measured pose")
    figure.update_yaxes(title_text="error in space (mm)", rangemode="tozero")
    return figure


def draw_over_joints(calibration: Calibration, errors: MeasuredErrors) -> go.Figure:
    """Length of what is left over each joint's position."""
    robot = calibration.model.robot
    columns = min(PANELS, len(robot.joints))
    rows = -(-len(robot.joints) // columns)
    units = ["mm" if slides else "°" for slides in robot.prismatic]
    figure = make_subplots(
        rows=rows,
        cols=columns,
        shared_yaxes=True,
        horizontal_spacing=0.05,
        vertical_spacing=0.32 / rows,
        subplot_titles=[f"{name} ({unit})" for name, unit in zip(robot.joint_names, units, strict=True)],
    )
    length = np.linalg.norm(errors.after[..., :3], axis=2) * 1e3
    for k, slides in enumerate(robot.prismatic):
        position = errors.q[:, k] * (1e3 if slides else 180.0 / np.pi)
        for t, target in enumerate(calibration.targets):
            seen = np.isfinite(length[:, t])
            figure.add_scatter(
                x=position[seen],
                y=length[seen, t],
                mode="markers",
                name=target,
                legendgroup=target,
                showlegend=k == 0 and len(calibration.targets) > 1,
                marker={"color": SERIES[(t + 1) % len(SERIES)], "symbol": SHAPES[t % len(SHAPES)], "size": 5},
                hovertemplate="%{x:.1f}: %{y:.3f} mm<extra>" + target + "</extra>",
                row=k // columns + 1,
                col=k % columns + 1,
            )
    several = len(calibration.targets) > 1
    styled(figure, height=230 * rows + 90, legend=several, top=100 if several else 60)
    figure.update_layout(legend={"y": 1.0 + 0.14 / rows})
    figure.update_yaxes(rangemode="tozero")
    figure.update_yaxes(title_text="left (mm)", col=1)
    return label_panels(figure)


def draw_over_orientation(calibration: Calibration, errors: MeasuredErrors) -> go.Figure:
    """Length of the error over how far the tool is turned from its mean orientation, nominal and calibrated."""
    turned = turn_from_mean(calibration.model.poses(errors.q)[:, :3, :3])
    figure = go.Figure()
    for label, values, colour, shape in (
        ("nominal robot", errors.before, VERMILION, "x-thin-open"),
        ("calibrated", errors.after, BLUE, "circle"),
    ):
        length = _worst(values)
        seen = np.isfinite(length)
        figure.add_scatter(
            x=turned[seen],
            y=length[seen],
            mode="markers",
            name=label,
            marker={"color": colour, "symbol": shape, "size": 6, "line": {"width": 2, "color": colour}},
            hovertemplate="%{x:.0f}°: %{y:.3f} mm<extra>" + label + "</extra>",
        )
    styled(figure, height=380, top=70)
    figure.update_xaxes(title_text="tool turned from its mean orientation (°)", rangemode="tozero")
    figure.update_yaxes(title_text="error in space (mm)", rangemode="tozero")
    return figure


def turn_from_mean(rotations: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, " n"]:
    """Angle of each orientation from the mean of all, degrees."""
    mean = se3.nearest_rotation(rotations.mean(axis=0))
    return np.degrees(np.linalg.norm(se3.log(mean.T @ rotations), axis=1))


def draw_by_axis(calibration: Calibration, errors: MeasuredErrors) -> go.Figure:
    """Spread of what is left along the axes of the robot's base, a panel for each target."""
    targets = [t for t in range(len(calibration.targets)) if np.isfinite(errors.after[:, t, 0]).any()]
    figure = make_subplots(
        rows=1,
        cols=len(targets),
        shared_yaxes=True,
        horizontal_spacing=0.04,
        subplot_titles=[calibration.targets[t] for t in targets],
    )
    for col, t in enumerate(targets, start=1):
        own = errors.after[np.isfinite(errors.after[:, t, 0]), t, :3] * 1e3
        for axis, (letter, colour) in enumerate(AXIS_COLOURS.items()):
            figure.add_box(
                y=own[:, axis],
                x=[letter] * len(own),
                name=letter,
                showlegend=False,
                marker={"color": colour, "size": 4},
                line={"width": 1.6},
                boxpoints="outliers",
                hoverinfo="y",
                row=1,
                col=col,
            )
    styled(figure, height=360, legend=False, top=60)
    figure.update_yaxes(zeroline=True)
    figure.update_yaxes(title_text="measured less predicted (mm)", col=1)
    return label_panels(figure)


def _worst(errors: Float[np.ndarray, "n targets b"]) -> Float[np.ndarray, " n"]:
    """The largest error in space of each row, millimetres; NaN where nothing was seen."""
    length = np.linalg.norm(errors[..., :3], axis=2) * 1e3
    seen = np.isfinite(length).any(axis=1)
    out = np.full(len(length), np.nan)
    out[seen] = np.nanmax(length[seen], axis=1)
    return out


# Figures of a model over some poses: how much each parameter moves the tool, and how many can be told apart.

EXPECTED = "largest influence (µm)"

FLOOR = 1e-18
"""Singular values are drawn no lower; exact zeros have no logarithm."""


def draw_sensitivities(
    sensitivities: Mapping[str, Sensitivity], eliminations: Mapping[str, Identifiability]
) -> go.Figure:
    """Largest influence of each parameter on X, Y and Z, for its tolerance or per unit.

    Args:
        sensitivities: a panel for each set of poses.
        eliminations: of the same sets; parameters that they do not keep are drawn pale.
    """
    figure = make_subplots(
        rows=len(sensitivities),
        cols=1,
        shared_xaxes=True,
        vertical_spacing=0.16,
        subplot_titles=[f"poses in {label}" for label in sensitivities],
    )
    scaled: list[list[float]] = []
    raw: list[list[float]] = []
    for row, (label, found) in enumerate(sensitivities.items(), start=1):
        parameters = found.model.parameters
        names = [p.symbol or p.name for p in parameters]
        kept = eliminations[label].kept
        opacity = [1.0 if p.name in kept else 0.35 for p in parameters]
        hover = [p.name + (f" ({p.symbol})" if p.symbol else "") for p in parameters]
        expected, per_unit = found.maximum(scaled=True) * 1e6, found.maximum()  # m/rad are mm/mrad
        for axis, colour in enumerate(AXIS_COLOURS.items()):
            scaled.append(expected[axis].tolist())
            raw.append(per_unit[axis].tolist())
            figure.add_bar(
                x=names,
                y=expected[axis],
                name=colour[0],
                legendgroup=colour[0],
                showlegend=row == 1,
                marker={"color": colour[1], "opacity": opacity},
                customdata=hover,
                hovertemplate="%{customdata}: %{y:.4g}<extra>" + f"{colour[0]}, {label}</extra>",
                row=row,
                col=1,
            )
    styled(figure, height=350 * len(sensitivities) + 80, top=100)
    figure.update_layout(barmode="group", bargap=0.2, legend={"y": 1.06})
    figure.update_xaxes(tickangle=-60, tickfont={"size": 12}, showticklabels=True, showgrid=False)
    figure.update_yaxes(title_text=EXPECTED)
    axes = [f"yaxis{'' if row == 0 else row + 1}.title.text" for row in range(len(sensitivities))]
    switch(
        figure,
        {
            "scaled by tolerance": ({"y": scaled}, dict.fromkeys(axes, EXPECTED)),
            "per unit": ({"y": raw}, dict.fromkeys(axes, "influence (mm/mm, mm/mrad)")),
        },
        y=1.06,
    )
    return label_panels(figure)


def draw_singular_values(eliminations: Mapping[str, Identifiability]) -> go.Figure:
    """Singular values of the stacked sensitivities, columns of unit length: the gap that decides the rank."""
    figure = go.Figure()
    shapes = ("circle", "diamond", "square", "cross")
    for k, (label, found) in enumerate(eliminations.items()):
        values = np.maximum(found.singular_values, FLOOR)
        colour = SERIES[k % len(SERIES)]
        counted = np.arange(len(values)) < found.rank
        figure.add_scatter(
            x=np.arange(1, len(values) + 1),
            y=values,
            mode="markers",
            name=f"{label}: {found.rank} of {len(values)} count",
            marker={
                "color": np.where(counted, colour, "white").tolist(),
                "line": {"color": colour, "width": 1.6},
                "symbol": shapes[k % len(shapes)],
                "size": 9,
            },
            hovertemplate="%{x}: %{y:.2e}<extra>" + label + "</extra>",
        )
    largest = max(found.singular_values.max(initial=0.0) for found in eliminations.values())
    count = max(len(found.names) for found in eliminations.values())
    figure.add_scatter(
        x=[0.5, count + 0.5],
        y=[NEGLIGIBLE * largest] * 2,
        mode="lines",
        name="limit: 10⁻⁹ of the largest",
        line={"color": GREY, "dash": "dash", "width": 1.5},
        hoverinfo="skip",
    )
    styled(figure, height=420)
    figure.update_xaxes(title_text="number of the singular value", range=[0, count + 1])
    figure.update_yaxes(
        title_text="singular value (columns of unit length)",
        type="log",
        exponentformat="power",
        dtick=3,
        range=[-18.7, 1.3],
    )
    return figure


# Figures of what a calibration leaves: how much of it goes with each quantity, and how.

SHOWN = 8
"""Quantities that can be chosen."""

SHORT = 0.3
"""Where a direction's movement is less than this share of its largest, the tool hardly tells a turn along it."""


def draw_shares(analysis: ResidualAnalysis) -> go.Figure:
    """Share of the remainder's variance that goes with each quantity; grey where it is not proven."""
    rows = [e for e in analysis.explained[::-1] if e.p_value is not None]
    figure = go.Figure(
        go.Bar(
            x=[100.0 * e.share for e in rows],
            y=[f"{e.regressor.name}: {e.regressor.moves}" for e in rows],
            orientation="h",
            marker={"color": [BLUE if e.proven else GREY for e in rows]},
            customdata=[f"p {e.p_value:.2g}" for e in rows],
            hovertemplate="%{y}<br>%{x:.1f} %, %{customdata}<extra></extra>",
        )
    )
    styled(figure, height=140 + 26 * max(len(rows), 3), legend=False)
    figure.update_xaxes(title_text="share of the variance on poses left out (%)", rangemode="tozero")
    return figure


def draw_against(analysis: ResidualAnalysis) -> go.Figure:
    """The remainder along the direction of each of the first quantities, against it, with the smooth that was fitted."""
    figure = go.Figure()
    owner: list[int] = []
    choices = [e.regressor for e in analysis.explained[:SHOWN]]
    for k, regressor in enumerate(choices):
        along, seen, unit = _along(regressor, analysis.residual)
        smooth = fit_smooth(regressor, analysis.residual) * 1e3
        u = regressor.values[:, 0] * regressor.scale
        order = np.argsort(u, kind="stable")
        names = list(AXIS_COLOURS) if along.shape[1] == 3 else [regressor.moves]
        for d, name in enumerate(names):
            colour = AXIS_COLOURS.get(name, BLUE)
            own = seen[:, d]
            owner += [k, k]
            figure.add_scatter(
                x=u[own],
                y=along[own, d],
                name=name,
                visible=k == 0,
                mode="markers",
                marker={"color": colour, "size": 5, "opacity": 0.55},
                hovertemplate="%{x:.4g}: %{y:.4g} " + unit + f"<extra>{name}</extra>",
            )
            figure.add_scatter(
                x=u[order],
                y=smooth[order, d],
                name=f"{name}, fitted",
                visible=k == 0,
                mode="lines" if regressor.values.shape[1] == 1 and regressor.smooth else "markers",
                line={"color": colour if len(names) > 1 else INK, "width": 2.5},
                marker={"color": colour if len(names) > 1 else INK, "symbol": "diamond", "size": 7},
                hoverinfo="skip",
            )
    styled(figure, height=480, top=100)
    labels = [f"{r.name} ({r.unit})" for r in choices]
    figure.update_xaxes(title_text=labels[0])
    units = [_unit(r) for r in choices]
    figure.update_yaxes(title_text=units[0])
    updates = {
        label: (
            {"visible": [o == k for o in owner]},
            {"xaxis.title.text": label, "yaxis.title.text": units[k]},
        )
        for k, label in enumerate(labels)
    }
    return switch(figure, updates, y=1.12) if len(updates) > 1 else figure


def _unit(regressor: Regressor) -> str:
    return "remainder (mrad)" if regressor.moves.startswith("turn") else "remainder (mm)"


def _along(
    regressor: Regressor, residual: Float[np.ndarray, "n 3"]
) -> tuple[Float[np.ndarray, "n directions"], Bool[np.ndarray, "n directions"], str]:
    """Movement along each direction that each pose's residual asks for, milli; where the pose tells it; its unit."""
    square = (regressor.carrier**2).sum(axis=1)
    along = np.einsum("nij,ni->nj", regressor.carrier, residual) / np.maximum(square, 1e-12)
    return 1e3 * along, square >= SHORT**2 * square.max(axis=0), "mrad" if regressor.moves.startswith("turn") else "mm"
