"""``taskcal correct``: a robot program and a calibration in, a corrected program out."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import taskcal
from taskcal.cli.command import argument, option, output_option
from taskcal.cli.options.common import (
    AcceptUncertainOption,
    CalibrationOption,
    CellOption,
    UnsealedOption,
    look_at,
    read_calibration,
    task_option,
)
from taskcal.cli.options.page import PageOptions
from taskcal.cli.output import info, keep_note, read_note
from taskcal.cli.run import File, Result, Run
from taskcal.correction.options import Bounds
from taskcal.errors import FileError
from taskcal_groundwork.files import is_backup
from taskcal_groundwork.said import Said, joined

if TYPE_CHECKING:
    from robot_programs.core.program import Frame, Program
    from robot_programs.core.source import Source
    from taskcal.report.content import Section
    from taskcal.report.page import Report


STEPS = 8
"""Of the bar: reading, those that `taskcal.correct` names, and the verdict."""

MAX_LISTED = 1000
"""Entries of a list of the JSON result, as of the page's table: of 100 000 motions all would be 53 MB."""


@dataclass(frozen=True, kw_only=True)
class DestinationOptions:
    """Destination of the corrected program.

    Raises:
        typer.BadParameter: neither a place nor a dry run.
    """

    output: Path | None = output_option(
        None,
        "OUT",
        "File to write, or folder, where the files keep their names. A file of another language (.mod, .src, .csv) becomes a "
        "new program.",
        writes="later",
    )
    dry_run: bool = option(False, help="Show the table without writing a program.")
    accept_uncertain: AcceptUncertainOption = False

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
    """Measured tools, parts and axes of the cell, and its controller.

    Raises:
        typer.BadParameter: a name of the cell file, without the file; or two controllers.
    """

    cell: CellOption = None
    tool: str | None = option(
        None,
        "NAME",
        "Tool of the cell file, for URScript, APT and CSV, where the program names none, or TP, where one number is unknown.",
    )
    part: str | None = option(
        None,
        "NAME",
        "Part of the cell file, for URScript, APT and CSV, where the program names none, or TP, where one number is unknown.",
    )

    missing: Path | None = option(
        None,
        "CELL.toml",
        "Cell file to write, with the tools, parts and data that no file of the program declares, to be filled in.",
        writes="new",
    )
    controller_kinematics: Path | None = option(
        None,
        "FILE",
        "Kinematics with which the controller computes: a UR's calibration.conf, or a program saved on it (.urp).",
        callback=look_at,
    )
    nominal_controller: bool = option(
        False,
        help="The controller computes with the dimensions of the calibration's robot file (URScript requires either).",
    )

    def __post_init__(self) -> None:
        if self.nominal_controller and self.controller_kinematics is not None:
            raise typer.BadParameter(
                "--controller-kinematics states other dimensions; keep one of them", param_hint="--nominal-controller"
            )
        for name, given in ((self.tool, "--tool"), (self.part, "--part")):
            if name is not None and self.cell is None:
                raise typer.BadParameter(f"{given} requires --cell, which has '{name}'", param_hint=given)


def command(
    *,
    run: Run,
    programs: list[Path] = argument(
        ...,
        "PROGRAM [MORE …]",
        "Its files (RAPID, KRL, TP, URScript, APT or CSV), or a folder or zip file of them, such as a backup.",
    ),
    calibration: CalibrationOption,
    unsealed: UnsealedOption = False,
    destination: DestinationOptions,
    around: CellOptions,
    limits: Bounds,
    task: Path | None = task_option("Judge the expected error against the tolerance of this task.", callback=look_at),
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
) -> Result:
    """Correct a robot program with the calibrated model.

    Every target becomes the pose at which the nominal controller drives the joints that the calibrated robot needs; lines and
    arcs get more targets where they need them. All other bytes of the files stay.

    Rejected targets stay unchanged, and so do motions that the text does not determine, such as to computed targets. They are
    listed by file and line with the reason, and make the exit status 1. If every motion is rejected, nothing is written.

    If the uncertainty exceeds the correction, nothing is written without --accept-uncertain, which holds for this run and is named
    in the verdict; the message states what to measure.

    The controller is taken to compute with the lengths of the calibration's robot file, unless --controller-kinematics names
    others. If the calibration puts that file in doubt, a warning says so.
    """
    run.free("--output", *destination.files(programs))
    from robot_programs.backup import check_place

    calibrated = read_calibration(calibration, unsealed=unsealed)
    described = None if task is None else taskcal.load_task(task)
    begin = run.bar(["reading the program"], STEPS)
    into = _new_program(programs[0], destination.output)
    cell, controller, program = _read(programs, around, calibrated, into, run)
    if not again:
        check_not_corrected(program.sources)
    if program.backup is not None and destination.output is not None and not destination.dry_run:
        check_place(program.backup, destination.output)
    correction = taskcal.correct(
        calibrated,
        program,
        cell=cell,
        bounds=limits,
        into=into,
        keep_joints=keep_joints,
        helper=helper,
        controller=controller,
        accept_uncertain=destination.accept_uncertain or destination.dry_run,
        progress=begin,
    )
    begin("the verdict")
    from taskcal.correction.verdict import judge

    accepted = destination.accept_uncertain
    verdict = judge(calibrated, described, correction, cell, accept_uncertain=accepted).summary()
    withheld, out = destination.withholds(correction), destination.output
    contents, lay = ({}, None) if out is None or destination.dry_run or withheld else correction.parts(out)
    files = [File("program", path, content) for path, content in contents.items()]
    if lay is not None:
        files.insert(0, File("program", out, lay))
    if files:
        remember_corrected(correction, program.sources)
    result = _result(correction, verdict, [one.path for one in files], page, None if all_rows else MAX_LISTED)
    left = [f"{count} more {name}" for name, count in result["not_listed"].items() if count]
    if page.as_json and left:
        info(f"not listed: {', '.join(left)}; --all-rows lists all")

    def sections() -> "Sequence[Section]":
        from taskcal.report.correction import MAX_SHOWN_TARGETS, correction_sections, doubts_section
        from taskcal.report.verdict import verdict_section

        told = {**result, **correction.told(targets=MAX_SHOWN_TARGETS)}
        changes = correction_sections(told, calibrated.model.robot, program.backup)
        return [*doubts_section(result), verdict_section(verdict), *changes]

    def make() -> "Report":
        from taskcal.report.correction import correction_page, error_sections

        return correction_page(correction, calibrated, [*sections(), *error_sections(correction, calibrated)])

    return Result(
        summary=result, sections=sections, files=files, page=make, failed=_failure(correction, withheld=withheld)
    )


def _failure(correction: "taskcal.Correction", *, withheld: bool) -> bool | str:
    """Why nothing is written; or whether something was rejected."""
    if not withheld:
        return bool(correction.rejected) or any(one.rejected or one.unread for one in correction.diagnostics)
    from taskcal.report.correction import state_uncertain

    reasons = [correction.why_unwritten] if correction.why_unwritten else []
    if correction.uncertain:
        why = state_uncertain(correction.summary())
        reasons.insert(0, Said("{why}; --accept-uncertain writes the program all the same", why=why))
    return Said("not written: {reasons}", reasons=joined("; ", reasons))


def _read(
    programs: list[Path], around: CellOptions, calibration: "taskcal.Calibration", into: Path | None, run: Run
) -> "tuple[taskcal.Cell, taskcal.Robot | None, Program]":
    """The cell, the robot as its controller computes with it where that is another than the calibration's, and the program.

    Raises:
        TaskcalError: one of them is not as it should be, or the controller's kinematics have to be stated.
    """
    from robot_programs.languages import language_of
    from robot_programs.reading import read_program
    from taskcal.correction.cell import given_frames
    from taskcal.correction.controller import ask_for_controller, read_controller
    from taskcal.errors import TaskcalError

    cell = taskcal.Cell() if around.cell is None else taskcal.load_cell(around.cell)
    robot, named = calibration.model.robot, around.controller_kinematics
    if around.nominal_controller:
        if cell.controller == "calibrated":
            raise TaskcalError(
                "the cell file states a calibrated controller: leave --nominal-controller out, or correct the file"
            )
        cell = replace(cell, controller="nominal")
    controller = None if named is None else read_controller(named, robot)
    tool, part = _frame(cell, around.tool, "tool"), _frame(cell, around.part, "part")
    tools, parts = given_frames(cell)
    program = read_program(
        *programs, robot=controller or robot, tool=tool, part=part, tools=tools, parts=parts, data=cell.data
    )
    _say_missing(program, around, run)
    if asked := ask_for_controller(language_of(into or program.sources[0].path), robot, cell, controller):
        raise TaskcalError(f"{program.sources[0].path}: {asked}")
    return cell, controller, program


MAX_SHOWN_SECTIONS = 4
"""Of a cell file to fill in; more are written to a file."""


def _say_missing(program: "Program", around: CellOptions, run: Run) -> None:
    """Name tools, parts and data that no file declares, and show or write the cell file that states them.

    Raises:
        FileError: the file cannot be written.
    """
    from robot_programs.core.program import missing_from
    from taskcal.correction.cell import cell_to_fill_in

    missing = missing_from(program.diagnostics)
    stated = [one for one in missing if one.kind != "other"]
    others = [one.name for one in missing if one.kind == "other"]
    if stated:
        listed = ", ".join(f"{one.kind} {one.name} ({one.count})" for one in stated)
        info(f"not declared in the files: {listed}")
        info("pass the files that declare them, or state them in the cell file (--cell); --missing CELL.toml writes it")
        if around.missing is None and len(stated) <= MAX_SHOWN_SECTIONS:
            info(cell_to_fill_in(stated))
    if others:
        info(f"not declared in the files, and nothing that a cell file states: {', '.join(others)}")
    if around.missing is not None and stated:
        own = "" if around.cell is None else around.cell.read_text(encoding="utf-8").rstrip() + "\n\n"
        run.write({around.missing: own + cell_to_fill_in(stated)})
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
    correction: "taskcal.Correction",
    verdict: Mapping[str, Any],
    written: Sequence[Path | None],
    page: PageOptions,
    most: int | None,
) -> dict[str, Any]:
    program, told = correction.program, correction.told(most)
    counts = {
        "targets": len(program.motions), "refused": len(correction.rejected), "remarks": len(correction.diagnostics),
    }  # fmt: skip
    return {
        "program": [source.path for source in program.sources],
        "skipped_files": 0 if program.backup is None else program.backup.skipped,
        "written": list(written),
        "report": page.report,
        "verdict": verdict,
        **told,
        "not_listed": {name: count - len(told[name]) for name, count in counts.items()},
    }


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
