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
from pydantic import Field

from taskcal.errors import FileError, TaskcalError, UnknownName, WrongValue
from taskcal.io.codec import NOT_IN_FILE, InFile, decode, read_brief
from taskcal.io.toml_file import Positive
from taskcal.short_repr import short_repr

UNMEASURED_SCALE = 5e-3
"""Relative standard uncertainty of a print that nobody measured: paper and an office printer differ by a few tenths of a
per cent; a print that was fitted to the page is off by some per cent, which only a ruler on it shows."""

MAX_SCALE_ERROR = 0.1
"""By which a measured length may differ from the drawn one; a print fitted to a page differs by 3 to 6 %."""

LARGEST_BIG_DOT = 1.25
"""Diameter over the distance of neighbours; from 1.41 on it would cover the middle of four."""

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


@dataclass(frozen=True, kw_only=True)
class Ruler:
    """What a ruler showed on the print, millimetres."""

    drawn_mm: Positive = 100.0
    """The same length in the drawing."""
    length_mm: Positive
    u_mm: Positive

    @staticmethod
    def check_stated(stated: Mapping[str, Any]) -> None:
        """See that the print is about as large as its drawing."""
        drawn, length = stated.get("drawn_mm", Ruler.drawn_mm), stated["length_mm"]
        if abs(length / drawn - 1.0) > MAX_SCALE_ERROR:
            raise ValueError(
                f"a length of {length:g} mm was drawn as {drawn:g} mm; give in drawn_mm what the same length has in the drawing"
            )


Count = Annotated[int, Field(strict=True, ge=1, le=MAX_COUNT)]
Square = Annotated[float, Field(strict=True, ge=0.5, le=1000.0, allow_inf_nan=False)]
"""Millimetres in files: squares of boards have 1 to 200, and those in metres are below the first bound."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Board:
    """A plane pattern whose corners a camera finds."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")] = "board"
    kind: Literal["charuco", "aprilgrid", "checkerboard", "circles", "asymmetric_circles"]
    columns: Count
    """Squares, tags, or dots in a row."""
    rows: Count
    square_m: Annotated[Square, InFile(key="square_mm", unit="mm")]
    """As drawn, metres: edge of a square; from tag to tag; from dot to dot; of asymmetric circles from row to row."""
    marker_m: Annotated[Square, InFile(key="marker_mm", unit="mm")] = 0.0
    """As drawn, metres: outer edge of a marker, with its black border; diameter of a dot; 0 on a checkerboard."""
    dictionary: Annotated[str, InFile(read=lambda _, text: dictionary_name(text))] = ""
    """One of `DICTIONARIES`; empty without markers."""
    first_marker: Annotated[int, Field(strict=True, ge=0, le=10_000)] = 0
    """Number of the first marker; the others follow."""
    legacy: bool = False
    """ChArUco as before OpenCV 4.6: with an even number of rows, the first square is white and has a marker."""
    border_bits: Literal[1, 2] | None = None
    """Width of a marker's black border, in bits; None for that of the kind."""
    big_dot: tuple[int, int] | None = None
    """Column and row of the larger dot of a grid of circles, counted from 0."""
    big_dot_m: Annotated[Square, InFile(key="big_dot_mm", unit="mm")] = 0.0
    """Its diameter, metres."""
    measured: Ruler | None = None
    """None where nobody measured the print."""
    bend_m: Annotated[tuple[float, float, float], NOT_IN_FILE] = (0.0, 0.0, 0.0)
    """Heights of a simulated board at `bend_terms`, metres; of a real one images tell them."""

    @staticmethod
    def check_stated(stated: Mapping[str, Any]) -> None:
        """See that a file states what the kind of board needs, and no more, and that it goes together."""
        name = stated["kind"]
        kind, columns, rows = KINDS[name], stated["columns"], stated["rows"]
        for key in kind.needed:
            if key not in stated:
                raise ValueError(f"{name} needs {' and '.join(kind.needed)}; {key} is missing")
        own = {key for one in KINDS.values() for key in (*one.needed, *one.allowed)}
        for key in sorted((stated.keys() & own) - {*kind.needed, *kind.allowed}):
            raise ValueError(f"{name} has no {key}; leave it out, or correct kind")
        if min(columns, rows) < kind.smallest:
            raise ValueError(
                f"{columns} columns and {rows} rows are too few; {name} has {kind.smallest} or more of each"
            )
        _see_sizes(stated, kind)
        _see_markers(stated)

    @property
    def scale(self) -> float:
        """Length of the print over that of the drawing, as measured."""
        return 1.0 if self.measured is None else self.measured.length_mm / self.measured.drawn_mm

    @property
    def u_scale(self) -> float:
        """Relative standard uncertainty of it."""
        return UNMEASURED_SCALE if self.measured is None else self.measured.u_mm / self.measured.length_mm

    @property
    def border(self) -> int:
        """Width of a marker's black border, in bits."""
        return self.border_bits or KINDS[self.kind].border_bits

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
    border_bits: int = 1
    """Width of its markers' black border, as usual."""
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
            border_bits=2,
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


def _see_sizes(stated: Mapping[str, Any], kind: BoardKind) -> None:
    """See that markers and dots do not touch each other."""
    largest, marker = kind.largest_marker * stated["square_mm"], stated.get("marker_mm", 0.0)
    # the larger dot is alone between smaller ones, and leaves ground in the middle of four, by which it is measured
    beside_others = min(2.0 * largest - marker, LARGEST_BIG_DOT * largest)
    for key, most in (("marker_mm", largest), ("big_dot_mm", beside_others)):
        if key in stated and stated[key] >= most:
            raise ValueError(f"{key} = {stated[key]:g} does not fit between neighbours; it must be below {most:.4g}")
    if ("big_dot" in stated) != ("big_dot_mm" in stated):
        raise ValueError("give big_dot and big_dot_mm, or neither")
    if "big_dot" not in stated:
        return
    (column, row), columns, rows = stated["big_dot"], stated["columns"], stated["rows"]
    if column >= columns or row >= rows:
        raise ValueError(
            f"big_dot = {[column, row]} is not on the board; its column is 0 to {columns - 1}, its row 0 to {rows - 1}"
        )
    if stated["big_dot_mm"] <= marker:
        raise ValueError(f"big_dot_mm = {stated['big_dot_mm']:g} is not larger than marker_mm = {marker:g}")


def _see_markers(stated: Mapping[str, Any]) -> None:
    """See that the dictionary has as many markers."""
    if "dictionary" not in stated:
        return
    try:
        name = dictionary_name(stated["dictionary"])
    except UnknownName as error:
        raise ValueError(f"dictionary: {error}") from error
    layout = {key: stated[key] for key in ("kind", "columns", "rows", "legacy") if key in stated}
    first, count = stated.get("first_marker", 0), DICTIONARIES[name].size
    last = first + Board(**layout, square_m=1.0).markers - 1
    if last >= count:
        raise ValueError(
            f"its markers have the numbers {first} to {last}, but {name} ends at {count - 1}; take a larger dictionary, or check "
            "columns, rows and first_marker"
        )


@dataclass(frozen=True, kw_only=True)
class BoardFile:
    """A file of boards."""

    board: Annotated[tuple[Board, ...], Field(min_length=1, max_length=20)]


def describe_board(keys: Mapping[str, Any]) -> Board:
    """A board from the keys of a file's entry.

    Raises:
        WrongValue: they do not describe one; the message names key and value.
    """
    try:
        return decode(Board, keys, brief=True)
    except TaskcalError as error:
        raise WrongValue(str(error)) from error


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
    boards = tuple(board for file in files for board in read_brief(file, BoardFile).board)
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
