"""A command of the command line: its options as they are declared, its help, and what is wrong with a value in users' words."""

import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import MISSING, Field, field, fields, is_dataclass, replace
from functools import partial, wraps
from inspect import Parameter, Signature, signature
from typing import Annotated, Any, cast, get_args, get_origin, get_type_hints

import typer
from typer import BadParameter
from typer.core import TyperCommand

from taskcal.cli.output import show_log
from taskcal.cli.run import Result, Run
from taskcal.errors import shown
from taskcal_groundwork.options import OPTION, Option, OptionError, StatedOption, Written, options_of, stated

# What is wrong with an option's value, in users' words: the parser of options says it in those of its validator.

NO_NUMBER = "is not a number; write for example 0.5"

_WORDS = (
    (re.compile(r"Value error, (.*?)\.?"), r"\1"),
    (re.compile(r"Input should be a valid integer.*"), "is not a whole number; write for example 10"),
    (re.compile(r"Input should be a valid number.*"), NO_NUMBER),
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
            value = _typed(names, arguments)
            plain = NO_NUMBER if value is not None and value.lower() == "nan" else found.expand(words)
            return plain if value is None or plain.startswith("'") else f"'{shown(value)}' {plain}"
    return message


def _typed(names: Sequence[str], arguments: Sequence[str]) -> str | None:
    """Return the text last typed as the value of an option."""
    for k in range(len(arguments) - 1, -1, -1):
        name, equals, value = arguments[k].partition("=")
        if name in names:
            return value if equals else next(iter(arguments[k + 1 :]), None)
    return None


WRITTEN_BY = {
    "ROBOT": "{robots list} lists the catalogue, and {robots import} writes the file of another robot",
    "TASK.toml": "{robots task} writes a task to begin with",
    "CAMPAIGN.csv": "{measure} measures a campaign live, and {simulate} simulates one",
    "CAL.json": "{identify} writes a calibration",
}
"""What writes a file that a command needs, by how help shows the file; names of commands stand for their examples."""


def what_writes(missing: Any, root: Any) -> str:
    """Commands that write what is missing; empty where none does.

    Args:
        missing: option or argument that has to be given.
        root: group of all commands.
    """

    def example(found: re.Match[str]) -> str:
        command = root
        for word in found[1].split():
            command = command.commands[word]
        return f"'{command.example}'"

    kinds = re.findall(r"[\w.]+", missing.metavar or "")
    said = next((f"{text}." for kind, text in WRITTEN_BY.items() if kind in kinds), "")
    return re.sub(r"\{(.+?)\}", example, said)


GONE = {
    "--loss": (
        "--gross-errors",
        "rows that cannot be right are left out of the fit (--gross-errors), and squares of the others are summed",
    ),
    "--markdown": (
        "--header",
        "the page is HTML, its numbers are JSON (--json), and its figures SVG or PDF (--figures)",
    ),
}
"""Options that there were, by name: one of those in their place, which tells the commands that had them, and what there is now."""


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
            if not wrong.message and "--output" not in names:  # it is missing
                wrong.message = what_writes(wrong.param, ctx.find_root().command)
            raise
        except Exception as wrong:
            name = getattr(wrong, "option_name", "")
            beside, now = GONE.get(name, ("", ""))
            if beside in self._options():
                raise BadParameter(f"is not an option any more: {now}", ctx, param_hint=name) from wrong
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


# The options of a command: single ones that it declares itself, and those of groups, as they are declared there.


def option(default: Any, metavar: str | None = None, help: str = "", **declared: Any) -> Any:
    """Declare an option that is a command's alone, in place of the default of a parameter or of a group's field.

    Args:
        default: its value where it is not given; ``...`` where it has to be given.
        metavar: how help shows its value; None for a flag or a choice.
        help: what it is.
        declared: as `Option` has it; all else is the parser's.
    """
    own = {name: declared.pop(name) for name in [*declared] if name in _OWN}
    made = Option(metavar=metavar, help=help, **own, more=declared)
    return field(default=MISSING if default is ... else default, metadata={OPTION: made})


def argument(default: Any, metavar: str, help: str, **declared: Any) -> Any:
    """Declare an argument, like `option`."""
    return option(default, metavar, help, argument=True, **declared)


def output_option(default: Any, metavar: str, help: str, *, writes: str = "new", **declared: Any) -> Any:
    """Declare ``--output``, the file that a command is called for, like `option`."""
    return option(default, metavar, help, also="-o", writes=writes, **declared)


_OWN = {one.name for one in fields(Option)} - {"more"}

TRUST = Option(
    help="Let a xacro file read files outside its own folder and the environment, as a program that you trust."
)


def laid_out(command: Callable[..., Result | None], called: str = "") -> Callable[..., None]:
    """Return a command as the command line reads it: every option a parameter of its own.

    Where an annotation is a dataclass, its options take its place; the command gets the dataclass, which may check its values
    against one another as it is made. Of a dataclass that is `Written`, it gets what was written. Annotated with a mapping, it
    begins with other values of its fields than by default; with `Told`, it has those of other options of the command, too, which
    are fields of its own that nobody writes. After a robot, or a source of one, ``--trust-xacro`` is added. It gives a `Result`,
    or prints by itself, and may take its `Run`.

    Args:
        command: takes options, arguments and groups by keyword.
        called: as the user calls it.

    Raises:
        ValueError: two options have one name.
    """
    hints = get_type_hints(command, include_extras=True)
    places: dict[str, StatedOption] = {}
    groups: dict[str, tuple[Callable[..., Any], dict[str, StatedOption]]] = {}
    told: dict[str, tuple[str, ...]] = {}
    takers = [name for name, hint in hints.items() if hint is Run]
    for name, parameter in signature(command).parameters.items():
        if name in takers:
            continue
        hint, begun, told[name] = _annotated(hints[name])
        kind: Any = get_args(hint)[0] if get_origin(hint) is Written else hint
        if is_dataclass(kind):
            group = cast("type[Any]", kind)
            own = [replace(one, default=begun.get(one.field, one.default)) for one in options_of(group)]
            added = {one.name.replace("-", "_"): one for one in own}
            groups[name] = (group if group is hint else partial(Written, group), added)
        else:
            added = {name: _single(name, hints[name], parameter.default)}
        if twice := places.keys() & added:
            raise ValueError(f"two options have one name: {', '.join(twice)}")
        places |= added
    flat = [_parameter(name, one) for name, one in places.items()]
    place = next((place for place, parameter in enumerate(flat) if parameter.name in ("robot", "source")), None)
    if place is not None:
        flat.insert(place + 1, _parameter("trust_xacro", _single("trust_xacro", Annotated[bool, TRUST], False)))

    @wraps(command)
    def run(*, trust_xacro: bool = False, **given: Any) -> None:
        try:
            given = {key: one.value(given.get(key)) for key, one in places.items()}
            for key, one in places.items():
                one.check(given[key])
            options = [(one, given[key]) for key, one in places.items()]
            every = {one.field: value for one, value in options}
            for name, (make, own) in groups.items():
                values = {one.field: given.pop(key) for key, one in own.items()}
                given[name] = make(**values, **{field: every[field] for field in told[name]})
            with ExitStack() as around:
                if trust_xacro:
                    from taskcal.robot.importers.xacro import trusting_xacro

                    around.enter_context(trusting_xacro())
                this = Run.begin(called, options, given.values())
                around.enter_context(this.opened)
                result = command(**given, **dict.fromkeys(takers, this))
                if result is not None:
                    this.finish(result)
        except OptionError as wrong:
            named = {one.field: f"--{one.name}" for one in places.values()}
            hint = " / ".join(named.get(name, name) for name in wrong.names)
            raise BadParameter(wrong.said(lambda name: named.get(name, name)), param_hint=hint) from wrong

    result: Any = run
    result.__signature__ = Signature(flat)
    result.__annotations__ = {parameter.name: parameter.annotation for parameter in flat}
    result.options = tuple(places.values())
    result.writes = [f"--{one.name}" for one in places.values() if one.option.writes]
    return run


class Told(tuple[str, ...]):
    """Fields of a group that other options of the command give."""


def _annotated(hint: Any) -> tuple[Any, Mapping[str, Any], Told]:
    """A type, what it begins with, and what it is told, as it is annotated."""
    if get_origin(hint) is not Annotated:
        return hint, {}, Told()
    kind, *more = get_args(hint)
    begun = next((one for one in more if isinstance(one, Mapping)), dict[str, Any]())
    return kind, begun, next((one for one in more if isinstance(one, Told)), Told())


def _single(name: str, hint: Any, default: Any) -> StatedOption:
    """An option that is a command's alone: its type is annotated with what is declared, or its default is a field that has it."""
    declared = None
    if isinstance(default, Field):
        declared, default = default.metadata[OPTION], default.default
    default = MISSING if default is Parameter.empty else default
    return stated(name, hint, default, declared) or cast(StatedOption, stated(name, hint, default, Option()))


def _parameter(name: str, one: StatedOption) -> Parameter:
    """A parameter as Typer takes it. A file is looked at by its reader alone, which reports what is wrong with it."""
    own, default = one.option, Parameter.empty if one.default is MISSING else one.written(one.default)
    names = () if own.argument else (f"--{one.name}", *filter(None, [own.also]))
    of_parser = own.ends and not one.numbers
    bounds = {key: bound for key, bound in (("min", own.low), ("max", own.high)) if bound is not None and of_parser}
    kind = typer.Argument if own.argument else typer.Option
    how = kind(*names, metavar=own.metavar, readable=False, help=own.help, **bounds, **own.more)
    written = str if one.numbers else one.kind
    hint = written | None if default is None else written
    return Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[hint, how])
