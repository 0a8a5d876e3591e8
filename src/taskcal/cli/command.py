"""A command of the command line: its help ends with the effects it can take."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature, signature
from typing import Annotated, Any, get_args, get_origin, get_type_hints

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

    example = ""
    """A use of it, which its help shows on a line of its own."""

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

    def format_help_text(self, ctx: Any, formatter: Any) -> None:
        """Write what the command does, and an example."""
        super().format_help_text(ctx, formatter)
        if self.example:
            formatter.write(f"\n  Example: {self.example}\n")

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help, and behind it what can be written for ``--effects``, effects of imported modules among it."""
        if "--effects" in self._options():
            from taskcal.robot.effects import spellings

            lines = [f"{text}: {meaning}" for text, meaning in spellings().items()]
            self.epilog = "\n\n".join(["Effects:", *lines])
        super().format_help(ctx, formatter)

    def _options(self) -> set[str]:
        return {name for parameter in self.params for name in parameter.opts}


# The options of a command, each declared once: single ones, and groups of them as one frozen value.


@dataclass(frozen=True, kw_only=True)
class Declared:
    """An option, or an argument, which is named after the parameter or the field that gets its value."""

    kind: Callable[..., Any] = typer.Option
    metavar: str | None = None
    help: str = ""
    also: str = ""
    """Another name of an option, such as ``-o``."""
    named: str = ""
    """Its name, where that is not the parameter's."""
    more: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """As Typer has it."""

    def of(self, parameter: str) -> Any:
        """What Typer takes. A file is looked at by its reader alone, which reports what is wrong with it."""
        names = (self.named or f"--{parameter.replace('_', '-')}", self.also) if self.kind is typer.Option else ()
        return self.kind(*filter(None, names), metavar=self.metavar, readable=False, help=self.help, **self.more)


def option(
    default: Any, metavar: str | None = None, help: str = "", *, also: str = "", named: str = "", **more: Any
) -> Any:
    """Declare an option, in place of the default of a parameter or of a group's field.

    Args:
        default: its value where it is not given; ``...`` where it has to be given.
        metavar: how help shows its value; None for a flag or a choice.
        help: what it is.
        also: another name, such as ``-o``.
        named: its name, where that is not the parameter's.
        more: as Typer has it.
    """
    return _field(default, Declared(metavar=metavar, help=help, also=also, named=named, more=more))


def argument(default: Any, metavar: str, help: str, **more: Any) -> Any:
    """Declare an argument, like `option`."""
    return _field(default, Declared(kind=typer.Argument, metavar=metavar, help=help, more=more))


def _field(default: Any, declared: Declared) -> Any:
    return field(default=MISSING if default is ... else default, metadata={DECLARED: declared})


DECLARED = "declared"

TRUST = Declared(
    help="Let a xacro file read files outside its own folder and the environment, as a program that you trust."
)


def laid_out(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command as the command line reads it: every option a parameter of its own.

    Where an annotation is a dataclass, its fields, declared like parameters, take its place; the command gets the
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
        flat += _parameters(groups[name]) if name in groups else [_parameter(name, hints[name], parameter.default)]
    place = next((place for place, parameter in enumerate(flat) if parameter.name in ("robot", "source")), None)
    if place is not None:
        flat.insert(place + 1, _parameter("trust_xacro", Annotated[bool, TRUST], False))

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
    return [_parameter(one.name, hints[one.name], one) for one in fields(group)]


def _parameter(name: str, hint: Any, default: Any) -> Parameter:
    """A parameter as Typer takes it.

    Args:
        name: of the parameter.
        hint: its type, which may be annotated with how it is declared.
        default: its value where it is not given; or a field, which has that and may say how it is declared.
    """
    declared = next((one for one in getattr(hint, "__metadata__", ()) if isinstance(one, Declared)), None)
    if isinstance(default, Field):
        declared, default = default.metadata.get(DECLARED, declared), default.default
    if declared is not None:
        hint = Annotated[get_args(hint)[0] if get_origin(hint) is Annotated else hint, declared.of(name)]
    default = Parameter.empty if default is MISSING else default
    return Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=hint)
