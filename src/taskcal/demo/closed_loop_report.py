"""The closed loop on virtual robots: how far the true cutter is from its way, before the correction and after it."""

from collections.abc import Mapping, Sequence

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float

from taskcal.demo.closed_loop import ClosedLoop, LoopRun, largest_errors
from taskcal.presentation.content import Chart, Commands, Numbers, Section, Table, Text
from taskcal.presentation.correction_figures import draw_errors, with_decades
from taskcal.presentation.report import report_html
from taskcal.presentation.theme import BLUE, GREY, VERMILION, styled


def tabulate_closed_loop(runs: Sequence[LoopRun]) -> Table:
    """Median, smallest and largest over the robots of each robot's figures, millimetres."""
    figures = {
        "largest error before": [run.before.length.max() for run in runs],
        "largest error after": [run.after.length.max() for run in runs],
        "rms error before": [_rms(run.before.length) for run in runs],
        "rms error after": [_rms(run.after.length) for run in runs],
        "stated uncertainty (rms)": [_stated(run) for run in runs],
    }
    rows = [
        (label, *(f"{f(np.array(values) * 1e3):.4f}" for f in (np.median, np.min, np.max)))
        for label, values in figures.items()
    ]
    return Table.of_rows(
        f"The true cutter against its way on the part: {len(runs)} virtual robots (mm)",
        ("", "median", "smallest", "largest"),
        rows,
        note="In space, at targets and between them. Stated: what the calibration expects at the worst target.",
    )


def _rms(length: np.ndarray) -> float:
    return float(np.sqrt((length**2).mean()))


def _stated(run: LoopRun) -> float:
    cutting = np.unique(run.before.move)
    return float(run.correction.uncertainty[cutting].max())


def draw_closed_loop(found: Mapping[str, Float[np.ndarray, " runs"]]) -> go.Figure:
    """Largest error of every robot, metres, ``before`` and ``after``, on a logarithmic scale, by the error before."""
    order = np.argsort(found["before"], kind="stable")
    figure = go.Figure()
    for label, colour, shape in (("before", VERMILION, "circle"), ("after", BLUE, "diamond")):
        figure.add_trace(
            go.Scatter(
                x=np.arange(1, len(order) + 1),
                y=found[label][order] * 1e3,
                mode="markers",
                name=label,
                marker={"color": colour, "size": 9, "symbol": shape},
                hovertemplate="%{y:.3f} mm<extra>" + label + "</extra>",
            )
        )
    figure.add_hline(y=0.1, line={"color": GREY, "dash": "dot", "width": 1})
    figure.update_xaxes(title_text="virtual robot, by its error before", dtick=max(1, len(order) // 10))
    return with_decades(styled(figure, height=400), "largest error on the part (mm)")


def closed_loop_html(loop: ClosedLoop, runs: Sequence[LoopRun], *, next_steps: str, version: str) -> str:
    """The page of the closed loop.

    Args:
        loop: what the robots have in common.
        runs: one for each robot.
        next_steps: commands to go on with.
        version: of the package that makes the page.
    """
    found = largest_errors(runs)
    moves = loop.program.moves
    items = (
        (f"{np.median(found['before']) * 1e3:.2f}", "mm", "largest error before, median of the robots"),
        (f"{np.median(found['after']) * 1e3:.3f}", "mm", "largest error after, median of the robots"),
        (str(len(moves)), "", "motions of the milling program, with arcs, two tools and two part frames"),
        (str(len(loop.q)), "", "measured poses, planned for the task"),
    )
    story = (
        "Each true robot has its own defects of geometry, drives that yield under weight, and gears that err. Its controller "
        "takes it for nominal. Sixty planned poses are measured with three reflectors on the spindle; the robot is identified; "
        "the cutters are known by the reflectors and the parts are measured by the tracker, each with its own uncertainty. Then "
        "the controller drives the program as it was written, and the corrected one, and the way of the true cutter on the true "
        "part is compared with what the program wants."
    )
    sections = [
        Section(title="In short", blocks=(Numbers(items), Text((story,)))),
        Section(
            title="All robots",
            blocks=(
                tabulate_closed_loop(runs),
                Chart(
                    title="Before and after",
                    figure=draw_closed_loop(found),
                    note="Each robot is one pair of marks; the dotted line is at 0.1 mm.",
                ),
            ),
        ),
        Section(
            title="The first robot",
            blocks=(
                Chart(
                    title="Error along the program",
                    figure=draw_errors(loop.program, runs[0].before, runs[0].after, "true error (mm)"),
                    note="Distance of the true cutter from where it is wanted; between targets, from its way.",
                ),
            ),
        ),
        Section(title="Go on", blocks=(Commands(next_steps),)),
    ]
    return report_html(
        "From measurement to a corrected program",
        sections,
        lead=f"{len(runs)} virtual robots of the kind {loop.robot.title or loop.robot.name}.",
        footer=f"Page by Taskcal {version}.",
    )
