"""What geometry cannot explain of a robot, stated or assumed before anything is measured."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from taskcal.robot.robot import Robot


@dataclass(frozen=True, kw_only=True)
class ModelError:
    """Gears, compliance, backlash, temperature: what stays when the geometry is known."""

    position: float
    """Standard deviation per axis of the tool point at a pose, metres."""
    source: str
    """Where the figure comes from, in words."""


TYPICAL = ModelError(
    position=0.26e-3,
    source="median of five measured robots, which had 0.06 to 1.34 mm",
)
"""For a robot whose file states none. The complete geometric model left 0.064, 0.204, 0.255, 0.326 and 1.337 mm of every measured
row of five robots (the documentation of the expected error names them). Those do not grow with the robots' reach (0.05, 0.05,
0.15, 0.32 and 1.34 mm per metre), so that the figure is no share of it."""


def model_error_of(robot: "Robot", given: float | None = None) -> ModelError:
    """The model error to assume of a robot that was not measured.

    Args:
        robot: the robot.
        given: what the user states, metres; zero for a robot that follows its geometry exactly.

    Returns:
        as given, as the robot's file states it, or that of a typical robot.
    """
    if given is not None:
        return ModelError(position=given, source="as given")
    if robot.model_error is None:
        return TYPICAL
    return robot.model_error
