"""The model that a command works with: of a robot, with effects, or of a calibration."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from taskcal.identification.calibration import Calibration
    from taskcal.robot.error_model import ErrorModel


@dataclass(frozen=True, kw_only=True)
class RobotOptions:
    """A robot, or a calibration.

    Raises:
        typer.BadParameter: neither, or both.
    """

    robot: Annotated[
        str | None,
        typer.Option(
            "--robot",
            "-r",
            metavar="ROBOT",
            help="Name in the catalogue, or a file: .toml, .urdf (or .urdf#TIP), .xacro.",
        ),
    ] = None
    calibration: Annotated[
        Path | None,
        typer.Option(
            "--calibration",
            "-c",
            metavar="CAL.json",
            readable=False,
            help="Instead of --robot: a calibration, with its effects and with what it knows.",
        ),
    ] = None

    def __post_init__(self) -> None:
        if (self.robot is None) == (self.calibration is None):
            both = "give one of them" if self.robot is None else "give one of them: a calibration contains its robot"
            raise typer.BadParameter(both, param_hint="--robot / --calibration")

    def load(self) -> "tuple[ErrorModel, Calibration | None]":
        """The model, and the calibration that it is of, where it is of one.

        Raises:
            FileError: the calibration cannot be read.
            TaskcalError: a robot that is not there.
        """
        from taskcal.identification.calibration import load_calibration
        from taskcal.robot.catalogue import load_robot
        from taskcal.robot.error_model import ErrorModel

        if self.calibration is not None:
            calibration = load_calibration(self.calibration)
            return calibration.model, calibration
        return ErrorModel(load_robot(self.robot or "")), None


@dataclass(frozen=True, kw_only=True)
class ModelOptions(RobotOptions):
    """A robot, with effects, or a calibration.

    Raises:
        typer.BadParameter: neither robot nor calibration, both, or effects beside a calibration.
    """

    effects: Annotated[
        str | None,
        typer.Option(
            "--effects",
            metavar="LIST",
            help="Effects to identify beside the geometry, those listed below. A calibration brings its own.",
        ),
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.calibration is not None and self.effects is not None:
            raise typer.BadParameter("the calibration brings its own", param_hint="--effects / --calibration")

    def load(self) -> "tuple[ErrorModel, Calibration | None]":
        """The model with the effects that are named, and the calibration that it is of, where it is of one.

        Raises:
            typer.BadParameter: effects such as have no place before anything is measured.
            TaskcalError: a robot that is not there, or an effect that it cannot have.
        """
        from taskcal.cli.options.effects import read_effects

        model, calibration = super().load()
        effects = [] if self.effects is None else read_effects(self.effects)
        if effects is None:
            raise typer.BadParameter(
                "nothing is measured that could prove them; name the effects", param_hint="--effects"
            )
        for effect in effects:
            model = model + effect
        return model, calibration
