"""The published procedure on a virtual robot: tables here, a page with figures, and files to go on with."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskcal.cli.options.common import ForceOption, JsonOption, SeedOption
from taskcal.cli.output import started_as
from taskcal.cli.outputs import Outputs, check_outputs

if TYPE_CHECKING:
    from taskcal.demo.procedure import Procedure
    from taskcal.robot.robot import Robot

HELD_OUT = 400

FITS = 14
"""Identifications of the procedure: seven models in each of two sets of orientations."""

KEPT = "robots"
"""Folder, in that of the results, of the calibrations of the closed loop's robots: an interrupted run goes on with them."""

Output = Annotated[
    Path, typer.Option("--output", "-o", metavar="FOLDER", help="Folder of the results; made if absent.")
]
Full = Annotated[
    bool,
    typer.Option(
        "--full",
        help="Go on to a corrected milling program: plan, measure, identify and correct virtual robots (half a minute each).",
    ),
]
Robots = Annotated[
    int, typer.Option("--robots", min=1, metavar="N", help="Virtual robots of the closed loop, with --full.")
]
Count = Annotated[int, typer.Option("--count", "-n", min=10, help="Measured poses of each campaign.")]


def command(
    output: Output = Path("taskcal-demo"),
    count: Count = 60,
    seed: SeedOption = 0,
    full: Full = False,
    robots: Robots = 20,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Run the published procedure on a virtual robot.

    Mechanism, complete model, sensitivity, elimination, identification,
    and errors on new poses; in one tool orientation and in several.
    Needs no file. Leaves a page with figures, and its data, in a folder.

    With --full, the loop is closed on virtual robots that no model of the
    fit describes: planned measurements, the effects that they prove, a milling
    program corrected, and the way of the true cutter as programmed, with the
    parts touched off, and corrected. --robots N runs fewer of them. What is
    identified of each is kept in the folder robots: interrupted, the same
    command with --force goes on where it was.
    """
    from taskcal.cli.output import console, working, write_json
    from taskcal.demo.procedure import ROBOT, run_procedure
    from taskcal.demo.procedure_files import procedure_contents, procedure_json
    from taskcal.demo.procedure_report import procedure_html
    from taskcal.errors import FileError
    from taskcal.identification.provenance import package_version
    from taskcal.robot.catalogue import load_robot
    from taskcal.robot.error_model import ErrorModel

    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        message = f"no folder can be made here: {error.strerror or error}; name another with --output"
        raise FileError(output, message) from error
    outputs = _outputs(output, full, force)
    with working("starting", steps=5 + FITS) as say:
        model = ErrorModel(load_robot(ROBOT))
        procedure = run_procedure(model, count=count, seed=seed, held_out=HELD_OUT, progress=say)
        say("figures and page")
        page = output / "report.html"
        files, contents = procedure_contents(procedure, output)
        commands = _next_steps(output, files)
        contents[page] = procedure_html(procedure, next_steps=commands, version=package_version())
        outputs.write(contents)
    files = {"page": page, **files}
    out = console()
    if not as_json:
        _show(out, procedure)
        out.print(f"The page with all tables and figures: {page}", soft_wrap=True)
        out.print("\nGo on:\n" + commands, soft_wrap=True)
    closed: dict[str, Any] = {}
    if full:
        more, closed["closed_loop"] = _close_the_loop(
            model.robot, robots, seed, output, outputs, None if as_json else out
        )
        files |= more
    if as_json:
        write_json({**procedure_json(procedure), "files": files, **closed})


def _outputs(folder: Path, full: bool, force: bool) -> Outputs:
    """The files of the demonstration, seen to be free."""
    from taskcal.demo.closed_loop_report import closed_loop_files
    from taskcal.demo.procedure_files import procedure_names

    paths = [folder / name for name in ("report.html", *procedure_names())]
    paths += closed_loop_files(folder).values() if full else []
    return check_outputs("demo", [("--output", path) for path in paths], force=force)


def _close_the_loop(
    robot: "Robot", count: int, seed: int, folder: Path, outputs: Outputs, out: Any
) -> tuple[dict[str, Path], Any]:
    """Run virtual robots, write what comes of it, and print it where there is an `out`."""
    from taskcal.cli.output import working
    from taskcal.demo.closed_loop import prepare_closed_loop, run_closed_loops, summarise_runs
    from taskcal.demo.closed_loop_report import closed_loop_contents, closed_loop_files, tabulate_closed_loop
    from taskcal.report.content import print_tables

    files = closed_loop_files(folder)
    command = (
        f"  {started_as()} correct --calibration {files['calibration for milling']} --cell {files['cell']} "
        f"{files['touched-off program']} --dry-run"
    )
    with working("the closed loop", steps=7 + count) as say:
        loop = prepare_closed_loop(robot, seed=seed, progress=say)
        runs = run_closed_loops(loop, range(seed, seed + count), say, fits=folder / KEPT)
        outputs.write(closed_loop_contents(loop, runs, files, next_steps=command))
    if out is not None:
        out.print()
        print_tables(out, (replace(tabulate_closed_loop(runs), note=""),))
        out.print(f"The page of the closed loop: {files['page of the closed loop']}", soft_wrap=True)
        out.print("\nGo on:\n" + command, soft_wrap=True)
    return files, summarise_runs(runs)


def _next_steps(folder: Path, files: dict[str, Path]) -> str:
    from taskcal.demo.procedure import ONE, ROBOT, SEVERAL

    one, several = files[f"campaign {ONE}"], files[f"campaign {SEVERAL}"]
    taskcal = started_as()
    return "\n".join(
        (
            "  # the demonstration's own measurements, 30 % of them kept aside to check",
            f"  {taskcal} identify --robot {ROBOT} {several} -o {folder / 'cal.json'} --holdout 0.3",
            f"  {taskcal} validate {folder / 'cal.json'} {one}",
            "  # your robot: one of the catalogue, or a table of its dimensions; joints and tracker points as CSV",
            f"  {taskcal} robots",
            f"  {taskcal} identify --robot ROBOT CAMPAIGN.csv -o CAL.json --holdout 0.3",
        )
    )


def _show(out: Any, procedure: "Procedure") -> None:
    from rich.text import Text

    from taskcal.demo import procedure_tables as tables
    from taskcal.demo.procedure_report import summary_points
    from taskcal.report.content import print_tables

    robot = procedure.model.robot
    out.print(Text(f"The published procedure on a virtual {robot.title or robot.name}", style="bold"))
    explanation = procedure.mechanism.explanation
    out.print(Text(f"{explanation[0].upper()}{explanation[1:]}.\n"))
    print_tables(out, tables.overview(procedure))
    out.print(Text("In short", style="bold"))
    for point in summary_points(procedure):
        out.print(Text(f"- {point}"))
    out.print()
