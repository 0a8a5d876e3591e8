"""What an effect does on a robot, once it has declared what that depends on."""

from taskcal.errors import TaskcalError
from taskcal.robot.effects.effect import Effect
from taskcal.robot.effects.linear_term import LinearTerm
from taskcal.robot.robot import Robot


def term_on(effect: Effect, robot: Robot) -> LinearTerm:
    """What an effect does on a robot.

    Raises:
        TaskcalError: it depends on conditions that it does not declare.
    """
    term = effect.term(robot)
    if term.given is not None and not (effect.needs or effect.uses):
        raise TaskcalError(
            f'the effect {type(effect).__name__} depends on conditions; say which in its class, such as needs = ("temperature",)'
        )
    return term
