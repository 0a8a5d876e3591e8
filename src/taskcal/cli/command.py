"""A command of the command line: its help ends with the effects it can take."""

import re
from collections.abc import Callable, Sequence
from dataclasses import MISSING, fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature, signature
from typing import Annotated, Any, get_type_hints

import typer
from typer import BadParameter
from typer.core import TyperCommand

from taskcal.cli.output import show_log
from taskcal.errors import shown

# What is wrong with an option's value, in users' words: the parser of options says it in those of its validator.

_WORDS = (
    (re.compile(r"Value error, (.*?)\.?"), r"\1"),
    (re.compile(r"Input should be a valid integer.*"), "is not a whole number; write for example 10"),
    (re.compile(r"Input should be a valid number.*"), "is not a number; write for example 0.5"),
    (re.compile(r"Input should be a finite number.*"), "is not a finite number"),
    (re.compile(r"Input should be greater than or equal to (.*)"), r"must be \1 or more"),
    (re.compile(r"Input should be less than or equal to (.*)"), r"must be \1 or less"),
    (re.compile(r"Input should be greater than (.*)"), r"must be above \1"),
    (re.compile(r"Input should be less than (.*)"), r"must be below \1"),
)
"""How the validator says it, and how to say it."""


def in_users_words(message: str, names: Sequence[str], arguments: Sequence[str]) -> str:
    """A message about a value, with the value before it where the message does not have it.

    Args:
        message: the validator's, or one of our own, which stays as it is.
        names: of the option, such as ``--count`` and ``-n``.
        arguments: as they were typed.
    """
    for said, words in _WORDS:
        if found := said.fullmatch(message):
            plain = found.expand(words)
            value = _typed(names, arguments)
            return plain if value is None or plain.startswith("'") else f"'{shown(value)}' {plain}"
    return message


def _typed(names: Sequence[str], arguments: Sequence[str]) -> str | None:
    """Return the text last typed as the value of an option."""
    for k in range(len(arguments) - 1, -1, -1):
        name, equals, value = arguments[k].partition("=")
        if name in names:
            return value if equals else next(iter(arguments[k + 1 :]), None)
    return None


class Command(TyperCommand):
    """A command of Taskcal."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the options."""
        try:
            return super().parse_args(ctx, list(args))
        except BadParameter as wrong:
            names = [] if wrong.param is None else wrong.param.opts
            wrong.message = in_users_words(wrong.message, names, args)
            raise

    def invoke(self, ctx: Any) -> Any:
        """Run the command."""
        show_log()
        return super().invoke(ctx)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help, and behind it what can be written for ``--effects``, effects of imported modules among it."""
        if "--effects" in self._options():
            from taskcal.robot.effects import spellings

            lines = [f"{text}: {meaning}" for text, meaning in spellings().items()]
            self.epilog = "\n\n".join(["Effects:", *lines])
        super().format_help(ctx, formatter)

    def _options(self) -> set[str]:
        return {name for parameter in self.params for name in parameter.opts}


# The options of a command: single ones, and groups of them as one frozen value.

TrustOption = Annotated[
    bool,
    typer.Option(
        "--trust-xacro",
        help="Let a xacro file read files outside its own folder and the environment, as a program that you trust.",
    ),
]


def laid_out(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command as the command line reads it: every option a parameter of its own.

    Where an annotation is a dataclass, its fields, annotated like parameters, take its place; the command gets the
    dataclass, which may check its values against one another as it is made. After a robot, or a source of one,
    ``--trust-xacro`` is added.

    Args:
        command: takes options, arguments and groups by keyword.

    Raises:
        ValueError: two groups have an option of one name.
    """
    hints = get_type_hints(command, include_extras=True)
    groups: dict[str, Any] = {name: kind for name, kind in hints.items() if is_dataclass(kind)}
    flat: list[Parameter] = []
    for name, parameter in signature(command).parameters.items():
        one = parameter.replace(kind=Parameter.KEYWORD_ONLY, annotation=hints[name])
        flat += _parameters(groups[name]) if name in groups else [one]
    place = next((place for place, parameter in enumerate(flat) if parameter.name in ("robot", "source")), None)
    if place is not None:
        flat.insert(place + 1, Parameter("trust_xacro", Parameter.KEYWORD_ONLY, default=False, annotation=TrustOption))

    @wraps(command)
    def run(*, trust_xacro: bool = False, **given: Any) -> None:
        for name, kind in groups.items():
            given[name] = kind(**{field.name: given.pop(field.name) for field in fields(kind)})
        if not trust_xacro:
            return command(**given)
        from taskcal.robot.importers.xacro import trusting_xacro

        with trusting_xacro():
            return command(**given)

    result: Any = run
    result.__signature__ = Signature(flat)
    result.__annotations__ = {parameter.name: parameter.annotation for parameter in flat}
    return run


def _parameters(group: type) -> list[Parameter]:
    """One for each field."""
    hints = get_type_hints(group, include_extras=True)
    return [
        Parameter(
            field.name,
            Parameter.KEYWORD_ONLY,
            default=Parameter.empty if field.default is MISSING else field.default,
            annotation=hints[field.name],
        )
        for field in fields(group)
    ]
