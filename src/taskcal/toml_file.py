"""TOML files with a schema: read, validated, and explained where they are wrong."""

import math
import re
import tomllib
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from taskcal.errors import FileError
from taskcal.text_file import read_text

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


def _of_unit_length(quaternion: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    length = math.hypot(*quaternion)
    if abs(length - 1.0) > 1e-2:
        raise ValueError(f"the quaternion {list(quaternion)} has length {length:.4f}; it must be 1 (qx qy qz qw)")
    return quaternion


Quaternion = Annotated[tuple[Finite, Finite, Finite, Finite], AfterValidator(_of_unit_length)]
"""A rotation, qx qy qz qw."""


class Section(BaseModel):
    """A section of a file; a key it does not know is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True)


SHOWN = 3

LARGEST_MB = 2.0
"""A robot, task, station or cell with a thousand joints, reflectors or touched points is smaller."""

LONGEST_KEY = 100
"""Parts of a dotted key; Taskcal's own have three."""

_BETWEEN_DOTS = re.compile(r"[,=\[\]{}\n]")

Schema = TypeVar("Schema", bound=Section)


def read_toml(path: Path, schema: type[Schema]) -> Schema:
    """Read a file as its schema wants it.

    Raises:
        FileError: it is missing, no TOML, or not as the schema wants it; the message names the place and the value.
    """
    text = read_text(path, LARGEST_MB, otherwise="is no TOML: it is not UTF-8 text")
    if any(chunk.count(".") > LONGEST_KEY for chunk in _BETWEEN_DOTS.split(text)):
        # the parser takes a time that grows with the square of the parts, and Python cannot free what it makes of 10⁵
        raise FileError(path, f"is no TOML that Taskcal reads: a key has more than {LONGEST_KEY} parts")
    try:
        data = tomllib.loads(text)
    except RecursionError as error:
        raise FileError(path, "is no TOML that Taskcal reads: its brackets are nested too deeply") from error
    except ValueError as error:  # of the parser, and of Python for an integer of thousands of digits
        trouble = str(error) if isinstance(error, tomllib.TOMLDecodeError) else "a number has too many digits"
        raise FileError(path, f"is no TOML: {trouble}") from error
    try:
        return schema.model_validate(data)
    except ValidationError as error:
        raise FileError(path, explain(error)) from error


def explain(error: ValidationError) -> str:
    """The problems of a validation, as ``joint 3, steps 1: what is wrong``; three at most."""
    problems = [_problem(dict(item)) for item in error.errors()[:SHOWN]]
    more = error.error_count() - SHOWN
    return "; ".join(problems) + (f"; and {more} more" if more > 0 else "")


def _problem(item: dict[str, Any]) -> str:
    place: list[str] = []
    for step in item["loc"]:
        if isinstance(step, int) and place:
            place[-1] += f" {step + 1}"
        else:
            place.append(str(step))
    if item["type"] == "extra_forbidden":
        *place, key = place
        where = ", ".join(place)
        return f"{where}{': ' if where else ''}'{key}' is no key that is known here; check its spelling"
    message = "is missing" if item["type"] == "missing" else item["msg"].removeprefix("Value error, ")
    value = item.get("input")
    shown = f" (got {value!r})" if isinstance(value, str | int | float | bool) else ""
    where = ", ".join(place)
    return f"{where}{': ' if where else ''}{message}{shown}"
