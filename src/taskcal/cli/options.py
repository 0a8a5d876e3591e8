"""Options that several commands share, and the lists written in them."""

from pathlib import Path
from typing import Annotated

import typer

RobotOption = Annotated[
    str, typer.Option("--robot", "-r", metavar="ROBOT", help="Name in the catalogue, or a file (.toml, .urdf, .xacro).")
]
OptionalRobotOption = Annotated[
    str | None,
    typer.Option("--robot", "-r", metavar="ROBOT", help="Name in the catalogue, or a file (.toml, .urdf, .xacro)."),
]
CalibrationOption = Annotated[
    Path | None,
    typer.Option(
        "--calibration",
        "-c",
        metavar="CAL.json",
        readable=False,
        help="Instead of --robot: a calibration, with its effects and with what it knows.",
    ),
]
TaskOption = Annotated[Path, typer.Option("--task", "-t", metavar="TASK.toml", readable=False, help="Task file.")]
CountOption = Annotated[
    int, typer.Option("--count", "-n", min=1, metavar="N", help="Poses to spread over the task's workspace.")
]
SeedOption = Annotated[int, typer.Option("--seed", min=0, metavar="N", help="Seed of everything random.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as JSON, alone on standard output.")]
ReportOption = Annotated[
    Path | None,
    typer.Option("--report", metavar="REPORT.html", readable=False, help="Write a page with figures here."),
]
ModelErrorOption = Annotated[
    float | None,
    typer.Option(
        "--model-error",
        metavar="MM",
        help="What geometry cannot explain (1σ per axis, 0 for nothing); by default as the robot's file states it, or a typical "
        "robot's.",
    ),
]
ForceOption = Annotated[
    bool, typer.Option("--force", help="Replace files that this command did not write, or that were edited since.")
]
TargetsOption = Annotated[
    str | None,
    typer.Option("--targets", metavar="NAME,…", help="Targets to use; all that are not reference points by default."),
]
ReferencePointsOption = Annotated[
    str | None,
    typer.Option(
        "--points",
        metavar="NAME,…",
        help="Fixed points beside the robot; names beginning with 'base' by default.",
    ),
]
RowsOption = Annotated[
    str | None,
    typer.Option(
        "--rows",
        metavar="A:B|FILE",
        help="Rows to use, counted from 0: A:B without B, or a file with one number per line.",
    ),
]


def check_source(robot: str | None, calibration: Path | None) -> None:
    """See that either a robot is named or a calibration.

    Raises:
        typer.BadParameter: both or none.
    """
    if (robot is None) == (calibration is None):
        said = "give one of them" if robot is None else "give one of them: a calibration contains its robot"
        raise typer.BadParameter(said, param_hint="--robot / --calibration")


def check_model_error(millimetres: float | None) -> float | None:
    """The model error that was stated, metres.

    Raises:
        typer.BadParameter: it is negative or not finite.
    """
    if millimetres is None:
        return None
    if not 0 <= millimetres < float("inf"):
        raise typer.BadParameter(f"{millimetres:g} is not zero or above", param_hint="--model-error")
    return millimetres * 1e-3


def split_names(text: str | None, option: str) -> list[str] | None:
    """Names from a list with commas; None where the option is not given.

    Raises:
        typer.BadParameter: a name is empty or stands twice.
    """
    if text is None:
        return None
    names = [name.strip() for name in text.split(",")]
    if not all(names):
        raise typer.BadParameter(
            f"'{text}' has an empty name; write names with single commas between them", param_hint=option
        )
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise typer.BadParameter(f"'{twice[0]}' stands twice", param_hint=option)
    return names


def check_within(value: float | None, least: float, most: float, option: str) -> None:
    """See that a number that was given is within its bounds.

    Raises:
        typer.BadParameter: it is not; a number that is not finite is not either.
    """
    if value is not None and not least <= value <= most:
        raise typer.BadParameter(f"{value:g} is not between {least:g} and {most:g}", param_hint=option)
