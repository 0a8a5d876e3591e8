"""``taskcal demo``: the published procedure on a simulated robot; tables here, a page with figures, and files to go on with."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import taskcal
from taskcal.cli.command import option, output_option
from taskcal.cli.output import say, show, started_as, tell, write_json
from taskcal.cli.progress import bar_over
from taskcal.cli.run import OutputOptions, Run
from taskcal_groundwork.options import Seed

if TYPE_CHECKING:
    from taskcal_demo.procedure import Procedure

HELD_OUT = 400

FITS = 14
"""Identifications of the procedure: seven models in each of two sets of orientations."""

ROBOTS = "robots"
"""Folder, in that of the results, of the calibrations of the closed loop's robots: an interrupted run goes on with them."""


def command(
    *,
    run: Run,
    output: Path = output_option(
        Path("taskcal-demo"), "FOLDER", "Folder of the results; made if absent.", writes="later"
    ),
    count: int = option(60, also="-n", help="Measured poses of each campaign.", low=10),
    seed: Seed = 0,
    full: bool = option(
        False,
        help="Continue to a corrected milling program: measure, identify and correct simulated robots (half a minute each).",
    ),
    robots: int = option(20, "N", "Virtual robots of the closed loop, with --full.", low=1),
    unkind: bool = option(
        False,
        help="With --full, repeat the closed loop with two truths that keep less to what is assumed; takes three times as long.",
    ),
    out: OutputOptions,
) -> None:
    """Run the published procedure on a simulated robot.

    Mechanism, complete model, sensitivity, elimination, identification, and errors at new poses; in one tool orientation and in
    several. Needs no file. Writes a page with figures, and its data, to a folder.

    With --full, the loop is closed on simulated robots that no model of the fit describes: planned measurements, significant
    effects, a corrected milling program, and the path of the true cutter as programmed, with the parts touched off, and
    corrected. The calibrations are kept in the folder robots: after an interruption the same command with --force goes on.
    With --unkind the same robots run twice more, with axes that wobble as no effect describes, and with everything twice as
    large; the page compares what was stated of each with what was true.
    """
    from taskcal.errors import FileError
    from taskcal_demo.closed_loop_report import closed_loop_files
    from taskcal_demo.procedure_report import procedure_contents, procedure_files, procedure_json, procedure_page

    if unkind and not full:
        raise typer.BadParameter("repeats the closed loop; add --full", param_hint="--unkind")
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        message = f"cannot make this folder: {error.strerror or error}; name another with --output"
        raise FileError(output, message) from error
    files = {"page": output / "report.html", **procedure_files(output)}
    paths = [*files.values(), *(closed_loop_files(output).values() if full else ())]
    run.free("--output", *paths)
    with bar_over(["starting"], 5 + FITS) as begin:
        model = taskcal.ErrorModel(taskcal.load_robot(taskcal.demo.ROBOT))
        procedure = taskcal.demo.run_procedure(model, count=count, seed=seed, held_out=HELD_OUT, progress=begin)
        begin("figures and page")
        commands = _next_steps(output, files)
        contents = {
            "page": procedure_page(procedure, next_steps=commands).html(),
            **procedure_contents(procedure),
        }
        run.write({files[name]: content for name, content in contents.items()})
    if not out.as_json:
        _show(procedure)
        tell(f"The page with all tables and figures: {files['page']}")
        print(f"\nContinue with:\n{commands}")
    closed: dict[str, Any] = {}
    if full:
        more, closed = _close_the_loop(
            model.robot, range(seed, seed + robots), output, run, quiet=out.as_json, unkind=unkind
        )
        files |= more
    if out.as_json:
        write_json({**procedure_json(procedure), "files": files, **closed})


def _close_the_loop(
    robot: "taskcal.Robot", seeds: range, folder: Path, run: Run, *, quiet: bool, unkind: bool
) -> tuple[dict[str, Path], dict[str, Any]]:
    """Run simulated robots, write the results, and print them unless they are printed as JSON."""
    from taskcal_demo.closed_loop_report import ASSUMED, closed_loop_contents, closed_loop_files, tabulate_unkind
    from taskcal_demo.true_robot import UNKIND

    files = closed_loop_files(folder)
    command = (
        f"  {started_as()} correct --calibration {files['calibration for milling']} --cell {files['cell']} "
        f"{files['touched-off program']} --dry-run"
    )
    truths = {ASSUMED: None, **(UNKIND if unkind else {})}
    with bar_over(["the closed loop"], 6 + len(truths) * (1 + len(seeds))) as begin:
        loop = taskcal.demo.prepare_closed_loop(robot, seed=seeds[0], progress=begin)
        cases = {
            name: taskcal.demo.run_closed_loops(loop, seeds, begin, sizes=sizes, fits=folder / ROBOTS)
            for name, sizes in truths.items()
        }
        runs = cases.pop(ASSUMED)
        contents = closed_loop_contents(loop, runs, unkind=cases, next_steps=command)
        run.write({files[name]: content for name, content in contents.items()})
    if not quiet:
        tell()
        show(replace(taskcal.demo.tabulate_closed_loop(runs), note=""))
        if cases:
            show(tabulate_unkind({ASSUMED: runs, **cases}))
        tell(f"The page of the closed loop: {files['page of the closed loop']}")
        print(f"\nContinue with:\n{command}")
    told = {name.replace(" ", "_"): taskcal.demo.summarise_runs(some) for name, some in cases.items()}
    return files, {
        "closed_loop": taskcal.demo.summarise_runs(runs),
        **({"closed_loop_unkind": told} if told else {}),
    }


def _next_steps(folder: Path, files: dict[str, Path]) -> str:
    from taskcal_demo.procedure import SEVERAL

    one, several = files[f"campaign {taskcal.demo.ONE}"], files[f"campaign {SEVERAL}"]
    program = started_as()
    return "\n".join(
        (
            "  # the demonstration's own measurements, 30 % of them held out",
            f"  {program} identify --robot {taskcal.demo.ROBOT} {several} -o {folder / 'cal.json'} --holdout 0.3",
            f"  {program} validate {folder / 'cal.json'} {one}",
            "  # your robot: one of the catalogue, or a table of its dimensions; joint values and tracker points as CSV",
            f"  {program} robots",
            f"  {program} identify --robot ROBOT CAMPAIGN.csv -o CAL.json --holdout 0.3",
        )
    )


def _show(procedure: "Procedure") -> None:
    from taskcal_demo.procedure_report import overview, summary_points

    robot = procedure.model.robot
    say(f"The published procedure on a simulated {robot.title or robot.name}")
    explanation = procedure.mechanism.explanation
    say(f"{explanation[0].upper()}{explanation[1:]}.")
    tell()
    for table in overview(procedure):
        show(table)
    say("Summary")
    for point in summary_points(procedure):
        say(f"- {point}")
    tell()
