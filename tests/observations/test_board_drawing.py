"""Sheets of boards: printed at true scale, they are found by OpenCV where their corners are."""

import cv2
import numpy as np
import pypdfium2
import pytest

from taskcal.errors import TaskcalError, WrongValue
from taskcal.observations.board_drawing import PAGES_MM, board_pdf, draw_board, lay_out_board, page_size
from taskcal.observations.calibration_board import Board

MARKED = {"marker_m": 0.02, "dictionary": "5X5_100", "square_m": 0.03}
BOARDS = {
    "charuco": Board(kind="charuco", columns=5, rows=6, first_marker=7, **MARKED),
    "older charuco": Board(kind="charuco", columns=5, rows=6, legacy=True, **MARKED),
    "april charuco": Board(
        kind="charuco", columns=5, rows=7, square_m=0.03, marker_m=0.024, dictionary="APRILTAG_36h11"
    ),
    "aprilgrid": Board(
        kind="aprilgrid",
        columns=3,
        rows=4,
        square_m=0.05,
        marker_m=0.04,
        dictionary="APRILTAG_36h11",
        border_bits=2,
        first_marker=3,
    ),
    "grid of other markers": Board(kind="aprilgrid", columns=3, rows=4, **MARKED),
    "checkerboard": Board(kind="checkerboard", columns=6, rows=7, square_m=0.025),
    "circles": Board(kind="circles", columns=5, rows=7, square_m=0.03, marker_m=0.015, big_dot=(1, 2), big_dot_m=0.02),
    "asymmetric circles": Board(kind="asymmetric_circles", columns=4, rows=7, square_m=0.02, marker_m=0.018),
}


def printed(sheet) -> np.ndarray:
    """A sheet as an image of about 120 pixels per inch; the page is stretched to whole pixels."""
    page = pypdfium2.PdfDocument(board_pdf([sheet]))[0]
    np.testing.assert_allclose(page.get_size(), np.array([sheet.width, sheet.height]) * 72 / 25.4, atol=1e-3)
    return np.ascontiguousarray(page.render(scale=120 / 72, grayscale=True).to_numpy().squeeze())


def pixel_mm(sheet, image: np.ndarray) -> np.ndarray:
    return np.array([sheet.width, sheet.height]) / image.shape[::-1]


def found(image: np.ndarray, board: Board) -> dict[int, np.ndarray]:
    """Corners by number, as OpenCV finds them, pixels; the middle of the first pixel is at zero."""
    markers = cv2.aruco.DetectorParameters()
    markers.markerBorderBits = board.border
    refined = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-4)
    known = board.dictionary and cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{board.dictionary}"))
    if board.kind == "charuco":
        numbers = np.arange(board.first_marker, board.first_marker + board.markers)
        theirs = cv2.aruco.CharucoBoard(
            (board.columns, board.rows), board.square_m, board.marker_m, known, numbers.astype(np.int32)
        )
        theirs.setLegacyPattern(board.legacy)
        corners, ids, _, _ = cv2.aruco.CharucoDetector(theirs).detectBoard(image)
        corners = cv2.cornerSubPix(image, corners, (5, 5), (-1, -1), refined)
        return dict(zip(ids.ravel().tolist(), corners.reshape(-1, 2), strict=True))
    if board.kind == "aprilgrid":
        corners, ids, _ = cv2.aruco.ArucoDetector(known, markers).detectMarkers(image)
        corners = cv2.cornerSubPix(image, np.concatenate(corners, axis=1), (4, 4), (-1, -1), refined).reshape(-1, 4, 2)
        return {4 * int(k) + c: four[c] for k, four in zip(ids.ravel(), corners, strict=True) for c in range(4)}
    if board.kind == "checkerboard":
        _, corners = cv2.findChessboardCornersSB(image, (board.columns - 1, board.rows - 1))
        corners = cv2.cornerSubPix(image, corners, (5, 5), (-1, -1), refined)
    else:
        layout = cv2.CALIB_CB_SYMMETRIC_GRID if board.kind == "circles" else cv2.CALIB_CB_ASYMMETRIC_GRID
        dots = cv2.SimpleBlobDetector_Params()
        dots.maxArea = 1e5
        finder = cv2.SimpleBlobDetector_create(dots)
        _, corners = cv2.findCirclesGrid(image, (board.columns, board.rows), flags=layout, blobDetector=finder)
    corners = corners.reshape(-1, 2)
    if (
        np.ptp(corners[: board.columns, 0]) and corners[0, 1] > corners[-1, 1]
    ):  # nothing tells OpenCV which way up it is
        corners = corners[::-1]
    return dict(enumerate(corners))


@pytest.mark.parametrize("name", BOARDS)
def test_a_printed_board_has_its_corners_where_they_are_stated(name):
    """To 0.05 mm, each by its own number."""
    board = BOARDS[name]
    sheet = lay_out_board(board)
    image = printed(sheet)
    corners = found(image, board)
    assert sorted(corners) == sorted(board.ids().tolist())
    at_mm = (np.array([corners[k] for k in board.ids()]) + 0.5) * pixel_mm(sheet, image) - [sheet.left, sheet.top]
    expected = 1e3 * (board.corners()[:, :2] - sheet.drawing.outline[:2])
    assert np.abs(at_mm - expected).max() < 0.05


def test_the_ruler_is_as_long_as_it_says():
    sheet = lay_out_board(BOARDS["circles"])
    image = printed(sheet)
    across, down = pixel_mm(sheet, image)
    below = int((sheet.top + sheet.size_mm[1] + 9.0) / down)
    rows = image[below:] < 128
    long = rows[rows.sum(axis=1).argmax()]
    assert abs((np.flatnonzero(long)[-1] - np.flatnonzero(long)[0] + 1) * across - 100.0) < across


def test_the_big_dot_is_the_one_that_is_named():
    board = BOARDS["circles"]
    radius = draw_board(board).discs[:, 2].reshape(board.rows, board.columns)
    assert radius[2, 1] == 0.01
    assert (np.delete(radius.ravel(), 11) == 0.0075).all()


@pytest.mark.parametrize(("columns", "rows"), [(7, 9), (12, 5), (30, 30)])
def test_a_board_too_large_is_told_a_page_that_fits(columns, rows):
    board = Board(kind="checkerboard", columns=columns, rows=rows, square_m=0.04)
    with pytest.raises(TaskcalError, match=r"more than A4; take --page \S+,") as caught:
        lay_out_board(board)
    page = str(caught.value).partition("--page ")[2].partition(",")[0]
    sheet = lay_out_board(board, page)
    assert sheet.left + sheet.size_mm[0] < sheet.width
    assert sheet.top + sheet.size_mm[1] < sheet.height
    assert sorted([sheet.width, sheet.height]) == sorted(page_size(page))


@pytest.mark.parametrize("page", ["A9", "200", "0x0x1", "9000x200", "-5x80"])
def test_a_page_that_is_none_is_refused(page):
    with pytest.raises(WrongValue, match="is not a page; choose A4"):
        lay_out_board(BOARDS["circles"], page)


def test_pages_are_upright():
    assert all(width < height for width, height in PAGES_MM.values())
