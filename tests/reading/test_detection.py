import re
from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import FileError
from taskcal.geometry import se3
from taskcal.observations import Board
from taskcal.observations.camera import KILO, Lens
from taskcal.reading.detection import corners_of, detect_corners, detector
from taskcal.reading.writer import corners_text
from taskcal.virtual.rendering import Exposure, render_boards
from tests.observations.test_board_drawing import BOARDS

cv2 = pytest.importorskip("cv2")
BOARD = Board(kind="charuco", columns=7, rows=6, square_m=0.03, marker_m=0.022, dictionary="5X5_100", name="bench")
SCALE = 2000.0
"""Pixels a metre of the flat print."""
VIEWS = {
    "1.png": [[0.9, 0.1, 60.0], [-0.15, 1.0, 90.0], [1e-4, 2e-4, 1.0]],
    "2.png": [[1.1, -0.2, 130.0], [0.2, 0.9, 40.0], [-1e-4, 1e-4, 1.0]],
}


@pytest.fixture
def folder(tmp_path):
    pattern = cv2.aruco.CharucoBoard((7, 6), 0.03, 0.022, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100))
    flat = pattern.generateImage((round(0.21 * SCALE), round(0.18 * SCALE)), marginSize=0)
    for name, H in VIEWS.items():
        seen = cv2.warpPerspective(flat, np.array(H), (640, 560), borderValue=200)
        cv2.imwrite(str(tmp_path / name), cv2.GaussianBlur(seen, (3, 3), 0.7))
    cv2.imwrite(str(tmp_path / "10.png"), np.full((560, 640), 128, np.uint8))
    return tmp_path


def test_corners_are_found_where_they_are_printed(folder):
    found = detect_corners(folder, [BOARD])
    assert found.images == ("1.png", "2.png", "10.png")
    assert (found.width, found.height) == (640, 560)
    for k, name in enumerate(found.images[:2]):
        own = found.image == k
        assert sorted(found.id[own]) == list(range(30))
        # a pixel of the flat print ends where the next begins, and has its middle half a pixel before
        printed = BOARD.corners()[found.id[own], :2] * SCALE - 0.5
        expected = cv2.perspectiveTransform(printed[None], np.array(VIEWS[name]))[0]
        np.testing.assert_allclose(found.pixel[own], expected, atol=0.2)
    assert not (found.image == 2).any()


OTHERS = [("aprilgrid", 0.1), ("aprilgrid", 3.2), ("checkerboard", 0.1), ("checkerboard", 3.2), ("circles", 0.1)]


@pytest.mark.parametrize(("name", "roll"), [*OTHERS, ("circles", 3.2), ("asymmetric circles", 0.1)])
def test_corners_of_other_boards_are_where_they_project(tmp_path, name, roll):
    """Rendered without distortion, a little turned: all that are numbered, each within 0.3 px of its own place."""
    board, lens = BOARDS[name], Lens(model="pinhole", width=800, height=600)
    turn, camera = se3.exp(np.array([0.2, -0.15, 0.0])) @ se3.exp(np.array([0.0, 0.0, roll])), lens.start(0.9)
    middle, size = board.corners().mean(axis=0), np.ptp(board.corners(), axis=0).max()
    T = se3.pose(turn, np.array([0.0, 0.0, 2.0 * size]) - turn @ middle)
    image = render_boards((board,), lens, camera, T[None], rng=np.random.default_rng(0))
    cv2.imwrite(str(tmp_path / "seen.png"), image)
    found = detect_corners(tmp_path, [board])
    fx, fy, cx, cy = camera[:4] * KILO
    x, y, z = se3.apply(T, board.corners()).T
    projected = dict(zip(board.ids().tolist(), np.column_stack([fx * x / z + cx, fy * y / z + cy]), strict=True))
    assert sorted(found.id) == sorted(projected)
    np.testing.assert_allclose(found.pixel, np.stack([projected[k] for k in found.id]), atol=0.3)


DOTS = {"kind": "circles", "square_m": 0.02, "marker_m": 0.01}
STAGGERED = {"kind": "asymmetric_circles", "columns": 4, "square_m": 0.02, "marker_m": 0.014, "big_dot": (1, 2)}
TOLD = {
    "square grid": Board(**DOTS, columns=7, rows=7, big_dot=(2, 3), big_dot_m=0.015),
    "a dot in the corner": Board(**DOTS, columns=6, rows=6, big_dot=(0, 0), big_dot_m=0.014),
    "a dot as wide as the spacing": Board(**DOTS, columns=9, rows=7, big_dot=(2, 3), big_dot_m=0.02),
    "upright": Board(**DOTS, columns=5, rows=7, big_dot=(1, 2), big_dot_m=0.013),
    "staggered": Board(**STAGGERED, rows=11, big_dot_m=0.018),
    "staggered, even": Board(**STAGGERED, rows=10, big_dot_m=0.018),
    "checkerboard": Board(kind="checkerboard", columns=9, rows=6, square_m=0.02),
    "square checkerboard": Board(kind="checkerboard", columns=8, rows=8, square_m=0.02),
}
"""Boards that tell which way up they are; of the last one, all but half a turn."""


@pytest.mark.parametrize("name", TOLD)
def test_a_board_is_found_the_way_up_that_it_is_or_not_at_all(tmp_path, name):
    """Turned at random about the camera's axis, tilted by up to 35°, in uneven light."""
    board, lens, rng = TOLD[name], Lens(model="pinhole", width=800, height=600), np.random.default_rng(11)
    camera, corners, find, found = lens.start(0.9), TOLD[name].corners(), detector([TOLD[name]]), 0
    size, views = np.ptp(corners[:, :2], axis=0).max(), 12
    fx, fy, cx, cy = camera[:4] * KILO
    for view in range(views):
        tilt, roll = (
            rng.uniform(-0.6, 0.6) * se3.exp(np.array([0.0, 0.0, rng.uniform(0, np.pi)]))[0],
            2 * np.pi * rng.random(),
        )
        turn = se3.exp(tilt) @ se3.exp(np.array([0.0, 0.0, roll]))
        T = se3.pose(
            turn, [*rng.uniform(-0.05, 0.05, 2) * size, rng.uniform(2.4, 3.0) * size] - turn @ corners.mean(axis=0)
        )
        light = Exposure(gradient=rng.uniform(0.0, 0.4), blur_px=rng.uniform(0.3, 1.0))
        cv2.imwrite(
            str(tmp_path / f"{view}.png"), render_boards((board,), lens, camera, T[None], rng=rng, exposure=light)
        )
        seen, _ = find(tmp_path / f"{view}.png")
        if not len(seen.id):
            continue
        x, y, z = se3.apply(T, corners).T
        projected = np.column_stack([fx * x / z + cx, fy * y / z + cy])
        ways = [projected, projected[::-1]] if board.same_after_half_turn else [projected]
        assert min(np.abs(seen.pixel - way[seen.id]).max() for way in ways) < 1.0, view
        found += 1
    assert found >= views - 1


def test_a_board_whose_larger_dot_is_not_where_it_is_stated_is_not_found(tmp_path):
    board, lens = replace(TOLD["square grid"], big_dot=(2, 1)), Lens(model="pinhole", width=800, height=600)
    camera, T = lens.start(0.9), se3.pose(np.eye(3), np.array([-0.06, -0.06, 0.35]))
    image = render_boards((board,), lens, camera, T[None], rng=np.random.default_rng(0))
    cv2.imwrite(str(tmp_path / "seen.png"), image)
    assert len(detector([board])(tmp_path / "seen.png")[0].id) == 49
    for other in ({"big_dot": (1, 3)}, {"big_dot": (0, 0)}, {"big_dot_m": 0.0199, "marker_m": 0.006}):
        assert not len(detector([replace(board, **other)])(tmp_path / "seen.png")[0].id)
    cv2.imwrite(str(tmp_path / "mirrored.png"), np.ascontiguousarray(image[:, ::-1]))
    assert not len(detector([board])(tmp_path / "mirrored.png")[0].id)


WRONG = {
    "dictionary": ({"dictionary": "4X4_100"}, "they show markers 0 to 20 of dictionary 5X5_250"),
    "counts": (
        {"columns": 6, "rows": 7},
        "columns and rows are swapped ('bench' is found with 7 columns and 6 rows then)",
    ),
    "layout": ({"legacy": True}, "it is printed in the present layout, legacy = false"),
}


@pytest.mark.parametrize(("change", "message"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_with_a_board_is_named(folder, change, message):
    with pytest.raises(FileError, match=re.escape(message)):
        detect_corners(folder, [replace(BOARD, **change)])


def test_a_mirrored_print_is_named(folder):
    for name in VIEWS:
        cv2.imwrite(str(folder / name), cv2.imread(str(folder / name))[:, ::-1])
    with pytest.raises(FileError, match="was printed mirrored"):
        detect_corners(folder, [BOARD])


def test_images_of_other_sizes_are_refused(folder):
    cv2.imwrite(str(folder / "3.png"), np.full((480, 640), 128, np.uint8))
    with pytest.raises(FileError, match=r"3\.png: has 640 × 480 pixels, and 1\.png 640 × 560"):
        detect_corners(folder, [BOARD])


@pytest.mark.parametrize("content", [b"", b"junk"])
def test_files_that_are_no_images_are_refused(folder, content):
    (folder / "3.png").write_bytes(content)
    with pytest.raises(FileError, match=r"3\.png: is not an image"):
        detect_corners(folder, [BOARD])


def test_each_folder_of_images_is_a_camera(folder, tmp_path):
    """Their corners are read the same from a file, which names the camera of each; one folder alone is to be named itself."""
    whole = tmp_path / "shots"
    for name, view in (("left", "1.png"), ("right", "2.png")):
        (whole / name).mkdir(parents=True)
        (folder / view).rename(whole / name / "0001.png")
    found = corners_of(whole, [BOARD])
    assert [(one.camera, one.images) for one in found] == [("left", ("0001.png",)), ("right", ("0001.png",))]
    (tmp_path / "seen.csv").write_text(corners_text(found))
    for one, again in zip(found, corners_of(tmp_path / "seen.csv", [BOARD]), strict=True):
        assert (again.camera, again.images, again.board, again.width) == (one.camera, one.images, one.board, 640)
        np.testing.assert_array_equal(again.pixel, one.pixel)
    (whole / "right" / "0001.png").unlink()
    with pytest.raises(FileError, match=r"has no images .*, but its folder left has: name that"):
        corners_of(whole, [BOARD])
    (folder / "10.png").rename(whole / "10.png")
    cv2.imwrite(str(whole / "1.png"), cv2.imread(str(whole / "left" / "0001.png")))
    (beside,) = corners_of(whole, [BOARD])
    assert any("folder left has images, too" in note for note in beside.notes)
