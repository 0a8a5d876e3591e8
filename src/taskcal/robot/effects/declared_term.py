"""What an effect does on a robot, once it has declared what that depends on, in coordinates that no other effect has."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from taskcal.errors import TaskcalError
from taskcal.geometry.chain import ErrorFrame, Fixed, Joint, Step
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


def terms_on(
    effects: Sequence[Effect], robot: Robot, steps: Sequence[Step]
) -> tuple[list[LinearTerm], tuple[Step, ...]]:
    """What effects do on a robot together, and the chain with the joints that they add.

    Each effect numbers its joints from ``len(robot.joints)`` on, as if it were alone, and finds the joints of those before it
    standing still. Here every effect gets coordinates of its own.

    Args:
        effects: in the order in which they extend the chain.
        robot: the robot.
        steps: its chain without effects.

    Raises:
        TaskcalError: an effect depends on conditions that it does not declare, or its term and its joints do not belong together.
    """
    terms: list[LinearTerm] = []
    own = first = len(robot.joints)
    for effect in effects:
        term = term_on(effect, robot)
        _expect_moved(effect, term)
        added = max(term.coordinates - own, 0)
        steps = _extended(effect, robot, steps, added, first - own)
        if added:
            pairs = term.pairs.copy()
            pairs[pairs[:, 0] >= own, 0] += first - own
            term = replace(term, pairs=pairs, coordinates=first + added)
        terms.append(term)
        first += added
    return terms, tuple(steps)


def _expect_moved(effect: Effect, term: LinearTerm) -> None:
    """Refuse a term that moves coordinates which it does not have."""
    moved = term.pairs[:, 0]
    if len(moved) and not 0 <= moved.min() <= moved.max() < term.coordinates:
        wrong = moved.max() if moved.min() >= 0 else moved.min()
        raise TaskcalError(
            f"the term of {type(effect).__name__} moves coordinate {wrong} and states {term.coordinates}; state "
            "coordinates=len(robot.joints) plus the joints that extend() adds"
        )


def _extended(effect: Effect, robot: Robot, steps: Sequence[Step], added: int, offset: int) -> tuple[Step, ...]:
    """The chain with an effect's joints, their numbers raised by `offset`.

    Raises:
        TaskcalError: the effect adds other joints than its term has coordinates, or drops a joint.
    """
    name, own = type(effect).__name__, len(robot.joints)
    # joints of other effects are shown as what they are at rest: whoever counts joints counts the robot's
    shown = [Fixed(np.eye(4)) if isinstance(step, Joint) and step.number is not None else step for step in steps]
    at_rest = {id(stand_in): step for stand_in, step in zip(shown, steps, strict=True) if stand_in is not step}
    out = effect.extend(robot, tuple(shown))
    if [id(step) for step in out if id(step) in at_rest] != list(at_rest) or _counted(out) != _counted(shown):
        raise TaskcalError(
            f"{name}.extend drops, repeats or adds steps that are not its own; return all that it was given in their order, and "
            "add only fixed parts and joints with a number"
        )
    numbers = sorted(step.number for step in out if isinstance(step, Joint) and step.number is not None)
    wanted = list(range(own, own + added))
    if numbers != wanted:
        raise TaskcalError(
            f"{name}.extend adds joints with the numbers {numbers}, and its term moves {wanted}; number each joint once, from "
            f"len(robot.joints) on, and state coordinates=len(robot.joints) + {len(numbers)} in the term"
        )
    return tuple(
        replace(step, number=step.number + offset)
        if isinstance(step, Joint) and step.number is not None
        else at_rest.get(id(step), step)
        for step in out
    )


def _counted(steps: Sequence[Step]) -> list[Step]:
    """Steps that are counted as they are met: error frames, and joints without a number."""
    return [step for step in steps if isinstance(step, ErrorFrame) or (isinstance(step, Joint) and step.number is None)]
