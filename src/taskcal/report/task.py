"""Figures of a task: errors and effects over slices of its workspace, or pose by pose along a list or a path."""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.identification.calibration import COVERAGE_95
from taskcal.planning.task_map import Maps, Slice, TaskCurves, TaskMaps
from taskcal.report.chart import AXIS_COLOURS, BLUE, GREY, SERIES, VERMILION, Axis, Figure, Heatmap, Panel, Series
from taskcal.report.content import NOMINAL, Chart, Section
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task
from taskcal.task.workspace import Orientation

MAX_EFFECTS = 6
"""Parameters whose maps a page has."""

MAX_MARKED = 60
"""Poses up to which a curve has a mark at each; more would run together."""


def draw_maps(slices: Sequence[Slice], views: Mapping[str, Maps], *, from_zero: bool = False) -> Mapping[str, Figure]:
    """Draw heat maps over slices of a workspace, a colour scale for each view, the same in all slices.

    Args:
        slices: planes through the middle of the workspace.
        views: each with a map in metres for every slice.
        from_zero: begin the scales at zero instead of the smallest value.
    """
    return {
        label: Figure(
            panels=tuple(_map_panel(at, values) for at, values in zip(slices, maps, strict=True)),
            columns=3,
            scale=span_of([values * 1e3 for values in maps], "mm", from_zero=from_zero),
        )
        for label, maps in views.items()
    }


def _map_panel(at: Slice, values: Float[np.ndarray, "v u"]) -> Panel:
    across, up = (name.upper() for name in at.plane)
    return Panel(
        title=f"{across}–{up} through the middle",
        x=Axis(title=f"{across} from the middle", unit="mm"),
        y=Axis(title=up, unit="mm"),
        cells=Heatmap(x=at.u * 1e3, y=at.v * 1e3, z=values * 1e3),
        equal=True,
    )


def span_of(maps: Sequence[np.ndarray], unit: str, *, from_zero: bool = False) -> tuple[float, float, str]:
    """Smallest and largest value of maps, which differ, and the unit."""
    every = np.concatenate([values[np.isfinite(values)] for values in maps])
    low, high = (float(every.min()), float(every.max())) if len(every) else (0.0, 1.0)
    low = 0.0 if from_zero else low
    return low, high if high > low else low + max(abs(low), 1.0) * 1e-3, unit


def draw_curves(curves: Mapping[str, Float[np.ndarray, " n"]]) -> Figure:
    """Draw 3D errors pose by pose, along a path or a list.

    Args:
        curves: values by what they are, metres.
    """
    series = tuple(
        Series(
            kind="line",
            name=label,
            x=np.arange(len(values)),
            y=values * 1e3,
            colour=SERIES[k % len(SERIES)],
            shape="circle" if len(values) < MAX_MARKED else "",
        )
        for k, (label, values) in enumerate(curves.items())
    )
    return Figure(panels=(Panel(x=POSE, y=Axis(title="3D error", unit="mm", log=True), series=series),))


POSE = Axis(title="pose of the task")


def draw_bands(bands: Mapping[str, Float[np.ndarray, "n 3"]]) -> Figure:
    """Draw intervals of 95 % about zero on X, Y and Z, pose by pose, on a logarithmic scale: the widest may be wider by far.

    Args:
        bands: standard deviations per axis by what they are, metres; the widest first.
    """
    panels = tuple(
        Panel(
            title=axis,
            x=POSE,
            y=Axis(title="half of the 95 % interval", unit="mm", log=True),
            series=tuple(
                Series(
                    kind="line",
                    name=label,
                    x=np.arange(len(deviation)),
                    y=COVERAGE_95 * 1e3 * deviation[:, k],
                    colour=(GREY, BLUE, VERMILION)[number % 3],
                )
                for number, (label, deviation) in enumerate(bands.items())
            ),
        )
        for k, axis in enumerate(AXIS_COLOURS)
    )
    return Figure(panels=panels, columns=3, shared="y")


def describe_task(task: Task) -> str:
    """Describe where and how the tool works in a task, in one line."""
    if task.workspace is None:
        count = 0 if task.poses is None else len(task.poses)
        return f"{task.name}: {'path' if task.path else 'list'} of {count} poses"
    space = task.workspace
    middle = se3.apply(space.T_base_frame, space.center) * 1e3
    about = " ".join(f"{value:.1f}" for value in middle)
    if space.shape == "box":
        shape = f"box of {' × '.join(f'{edge * 1e3:g}' for edge in space.size)} mm"
    else:
        shape = f"cylinder of {space.size[0] * 1e3:g} mm diameter and {space.size[2] * 1e3:g} mm height"
    turned = "; ".join(_describe_orientation(one, space.T_base_frame[:3, :3]) for one in space.orientations)
    return f"{task.name}: {shape} about {about} mm of the base; {turned}"


def _describe_orientation(one: Orientation, base: Float[np.ndarray, "3 3"]) -> str:
    axis = " ".join(f"{value + 0.0:.3f}" for value in (base @ one.rotation)[:, 2].round(3))
    spin = "free" if one.spin >= np.pi else f"±{np.degrees(one.spin):g}°"
    return f"tool axis {axis} within {np.degrees(one.cone):g}°, turned about it {spin}"


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
        )[:MAX_EFFECTS]
        views = {"identified": maps.after, NOMINAL: maps.before, "tolerances": maps.tolerance}
        charts = (
            Chart(
                "Expected error before and after identification",
                draw_maps(maps.slices, views),
                "Bright is worse. Drawn in one tool orientation, that of the task's middle. White: out of the robot's reach "
                "there. Each view has its own scale of colours.",
            ),
            Chart(
                "3D effect of a single parameter's tolerance",
                draw_maps(maps.coarse, {labels[name]: maps.effects[name] for name in strongest}, from_zero=True),
                "One colour all over: the geometric error moves the whole task equally. Bright corners: it matters there most. "
                f"The {MAX_EFFECTS} strongest parameters, the strongest first. Each has its own scale of colours.",
            ),
        )
    return Section("Errors over the task", meaning, *charts)
