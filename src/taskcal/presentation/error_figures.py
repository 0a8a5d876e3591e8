"""Figures of errors at measured poses: row by row, and over joints, orientation, axes and targets."""

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float
from plotly.subplots import make_subplots

from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.measured_errors import MeasuredErrors
from taskcal.presentation.theme import AXIS_COLOURS, BLUE, SERIES, VERMILION, label_panels, styled

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
