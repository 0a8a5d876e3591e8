"""Options that belong together, as one frozen value: each field of a dataclass is an option, and a command takes the whole."""

from collections.abc import Callable
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature, signature
from typing import Any, get_type_hints


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
