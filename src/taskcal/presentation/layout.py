"""Tables and labelled lines as text of a given width, in which no word and no number is ever broken.

A table that is too wide first folds its header, then its columns of words, between words; then it is turned on its side, where it
has few rows; then it leaves out columns that it can do without, and names them; else its rows stand one below the other, cell by
cell. A single word that is wider than the line stays whole.
"""

import textwrap
from collections.abc import Collection, Iterable, Sequence

FEW_ROWS = 4
"""Rows up to which a table that is too wide is turned on its side."""

NARROWEST = 14
"""Characters that a column of words keeps, if it has them."""

GAP = 3
"""Spaces between columns; one less where that lets a table fit."""

Rows = Sequence[Sequence[str]]


def lay_out_table(
    header: Sequence[str],
    groups: Sequence[tuple[str, Rows]],
    left: Collection[int],
    width: int,
    spare: Sequence[int] = (),
) -> list[str]:
    """The lines of a table.

    Args:
        header: of the columns.
        groups: of rows, each with a heading over them or none.
        left: columns of words, set flush left; the others are numbers.
        width: of the text, characters.
        spare: columns that the table can do without where it is too wide, those that go first at the front.
    """
    rows = [row for _, group in groups for row in group]
    for gap in (GAP, GAP - 1):
        widths = _fit(header, rows, left, width - gap * (len(header) - 1) - 1)
        if widths:
            return _columns(header, groups, left, widths, gap)
    if 0 < len(rows) <= FEW_ROWS and len(groups) == 1:
        turned = [[name, *(row[k] for row in rows)] for k, name in enumerate(header)]
        first, others = turned[0], turned[1:]
        for gap in (GAP, GAP - 1):
            widths = _fit(first, others, {0}, width - gap * len(rows) - 1)
            if widths:
                return _columns(first, [("", others)], {0}, widths, gap)
    return _without_spare(header, groups, left, width, spare) or _stacked(header, groups, width)


def _without_spare(
    header: Sequence[str], groups: Sequence[tuple[str, Rows]], left: Collection[int], width: int, spare: Sequence[int]
) -> list[str]:
    """The lines of a table without as many of the spare columns as have to go; none where that is not enough."""
    for number in range(1, len(spare) + 1):
        gone = set(spare[:number])
        stay = [k for k in range(len(header)) if k not in gone]
        names = [header[k] for k in stay]
        narrower = [(heading, [[row[k] for k in stay] for row in rows]) for heading, rows in groups]
        words = [place for place, k in enumerate(stay) if k in left]
        for gap in (GAP, GAP - 1):
            room = width - gap * (len(stay) - 1) - 1
            widths = _fit(names, [row for _, rows in narrower for row in rows], words, room)
            if widths:
                said = f"(not shown for want of width: {', '.join(header[k] for k in sorted(gone))})"
                return [*_columns(names, narrower, words, widths, gap), *(f" {line}" for line in fold(said, width - 1))]
    return []


def lay_out_facts(facts: Iterable[tuple[str, str]], width: int) -> list[str]:
    """Labelled texts, folded between words beside their labels."""
    pairs = list(facts)
    label_width = max((len(label) for label, _ in pairs), default=0)
    indent = label_width + 2
    out: list[str] = []
    for label, text in pairs:
        lines = [line for part in text.split("\n") for line in fold(part, max(width - indent, 1))]
        out += [f"{label if number == 0 else '':<{indent}}{line}".rstrip() for number, line in enumerate(lines)]
    return out


def fold(text: str, width: int) -> list[str]:
    """Lines of a text, cut between words alone."""
    return textwrap.wrap(text, max(width, 1), break_long_words=False, break_on_hyphens=False) or [""]


def _fit(header: Sequence[str], rows: Rows, left: Collection[int], room: int) -> list[int]:
    """Widths of the columns that fit into so many characters; none where they cannot."""
    cells = [[row[k] for row in rows] for k in range(len(header))]
    whole = [max([len(name), *map(len, column)]) for name, column in zip(header, cells, strict=True)]
    if sum(whole) <= room:
        return whole
    widths = [max([_longest_word(name), *map(len, column)]) for name, column in zip(header, cells, strict=True)]
    least = [
        max([_longest_word(name), min(width, NARROWEST), *map(_longest_word, column)]) if k in left else width
        for k, (name, column, width) in enumerate(zip(header, cells, widths, strict=True))
    ]
    if sum(least) > room:
        return []
    while sum(widths) > room:
        widest = max(range(len(widths)), key=lambda k: widths[k] - least[k])
        widths[widest] -= 1
    return widths


def _longest_word(text: str) -> int:
    return max(map(len, text.split()), default=0)


def _columns(
    header: Sequence[str], groups: Sequence[tuple[str, Rows]], left: Collection[int], widths: Sequence[int], gap: int
) -> list[str]:
    """A table of columns of these widths."""
    depth = max(len(fold(name, width)) for name, width in zip(header, widths, strict=True))
    lines = [fold(name, width) for name, width in zip(header, widths, strict=True)]
    above = [[""] * (depth - len(parts)) + parts for parts in lines]  # units stand right above the numbers
    out = [line for number in range(depth) for line in _row([parts[number] for parts in above], left, widths, gap)]
    out.append(" " + "─" * (sum(widths) + gap * (len(widths) - 1)))
    for heading, rows in groups:
        if heading:
            out += [f" {line}" for line in fold(heading, sum(widths) + gap * (len(widths) - 1))]
        for row in rows:
            out += _row(row, left, widths, gap)
    return out


def _row(cells: Sequence[str], left: Collection[int], widths: Sequence[int], gap: int) -> list[str]:
    """The lines of one row; a cell folds where it has to."""
    folded = [[cell] if len(cell) <= width else fold(cell, width) for cell, width in zip(cells, widths, strict=True)]
    out: list[str] = []
    for number in range(max(map(len, folded))):
        texts = [lines[number] if number < len(lines) else "" for lines in folded]
        set_out = [
            f"{t:<{w}}" if k in left else f"{t:>{w}}" for k, (t, w) in enumerate(zip(texts, widths, strict=True))
        ]
        out.append(f" {(' ' * gap).join(set_out)}".rstrip())
    return out


def _stacked(header: Sequence[str], groups: Sequence[tuple[str, Rows]], width: int) -> list[str]:
    """Rows one below the other: the first cell, then the others with their headers."""
    out: list[str] = []
    for heading, rows in groups:
        out += [f" {line}" for line in fold(heading, width - 1)] if heading else []
        for row in rows:
            out += [f" {line}" for line in fold(f"{header[0]} {row[0]}".strip(), width - 1)]
            named = [(f"   {name}", cell) for name, cell in zip(header[1:], row[1:], strict=True) if cell]
            out += lay_out_facts(named, width)
    return out
