"""Printed boards: their files, and their corners as OpenCV has them."""

import cv2
import numpy as np
import pytest

from taskcal.errors import FileError
from taskcal.observations.calibration_board import DICTIONARIES, Board, dictionary_name, read_boards

CHARUCO = """
[[board]]
kind = "charuco"
columns = 5
rows = 8
square_mm = 36.0
marker_mm = 18.0
dictionary = "DICT_6X6_250"
legacy = true
[board.measured]
length_mm = 99.5
u_mm = 0.2
"""
CIRCLES = """
[[board]]
name = "dots"
kind = "asymmetric_circles"
columns = 4
rows = 11
square_mm = 20.0
marker_mm = 14.0
big_dot = [1, 2]
big_dot_mm = 18.0
"""


def written(tmp_path, text: str):
    path = tmp_path / "board.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_board_file_gives_metres_and_the_scale_of_the_print(tmp_path):
    charuco, dots = read_boards(written(tmp_path, CHARUCO + CIRCLES))
    assert (charuco.dictionary, charuco.legacy, charuco.square_m) == ("6X6_250", True, pytest.approx(0.036))
    assert (charuco.scale, charuco.u_scale) == (pytest.approx(0.995), pytest.approx(0.2 / 99.5))
    np.testing.assert_allclose(np.ptp(charuco.corners(), axis=0), 0.995 * 0.036 * np.array([3, 6, 0]))
    assert (dots.big_dot, dots.big_dot_m) == ((1, 2), pytest.approx(0.018))


@pytest.mark.parametrize("legacy", [False, True])
@pytest.mark.parametrize("rows", [6, 7])
def test_charuco_corners_and_markers_are_where_opencv_has_them(rows, legacy):
    board = Board(
        kind="charuco", columns=5, rows=rows, square_m=0.04, marker_m=0.02, dictionary="5X5_100", legacy=legacy
    )
    theirs = cv2.aruco.CharucoBoard((5, rows), 0.04, 0.02, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100))
    theirs.setLegacyPattern(legacy)
    np.testing.assert_allclose(board.corners(), theirs.getChessboardCorners(), atol=1e-7)
    first = np.array([marker[0, :2] for marker in theirs.getObjPoints()])
    np.testing.assert_allclose(0.04 * board.marker_cells() + 0.01, first, atol=1e-7)
    assert board.markers == len(first)


def test_dictionaries_are_those_of_opencv():
    for name, family in DICTIONARIES.items():
        theirs = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{name}"))
        assert (theirs.markerSize, len(theirs.bytesList)) == (family.bits, family.size), name
        assert dictionary_name(f"dict_{name}".lower()) == name
    assert dictionary_name("tag36h11") == dictionary_name("36h11") == "APRILTAG_36h11"


TWO = CHARUCO + CHARUCO.replace("[[board]]", '[[board]]\nname = "second"')


@pytest.mark.parametrize(
    ("text", "old", "new", "said"),
    [
        (CHARUCO, "square_mm = 36.0", "square_mm = 0.036", r"board 1, square_mm: must be 0\.5 or more \(got 0\.036\)"),
        (CHARUCO, "marker_mm = 18.0", "marker_mm = 36.0", r"marker_mm = 36 does not fit .* below 36"),
        (CHARUCO, "marker_mm = 18.0\n", "", r"charuco needs .*marker_mm is missing"),
        (CHARUCO, "6X6_250", "6X6_25", r"no dictionary of markers '.*6X6_25'; did you mean '6X6_250'"),
        (CHARUCO, "rows = 8", "rows = 180", r"numbers 0 to 449, but 6X6_250 ends at 249"),
        (CHARUCO, "rows = 8", "rows = 2", r"5 columns and 2 rows are too few; charuco has 3 or more"),
        (CHARUCO, "length_mm = 99.5", "length_mm = 9.95", r"length of 9\.95 mm was drawn as 100 mm"),
        (CHARUCO, "charuco", "chessboard", r"board 1, kind: must be 'charuco', .*\(got 'chessboard'\)"),
        (CHARUCO, "charuco", "checkerboard", r"checkerboard has no dictionary; leave it out"),
        (
            CIRCLES,
            "big_dot = [1, 2]",
            "big_dot = [4, 2]",
            r"big_dot = \[4, 2\] is not on the board; its column is 0 to 3",
        ),
        (CIRCLES, "big_dot_mm = 18.0", "big_dot_mm = 14.0", r"big_dot_mm = 14 is not larger than marker_mm = 14"),
        (CIRCLES, "big_dot_mm = 18.0", "big_dot_mm = 36.0", r"big_dot_mm = 36 does not fit .* below 35\.36"),
        (CIRCLES, "big_dot_mm = 18.0\n", "", r"give big_dot and big_dot_mm, or neither"),
        (CHARUCO + CIRCLES, 'name = "dots"', "", r"two boards are named 'board'"),
        (TWO, "", "", r"'board' and 'second' cannot be told apart.*share markers"),
        (CIRCLES, "[[board]]", "[board]", r"board: is one table; write its header as \[\[board\]\]"),
    ],
)
def test_a_wrong_board_is_refused_with_key_and_value(tmp_path, text, old, new, said):
    assert old in text
    path = written(tmp_path, text.replace(old, new))
    with pytest.raises(FileError, match=said) as caught:
        read_boards(path)
    assert str(caught.value).startswith(str(path))


def test_boards_with_other_markers_are_told_apart(tmp_path):
    text = TWO.replace('"second"', '"second"\nfirst_marker = 20')
    assert [board.markers for board in read_boards(written(tmp_path, text))] == [20, 20]
