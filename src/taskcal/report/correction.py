"""A correction as a page: errors before and after, where they are, and what was left alone."""

import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float

from robot_programs.core.program import Program
from robot_programs.core.source import Place
from taskcal.correction.correction import Correction, Deviations
from taskcal.identification.calibration import Calibration
from taskcal.identification.uncertainty_budget import evaluation_of_model_error
from taskcal.report.calibration import corrected_uncertainty_section
from taskcal.report.content import Block, Chart, Numbers, Points, Scene, Section, Table, Text
from taskcal.report.page import Page
from taskcal.report.scene import coloured_points, spread_rows, to_mm
from taskcal.report.theme import BLUE, GREY, ORANGE, VERMILION, styled, with_decades

# Figures of a corrected program: its error along the way, and where it goes.

FLOOR = 1e-5
"""Smaller errors are drawn as this, millimetres: what is left there is the rounding of the program's numbers."""

MOST = 20_000
"""Points of a curve; more are thinned out."""

MOST_IN_SPACE = 4000
"""Points in space; more would only hide each other."""


def draw_errors_along(correction: Correction) -> go.Figure:
    """Predicted error in space along the program, before and after."""
    lines = {"before": correction.before, "after": correction.after}
    return draw_errors(correction.program, lines, "predicted error (mm)")


def draw_errors(program: Program, lines: Mapping[str, Deviations], title: str) -> go.Figure:
    """Error in space along a program, in two or three lines by what they are called, on a logarithmic scale."""
    figure = go.Figure()
    colours = (VERMILION, ORANGE, BLUE) if len(lines) > 2 else (VERMILION, BLUE)
    for (label, deviations), colour in zip(lines.items(), colours, strict=True):
        rows = _thinned(len(deviations.error))
        line = [program.moves[i].place.line for i in deviations.move[rows]]
        figure.add_trace(
            go.Scatter(
                x=deviations.move[rows] + deviations.share[rows],
                y=np.maximum(deviations.length[rows] * 1e3, FLOOR),
                mode="lines",
                name=label,
                line={"color": colour, "width": 1.2},
                customdata=line,
                hovertemplate="line %{customdata}: %{y:.3f} mm<extra>" + label + "</extra>",
            )
        )
    figure.update_xaxes(title_text="motion, in the order of the program")
    return with_decades(styled(figure, height=420), title)


def draw_errors_per_axis(correction: Correction) -> go.Figure:
    """Distribution of the errors along the part's axes at targets, before and after."""
    figure = go.Figure()
    for label, deviations, colour in (("before", correction.before, VERMILION), ("after", correction.after, BLUE)):
        rows = np.flatnonzero(deviations.at_target)
        for axis, name in enumerate("XYZ"):
            figure.add_trace(
                go.Box(
                    x=[name] * len(rows),
                    y=deviations.error[rows, axis] * 1e3,
                    name=label,
                    legendgroup=label,
                    showlegend=axis == 0,
                    offsetgroup=label,
                    marker={"color": colour, "size": 3},
                    line={"width": 1.2},
                    boxpoints=False,
                )
            )
    figure.update_layout(boxmode="group")
    figure.update_yaxes(title_text="true less wanted (mm)")
    figure.update_xaxes(title_text="axis of the part")
    return styled(figure, height=380)


def draw_program(correction: Correction) -> Scene:
    """Where the program takes the tool, coloured by its error before; in each part's own frame."""
    deviations = correction.before
    position = _positions(correction, deviations)
    moves = correction.program.moves
    own = np.array([moves[i].part.name for i in deviations.move])
    top = float(deviations.length.max() * 1e3) if len(deviations.error) else 1.0
    layers: list[Mapping[str, Any]] = []
    for name in dict.fromkeys(own.tolist()):
        rows = np.flatnonzero((own == name) & np.isfinite(position[:, 0]))
        rows = rows[spread_rows(len(rows), MOST_IN_SPACE)]
        if len(rows):
            length = deviations.length[rows] * 1e3
            lines = [moves[i].place.line for i in deviations.move[rows]]
            tips = [f"line {line}: {error:.3f} mm" for line, error in zip(lines, length, strict=True)]
            label = f"{name or 'base'}: error before, dark 0 to bright {top:.3f} mm"
            way = {"kind": "strokes", "label": f"{name or 'base'}: way", "colour": GREY, "width": 2}
            layers.append({**way, "at": [to_mm(position[rows])]})
            layers.append(coloured_points(label, position[rows], length, (0.0, top), tips))
    return Scene(
        title="Where the program goes",
        layers=tuple(layers),
        note="Bright points are those that the robot misses most without the correction; a bright corner is where the part "
        "would be worst. Every part in its own frame.",
    )


def _positions(correction: Correction, deviations: Deviations) -> Float[np.ndarray, "k 3"]:
    """Wanted tool points in the part."""
    return correction.wanted.at(deviations.move, deviations.share)[:, :3, 3]


def _thinned(count: int) -> np.ndarray:
    return np.unique(np.linspace(0, count - 1, min(count, MOST)).astype(int)) if count else np.zeros(0, dtype=int)


# What a correction does to a program, as tables.

_COLUMNS = ("max_mm", "rms_mm", "mean_mm", "max_x_mm", "max_y_mm", "max_z_mm", "max_turn_deg")


def state_expected(correction: Correction) -> list[tuple[str, str]]:
    """The error to be expected before and after, with the uncertainty and where it comes from; label and text."""
    if not len(correction.before.error):
        return [("to be expected", "not known: the robot reaches no target of the program; the reasons stand below")]
    budget = correction.budget
    shares = ", ".join(f"{name} {share:.0%}" for name, share in budget.shares.items())
    return [
        (
            "to be expected",
            f"{budget.before * 1e3:.3f} mm before, {budget.after * 1e3:.3f} mm after (rms in space at the targets)",
        ),
        ("corrected", f"{np.sqrt(budget.correction) * 1e3:.3f} mm, known to ± {budget.uncertainty * 1e3:.3f} mm"),
        ("± comes from", shares),
    ]


def state_uncertain(correction: Correction) -> str:
    """Why a correction is not worth writing, and what to measure."""
    budget = correction.budget
    share = max(budget.shares.items(), key=lambda item: item[1])
    return (
        f"the correction of {np.sqrt(budget.correction) * 1e3:.3f} mm is smaller than its uncertainty of "
        f"{budget.uncertainty * 1e3:.3f} mm (rms), of which {share[1]:.0%} is {share[0]}: {budget.remedy}"
    )


def tabulate_errors(correction: Correction) -> Table:
    """Predicted errors before and after, at targets and between them."""
    summary = correction.summary()
    rows: list[tuple[str, ...]] = []
    for where, label in (("targets", "at targets"), ("between", "between targets")):
        for when in ("before", "after"):
            deviations = summary[when][where]
            if deviations is not None:
                rows.append(
                    (f"{label}, {when}", str(deviations["count"]), *(f"{deviations[key]:.4f}" for key in _COLUMNS))
                )
    return Table.of_rows(
        "Predicted error of the true tool, without its uncertainty",
        ("", "points", "max mm", "rms mm", "mean mm", "max x", "max y", "max z", "max turn °"),
        rows,
        note="In the part's axes. Between targets, what lies along the way is left out. At a target that a zone rounds, the middle "
        "of the corner counts.",
    )


def tabulate_targets(correction: Correction, count: int | None = None) -> Table:
    """Targets with the largest errors before, or all of them in the order of the program."""
    targets = correction.targets()
    if count is not None:
        targets = sorted(targets, key=lambda t: -(t["before_mm"] or 0.0))[:count]
    rows = [
        (
            f"{Path(t['file']).name}:{t['line']}",
            t["target"],
            t["kind"],
            t["tool"],
            t["frame"],
            _number(t["before_mm"]),
            _number(t["after_mm"]),
            _number(t["uncertainty_rms_mm"]),
            _number(t["shift_mm"]),
            _number(t["joint_change_deg"]),
            str(t["written_as"]),
        )
        for t in targets
    ]
    title = "Targets" if count is None or len(rows) < count else f"The {len(rows)} targets with the largest errors"
    return Table.of_rows(
        title,
        (
            "line",
            "target",
            "motion",
            "tool",
            "frame",
            "before mm",
            "after mm",
            "± rms mm",
            "moved mm",
            "joints °",
            "as",
        ),
        rows,
        text_columns=(0, 1, 2, 3, 4),
        note="± rms: what the calibration must expect at the target. As: motions that one became.",
        folded=count is None,
    )


def tabulate_correction(correction: Correction) -> list[tuple[str, str]]:
    """What else there is to say, label and text."""
    motion, robot = correction.motion, correction.motion.robot
    summary = correction.summary()
    facts = [("relative to", statement) for statement in correction.statements]
    facts.append(
        (
            "motions",
            f"{summary['moves']}, of which {summary['corrected']} corrected and written as "
            f"{int(correction.pieces[correction.corrected].sum())}, {summary['refused']} refused, "
            f"{summary['moves'] - summary['corrected'] - summary['refused']} as they were; "
            f"{summary['unresolved']} remarks on what was not read",
        )
    )
    more = int(correction.pieces[correction.corrected].sum()) - summary["corrected"]
    facts.append(
        (
            "lines and arcs",
            f"divided until the true tool keeps to them within {summary['tolerance_mm']:.3f} mm: {more} motions more",
        )
    )
    facts.append(
        (
            "largest change",
            f"{summary['largest_shift_mm']:.3f} mm, {summary['largest_turn_deg']:.3f}°, "
            f"a joint by {summary['largest_joint_change_deg']:.3f}°",
        )
    )
    for label, key, unit in (("joint speed", "joint_speed", "/s"), ("joint acceleration", "joint_acceleration", "/s²")):
        deviations = summary[key]
        if not deviations:
            facts.append((label, "not known: no speed is programmed along lines and arcs"))
            continue
        scale = dict(zip(robot.joint_names, ("mm" if slides else "°" for slides in robot.prismatic), strict=True))
        words = [
            f"{name} {entry['largest']:.1f}{scale[name]}{unit}"
            + (f" of {entry['limit']:.0f}" if entry["limit"] is not None else "")
            for name, entry in deviations.items()
        ]
        facts.append((label, ", ".join(words)))
    if np.isfinite(motion.conditioning):
        facts.append(
            ("nearest to singular", f"ratio {motion.conditioning:.3f} of the Jacobian's singular values; 0 is singular")
        )
    return facts


def _number(value: float | None) -> str:
    return "" if value is None or not np.isfinite(value) else f"{value:.4f}"


# Remarks on many places of a program, as few lines: each reason once, with how often and where first.

SHOWN = 3
"""Places that are named of each reason beside the first."""

_DIFFERENT = re.compile(
    r"\w+(?= stays as it is)"
    r"|'[^']*'"
    r"|[^\s:']+\.\w+:\d+"
    r"|[$A-Z][$A-Z0-9_]+(?:\[[^\]]*\])?(?!\w)"
    r"|[-+]?\d+(?:\.\d+)?"
)
"""What differs between remarks of one reason: motions, names in quotes, places, names in capitals as KRL has them, and numbers."""


def group_remarks(remarks: Iterable[tuple[Place, str]]) -> list[str]:
    """A line for each reason, in the order in which the reasons come up.

    Remarks that differ in names, places and numbers only have one reason; the line gives the first of them. Places in the texts are
    named from the folder that all files have in common.

    Args:
        remarks: places and texts.
    """
    remarks = list(remarks)
    among = _common_folder(place.path for place, _ in remarks) if remarks else None
    groups: dict[str, list[tuple[Place, str]]] = {}
    for place, text in remarks:
        short = text if among in (None, Path()) else text.replace(f"{among}{os.sep}", "")
        groups.setdefault(_DIFFERENT.sub("#", short), []).append((place, short))
    return [_line(group) for group in groups.values()]


def _line(group: list[tuple[Place, str]]) -> str:
    (first, text), *_ = group
    _, *others = dict.fromkeys(place for place, _ in group)
    if len(group) == 1:
        return f"{first}: {text}"
    if not others:
        return f"{first}: {text} ({len(group)} times)"
    among = _common_folder(place.path for place, _ in group)
    places = [
        f"{place.line}" if place.path == first.path else f"{_from(among, place.path)}:{place.line}"
        for place in others[:SHOWN]
    ]
    more = f"and {len(others) - SHOWN} more" if len(others) > SHOWN else ""
    at = ", ".join([*places, *([more] if more else [])])
    return f"{first}: {text} ({len(group)} times; also in {'line' if others[0].path == first.path else 'file'} {at})"


def _common_folder(paths: Iterable[Path]) -> Path | None:
    """The folder that holds all of some files; None where there is none."""
    folders = [path.parent for path in paths]
    above = (folders[0], *folders[0].parents)
    return next((folder for folder in above if all(other.is_relative_to(folder) for other in folders)), None)


def _from(folder: Path | None, path: Path) -> Path:
    return path if folder is None else path.relative_to(folder)


def correction_page(correction: Correction, calibration: Calibration, *, version: str) -> Page:
    """The page of a correction.

    Args:
        correction: the corrected program.
        calibration: by which it was corrected.
        version: of the package that makes the page.
    """
    robot = calibration.model.robot
    names = ", ".join(source.path.name for source in correction.program.sources)
    return Page(
        title=f"Correction of {names}",
        sections=(
            _summary(correction),
            _errors(correction),
            *_uncertainty(correction, calibration),
            _left(correction),
            _targets(correction),
        ),
        lead=f"For the {robot.title or robot.name}, by the calibration of {calibration.provenance.campaign or 'a campaign'}.",
        footer=f"Page by Taskcal {version}; calibration of {calibration.provenance.created}.",
    )


def _summary(correction: Correction) -> Section:
    summary, budget = correction.summary(), correction.budget
    expected = (
        (f"{budget.before * 1e3:.3f}", "mm", "error to be expected before (rms in space at the targets)"),
        (f"{budget.after * 1e3:.3f}", "mm", "error to be expected after, uncertainty included"),
        (
            f"{budget.uncertainty * 1e3:.3f}",
            "mm",
            "of uncertainty: what the calibration must expect beyond its prediction",
        ),
    )
    items = (
        *(expected if len(correction.before.error) else ()),
        (f"{summary['largest_shift_mm']:.3f}", "mm", "farthest that a target was moved"),
        (str(summary["refused"]), "", "motions refused, and left as they were"),
        (str(summary["unresolved"]), "", "remarks on motions and texts that were not read, and were left as they were"),
    )
    facts = Table.of_rows(
        "The correction", ("", ""), [*state_expected(correction), *tabulate_correction(correction)], text_columns=(0, 1)
    )
    doubt = (Text((f"Look out: {state_uncertain(correction)}.",)),) if correction.uncertain else ()
    return Section(title="In short", blocks=(Numbers(items), *doubt, facts))


def _errors(correction: Correction) -> Section:
    blocks: list[Block] = [tabulate_errors(correction)]
    if len(correction.before.error):
        blocks += [
            Chart(
                title="Predicted error along the program",
                figure=draw_errors_along(correction),
                note="The lower line should lie well below the upper one along the whole program; where it does not, see "
                "what was left alone. Distance of the true tool from where it is wanted; between targets, from its way.",
            ),
            Chart(
                title="Errors at targets along the part's axes",
                figure=draw_errors_per_axis(correction),
                note="After the correction, boxes should lie about zero and be short. They hold the middle half, whiskers "
                "reach 1.5 times as far.",
            ),
            draw_program(correction),
        ]
    return Section(title="Errors", blocks=tuple(blocks))


def _uncertainty(correction: Correction, calibration: Calibration) -> tuple[Section, ...]:
    if not len(correction.before.error):
        return ()
    budget = correction.budget.of_targets(evaluation_of_model_error(calibration))
    return (corrected_uncertainty_section(budget),)


def _left(correction: Correction) -> Section:
    moves = correction.program.moves
    refused = group_remarks((moves[i].place, why) for i, why in sorted(correction.rejected.items()))
    diagnostics = group_remarks((diagnostic.place, diagnostic.text) for diagnostic in correction.diagnostics)
    blocks: list[Block] = []
    if refused:
        blocks += [Text(("These motions stay as they were:",)), Points(tuple(refused))]
    if diagnostics:
        blocks += [Text(("To be looked at:",)), Points(tuple(diagnostics))]
    if not blocks:
        blocks.append(Text(("Every motion was corrected, and nothing else is to be said.",)))
    return Section(title="What was left alone", blocks=tuple(blocks))


def _targets(correction: Correction) -> Section:
    return Section(title="Targets", blocks=(tabulate_targets(correction),))
