"""Rows of a campaign, as the command line chooses them: a:b, or a file of row numbers; counted from 0."""

import re
from pathlib import Path

import typer

from taskcal.errors import CampaignError, FileError, shown
from taskcal.text_file import read_text

_RANGE = re.compile(r"(\d{0,15}):(\d{0,15})$", re.ASCII)


def choose_rows(text: str, count: int, source: Path) -> list[int]:
    """Row numbers of a campaign with `count` rows.

    Raises:
        typer.BadParameter: what looks like a range is none.
        FileError: the file of row numbers is missing, or a line is not a row number or stands twice.
        CampaignError: the campaign does not have such a row.
    """
    path = Path(text)
    match = _RANGE.match(text)
    if path.exists() or not (match or _looks_like_range(text)):
        return _from_file(path, count, source)
    if not match:
        raise typer.BadParameter(
            f"'{shown(text)}' is not a range of rows; write a:b with a < b, such as 0:60", param_hint="--rows"
        )
    first, last = int(match[1] or 0), int(match[2] or count)
    if first >= last and match[2]:
        raise typer.BadParameter(
            f"'{text}' is empty; write a:b with a < b, counted from 0, without b", param_hint="--rows"
        )
    if last > count or first >= count:
        raise CampaignError(
            f"rows {text}: {source} has {count} rows, numbered 0 to {count - 1}; write {_nearest(first, count)}"
        )
    return list(range(first, last))


def _nearest(first: int, count: int) -> str:
    return f"{first}:{count}" if first < count else f"0:{count}"


def _looks_like_range(text: str) -> bool:
    return bool(re.match(r"[-+\d.,\s]*$", text) or re.match(r"[^/\\.]*:[^/\\.]*$", text))


def _from_file(path: Path, count: int, source: Path) -> list[int]:
    if not path.exists():
        raise FileError(path, "cannot be read: there is no such file; --rows takes a:b or a file of row numbers")
    lines = read_text(path, otherwise="is not a text file; write one row number per line, counted from 0").splitlines()
    found: dict[int, int] = {}
    for number, line in enumerate(lines, start=1):
        text = line.split("#", 1)[0].strip()
        if not text:
            continue
        if not re.fullmatch(r"\d{1,15}", text, re.ASCII):
            raise FileError(
                path, f"'{shown(text)}' is not a row number; write one per line, counted from 0", line=number
            )
        row = int(text)
        if row >= count:
            raise FileError(path, f"row {row}: {source} has {count} rows, numbered 0 to {count - 1}", line=number)
        if row in found:
            raise FileError(path, f"row {row} stands in line {found[row]} already; name each row once", line=number)
        found[row] = number
    if not found:
        raise FileError(path, "names no row; write one row number per line, counted from 0")
    return list(found)
