"""Content of a report: sections of short texts, tables, figures and commands."""

import math
import re
import textwrap
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from taskcal_groundwork.said import Said, numeral

if TYPE_CHECKING:
    from taskcal.identification.calibration import Calibration
    from taskcal.report.chart import Figure


@dataclass(frozen=True)
class Column:
    """A column of a table, declared once for page, terminal and studio."""

    label: str
    value: str | Callable[[Any], object]
    """Key of a row that is a mapping, attribute of any other, or a function of the row."""
    form: str = ""
    """Format of its numbers; a column of words has none, and is set flush left."""
    factor: float = 1.0
    """From the unit of the rows to that of the label."""
    optional: bool = False
    """Whether it is left out where no row has a value, or only empty words."""

    def of(self, row: Any) -> Any:
        """The value in a row; None where it has none."""
        if callable(self.value):
            return self.value(row)
        return row.get(self.value) if isinstance(row, Mapping) else getattr(row, self.value)  # pyright: ignore[reportUnknownMemberType, reportUnknownVariableType]

    def cell(self, row: Any) -> str:
        """The value in a row as text; a number as one that is said, so that a page has it with the comma of its language."""
        value = self.of(row)
        if value is None or (isinstance(value, float) and not math.isfinite(value)):
            return "–"
        if not self.form or isinstance(value, str):
            return value if isinstance(value, str) else str(value)
        size = value if self.factor == 1.0 else value * self.factor
        if self.form.endswith("f") and float(format(size, self.form)) == 0.0:  # zero has no sign
            return numeral(0.0, self.form.lstrip("+"))
        return numeral(size, self.form)


def millimetres(label: str, value: str | Callable[[Any], object], form: str = ".3f") -> Column:
    """A column of lengths in metres."""
    return Column(label, value, form, 1e3)


@dataclass(frozen=True, kw_only=True)
class TextTable:
    """A table of texts, the same on paper and in a terminal."""

    kind: ClassVar[str] = "table"
    title: str
    header: tuple[str, ...]
    groups: tuple[tuple[str, tuple[tuple[str, ...], ...]], ...]
    """Rows in groups; each group has a heading over its rows, or none where that is empty."""
    text_columns: tuple[int, ...] = (0,)
    """Columns of words, set flush left; the others are numbers."""
    note: str = ""
    """What the table shows."""
    folded: bool = False
    """Whether a page shows it only on demand."""
    spare: tuple[str, ...] = ()
    """Headers of columns that a terminal leaves out where it is too narrow, those that go first at the front."""

    @classmethod
    def of(
        cls,
        title: str,
        columns: Iterable[Column],
        rows: Iterable[Any] | Mapping[str, Iterable[Any]],
        *,
        note: str = "",
        folded: bool = False,
        spare: tuple[str, ...] = (),
    ) -> "TextTable":
        """A table of columns, each of which takes its value from every row.

        Args:
            title: of the table.
            columns: from left to right.
            rows: of the table, or of its groups by their headings.
            note: what it shows.
            folded: whether a page shows it only on demand.
            spare: headers that a terminal leaves out where it is too narrow.
        """
        by_heading = rows if isinstance(rows, Mapping) else {"": rows}
        groups = {heading: list(group) for heading, group in by_heading.items()}
        every = [row for group in groups.values() for row in group]
        shown = [c for c in columns if not c.optional or not every or any(c.of(row) not in (None, "") for row in every)]
        return cls(
            title=title,
            header=tuple(column.label for column in shown),
            groups=tuple(
                (heading, tuple(tuple(column.cell(row) for column in shown) for row in group))
                for heading, group in groups.items()
            ),
            text_columns=tuple(k for k, column in enumerate(shown) if not column.form),
            note=note,
            folded=folded,
            spare=spare,
        )

    @classmethod
    def of_rows(
        cls,
        title: str,
        header: tuple[str, ...],
        rows: Iterable[tuple[str, ...]],
        *,
        text_columns: tuple[int, ...] = (0,),
        note: str = "",
        folded: bool = False,
    ) -> "TextTable":
        """A table of texts without groups."""
        groups = (("", tuple(rows)),)
        return cls(title=title, header=header, groups=groups, text_columns=text_columns, note=note, folded=folded)

    @property
    def rows(self) -> tuple[tuple[str, ...], ...]:
        """Rows of all groups, without the headings."""
        return tuple(row for _, rows in self.groups for row in rows)

    def __len__(self) -> int:
        return len(self.rows)


@dataclass(frozen=True)
class Text:
    """A paragraph."""

    kind: ClassVar[str] = "text"
    words: str
    leads: bool = False
    """Whether it says what the section is about, and is set larger."""


@dataclass(frozen=True, init=False)
class Bullets:
    """A list of short statements."""

    kind: ClassVar[str] = "points"
    items: tuple[str, ...]

    def __init__(self, *items: str) -> None:
        object.__setattr__(self, "items", items)


@dataclass(frozen=True, init=False)
class Numbers:
    """A few numbers to remember, each with its unit and what it is."""

    kind: ClassVar[str] = "numbers"
    items: tuple[tuple[str, str, str], ...]

    def __init__(self, *items: tuple[str, str, str] | None) -> None:
        """Take numbers; what is None is left out."""
        object.__setattr__(self, "items", tuple(item for item in items if item is not None))


@dataclass(frozen=True, init=False)
class Facts:
    """Labelled statements."""

    kind: ClassVar[str] = "facts"
    items: tuple[tuple[str, str], ...]
    """Label and text."""

    def __init__(self, *items: tuple[str, str] | None) -> None:
        """Take statements; what is None is left out."""
        object.__setattr__(self, "items", tuple(item for item in items if item is not None))


@dataclass(frozen=True)
class NextStep:
    """What to do next."""

    kind: ClassVar[str] = "step"
    words: str
    about: str = ""
    """What it is about, by which a page leads to where it is done."""


@dataclass(frozen=True)
class Commands:
    """Lines to type into a terminal."""

    kind: ClassVar[str] = "commands"
    lines: str


@dataclass(frozen=True, eq=False)
class Chart:
    """A figure, and how to read it."""

    kind: ClassVar[str] = "chart"
    title: str
    figure: "Figure | Mapping[str, Figure]"
    """Or views of it by their labels, of which a page shows the first, and the others on demand."""
    note: str = ""


@dataclass(frozen=True, eq=False, kw_only=True)
class Viewer:
    """A figure in space that is turned with the mouse, and how to read it. All lengths are millimetres."""

    kind: ClassVar[str] = "scene"
    title: str
    poses: tuple[Mapping[str, Any], ...] = ()
    """A robot at some poses, as `robot_scene.draw_robot` has them; one is shown at a time."""
    look: Mapping[str, Any] | None = None
    """Radii and colours of the robot's parts, as `scene.robot_look` has them."""
    layers: tuple[Mapping[str, Any], ...] = ()
    """Strokes, arrows, points and markers, each with a label and a colour."""
    shown: int = 0
    """Number of the pose that is shown first."""
    scale: float | None = None
    """Times that arrows are drawn longer than they are at first; None where there are no arrows."""
    floor: bool = False
    """Whether a grid at height zero and the axes of the base are drawn."""
    note: str = ""

    @property
    def scale_decades(self) -> float:
        """Initial position of the slider."""
        return math.log10(self.scale or 1.0)

    def content(self) -> dict[str, Any]:
        """Content that the page draws."""
        return {
            "poses": self.poses,
            "look": self.look,
            "layers": self.layers,
            "shown": self.shown,
            "scale": None if self.scale is None else {"start": self.scale},
            "floor": self.floor,
        }


Block = TextTable | Text | Bullets | Numbers | Facts | NextStep | Commands | Chart | Viewer


@dataclass(frozen=True, eq=False, init=False)
class Section:
    """A part of a report."""

    title: str
    blocks: tuple[Block, ...]

    def __init__(self, title: str, *blocks: Block | str | None) -> None:
        """Put a section together.

        Args:
            title: of the section.
            blocks: in order; words alone are a paragraph, and what is None, or a table without rows, is left out.
        """
        object.__setattr__(self, "title", title)
        made = (Text(block) if isinstance(block, str) else block for block in blocks if block is not None)
        object.__setattr__(self, "blocks", tuple(one for one in made if not isinstance(one, TextTable) or len(one)))


# Tables and labelled lines as text of a given width, in which no word and no number is ever broken.
#
# A table that is too wide first folds its header, then its columns of words, between words; then it is turned on
# its side, where it has few rows; then it leaves out columns that it can do without, and names them; else its rows
# stand one below the other, cell by cell. A single word that is wider than the line stays whole.

MAX_TRANSPOSED_ROWS = 4
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
    if 0 < len(rows) <= MAX_TRANSPOSED_ROWS and len(groups) == 1:
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


# The unit of short lengths on a page: one of them throughout.


@dataclass(frozen=True)
class LengthUnit:
    """Millimetres or micrometres, and the digits that are worth reading."""

    name: str
    factor: float
    """From metres."""
    digits: int
    """Behind the point: a tenth of a micrometre for what was computed, a micrometre for what was measured."""


MILLIMETRES = LengthUnit("mm", 1e3, 3)
MICROMETRES = LengthUnit("µm", 1e6, 1)


# Numbers with as many digits as they are worth.

DIGITS = 2
"""Of an uncertainty that are worth stating (GUM:2008, 7.2.6)."""


def decimals_of(uncertainty: float) -> int:
    """Digits behind the point that an uncertainty leaves worth stating."""
    if not 0.0 < uncertainty < math.inf:
        return 4
    return min(max(DIGITS - 1 - math.floor(math.log10(uncertainty)), 0), 9)


def moment(written: str) -> str:
    """A time of ISO 8601 as a page's language has it, to the minute; any other text as it is."""
    found = re.match(r"(\d{4})-(\d\d)-(\d\d)T(\d\d:\d\d)(?::[\d.]+)?(Z|[+-]\d\d:\d\d)?$", written)
    if found is None:
        return written
    year, month, day, time, zone = found.groups("")
    zone = " UTC" if zone in ("Z", "+00:00") else f" {zone}" if zone else ""
    return Said("{year}-{month}-{day} {time}{zone}", year=year, month=month, day=day, time=time, zone=zone)


class WithMinus(float):
    """A number whose sign is a minus, not a hyphen."""

    def __format__(self, form: str) -> str:
        return super().__format__(form).replace("-", "−")


def signed(value: float, digits: int) -> Said:
    """A number with its sign; nothing has none."""
    if not float(f"{value:.{digits}f}"):
        return numeral(0.0, f".{digits}f")
    return numeral(WithMinus(value), f"+.{digits}f")


# Models and their uncertainty in words.

NOMINAL: str = Said("nominal (registered)")
"""The nominal model, with tracker frame and targets fitted to the measurements."""

CALIBRATED: str = Said("calibrated")


def model_error_origin(calibration: "Calibration") -> Said:
    """Whether the model error was given, estimated, or is not significant."""
    if calibration.provenance.options.get("model_error", "estimate") != "estimate":
        return Said("as given")
    if not any(calibration.model_error):
        return Said("not significant (below tracker noise)")
    if calibration.model.effects:
        return Said("residuals of geometry and effects beyond tracker noise")
    return Said("residuals of geometry beyond tracker noise")


def state_model_error(millimetres: float, origin: str, milliradians: float | None = None) -> Said:
    """State the model error on which a plan, a study or a choice of parameters is based, and its origin."""
    size = Said("{error:.3g} mm", error=millimetres)
    if milliradians is not None:
        size = Said("{size} and {turn:.3g} mrad", size=size, turn=milliradians)
    return Said("{size} per axis at every pose: {origin}", size=size, origin=origin)


def describe_effective(identified: str, effective: float | None, groups: int | None) -> str:
    """State how many parameters the rows determine, after their number, where that is known.

    Args:
        identified: the number, in words.
        effective: number of effective parameters.
        groups: of parameters whose size was estimated.
    """
    if effective is None:
        return identified
    if groups == 1:
        identified = Said("{identified}, with one estimated prior scale", identified=identified)
    elif groups is not None:
        identified = Said(
            "{identified}, in {groups} groups with an estimated size each", identified=identified, groups=groups
        )
    return Said("{identified}: {effective:.1f} effective parameters", identified=identified, effective=effective)


def prior_scale_origin(calibration: "Calibration") -> str:
    """An addition to the prior's scale: whether it was given."""
    return Said("as given") if calibration.provenance.options.get("prior_scale", "estimate") != "estimate" else ""
