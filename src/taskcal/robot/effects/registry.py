"""Every effect that is defined, by the key people name it by and by the name files know it by."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from taskcal.arguments import warn_renamed
from taskcal.errors import TaskcalError, UnknownName, shown
from taskcal.robot.conditions import Conditions
from taskcal.robot.robot import Robot

if TYPE_CHECKING:
    from taskcal.robot.effects.effect import Effect

_KINDS: dict[str, type["Effect"]] = {}
"""By class name, in the order of definition."""

FORMER_KEYS = {"overrun": "overshoot"}
"""Texts that named an effect in earlier releases, and what names it now."""

FORMER_KINDS = {"Overrun": "Overshoot"}
"""Of files that earlier releases wrote."""


def register(kind: type["Effect"]) -> None:
    """Take an effect up among those that compete, are read from files, and are named on the command line.

    The same class of the same module may be defined again, as a notebook's cell does.

    Raises:
        TaskcalError: another effect has its name, its key, or one of its spellings.
    """
    name = kind.__name__
    for other in _KINDS.values():
        if _home(other) == _home(kind):
            continue
        taken = {other.__name__} & {name} or {other.key, *other.ways_to_write()} & {kind.key, *kind.ways_to_write()}
        if taken:
            raise TaskcalError(
                f"the effect {name} of the module {kind.__module__} cannot be called '{min(taken)}': {other.__name__} of "
                f"{other.__module__} is; choose another name"
            )
    _KINDS[name] = kind


def _home(kind: type["Effect"]) -> tuple[str, str]:
    return kind.__module__, kind.__qualname__


def kinds() -> tuple[type["Effect"], ...]:
    """All effects, in the order in which they were defined."""
    return tuple(_KINDS.values())


def candidates(robot: Robot, conditions: Conditions) -> list["Effect"]:
    """Effects that compete on a robot by default, measured under these conditions; none where it has driven joints."""
    if robot.driven:
        return []
    return [effect for kind in kinds() for effect in kind.candidates(robot, conditions)]


def ways_to_write() -> dict[str, str]:
    """What can be written for an effect on the command line, and what it means; in alphabetical order."""
    return dict(sorted((text, meaning) for kind in kinds() for text, meaning in kind.ways_to_write().items()))


def parse_effect(text: str) -> "Effect":
    """The effect that a text such as ``harmonics:1-4`` names.

    Raises:
        TaskcalError: it names none, or with options that do not exist.
    """
    wanted = text
    if text in FORMER_KEYS and text not in ways_to_write():
        wanted = FORMER_KEYS[text]
        warn_renamed(f"the effect '{text}'", wanted, stacklevel=2)
    for kind in kinds():
        effect = kind.parse(wanted)
        if effect is not None:
            return effect
    raise TaskcalError(f"'{shown(text)}' is not an effect; known: {', '.join(ways_to_write())}")


def effect_from(data: Mapping[str, Any]) -> "Effect":
    """The effect that `Effect.to_json` described.

    Raises:
        UnknownName: a kind that does not exist.
        TaskcalError: a kind whose module is not imported.
    """
    kind, module = str(data["kind"]), data.get("module")
    if module is None:
        kind = FORMER_KINDS.get(kind, kind)
    if kind in _KINDS:
        return _KINDS[kind].from_json({name: value for name, value in data.items() if name not in ("kind", "module")})
    if module is None:
        raise UnknownName("effect", kind, _KINDS)
    where = "a script or notebook" if module == "__main__" else f"the module '{shown(module)}'"
    raise TaskcalError(
        f"the effect '{shown(kind)}' comes from {where}, which is not imported; import the module that defines it first, on "
        "the command line by taskcal --import MODULE …"
    )
