"""Text in columns: commas, semicolons, tabs, bars or blanks between the cells."""

import csv
import re
from collections import Counter, deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain, islice
from pathlib import Path

import numpy as np
from jaxtyping import Bool

from taskcal.errors import FileError, listed, shown
from taskcal.tables.options import DecimalMark
from taskcal.tables.table import ANGLES, LENGTHS, MAX_MARKS, NUMBER, PLURALS, TEXT, UNITS, Cells, Sheet, Table, too_wide

# Whether a comma in a number is its decimal mark or parts its thousands.

_COMMA_IS_DECIMAL = re.compile(
    r"[+-]?(?:\d*,(?:\d{1,2}|\d{4,})|\d{4,},\d+|0+,\d+|,\d+|\d{1,3}(?:\.\d{3})+,\d+|\d*,\d+e[+-]?\d+)", re.ASCII | re.I
)
"""No number with thousands parted by commas looks so: ``12,5``, ``1234,567``, ``0,123``, ``1.234,5``, ``1,5e3``."""

_COMMA_PARTS_THOUSANDS = re.compile(r"[+-]?(?:\d{1,3}(?:,\d{3})+\.\d*|\d{1,3}(?:,\d{3}){2,})", re.ASCII)
"""No number with a decimal comma looks so: ``-2,305.6424``, ``1,234,567``."""

_POINT_IS_DECIMAL = re.compile(r"[+-]?(?:\d*\.(?:\d{1,2}|\d{4,})|\d{4,}\.\d+|0+\.\d+|\.\d+)", re.ASCII)
"""No number with thousands parted by points looks so."""

_WITH_COMMA = re.compile(r"[+-]?[\d.]*(?:,\d*)+(?:\.\d*)?(?:e[+-]?\d+)?", re.ASCII | re.I)


def find_decimal_mark(path: Path, cells: Iterable[tuple[int, str]]) -> DecimalMark:
    """The decimal mark of a table, by all of its numbers.

    Args:
        path: of the file, for errors.
        cells: the cells that hold a comma or a point, each with its line.

    Raises:
        FileError: some cells can only be read with one mark and some only with the other, or a comma may be either.
    """
    comma: tuple[int, str] | None = None
    point: tuple[int, str] | None = None
    unsure: tuple[int, str] | None = None
    for line, cell in cells:
        if "," in cell:
            if _COMMA_IS_DECIMAL.fullmatch(cell):
                comma = comma or (line, cell)
            elif _COMMA_PARTS_THOUSANDS.fullmatch(cell):
                point = point or (line, cell)
            elif _WITH_COMMA.fullmatch(cell):
                unsure = unsure or (line, cell)
        elif point is None and _POINT_IS_DECIMAL.fullmatch(cell):
            point = (line, cell)
    if comma and point:
        line = max(comma[0], point[0])
        message = (
            f"'{shown(comma[1])}' in line {comma[0]} has a decimal comma, '{shown(point[1])}' in line {point[0]} a decimal "
            "point; write all with one of them"
        )
        raise FileError(path, message, line=int(line))
    if comma:
        return ","
    if unsure and not point:
        line, cell = unsure
        message = (
            f"'{shown(cell)}' may be {shown(cell.replace(',', '.'))} or {shown(cell.replace(',', ''))}, and no other number "
            "tells which; state the decimal mark, comma or point"
        )
        raise FileError(path, message, line=int(line))
    return "."


def with_point(cell: str, mark: DecimalMark) -> str:
    """A number's text with a decimal point and no parted thousands; any other text as it is."""
    if "," not in cell:
        return cell if mark == "." or not _POINTS_PART_THOUSANDS.fullmatch(cell) else cell.replace(".", "")
    if not _WITH_COMMA.fullmatch(cell):
        return cell
    if mark == ",":
        whole, _, rest = cell.rpartition(",")
        return cell if "," in whole else f"{whole.replace('.', '')}.{rest}"
    return cell.replace(",", "") if _PARTED.fullmatch(cell) else cell


_POINTS_PART_THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:\.\d{3})+", re.ASCII)

_PARTED = re.compile(r"[+-]?\d{1,3}(?:,\d{3})+(?:\.\d*)?", re.ASCII)


# The lines of a text, one after another.

_AT_ONCE = 1 << 16
"""Characters that are parted into lines at once: all lines of a large file take several times the memory of its text."""


def lines_of(text: str) -> Iterator[str]:
    """Lines of a text, without their line feeds."""
    for part in parts_of(text):
        yield from part.removesuffix("\n").split("\n")
    if text.endswith("\n") or not text:
        yield ""


def parts_of(text: str) -> Iterator[str]:
    """A text divided behind some of its line feeds."""
    begin = 0
    while begin < len(text):
        end = text.find("\n", begin + _AT_ONCE) + 1 or len(text)
        yield text[begin:end]
        begin = end


# Numbers in other characters than a programming language writes: signs, grouped digits, exponents of Fortran.

_GROUPED = re.compile(r"(?<=\d)['’\u00a0\u2009\u202f](?=\d{3}(?!\d))")
"""Between three digits and those before them: an apostrophe as the Swiss write, or a blank that does not break the line."""

_BLANKS = re.compile(r"[+-]?\d{1,3}(?: \d{3})+(?:[.,]\d*)?", re.ASCII)
"""Digits in groups with blanks between them."""

_EXPONENT = re.compile(r"(?<=[\d.])[dD](?=[+-]\d{2,3}(?!\w))", re.ASCII)
"""As Fortran writes numbers of double precision, ``3.1416D+02``."""

_MINUS = re.compile(r"(?<![\w\u2012\u2013])[\u2212\u2012\u2013](?=[\d.,])")
"""A minus sign, and dashes that stand for one before a digit."""


def in_plain_digits(text: str) -> str:
    """Text whose numbers have a hyphen for a sign, digits in one group, and ``e`` before the exponent."""
    changes: list[tuple[re.Pattern[str], str]] = []
    if not text.isascii():
        changes = [(_MINUS, "-"), (_GROUPED, "")]
    elif "'" in text:
        changes = [(_GROUPED, "")]
    if any(mark in text for mark in ("D+", "D-", "d+", "d-")):
        changes.append((_EXPONENT, "e"))
    for pattern, put in changes:
        if pattern.search(text):
            # what stands between the changes takes far more memory than the text
            text = "".join(pattern.sub(put, part) for part in parts_of(text))
    return text


def without_blanks(cell: str) -> str:
    """A number without the blanks between its groups of digits; any other text as it is."""
    return cell.replace(" ", "") if " " in cell and _BLANKS.fullmatch(cell) else cell


# Units behind the numbers in the cells, as in ``31,4°`` or ``812.5 mm``.

_BEHIND_NUMBERS = sorted((word for word, name in UNITS.items() if name in LENGTHS or name in ANGLES), key=len)[::-1]

_MEASURED = re.compile(
    rf"([+-]?(?:\d[\d.,]*+|[.,]\d++)(?:e[+-]?\d+)?)\s*({'|'.join(map(re.escape, _BEHIND_NUMBERS))}|°c)",
    re.ASCII | re.IGNORECASE,
)

MIN_UNIT_SHARE = 0.8
"""Share of a column's cells with digits first, at least, that have one unit, where it is the column's. A convention: some cells
hold remarks."""

_BEGINS_A_NUMBER = re.compile(r"[+-]?[.,]?\d", re.ASCII)


def with_units_apart(sheet: Sheet) -> Sheet:
    """A sheet in which the unit that most cells of a column have behind their numbers is the column's.

    Cells of that column in another unit stay as they are, and are no numbers.
    """
    cells = Cells.of(sheet.rows)
    columns = {k for row in cells[-20:] for k, cell in enumerate(row) if _MEASURED.fullmatch(cell)}
    texts, units = cells.cells.copy(), dict[int, str]()
    for k in sorted(columns):
        at = (cells.begins + k)[cells.widths > k]
        column: list[str] = cells.cells[at].tolist()
        matches = [_MEASURED.fullmatch(cell) for cell in column]
        found = Counter(
            match and match[2].casefold()
            for match, cell in zip(matches, column, strict=True)
            if match or _BEGINS_A_NUMBER.match(cell)
        )
        unit = max(filter(None, found), key=found.__getitem__)
        if found[unit] >= MIN_UNIT_SHARE * found.total():
            units[k] = unit
            texts[at] = np.array(
                [m[1] if m and m[2].casefold() == unit else cell for m, cell in zip(matches, column, strict=True)],
                dtype=TEXT,
            )
    if not units:
        return sheet
    stated = tuple(units.get(k, "") for k in range(max(units) + 1))
    return replace(sheet, rows=Cells(texts, cells.widths), units=stated)


_SEPARATOR_LINE = re.compile(r"\Asep=(.)[ \t]*(?=\n)", re.IGNORECASE)
"""What a spreadsheet writes first to say how it separates."""

_COMMENT = re.compile(r"\s*(?:#|//|%|;;|!)(.*)")

_ANY_NUMBER = re.compile(r"[+-]?(?:\d(?:[\d.,]*\d)?|\d++\.|[.,]\d++)(?:e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
"""A number with any decimal mark, to tell one way of parting lines from another; a comma behind it parts."""

_SAMPLED = 120
"""Lines that tell the separator, from the beginning and as many from the end."""

BLANKS = " "
COMMA_BLANK = ", "
"""A comma and a blank: what programs write that print decimal commas between commas."""

_SEPARATORS = ("\t", ";", "|", ",", COMMA_BLANK, BLANKS)
"""The first of those that part equally well is taken."""


_SELDOM_ELSE = ("\t", ";", "|")
"""What stands in nearly every line for no other reason than to part it."""


def parse_delimited(path: Path, text: str, decimal: DecimalMark | None = None) -> Sheet:
    """The rows of a file's text.

    Args:
        path: of the file, for errors.
        text: its whole text, lines ended by line feeds.
        decimal: the decimal mark; by default what the numbers themselves tell.

    Raises:
        FileError: a quote is not closed, or a comma may be a decimal mark or part thousands.
    """
    stated = _SEPARATOR_LINE.match(text)
    if stated:
        text = text[stated.end() + 1 :]
    numbered = enumerate(map(_COMMENT.match, lines_of(text)), start=1)
    commented = ((number, match[1].strip()) for number, match in numbered if match)
    first_comments = tuple(islice(commented, 2 * _SAMPLED))
    comments = tuple(comment for _, comment in chain(first_comments, commented))
    separator = stated[1] if stated and stated[1] in _SEPARATORS else separator_of(lines_of(text))
    first, grouped = 1 if stated else 0, separator != BLANKS and " " in text
    rows, lines = Cells.numbered(
        (number + first, tuple(map(without_blanks, cells)) if grouped else cells)
        for number, cells in _cells(path, text, separator)
        if any(cells)
    )
    sheet = Sheet(path=path, rows=rows, lines=lines, separator=separator, comments=comments)
    if not len(rows):
        return sheet
    sheet = with_units_apart(sheet.noted(*_commented(first_comments, separator, int(rows.widths[-1]), first)))
    # of a large file each form of its rows takes as much memory as its text
    del rows
    if separator == ",":
        # a comma that parts cells is in none of them, but for quoted ones
        return with_decimal_points(sheet, decimal) if '"' in text else sheet
    return with_decimal_points(sheet, decimal)


def _commented(comments: Sequence[tuple[int, str]], separator: str, width: int, first: int) -> tuple[str, ...]:
    """Note on rows of numbers after a comment mark, as people leave them out."""
    lines = [
        number + first
        for number, comment in comments
        if len(row := split_line(comment, separator)) == width and sum(map(bool, map(_ANY_NUMBER.fullmatch, row))) > 2
    ]
    if not lines:
        return ()
    return (f"numbers behind a comment mark are left out (line {listed(lines, 5)})",)


def with_decimal_points(
    sheet: Sheet, decimal: DecimalMark | None = None, texts: Bool[np.ndarray, " cells"] | None = None
) -> Sheet:
    """A sheet whose numbers have decimal points and no parted thousands.

    Args:
        sheet: whose cells they are.
        decimal: the decimal mark; by default what the numbers themselves tell.
        texts: the cells that are text in the file; the others are numbers of a workbook, and have no mark of their own.

    Raises:
        FileError: the decimal mark is not stated and cannot be told.
    """
    cells = Cells.of(sheet.rows)
    own = np.ones(len(cells.cells), dtype=bool) if texts is None else texts
    if not (cells.holding(",") & own).any():
        return sheet
    at = cells.holding(",.") & own
    lines = np.repeat(sheet.lines, cells.widths)[at]
    mark = find_decimal_mark(sheet.path, zip(lines, cells.texts(at), strict=True)) if decimal is None else decimal
    if decimal is not None:
        sheet = replace(sheet, acted=sheet.acted | {"decimal"})
    pointed = cells.mapped(lambda cell: with_point(cell, mark), at)
    if np.array_equal(pointed.cells, cells.cells):
        return sheet
    note = "numbers are read with decimal commas" if mark == "," else "commas in numbers are read as parting thousands"
    return replace(sheet, rows=pointed).noted(note)


def separator_of(lines: Iterable[str]) -> str:
    """Separator of the cells: the one that gives most lines the same count of cells, and most cells numbers."""
    plain = (line for line in lines if line.strip() and not _COMMENT.match(line))
    sample = [*islice(plain, _SAMPLED), *deque(plain, _SAMPLED)]
    for separator in _SELDOM_ELSE:
        if (
            sample
            and sum(separator in line for line in sample) >= 0.9 * len(sample)
            and _fit(sample, separator)[0] > 0.2
        ):
            return separator
    best = max(_SEPARATORS, key=lambda separator: _fit(sample, separator))
    # where commas with a blank behind them part the lines as well, commas without one are decimal marks
    return COMMA_BLANK if best == "," and _fit(sample, COMMA_BLANK)[0] >= _fit(sample, best)[0] else best


def _fit(lines: Sequence[str], separator: str) -> tuple[float, int]:
    """Score of a separator: share of cells that are numbers in lines of the usual count; then the count."""
    rows = [split_line(line, separator) for line in lines]
    counts = Counter(len(row) for row in rows if len(row) > 1)
    if not counts:
        return 0.0, 0
    usual, times = max(counts.items(), key=lambda item: (item[1], item[0]))
    cells = [cell for row in rows if len(row) == usual for cell in row]
    numeric = sum(_ANY_NUMBER.fullmatch(cell) is not None for cell in cells)
    return round((numeric + 0.01 * len(cells)) / len(cells) * times / len(rows), 6), usual


def split_line(line: str, separator: str) -> tuple[str, ...]:
    """The cells of one line."""
    if separator == BLANKS:
        return tuple(line.split())
    if separator == COMMA_BLANK:
        return tuple(cell.strip() for cell in re.split(r",\s+", line.strip()))
    if '"' not in line:
        return tuple(cell.strip() for cell in line.split(separator))
    try:
        return tuple(cell.strip() for cell in next(csv.reader([line], delimiter=separator), []))
    except csv.Error:
        return ()


def _cells(path: Path, text: str, separator: str) -> Iterator[tuple[int, tuple[str, ...]]]:
    """The cells of every line that is not a comment, with the line's number."""
    if separator in (BLANKS, COMMA_BLANK) or '"' not in text:
        for number, line in enumerate(lines_of(text), start=1):
            if not _COMMENT.match(line):
                yield number, split_line(line, separator)
        return
    for number, row in quoted_rows(path, text, separator):
        cells = tuple(cell.strip() for cell in row)
        if cells and not _COMMENT.match(cells[0]):
            yield number, cells


def quoted_rows(path: Path, text: str, separator: str) -> Iterator[tuple[int, list[str]]]:
    """The cells of every row of text with quotes, which may hold ends of lines, with the number of its last line.

    Raises:
        FileError: a quote is not closed, or the lines of one row have too many cells.
    """
    marks = 0

    def lines() -> Iterator[str]:
        nonlocal marks
        begin = 0
        while begin < len(text):
            end = text.find("\n", begin) + 1 or len(text)
            marks += text.count(separator, begin, end)
            if marks > MAX_MARKS:
                raise too_wide(path, reader.line_num + 1)
            yield text[begin:end]
            begin = end

    reader = csv.reader(lines(), delimiter=separator)
    try:
        for row in reader:
            marks = 0
            yield reader.line_num, row
    except csv.Error as error:
        raise FileError(path, f"cannot be parted into cells: {error}", line=reader.line_num) from error


# What stands below a table: rows that sum it up, and remarks.

_STATISTIC = re.compile(
    r"(?:overall )?(?:(?:mean|average|avg|arithmetic mean|median|std|stdev|stddev|std dev|std\. dev|standard deviation|st\.? ?dev"
    r"|s\.?d|sigma|σ|variance|min|minimum|max|maximum|range|span|rms|rmse|sum|total|count"
    r"|mittel|mittelwert|mw|durchschnitt|ø|stdabw|std\.? ?abw|stabw|standardabweichung|summe|spannweite|anzahl|varianz)"
    r"|[1-6] ?(?:sigma|σ))"
    r"(?: ?\(?(?:value|values|error|errors|deviation|dev|wert|fehler|abweichung|absolute|abs|[xyz]|of .{1,40})\)?)*",
    re.IGNORECASE,
)
"""Names of statistics, in English and German."""

_REMARK = re.compile(
    r"\W{2,}.*|<.*|\W*(?:end|eof|ende|fin|stop)\b.*|[^\W\d_][^:=]{0,40}[:=].*"
    r"|(?:total|sum|count|number|summe|anzahl|created|exported|generated|page|seite|remark|note|bemerkung)\b.*",
    re.IGNORECASE | re.DOTALL,
)
"""A single text that names no row: a line, an end, ``Operator: NN``, a count."""

MAX_REMARKS = 20
"""Rows below a table that are looked at."""


def is_statistic(text: str) -> bool:
    """Whether a text is the name of a statistic, such as ``Mean`` or ``Max. error``."""
    plain = re.sub(r"[\s_]+", " ", text[:100]).strip().rstrip(":=").strip()
    return bool(_STATISTIC.fullmatch(plain) or _STATISTIC.fullmatch(plain.replace(".", "")))


def is_footer(row: Sequence[str]) -> bool:
    """Whether a row below a table sums it up by name, or is a remark alone."""
    filled = [cell for cell in row if cell]
    if not filled or NUMBER.fullmatch(filled[0]):
        return False
    return is_statistic(filled[0]) or (len(filled) == 1 and _REMARK.fullmatch(filled[0]) is not None)


def footer_note(lines: Iterable[int], rows: Sequence[Sequence[str]]) -> str:
    """First texts and lines of rows that are left out, for a note."""
    firsts = [next(filter(None, row)) for row in rows]
    return listed((f"{shown(text, 40)} (line {line})" for text, line in zip(firsts, lines, strict=True)), 5)


# A last line without a line end, which may be cut off in its last cell.

MIN_EXPONENTS = 3
"""Numbers above the last one, all with exponents of one length, that tell a fixed form from small numbers. A convention."""

_SHAPE = re.compile(r"[^.]*(?:\.(?P<decimals>\d*))?(?:e(?P<exponent>[+-]?\d*))?", re.ASCII | re.IGNORECASE)


def expect_whole_end(table: Table, text: str) -> Table:
    """A table whose file may be cut off in its last cell, with a note where nothing shows that it is not.

    The cell is whole where a line end or a separator follows, or where it has as many digits behind the point and in its exponent
    as all other cells of its column, which then have the same.

    Raises:
        FileError: it has fewer, in a file whose numbers are filled up with zeros to the same decimals, or is empty and no other is.
    """
    if not len(table) or text.endswith("\n") or int(table.lines[-1]) != text.count("\n") + 1:
        return table
    (*others, last), column = table.cells.column(len(table.header) - 1).tolist(), table.header[-1]
    if text[-1] in '\x1a\t;|"' or (text[-1] == "," and not last.endswith(".")):
        if last or not others or not all(others):
            return table
        message = "is empty in the last line, which has no line end, and in no other; is the file cut off?"
        raise table.error(
            f"{message} Take it from where it came, or end the line if it is whole", len(table) - 1, column
        )
    is_number = NUMBER.fullmatch(last) is not None
    shapes = [_shape(other) for other in others if NUMBER.fullmatch(other)]
    if is_number and set(shapes) == {_shape(last)} and _shape(last) != (0, 0):
        return table
    if not is_number and last in others and not any(other.startswith(last) and other != last for other in others):
        return table
    if is_number and shapes and _shape(last) < min(shapes) and _is_filled_up(table.cells, shapes, _shape(last)):
        message = (
            f"the file ends in '{shown(last)}', without a line end and with fewer digits than all others ('{shown(others[-1])}'); "
            "is it cut off? Take it from where it came, or end the line if it is whole"
        )
        raise table.error(message, len(table) - 1, column)
    return table.noted(
        f"the last line has no line end, and nothing shows that its last cell ('{shown(last)}') is whole"
    )


def _shape(number: str) -> tuple[int, int]:
    """Digits of a number behind its point, and length of its exponent."""
    match = _SHAPE.fullmatch(number)
    assert match is not None, "any number has this form"
    return len(match["decimals"] or ""), len(match["exponent"] or "")


def _is_filled_up(cells: Cells, others: Sequence[tuple[int, int]], last: tuple[int, int]) -> bool:
    """Whether numbers have fixed forms, of which the last one of a column falls short.

    What writes as many decimals as each number needs writes no zero but in ``.0``, and an exponent in some numbers only.
    """
    texts = cells.cells
    zeros = np.strings.endswith(texts, "0") & cells.holding(".") & ~cells.holding("eE")
    if last == (0, 0) and zeros.any():
        return True
    padded = zeros & ~np.strings.endswith(texts, ".0")
    return len(set(others)) == 1 and bool(padded.any() or (others[0][1] and len(others) >= MIN_EXPONENTS))


# Logs that write every number behind its name: ``Cnt=1  X=-5907.204 Y=-4051.459 RotX= 1.530``.

_PAIR = re.compile(
    r"(?<![\w.\[\]°/])([A-Za-z_][\w.\[\]°/]*+)\s*+[=:]\s*([+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?)(?=[\s,;]|$)",
    re.ASCII,
)

_SECTION = re.compile(
    r"\s*(?P<what>[^\W\d_]+)[ _.#:-]*(?P<number>\d+(?:[.-]\d+)*+\w*+)\s*+(?!=)[:.,;]?\s*(?P<remark>.*)$"
)
"""A line such as ``Pos 3`` that names what follows, and a remark behind the number."""

_LONGEST_TITLE = 300
"""Letters of a line that may name what follows; longer ones are text."""

_LABELLED_SAMPLE = 200
MIN_LABELS = 3
"""Of one line; a preamble has one or two."""


def has_labelled_values(text: str) -> bool:
    """Whether most lines write at least three numbers, each behind its name."""
    lines = [line for line in text.split("\n", _LABELLED_SAMPLE)[:_LABELLED_SAMPLE] if line.strip()]
    labelled = sum(len(_PAIR.findall(line[:2000])) >= MIN_LABELS for line in lines)
    return labelled > 0 and 2 * labelled >= len(lines)


def parse_labelled_values(path: Path, text: str) -> Sheet:
    """A row for every line with the names that most lines have, and a first column for the section it stands in.

    Sections begin with a line such as ``Pos 3``. Text behind the number is a remark where other lines begin with the same word.
    Other lines and remarks are left out, and listed in notes; the first lines are kept as comments, which may state units.
    """
    usual = Counter(
        tuple(name for name, _ in pairs) for line in lines_of(text) if len(pairs := _PAIR.findall(line)) >= MIN_LABELS
    ).most_common(1)[0][0]
    titles = _section_words(text)
    section, sectioned = "", False
    strays: list[tuple[int, str]] = []
    remarks: list[tuple[int, str]] = []

    def numbered() -> Iterator[tuple[int, tuple[str, ...]]]:
        nonlocal section, sectioned
        yield 0, ("id", *usual)
        for number, line in enumerate(lines_of(text), start=1):
            pairs = _PAIR.findall(line)
            titled = _titled(line)
            if tuple(name for name, _ in pairs) == usual:
                yield number, (section, *(value for _, value in pairs))
            elif titled and titled["what"].casefold() in titles:
                section, sectioned = titled["number"], True
                if titled["remark"]:
                    remarks.append((number, line.strip()))
            elif line.strip():
                strays.append((number, line.strip()))

    rows, lines = Cells.numbered(numbered())
    if not sectioned:
        rows = Cells.of(row[1:] for row in rows)
    notes: list[str] = []
    for found, said in (
        (strays, f"{len(strays)} line{'s' if len(strays) > 1 else ''} without {', '.join(usual[:3])} … are left out"),
        (remarks, "text behind the number of a header is left out"),
    ):
        if found:
            notes.append(f"{said}: {footer_note([line for line, _ in found], [(words,) for _, words in found])}")
    return Sheet(
        path=path,
        rows=rows,
        lines=np.concatenate([lines[1:2], lines[1:]]),
        separator="=",
        comments=tuple(line for _, line in strays[:_LABELLED_SAMPLE]),
        notes=tuple(notes),
    )


def _section_words(text: str) -> set[str]:
    """Words in small letters that begin the lines which name sections.

    With a number alone behind it a word is one; without such lines, the word that most lines with different numbers begin with.
    """
    titled = [match for line in lines_of(text) if (match := _titled(line))]
    plain = {match["what"].casefold() for match in titled if not match["remark"]}
    if plain:
        return plain
    numbers: dict[str, list[str]] = {}
    for match in titled:
        numbers.setdefault(match["what"].casefold(), []).append(match["number"])
    return {word for word, stood in numbers.items() if len(stood) > 1 and len(set(stood)) == len(stood)}


def _titled(line: str) -> re.Match[str] | None:
    """Match of a line that names the section below it; None if it cannot."""
    if len(line) > _LONGEST_TITLE or len(_PAIR.findall(line)) >= MIN_LABELS:
        return None
    return _SECTION.match(line)


# Motion capture as Motive exports it: a line of settings, then names, kinds and axes of the columns in rows of their own.
#
# Source: OptiTrack's documentation of Motive's CSV export.


def is_motion_capture(text: str) -> bool:
    """Whether a text begins as such an export does."""
    return text.startswith("Format Version,")


def parse_motion_capture(path: Path, text: str) -> Sheet:
    """A row for every frame; bodies' poses as ``NAME_x_mm … NAME_qw``, markers' positions as ``NAME_x_mm …``.

    Raises:
        FileError: rotations are not quaternions, the unit is not stated, or the rows of names are not as they should be.
    """
    rows, lines = Cells.numbered((line, tuple(row)) for line, row in quoted_rows(path, text, ","))
    settings = dict(zip(rows[0][::2], rows[0][1::2], strict=False))
    unit = UNITS.get(settings.get("Length Units", "").casefold())
    if unit not in LENGTHS:
        known = ", ".join(PLURALS[name] for name in LENGTHS)
        raise FileError(path, f"states no unit of length that is known; known: {known}", line=1)
    if settings.get("Rotation Type", "Quaternion") != "Quaternion":
        message = f"has rotations as {shown(settings['Rotation Type'])}; export them as quaternions"
        raise FileError(path, message, line=1)
    axes_at = next((k for k, row in enumerate(rows) if row and row[0].strip().casefold() == "frame"), None)
    heads = _heads([row for row in rows[1 : axes_at or 0] if any(row)])
    if axes_at is None or axes_at < 2 or not {"type", "name"} <= heads.keys():
        raise FileError(path, "begins as an export of Motive, but lacks its rows of types, names and axes", line=1)
    axes, kinds = rows[axes_at], rows[axes_at - 1]
    header = tuple(_column(k, heads, kinds, axes, unit) for k in range(len(axes)))
    below = zip(lines[axes_at + 1 :], rows[axes_at + 1 :], strict=True)
    body = ((line, tuple(cell.strip() for cell in row)) for line, row in below if any(row))
    rows, lines = Cells.numbered(chain([(lines[axes_at], header)], body))
    return Sheet(path=path, rows=rows, lines=lines, separator=",")


def _heads(rows: list[tuple[str, ...]]) -> dict[str, tuple[str, ...]]:
    """Rows above the axes by what they hold; Motive 2 and before write types and names first, and do not say so."""
    told = {row[1].strip().casefold(): row for row in rows if len(row) > 2 and row[1].strip()}
    return told or dict(zip(("type", "name"), rows, strict=False))


def _column(k: int, heads: dict[str, tuple[str, ...]], kinds: tuple[str, ...], axes: tuple[str, ...], unit: str) -> str:
    """A column's name from its type, name, kind and axis."""

    def cell(row: tuple[str, ...]) -> str:
        return row[k].strip() if k < len(row) else ""

    if k < 2:
        # the frame and its time
        return axes[k].strip()
    name = "_".join(cell(heads["name"]).replace(":", " ").split())
    kind, axis = cell(kinds).casefold(), cell(axes)
    if kind == "rotation":
        return f"{name}_q{axis.lower()}"
    if kind == "position":
        return f"{name}_{axis.lower()}_{unit}"
    return "_".join(filter(None, (name, kind.replace(" ", "_"), axis))) or f"column {k + 1}"
