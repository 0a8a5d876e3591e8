"""A correction as a page and as tables: errors before and after, their uncertainty, and motions left unchanged."""

import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from robot_programs.core.program import Program
from robot_programs.core.source import Place
from taskcal.correction.correction import Correction, Deviations
from taskcal.correction.verdict import Verdict
from taskcal.identification.calibration import Calibration
from taskcal.identification.measured_range import describe_outside
from taskcal.identification.uncertainty_budget import evaluation_of_model_error
from taskcal.kinematics.inverse import freedom_of
from taskcal.report.calibration import corrected_uncertainty_section
from taskcal.report.chart import BLUE, GREY, ORANGE, VERMILION, Axis, Figure, Panel, Series
from taskcal.report.content import Block, Chart, Column, Numbers, Points, Scene, Section, Table
from taskcal.report.page import Page, edited_entry
from taskcal.report.scene import coloured_points, spread_rows, strokes
from taskcal.report.verdict import verdict_section
from taskcal.robot.error_model import ErrorModel

# Errors of a corrected program along its path, and in space.

MIN_DRAWN_MM = 1e-5
"""Smaller errors are drawn as this: below it there is only the rounding of the program's numbers."""

MAX_POINTS_IN_SPACE = 4000
"""Points in space; more would only hide each other."""


MAX_POINTS_ON_LINE = 2000
"""Points of a line; of a longer program the largest error of each of as many sections is drawn."""

MAX_TARGETS_ON_PAGE = 1000
"""Targets of the page's table, those with the largest errors: some 300 kB."""


def _largest(deviations: Deviations) -> Deviations:
    """The largest in each section of a long program; all of a short one."""
    length = deviations.length
    if len(length) <= MAX_POINTS_ON_LINE:
        return deviations
    sections = np.array_split(np.arange(len(length)), MAX_POINTS_ON_LINE)
    return deviations.rows(np.array([rows[np.argmax(length[rows])] for rows in sections]))


def draw_errors(program: Program, lines: Mapping[str, Deviations], title: str) -> Figure:
    """Draw the 3D error along a program, in two or three lines by their labels, on a logarithmic scale."""
    lines = {label: _largest(deviations) for label, deviations in lines.items()}
    colours = (VERMILION, ORANGE, BLUE) if len(lines) > 2 else (VERMILION, BLUE)
    series = tuple(
        Series(
            kind="line",
            name=label,
            x=deviations.move + deviations.share,
            y=np.maximum(deviations.length * 1e3, MIN_DRAWN_MM),
            colour=colour,
            labels=[f"line {program.motions[i].place.line}" for i in deviations.move],
        )
        for (label, deviations), colour in zip(lines.items(), colours, strict=True)
    )
    x, y = Axis(title="motion, in the order of the program"), Axis(title=title, unit="mm", log=True)
    return Figure(panels=(Panel(x=x, y=y, series=series, height=320.0),))


def draw_errors_per_axis(correction: Correction) -> Figure:
    """Draw the distribution of the errors along the part's axes at targets, before and after correction."""
    series: list[Series] = []
    for label, deviations, colour in (("before", correction.before, VERMILION), ("after", correction.after, BLUE)):
        errors = deviations.error[np.flatnonzero(deviations.at_target)] * 1e3
        axes = np.tile(np.arange(3), len(errors))
        series.append(Series(kind="boxes", name=label, x=errors[:, :3].ravel(), y=axes, colour=colour))
    axes = Axis(title="axis of the part", categories=("X", "Y", "Z"))
    return Figure(panels=(Panel(x=Axis(title="true less programmed", unit="mm"), y=axes, series=tuple(series)),))


def draw_program(correction: Correction) -> Scene:
    """Draw the programmed path, coloured by its error before correction; in each part's own frame."""
    deviations, motions = correction.before, correction.program.motions
    position = correction.wanted.at(deviations.move, deviations.share)[:, :3, 3]
    own = np.array([motions[i].part.name for i in deviations.move])
    top = float(deviations.length.max() * 1e3) if len(deviations.error) else 1.0
    layers: list[Mapping[str, Any]] = []
    for name in dict.fromkeys(own.tolist()):
        rows = np.flatnonzero((own == name) & np.isfinite(position[:, 0]))
        rows = rows[spread_rows(len(rows), MAX_POINTS_IN_SPACE)]
        if len(rows):
            length = deviations.length[rows] * 1e3
            lines = [motions[i].place.line for i in deviations.move[rows]]
            tips = [f"line {line}: {error:.3f} mm" for line, error in zip(lines, length, strict=True)]
            label = f"{name or 'base'}: error before, dark 0 to bright {top:.3f} mm"
            layers.append(strokes(f"{name or 'base'}: path", [position[rows]], GREY))
            layers.append(coloured_points(label, position[rows], length, (0.0, top), tips))
    return Scene(
        title="Programmed path and error",
        layers=tuple(layers),
        note="Bright points have the largest error without the correction. Every part in its own frame.",
    )


# A correction as tables.

ERRORS = (
    Column("", lambda row: row[0]),
    *(
        Column(label, lambda row, key=key: row[1][key], form)
        for label, key, form in (
            ("points", "count", "d"),
            ("max mm", "max_mm", ".4f"),
            ("rms mm", "rms_mm", ".4f"),
            ("mean mm", "mean_mm", ".4f"),
            *((f"max {axis} mm", f"max_{axis}_mm", ".4f") for axis in "xyz"),
            ("max turn °", "max_turn_deg", ".4f"),
        )
    ),
)

TARGETS = (
    Column("line", lambda t: f"{Path(t['file']).name}:{t['line']}"),
    Column("target", "target"),
    Column("motion", "kind"),
    Column("tool", "tool"),
    Column("frame", "frame"),
    Column("before mm", "before_mm", ".4f"),
    Column("after mm", "after_mm", ".4f"),
    Column("u mm", "uncertainty_rms_mm", ".4f"),
    Column("moved mm", "shift_mm", ".4f"),
    Column("joints °", "joint_change_deg", ".4f"),
    Column("motions", "written_as", "d"),
    Column("outside range", describe_outside, optional=True),
)

ON_A_LINE = ("line", "target", "before mm", "after mm", "u mm", "moved mm", "outside range")
"""Columns of a target that go on one line of a terminal; a page has all."""


def state_expected(correction: Correction) -> list[tuple[str, str]]:
    """State the expected error before and after, with the uncertainty and its sources; label and text."""
    if not len(correction.before.error):
        return [
            ("expected error", "not known: no target of the program is known and reached; the reasons are listed below")
        ]
    budget = correction.budget
    expected = f"{budget.before * 1e3:.3f} mm before, {budget.after * 1e3:.3f} mm after (3D rms at targets, uncertainty included)"
    size = f"{np.sqrt(budget.correction) * 1e3:.3f} mm rms, standard uncertainty {budget.uncertainty * 1e3:.3f} mm"
    shares = ", ".join(f"{name} {share:.0%}" for name, share in budget.shares.items())
    return [("expected error", expected), ("correction", size), ("uncertainty budget", shares)]


def state_uncertain(correction: Correction) -> str:
    """State why a correction is not significant, and what to measure."""
    budget = correction.budget
    source, share = max(budget.shares.items(), key=lambda item: item[1])
    return (
        f"the correction of {np.sqrt(budget.correction) * 1e3:.3f} mm rms is smaller than its standard uncertainty of "
        f"{budget.uncertainty * 1e3:.3f} mm, of which {share:.0%} is {source}: {budget.remedy}"
    )


def tabulate_errors(correction: Correction) -> Table:
    """Tabulate predicted errors before and after, at targets and between them."""
    summary = correction.summary()
    rows = [
        (f"{label}, {when}", summary[when][where])
        for where, label in (("targets", "at targets"), ("between", "between targets"))
        for when in ("before", "after")
        if summary[when][where] is not None
    ]
    return Table.of(
        "Predicted error of the true tool, without its uncertainty",
        ERRORS,
        rows,
        note="In the part's axes. Between targets, deviations along the path do not count. At a target that a zone rounds, the "
        "middle of the corner counts.",
    )


def tabulate_targets(correction: Correction, count: int | None = None) -> Table:
    """Tabulate some targets with the largest errors before, one a line, or all of them in the order of the program.

    Of more than `MAX_TARGETS_ON_PAGE` those with the largest errors stand for all.
    """
    most = MAX_TARGETS_ON_PAGE if count is None else count
    targets = correction.targets(most)
    everything = len(correction.program.motions) < most
    columns = TARGETS if count is None else [column for column in TARGETS if column.label in ON_A_LINE]
    if count is not None or not everything:
        targets = sorted(targets, key=lambda t: -(t["before_mm"] or 0.0))
    return Table.of(
        "Targets" if everything else f"The {len(targets)} targets with the largest errors",
        columns,
        targets,
        note="u: standard uncertainty at the target, 3D rms. Outside range: joint that leaves the measured range farthest in the "
        "motion." + (" Motions: number written for one." if count is None else ""),
        folded=count is None,
    )


def tabulate_correction(correction: Correction) -> list[tuple[str, str]]:
    """State everything else about a correction, label and text."""
    motion, summary = correction.motion, correction.summary()
    pieces = int(correction.pieces[correction.corrected].sum())
    unchanged = summary["moves"] - summary["corrected"] - summary["refused"]
    facts = [("relative to", statement) for statement in correction.statements]
    facts += [
        (
            "motions",
            f"{summary['moves']}: {summary['corrected']} corrected and written as {pieces}, {summary['refused']} rejected, "
            f"{unchanged} unchanged; {summary['unresolved']} statements not interpreted"
            + (f"; {summary['at_run_time']} more corrected at run time" if correction.helper is not None else ""),
        ),
        (
            "lines and arcs",
            f"divided until the true tool deviates by at most {summary['tolerance_mm']:.3f} mm: "
            f"{pieces - summary['corrected']} more motions",
        ),
        (
            "largest change",
            f"{summary['largest_shift_mm']:.3f} mm, {summary['largest_turn_deg']:.3f}°, "
            f"a joint by {summary['largest_joint_change_deg']:.3f}°",
        ),
        ("outside measured range", f"{summary['outside_moves']} of {summary['moves']} motions"),
    ]
    robot = motion.robot
    freedom, targets = freedom_of(ErrorModel(robot)), summary["after"]["targets"]
    if targets is not None and not freedom.whole:
        facts.append(("not corrected", f"up to {targets['max_turn_deg']:.3f}° at targets: {freedom}"))
    units = dict(zip(robot.joint_names, ("mm" if slides else "°" for slides in robot.prismatic), strict=True))
    for label, key, per in (("joint speed", "joint_speed", "/s"), ("joint acceleration", "joint_acceleration", "/s²")):
        words = [
            f"{name} {entry['largest']:.1f}{units[name]}{per}"
            + (f" of {entry['limit']:.0f}" if entry["limit"] is not None else "")
            for name, entry in summary[key].items()
        ]
        facts.append((label, ", ".join(words) or "not known: no speed is programmed along lines and arcs"))
    if np.isfinite(motion.conditioning):
        facts.append(
            ("nearest to singular", f"ratio {motion.conditioning:.3f} of the Jacobian's singular values; 0 is singular")
        )
    return facts


# Remarks on many places of a program, as few lines: each reason once, with how often and where first.

MAX_PLACES = 3
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
        for place in others[:MAX_PLACES]
    ]
    more = f"and {len(others) - MAX_PLACES} more" if len(others) > MAX_PLACES else ""
    at = ", ".join([*places, *([more] if more else [])])
    return f"{first}: {text} ({len(group)} times; also in {'line' if others[0].path == first.path else 'file'} {at})"


def _common_folder(paths: Iterable[Path]) -> Path | None:
    """The folder that holds all of some files; None where there is none."""
    folders = [path.parent for path in paths]
    above = (folders[0], *folders[0].parents)
    return next((folder for folder in above if all(other.is_relative_to(folder) for other in folders)), None)


def _from(folder: Path | None, path: Path) -> Path:
    return path if folder is None else path.relative_to(folder)


def correction_page(correction: Correction, calibration: Calibration, verdict: Verdict) -> Page:
    """Make the page of a correction.

    Args:
        correction: the corrected program.
        calibration: by which it was corrected.
        verdict: on both.
    """
    robot = calibration.model.robot
    names = ", ".join(source.path.name for source in correction.program.sources)
    sections = [verdict_section(verdict), _summary(correction), _errors(correction)]
    if len(correction.before.error):
        budget = correction.budget.of_targets(evaluation_of_model_error(calibration))
        sections.append(corrected_uncertainty_section(budget))
    sections += [_unchanged(correction), Section("Targets", tabulate_targets(correction))]
    return Page(
        title=f"Correction of {names}",
        sections=sections,
        lead=f"For the {robot.title or robot.name}, by the calibration of {calibration.provenance.campaign or 'a campaign'}.",
        source=f"calibration of {calibration.provenance.created}",
        header=(edited_entry(calibration.edit_warning),) if calibration.edited else (),
    )


def _summary(correction: Correction) -> Section:
    summary, budget = correction.summary(), correction.budget
    expected = (
        (f"{budget.before * 1e3:.3f}", "mm", "expected error before (3D rms at targets)"),
        (f"{budget.after * 1e3:.3f}", "mm", "expected error after, uncertainty included"),
        (f"{budget.uncertainty * 1e3:.3f}", "mm", "standard uncertainty of the correction (3D rms)"),
    )
    facts = [*state_expected(correction), *tabulate_correction(correction)]
    return Section(
        "Summary",
        Numbers(
            *(expected if len(correction.before.error) else ()),
            (f"{summary['largest_shift_mm']:.3f}", "mm", "largest shift of a target"),
            (
                str(summary["outside_moves"]),
                "",
                "motions outside the measured joint range, where errors are less certain",
            ),
            (str(summary["refused"]), "", "motions rejected, and left unchanged"),
            (str(summary["unresolved"]), "", "statements not interpreted, and left unchanged"),
        ),
        f"Not significant: {state_uncertain(correction)}." if correction.uncertain else None,
        Table.of_rows("The correction", ("", ""), facts, text_columns=(0, 1)),
    )


def _errors(correction: Correction) -> Section:
    blocks: list[Block] = [tabulate_errors(correction)]
    if len(correction.before.error):
        lines = {"before": correction.before, "after": correction.after}
        blocks += [
            Chart(
                "Predicted error along the program",
                draw_errors(correction.program, lines, "predicted 3D error"),
                "The lower line should lie well below the upper one along the whole program; where it does not, see the "
                "motions left unchanged. At targets: distance of the true tool from the programmed position; else from the path.",
            ),
            Chart(
                "Errors at targets along the part's axes",
                draw_errors_per_axis(correction),
                "After the correction, boxes should lie about zero and be short. They hold the middle half, whiskers "
                "reach 1.5 times as far.",
            ),
            draw_program(correction),
        ]
    return Section("Errors", *blocks)


def _unchanged(correction: Correction) -> Section:
    motions = correction.program.motions
    rejected = group_remarks((motions[i].place, why) for i, why in sorted(correction.rejected.items()))
    diagnostics = group_remarks((diagnostic.place, diagnostic.text) for diagnostic in correction.diagnostics)
    listed = {"Rejected motions:": rejected, "Diagnostics:": diagnostics}
    blocks = [block for title, lines in listed.items() if lines for block in (title, Points(*lines))]
    return Section("Motions left unchanged", *(blocks or ["None: every motion was corrected."]))
