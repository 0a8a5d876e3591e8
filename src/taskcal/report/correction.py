"""A correction as a page and as tables: errors before and after, their uncertainty, and motions left unchanged."""

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from robot_programs.core.program import Program
from robot_programs.core.source import Backup, Place
from taskcal.correction.correction import REMEDIES, Correction, Deviations
from taskcal.errors import listed
from taskcal.identification.calibration import Calibration
from taskcal.identification.measured_range import describe_outside
from taskcal.identification.uncertainty_budget import evaluation_of_model_error
from taskcal.kinematics.inverse import freedom_of
from taskcal.report.calibration import corrected_uncertainty_section
from taskcal.report.chart import BLUE, GREY, ORANGE, VERMILION, Axis, Figure, Panel, Series
from taskcal.report.content import Block, Bullets, Chart, Column, Facts, Section, TextTable, Viewer
from taskcal.report.page import Report, edited_entry
from taskcal.report.scene import coloured_points, spread_rows, strokes
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal_groundwork.said import Said, joined, term

# Errors of a corrected program along its path, and in space.

MIN_DRAWN_MM = 1e-5
"""Smaller errors are drawn as this: below it there is only the rounding of the program's numbers."""

MAX_POINTS_IN_SPACE = 4000
"""Points in space; more would only hide each other."""


MAX_POINTS_ON_LINE = 2000
"""Points of a line; of a longer program the largest error of each of as many sections is drawn."""

MAX_SHOWN_TARGETS = 12
"""Targets that are shown with the summary, those with the largest errors."""

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
    x, y = Axis(title=Said("motion, in the order of the program")), Axis(title=title, unit="mm", log=True)
    return Figure(panels=(Panel(x=x, y=y, series=series, height=320.0),))


def draw_errors_per_axis(correction: Correction) -> Figure:
    """Draw the distribution of the errors along the part's axes at targets, before and after correction."""
    series: list[Series] = []
    for label, deviations, colour in (("before", correction.before, VERMILION), ("after", correction.after, BLUE)):
        errors = deviations.error[np.flatnonzero(deviations.at_target)] * 1e3
        axes = np.tile(np.arange(3), len(errors))
        series.append(Series(kind="boxes", name=label, x=errors[:, :3].ravel(), y=axes, colour=colour))
    axes = Axis(title=Said("axis of the part"), categories=("X", "Y", "Z"))
    return Figure(panels=(Panel(x=Axis(title=Said("true less programmed"), unit="mm"), y=axes, series=tuple(series)),))


def draw_program(correction: Correction) -> Viewer:
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
    return Viewer(
        title=Said("Programmed path and error"),
        layers=tuple(layers),
        note=Said("Bright points have the largest error without the correction. Every part in its own frame."),
    )


# A correction as tables.

ERRORS = (
    Column("", lambda row: row[0]),
    *(
        Column(label, lambda row, key=key: row[1][key], form)
        for label, key, form in (
            (Said("points"), "count", "d"),
            (Said("max mm"), "max_mm", ".4f"),
            (Said("rms mm"), "rms_mm", ".4f"),
            (Said("mean mm"), "mean_mm", ".4f"),
            *((Said("max {axis} mm", axis=axis), f"max_{axis}_mm", ".4f") for axis in "xyz"),
            (Said("max turn °"), "max_turn_deg", ".4f"),
        )
    ),
)

TARGETS = (
    Column(Said("line"), lambda t: f"{Path(t['file']).name}:{t['line']}"),
    Column(Said("programmed target"), "target"),
    Column(Said("motion"), "kind"),
    Column(Said("tool"), "tool"),
    Column(Said("frame"), "frame"),
    Column(Said("before mm"), "before_mm", ".4f"),
    Column(Said("after mm"), "after_mm", ".4f"),
    Column("u mm", "uncertainty_rms_mm", ".4f"),
    Column(Said("moved mm"), "shift_mm", ".4f"),
    Column(Said("joints °"), "joint_change_deg", ".4f"),
    Column(Said("motions"), "written_as", "d"),
    Column(Said("outside range"), describe_outside, optional=True),
)

ON_A_LINE = ("line", "programmed target", "before mm", "after mm", "u mm", "moved mm", "outside range")
"""Columns of a target that go on one line of a terminal; a page has all."""


# What is said of a correction, by its summary: `Correction.summary`, or what ``taskcal correct --json --all-rows`` prints.


def state_expected(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """State the expected error before and after, with the uncertainty and its sources; label and text."""
    if not is_predicted(summary):
        unknown = Said("not known: no target of the program is known and reached; the reasons are listed below")
        return [(Said("expected error"), unknown)]
    expected = summary["expected"]
    shares = (Said("{source} {share:.0%}", source=term(name), share=one) for name, one in expected["shares"].items())
    return [
        (
            Said("expected error"),
            Said(
                "{before:.3f} mm before, {after:.3f} mm after (3D rms at targets, uncertainty included)",
                before=expected["before_mm"],
                after=expected["after_mm"],
            ),
        ),
        (
            Said("correction"),
            Said(
                "{size:.3f} mm rms, standard uncertainty {uncertainty:.3f} mm",
                size=expected["correction_mm"],
                uncertainty=expected["uncertainty_mm"],
            ),
        ),
        (Said("uncertainty budget"), joined(", ", shares)),
    ]


def is_predicted(summary: Mapping[str, Any]) -> bool:
    """Whether the error of any point of the program is known."""
    return any(summary["before"][where] is not None for where in ("targets", "between"))


def state_uncertain(summary: Mapping[str, Any]) -> Said:
    """State why a correction is not significant, and what to measure."""
    expected = summary["expected"]
    source, share = max(expected["shares"].items(), key=lambda item: item[1])
    return Said(
        "the correction of {size:.3f} mm rms is smaller than its standard uncertainty of {uncertainty:.3f} mm, of which "
        "{share:.0%} is {source}: {remedy}",
        size=expected["correction_mm"],
        uncertainty=expected["uncertainty_mm"],
        share=share,
        source=term(source),
        remedy=term(REMEDIES[source]),
    )


def tabulate_errors(correction: Correction) -> TextTable:
    """Tabulate predicted errors before and after, at targets and between them."""
    summary = correction.summary()
    rows = [
        (f"{label}, {when}", summary[when][where])
        for where, label in (("targets", "at targets"), ("between", "between targets"))
        for when in ("before", "after")
        if summary[when][where] is not None
    ]
    return TextTable.of(
        Said("Predicted error of the true tool, without its uncertainty"),
        ERRORS,
        rows,
        note=Said(
            "In the part's axes. Between targets, deviations along the path do not count. At a target that a zone rounds, the "
            "middle of the corner counts."
        ),
    )


def tabulate_targets(targets: Sequence[Mapping[str, Any]], moves: int, count: int | None = None) -> TextTable:
    """Tabulate some targets with the largest errors before, one a line, or all of them in the order of the program.

    Of more than `MAX_TARGETS_ON_PAGE` those with the largest errors stand for all.

    Args:
        targets: as `Correction.targets` has them, all or those with the largest errors.
        moves: motions of the program.
        count: how many are shown on a line each; all by default, with all columns.
    """
    most = MAX_TARGETS_ON_PAGE if count is None else count
    everything = moves < most
    columns = TARGETS if count is None else [column for column in TARGETS if column.label in ON_A_LINE]
    if count is not None or not everything:
        targets = sorted(targets, key=lambda t: -(t["before_mm"] or 0.0))[:most]
    note = Said(
        "u: standard uncertainty at the target, 3D rms. Outside range: joint that leaves the measured range farthest in the motion."
    )
    return TextTable.of(
        Said("Targets")
        if everything
        else Said("The {count} targets with the largest errors", count=min(most, len(targets))),
        columns,
        targets,
        note=Said("{note} Motions: number written for one.", note=note) if count is None else note,
        folded=count is None,
    )


def tabulate_correction(summary: Mapping[str, Any], robot: Robot) -> list[tuple[str, str]]:
    """State everything else about a correction, label and text.

    Args:
        summary: of the correction.
        robot: whose program it is.
    """
    unchanged = summary["moves"] - summary["corrected"] - len(summary["refused"])
    pieces = summary["written_moves"] - (summary["moves"] - summary["corrected"])
    motions = Said(
        "{moves}: {corrected} corrected and written as {pieces}, {refused} rejected, {unchanged} unchanged; statements not "
        "interpreted: {unresolved}; lines added: {added}",
        moves=summary["moves"],
        corrected=summary["corrected"],
        pieces=pieces,
        refused=len(summary["refused"]),
        unchanged=unchanged,
        unresolved=summary["unresolved"],
        added=summary["added_lines"],
    )
    if summary["at_run_time"]:
        motions = Said("{motions}; {count} more corrected at run time", motions=motions, count=summary["at_run_time"])
    facts: list[tuple[str, str]] = [
        (Said("relative to"), joined("; ", map(term, statement.split("; ")))) for statement in summary["relative_to"]
    ]
    facts += [
        (Said("motions"), motions),
        (
            Said("lines and arcs"),
            Said(
                "divided until the true tool deviates by at most {tolerance:.3f} mm: {more} more motions",
                tolerance=summary["tolerance_mm"],
                more=pieces - summary["corrected"],
            ),
        ),
        (
            Said("largest change"),
            Said(
                "{shift:.3f} mm, {turn:.3f}°, a joint by {joint:.3f}°",
                shift=summary["largest_shift_mm"],
                turn=summary["largest_turn_deg"],
                joint=summary["largest_joint_change_deg"],
            ),
        ),
        (
            Said("outside measured range"),
            Said("{outside} of {moves} motions", outside=summary["outside_moves"], moves=summary["moves"]),
        ),
    ]
    freedom, targets = freedom_of(ErrorModel(robot)), summary["after"]["targets"]
    if targets is not None and not freedom.whole:
        left = Said("up to {turn:.3f}° at targets: {freedom}", turn=targets["max_turn_deg"], freedom=str(freedom))
        facts.append((Said("not corrected"), left))
    units = dict(zip(robot.joint_names, ("mm" if slides else "°" for slides in robot.prismatic), strict=True))
    speeds = ((Said("joint speed"), "joint_speed", "/s"), (Said("joint acceleration"), "joint_acceleration", "/s²"))
    for label, key, per in speeds:
        words = [_of_limit(name, entry, f"{units[name]}{per}") for name, entry in summary[key].items()]
        unknown = Said("not known: no speed is programmed along lines and arcs")
        facts.append((label, joined(", ", words) if words else unknown))
    if (ratio := summary["smallest_singular_ratio"]) is not None:
        said = Said("ratio {ratio:.3f} of the Jacobian's singular values; 0 is singular", ratio=ratio)
        facts.append((Said("nearest to singular"), said))
    return facts


def _of_limit(name: str, entry: Mapping[str, Any], unit: str) -> Said:
    said = Said("{name} {largest:.1f}{unit}", name=name, largest=entry["largest"], unit=unit)
    return said if entry["limit"] is None else Said("{said} of {limit:.0f}", said=said, limit=entry["limit"])


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
    said = {"place": str(first), "text": term(text), "count": len(group)}
    if len(group) == 1:
        return Said("{place}: {text}", **said)
    if not others:
        return Said("{place}: {text} ({count} times)", **said)
    among = _common_folder(place.path for place, _ in group)
    places = [
        f"{place.line}" if place.path == first.path else f"{_from(among, place.path)}:{place.line}" for place in others
    ]
    where = Said("line {at}", at=listed(places, MAX_PLACES))
    if others[0].path != first.path:
        where = Said("file {at}", at=listed(places, MAX_PLACES))
    return Said("{place}: {text} ({count} times; also in {where})", **said, where=where)


def _common_folder(paths: Iterable[Path]) -> Path | None:
    """The folder that holds all of some files; None where there is none."""
    folders = [path.parent for path in paths]
    above = (folders[0], *folders[0].parents)
    return next((folder for folder in above if all(other.is_relative_to(folder) for other in folders)), None)


def _from(folder: Path | None, path: Path) -> Path:
    return path if folder is None else path.relative_to(folder)


def correction_page(correction: Correction, calibration: Calibration, sections: Sequence[Section]) -> Report:
    """Make the page of a correction.

    Args:
        correction: the corrected program.
        calibration: by which it was corrected.
        sections: what is in doubt, the verdict, `correction_sections`, and `error_sections`.
    """
    robot = calibration.model.robot
    names = ", ".join(source.path.name for source in correction.program.sources)
    return Report(
        title=f"Correction of {names}",
        sections=sections,
        lead=f"For the {robot.title or robot.name}, by the calibration of {calibration.provenance.campaign or 'a campaign'}.",
        source=f"calibration of {calibration.provenance.created}",
        header=(edited_entry(calibration.edit_warning),) if calibration.edited else (),
    )


def doubts_section(told: Mapping[str, Any]) -> list[Section]:
    """Make the section of what is in doubt, if anything is."""
    points = Bullets(*(Said("Warning: {doubt}.", doubt=term(doubt)) for doubt in told["doubts"]))
    return [Section(Said("Warning"), points)] if told["doubts"] else []


def correction_sections(told: Mapping[str, Any], robot: Robot, backup: Backup | None = None) -> list[Section]:
    """Make the sections that need no figure: what stays as it is, and how the program changes.

    Args:
        told: as `Correction.told` has it, or ``taskcal correct --json --all-rows`` prints it.
        robot: whose program it is.
        backup: that the program is a part of, if it is.
    """
    facts = [*state_expected(told), *tabulate_correction(told, robot)]
    if backup is not None:
        others = Said(
            "{path}: {files} files of the program, {skipped} others",
            path=str(backup.path),
            files=len(told["program"]),
            skipped=backup.skipped,
        )
        facts.append((Said("backup"), others))
    expected = told["expected"]
    uncertain = told["corrected"] > 0 and expected["uncertainty_mm"] > expected["correction_mm"]
    summary = Section(
        Said("Summary"),
        Said("Not significant: {why}.", why=state_uncertain(told)) if uncertain else None,
        tabulate_targets(told["targets"], told["moves"], MAX_SHOWN_TARGETS) if is_predicted(told) else None,
        Facts(*facts),
    )
    return [_unchanged(told), summary]


def error_sections(correction: Correction, calibration: Calibration) -> list[Section]:
    """Make the sections of predicted errors along the program, their uncertainty, and every target."""
    sections = [_errors(correction)]
    if len(correction.before.error):
        budget = correction.budget.of_targets(evaluation_of_model_error(calibration))
        sections.append(corrected_uncertainty_section(budget))
    targets = correction.targets(MAX_TARGETS_ON_PAGE)
    return [*sections, Section(Said("Targets"), tabulate_targets(targets, len(correction.program.motions)))]


def _errors(correction: Correction) -> Section:
    blocks: list[Block] = [tabulate_errors(correction)]
    if len(correction.before.error):
        lines = {"before": correction.before, "after": correction.after}
        blocks += [
            Chart(
                Said("Predicted error along the program"),
                draw_errors(correction.program, lines, "predicted 3D error"),
                Said(
                    "The lower line should lie well below the upper one along the whole program; where it does not, see the "
                    "motions left unchanged. At targets: distance of the true tool from the programmed position; else from "
                    "the path."
                ),
            ),
            Chart(
                Said("Errors at targets along the part's axes"),
                draw_errors_per_axis(correction),
                Said(
                    "After the correction, boxes should lie about zero and be short. They hold the middle half, whiskers "
                    "reach 1.5 times as far."
                ),
            ),
            draw_program(correction),
        ]
    return Section(Said("Errors"), *blocks)


def _unchanged(told: Mapping[str, Any]) -> Section:
    lists = {Said("Rejected motions:"): ("refused", "reason"), Said("Diagnostics:"): ("remarks", "text")}
    blocks: list[Block | str] = []
    for title, (key, words) in lists.items():
        places = ((Place(path=Path(one["file"]), line=one["line"]), one[words]) for one in told[key])
        blocks += [title, Bullets(*group_remarks(places))] if told[key] else []
    if told["remarks"] and not told["refused"]:
        blocks.insert(0, Said("No motion was rejected."))
    return Section(Said("Motions left unchanged"), *(blocks or [Said("Every motion was corrected.")]))
