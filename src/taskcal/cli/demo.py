"""The published procedure on a virtual robot: tables here, a page with figures, and files to go on with."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskcal.cli.options import JsonOption, SeedOption
from taskcal.cli.output import started_as

if TYPE_CHECKING:
    from taskcal.demo.procedure import Procedure
    from taskcal.demo.tool_point_errors import Errors
    from taskcal.robot.robot import Robot

HELD_OUT = 400

Output = Annotated[
    Path, typer.Option("--output", "-o", metavar="FOLDER", help="Folder of the results; made if absent.")
]
Full = Annotated[
    bool,
    typer.Option(
        "--full",
        help="Go on to a corrected milling program: plan, measure, identify and correct virtual robots (some minutes).",
    ),
]
Robots = Annotated[
    int, typer.Option("--robots", min=1, metavar="N", help="Virtual robots of the closed loop, with --full.")
]
Count = Annotated[int, typer.Option("--count", "-n", min=10, help="Measured poses of each campaign.")]


def demo(
    output: Output = Path("taskcal-demo"),
    count: Count = 60,
    seed: SeedOption = 0,
    full: Full = False,
    robots: Robots = 20,
    as_json: JsonOption = False,
) -> None:
    """Run the published procedure on a virtual robot.

    Mechanism, complete model, sensitivity, elimination, identification,
    and errors on new poses; in one tool orientation and in several.
    Needs no file. Leaves a page with figures, and its data, in a folder.

    With --full, the loop is closed on virtual robots: planned measurements,
    effects beside the geometry, a milling program corrected, and the way of
    the true cutter before and after.
    """
    from taskcal.cli.output import announce_compilation, console, working, write_json
    from taskcal.demo.procedure import run_procedure
    from taskcal.demo.procedure_report import procedure_html
    from taskcal.demo.reference_task import ROBOT
    from taskcal.errors import FileError
    from taskcal.files import write_whole
    from taskcal.identification.calibration import package_version
    from taskcal.robot.catalogue import load_robot
    from taskcal.robot.error_model import ErrorModel

    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        message = f"no folder can be made here: {error.strerror or error}; name another with --output"
        raise FileError(output, message) from error
    announce_compilation()
    with working("starting") as say:
        model = ErrorModel(load_robot(ROBOT))
        procedure = run_procedure(model, count=count, seed=seed, held_out=HELD_OUT, progress=say)
        say("figures and page")
        page = output / "report.html"
        files = _write_data(procedure, output)
        commands = _next_steps(output, files)
        html = procedure_html(procedure, next_steps=commands, version=package_version())
        write_whole(page, html)
    files = {"page": page, **files}
    out = console()
    if not as_json:
        _show(out, procedure)
        out.print(f"The page with all tables and figures: {page}", soft_wrap=True)
        out.print("\nGo on:\n" + commands, soft_wrap=True)
    closed = _close_the_loop(model.robot, robots, seed, output, files, None if as_json else out) if full else {}
    if as_json:
        write_json({**_as_json(procedure, files), **closed})


def _close_the_loop(
    robot: "Robot", count: int, seed: int, folder: Path, files: dict[str, Path], out: Any
) -> dict[str, Any]:
    """Send virtual robots round, write what comes of it, and print it where there is an `out`."""
    from taskcal.cli.output import working
    from taskcal.cli.round_trip import run_round_trips, show_round_trips, summarise_round_trips, write_round_trips

    with working("the closed loop") as say:
        shop, trips = run_round_trips(robot, count, seed, say)
        files |= write_round_trips(shop, trips, folder)
    if out is not None:
        out.print()
        show_round_trips(out, trips, files)
    return {"closed_loop": summarise_round_trips(trips)}


def _write_data(procedure: "Procedure", folder: Path) -> dict[str, Path]:
    """Campaigns, and the calibrations of the whole model."""
    from taskcal.demo.procedure import ONE, SEVERAL
    from taskcal.measurement.writer import write_campaign

    names = {ONE: "one-orientation", SEVERAL: "several-orientations"}
    files: dict[str, Path] = {}
    for label, campaign in procedure.campaigns.items():
        files[f"campaign {label}"] = folder / f"campaign-{names[label]}.csv"
        write_campaign(files[f"campaign {label}"], campaign, procedure.model.robot)
    for fit in procedure.fits:
        if fit.parameters == len(procedure.model):
            files[f"calibration {fit.campaign}"] = folder / f"calibration-{names[fit.campaign]}.json"
            fit.calibration.save(files[f"calibration {fit.campaign}"])
    return files


def _next_steps(folder: Path, files: dict[str, Path]) -> str:
    from taskcal.demo.procedure import ONE, SEVERAL
    from taskcal.demo.reference_task import ROBOT

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
    from taskcal.presentation.terminal import print_tables

    robot = procedure.model.robot
    out.print(Text(f"The published procedure on a virtual {robot.title or robot.name}", style="bold"))
    explanation = procedure.mechanism.explanation
    out.print(Text(f"{explanation[0].upper()}{explanation[1:]}.\n"))
    print_tables(
        out,
        (
            tables.tabulate_model(procedure.model),
            tables.tabulate_influences(procedure, 10),
            tables.tabulate_counts(procedure),
            tables.tabulate_relations(procedure),
            tables.tabulate_residuals(procedure),
            tables.tabulate_held_out(procedure),
        ),
    )
    out.print(Text("In short", style="bold"))
    for point in summary_points(procedure):
        out.print(Text(f"- {point}"))
    out.print()


def _as_json(procedure: "Procedure", files: dict[str, Path]) -> dict[str, Any]:
    mechanism, elimination = procedure.mechanism, procedure.elimination
    scaled = {label: found.maximum(scaled=True) * 1e6 for label, found in procedure.sensitivities.items()}
    covered = {(p.campaign, p.model, p.where): p.share_inside(0.95) for p in procedure.predictions}
    return {
        "robot": procedure.model.robot.name,
        "seed": procedure.seed,
        "poses": {label: len(campaign) for label, campaign in procedure.campaigns.items()},
        "mechanism": {
            "motorised": mechanism.motorised,
            "passive": mechanism.passive,
            "mobility": mechanism.mobility,
            "overconstraint": mechanism.overconstraint,
        },
        "parameters": [
            {
                "name": row.name,
                "symbol": row.symbol,
                "published": row.published,
                "repeats": row.repeats,
                "eliminated": row.eliminated,
                "largest_influence_um": {label: values[:, i] for label, values in scaled.items()},
            }
            for i, row in enumerate(elimination.rows)
        ],
        "elimination": {
            label: {
                "rank": found.rank,
                "kept": found.kept,
                "zero": found.zero,
                "dependent": found.dependent,
                "condition_number": found.condition_number,
            }
            for label, found in elimination.eliminations.items()
        },
        "fits": [
            {
                "campaign": fit.campaign,
                "model": fit.model,
                "parameters": fit.parameters,
                "residual": _errors(fit.residual),
                "inside": _errors(fit.inside),
                "outside": _errors(fit.outside),
                "inside_95": covered[fit.campaign, fit.model, "same orientations"],
                "outside_95": covered[fit.campaign, fit.model, "turned farther"],
            }
            for fit in procedure.fits
        ],
        "files": files,
    }


def _errors(errors: "Errors") -> dict[str, float]:
    x, y, z = (value * 1e3 for value in errors.per_axis)
    return {
        "mean_mm": errors.mean * 1e3,
        "max_mm": errors.maximum * 1e3,
        "max_x_mm": x,
        "max_y_mm": y,
        "max_z_mm": z,
    }
