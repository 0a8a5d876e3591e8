"""``taskcal correct``: a robot program and a calibration in, a corrected program out."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import taskcal
from robot_programs.core.files import is_backup
from taskcal.cli.command import argument, option
from taskcal.cli.options.common import (
    UnsealedOption,
    above_zero,
    look_at,
    look_at_calibration,
    metres,
    read_calibration,
)
from taskcal.cli.options.page import PageOptions
from taskcal.cli.output import info, keep_note, read_note, show, show_facts, tell
from taskcal.cli.progress import bar_over
from taskcal.errors import FileError

if TYPE_CHECKING:
    from robot_programs.core.program import Frame, Program
    from robot_programs.core.source import Source
    from taskcal.correction.verdict import Verdict


STEPS = 8
"""Of the bar: reading, those that `taskcal.correct` names, and the verdict."""

MAX_SHOWN_TARGETS = 12
"""Targets of the table."""

MAX_LISTED = 1000
"""Entries of a list of the JSON result, as of the page's table: of 100 000 motions all would be 53 MB."""


@dataclass(frozen=True, kw_only=True)
class DestinationOptions:
    """Destination of the corrected program.

    Raises:
        typer.BadParameter: neither a place nor a dry run.
    """

    output: Path | None = option(
        None,
        "OUT",
        "File to write, or folder, where the files keep their names. A file of another language (.mod, .src, .csv) becomes a "
        "new program.",
        also="-o",
    )
    dry_run: bool = option(False, help="Show the table without writing a program.")
    accept_uncertain: bool = option(
        False,
        help="Write the program even if the uncertainty exceeds the correction, or three times the robot's tolerances.",
    )

    def __post_init__(self) -> None:
        if self.output is None and not self.dry_run:
            raise typer.BadParameter("name the file or folder to write, or pass --dry-run", param_hint="--output")

    def files(self, programs: list[Path]) -> list[Path]:
        """Files to write: the one named, or those of the same names in a folder."""
        if self.output is None or self.dry_run or any(map(is_backup, programs)):
            return []
        if self.output.is_dir():
            return list(dict.fromkeys(self.output / path.name for path in programs))
        return [self.output]

    def withholds(self, correction: "taskcal.Correction") -> bool:
        """Whether the program is not written: for its uncertainty, or because every motion was refused."""
        uncertain = correction.uncertain and not self.accept_uncertain
        return (uncertain or bool(correction.why_unwritten)) and not self.dry_run


@dataclass(frozen=True, kw_only=True)
class CellOptions:
    """Measured tools, parts and axes of the cell.

    Raises:
        typer.BadParameter: a name of the cell file, without the file.
    """

    cell: Path | None = option(
        None, "CELL.toml", "Measured frames of tools and parts; by default those of the controller."
    )
    tool: str | None = option(
        None, "NAME", "Tool of the cell file, for URScript, APT and CSV, where the program names none."
    )
    part: str | None = option(
        None, "NAME", "Part of the cell file, for URScript, APT and CSV, where the program names none."
    )

    missing: Path | None = option(
        None,
        "CELL.toml",
        "Cell file to write, with the tools, parts and data that no file of the program declares, to be filled in.",
    )

    def __post_init__(self) -> None:
        for name, given in ((self.tool, "--tool"), (self.part, "--part")):
            if name is not None and self.cell is None:
                raise typer.BadParameter(f"{given} requires --cell, which has '{name}'", param_hint=given)


@dataclass(frozen=True, kw_only=True)
class BoundsOptions:
    """Limits of the correction."""

    tolerance_mm: float | None = option(
        None,
        "MM",
        "Maximum deviation from lines and arcs; by default 0.02, or a fifth of the uncertainty if larger, up to all of it if "
        "the program would grow by more than half.",
        show_default=False,
        callback=above_zero,
    )
    max_shift_mm: float = option(
        5.0, "MM", "Maximum shift of a target; larger corrections are rejected.", callback=above_zero
    )
    max_turn_deg: float = option(
        1.0, "DEG", "Maximum rotation of a target; larger corrections are rejected.", callback=above_zero
    )
    max_joint_deg: float = option(5.0, "DEG", "Maximum joint change at a target.", callback=above_zero)

    def bounds(self) -> "taskcal.Bounds":
        """Bounds in metres and radians."""
        from math import radians

        return taskcal.Bounds(
            tolerance=metres(self.tolerance_mm),
            shift=self.max_shift_mm * 1e-3,
            turn=radians(self.max_turn_deg),
            joint=radians(self.max_joint_deg),
        )


def command(
    *,
    programs: list[Path] = argument(
        ...,
        "PROGRAM [MORE …]",
        "Its files (RAPID, KRL, TP, URScript, APT or CSV), or a folder or zip file of them, such as a backup.",
    ),
    calibration: Path = option(
        ..., "CAL.json", "Calibration written by taskcal identify.", also="-c", callback=look_at_calibration
    ),
    unsealed: UnsealedOption = False,
    destination: DestinationOptions,
    around: CellOptions,
    limits: BoundsOptions,
    task: Path | None = option(
        None, "TASK.toml", "Judge the expected error against the tolerance of this task.", also="-t", callback=look_at
    ),
    keep_joints: bool = option(False, help="Leave motions to joint positions unchanged, such as to a home position."),
    helper: bool = option(
        False,
        help="Correct at run time the targets that the text does not state, such as computed ones (RAPID, KRL, URScript).",
    ),
    again: bool = option(False, help="Correct a program that taskcal correct wrote."),
    all_rows: bool = option(
        False, help=f"List every target, rejection and remark with --json, not only {MAX_LISTED} of each."
    ),
    page: PageOptions,
) -> None:
    """Correct a robot program with the calibrated model.

    Every target becomes the pose at which the nominal controller drives the joints that the calibrated robot needs; lines and
    arcs get more targets where they need them. All other bytes of the files stay.

    Rejected targets stay unchanged. They are listed by file and line with the reason, and make the exit status 1. If every
    motion is rejected, nothing is written. Motions that the text does not determine, such as to computed targets, stay
    unchanged and are listed.

    If the uncertainty exceeds the correction, nothing is written without --accept-uncertain; the message states what to
    measure.
    """
    named = [("--output", path) for path in destination.files(programs)]
    outputs = page.begin("correct", named, [calibration, around.cell, *programs])
    from robot_programs.backup import check_place

    calibrated = read_calibration(calibration, unsealed=unsealed)
    described = None if task is None else taskcal.load_task(task)
    with bar_over(["reading the program"], STEPS) as begin:
        cell, program = _read(programs, around, calibrated)
        if not again:
            check_not_corrected(program.sources)
        if program.backup is not None and destination.output is not None and not destination.dry_run:
            check_place(program.backup, destination.output)
        correction = taskcal.correct(
            calibrated,
            program,
            cell=cell,
            bounds=limits.bounds(),
            into=_new_program(programs[0], destination.output),
            keep_joints=keep_joints,
            helper=helper,
            accept_uncertain=destination.accept_uncertain or destination.dry_run,
            progress=begin,
        )
        begin("the verdict")
        from taskcal.correction.verdict import judge
        from taskcal.report.correction import correction_page, state_uncertain

        verdict = judge(calibrated, described, correction, cell)
    withheld, out = destination.withholds(correction), destination.output
    contents, lay = ({}, None) if out is None or destination.dry_run or withheld else correction.parts(out)
    made = page.write(outputs, contents, lambda: correction_page(correction, calibrated, verdict), lay)
    written = tuple(contents) if lay is None or out is None else (out,)
    if written:
        remember_corrected(correction, program.sources)
    result = _result(correction, verdict, written, page, None if all_rows else MAX_LISTED)
    page.give(result, lambda: _show(correction, verdict, written, page.in_words(made)))
    left = [f"{count} more {name}" for name, count in result["not_listed"].items() if count]
    if page.as_json and left:
        info(f"not listed: {', '.join(left)}; --all-rows lists all")
    not_written = "error: not written: " if withheld else ""
    if correction.uncertain:
        info(f"{not_written}{state_uncertain(correction)}")
        if withheld:
            info("--accept-uncertain writes the program all the same")
    if withheld and correction.why_unwritten:
        info(f"{not_written}{correction.why_unwritten}")
    if withheld or correction.rejected or any(diagnostic.rejected for diagnostic in correction.diagnostics):
        raise typer.Exit(1)


def _read(
    programs: list[Path], around: CellOptions, calibration: "taskcal.Calibration"
) -> "tuple[taskcal.Cell, Program]":
    from robot_programs.reading import read_program
    from taskcal.correction.cell import given_frames

    cell = taskcal.Cell() if around.cell is None else taskcal.load_cell(around.cell)
    tool, part = _frame(cell, around.tool, "tool"), _frame(cell, around.part, "part")
    tools, parts = given_frames(cell)
    program = read_program(
        *programs, robot=calibration.model.robot, tool=tool, part=part, tools=tools, parts=parts, data=cell.data
    )
    _say_missing(program, around)
    return cell, program


MAX_SHOWN_SECTIONS = 4
"""Of a cell file to fill in; more are written to a file."""


def _say_missing(program: "Program", around: CellOptions) -> None:
    """Name tools, parts and data that no file declares, and show or write the cell file that states them.

    Raises:
        FileError: the file exists, or cannot be written.
    """
    from robot_programs.core.program import missing_from
    from taskcal.correction.cell import cell_to_fill_in
    from taskcal.io.files import write_whole

    missing = missing_from(program.diagnostics)
    stated = [one for one in missing if one.kind != "other"]
    others = [one.name for one in missing if one.kind == "other"]
    if stated:
        listed = ", ".join(f"{one.kind} {one.name} ({one.count})" for one in stated)
        info(f"declared in none of the files: {listed}")
        info("pass the files that declare them, or state them in the cell file (--cell); --missing CELL.toml writes it")
        if around.missing is None and len(stated) <= MAX_SHOWN_SECTIONS:
            info(cell_to_fill_in(stated))
    if others:
        info(f"declared in none of the files, and not for a cell file: {', '.join(others)}")
    if around.missing is not None and stated:
        if around.missing.exists():
            raise FileError(around.missing, "exists; name a new file for what is to be stated")
        own = "" if around.cell is None else around.cell.read_text(encoding="utf-8").rstrip() + "\n\n"
        write_whole(around.missing, own + cell_to_fill_in(stated))
        info(f"to be filled in: {around.missing}")


def _new_program(program: Path, output: Path | None) -> Path | None:
    """The file to write as a new program, where it is named in another language than the program's."""
    from robot_programs.languages import language_of, languages

    suffixes = {suffix for language in languages() for suffix in language.suffixes}
    if output is None or is_backup(output) or is_backup(program) or output.suffix.lower() not in suffixes:
        return None
    return None if language_of(output) == language_of(program) else output


def _frame(cell: "taskcal.Cell", name: str | None, kind: str) -> "Frame | None":
    """The controller's value of a tool or part of the cell file.

    Raises:
        TaskcalError: the file does not have it, or not the controller's value.
    """
    if name is None:
        return None
    from robot_programs.core.program import Frame
    from taskcal.errors import TaskcalError, UnknownName

    among = cell.tools if kind == "tool" else cell.parts
    measured = among.get(name.casefold())
    if measured is None:
        raise UnknownName(kind, name, [m.name for m in among.values()], "in the cell file")
    if measured.controller is None:
        raise TaskcalError(
            f"the cell file does not state the controller's {kind} '{name}'; add controller = {{ position_mm = …, "
            "quaternion = … }"
        )
    return Frame(name=measured.name, T=measured.controller)


def _result(
    correction: "taskcal.Correction", verdict: "Verdict", written: tuple[Path, ...], page: PageOptions, most: int | None
) -> dict[str, Any]:
    program = correction.program
    lists = {
        "targets": correction.targets(most),
        "refused": [
            {"file": program.motions[i].place.path, "line": program.motions[i].place.line, "reason": reason}
            for i, reason in sorted(correction.rejected.items())[:most]
        ],
        "remarks": [
            {"file": diagnostic.place.path, "line": diagnostic.place.line, "text": diagnostic.text}
            for diagnostic in correction.diagnostics[:most]
        ],
    }
    counts = {
        "targets": len(program.motions), "refused": len(correction.rejected), "remarks": len(correction.diagnostics),
    }  # fmt: skip
    return {
        "program": [source.path for source in program.sources],
        "skipped_files": 0 if program.backup is None else program.backup.skipped,
        "written": list(written),
        "report": page.report,
        "verdict": verdict.summary(),
        **correction.summary(),
        **lists,
        "not_listed": {name: counts[name] - len(lists[name]) for name in lists},
    }


def _show(correction: "taskcal.Correction", verdict: "Verdict", written: tuple[Path, ...], pages: str) -> None:
    from taskcal.report import correction as tables
    from taskcal.report.verdict import next_step, tabulate_verdict

    judged = tabulate_verdict(verdict)
    show(judged)
    tell(f"{judged.note}\n")
    if len(correction.before.error):
        targets = tables.tabulate_targets(correction, MAX_SHOWN_TARGETS)
        show(targets)
        tell(f"{targets.note}\n")
    show_facts([*tables.state_expected(correction), *tables.tabulate_correction(correction)])
    backup = correction.program.backup
    if backup is not None:
        info(f"{backup.path}: {len(correction.program.sources)} files of the program, {backup.skipped} others")
    motions = correction.program.motions
    problems = [(motions[i].place, f"unchanged: {why}") for i, why in sorted(correction.rejected.items())]
    problems += [(diagnostic.place, diagnostic.text) for diagnostic in correction.diagnostics]
    for problem in tables.group_remarks(problems):
        info(problem)
    for path in written:
        info(f"written: {path}")
    if pages:
        info(f"written: {pages}")
    tell()
    show_facts([("next", next_step(verdict))])


# Programs that ``taskcal correct`` wrote: known again by their bytes, wherever they lie, so that none is corrected
# twice.
#
# A corrected program bears no mark, for all but its targets stays unchanged. A note has a digest of what was written
# instead, with the name of the program that it was made from.


def check_not_corrected(sources: "Iterable[Source]") -> None:
    """Check that no file of a program is as `taskcal correct` wrote it.

    Raises:
        FileError: one is, with the file that it was made from.
    """
    for source in sources:
        if origin := read_note("corrected", source.encode()).get("program"):
            raise FileError(
                source.path,
                f"was written by taskcal correct from '{origin}' and would be corrected twice; correct that file, or confirm with "
                "--again",
            )


def remember_corrected(correction: "taskcal.Correction", read: "Iterable[Source]") -> None:
    """Note the files in which a correction changed something; where no note can be kept, they will not be known."""
    given = {source.path: source.encode() for source in read}
    for source in correction.sources:
        content = source.encode()
        if content not in given.values():
            origin = source.path if source.path in given else correction.program.sources[0].path
            keep_note("corrected", content, {"program": str(origin.resolve())})
