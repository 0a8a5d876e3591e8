"""Accuracy and repeatability after ISO 9283 as a page: of poses measured in cycles, or of passes along a path."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from taskcal.campaigns.performance import CyclePerformance, PathPerformance
from taskcal.report.chart import BLUE, SERIES, SHAPES, VERMILION, Axis, Figure, Panel, Series
from taskcal.report.content import Chart, Column, Numbers, Section, TextTable
from taskcal.report.page import Report


def pose_sections(performance: CyclePerformance) -> list[Section]:
    """Make the sections of poses."""
    summary = performance.summary()
    sections = [
        Section("Summary", Numbers(*_worst_of_poses(performance)), _MEANING),
        Section("Poses", *_pose_charts(performance), tabulate_results("Every pose", summary["poses"])),
    ]
    for key, title, words in (
        ("directions", "Directions of approach", "Distance between the means of several directions."),
        ("distances", "Distances", "Accuracy and repeatability of the distance between two poses."),
    ):
        if summary[key]:
            table = tabulate_results(f"All {title.lower()}", summary[key])
            sections.append(Section(title, words, table))
    return sections


def path_sections(performance: PathPerformance) -> list[Section]:
    """Make the sections of a path."""
    again = performance.repeatability
    numbers = Numbers(
        (f"{performance.accuracy * 1e3:.3f}", "mm", "path accuracy AT_p: largest deviation of the mean pass"),
        None if again is None else (f"{again * 1e3:.3f}", "mm", "path repeatability RT_p, at the worst point"),
        (str(performance.cycles), "", "passes"),
    )
    series = tuple(
        Series(kind="line", name=label, x=np.arange(len(values)), y=values * 1e3, colour=colour, dash=dash)
        for label, values, colour, dash in (
            ("accuracy", performance.accuracy_along, VERMILION, False),
            ("repeatability", performance.repeatability_along, BLUE, True),
        )
        if values is not None
    )
    along = Chart(
        "Accuracy and repeatability along the path",
        Figure(panels=(Panel(x=Axis(title="section of the path"), y=Axis(unit="mm", zero=True), series=series),)),
        "A peak of accuracy: the path is missed the same way each time, mostly at a corner; this can be corrected. A peak of "
        "repeatability is random, and cannot.",
    )
    return [
        Section("Summary", numbers, _MEANING),
        Section("Along the path", along, tabulate_results("The path", [performance.summary()])),
    ]


_MEANING = (
    "Accuracy is the distance of the mean of all cycles from the command; repeatability is the mean distance of the cycles from "
    "their own mean, plus three standard deviations. All lengths are in millimetres, in the frame of the commands."
)


def performance_page(title: str, sections: Sequence[Section], source: str) -> Report:
    """Make the page of poses or of a path.

    Args:
        title: of the page.
        sections: of it.
        source: file of the measurements.
    """
    clauses = "ISO 9283:1998 (poses: 7.2; directions: 7.2.3; distances: 7.3; paths: 8)"
    return Report(title=title, sections=sections, lead=f"Accuracy and repeatability after {clauses}, from {source}.")


def _worst_of_poses(performance: CyclePerformance) -> list[tuple[str, str, str]]:
    poses = performance.poses.values()
    worst = {
        "pose accuracy AP_p of the worst pose": [one.accuracy for one in poses if one.accuracy is not None],
        "pose repeatability RP_l of the worst pose": [
            one.repeatability for one in poses if one.repeatability is not None
        ],
    }
    return [
        *((f"{max(values) * 1e3:.3f}", "mm", said) for said, values in worst.items() if values),
        (str(len(poses)), "", "poses, each direction of approach counted"),
        (str(min(one.cycles for one in poses)), "", "cycles at least; the standard requires 30"),
    ]


def _pose_charts(performance: CyclePerformance) -> list[Chart]:
    names = [f"{pose} {direction}".strip() for pose, direction in performance.poses]
    poses = list(performance.poses.values())
    bars = tuple(
        Series(kind="bars", name=label, x=1e3 * values, y=range(len(poses)), colour=colour, hollow=hollow)
        for label, values, colour, hollow in (
            ("accuracy AP_p", np.array([one.accuracy for one in poses], dtype=float), VERMILION, False),
            ("repeatability RP_l", np.array([one.repeatability for one in poses], dtype=float), BLUE, True),
        )
        if np.isfinite(values).any()
    )
    cycles = tuple(
        Series(
            kind="line",
            name=name,
            x=np.arange(1, one.cycles + 1),
            y=one.distances * 1e3,
            colour=SERIES[k % len(SERIES)],
            shape=SHAPES[k % len(SHAPES)],
        )
        for k, (name, one) in enumerate(zip(names, poses, strict=True))
    )
    return [
        Chart(
            "Accuracy and repeatability of every pose",
            Figure(panels=(Panel(x=Axis(unit="mm", zero=True), y=Axis(categories=tuple(names)), series=bars),)),
            "Full bars much longer than empty ones: the errors are reproducible, and a calibration helps. Empty ones as "
            "long: it does not.",
        ),
        Chart(
            "Distance of every cycle from the mean of all",
            Figure(
                panels=(
                    Panel(
                        x=Axis(title="cycle"),
                        y=Axis(title="from the mean of all cycles", unit="mm", zero=True),
                        series=cycles,
                    ),
                )
            ),
            "Scatter without a trend: random. A line that falls and rises again: drift, such as warm-up.",
        ),
    ]


def tabulate_results(title: str, results: Sequence[Mapping[str, Any]]) -> TextTable:
    """Tabulate summaries of poses, directions, distances or paths, a row for each."""
    keys = [key for key in dict.fromkeys(key for result in results for key in result) if key != "left_out"]
    values = {key: [result[key] for result in results if key in result] for key in keys}
    forms = {key: _form(column) for key, column in values.items()}
    columns = [Column(key.replace("_mm", " mm").replace("_deg", " °"), key, forms[key]) for key in keys]
    return TextTable.of(title, columns, results)


def _form(values: Sequence[Any]) -> str:
    if any(isinstance(value, str) for value in values):
        return ""
    return ".3f" if any(isinstance(value, float) for value in values) else "d"
