"""Arguments of the public functions: a thing of another kind is refused by name, with what would make the right one."""

from collections.abc import Mapping

from taskcal.errors import WrongKind, shown

MADE_BY = {
    "Calibration": 'load_calibration("cal.json") loads one, identify(model, campaign) makes one',
    "Campaign": 'read_campaign("campaign.csv", robot) reads one',
    "ErrorModel": 'ErrorModel(load_robot("my-robot.toml")) is one; a calibration has one, calibration.model',
    "Program": 'read_program("part.mod") reads one',
    "Robot": 'load_robot("my-robot.toml") loads one',
    "Task": 'load_task("task.toml") loads one',
}
"""Of each kind, where one comes from."""


def expect_kinds(kinds: Mapping[str, type], **arguments: object) -> None:
    """See that arguments are what their names say.

    Args:
        kinds: by name of the argument.
        **arguments: by name.

    Raises:
        WrongKind: one is something else; the message says what it is, and how to come by the right one.
    """
    for name, value in arguments.items():
        kind = kinds[name]
        if not isinstance(value, kind):
            given = shown(repr(value)) if isinstance(value, str | int | float) else _with_article(type(value))
            raise WrongKind(f"{name} is {given}, not {_with_article(kind)}: {MADE_BY[kind.__name__]}")


def _with_article(kind: type) -> str:
    return f"{'an' if kind.__name__[0] in 'AEIOU' else 'a'} {kind.__name__}"
