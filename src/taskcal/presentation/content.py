"""What a report is made of: sections of short texts, tables, figures and commands."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

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
    least_width: int = 0
    """CSS pixels under which a page scrolls it sideways, where it has many panels or labels."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Scene:
    """A figure in space that is turned with the mouse, and how to read it. All lengths are millimetres."""

    kind: ClassVar[str] = "scene"
    title: str
    poses: tuple[Mapping[str, Any], ...] = ()
    """A robot at some poses, as `robot_scene.draw_robot` has them; one is shown at a time."""
    radius: float = 0.0
    """Of the robot's first link."""
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
        """Where the slider stands at first."""
        return math.log10(self.scale or 1.0)

    def content(self) -> dict[str, Any]:
        """What the page draws."""
        return {
            "poses": self.poses,
            "radius": self.radius,
            "layers": self.layers,
            "shown": self.shown,
            "scale": None if self.scale is None else {"start": self.scale},
            "floor": self.floor,
        }


Block = Table | Text | Points | Numbers | Commands | Chart | Scene


@dataclass(frozen=True, eq=False, kw_only=True)
class Section:
    """A part of a report."""

    title: str
    blocks: tuple[Block, ...]
