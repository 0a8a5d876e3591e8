"""TOML files with a schema: read, validated, and explained where they are wrong."""

import math
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, get_args, get_origin

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo

from taskcal.errors import FileError, advise, listed, shown
from taskcal.io.text_file import read_text

# Where a text is not TOML, and what to write there instead.

_PLACE = re.compile(r"(?P<what>.*) \(at (line (?P<line>\d+), column (?P<column>\d+)|end of document)\)", re.DOTALL)

_COMMENT = re.compile(r"\s+#[^\"']*$")

SHOWN_MISTAKES = 40
"""Characters of a line in a message."""


class Fault(NamedTuple):
    """Place and remedy of one mistake."""

    line: int | None
    """Counted from 1; None where the parser does not say."""
    said: str


class _Stop(NamedTuple):
    """Place at which the parser stopped."""

    before: str
    """Of the line."""
    behind: str
    """The rest of it, without a comment."""

    @property
    def value(self) -> str:
        """Value after the first equals sign of the line, up to where the parser stopped and beyond."""
        return (self.before + self.behind).partition("=")[2].strip()

    @property
    def key(self) -> str:
        """Key before the equals sign, or the line where it has none."""
        return (self.before + self.behind).partition("=")[0].strip()


def find_mistake(error: str, text: str) -> Fault:
    """The mistake behind an error of the parser.

    Args:
        error: the parser's message.
        text: what it was given.
    """
    found = _PLACE.fullmatch(error)
    if found is None:
        return Fault(None, _OTHERWISE)
    lines = text.split("\n")
    if found["line"]:
        number, column = int(found["line"]), int(found["column"])
    else:  # the end is of the last line that has anything
        number = max((k for k, line in enumerate(lines, start=1) if line.strip()), default=1)
        column = len(lines[number - 1]) + 1
    line = lines[number - 1].rstrip("\r")
    stop = _Stop(line[: column - 1], _COMMENT.sub("", line[column - 1 :]))
    remedy = next((say(stop) for start, say in _REMEDIES.items() if found["what"].startswith(start)), _OTHERWISE)
    around = f"column {column} of '{shown(line.strip(), SHOWN_MISTAKES)}'" if line.strip() else f"column {column}"
    return Fault(number, f"{around}: {remedy}")


_OTHERWISE = "write name = value lines, text in quotes, numbers with a point, lists in brackets, comments after #"


def _of_value(stop: _Stop) -> str:
    """A value that is none."""
    value = stop.behind.strip()
    if not value or value.startswith("#"):
        return 'a value is missing; write one, such as 12.5 or "text"'
    if value.lower() in ("true", "false"):
        return f"write {value.lower()} in small letters"
    if value[0] in "“”„‘’«»":
        return 'write straight quotes, such as "text"'
    if value[0] in ".," and value[1:2].isdigit():
        return f"write a digit before the point, such as 0.{value[1]}"
    if value[0] in ",]}":
        return "a value is missing before it, or there is a comma too many"
    return 'text needs quotes, such as "text", and a number a point, such as 12.5'


def _of_rest(stop: _Stop) -> str:
    """Something behind a value."""
    rest, value = stop.behind.strip(), stop.value
    if re.fullmatch(r"[-+]?\d+,\d+.*", value):
        return "write a point in numbers, not a comma, such as 1.5"
    if re.match(r"[-+]?0\d", value):
        return "leave out the zero before the number"
    if rest.startswith(("//", ";", "--")):
        return "write # before a comment"
    if re.match(r"[-+]?[\d.]+\s*[a-zA-Zµ°%]+", value):
        return f"leave out '{shown(rest, SHOWN_MISTAKES)}'; keys name their unit, such as size_mm and cone_deg"
    return f"leave out '{shown(rest, SHOWN_MISTAKES)}', or write it on a line of its own, a comment after #"


def _of_key(stop: _Stop) -> str:
    """A key that no equals sign follows."""
    if stop.behind.startswith(":"):
        return "write = between name and value, not a colon"
    if stop.behind and not stop.behind[0].isascii():
        return "write names with the letters a to z, digits, _ and -, or in quotes"
    return "write = between name and value, such as size_mm = 12.5; a name has no blanks"


def _of_character(stop: _Stop) -> str:
    """A character that may not stand there."""
    if not stop.behind:
        return "the text in quotes has no end; close it on the same line"
    return "take out this character, which cannot be seen"


def _twice(stop: _Stop) -> str:
    key = shown(stop.key, SHOWN_MISTAKES)
    if key.startswith("["):
        return f"{key} stands here a second time, or was given in another way before; put all of it in one place"
    return f"'{key}' is given a second time; leave one of them out"


_REMEDIES: dict[str, Callable[[_Stop], str]] = {
    "Invalid value": _of_value,
    "Expected newline or end of document": _of_rest,
    "Expected '=' after": _of_key,
    "Illegal character": _of_character,
    "Found invalid character": _of_character,
    "Unterminated string": lambda _: "the text in quotes has no end; close it",
    "Expected \"'": lambda _: "the text in quotes has no end; close it",
    "Expected '\"": lambda _: "the text in quotes has no end; close it",
    "Unclosed array": lambda _: "a list is not closed before this, or lacks a comma; write [1.0, 2.0, 3.0]",
    "Unclosed inline table": lambda _: (
        "braces are not closed on their line, or lack a comma; write { a = 1.0, b = 2.0 }"
    ),
    "Duplicate inline table key": _twice,
    "Cannot overwrite": _twice,
    "Cannot declare": _twice,
    "Cannot mutate": _twice,
    "Cannot redefine": _twice,
    "Expected ']]'": lambda _: (
        "write a section that may stand several times as [[name]], with two brackets on either side"
    ),
    "Expected ']'": lambda _: "write a section as [name], with a bracket on either side",
    "Unescaped": lambda _: (
        "write \\\\ for a backslash in double quotes, or put the text in single ones, such as 'C:\\parts'"
    ),
    "Escaped character": lambda _: "write \\\\ for a backslash in double quotes, or put the text in single ones",
    "Invalid hex": lambda _: "write \\\\ for a backslash in double quotes, or put the text in single ones",
    "Invalid initial character for a key": lambda _: "write a name here, with letters, digits, _ and -",
    "Invalid statement": lambda _: "write name = value, or a section as [name]",
    "Invalid date": lambda _: "there is no such date or time; write one as 2026-01-31, or text in quotes",
}
"""What to do about it, by how the parser's message begins."""


LARGEST = 1e6
"""Of any number in millimetres, degrees, kilograms or seconds: 1 km, six times what a laser tracker reaches, and 2800
turns, eleven times the travel of an axis without stops (±242 turns in ABB's IRB data sheets)."""

SMALLEST = 1e-6
"""Of a number above zero: a nanometre, below what any gauge shows; squares of smaller ones may vanish."""

STIFFEST = 1e15
"""Nm/rad; drives of industrial robots have up to 1e7, and this one yields nothing."""

Finite = Annotated[float, Field(strict=True, ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(strict=True, ge=0, le=LARGEST, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, ge=SMALLEST, le=LARGEST, allow_inf_nan=False)]
Stiffness = Annotated[float, Field(strict=True, ge=SMALLEST, le=STIFFEST, allow_inf_nan=False)]
Ratio = Annotated[float, Field(strict=True, ge=0, le=1e300, allow_inf_nan=False)]
Count = Annotated[int, Field(strict=True, ge=0, le=10**9)]
Flag = Annotated[bool, Field(strict=True)]
HalfTurn = Annotated[float, Field(strict=True, ge=0, le=180, allow_inf_nan=False)]
"""An angle between directions, degrees."""


def _sign(value: object) -> object:
    if type(value) is not int:
        raise ValueError("must be 1 or -1")
    return value


Sign = Annotated[Literal[1, -1], BeforeValidator(_sign)]


def _of_some_length(direction: tuple[float, float, float]) -> tuple[float, float, float]:
    if math.hypot(*direction) < SMALLEST:
        raise ValueError("has no direction; give for example [0.0, 0.0, 1.0]")
    return direction


Direction = Annotated[tuple[Finite, Finite, Finite], AfterValidator(_of_some_length)]
"""A direction, of any length."""


def _of_unit_length(quaternion: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    length = math.hypot(*quaternion)
    if abs(length - 1.0) > 1e-2:
        raise ValueError(f"the quaternion {list(quaternion)} has length {length:.4f}; it must be 1 (qx qy qz qw)")
    return quaternion


Quaternion = Annotated[tuple[Finite, Finite, Finite, Finite], AfterValidator(_of_unit_length)]
"""A rotation, qx qy qz qw."""


class FileSection(BaseModel):
    """A section of a file; a key it does not know is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True)


SHOWN = 3

LARGEST_MB = 2.0
"""A robot, task, station or cell with a thousand joints, reflectors or touched points is smaller."""

LONGEST_KEY = 20
"""Parts of a dotted key; Taskcal's own have three. The parser takes time and memory that grow with the square of the parts, and
Python cannot free what it makes of 10⁵; of 20 parts the largest file takes 0.3 GB."""

_ENDS = re.compile(r"([,=\[\]{}\n#])")
"""What a key stands between."""

Schema = TypeVar("Schema", bound=FileSection)


def read_toml(path: Path, schema: type[Schema]) -> Schema:
    """Read a file as its schema wants it.

    Raises:
        FileError: it is missing, no TOML, or not as the schema wants it; the message names the place and the value.
    """
    data = toml_of(path)
    try:
        return schema.model_validate(data)
    except ValidationError as error:
        raise FileError(path, explain(error, schema)) from error


def toml_of(path: Path) -> dict[str, Any]:
    """The content of a file, whatever its schema.

    Raises:
        FileError: it is missing or too large, or no TOML.
    """
    return parse_toml(read_text(path, LARGEST_MB, otherwise="is not TOML: it is not UTF-8 text"), path)


def tables_of_task(path: Path) -> list[str]:
    """The list or path of poses that a file names which may be a task, before the task's reader says what is wrong with it."""
    try:
        content = toml_of(path)
    except FileError:
        return []
    named = (content.get(key) for key in ("poses", "path"))
    return [name for name in named if isinstance(name, str) and "\0" not in name]


def parse_toml(text: str, path: Path) -> dict[str, Any]:
    """The content of a text; the only way to the parser for what users write.

    Args:
        text: TOML.
        path: that it is from.

    Raises:
        FileError: it is no TOML, or a key is longer than any that makes sense.
    """
    chunks = _ENDS.split(text)
    keys = (chunk for chunk, end in zip(chunks[::2], chunks[1::2], strict=False) if end in "=]")
    if any(key.count(".") >= LONGEST_KEY for key in keys):
        raise FileError(path, f"is not TOML that Taskcal reads: a key has more than {LONGEST_KEY} parts")
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise FileError(path, "is not TOML that Taskcal reads: its brackets are nested too deeply") from error
    except tomllib.TOMLDecodeError as error:
        mistake = find_mistake(str(error), text)
        raise FileError(path, f"is not TOML: {mistake.said}", line=mistake.line) from error
    except ValueError as error:  # of Python, for an integer of thousands of digits
        raise FileError(path, "is not TOML: a number has too many digits") from error


def explain(error: ValidationError, schema: type[BaseModel]) -> str:
    """The problems of a validation by a schema, as ``joint 3, steps 1: what is wrong``; three at most."""
    items = [item for item in map(dict, error.errors()) if not _is_long_enough(item)]
    items.sort(key=lambda item: item["type"] != "extra_forbidden")  # what is missing may stand there under another name
    return listed((_problem(item, schema) for item in items), SHOWN, "; ")


def _is_long_enough(item: dict[str, Any]) -> bool:
    """Whether a list is called too short merely because the validator counts no entry that is wrong itself."""
    return item["type"] == "too_short" and len(item["input"]) >= item["ctx"]["min_length"]


def _problem(item: dict[str, Any], schema: type[BaseModel]) -> str:
    place: list[str] = []
    for step in item["loc"]:
        if isinstance(step, int) and place:
            place[-1] += f" {step + 1}"
        else:
            place.append(str(step))
    if item["type"] == "extra_forbidden":
        *place, key = place
        where = ", ".join(map(shown, place))
        known, homes = _keys(schema, item["loc"][:-1]), _homes(schema, key)
        advice = advise(key, known) if known else "check its spelling"
        if homes:
            advice = f"it belongs in {' or '.join(homes)}"
        return f"{where}{': ' if where else ''}'{shown(key)}' is not a known key; {advice}"
    say = PLAIN.get(item["type"])
    message = "is not what belongs here" if say is None else say(item.get("ctx", {}))
    message = _other_header(item, schema) or message
    where = ", ".join(map(shown, place))
    return f"{where}{': ' if where else ''}{message}{_got(item)}"


def _other_header(item: dict[str, Any], schema: type[BaseModel]) -> str:
    """What to write where one table is given for a list of them, or the reverse; empty where neither is."""
    *above, name = [step for step in item["loc"] if isinstance(step, str)] or [""]
    place, given = shown(".".join((*above, name))), item["input"]
    if item["type"] in ("model_type", "dict_type") and _are_tables(given):
        return f"is a list of tables; write its header in single brackets, [{place}]"
    if item["type"] not in ("list_type", "tuple_type") or not isinstance(given, dict):
        return ""
    field = _fields(schema, above).get(name)
    return "" if field is None or not _sections(field.annotation) else f"is one table; write its header as [[{place}]]"


def _are_tables(value: object) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(one, dict) for one in value)


def _keys(schema: type[BaseModel], place: Sequence[str | int]) -> tuple[str, ...]:
    """Keys of the section at a place; none where it may be one of several kinds."""
    return tuple(_fields(schema, place))


def _fields(schema: type[BaseModel], place: Sequence[str | int]) -> Mapping[str, FieldInfo]:
    """Fields of the section at a place; none where it may be one of several kinds."""
    for step in place:
        if isinstance(step, int):
            continue
        field = schema.model_fields.get(step)
        sections = _sections(field.annotation) if field else set()
        if len(sections) != 1:
            return {}
        (schema,) = sections
    return schema.model_fields


def _homes(schema: type[BaseModel], key: str, within: tuple[str, ...] = ()) -> list[str]:
    """Headers of the sections in which a schema has a key of this name."""
    found = ["the first lines"] if not within and key in schema.model_fields else []
    for name, field in schema.model_fields.items():
        header = _header(".".join((*within, name)), field.annotation)
        for section in sorted(_sections(field.annotation), key=lambda section: section.__name__):
            found += [header] if key in section.model_fields else []
            found += _homes(section, key, (*within, name)) if name not in within else []
    return list(dict.fromkeys(found))


def _header(place: str, annotation: Any) -> str:
    """Header of one section, of one of several, or of one with a name of its own."""
    kinds = {get_origin(kind) for kind in (annotation, *get_args(annotation))}
    if kinds & {tuple, list}:
        return f"[[{place}]]"
    return f"[{place}.NAME]" if kinds & {dict, Mapping} else f"[{place}]"


def _sections(annotation: Any) -> set[type[BaseModel]]:
    """All kinds of section that an annotation allows."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return {annotation}
    return set().union(*map(_sections, get_args(annotation)))


def _got(item: dict[str, Any]) -> str:
    """The value, where it is one that can be shown and the message is about it."""
    value = item.get("input")
    if not isinstance(value, str | int | float | bool):
        return ""
    try:
        return f" (got {shown(repr(value))})"
    except ValueError:  # Python does not write out integers of thousands of digits
        return ""


PLAIN: Mapping[str, Callable[[dict[str, Any]], str]] = {
    "missing": lambda _: "is missing",
    "value_error": lambda known: str(known["error"]),
    "float_type": lambda _: "is not a number; write it without quotes, such as 12.5",
    "finite_number": lambda _: "is not a finite number",
    "int_type": lambda _: "is not a whole number; write it without quotes and point, such as 12",
    "int_parsing_size": lambda _: "is too large a number",
    "bool_type": lambda _: "is neither true nor false",
    "greater_than": lambda known: f"must be above {known['gt']:g}",
    "greater_than_equal": lambda known: f"must be {known['ge']:g} or more",
    "less_than": lambda known: f"must be below {known['lt']:g}",
    "less_than_equal": lambda known: f"must be {known['le']:g} or less",
    "string_type": lambda _: "is not text; write it in quotes",
    "string_too_short": lambda _: "is empty; write something",
    "string_pattern_mismatch": lambda _: "is not a name; use letters, digits and underscores, a letter first",
    "string_too_long": lambda known: f"has more than {known['max_length']} characters",
    "float_parsing": lambda _: "is not a number, such as 12.5",
    "date_from_datetime_parsing": lambda _: "is not a date, such as 2026-11-26",
    "literal_error": lambda known: f"must be {known['expected']}",
    "tuple_type": lambda _: "is not a list; write it in brackets, such as [1.0, 2.0]",
    "list_type": lambda _: "is not a list; write it in brackets, such as [1.0, 2.0]",
    "dict_type": lambda _: "is not a table of keys and values",
    "model_type": lambda _: "is not a table of keys and values",
    "too_short": lambda known: f"has {_entries(known['actual_length'])}; give {known['min_length']} or more",
    "too_long": lambda known: f"has more than {_entries(known['max_length'])}",
}
"""The validator's kinds of error in plain words."""


def _entries(count: int) -> str:
    return "1 entry" if count == 1 else f"{count or 'no'} entries"
