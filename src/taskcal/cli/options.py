"""Options that several commands share, and the lists written in them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from taskcal.cli.first_look import look_at, look_at_calibration

RobotOption = Annotated[
    str,
    typer.Option(
        "--robot",
        "-r",
        metavar="ROBOT",
        help="Name in the catalogue, or a file: .toml, .urdf (or .urdf#TIP), .xacro.",
    ),
]
TaskOption = Annotated[
    Path, typer.Option("--task", "-t", metavar="TASK.toml", readable=False, callback=look_at, help="Task file.")
]
CampaignArgument = Annotated[
    Path,
    typer.Argument(
        metavar="CAMPAIGN.csv",
        readable=False,
        callback=look_at,
        help="Measurements: joint positions and measured target positions.",
    ),
]
CalibrationArgument = Annotated[
    Path,
    typer.Argument(
        metavar="CAL.json",
        readable=False,
        callback=look_at_calibration,
        help="Calibration written by taskcal identify.",
    ),
]
CountOption = Annotated[
    int, typer.Option("--count", "-n", min=1, metavar="N", help="Number of poses spread over the task's workspace.")
]
SeedOption = Annotated[int, typer.Option("--seed", min=0, metavar="N", help="Seed of the random number generator.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as JSON, alone on standard output.")]
ForceOption = Annotated[
    bool, typer.Option("--force", help="Replace files that this command did not write, or that were edited since.")
]
ModelErrorOption = Annotated[
    float | None,
    typer.Option(
        "--model-error-mm",
        metavar="MM",
        help="What geometry cannot explain (1σ per axis, 0 for nothing); by default as the robot's file states it, or a typical "
        "robot's.",
    ),
]


@dataclass(frozen=True, kw_only=True)
class OutputOptions:
    """How a command gives its result."""

    force: ForceOption = False
    as_json: JsonOption = False


@dataclass(frozen=True, kw_only=True)
class SpreadOptions:
    """How many poses are spread over a task, and how they are drawn."""

    count: CountOption = 60
    seed: SeedOption = 0


def check_model_error(millimetres: float | None) -> float | None:
    """The model error that was stated, metres.

    Raises:
        typer.BadParameter: it is negative or not finite.
    """
    if millimetres is None:
        return None
    if not 0 <= millimetres < float("inf"):
        raise typer.BadParameter(f"{millimetres:g} is not zero or above", param_hint="--model-error-mm")
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


def check_above_zero(value: float | None, option: str) -> None:
    """See that a number that was given is above zero.

    Raises:
        typer.BadParameter: it is not; a number that is not finite is not either.
    """
    if value is not None and not 0 < value < float("inf"):
        raise typer.BadParameter(f"{value:g} is not above zero", param_hint=option)


def check_within(value: float | None, least: float, most: float, option: str) -> None:
    """See that a number that was given is within its bounds.

    Raises:
        typer.BadParameter: it is not; a number that is not finite is not either.
    """
    if value is not None and not least <= value <= most:
        raise typer.BadParameter(f"{value:g} is not between {least:g} and {most:g}", param_hint=option)
