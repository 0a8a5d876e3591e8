"""Where a text is not TOML, and what to write there instead."""

import re
from collections.abc import Callable
from typing import NamedTuple

from taskcal.errors import shown

_PLACE = re.compile(r"(?P<what>.*) \(at (line (?P<line>\d+), column (?P<column>\d+)|end of document)\)", re.DOTALL)

SHOWN = 40
"""Characters of a line in a message."""


class Mistake(NamedTuple):
    """What a reader of the message needs to mend it."""

    line: int | None
    """Counted from 1; None where the parser does not say."""
    said: str


class _Stop(NamedTuple):
    """Where the parser stopped."""

    before: str
    """Of the line."""
    behind: str
    """The rest of it."""

    @property
    def value(self) -> str:
        """What stands behind the first equals sign of the line, up to where the parser stopped and beyond."""
        return (self.before + self.behind).partition("=")[2].strip()

    @property
    def key(self) -> str:
        """What stands before the equals sign, or the line where it has none."""
        return (self.before + self.behind).partition("=")[0].strip()


def find_mistake(error: str, text: str) -> Mistake:
    """The mistake behind an error of the parser.

    Args:
        error: the parser's message.
        text: what it was given.
    """
    found = _PLACE.fullmatch(error)
    if found is None:
        return Mistake(None, _OTHERWISE)
    lines = text.split("\n")
    if found["line"]:
        number, column = int(found["line"]), int(found["column"])
    else:  # the end is of the last line that has anything
        number = max((k for k, line in enumerate(lines, start=1) if line.strip()), default=1)
        column = len(lines[number - 1]) + 1
    line = lines[number - 1].rstrip("\r")
    stop = _Stop(line[: column - 1], line[column - 1 :])
    remedy = next((say(stop) for start, say in _REMEDIES.items() if found["what"].startswith(start)), _OTHERWISE)
    around = f"column {column} of '{shown(line.strip(), SHOWN)}'" if line.strip() else f"column {column}"
    return Mistake(number, f"{around}: {remedy}")


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
        return f"leave out '{shown(rest, SHOWN)}'; keys name their unit, such as size_mm and cone_deg"
    return f"leave out '{shown(rest, SHOWN)}', or write it on a line of its own, a comment after #"


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
    key = shown(stop.key, SHOWN)
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
