"""Files of instruments that are no columns of one row a point: reports of coordinate measuring machines, recordings of QTM."""

import re
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from robot_programs.languages import languages
from taskcal.errors import FileError, shown
from taskcal.tables.table import LENGTHS, UNITS, Cells, Sheet
from taskcal.tables.text import lines_of

# The report of a coordinate measuring machine, as PC-DMIS writes it: a head for each feature, and a line for each coordinate.

_FEATURE = re.compile(
    r"[^\S\n]*+DIM\s+\S+\s*=\s*LOCATION OF\s+\S+\s+(?P<name>\S+)\s+UNITS\s*=\s*(?P<unit>\w+)", re.IGNORECASE
)
_HEAD = re.compile(r"\s*AX\s+(?P<names>.*\bMEAS\b.*)", re.IGNORECASE)
_AXIS = re.compile(r"\s*(?P<axis>[XYZ])\s+(?P<numbers>[-+.\d].*)", re.IGNORECASE)


def is_coordinate_report(text: str) -> bool:
    """Whether a text is such a report."""
    return "LOCATION OF" in text and re.search(rf"^{_FEATURE.pattern}", text, re.MULTILINE | re.IGNORECASE) is not None


def parse_coordinate_report(path: Path, text: str) -> Sheet:
    """A row for every feature: its name and its measured coordinates.

    Raises:
        FileError: a feature lacks a coordinate, has one twice, or units differ or are not known.
    """
    found: list[tuple[int, str, str, dict[str, str]]] = []
    measured = 0
    for number, line in enumerate(lines_of(text), start=1):
        if feature := _FEATURE.match(line):
            found.append((number, feature["name"], feature["unit"], {}))
        elif head := _HEAD.match(line):
            measured = [name.upper() for name in head["names"].split()].index("MEAS")
        elif found and (match := _AXIS.match(line)):
            numbers, at = match["numbers"].split(), found[-1][3]
            if match["axis"].upper() in at or measured >= len(numbers):
                raise FileError(path, f"has no single measured {match['axis']} of '{shown(found[-1][1])}'", line=number)
            at[match["axis"].upper()] = numbers[measured]
    (first, _, written, _), *_ = found
    unit = UNITS.get(written.casefold())
    if unit not in LENGTHS:
        raise FileError(path, f"'{shown(written)}' is no unit of length; known: {', '.join(LENGTHS)}", line=first)

    def numbered() -> Iterator[tuple[int, tuple[str, ...]]]:
        yield first, ("id", *(f"{axis}_{unit}" for axis in "xyz"))
        for number, name, own, at in found:
            if at.keys() != {*"XYZ"} or own != written:
                what = "another unit" if own != written else "not all of X, Y and Z"
                raise FileError(
                    path, f"'{shown(name)}' has {what}; report X, Y and Z of each point in one unit", line=number
                )
            yield number, (name, *(at[axis] for axis in "XYZ"))

    rows, lines = Cells.numbered(numbered())
    note = (
        f"the measured coordinates (MEAS) of {len(found)} features are read; nominal ones and deviations are left out"
    )
    return Sheet(path=path, rows=rows, lines=lines, separator="=", notes=(note,))


# Recordings of markers as Qualisys Track Manager exports them: settings a line, the last of them the markers' names.


def is_qtm_export(text: str) -> bool:
    """Whether a text begins as such an export does."""
    return text.startswith("NO_OF_FRAMES\t")


def parse_qtm_export(path: Path, text: str) -> Sheet:
    """A row for every frame, with each marker's position as ``NAME_x_mm …``.

    Raises:
        FileError: it is of something else than markers' positions, or a row has another number of columns.
    """
    numbered = [(number, line.split("\t")) for number, line in enumerate(lines_of(text), start=1) if line.strip()]
    stated = [row for _, row in numbered if re.fullmatch(r"[A-Z_]+", row[0])]
    settings = {row[0]: [cell.strip() for cell in row[1:] if cell.strip()] for row in stated}
    included, names = settings.get("DATA_INCLUDED", []), settings.get("MARKER_NAMES", [])
    if included != ["3D"] or not names:
        what = f"with {shown(' '.join(included) or 'no kind of data')}"
        raise FileError(
            path, f"is an export of Qualisys QTM {what}; export the markers' positions (3D) as TSV, with the header"
        )
    axes = [f"{'_'.join(name.split())}_{axis}_mm" for name in names for axis in "xyz"]
    body = [
        (number, tuple(cell.strip() for cell in row)) for number, row in numbered if re.match(r"\s*[-+.\d]", row[0])
    ]
    body = [(number, row[:-1] if not row[-1] else row) for number, row in body]
    timed = bool(body) and len(body[0][1]) == len(axes) + 2
    header = (*(("Frame", "Time_s") if timed else ()), *axes)
    for number, row in body:
        if len(row) != len(header):
            message = f"the row has {len(row)} numbers, where {len(names)} markers have {len(header)}; export it from QTM anew"
            raise FileError(path, message, line=number)
    rows, lines = Cells.numbered([(1, header), *body])
    return Sheet(path=path, rows=rows, lines=lines, separator="\t")


# What is no table at all.


def program_named(path: Path, text: str) -> FileError | None:
    """Error for a robot program whose name does not say that it is one; None of any other text."""
    found = [
        one
        for one in languages()
        if one.has_logic and one.marks and re.search(one.marks, text, re.MULTILINE | re.IGNORECASE)
    ]
    if not found:
        return None
    names, ends = (" or ".join(words) for words in ([one.name for one in found], [one.suffixes[0] for one in found]))
    message = (
        f"is a program in {names}, not a table; with a name that ends in {ends} its motions to joint positions are read"
    )
    return FileError(path, message)


MIN_COORDINATE_LINES = 9
"""Lines of X, Y, Z in turn that are one coordinate each: three points."""

_LOOKED_AT = 200
"""First lines that tell it."""

_MAX_LETTERS = 300
"""Of a line, that are looked at."""

_ONE_AXIS = re.compile(
    r"(?:[^\s,;]{1,40}[\s,;]+){0,3}?(?P<axis>[XYZ])(?:[-_ ]?(?:value|wert|coord|koord)[^\s,;]*)?"
    r"(?:[\s,;:=]+[^\s,;:=\d.+-][^\s,;:=]{0,40})?[\s,;:=]+[-+]?[\d.]",
    re.IGNORECASE,
)
"""A line of one coordinate, up to three words before its letter."""


def refuse_coordinate_lines(path: Path, text: str) -> None:
    """See that a text does not have one coordinate a line, X, Y and Z in turn.

    Raises:
        FileError: it has.
    """
    lines = enumerate(islice(lines_of(text), _LOOKED_AT), start=1)
    found = [
        (number, line.strip(), m["axis"].upper())
        for number, line in lines
        if (m := _ONE_AXIS.match(line[:_MAX_LETTERS].strip()))
    ]
    if len(found) >= MIN_COORDINATE_LINES and re.fullmatch("(?:XYZ)+X?Y?", "".join(axis for *_, axis in found)):
        number, line, _ = found[0]
        message = (
            f"is a report with one coordinate a line ('{shown(line, 40)}'), not a table of points; give a row for each point, with "
            "columns id x_mm y_mm z_mm"
        )
        raise FileError(path, message, line=number)
