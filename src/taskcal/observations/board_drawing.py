"""What is black on a calibration board, and its sheet for the printer: a PDF at true scale, with a ruler to check the print."""

import re
import textwrap
import zlib
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from taskcal.errors import TaskcalError, WrongValue, shown
from taskcal.observations.calibration_board import DICTIONARIES, Board
from taskcal.short_repr import short_repr

# Black squares and dots.


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Drawing:
    """Black shapes on white, x to the right and y down, metres."""

    boxes: Float[np.ndarray, "n 4"]
    """Left, top, right, bottom."""
    discs: Float[np.ndarray, "m 3"]
    """Centre and radius."""

    @property
    def outline(self) -> Float[np.ndarray, " 4"]:
        """Left, top, right, bottom of all."""
        center, radius = self.discs[:, :2], self.discs[:, 2:]
        low = np.concatenate([self.boxes[:, :2], center - radius])
        high = np.concatenate([self.boxes[:, 2:], center + radius])
        return np.concatenate([low.min(axis=0), high.max(axis=0)])


def draw_board(board: Board) -> Drawing:
    """What is black on a board, as drawn: not of the size that was measured on its print.

    Raises:
        TaskcalError: it has markers, and OpenCV, which knows their patterns, is not installed.
    """
    none, square = np.zeros((0, 4)), board.square_m
    if board.kind in ("circles", "asymmetric_circles"):
        radius = np.full(board.columns * board.rows, 0.5 * board.marker_m)
        if board.big_dot is not None:
            radius[board.big_dot[0] + board.columns * board.big_dot[1]] = 0.5 * board.big_dot_m
        return Drawing(boxes=none, discs=np.column_stack([board.drawn_corners(), radius]))
    if board.kind == "aprilgrid":
        first = square * board.marker_cells()
        gap = square - board.marker_m  # with a square in every corner of a tag, which makes it that of a chessboard
        crossings = square * np.stack(np.meshgrid(np.arange(board.columns + 1), np.arange(board.rows + 1)), axis=-1)
        boxes = [_squares(crossings.reshape(-1, 2) - gap, gap)]
    else:
        row, column = np.nonzero(board.black_squares())
        boxes = [_squares(square * np.column_stack([column, row]), square)]
        first = square * board.marker_cells() + 0.5 * (square - board.marker_m)
    for corner, black in zip(first, marker_patterns(board), strict=True):
        bit = board.marker_m / len(black)
        row, column = np.nonzero(black)
        boxes.append(_squares(corner + bit * np.column_stack([column, row]), bit))
    return Drawing(boxes=np.concatenate(boxes), discs=np.zeros((0, 3)))


def _squares(corner: Float[np.ndarray, "n 2"], size: float) -> Float[np.ndarray, "n 4"]:
    return np.concatenate([corner, corner + size], axis=1)


def marker_patterns(board: Board) -> Bool[np.ndarray, "markers bits bits"]:
    """Which bits of each marker are black, border and all.

    Raises:
        TaskcalError: it has markers, and OpenCV is not installed.
    """
    if not board.markers:
        return np.zeros((0, 1, 1), dtype=bool)
    try:
        from cv2 import aruco
    except ImportError as error:
        raise TaskcalError("the markers of a board take OpenCV: pip install 'taskcal[images]'") from error
    family = DICTIONARIES[board.dictionary]
    known = aruco.getPredefinedDictionary(getattr(aruco, f"DICT_{board.dictionary}"))
    bits = family.bits + 2 * board.border
    numbers = range(board.first_marker, board.first_marker + board.markers)
    black = np.stack([known.generateImageMarker(k, bits, borderBits=board.border) == 0 for k in numbers])
    return black[:, ::-1, ::-1] if board.kind == "aprilgrid" and family.half_turn else black


# A sheet of paper with a board.

PAGES_MM = {
    "A4": (210.0, 297.0),
    "letter": (215.9, 279.4),
    "A3": (297.0, 420.0),
    "tabloid": (279.4, 431.8),
    "A2": (420.0, 594.0),
    "A1": (594.0, 841.0),
    "A0": (841.0, 1189.0),
}
"""Width and height, upright (ISO 216, ANSI/ASME Y14.1)."""

MARGIN_MM = 10.0
"""Left white around; office printers do not reach the last 4 mm of a sheet."""

FOOTER_MM = 27.0
"""Height of ruler and text below the board."""

RULER_MM = 100.0

NARROWEST_MM = 150.0
"""Width of the text, which a ruler fits too."""

POINTS = 72.0 / 25.4
"""Per millimetre."""

LINE_MM, FONT_POINTS, CHARACTER_MM = 3.3, 8, 1.45
"""Of the text, in Helvetica: the mean width of its characters is half their size."""

MAX_PAGE_MM = 5000.0
"""14 400 points, the largest page of a PDF (ISO 32000-1, annex C), is 5080 mm."""


@dataclass(frozen=True, eq=False, kw_only=True)
class BoardSheet:
    """Place of a board on a page, millimetres from its upper left corner."""

    board: Board
    drawing: Drawing
    page: str
    width: float
    height: float
    left: float
    """Of the pattern's outline."""
    top: float

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width and height of the pattern."""
        low_x, low_y, high_x, high_y = (1e3 * self.drawing.outline).tolist()
        return high_x - low_x, high_y - low_y


def page_size(page: str) -> tuple[float, float]:
    """Width and height of a named page, or of one stated as `WIDTHxHEIGHT`, millimetres.

    Raises:
        WrongValue: there is none such.
    """
    named = {name.lower(): size for name, size in PAGES_MM.items()}
    if page.lower() in named:
        return named[page.lower()]
    found = re.fullmatch(r"(\d+(?:\.\d+)?)[x×](\d+(?:\.\d+)?)", page.strip().lower())
    if found is None or max(map(float, found.groups())) > MAX_PAGE_MM:
        raise WrongValue(
            f"'{shown(page)}' is not a page; choose {', '.join(PAGES_MM)}, or give width and height in millimetres, such as "
            f"700x1000, up to {MAX_PAGE_MM:.0f}"
        )
    return float(found[1]), float(found[2])


def lay_out_board(board: Board, page: str = "A4") -> BoardSheet:
    """Place a board on a page, upright if it fits so, else across.

    Args:
        board: the board.
        page: one of `PAGES_MM`, or `WIDTHxHEIGHT` in millimetres.

    Raises:
        WrongValue: there is no such page.
        TaskcalError: the board does not fit; the message names a page that it fits.
    """
    drawing = draw_board(board)
    low_x, low_y, high_x, high_y = (1e3 * drawing.outline).tolist()
    quiet = _quiet(board)
    width = max(high_x - low_x + 2 * quiet, NARROWEST_MM + 2 * MARGIN_MM)
    height = high_y - low_y + 2 * quiet + FOOTER_MM
    short, long = page_size(page)
    for across, down in ((short, long), (long, short)):
        if width <= across and height <= down:
            left, free = 0.5 * (across - (high_x - low_x)), down - height
            return BoardSheet(
                board=board,
                drawing=drawing,
                page=page,
                width=across,
                height=down,
                left=left,
                top=quiet + min(0.5 * free, MARGIN_MM),
            )
    fits = next((name for name, size in PAGES_MM.items() if _holds(size, width, height)), None)
    remedy = f"--page {fits}" if fits else f"--page {np.ceil(width):.0f}x{np.ceil(height):.0f}"
    raise TaskcalError(
        f"board '{board.name}', {high_x - low_x:.1f} × {high_y - low_y:.1f} mm, needs a page of {width:.0f} × {height:.0f} mm with "
        f"margins and ruler, more than {page}; take {remedy}, or smaller squares"
    )


def _quiet(board: Board) -> float:
    """White around a pattern, millimetres: finders of plain chessboards look for the outer squares as well."""
    return max(MARGIN_MM, 0.5e3 * board.square_m) if board.kind == "checkerboard" else MARGIN_MM


def _holds(page: tuple[float, float], width: float, height: float) -> bool:
    return (width <= page[0] and height <= page[1]) or (width <= page[1] and height <= page[0])


def sheet_text(sheet: BoardSheet) -> list[str]:
    """What is printed below a board."""
    board, (width, height) = sheet.board, sheet.size_mm
    marker = {"checkerboard": "", "charuco": "markers", "aprilgrid": "tags"}.get(board.kind, "dots")
    sizes = f"pitch {board.square_m * 1e3:g} mm" + (f", {marker} {board.marker_m * 1e3:g} mm" if marker else "")
    markers = f", {board.dictionary} from {board.first_marker}" if board.dictionary else ""
    layout = ", layout before OpenCV 4.6" if board.legacy else ""
    side = max(width, height)
    return [
        f"{board.name}: {board.kind}, {board.columns} columns, {board.rows} rows, {sizes}{markers}{layout}",
        f"Print at 100 %, not fitted to the page. Then the ruler has {RULER_MM:.0f} mm, and the pattern "
        f"{width:.3f} x {height:.3f} mm. Mount it on a flat plate.",
        f"Measure the pattern's longer side, and write into the board's file, under [board.measured]: drawn_mm = {side:.3f}, "
        "length_mm = what you measured, u_mm = its standard uncertainty.",
    ]


def board_pdf(sheets: list[BoardSheet]) -> bytes:
    """A PDF of sheets, a page each, in vector graphics and at true scale."""
    fonts = "/Font << /F1 << /Type /Font /Subtype /Type1 /BaseFont /Helvetica /Encoding /WinAnsiEncoding >> >>"
    kids = " ".join(f"{3 + 2 * k} 0 R" for k in range(len(sheets)))
    objects = [
        b"<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
        f"<< /Type /Pages /Kids [{kids}] /Count {len(sheets)} >>".encode(),
    ]
    for k, sheet in enumerate(sheets):
        box = f"[0 0 {sheet.width * POINTS:.4f} {sheet.height * POINTS:.4f}]"
        content = zlib.compress(_content(sheet).encode("cp1252"), 9)
        objects += [
            f"<< /Type /Page /Parent 2 0 R /MediaBox {box} /Contents {4 + 2 * k} 0 R /Resources << {fonts} >> >>".encode(),
            f"<< /Length {len(content)} /Filter /FlateDecode >>\nstream\n".encode() + content + b"\nendstream",
        ]
    out, places = bytearray(b"%PDF-1.6\n%\xe2\xe3\xcf\xd3\n"), []
    for number, body in enumerate(objects, start=1):
        places.append(len(out))
        out += f"{number} 0 obj\n".encode() + body + b"\nendobj\n"
    table = "".join(f"{place:010d} 00000 n \n" for place in places)
    end = (
        f"xref\n0 {len(objects) + 1}\n0000000000 65535 f \n{table}trailer\n<< /Size {len(objects) + 1} /Root 1 0 R >>\n"
    )
    return bytes(out) + f"{end}startxref\n{len(out)}\n%%EOF\n".encode()


CIRCLE = 4.0 / 3.0 * (np.sqrt(2.0) - 1.0)
"""Length of the handles of four Bézier curves that are a circle to 0.03 % of its radius."""


def _content(sheet: BoardSheet) -> str:
    """The operators of a page. All shapes are one path, so that no viewer leaves a seam between neighbours."""
    shift = np.array([sheet.left, sheet.top]) - 1e3 * sheet.drawing.outline[:2]
    path: list[str] = []
    for left, top, right, bottom in 1e3 * sheet.drawing.boxes + np.tile(shift, 2):
        path.append(_box(sheet, left, top, right - left, bottom - top))
    for x, y, r in 1e3 * sheet.drawing.discs:
        path.append(_disc((x + shift[0]) * POINTS, (sheet.height - y - shift[1]) * POINTS, r * POINTS))
    foot = sheet.top + sheet.size_mm[1] + _quiet(sheet.board)
    path.append(_box(sheet, MARGIN_MM, foot + 4.8, RULER_MM, 0.2))
    for k in range(int(RULER_MM) + 1):
        high = 5.0 if k % 10 == 0 else 3.5 if k % 5 == 0 else 2.0
        path.append(
            _box(sheet, MARGIN_MM + k - 0.05 * (k > 0), foot + 5.0 - high, 0.1 if 0 < k < RULER_MM else 0.05, high)
        )
    lines = [f"0 to {RULER_MM:.0f} mm"]
    for line in sheet_text(sheet):
        lines += textwrap.wrap(line, int((sheet.width - 2 * MARGIN_MM) / CHARACTER_MM))
    text = [
        f"BT /F1 {FONT_POINTS} Tf {LINE_MM * POINTS:.3f} TL {MARGIN_MM * POINTS:.3f} {_up(sheet, foot + 8.5):.3f} Td"
    ]
    text += [f"({_ESCAPED.sub(_BACKSLASH, line)}) Tj T*" for line in lines]
    return "\n".join(["0 g", *path, "f", *text, "ET"])


_ESCAPED, _BACKSLASH = re.compile(r"[\\()]"), r"\\\g<0>"


def _up(sheet: BoardSheet, y_mm: float) -> float:
    """Points from the lower edge of the page."""
    return (sheet.height - y_mm) * POINTS


def _box(sheet: BoardSheet, left: float, top: float, width: float, height: float) -> str:
    x, y, w, h = left * POINTS, _up(sheet, top + height), width * POINTS, height * POINTS
    return f"{x:.4f} {y:.4f} {w:.4f} {h:.4f} re"


def _disc(x: float, y: float, r: float) -> str:
    h = CIRCLE * r
    curves = [
        (r, h, h, r, 0.0, r),
        (-h, r, -r, h, -r, 0.0),
        (-r, -h, -h, -r, 0.0, -r),
        (h, -r, r, -h, r, 0.0),
    ]
    center = np.array([x, y] * 3)
    parts = [" ".join(f"{value:.4f}" for value in center + curve) + " c" for curve in curves]
    return f"{x + r:.4f} {y:.4f} m " + " ".join(parts)
