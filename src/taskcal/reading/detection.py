"""Corners of printed boards in images, by OpenCV, and what is wrong with boards that are not found."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import FileError, TaskcalError
from taskcal.observations.calibration_board import Board
from taskcal.observations.camera import FEWEST_CORNERS
from taskcal.reading.pictures import (
    CORNER_COLUMNS,
    PIXEL_DECIMALS,
    Corners,
    has_corners,
    in_words,
    natural_order,
    read_corners,
)
from taskcal.tables.forms import read_table

SUFFIXES = frozenset((".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".pgm", ".ppm"))
"""Of images that OpenCV reads."""

THUMBNAIL_PX, THUMBNAIL_QUALITY = 480, 60
"""Width of a small image, and quality of its JPEG: 15 to 25 kB, on which squares are seen."""

LOOKED_AT = 3
"""Images, evenly among all, on which other boards are tried where one is not found."""

TRIED = (
    "4X4_250",
    "5X5_250",
    "6X6_250",
    "7X7_250",
    "ARUCO_ORIGINAL",
    "APRILTAG_36h11",
    "APRILTAG_25h9",
    "APRILTAG_16h5",
)
"""Dictionaries that are tried: those that boards are printed with; shorter and longer ones begin alike."""

BLURRED_PX, BLURRED_TIMES = 6.0, 2.0
"""Width of an edge, pixels, and times the usual one of a campaign, from which on an image is called blurred: edges of sharp
pictures are 2 to 3 pixels wide, and corners of ones twice as wide scatter about twice as much."""

WINDOW = 6
"""Pixels about a corner in which edges are measured: less than a square of any picture that a board is found in."""

WINDOW_SHARE, MAX_WINDOW = 0.25, 10
"""Half of the window in which a tag's corner is refined, over the gap between tags, in which its small square lies, and pixels:
the outline of a tag, where that touches it, is up to 3 pixels off."""


DOT_SAMPLES = 41
"""Along either side of the part of a board in which a dot is measured: 2.5 % of a square."""


class Detection(NamedTuple):
    """Corners of one board in an image."""

    id: Int[np.ndarray, " c"]
    pixel: Float[np.ndarray, "c 2"]


NOTHING = Detection(np.zeros(0, dtype=int), np.zeros((0, 2)))


def corners_of(path: Path, boards: Sequence[Board]) -> tuple[Corners, ...]:
    """Corners in the images of each camera: of a folder, of the folders in it, one for each camera, or as a file has them.

    Raises:
        FileError: there is neither, or no image.
        TaskcalError: OpenCV is not installed.
    """
    if path.is_dir():
        cameras = sorted((one for one in path.iterdir() if one.is_dir() and _has_images(one)), key=lambda one: one.name)
        if _has_images(path) or len(cameras) < 2:
            found = detect_corners(path, boards)
            inside = in_words([one.name for one in cameras])
            more = (f"its folder {inside} has images, too, which are not looked at",) if cameras else ()
            return (replace(found, notes=(*found.notes, *more)),)
        return tuple(replace(detect_corners(one, boards), camera=one.name) for one in cameras)
    table = read_table(path)
    if not has_corners(table):
        raise FileError(path, f"is not a file of corners: it needs columns {', '.join(CORNER_COLUMNS[:5])}", line=1)
    return read_corners(table)


def _opencv() -> Any:
    try:
        import cv2
    except ImportError as error:
        raise TaskcalError(
            "corners of boards are found by OpenCV, which is not installed: pip install 'taskcal[images]'"
        ) from error
    return cv2


def detect_corners(folder: Path, boards: Sequence[Board]) -> Corners:
    """Find the corners of boards in all images of a folder.

    Raises:
        FileError: there are no images, one cannot be read, they differ in size, or show no board; the message says which board
            they show instead.
        TaskcalError: OpenCV is not installed.
    """
    cv2 = _opencv()
    paths = sorted(
        (path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES),
        key=lambda path: natural_order(path.name),
    )
    if not paths:
        inside = sorted(path.name for path in folder.iterdir() if path.is_dir() and _has_images(path))
        several = f", but its folder {in_words(inside)} has: name that" if inside else ""
        raise FileError(folder, f"has no images ({', '.join(sorted(SUFFIXES))}){several}")
    finders = [_finder(board) for board in boards]
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)  # an image in each thread, where two threads in one image wait for each other
    try:
        with ThreadPoolExecutor(min(os.cpu_count() or 1, 8)) as workers:
            seen = list(workers.map(lambda path: _look(path, finders), paths))
    finally:
        cv2.setNumThreads(before)
    (height, width), first = seen[0][0], paths[0].name
    for path, (size, *_) in zip(paths, seen, strict=True):
        if size != (height, width):
            raise FileError(
                path,
                f"has {size[1]} × {size[0]} pixels, and {first} {width} × {height}: a camera has other numbers for another size; "
                "calibrate each by itself",
            )
    if not any(len(one.id) >= FEWEST_CORNERS for _, found, _ in seen for one in found):
        some = [paths[k] for k in np.unique(np.linspace(0, len(paths) - 1, LOOKED_AT).astype(int))]
        raise FileError(folder, f"no board of the file is seen in {len(paths)} images{_what_else(some, boards)}")
    widths = np.array([width for *_, width in seen])
    usual = float(np.nanmedian(widths))
    blurred = [path.name for path, width in zip(paths, widths, strict=True) if is_blurred(width, usual)]
    notes = (
        [f"{in_words(blurred)}: blurred, edges of more than {BLURRED_TIMES:g} times the usual {usual:.1f} pixels"]
        if blurred
        else []
    )
    corners = _corners(folder.name, paths, (height, width), [found for _, found, _ in seen], boards)
    pixel = np.round(corners.pixel, PIXEL_DECIMALS)
    return replace(corners, pixel=pixel, folder=folder, blurred=tuple(blurred), notes=tuple(notes))


def _corners(
    source: str,
    paths: Sequence[Path],
    size: tuple[int, int],
    seen: Sequence[Sequence[Detection]],
    boards: Sequence[Board],
) -> Corners:
    """Corners of boards as they were found in each image."""
    parts = [(k, b, one) for k, found in enumerate(seen) for b, one in enumerate(found)]
    return Corners(
        source=source,
        images=tuple(path.name for path in paths),
        width=size[1],
        height=size[0],
        image=np.concatenate([np.full(len(one.id), k) for k, _, one in parts]),
        board=tuple(boards[b].name for _, b, one in parts for _ in one.id),
        id=np.concatenate([one.id for *_, one in parts]),
        pixel=np.concatenate([one.pixel for *_, one in parts]),
    )


def detector(boards: Sequence[Board]) -> Callable[[Path], tuple[Corners, float]]:
    """What finds the corners of boards in an image at a time, and how wide the edges at them are, pixels; NaN of none.

    It raises a FileError where the image cannot be read.

    Raises:
        TaskcalError: OpenCV is not installed.
    """
    finders = [_finder(board) for board in boards]

    def look(path: Path) -> tuple[Corners, float]:
        size, found, edge = _look(path, finders)
        return _corners(path.name, [path], size, [found], boards), edge

    return look


def is_blurred(edge: float, usual: float) -> bool:
    """Whether edges of an image are far wider than the usual ones of its campaign, pixels."""
    return bool(edge > max(BLURRED_PX, BLURRED_TIMES * usual))


def _has_images(folder: Path) -> bool:
    return any(path.suffix.lower() in SUFFIXES for path in folder.iterdir())


def _read(path: Path) -> np.ndarray:
    cv2 = _opencv()
    data = np.fromfile(path, dtype=np.uint8)
    image = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION) if data.size else None
    if image is None:
        raise FileError(path, "is not an image that OpenCV reads; save it as PNG")
    return image


def thumbnail(path: Path) -> bytes:
    """A small JPEG of an image, to be shown.

    Raises:
        FileError: it is not an image that OpenCV reads.
        TaskcalError: OpenCV is not installed.
    """
    cv2 = _opencv()
    image = _read(path)
    share = min(1.0, THUMBNAIL_PX / image.shape[1])
    small = cv2.resize(image, None, fx=share, fy=share, interpolation=cv2.INTER_AREA)
    return cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, THUMBNAIL_QUALITY])[1].tobytes()


def _look(
    path: Path, finders: Sequence[Callable[[np.ndarray], Detection]]
) -> tuple[tuple[int, int], list[Detection], float]:
    """Size of an image, what it shows, and how wide the edges at its corners are, pixels."""
    image = _read(path)
    found = [find(image) for find in finders]
    pixel = np.concatenate([one.pixel for one in found])
    return (image.shape[0], image.shape[1]), found, _edge_width(image, pixel)


def _edge_width(image: np.ndarray, pixel: Float[np.ndarray, "c 2"]) -> float:
    """Contrast over the steepest slope, in the middle of what the corners show; NaN of none."""
    out: list[float] = []
    for u, v in np.rint(pixel).astype(int):
        part = image[max(v - WINDOW, 0) : v + WINDOW + 1, max(u - WINDOW, 0) : u + WINDOW + 1].astype(float)
        if min(part.shape) < WINDOW:
            continue
        slope = np.hypot(*np.gradient(part)).max()
        out.append(float(np.ptp(part)) / max(float(slope), 1e-9))
    return float(np.median(out)) if out else np.nan


# One finder for each kind of board.


def _finder(board: Board) -> Callable[[np.ndarray], Detection]:
    finders = {
        "charuco": _charuco,
        "aprilgrid": _tags,
        "checkerboard": _checkerboard,
        "circles": _circles,
        "asymmetric_circles": _circles,
    }
    return finders[board.kind](board)


def _dictionary(name: str) -> Any:
    cv2 = _opencv()
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{name}"))


def _charuco(board: Board) -> Callable[[np.ndarray], Detection]:
    cv2 = _opencv()
    numbers = board.first_marker + np.arange(board.markers)
    size = board.columns, board.rows
    pattern = cv2.aruco.CharucoBoard(size, board.square_m, board.marker_m, _dictionary(board.dictionary), numbers)
    pattern.setLegacyPattern(board.legacy)
    detector = cv2.aruco.CharucoDetector(pattern)

    def find(image: np.ndarray) -> Detection:
        pixel, ids, _, _ = detector.detectBoard(image)
        return NOTHING if ids is None else Detection(ids.reshape(-1).astype(int), pixel.reshape(-1, 2).astype(float))

    return find


def _marker_detector(dictionary: str, border_bits: int = 1) -> Any:
    cv2 = _opencv()
    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = border_bits
    return cv2.aruco.ArucoDetector(_dictionary(dictionary), parameters)


def _tags(board: Board) -> Callable[[np.ndarray], Detection]:
    cv2 = _opencv()
    detector, own = _marker_detector(board.dictionary, board.border), set(board.ids().tolist())
    window = WINDOW_SHARE * (board.square_m - board.marker_m) / board.marker_m
    until = cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-3

    def find(image: np.ndarray) -> Detection:
        corners, ids, _ = detector.detectMarkers(image)
        if ids is None:
            return NOTHING
        number = (4 * ids.reshape(-1, 1) + np.arange(4)).reshape(-1)
        here = np.array([int(one) in own for one in number])
        rough = np.concatenate(corners).reshape(-1, 4, 2)
        side = float(np.median(np.linalg.norm(rough - np.roll(rough, 1, axis=1), axis=2)))
        half = min(max(round(window * side), 2), MAX_WINDOW)
        pixel = cv2.cornerSubPix(image, rough.reshape(-1, 1, 2).copy(), (half, half), (-1, -1), until).reshape(-1, 2)
        return Detection(number[here].astype(int), pixel[here].astype(float))

    return find


def _checkerboard(board: Board) -> Callable[[np.ndarray], Detection]:
    cv2 = _opencv()
    size = board.columns - 1, board.rows - 1
    flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY

    def find(image: np.ndarray) -> Detection:
        there, pixel = cv2.findChessboardCornersSB(image, size, flags=flags)
        if not there:
            return NOTHING
        pixel = pixel.reshape(-1, 2).astype(float)
        # OpenCV may begin at any end of a board whose ends differ in colour
        black = bool(board.black_squares()[1, 1])
        turned = (pixel[order] for order in _turns(*size))
        fitting = (one for one in turned if black == (_shade(image, one, size[0], 0) < _shade(image, one, size[0], 1)))
        return Detection(board.ids(), next(fitting, pixel))

    return find


def _turns(columns: int, rows: int) -> list[Int[np.ndarray, " c"]]:
    """Orders in which points of a grid come that is turned: by half a turn, and a square one by quarters."""
    grid = np.arange(columns * rows).reshape(rows, columns)
    return [np.rot90(grid, quarters).reshape(-1) for quarters in (range(4) if columns == rows else (0, 2))]


def _shade(image: np.ndarray, pixel: Float[np.ndarray, "c 2"], columns: int, first: int) -> float:
    """Shade in the middle of the square behind a corner."""
    u, v = np.rint(pixel[first + np.array([0, 1, columns, columns + 1])].mean(axis=0)).astype(int)
    return float(image[max(v - 1, 0) : v + 2, max(u - 1, 0) : u + 2].mean())


def _circles(board: Board) -> Callable[[np.ndarray], Detection]:
    cv2 = _opencv()
    staggered = board.kind == "asymmetric_circles"
    form = cv2.CALIB_CB_ASYMMETRIC_GRID if staggered else cv2.CALIB_CB_SYMMETRIC_GRID
    orders = _staggered_orders(board.columns, board.rows) if staggered else _turns(board.columns, board.rows)
    told = board.big_dot is not None and not board.same_after_half_turn

    def find(image: np.ndarray) -> Detection:
        for flags in (form | cv2.CALIB_CB_CLUSTERING, form):  # each finds boards that the other does not
            there, pixel = cv2.findCirclesGrid(image, (board.columns, board.rows), flags=flags)
            for order in orders if there else ():
                found = pixel.reshape(-1, 2).astype(float)[order]
                if _is_in_order(board, found) and (not told or _has_big_dot(board, image, found)):
                    return Detection(board.ids(), found)
        return NOTHING

    return find


def _staggered_orders(columns: int, rows: int) -> list[Int[np.ndarray, " c"]]:
    """Orders in which staggered dots come, as they are and, of an even number of rows, turned by half a turn.

    Of an even number of rows OpenCV exchanges the rows of each pair.
    """
    grid = np.arange(columns * rows)
    if rows % 2:
        return [grid]
    exchanged = grid.reshape(-1, 2, columns)[:, ::-1].reshape(-1)
    return [grid, grid[::-1], exchanged, exchanged[::-1]]


def _is_in_order(board: Board, pixel: Float[np.ndarray, "c 2"]) -> bool:
    """Whether rows follow one another to one side of their own direction, as on the board, which no lens changes."""
    at = pixel.reshape(board.rows, board.columns, 2)
    along, down = np.diff(at, axis=1)[:-1], np.diff(at, axis=0)[:, :-1]
    return bool((along[..., 0] * down[..., 1] - along[..., 1] * down[..., 0] > 0.0).all())


def _has_big_dot(board: Board, image: np.ndarray, pixel: Float[np.ndarray, "c 2"]) -> bool:
    """Whether the dot that is stated to be larger is, alone, by half as much as is stated or more."""
    assert board.big_dot is not None
    column, row = board.big_dot
    sizes = _dot_sizes(board, image, pixel)
    least = 0.5 * (1.0 + board.big_dot_m / board.marker_m) * np.median(sizes)
    return np.flatnonzero(sizes >= least).tolist() == [row * board.columns + column]


def _dot_sizes(board: Board, image: np.ndarray, pixel: Float[np.ndarray, "c 2"]) -> Float[np.ndarray, " c"]:
    """Diameters of dots as they are on the board, in its squares: what perspective does to them is taken away.

    Each is measured in the part of the board that is nearer to it than to the other dots; the corners of that part are ground.
    """
    cv2 = _opencv()
    H, _ = cv2.findHomography(board.drawn_corners() / board.square_m, pixel)
    axes = np.array([[1.0, 1.0], [1.0, -1.0]]) if board.kind == "asymmetric_circles" else np.eye(2)
    across = np.linspace(-0.5, 0.5, DOT_SAMPLES)
    part = np.stack(np.meshgrid(across, across), axis=-1) @ axes
    centre = cv2.perspectiveTransform(pixel[:, None], np.linalg.inv(H))
    at = cv2.perspectiveTransform((centre + part.reshape(1, -1, 2)).reshape(1, -1, 2), H)
    seen = cv2.remap(image, at.reshape(len(pixel), -1, 2).astype(np.float32), None, cv2.INTER_LINEAR).astype(float)
    middle = seen[:, [len(seen[0]) // 2]]
    ground = np.median(seen[:, [0, DOT_SAMPLES - 1, -DOT_SAMPLES, -1]], axis=1, keepdims=True)
    share = (np.abs(seen - middle) < np.abs(seen - ground)).mean(axis=1)
    return np.sqrt(4.0 / np.pi * share * abs(np.linalg.det(axes)))


# Boards that are not found: what the images show instead.


def _what_else(paths: Sequence[Path], boards: Sequence[Board]) -> str:
    """What would be found in some images: another dictionary, layout or order of the counts, or a mirrored print."""
    images = [_read(path) for path in paths]

    def count(board: Board, pictures: Sequence[np.ndarray] = images) -> int:
        find = _finder(board)
        return sum(len(find(image).id) for image in pictures)

    for board in boards:
        mirrored = [np.ascontiguousarray(image[:, ::-1]) for image in images]
        if board.dictionary and count(board, mirrored):
            return f": it is seen in the mirrored images, so '{board.name}' was printed mirrored, or the camera mirrors its images"
        tried: list[tuple[str, Board]] = [
            ("columns and rows are swapped", replace(board, columns=board.rows, rows=board.columns))
        ]
        if board.kind == "charuco":
            other = "the old layout, legacy = true" if not board.legacy else "the present layout, legacy = false"
            tried += [
                (f"it is printed in {other}", replace(board, legacy=not board.legacy)),
                (
                    f"columns and rows are swapped, and it is printed in {other}",
                    replace(board, columns=board.rows, rows=board.columns, legacy=not board.legacy),
                ),
            ]
        for what, trial in tried:
            if count(trial) >= FEWEST_CORNERS:
                return f": {what} ('{board.name}' is found with {trial.columns} columns and {trial.rows} rows then)"
        if board.dictionary:
            own = _markers(board.dictionary, images)
            if own:
                return (
                    f": the markers {min(own)} to {max(own)} in them are of its dictionary; check columns, rows and "
                    f"first_marker of '{board.name}'"
                )
            numbers = {name: _markers(name, images) for name in TRIED}
            best = max(numbers, key=lambda name: len(numbers[name]))
            if numbers[best]:
                return (
                    f": they show markers {min(numbers[best])} to {max(numbers[best])} of dictionary {best} (or another one of "
                    f"{best.split('_')[0]}), where '{board.name}' has {board.dictionary}"
                )
    return "; check the board's file, and that the whole board is lit and in focus"


def _markers(dictionary: str, images: Sequence[np.ndarray]) -> set[int]:
    """Markers of a dictionary that images show, each in two images or in the only one."""
    detector = _marker_detector(dictionary)
    seen = [ids.reshape(-1).tolist() for image in images if (ids := detector.detectMarkers(image)[1]) is not None]
    every = [number for one in seen for number in set(one)]
    return {number for number in every if len(images) == 1 or every.count(number) > 1}
