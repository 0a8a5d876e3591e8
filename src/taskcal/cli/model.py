"""The model that a command works with: of a robot, with effects, or of a calibration."""

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from taskcal.identification.calibration import Calibration
    from taskcal.robot.error_model import ErrorModel

EffectsOption = Annotated[
    str | None,
    typer.Option(
        "--effects",
        metavar="LIST",
        help="Effects to identify beside the geometry, those listed below. A calibration brings its own.",
    ),
]


def model_of(robot: str | None, calibration: "Calibration | None", effects: str | None) -> "ErrorModel":
    """The model.

    Raises:
        typer.BadParameter: effects beside a calibration, or such as have no place before anything is measured.
        TaskcalError: a robot that is not there, or an effect that it cannot have.
    """
    from taskcal.cli.effects import read_effects
    from taskcal.robot.catalogue import load_robot
    from taskcal.robot.error_model import ErrorModel

    if calibration is not None:
        if effects is not None:
            raise typer.BadParameter("the calibration brings its own", param_hint="--effects / --calibration")
        return calibration.model
    model = ErrorModel(load_robot(robot or ""))
    asked = [] if effects is None else read_effects(effects)
    if asked is None:
        raise typer.BadParameter("nothing is measured that could prove them; name the effects", param_hint="--effects")
    for effect in asked:
        model = model + effect
    return model
