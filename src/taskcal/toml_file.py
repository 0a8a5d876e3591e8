"""TOML files with a schema: read, validated, and explained where they are wrong."""

import math
import tomllib
from pathlib import Path
from typing import Annotated, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from taskcal.errors import FileError

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


Schema = TypeVar("Schema", bound=Section)


def read_toml(path: Path, schema: type[Schema]) -> Schema:
    """Read a file as its schema wants it.

    Raises:
        FileError: it is missing, no TOML, or not as the schema wants it; the message names the place and the value.
    """
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FileError(path, f"cannot be read: {error.strerror or error}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise FileError(path, f"is no TOML: {error}") from error
    try:
        return schema.model_validate(data)
    except ValidationError as error:
        raise FileError(path, explain(error)) from error


def explain(error: ValidationError) -> str:
    """First problem of a validation, as ``joint 3, steps 1: what is wrong``."""
    first = error.errors()[0]
    place: list[str] = []
    for item in first["loc"]:
        if isinstance(item, int) and place:
            place[-1] += f" {item + 1}"
        else:
            place.append(str(item))
    message = first["msg"].removeprefix("Value error, ")
    value = first.get("input")
    shown = f" (got {value!r})" if isinstance(value, str | int | float | bool) else ""
    more = f"; {error.error_count() - 1} more" if error.error_count() > 1 else ""
    return f"{', '.join(place) or 'the file'}: {message}{shown}{more}"
