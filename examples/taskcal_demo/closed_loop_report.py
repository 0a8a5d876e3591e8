"""The closed loop on virtual robots: how far the true cutter is from its way, as programmed, touched off and corrected."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from taskcal.correction.cell import cell_text
from taskcal.report.chart import BLUE, INK, ORANGE, VERMILION, Axis, Figure, Level, Panel, Series
from taskcal.report.content import Chart, Column, Commands, Numbers, Section, TextTable
from taskcal.report.correction import draw_errors
from taskcal.report.page import Report
from taskcal_demo.closed_loop import (
    LINES,
    ClosedLoop,
    LoopRun,
    StatedAndTrue,
    errors_by_line,
    largest_errors,
    rms,
    share_within,
    stated_errors,
)
from taskcal_demo.true_robot import AxisWobble

MARKERS = {
    "as programmed": (VERMILION, "circle"),
    "touched off": (ORANGE, "square"),
    "corrected": (BLUE, "diamond"),
    "stated": (INK, "cross"),
}
"""Colour and shape of each line; the shapes tell them apart without colour."""

STORY = (
    "Each true robot is measured in planned poses with three reflectors on its spindle. What its data prove beside the geometry "
    "is identified with it; the cutters are known by the reflectors, each with its own uncertainty. Then the controller, which "
    "takes the robot for nominal, runs the program as it was written, the same with the frames of its parts touched off by the "
    "robot's own cutter, and that one corrected, which knows from the joints at which the parts were touched how far they were "
    "off there; and the path of the true cutter on the true part is compared with what the program wants."
)
TRUTH = (
    "The true robots have geometric errors; drives, bearings and links that yield to the weight they carry; gears with "
    "ripples of unknown orders, whose size changes over the turn; lost motion that is taken up little by little; and links that "
    "warm up each in its own time. The fit is told none of this, only the order of the poses and the time of each."
)

KIND = (
    "Kind to the correction, all the same: geometric errors are drawn from the tolerances, which the fit has as its prior; base "
    "and parts are where the controller has them, cutters as the controller knows them; no force of the process acts on the "
    "cutter."
)


def tabulate_closed_loop(runs: Sequence[LoopRun]) -> TextTable:
    """Median, smallest and largest over the robots of each robot's figures, millimetres."""
    lines = [errors_by_line(run) for run in runs]
    figures = {
        **{f"largest error, {line}": [each[line].length.max() for each in lines] for line in LINES},
        "stated, 95 % within, at the worst target": list(largest_errors(runs)["stated"]),
        **{f"rms error, {line}": [rms(each[line].length) for each in lines] for line in LINES},
        "stated rms": [rms(stated_errors(run)) for run in runs],
    }
    within = np.array([share_within(run) for run in runs]) * 100.0
    sizes = {"median": np.median, "smallest": np.min, "largest": np.max}
    rows = [
        *((label, 1e3 * np.array(values), ".4f") for label, values in figures.items()),
        ("points within the stated 95 % (%)", within, ".1f"),
    ]
    columns = (
        Column("", lambda row: row[0]),
        *(Column(name, lambda row, size=size: format(size(row[1]), row[2]), "s") for name, size in sizes.items()),
    )
    return TextTable.of(
        f"The true cutter against its way on the part: {len(runs)} virtual robots (mm)",
        columns,
        rows,
        note="In space, at targets and between them. Touched off: the robot's own cutter set the part's frame at four marks on "
        "it. Stated: what the correction expects of its own error, its root mean square along the program, and the radius "
        "within which 95 % of the errors at the worst target would lie if they were alike in all directions.",
    )


def tabulate_effects(runs: Sequence[LoopRun]) -> TextTable:
    """On how many robots the search found each effect."""
    names = [effect.name for run in runs for effect in run.calibration.model.effects]
    rows = [(name, f"{names.count(name)} of {len(runs)}") for name in sorted(set(names), key=lambda n: -names.count(n))]
    return TextTable.of_rows(
        "Effects that the data proved",
        ("effect", "robots"),
        rows,
        note="None of them is what the true robots do; each is the nearest of what may be identified.",
    )


ASSUMED = "as assumed"
"""Name of the truths of `true_robot` beside the unkind ones."""


def tabulate_unkind(cases: Mapping[str, Sequence[LoopRun]]) -> TextTable:
    """What was stated of the corrected program and what was true, for the robots of each truth by its name, millimetres."""
    columns = (
        Column("truth", lambda row: row[0]),
        Column("rms\ntrue", lambda row: row[1].rms, ".3f", 1e3),
        Column("rms\nstated", lambda row: row[1].stated_rms, ".3f", 1e3),
        Column("largest\ntrue", lambda row: row[1].largest, ".3f", 1e3),
        Column("95 % within\nstated", lambda row: row[1].stated_95, ".3f", 1e3),
        Column("points within\nthe stated 95 % (%)", lambda row: row[1].within, ".1f", 100.0),
        Column("what was stated", lambda row: "held" if row[1].held else "did not hold"),
        Column("on robots\nby themselves", lambda row: row[2], "s"),
    )
    return TextTable.of(
        "Corrected, by how kind the truth is (mm)",
        columns,
        [(name, StatedAndTrue.of(runs), _held_on(runs)) for name, runs in cases.items()],
        note="All points of all robots together. Stated within: the radius at the worst target. What was stated held if the "
        "true rms is at most the stated one and at least 95 % of the points are within the radius stated for each; the last "
        "column counts the robots on which it did.",
    )


def _held_on(runs: Sequence[LoopRun]) -> str:
    """On how many robots, each by itself, what was stated held."""
    return f"{sum(StatedAndTrue.of([run]).held for run in runs)} of {len(runs)}"


def draw_closed_loop(found: Mapping[str, Float[np.ndarray, " runs"]]) -> Figure:
    """Errors of every robot, metres, as `largest_errors` gives them, on a logarithmic scale, by the error as programmed."""
    order = np.argsort(found[LINES[0]], kind="stable")
    series = tuple(
        Series(
            name="stated, 95 % within" if label == "stated" else label,
            x=np.arange(1, len(order) + 1),
            y=found[label][order] * 1e3,
            colour=colour,
            shape=shape,
            hollow=label == LINES[0],
        )
        for label, (colour, shape) in MARKERS.items()
    )
    x = Axis(title="virtual robot, by its error as programmed")
    y = Axis(title="largest error on the part", unit="mm", log=True)
    level = Level(at=0.1, name="0.1 mm")
    return Figure(panels=(Panel(x=x, y=y, series=series, levels=(level,), height=300.0),))


def closed_loop_page(
    loop: ClosedLoop, runs: Sequence[LoopRun], *, unkind: Mapping[str, Sequence[LoopRun]] | None = None, next_steps: str
) -> Report:
    """Make the page of the closed loop.

    Args:
        loop: what the robots have in common.
        runs: one for each robot.
        unkind: the same robots with truths that keep less to what is assumed, by the name of each in `UNKIND`.
        next_steps: commands to go on with.
    """
    found = largest_errors(runs)
    return Report(
        title="From measurement to a corrected program",
        sections=(
            Section(
                "In short",
                Numbers(
                    *(
                        (f"{np.median(found[line]) * 1e3:.2g}", "mm", f"largest error {line}, median of the robots")
                        for line in LINES
                    ),
                    (
                        str(len(loop.program.motions)),
                        "",
                        "motions of the milling program, with arcs, two tools and two part frames",
                    ),
                    (str(len(loop.q)), "", "measured poses, planned for the task"),
                ),
                STORY,
                TRUTH,
                KIND,
            ),
            Section(
                "All robots",
                tabulate_closed_loop(runs),
                Chart(
                    "As programmed, touched off, corrected",
                    draw_closed_loop(found),
                    "Each robot is one column of marks; the dashed line is at 0.1 mm.",
                ),
                tabulate_effects(runs),
            ),
            *([_unkind(runs, unkind)] if unkind else []),
            Section(
                "The first robot",
                Chart(
                    "Error along the program",
                    draw_errors(loop.program, errors_by_line(runs[0]), "true error"),
                    "Distance of the true cutter from where it is wanted; between targets, from its way.",
                ),
            ),
            Section("Go on", Commands(next_steps)),
        ),
        lead=f"{len(runs)} virtual robots of the kind {loop.robot.title or loop.robot.name}.",
    )


def _unkind(runs: Sequence[LoopRun], unkind: Mapping[str, Sequence[LoopRun]]) -> Section:
    """What was stated and what was true, beside truths that keep less to what is assumed."""
    held = {name: StatedAndTrue.of(some).held for name, some in unkind.items()}
    return Section(
        "Unkind truths",
        "The same robots and the same loop, with two other truths. Axis wobble: besides, each axis tilts across itself, with "
        f"{1e6 * AxisWobble.tolerance:.0f} µrad (1σ) in the cosine and the sine of one and of two periods per turn, and of the sum "
        "of its angle and the next joint's; no effect of the fit tilts an axis. Twice as large: geometric errors, compliance, gear "
        "errors, lost motion and thermal expansion are all doubled; the fit's prior is not.",
        tabulate_unkind({ASSUMED: runs, **unkind}),
        *(
            f"{name.capitalize()}: what was stated {'held' if held[name] else 'did not hold'}; robot by robot on {_held_on(some)}."
            for name, some in unkind.items()
        ),
    )


# What a closed loop leaves in a folder: the program, what belongs to the first robot, and the page.

NAMES = {
    "program": "Milling.mod",
    "touched-off program": "Milling-touched-off.mod",
    "corrected program": "Milling-corrected.mod",
    "calibration for milling": "calibration-milling.json",
    "cell": "cell.toml",
    "page of the closed loop": "closed-loop.html",
}


def closed_loop_files(folder: Path) -> dict[str, Path]:
    """The files by what they hold."""
    return {label: folder / name for label, name in NAMES.items()}


def closed_loop_contents(
    loop: ClosedLoop, runs: Sequence[LoopRun], *, unkind: Mapping[str, Sequence[LoopRun]] | None = None, next_steps: str
) -> dict[str, str | bytes]:
    """Content of each file to be written, by what it holds.

    Args:
        loop: what the robots have in common.
        runs: one for each robot.
        unkind: as of `closed_loop_page`.
        next_steps: commands to go on with, for the page.
    """
    first = runs[0]
    return {
        "program": loop.milling.source.encode(),
        "touched-off program": first.correction.program.sources[0].encode(),
        "corrected program": first.correction.sources[0].encode(),
        "calibration for milling": first.calibration.to_text(),
        "cell": cell_text(first.cell),
        "page of the closed loop": closed_loop_page(loop, runs, unkind=unkind, next_steps=next_steps).html(),
    }
