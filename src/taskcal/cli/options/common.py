"""Options that several commands share, what is checked of them, and the model and task that they name."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

import taskcal
from taskcal.cli.command import option
from taskcal.cli.output import info, warn_of_edits
from taskcal.errors import FileError
from taskcal.identification.options import read_effects
from taskcal.io.files import finish_writing
from taskcal_groundwork.options import Option, Seed
from taskcal_groundwork.said import Said

if TYPE_CHECKING:
    from collections.abc import Iterable


# A first look at files that a command is to read, before the libraries that read them are imported: wrong ones end
# here.

MAX_PARSED_BYTES = 100_000
"""Of a calibration up to which it is parsed whole here; a real one that is larger begins as it should."""


def look_at(path: Path | None) -> Path | None:
    """The path of a file that exists.

    Raises:
        FileError: there is nothing there, or nothing that may be looked at.
    """
    if path is not None:
        try:
            finish_writing(path.resolve().parent)
            os.stat(path)
        except OSError as error:
            raise FileError(path, f"cannot be read: {error.strerror or error}") from error
        except ValueError:
            pass  # a NUL character: its reader names it
    return path


def look_at_all(paths: list[Path]) -> list[Path]:
    """The paths of files that exist.

    Raises:
        FileError: one of them does not.
    """
    for path in paths:
        look_at(path)
    return paths


def look_at_calibration(path: Path) -> Path:
    """The path of a file that may be a calibration.

    Raises:
        FileError: there is none, or it is something else.
    """
    from taskcal.identification.calibration_format import CALIBRATION

    look_at(path)
    if not path.is_file():
        return path
    with path.open("rb") as stream:
        begins = stream.read(200).lstrip()[:1]
    if begins != b"{" or path.stat().st_size < MAX_PARSED_BYTES:
        CALIBRATION.look_at(path)
    return path


def read_calibration(path: Path, *, unsealed: bool) -> "taskcal.Calibration":
    """A calibration; where it was edited, every result and page of this run says so.

    Raises:
        FileError: as `taskcal.load_calibration`.
    """
    calibration = taskcal.load_calibration(path, unsealed=unsealed)
    warn_of_edits(calibration.edit_warning)
    return calibration


# Options of one value.

ROBOT = "Catalogue name, or file: .toml, .urdf (or .urdf#TIP), .xacro."


RobotOption = Annotated[str, Option(metavar="ROBOT", help=ROBOT, also="-r")]
TaskOption = Annotated[Path, Option(metavar="TASK.toml", help="Task file.", also="-t", more={"callback": look_at})]
CampaignArgument = Annotated[
    Path,
    Option(
        argument=True,
        metavar="CAMPAIGN.csv",
        help="Measurements: joint values and measured points or poses.",
        more={"callback": look_at},
    ),
]
CampaignsArgument = Annotated[
    list[Path],
    Option(
        argument=True,
        metavar="CAMPAIGN.csv…",
        help="Measurements: joint values and measured points or poses. Of several files each is a station of the tracker, unless a "
        "column 'station' names them.",
        more={"callback": look_at_all},
    ),
]
CalibrationArgument = Annotated[
    Path,
    Option(
        argument=True,
        metavar="CAL.json",
        help="Calibration written by taskcal identify.",
        more={"callback": look_at_calibration},
    ),
]
CalibrationOption = Annotated[
    Path,
    Option(
        metavar="CAL.json",
        help="Calibration written by taskcal identify.",
        also="-c",
        more={"callback": look_at_calibration},
    ),
]
CellOption = Annotated[
    Path | None,
    Option(metavar="CELL.toml", help="Measured frames of tools and parts; by default those of the controller."),
]
ConventionOption = Annotated[
    Literal["dh", "mdh"] | None,
    Option(
        help="Of a table. dh: Rz(θ)·Tz(d)·Tx(a)·Rx(α); mdh: Rx(α)·Tx(a)·Rz(θ)·Tz(d).", more={"case_sensitive": False}
    ),
]
AcceptUncertainOption = Annotated[
    bool,
    Option(
        help="Write the file even if the uncertainty exceeds three times the robot's tolerances, or a program's correction."
    ),
]
CountOption = Annotated[
    int,
    Option(metavar="N", help="Number of poses, distributed over the task's workspace.", also="-n", low=1),
]
UnsealedOption = Annotated[
    bool, Option(help="Read calibrations that were edited after they were identified; every result says so.")
]


def robot_option(help: str) -> Any:
    """Declare ``--robot`` where a robot need not be given."""
    return option(None, "ROBOT", help, also="-r")


def task_option(help: str, **declared: Any) -> Any:
    """Declare ``--task`` where a task need not be given, like `option`."""
    return option(None, "TASK.toml", help, also="-t", **declared)


def accuracy_option(help: str) -> Any:
    """Declare ``--accuracy-mm``, a required accuracy."""
    return option(None, "MM", help, low=0.0, ends=False)


def metres(millimetres: float | None) -> float | None:
    """A length that was stated, or None."""
    return None if millimetres is None else millimetres * 1e-3


def split_names(text: str | None, option: str) -> list[str] | None:
    """Names from a list with commas; None where the option is not given.

    Raises:
        typer.BadParameter: a name is empty or listed twice.
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
        raise typer.BadParameter(f"'{twice[0]}' is listed twice", param_hint=option)
    return names


def choose_names(text: str, option: str, offered: "Iterable[str]") -> list[str]:
    """Names from a list with commas, all among those offered.

    Raises:
        typer.BadParameter: one is not.
    """
    from taskcal.errors import UnknownName

    names, known = split_names(text, option) or [], list(offered)
    for name in names:
        if name not in known:
            raise typer.BadParameter(str(UnknownName(option.strip("-").rstrip("s"), name, known)), param_hint=option)
    return names


# Groups of options.


@dataclass(frozen=True, kw_only=True)
class SpreadOptions:
    """Number and seed of poses distributed over a task."""

    count: CountOption = 60
    seed: Seed = 0


@dataclass(frozen=True, kw_only=True)
class RobotOptions:
    """A robot, or a calibration.

    Raises:
        typer.BadParameter: neither, or both.
    """

    robot: str | None = robot_option(ROBOT)
    calibration: Path | None = option(
        None, "CAL.json", "Use this calibration, with its effects, instead of --robot.", also="-c"
    )
    unsealed: UnsealedOption = False

    def __post_init__(self) -> None:
        if (self.robot is None) == (self.calibration is None):
            both = "give one of them" if self.robot is None else "give one of them: a calibration contains its robot"
            raise typer.BadParameter(both, param_hint="--robot / --calibration")

    def load(self) -> "tuple[taskcal.ErrorModel, taskcal.Calibration | None]":
        """The model, and the calibration that it is of, where it is of one.

        Raises:
            FileError: the calibration cannot be read.
            TaskcalError: there is no such robot.
        """
        if self.calibration is not None:
            calibration = read_calibration(self.calibration, unsealed=self.unsealed)
            return calibration.model, calibration
        return taskcal.ErrorModel(taskcal.load_robot(self.robot or "")), None


@dataclass(frozen=True, kw_only=True)
class ModelOptions(RobotOptions):
    """A robot, with effects, or a calibration.

    Raises:
        typer.BadParameter: neither robot nor calibration, both, or effects beside a calibration.
    """

    effects: str | None = option(None, "LIST", "Non-geometric effects, those listed below; a calibration has its own.")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.calibration is not None and self.effects is not None:
            raise typer.BadParameter("the calibration has its own effects", param_hint="--effects / --calibration")

    def load(self) -> "tuple[taskcal.ErrorModel, taskcal.Calibration | None]":
        """The model with the named effects, and the calibration that it is of, where it is of one.

        Raises:
            typer.BadParameter: effects that only measurements can select.
            TaskcalError: there is no such robot, or it cannot have an effect.
        """
        model, calibration = super().load()
        effects = read_effects(self.effects or "none")
        if effects is None:
            raise typer.BadParameter("'auto' needs --campaign; otherwise list the effects", param_hint="--effects")
        for effect in effects:
            model = model + effect
        return model, calibration


# The poses of a task.

REACHING = "joints that reach the task's poses"
"""What is being done."""


def read_and_reach(
    model: "taskcal.ErrorModel", path: Path, count: int, seed: int, begin: Callable[[str], None]
) -> "taskcal.task.TaskPoses":
    """Read a task and find the joints that reach it; a message states how many poses are out of reach."""
    task = taskcal.load_task(path)
    begin(REACHING)
    poses = taskcal.reach_task(model, task, count, seed)
    missing = int(poses.unreachable.sum())
    if missing:
        said = {"missing": missing, "all": len(poses.unreachable)}
        info(Said("{missing} of {all} poses of the task are out of the robot's reach and left out", **said))
    return poses


# Options of commands that compute many things in parallel.

ENGINES = ("loky", "threading", "sequential", "dask")

ADDRESSED = "dask:"
"""Begins an engine with its scheduler's address in one word, as Python has it."""


@dataclass(frozen=True, kw_only=True)
class EngineOptions:
    """Engine of parallel computations.

    Raises:
        typer.BadParameter: there is no such engine, or a scheduler is lacking or has no use.
    """

    engine: str = option(
        "loky",
        "ENGINE",
        "loky (processes on this machine), threading, sequential, or dask (a cluster, see --scheduler).",
    )
    scheduler: str | None = option(None, "ADDRESS", "Scheduler of the Dask cluster, such as tcp://HOST:8786.")
    workers: int | None = option(None, "N", "Parallel workers; by default one per core.", low=1)

    @property
    def engine_name(self) -> str:
        """The engine, with its scheduler."""
        return self.engine if self.scheduler is None else f"{ADDRESSED}{self.scheduler}"

    @property
    def max_workers(self) -> int:
        """Maximum number of workers; −1 for one per core."""
        return -1 if self.workers is None else self.workers

    def __post_init__(self) -> None:
        if self.engine not in ENGINES and not self.engine.startswith(ADDRESSED):
            raise typer.BadParameter(
                f"'{self.engine}' is not an engine; choose {', '.join(ENGINES[:-1])}, or dask with --scheduler ADDRESS",
                param_hint="--engine",
            )
        if self.engine == "dask" and not self.scheduler:
            raise typer.BadParameter(
                "needs --scheduler: the address that 'dask scheduler' prints, such as tcp://HOST:8786",
                param_hint="--engine dask / --scheduler",
            )
        if self.engine != "dask" and self.scheduler is not None:
            raise typer.BadParameter(f"only --engine dask has one, not {self.engine}", param_hint="--scheduler")
