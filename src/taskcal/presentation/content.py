"""What a report is made of: sections of short texts, tables, figures and commands."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:
    import plotly.graph_objects as go


@dataclass(frozen=True, kw_only=True)
class Table:
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

    @classmethod
    def of_rows(
        cls,
        title: str,
        header: tuple[str, ...],
        rows: list[tuple[str, ...]],
        *,
        text_columns: tuple[int, ...] = (0,),
        note: str = "",
        folded: bool = False,
    ) -> "Table":
        """A table without groups."""
        return cls(
            title=title,
            header=header,
            groups=(("", tuple(rows)),),
            text_columns=text_columns,
            note=note,
            folded=folded,
        )

    @property
    def rows(self) -> tuple[tuple[str, ...], ...]:
        """Those of all groups, without the headings."""
        return tuple(row for _, rows in self.groups for row in rows)

    def __len__(self) -> int:
        return sum(len(rows) for _, rows in self.groups)


@dataclass(frozen=True)
class Text:
    """Paragraphs."""

    kind: ClassVar[str] = "text"
    paragraphs: tuple[str, ...]


@dataclass(frozen=True)
class Points:
    """A list of short statements."""

    kind: ClassVar[str] = "points"
    items: tuple[str, ...]


@dataclass(frozen=True)
class Numbers:
    """A few numbers to remember, each with its unit and what it is."""

    kind: ClassVar[str] = "numbers"
    items: tuple[tuple[str, str, str], ...]


@dataclass(frozen=True)
class Commands:
    """Lines to type into a terminal."""

    kind: ClassVar[str] = "commands"
    lines: str


@dataclass(frozen=True, eq=False, kw_only=True)
class Chart:
    """A figure, and how to read it."""

    kind: ClassVar[str] = "chart"
    title: str
    figure: "go.Figure"
    note: str = ""


Block = Table | Text | Points | Numbers | Commands | Chart


@dataclass(frozen=True, eq=False, kw_only=True)
class Section:
    """A part of a report."""

    title: str
    blocks: tuple[Block, ...]
