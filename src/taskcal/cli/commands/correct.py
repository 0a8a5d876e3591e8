"""``taskcal correct``: a robot program and a calibration in, a corrected program out."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskcal.cli.options import ForceOption, JsonOption, ReportOption
from taskcal.cli.output import (
    announce_compilation,
    note,
    show_facts,
    show_table,
    tell,
    working,
    write_json,
)
from taskcal.cli.outputs import check_outputs

if TYPE_CHECKING:
    from taskcal.correction.cell import Cell
    from taskcal.correction.correction import Correction
    from taskcal.programs.program import Frame

SHOWN = 12
"""Targets of the table; the JSON result and the page have all of them."""


def command(
    programs: Annotated[
        list[Path],
        typer.Argument(metavar="PROGRAM [MORE …]", readable=False, help="Its files: RAPID, KRL, APT or CSV."),
    ],
    calibration: Annotated[
        Path,
        typer.Option(
            "--calibration", "-c", metavar="CAL.json", readable=False, help="Calibration written by taskcal identify."
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="OUT",
            readable=False,
            help="File to write, or folder: the corrected files keep their names in it. A file of another language (.mod, .src, "
            ".csv) is written afresh.",
        ),
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Show the table, write no program.")] = False,
    cell: Annotated[
        Path | None,
        typer.Option(
            "--cell",
            metavar="CELL.toml",
            readable=False,
            help="What was measured of tools and parts; by default all are where the controller has them.",
        ),
    ] = None,
    tool: Annotated[
        str | None,
        typer.Option("--tool", metavar="NAME", help="Tool of the cell file, for APT and CSV, which name none."),
    ] = None,
    part: Annotated[
        str | None,
        typer.Option("--part", metavar="NAME", help="Part of the cell file, for APT and CSV, which name none."),
    ] = None,
    tolerance_mm: Annotated[
        float, typer.Option("--tolerance-mm", metavar="MM", help="The true tool keeps to lines and arcs within this.")
    ] = 0.02,
    max_shift_mm: Annotated[
        float, typer.Option("--max-shift-mm", metavar="MM", help="No target is moved farther.")
    ] = 5.0,
    max_turn_deg: Annotated[
        float, typer.Option("--max-turn-deg", metavar="DEG", help="No target is turned farther.")
    ] = 1.0,
    max_joint_deg: Annotated[
        float, typer.Option("--max-joint-deg", metavar="DEG", help="No joint is moved farther at a target.")
    ] = 5.0,
    keep_joints: Annotated[
        bool,
        typer.Option(
            "--keep-joints", help="Leave motions to joint positions as they are, such as those to a home position."
        ),
    ] = False,
    accept_uncertain: Annotated[
        bool,
        typer.Option(
            "--accept-uncertain", help="Write the program even where the uncertainty is larger than the correction."
        ),
    ] = False,
    report: ReportOption = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Correct a robot program, so that the true tool goes where the program says.

    Every target becomes the pose that makes the controller, which takes its robot for nominal, drive the joints that the
    robot as calibrated needs; lines and arcs get more targets where they need them. Whatever else the files say stays,
    byte for byte. Targets that are refused stay too, are named by file and line with the reason, and make the exit status 1.
    Motions that the text does not tell, such as those to computed targets, stay and are named.

    Where the uncertainty is larger than the correction nothing is written, unless asked for with --accept-uncertain;
    the message says what to measure.
    """
    for option, value in (
        ("--tolerance-mm", tolerance_mm), ("--max-shift-mm", max_shift_mm), ("--max-turn-deg", max_turn_deg),
        ("--max-joint-deg", max_joint_deg),
    ):  # fmt: skip
        if not 0 < value < float("inf"):
            raise typer.BadParameter(f"{value:g} is not above zero", param_hint=option)
    if output is None and not dry_run:
        raise typer.BadParameter("name the file or folder to write, or ask for --dry-run", param_hint="--output")
    for name, option in ((tool, "--tool"), (part, "--part")):
        if name is not None and cell is None:
            raise typer.BadParameter(f"'{name}' is a name of the cell file; give that with --cell", param_hint=option)
    inputs = [path for path in (calibration, cell, *programs) if path is not None]
    targets = [] if output is None or dry_run else _targets(programs, output)
    named = [("--report", report), *(("--output", path) for path in targets)]
    outputs = check_outputs("correct", named, inputs, force=force)
    import numpy as np

    from taskcal.correction.cell import Cell
    from taskcal.correction.cell_file import load_cell
    from taskcal.correction.correct import correct
    from taskcal.correction.correction import Bounds
    from taskcal.identification.calibration_file import load_calibration
    from taskcal.presentation.correction_tables import state_uncertain
    from taskcal.programs.reading import read_program

    known = load_calibration(calibration)
    around = Cell() if cell is None else load_cell(cell)
    program = read_program(
        *programs,
        robot=known.model.robot,
        tool=_frame(around, tool, "tool"),
        part=_frame(around, part, "part"),
    )
    announce_compilation()
    bounds = Bounds(
        tolerance=tolerance_mm * 1e-3,
        shift=max_shift_mm * 1e-3,
        turn=float(np.radians(max_turn_deg)),
        joint=float(np.radians(max_joint_deg)),
    )
    with working("reading the program") as say:
        found = correct(
            known,
            program,
            cell=around,
            bounds=bounds,
            into=_afresh(programs[0], output),
            keep_joints=keep_joints,
            progress=say,
        )
    contents: dict[Path, str | bytes] = {}
    withheld = found.uncertain and not accept_uncertain and not dry_run
    if output is not None and not dry_run and not withheld:
        contents.update(found.contents(output))
    written = tuple(contents)
    if report is not None:
        from taskcal.identification.provenance import package_version
        from taskcal.presentation.correction_report import correction_html

        contents[report] = correction_html(found, known, version=package_version())
    outputs.write(contents)
    if as_json:
        write_json(_as_json(found, written, report))
    else:
        _show(found, written, report)
    if found.uncertain:
        note(f"{'error: not written: ' if withheld else ''}{state_uncertain(found)}")
        if withheld:
            note("--accept-uncertain writes the program all the same")
    if withheld or found.rejected or any(diagnostic.rejected for diagnostic in found.diagnostics):
        raise typer.Exit(1)


def _targets(programs: list[Path], output: Path) -> list[Path]:
    """Files that the corrected program goes to: the one named, or those of the same names in a folder."""
    return list(dict.fromkeys(output / path.name for path in programs)) if output.is_dir() else [output]


def _afresh(program: Path, output: Path | None) -> Path | None:
    """The file to write afresh, where it is named in another language than the program's."""
    from taskcal.programs.languages import LANGUAGES, language_of

    known = {suffix for language in LANGUAGES for suffix in language.suffixes}
    if output is None or output.is_dir() or output.suffix.lower() not in known:
        return None
    return None if language_of(output) == language_of(program) else output


def _frame(cell: "Cell", name: str | None, kind: str) -> "Frame | None":
    """The controller's value of a tool or part of the cell file.

    Raises:
        TaskcalError: the file does not have it, or not the controller's value.
    """
    if name is None:
        return None
    from taskcal.errors import TaskcalError, UnknownName
    from taskcal.programs.program import Frame

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


def _as_json(found: "Correction", written: tuple[Path, ...], report: Path | None) -> dict[str, Any]:
    program = found.program
    return {
        "program": [source.path for source in program.sources],
        "written": list(written),
        "report": report,
        **found.summary(),
        "targets": found.targets(),
        "refused": [
            {"file": program.moves[i].place.path, "line": program.moves[i].place.line, "reason": reason}
            for i, reason in sorted(found.rejected.items())
        ],
        "remarks": [
            {"file": diagnostic.place.path, "line": diagnostic.place.line, "text": diagnostic.text}
            for diagnostic in found.diagnostics
        ],
    }


def _show(found: "Correction", written: tuple[Path, ...], report: Path | None) -> None:
    from taskcal.presentation.correction_tables import (
        state_expected,
        tabulate_correction,
        tabulate_errors,
        tabulate_targets,
    )

    show_facts(state_expected(found))
    for table in (tabulate_errors(found), tabulate_targets(found, SHOWN)):
        show_table(table.title, table.header, table.groups[0][1], left=table.text_columns)
        if table.note:
            note_text = table.note
            tell(f"{note_text}\n")
    show_facts(tabulate_correction(found))
    problems = [f"{found.program.moves[i].place}: left as it was: {why}" for i, why in sorted(found.rejected.items())]
    problems += [str(diagnostic) for diagnostic in found.diagnostics]
    for problem in problems:
        note(problem)
    for path in written:
        note(f"written: {path}")
    if report is not None:
        note(f"written: {report}")
