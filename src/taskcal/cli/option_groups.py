"""Options that belong together, as one frozen value: each field of a dataclass is an option, and a command takes the whole."""

from collections.abc import Callable
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature, signature
from typing import Annotated, Any, get_type_hints

import typer

TrustOption = Annotated[
    bool,
    typer.Option(
        "--trust-xacro",
        help="Let a xacro file read files outside its own folder and the environment, as a program that you trust.",
    ),
]


def grouped(command: Callable[..., None]) -> Callable[..., None]:
    """A command whose groups are laid out as the single options that the command line reads.

    Where an annotation is a dataclass, every field of it, annotated like a parameter, stands in its place; the command gets
    the dataclass, which may check its values against one another as it is made.

    Args:
        command: takes options, arguments and groups by keyword.

    Raises:
        ValueError: two groups have an option of one name.
    """
    hints = get_type_hints(command, include_extras=True)
    groups: dict[str, Any] = {name: kind for name, kind in hints.items() if is_dataclass(kind)}
    flat: list[Parameter] = []
    for name, parameter in signature(command).parameters.items():
        if name in groups:
            flat += _parameters(groups[name])
        else:
            flat.append(parameter.replace(kind=Parameter.KEYWORD_ONLY, annotation=hints[name]))

    @wraps(command)
    def run(**given: Any) -> None:
        for name, kind in groups.items():
            given[name] = kind(**{field.name: given.pop(field.name) for field in fields(kind)})
        command(**given)

    laid_out: Any = run
    laid_out.__signature__ = Signature(flat)
    laid_out.__annotations__ = {parameter.name: parameter.annotation for parameter in flat}
    return run


def _parameters(group: type) -> list[Parameter]:
    """One for each field."""
    hints = get_type_hints(group, include_extras=True)
    return [
        Parameter(field.name, Parameter.KEYWORD_ONLY, default=_default(field), annotation=hints[field.name])
        for field in fields(group)
    ]


def _default(field: Field[Any]) -> Any:
    return Parameter.empty if field.default is MISSING else field.default


def trusting(command: Callable[..., None]) -> Callable[..., None]:
    """A command with ``--trust-xacro`` after its robot or its source of one; a command that takes none is left as it is.

    Args:
        command: as typer takes it, with its groups laid out.
    """
    hints = get_type_hints(command, include_extras=True)
    flat = [
        parameter.replace(kind=Parameter.KEYWORD_ONLY, annotation=hints[name])
        for name, parameter in signature(command).parameters.items()
    ]
    robot = next((place for place, parameter in enumerate(flat) if parameter.name in ("robot", "source")), None)
    if robot is None:
        return command
    flat.insert(robot + 1, Parameter("trust_xacro", Parameter.KEYWORD_ONLY, default=False, annotation=TrustOption))

    @wraps(command)
    def run(*, trust_xacro: bool, **given: Any) -> None:
        if not trust_xacro:
            return command(**given)
        from taskcal.robot.xacro import trusting_xacro

        with trusting_xacro():
            return command(**given)

    laid_out: Any = run
    laid_out.__signature__ = Signature(flat)
    laid_out.__annotations__ = {parameter.name: parameter.annotation for parameter in flat}
    return run
