"""Options that several commands share, and the lists written in them."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from taskcal.errors import FileError

# A first look at files that a command is to read, before the libraries that read them are imported: wrong ones end
# here.

LARGEST = 100_000
"""Bytes of a calibration up to which it is parsed whole here; a real one that is larger begins as it should."""


def look_at(path: Path | None) -> Path | None:
    """The path of a file that is there.

    Raises:
        FileError: there is nothing there, or nothing that may be looked at.
    """
    if path is not None:
        try:
            os.stat(path)
        except OSError as error:
            raise FileError(path, f"cannot be read: {error.strerror or error}") from error
        except ValueError:
            pass  # a NUL character: its reader names it
    return path


def look_at_calibration(path: Path) -> Path:
    """The path of a file that may be a calibration.

    Raises:
        FileError: there is none, or it is something else.
    """
    from taskcal.identification.calibration_format import read_envelope

    look_at(path)
    if not path.is_file():
        return path
    with path.open("rb") as stream:
        begins = stream.read(200).lstrip()[:1]
    if begins != b"{" or path.stat().st_size < LARGEST:
        read_envelope(path)
    return path


def look_at_calibrations(paths: list[Path]) -> list[Path]:
    """The paths of files that may be calibrations.

    Raises:
        FileError: one is not there, or something else.
    """
    return [look_at_calibration(path) for path in paths]


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


# Options of commands that compute many things side by side.

ENGINES = ("loky", "threading", "sequential", "dask")

ADDRESSED = "dask:"
"""Begins an engine with its scheduler's address in one word, as Python has it."""


@dataclass(frozen=True, kw_only=True)
class EngineOptions:
    """Where many things are computed side by side.

    Raises:
        typer.BadParameter: there is no such engine, or a scheduler is lacking or has no use.
    """

    engine: Annotated[
        str,
        typer.Option(
            "--engine",
            metavar="ENGINE",
            help="loky (processes on this machine), threading, sequential, or dask (a cluster, see --scheduler).",
        ),
    ] = "loky"
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="ADDRESS", help="Scheduler of the Dask cluster, such as tcp://HOST:8786."),
    ] = None
    workers: Annotated[
        int | None, typer.Option("--workers", min=1, metavar="N", help="Parallel workers; by default one per core.")
    ] = None

    @property
    def engine_name(self) -> str:
        """The engine, with its scheduler."""
        return self.engine if self.scheduler is None else f"{ADDRESSED}{self.scheduler}"

    @property
    def most_workers(self) -> int:
        """How many, −1 for one per core."""
        return -1 if self.workers is None else self.workers

    def __post_init__(self) -> None:
        if self.engine not in ENGINES and not self.engine.startswith(ADDRESSED):
            raise typer.BadParameter(
                f"'{self.engine}' is not an engine; choose {', '.join(ENGINES[:-1])}, or dask with --scheduler ADDRESS",
                param_hint="--engine",
            )
        if self.engine == "dask" and not self.scheduler:
            raise typer.BadParameter(
                "which cluster? Name the address that 'dask scheduler' prints, such as tcp://HOST:8786",
                param_hint="--engine dask / --scheduler",
            )
        if self.engine != "dask" and self.scheduler is not None:
            raise typer.BadParameter(f"only --engine dask has one, not {self.engine}", param_hint="--scheduler")
