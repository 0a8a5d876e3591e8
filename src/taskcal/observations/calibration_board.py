"""Printed calibration boards: the corners of each kind in the board's frame, and the files that describe boards.

The frame of a board: x to the right along its columns, y down along its rows, z into the board, as a camera in front of it
has its axes. Its origin is the outer corner of the first square, of the first tag, or the centre of the first dot.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
import tomli_w
from jaxtyping import Bool, Float, Int
from pydantic import Field, ValidationError, model_validator

from taskcal.errors import FileError, UnknownName, WrongValue
from taskcal.io.toml_file import Positive, Section, explain, read_toml
from taskcal.short_repr import short_repr

UNMEASURED_SCALE = 5e-3
"""Relative standard uncertainty of a print that nobody measured: paper and an office printer differ by a few tenths of a
per cent; a print that was fitted to the page is off by some per cent, which only a ruler on it shows."""

MAX_SCALE_ERROR = 0.1
"""By which a measured length may differ from the drawn one; a print fitted to a page differs by 3 to 6 %."""

MAX_COUNT = 200
"""Columns, or rows."""


class MarkerFamily(NamedTuple):
    """A dictionary of square markers, as OpenCV has them."""

    bits: int
    """Along one edge, without the black border."""
    size: int
    """Number of markers."""
    half_turn: bool = False
    """Whether OpenCV has its markers upside down: those of AprilTag."""


DICTIONARIES: Mapping[str, MarkerFamily] = MappingProxyType(
    {
        **{f"{bits}X{bits}_{n}": MarkerFamily(bits, n) for bits in (4, 5, 6, 7) for n in (50, 100, 250, 1000)},
        "ARUCO_ORIGINAL": MarkerFamily(5, 1024),
        "ARUCO_MIP_36h12": MarkerFamily(6, 250),
        "APRILTAG_16h5": MarkerFamily(4, 30, half_turn=True),
        "APRILTAG_25h9": MarkerFamily(5, 35, half_turn=True),
        "APRILTAG_36h10": MarkerFamily(6, 2320, half_turn=True),
        "APRILTAG_36h11": MarkerFamily(6, 587, half_turn=True),
    }
)
"""OpenCV's predefined dictionaries, without the prefix DICT_."""


def dictionary_name(text: str) -> str:
    """Name of a dictionary, in OpenCV's spelling, from `DICT_6X6_250`, `6x6_250`, `tag36h11` and the like.

    Raises:
        UnknownName: there is none such.
    """
    plain = re.sub(r"^(DICT_)?(APRIL)?TAG_?(?=\d)", "APRILTAG_", text.strip().upper()).removeprefix("DICT_")
    plain = f"APRILTAG_{plain}" if re.fullmatch(r"\d+H\d+", plain) else plain
    found = next((name for name in DICTIONARIES if name.upper() == plain), None)
    if found is None:
        raise UnknownName("dictionary of markers", text, DICTIONARIES)
    return found


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Board:
    """A plane pattern whose corners a camera finds."""

    name: str = "board"
    kind: Literal["charuco", "aprilgrid", "checkerboard", "circles", "asymmetric_circles"]
    columns: int
    """Squares, tags, or dots in a row."""
    rows: int
    square_m: float
    """As drawn, metres: edge of a square; from tag to tag; from dot to dot; of asymmetric circles from row to row."""
    marker_m: float = 0.0
    """As drawn, metres: outer edge of a marker, with its black border; diameter of a dot; 0 on a checkerboard."""
    dictionary: str = ""
    """One of `DICTIONARIES`; empty without markers."""
    first_marker: int = 0
    """Number of the first marker; the others follow."""
    legacy: bool = False
    """ChArUco as before OpenCV 4.6: with an even number of rows, the first square is white and has a marker."""
    border_bits: int = 1
    """Width of a marker's black border, in bits."""
    big_dot: tuple[int, int] | None = None
    """Column and row of the larger dot of a grid of circles, counted from 0."""
    big_dot_m: float = 0.0
    """Its diameter, metres."""
    scale: float = 1.0
    """Length of the print over that of the drawing, as measured."""
    u_scale: float = UNMEASURED_SCALE
    """Relative standard uncertainty of it."""
    bend_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Heights of a simulated board at `bend_terms`, metres; of a real one images tell them."""

    def corners(self) -> Float[np.ndarray, "m 3"]:
        """Corners, or centres of dots, in the board's frame, of the size that was measured, metres."""
        return self.raised(self.drawn_corners())

    def raised(self, drawn: Float[np.ndarray, "k 2"]) -> Float[np.ndarray, "k 3"]:
        """Places of the drawing in the board's frame, metres."""
        height = (
            bend_terms(drawn, self.drawn_corners()) @ np.array(self.bend_m)
            if any(self.bend_m)
            else np.zeros(len(drawn))
        )
        return np.column_stack([self.scale * drawn, height])

    def drawn_corners(self) -> Float[np.ndarray, "m 2"]:
        """X and y of the corners in the drawing, metres."""
        return KINDS[self.kind].corners(self)

    def ids(self) -> Int[np.ndarray, " m"]:
        """Number of each corner, as OpenCV counts.

        Those of squares and dots are counted row by row; the four of a tag are four times the tag's number, and 0 to 3 in the
        order in which OpenCV finds them.
        """
        ids = np.arange(len(self.drawn_corners()))
        return ids + 4 * self.first_marker if self.kind == "aprilgrid" else ids

    @property
    def markers(self) -> int:
        """How many markers it has."""
        return KINDS[self.kind].markers(self)

    def marker_cells(self) -> Int[np.ndarray, "markers 2"]:
        """Column and row of each marker, in the order of their numbers."""
        if self.kind == "aprilgrid":  # counted from the lower left one, as Kalibr does
            return _grid(self.columns, self.rows) * [1, -1] + [0, self.rows - 1]
        return (
            _grid(self.columns, self.rows)[~self.black_squares().reshape(-1)] if self.markers else np.zeros((0, 2), int)
        )

    def black_squares(self) -> Bool[np.ndarray, "rows columns"]:
        """Which squares of a chessboard are black; the first one, but for the old layout."""
        first_is_white = self.legacy and self.rows % 2 == 0
        return (np.arange(self.rows)[:, None] + np.arange(self.columns)) % 2 == int(first_is_white)

    @property
    def same_after_half_turn(self) -> bool:
        """Whether nothing on it tells which way up it is."""
        return KINDS[self.kind].same_after_half_turn(self)


def bend_terms(plane: Float[np.ndarray, "m 2"], whole: Float[np.ndarray, "k 2"]) -> Float[np.ndarray, "m 3"]:
    """X², x·y and y² of places on a board, from −1 to 1 over the larger side of its corners.

    Args:
        plane: the places, metres.
        whole: all corners of the board.
    """
    low, high = whole.min(axis=0), whole.max(axis=0)
    x, y = ((plane - 0.5 * (low + high)) / (0.5 * float((high - low).max()))).T
    return np.column_stack([x * x, x * y, y * y])


def _grid(columns: int, rows: int) -> Int[np.ndarray, "m 2"]:
    """Column and row, row by row."""
    row, column = np.divmod(np.arange(columns * rows), columns)
    return np.column_stack([column, row])


# The kinds of board.


@dataclass(frozen=True, kw_only=True)
class BoardKind:
    """What is particular to a kind of board."""

    corners: Callable[[Board], Float[np.ndarray, "m 2"]]
    """In the drawing, metres."""
    markers: Callable[[Board], int] = lambda _: 0
    same_after_half_turn: Callable[[Board], bool] = lambda _: False
    smallest: int
    """Columns and rows that it has at least, so that OpenCV finds it."""
    needed: tuple[str, ...] = ()
    """Keys that a file states for it, beside its counts and `square_mm`."""
    allowed: tuple[str, ...] = ()
    """Keys that a file may state for it."""
    largest_marker: float = 1.0
    """Over `square_mm`, which it does not reach."""


def _inner_corners(board: Board) -> Float[np.ndarray, "m 2"]:
    return board.square_m * (1.0 + _grid(board.columns - 1, board.rows - 1))


def _tag_corners(board: Board) -> Float[np.ndarray, "m 2"]:
    around = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    if DICTIONARIES[board.dictionary].half_turn:
        around = np.roll(around, -2, axis=0)  # the tag is drawn upright, and OpenCV counts from its lower right corner
    return (board.square_m * board.marker_cells()[:, None] + board.marker_m * around).reshape(-1, 2)


def _dots(board: Board) -> Float[np.ndarray, "m 2"]:
    return board.square_m * _grid(board.columns, board.rows)


def _staggered_dots(board: Board) -> Float[np.ndarray, "m 2"]:
    column, row = _grid(board.columns, board.rows).T
    return board.square_m * np.column_stack([2 * column + row % 2, row])


def _without_big_dot(board: Board) -> bool:
    """Whether no dot is larger, or the one in the middle is."""
    return board.big_dot is None or board.big_dot == ((board.columns - 1) / 2, (board.rows - 1) / 2)


KINDS: Mapping[str, BoardKind] = MappingProxyType(
    {
        "charuco": BoardKind(
            corners=_inner_corners,
            markers=lambda board: int((~board.black_squares()).sum()),
            smallest=3,
            needed=("marker_mm", "dictionary"),
            allowed=("legacy", "first_marker"),
        ),
        "aprilgrid": BoardKind(
            corners=_tag_corners,
            markers=lambda board: board.columns * board.rows,
            smallest=1,
            needed=("marker_mm", "dictionary"),
            allowed=("first_marker", "border_bits"),
        ),
        "checkerboard": BoardKind(
            corners=_inner_corners,
            same_after_half_turn=lambda board: (board.columns + board.rows) % 2 == 0,
            smallest=4,
        ),
        "circles": BoardKind(
            corners=_dots,
            same_after_half_turn=_without_big_dot,
            smallest=3,
            needed=("marker_mm",),
            allowed=("big_dot", "big_dot_mm"),
        ),
        "asymmetric_circles": BoardKind(
            corners=_staggered_dots,
            same_after_half_turn=lambda board: board.rows % 2 == 0 and _without_big_dot(board),
            smallest=3,
            needed=("marker_mm",),
            allowed=("big_dot", "big_dot_mm"),
            largest_marker=2**0.5,
        ),
    }
)


# Files of boards.

Count = Annotated[int, Field(strict=True, ge=1, le=MAX_COUNT)]
Square = Annotated[float, Field(strict=True, ge=0.5, le=1000.0, allow_inf_nan=False)]
"""Millimetres: squares of boards have 1 to 200, and those in metres are below the first bound."""


class MeasuredSection(Section):
    """What a ruler showed on the print."""

    drawn_mm: Positive = 100.0
    length_mm: Positive
    u_mm: Positive

    @model_validator(mode="after")
    def _consistent(self) -> "MeasuredSection":
        if abs(self.length_mm / self.drawn_mm - 1.0) > MAX_SCALE_ERROR:
            raise ValueError(
                f"a length of {self.length_mm:g} mm was drawn as {self.drawn_mm:g} mm; give in drawn_mm what the same length "
                "has in the drawing"
            )
        return self


class BoardSection(Section):
    """A board of a file."""

    name: str = Field(default="board", pattern=r"^[A-Za-z][A-Za-z0-9_]*$")
    kind: Literal["charuco", "aprilgrid", "checkerboard", "circles", "asymmetric_circles"]
    columns: Count
    rows: Count
    square_mm: Square
    marker_mm: Square | None = None
    dictionary: str | None = None
    first_marker: Annotated[int, Field(strict=True, ge=0, le=10_000)] = 0
    legacy: Annotated[bool, Field(strict=True)] = False
    border_bits: Literal[1, 2] = 2
    big_dot: tuple[Annotated[int, Field(strict=True, ge=0)], Annotated[int, Field(strict=True, ge=0)]] | None = None
    big_dot_mm: Square | None = None
    measured: MeasuredSection | None = None

    @model_validator(mode="after")
    def _consistent(self) -> "BoardSection":
        kind = KINDS[self.kind]
        for key in kind.needed:
            if getattr(self, key) is None:
                raise ValueError(f"{self.kind} needs {' and '.join(kind.needed)}; {key} is missing")
        own = {key for one in KINDS.values() for key in (*one.needed, *one.allowed)}
        for key in sorted((self.model_fields_set & own) - {*kind.needed, *kind.allowed}):
            raise ValueError(f"{self.kind} has no {key}; leave it out, or correct kind")
        if min(self.columns, self.rows) < kind.smallest:
            raise ValueError(
                f"{self.columns} columns and {self.rows} rows are too few; {self.kind} has {kind.smallest} or more of each"
            )
        self._see_sizes(kind)
        self._see_markers(kind)
        return self

    def _see_sizes(self, kind: BoardKind) -> None:
        """See that markers and dots do not touch each other."""
        largest = kind.largest_marker * self.square_mm
        for key, value in (("marker_mm", self.marker_mm), ("big_dot_mm", self.big_dot_mm)):
            if value is not None and value >= largest:
                raise ValueError(f"{key} = {value:g} does not fit between neighbours; it must be below {largest:.4g}")
        if (self.big_dot is None) != (self.big_dot_mm is None):
            raise ValueError("give big_dot and big_dot_mm, or neither")
        if self.big_dot is not None and (self.big_dot[0] >= self.columns or self.big_dot[1] >= self.rows):
            raise ValueError(
                f"big_dot = {list(self.big_dot)} is not on the board; its column is 0 to {self.columns - 1}, its row 0 to "
                f"{self.rows - 1}"
            )
        if self.big_dot_mm is not None and self.marker_mm is not None and self.big_dot_mm <= self.marker_mm:
            raise ValueError(f"big_dot_mm = {self.big_dot_mm:g} is not larger than marker_mm = {self.marker_mm:g}")

    def _see_markers(self, kind: BoardKind) -> None:
        """See that the dictionary has as many markers."""
        if self.dictionary is None:
            return
        try:
            name = dictionary_name(self.dictionary)
        except UnknownName as error:
            raise ValueError(f"dictionary: {error}") from error
        last, count = self.first_marker + self.board().markers - 1, DICTIONARIES[name].size
        if last >= count:
            raise ValueError(
                f"its markers have the numbers {self.first_marker} to {last}, but {name} ends at {count - 1}; take a larger "
                "dictionary, or check columns, rows and first_marker"
            )

    def board(self) -> Board:
        """The board it describes."""
        found = self.measured
        return Board(
            name=self.name,
            kind=self.kind,
            columns=self.columns,
            rows=self.rows,
            square_m=self.square_mm * 1e-3,
            marker_m=(self.marker_mm or 0.0) * 1e-3,
            dictionary="" if self.dictionary is None else dictionary_name(self.dictionary),
            first_marker=self.first_marker,
            legacy=self.legacy,
            border_bits=self.border_bits if self.kind == "aprilgrid" else 1,
            big_dot=self.big_dot,
            big_dot_m=(self.big_dot_mm or 0.0) * 1e-3,
            scale=1.0 if found is None else found.length_mm / found.drawn_mm,
            u_scale=UNMEASURED_SCALE if found is None else found.u_mm / found.length_mm,
        )


class BoardFile(Section):
    """A file of boards."""

    board: tuple[BoardSection, ...] = Field(min_length=1, max_length=20)


def describe_board(keys: Mapping[str, Any]) -> Board:
    """A board from the keys of a file's entry.

    Raises:
        WrongValue: they do not describe one; the message names key and value.
    """
    try:
        return BoardSection.model_validate(keys).board()
    except ValidationError as error:
        raise WrongValue(explain(error, BoardSection)) from error


def board_text(keys: Mapping[str, Any]) -> str:
    """The file of one board."""
    return tomli_w.dumps({"board": [dict(keys)]})


def read_boards(path: str | Path) -> tuple[Board, ...]:
    """Read the boards of a file, or of all files of a folder.

    Raises:
        FileError: it is missing, no TOML, or does not describe boards; or two of its boards cannot be told apart.
    """
    path = Path(path)
    files = sorted(path.glob("*.toml")) if path.is_dir() else [path]
    if not files:
        raise FileError(path, "has no files of boards; name a file, or a folder with files such as floor.toml")
    boards = tuple(section.board() for file in files for section in read_toml(file, BoardFile).board)
    for k, one in enumerate(boards):
        for other in boards[:k]:
            if one.name == other.name:
                raise FileError(path, f"two boards are named '{one.name}'; give each its own name")
            if _look_alike(one, other):
                raise FileError(
                    path,
                    f"the boards '{other.name}' and '{one.name}' cannot be told apart in an image: "
                    + (
                        "they share markers; give the second another first_marker or dictionary"
                        if one.dictionary
                        else "give one other columns or rows, or markers"
                    ),
                )
    return boards


def _look_alike(one: Board, other: Board) -> bool:
    """Whether two boards share markers, or have none and the same grid."""
    if one.dictionary and other.dictionary:
        first, end = max(one.first_marker, other.first_marker), min(b.first_marker + b.markers for b in (one, other))
        return _family(one.dictionary) == _family(other.dictionary) and first < end
    return not one.dictionary and (one.kind, {one.columns, one.rows}) == (other.kind, {other.columns, other.rows})


def _family(dictionary: str) -> str:
    """Those of one size begin with the same markers: 6X6_50 is the beginning of 6X6_250."""
    return dictionary.partition("_")[0] if dictionary[0].isdigit() else dictionary
