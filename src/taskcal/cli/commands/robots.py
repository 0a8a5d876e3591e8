"""``taskcal robots``: the catalogue, one robot, and robots from files of other programs."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from taskcal.cli.command import Command
from taskcal.cli.option_groups import grouped, trusting
from taskcal.cli.options import JsonOption, OutputOptions
from taskcal.cli.output import info, show_table, tell, write_json
from taskcal.cli.outputs import check_outputs


class ShowByDefault(TyperGroup):
    """A group whose first argument, where it is not a command, is the robot to show."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Put ``show`` before a robot's name."""
        if args and args[0] not in self.commands and not args[0].startswith("-"):
            args = ["show", *args]
        return super().resolve_command(ctx, args)


class Convention(StrEnum):
    """Denavit–Hartenberg conventions."""

    dh = "dh"
    mdh = "mdh"


app = typer.Typer(
    cls=ShowByDefault,
    add_completion=False,
    rich_markup_mode=None,
    invoke_without_command=True,
    subcommand_metavar="[NAME_OR_FILE | COMMAND …]",
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback()
def catalogue(context: typer.Context, as_json: JsonOption = False) -> None:
    """List the catalogue, show one robot, or make a robot file from a file of another program.

    taskcal robots — the catalogue

    taskcal robots NAME_OR_FILE — one robot: joints, tool, mechanism, parameters

    taskcal robots import ROBOT.urdf -o ROBOT.toml — a robot of your own, from a URDF

    taskcal robots import TABLE.csv --convention dh -o ROBOT.toml — from a table
    """
    context.obj = as_json
    if context.invoked_subcommand is not None:
        return
    from taskcal.cli.robot_sheet import catalogue_entry
    from taskcal.robot.catalogue import catalogue_names, load_robot

    result = {"robots": [catalogue_entry(load_robot(name)) for name in catalogue_names()]}
    if as_json:
        write_json(result)
        return
    rows = [(r["name"], r["title"], str(r["joints"]), "; ".join(r["notes"])) for r in result["robots"]]
    show_table("Robots in the catalogue", ("name", "robot", "joints", "notes"), rows, left=(0, 1, 3))


@app.command("show", cls=Command)
@trusting
def show(
    context: typer.Context,
    robot: Annotated[
        str,
        typer.Argument(
            metavar="NAME_OR_FILE",
            help="Name in the catalogue, or a file: .toml, .urdf (or .urdf#TIP), .xacro.",
        ),
    ],
    as_json: JsonOption = False,
) -> None:
    """Show one robot (the word 'show' may be left out)."""
    from taskcal.cli.robot_sheet import describe, show_sheet
    from taskcal.robot.catalogue import load_robot

    result = describe(load_robot(robot))
    if as_json or context.obj:
        write_json(result)
    else:
        show_sheet(result)


@dataclass(frozen=True, kw_only=True)
class DescriptionOptions:
    """How another program's file is read."""

    convention: Annotated[
        Convention | None,
        typer.Option(
            "--convention",
            case_sensitive=False,
            help="Of a table. dh: Rz(θ)·Tz(d)·Tx(a)·Rx(α); mdh: Rx(α)·Tx(a)·Rz(θ)·Tz(d).",
        ),
    ] = None
    tip: Annotated[
        str | None,
        typer.Option(
            "--tip", metavar="LINK", help="Of a URDF: the link that is the tool; that of its longest chain by default."
        ),
    ] = None
    base: Annotated[
        str | None,
        typer.Option("--base", metavar="LINK", help="Of a URDF: the link that is the base; its root by default."),
    ] = None
    units: Annotated[
        str | None,
        typer.Option(
            "--units",
            metavar="UNITS",
            help="Units of a table whose columns do not state them: mm,deg or m,rad; otherwise inferred from the values.",
        ),
    ] = None
    nominal: Annotated[
        str | None,
        typer.Option(
            "--nominal", metavar="ROBOT", help="Of a UR's calibration.conf: the robot of its type, such as ur5e."
        ),
    ] = None
    name: Annotated[str | None, typer.Option("--name", help="Name of the robot; the file's by default.")] = None


@app.command("import", cls=Command)
@trusting
@grouped
def import_robot(
    context: typer.Context,
    source: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            readable=False,
            help="URDF (.urdf), xacro (.xacro), UR's kinematics (.yaml) or calibration.conf, or a table (.csv) with the columns "
            "joint, alpha_deg, a_mm, d_mm, theta_offset_deg; optionally theta_from_controller such as -(J2+J3), type, lower_deg "
            "and upper_deg.",
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="ROBOT.toml", readable=False, help="Robot file to write.")
    ],
    reading: DescriptionOptions,
    out: OutputOptions,
) -> None:
    """Make a robot file from a URDF, a Denavit–Hartenberg table or a UR's calibration."""
    if output.suffix != ".toml":
        raise typer.BadParameter(f"'{output}' does not end in .toml, as robot files do", param_hint="--output")
    outputs = check_outputs("robots import", [("--output", output)], [source], force=out.force)
    from taskcal.robot.catalogue import load_robot
    from taskcal.robot.description import describe_robot, robot_toml

    described = describe_robot(
        source,
        convention=None if reading.convention is None else reading.convention.value,
        tip=reading.tip,
        base=reading.base,
        name=reading.name,
        units=reading.units,
        nominal=None if reading.nominal is None else load_robot(reading.nominal),
    )
    outputs.write({output: robot_toml(described)})
    if out.as_json or context.obj:
        write_json({"robot": str(output), "name": described["name"], "joints": [j["name"] for j in described["joint"]]})
        return
    for line in described["source"][1:]:
        info(line)
    tell(f"wrote {output}: {described['name']}, {len(described['joint'])} joints")
    info(
        f"use it with --robot {output}; taskcal robots {output} shows it. Add limits, tool and tolerances to the file where "
        "they are known: the tolerances are the prior of every fit"
    )
