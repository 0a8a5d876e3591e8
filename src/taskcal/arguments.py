"""Arguments of the public functions: a thing of another kind is refused by name."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Any, TypeVar, get_args

from taskcal.errors import WrongKind, shown

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


Options = TypeVar("Options", bound="DataclassInstance")

MADE_BY = {
    "Bounds": "Bounds(shift=5e-3) is one",
    "Calibration": 'load_calibration("cal.json") loads one, identify(model, campaign) makes one',
    "Campaign": 'read_campaign("campaign.csv", robot) reads one',
    "Cell": 'load_cell("cell.toml") loads one',
    "Conditions": "a campaign has one, campaign.conditions",
    "EffectSearch": "EffectSearch(field=True) is one",
    "ErrorModel": 'ErrorModel(load_robot("my-robot.toml")) is one; a calibration has one, calibration.model',
    "FitOptions": 'FitOptions(keep=("J2", "J3")) is one',
    "Frame": "Frame(name=…, T=…) is one",
    "Hyperparameters": "known_hyperparameters(calibration) are",
    "Program": 'read_program("part.mod") reads one',
    "Registration": "register(model, campaign) finds one",
    "Robot": 'load_robot("my-robot.toml") loads one',
    "Squared": "Squared(), Huber(1.5) and Cauchy() are losses",
    "Station": 'load_station("station.toml") loads one',
    "Task": 'load_task("task.toml") loads one',
    "TrackerNoise": "TrackerNoise(mpe_to_sigma=0.577) is one",
}
"""Of each kind, where one comes from."""


def expect_kinds(kinds: Mapping[str, type | UnionType], **arguments: object) -> None:
    """See that arguments are what their names say.

    Args:
        kinds: by name of the argument; a union such as ``Campaign | None`` where it may be left out.
        **arguments: by name.

    Raises:
        WrongKind: one is something else; the message says what it is, and how to come by the right one.
    """
    for name, value in arguments.items():
        kind = kinds[name]
        if not isinstance(value, kind):
            given = shown(repr(value)) if isinstance(value, str | int | float) else _with_article(type(value))
            choices: list[type] = [choice for choice in _alternatives(kind) if choice is not NoneType]
            right = " or ".join(_with_article(choice) for choice in choices)
            raise WrongKind(f"{name} is {given}, not {right}: {MADE_BY[choices[0].__name__]}")


def _alternatives(kind: type | UnionType) -> tuple[type, ...]:
    return get_args(kind) if isinstance(kind, UnionType) else (kind,)


def _with_article(kind: type) -> str:
    return f"{'an' if kind.__name__[0] in 'AEIOU' else 'a'} {kind.__name__}"


def options_of(kind: type[Options], choices: Mapping[str, Any], what: str) -> Options:
    """Options by keywords, those not named as in ``options``, or as by default.

    Args:
        kind: of the options, all of which have a default.
        choices: values by name; ``options`` for all others at once.
        what: the options are of, for the message, such as ``a plan``.

    Raises:
        TypeError: an option that does not exist; the message names all.
    """
    named = {name: value for name, value in choices.items() if name != "options"}
    return with_choices(choices.get("options") or kind(), named, what)


def with_choices(options: Options, choices: Mapping[str, Any], what: str) -> Options:
    """Frozen options with some of their values replaced by keywords.

    Args:
        options: the others.
        choices: new values by name.
        what: the options are of, for the message, such as ``a fit``.

    Raises:
        TypeError: an option that does not exist; the message names all.
    """
    names = [f.name for f in fields(options)]
    for name in choices:
        if name not in names:
            raise TypeError(f"no option '{name}' of {what}; there are {', '.join(names)}")
    return replace(options, **choices)


# Names that stand several times where each must be one's own.

Item = TypeVar("Item")


def repeated(items: Iterable[Item]) -> list[Item]:
    """Items that occur twice or more, each once, in order of first occurrence."""
    return [item for item, times in Counter(items).items() if times > 1]
