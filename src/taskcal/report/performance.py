"""Accuracy and repeatability after ISO 9283 as a page: of poses measured in cycles, or of passes along a path."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go

from taskcal.campaigns.performance import CyclePerformance, PathPerformance
from taskcal.report.content import Block, Chart, Numbers, Section, Table, Text
from taskcal.report.page import Page
from taskcal.report.theme import BLUE, SERIES, VERMILION, styled

SHAPES = ("circle", "square", "diamond", "triangle-up", "cross", "x")

_LEFT_OUT = {"left_out"}


def pose_performance_page(performance: CyclePerformance, source: str, *, version: str) -> Page:
    """The page of poses.

    Args:
        performance: what was found.
        source: file of the measurements.
        version: of the package, for the footer.
    """
    summary = performance.summary()
    sections = [
        Section(title="In short", blocks=(Numbers(_worst_of_poses(performance)), Text((_MEANING,)))),
        Section(title="Poses", blocks=(*_pose_figures(performance), _tabulate("Every pose", summary["poses"]))),
    ]
    for key, title, words in (
        ("directions", "Directions of approach", "How far the means of several directions lie apart (7.2.3)."),
        ("distances", "Distances", "Accuracy and repeatability of the distance between two poses (7.3)."),
    ):
        if summary[key]:
            sections.append(
                Section(title=title, blocks=(Text((words,)), _tabulate(f"All {title.lower()}", summary[key])))
            )
    return _page("Performance of poses", sections, source, version)


def path_performance_page(performance: PathPerformance, source: str, *, version: str) -> Page:
    """The page of a path.

    Args:
        performance: what was found.
        source: file of the measurements.
        version: of the package, for the footer.
    """
    items = [(f"{performance.accuracy * 1e3:.3f}", "mm", "path accuracy AT_p: farthest that the mean pass is off")]
    if performance.repeatability is not None:
        items.append((f"{performance.repeatability * 1e3:.3f}", "mm", "path repeatability RT_p, at the worst point"))
    items.append((str(performance.cycles), "", "passes"))
    along = Chart(
        title="Accuracy and repeatability along the path",
        figure=_draw_along(performance),
        note="A peak in the upper line is where the path is missed the same way each time, mostly a corner: it can be corrected. A "
        "peak in repeatability is chance, and cannot.",
    )
    sections = [
        Section(title="In short", blocks=(Numbers(tuple(items)), Text((_MEANING,)))),
        Section(title="Along the path", blocks=(along, _tabulate("The path", [performance.summary()]))),
    ]
    return _page("Performance along a path", sections, source, version)


_MEANING = (
    "Accuracy is how far the mean of all cycles is from the command; repeatability is the mean distance of the cycles from "
    "their own mean, and three standard deviations. All lengths are in millimetres, in the frame of the commands. Definitions: "
    "ISO 9283:1998, clauses 7.2, 7.3 and 8."
)


def _page(title: str, sections: Sequence[Section], source: str, version: str) -> Page:
    return Page(
        title=title,
        sections=tuple(sections),
        lead=f"Accuracy and repeatability after ISO 9283, from {source}.",
        footer=f"Page by Taskcal {version}.",
    )


def _worst_of_poses(performance: CyclePerformance) -> tuple[tuple[str, str, str], ...]:
    poses = performance.poses.values()
    accuracy = [one.accuracy for one in poses if one.accuracy is not None]
    repeatability = [one.repeatability for one in poses if one.repeatability is not None]
    items: list[tuple[str, str, str]] = []
    if accuracy:
        items.append((f"{max(accuracy) * 1e3:.3f}", "mm", "pose accuracy AP_p of the worst pose"))
    if repeatability:
        items.append((f"{max(repeatability) * 1e3:.3f}", "mm", "pose repeatability RP_l of the worst pose"))
    items.append((str(len(performance.poses)), "", "poses, each direction of approach counted"))
    items.append((str(min(one.cycles for one in poses)), "", "cycles at least; the standard asks for 30"))
    return tuple(items)


def _pose_figures(performance: CyclePerformance) -> list[Block]:
    names = [f"{pose} {direction}".strip() for pose, direction in performance.poses]
    poses = list(performance.poses.values())
    bars = go.Figure()
    for label, values, colour, pattern in (
        ("accuracy AP_p", [one.accuracy for one in poses], VERMILION, ""),
        ("repeatability RP_l", [one.repeatability for one in poses], BLUE, "/"),
    ):
        if any(value is not None for value in values):
            bars.add_bar(
                x=names,
                y=[None if value is None else value * 1e3 for value in values],
                name=label,
                marker={"color": colour, "pattern": {"shape": pattern}},
                hovertemplate="%{x}: %{y:.3f} mm<extra>" + label + "</extra>",
            )
    styled(bars, height=380, top=60)
    bars.update_yaxes(title_text="mm", rangemode="tozero")
    bars.update_xaxes(title_text="pose", type="category")
    cycles = go.Figure()
    for k, (name, one) in enumerate(zip(names, poses, strict=True)):
        cycles.add_scatter(
            x=np.arange(1, one.cycles + 1),
            y=one.distances * 1e3,
            mode="lines+markers",
            name=name,
            line={"color": SERIES[k % len(SERIES)], "width": 1},
            marker={"symbol": SHAPES[k % len(SHAPES)], "size": 7},
            hovertemplate="cycle %{x}: %{y:.3f} mm<extra>" + name + "</extra>",
        )
    styled(cycles, height=380, top=80)
    cycles.update_xaxes(title_text="cycle")
    cycles.update_yaxes(title_text="from the mean of all cycles (mm)", rangemode="tozero")
    return [
        Chart(
            title="Accuracy and repeatability of every pose",
            figure=bars,
            note="Plain bars much higher than hatched ones: the robot goes to the wrong place, reliably, and a calibration "
            "helps. Hatched ones as high: it does not.",
        ),
        Chart(
            title="Distance of every cycle from the mean of all",
            figure=cycles,
            note="Without a trend, cycles scatter. A line that falls and rises again drifts: the robot, or what it stands on, grew "
            "warm while it was measured.",
        ),
    ]


def _draw_along(performance: PathPerformance) -> go.Figure:
    figure = go.Figure()
    at = np.arange(len(performance.accuracy_along))
    along = performance.repeatability_along
    lines = [("accuracy", performance.accuracy_along, VERMILION, "solid")]
    if along is not None:
        lines.append(("repeatability", along, BLUE, "dash"))
    for label, values, colour, dash in lines:
        figure.add_scatter(
            x=at,
            y=values * 1e3,
            mode="lines",
            name=label,
            line={"color": colour, "width": 2.2, "dash": dash},
            hovertemplate="section %{x}: %{y:.3f} mm<extra>" + label + "</extra>",
        )
    styled(figure, height=400, top=60)
    figure.update_xaxes(title_text="section of the path")
    figure.update_yaxes(title_text="mm", rangemode="tozero")
    return figure


def _tabulate(title: str, results: Sequence[Mapping[str, Any]]) -> Table:
    columns = [key for key in dict.fromkeys(key for result in results for key in result) if key not in _LEFT_OUT]
    words = tuple(k for k, key in enumerate(columns) if any(isinstance(result.get(key), str) for result in results))
    rows = [tuple(_text(result[key]) if key in result else "" for key in columns) for result in results]
    header = tuple(key.replace("_mm", " mm").replace("_deg", " °") for key in columns)
    return Table.of_rows(title, header, rows, text_columns=words)


def _text(value: float | int | str) -> str:
    return f"{value:.3f}" if isinstance(value, float) else str(value)
