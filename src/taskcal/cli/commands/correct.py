"""``taskcal correct``: a robot program and a calibration in, a corrected program out."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from robot_programs.core.files import is_backup
from taskcal.cli.options.common import look_at_calibration
from taskcal.cli.options.correction import BoundsOptions, CellOptions
from taskcal.cli.options.page import PageOptions
from taskcal.cli.output import check_outputs, info, keep_note, read_note, show_facts, show_table, tell, write_json
from taskcal.cli.progress import bar_over
from taskcal.errors import FileError

if TYPE_CHECKING:
    from robot_programs.core.program import Frame, Program
    from robot_programs.core.source import Source
    from taskcal.correction.cell import Cell
    from taskcal.correction.correction import Correction
    from taskcal.identification.calibration import Calibration
    from taskcal.report.page import Page


SHOWN = 12
"""Targets of the table; the JSON result and the page have all of them."""


@dataclass(frozen=True, kw_only=True)
class DestinationOptions:
    """Where the corrected program goes.

    Raises:
        typer.BadParameter: neither a place nor a dry run.
    """

    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="OUT",
            readable=False,
            help="File to write, or folder: the corrected files keep their names in it. A file of another language (.mod, .src, "
            ".csv) is written as a new program.",
        ),
    ] = None
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Show the table without writing a program.")] = False
    accept_uncertain: Annotated[
        bool,
        typer.Option(
            "--accept-uncertain", help="Write the program even where the uncertainty is larger than the correction."
        ),
    ] = False

    def __post_init__(self) -> None:
        if self.output is None and not self.dry_run:
            raise typer.BadParameter("name the file or folder to write, or ask for --dry-run", param_hint="--output")

    def files(self, programs: list[Path]) -> list[Path]:
        """Files to write: the one named, or those of the same names in a folder."""
        if self.output is None or self.dry_run or any(map(is_backup, programs)):
            return []
        if self.output.is_dir():
            return list(dict.fromkeys(self.output / path.name for path in programs))
        return [self.output]

    def contents(self, correction: "Correction") -> dict[Path, str | bytes]:
        """What to write; nothing where it is withheld."""
        if self.output is None or self.dry_run or self.withholds(correction) or correction.program.backup:
            return {}
        return dict(correction.contents(self.output))

    def write_backup(self, correction: "Correction") -> tuple[Path, ...]:
        """Write the corrected folder or zip file, where one was read, and say where it is.

        Raises:
            FileError: it cannot be written.
        """
        if correction.program.backup is None or self.output is None or self.dry_run or self.withholds(correction):
            return ()
        return correction.write(self.output)

    def withholds(self, correction: "Correction") -> bool:
        """Whether the program is not written: for its uncertainty, or because every motion was refused."""
        uncertain = correction.uncertain and not self.accept_uncertain
        return (uncertain or bool(correction.why_unwritten)) and not self.dry_run


def command(
    programs: Annotated[
        list[Path],
        typer.Argument(
            metavar="PROGRAM [MORE …]",
            readable=False,
            help="Its files: RAPID, KRL, TP (FANUC), APT or CSV; or a folder or zip file with them, such as a backup.",
        ),
    ],
    calibration: Annotated[
        Path,
        typer.Option(
            "--calibration",
            "-c",
            metavar="CAL.json",
            readable=False,
            callback=look_at_calibration,
            help="Calibration written by taskcal identify.",
        ),
    ],
    destination: DestinationOptions,
    around: CellOptions,
    limits: BoundsOptions,
    keep_joints: Annotated[
        bool,
        typer.Option(
            "--keep-joints", help="Leave motions to joint positions as they are, such as those to a home position."
        ),
    ] = False,
    again: Annotated[
        bool, typer.Option("--again", help="Correct a program even though taskcal correct wrote it.")
    ] = False,
    *,
    page: PageOptions,
) -> None:
    """Correct a robot program with the calibrated model.

    Every target becomes the pose that makes the controller, which takes its robot for nominal, drive the joints that the
    robot as calibrated needs; lines and arcs get more targets where they need them. Whatever else the files say stays,
    byte for byte. Targets that are refused stay too, are named by file and line with the reason, and make the exit status 1.
    Where every motion is refused nothing is written.
    Motions that the text does not tell, such as those to computed targets, stay and are named.

    Where the uncertainty is larger than the correction nothing is written, unless asked for with --accept-uncertain;
    the message says what to measure.
    """
    inputs = [path for path in (calibration, around.cell, *programs, page.header) if path is not None]
    named = [*page.places, *(("--output", path) for path in destination.files(programs))]
    outputs = check_outputs("correct", named, inputs, force=page.force)
    page.check()
    from robot_programs.backup import check_place
    from taskcal.correction.correct import correct
    from taskcal.identification.calibration import load_calibration

    calibrated = load_calibration(calibration)
    cell, program = _read(programs, around, calibrated)
    if not again:
        check_not_corrected(program.sources)
    if program.backup is not None and destination.output is not None and not destination.dry_run:
        check_place(program.backup, destination.output)
    with bar_over(["reading the program"], 4) as say:
        correction = correct(
            calibrated,
            program,
            cell=cell,
            bounds=limits.bounds(),
            into=_new_program(programs[0], destination.output),
            keep_joints=keep_joints,
            progress=say,
        )
    contents = destination.contents(correction)
    written = (*contents, *destination.write_backup(correction))
    made = page.compose(_page(correction, calibrated)) if page.asked else {}
    outputs.write({**contents, **made})
    if written:
        remember_corrected(correction)
    if page.as_json:
        write_json(_as_json(correction, written, page))
    else:
        _show(correction, written, page.in_words(made))
    withheld = destination.withholds(correction)
    _say_uncertain(correction, withheld=withheld)
    if withheld and correction.why_unwritten:
        info(f"error: not written: {correction.why_unwritten}")
    if withheld or correction.rejected or any(diagnostic.rejected for diagnostic in correction.diagnostics):
        raise typer.Exit(1)


def _read(programs: list[Path], around: CellOptions, calibration: "Calibration") -> "tuple[Cell, Program]":
    from robot_programs.core.program import Frame
    from robot_programs.languages import language_of
    from robot_programs.reading import read_program
    from taskcal.correction.cell import Cell, load_cell

    cell = Cell() if around.cell is None else load_cell(around.cell)
    tool, part = _frame(cell, around.tool, "tool"), _frame(cell, around.part, "part")
    told = {m.name: Frame(name=m.name, T=m.controller) for m in cell.tools.values() if m.controller is not None}
    files = any(map(is_backup, programs))
    tools = {} if files or language_of(programs[0]).declares_frames else told
    return cell, read_program(*programs, robot=calibration.model.robot, tool=tool, part=part, tools=tools)


def _page(correction: "Correction", calibration: "Calibration") -> "Page":
    from taskcal.identification.provenance import package_version
    from taskcal.report.correction import correction_page

    return correction_page(correction, calibration, version=package_version())


def _say_uncertain(correction: "Correction", *, withheld: bool) -> None:
    """Say that the uncertainty is larger than the correction, where it is."""
    if not correction.uncertain:
        return
    from taskcal.report.correction import state_uncertain

    info(f"{'error: not written: ' if withheld else ''}{state_uncertain(correction)}")
    if withheld:
        info("--accept-uncertain writes the program all the same")


def _new_program(program: Path, output: Path | None) -> Path | None:
    """The file to write as a new program, where it is named in another language than the program's."""
    from robot_programs.languages import language_of, languages

    suffixes = {suffix for language in languages() for suffix in language.suffixes}
    if output is None or is_backup(output) or is_backup(program) or output.suffix.lower() not in suffixes:
        return None
    return None if language_of(output) == language_of(program) else output


def _frame(cell: "Cell", name: str | None, kind: str) -> "Frame | None":
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
            f"the cell file does not say where the controller has {kind} '{name}'; add controller = {{ position_mm = …, "
            "quaternion = … }"
        )
    return Frame(name=measured.name, T=measured.controller)


def _as_json(correction: "Correction", written: tuple[Path, ...], page: PageOptions) -> dict[str, Any]:
    program = correction.program
    return {
        "program": [source.path for source in program.sources],
        "skipped_files": 0 if program.backup is None else program.backup.skipped,
        "written": list(written),
        "report": page.report,
        **page.summary(),
        **correction.summary(),
        "targets": correction.targets(),
        "refused": [
            {"file": program.moves[i].place.path, "line": program.moves[i].place.line, "reason": reason}
            for i, reason in sorted(correction.rejected.items())
        ],
        "remarks": [
            {"file": diagnostic.place.path, "line": diagnostic.place.line, "text": diagnostic.text}
            for diagnostic in correction.diagnostics
        ],
    }


def _show(correction: "Correction", written: tuple[Path, ...], pages: str) -> None:
    from taskcal.report.correction import (
        group_remarks,
        state_expected,
        tabulate_correction,
        tabulate_errors,
        tabulate_targets,
    )

    show_facts(state_expected(correction))
    assessed = bool(len(correction.before.error))
    for table in (tabulate_errors(correction), tabulate_targets(correction, SHOWN)) if assessed else ():
        show_table(table.title, table.header, table.groups[0][1], left=table.text_columns)
        if table.note:
            tell(f"{table.note}\n")
    show_facts(tabulate_correction(correction))
    backup = correction.program.backup
    if backup is not None:
        info(f"{backup.path}: {len(correction.program.sources)} files of the program, {backup.skipped} others")
    moves = correction.program.moves
    problems = [(moves[i].place, f"left as it was: {why}") for i, why in sorted(correction.rejected.items())]
    problems += [(diagnostic.place, diagnostic.text) for diagnostic in correction.diagnostics]
    for problem in group_remarks(problems):
        info(problem)
    for path in written:
        info(f"written: {path}")
    if pages:
        info(f"written: {pages}")


# Programs that ``taskcal correct`` wrote: known again by their bytes, wherever they lie, so that none is corrected twice.
#
# A corrected program bears no mark, for all but its targets stays unchanged. A note has a digest of what was written instead,
# with the name of the program that it was made from.


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


def remember_corrected(correction: "Correction") -> None:
    """Note the files in which a correction changed something; where no note can be kept, they will not be known."""
    given = {source.path: source.encode() for source in correction.program.sources}
    for source in correction.sources:
        content = source.encode()
        if content not in given.values():
            origin = source.path if source.path in given else correction.program.sources[0].path
            keep_note("corrected", content, {"program": str(origin.resolve())})
