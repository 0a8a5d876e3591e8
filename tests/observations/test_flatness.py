"""Boards that bend: heights and camera are found; flat boards stay as they are."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.geometry import se3
from taskcal.kernels.projection import PINHOLE, project
from taskcal.observations.calibration_board import Board, bend_terms
from taskcal.observations.camera import Lens, calibrate_camera
from taskcal.observations.flatness import find_bend
from taskcal.reading.detection import detect_corners
from taskcal.virtual.rendering import render_boards
from tests.observations.pictured import CAMERA, CORNERS, PIXELS, take_pictures

BEND = np.array([3e-4, -1e-4, 2e-4])


def pictures(seed: int, bend: np.ndarray):
    """Of a board whose corners are at their heights."""
    seen = take_pictures(seed, 16)
    corners = CORNERS + np.column_stack(
        [np.zeros((len(CORNERS), 2)), bend_terms(CORNERS[:, :2], CORNERS[:, :2]) @ bend]
    )
    T = np.repeat(se3.inverse(seen.poses(seen.q) @ seen.moving) @ seen.standing, len(corners), axis=0)
    pixel = project(PINHOLE, PIXELS, T[:, :3, :3], T[:, :3, 3], np.tile(corners, (16, 1)))[0]
    pixel += 0.15 * np.random.default_rng(seed).normal(size=pixel.shape)
    return replace(seen, pixel=pixel).campaign().observations[0].pictures[0]


@pytest.mark.parametrize("seed", range(6))
def test_flat_boards_stay_as_they_are(seed):
    flat = pictures(seed, np.zeros(3))
    again, *found = find_bend(flat)
    assert again is flat
    assert found == [[], []]


TAG = 0.04 * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])


TAGS = {"a tag": TAG, "two tags": np.concatenate([TAG, TAG + np.array([0.1, 0.0, 0.0])])}


@pytest.mark.parametrize("board", TAGS.values(), ids=TAGS)
@pytest.mark.parametrize(("tilt", "noise"), [(0.0, 5.0), (0.1, 0.2), (0.6, 0.2), (0.6, 5.0)])
def test_tags_that_cannot_show_a_bend_are_taken_for_flat_and_named(board, tilt, noise):
    rng, count, lens = np.random.default_rng(2), 25, Lens(model="pinhole", width=1600, height=1200)
    pixel = []
    for _ in range(count):
        turn = se3.exp(tilt * rng.normal(size=3) * [1, 1, 0]) @ se3.exp(np.array([0.0, 0.0, rng.uniform(-3, 3)]))
        T = np.tile(se3.pose(turn, rng.uniform([-0.05, -0.05, 0.4], [0.05, 0.05, 0.6])), (len(board), 1, 1))
        exact = project(PINHOLE, PIXELS, T[:, :3, :3], T[:, :3, 3], board)[0]
        pixel.append(exact + noise * rng.normal(size=exact.shape))
    first = len(board) * np.arange(count + 1)
    corners = np.tile(board, (count, 1))
    flat = calibrate_camera(
        lens, tuple(map(str, range(count))), np.zeros(count, int), first, corners, np.concatenate(pixel)
    )
    again, *found = find_bend(flat)
    assert again is flat
    assert found == [[], [0]]


@pytest.mark.parametrize("seed", range(3))
def test_bend_and_camera_of_a_bent_board_are_found(seed):
    """The heights to a part of a twentieth, and focal lengths within four standard deviations, which a plane misses by ten."""
    bent = pictures(seed, BEND)
    again, (found,), _ = find_bend(bent)
    plane = np.column_stack([np.ones(len(CORNERS)), CORNERS[:, :2]])
    z = bend_terms(CORNERS[:, :2], CORNERS[:, :2]) @ BEND
    true = np.ptp(z - plane @ np.linalg.lstsq(plane, z, rcond=None)[0])
    assert abs(found.height - true) < 4.0 * found.error
    assert found.error < 0.15 * true
    own = again.settle(again.camera)
    deviations = np.sqrt(np.diag(np.linalg.inv(own.of_camera[0].sum(axis=0))))
    assert (np.abs(again.camera - CAMERA)[:2] < 4.0 * deviations[:2]).all()
    assert (np.abs(bent.camera - CAMERA)[:2] > 5.0 * deviations[:2]).all()
    assert again.noise == pytest.approx(0.15, rel=0.05)


def test_bent_boards_are_rendered_where_their_corners_project(tmp_path):
    """A sheet that bows by 4 mm, tilted: within 0.3 px, where a flat one is off by several."""
    cv2 = pytest.importorskip("cv2")
    board = Board(
        kind="charuco", columns=7, rows=6, square_m=0.03, marker_m=0.022, dictionary="5X5_100", bend_m=(4e-3, 0.0, 2e-3)
    )
    lens, turn = Lens(model="pinhole", width=800, height=600), se3.exp(np.array([0.4, -0.3, 0.2]))
    camera, T = lens.start(0.9), se3.pose(turn, np.array([0.0, 0.0, 0.4]) - turn @ board.corners().mean(axis=0))
    cv2.imwrite(
        str(tmp_path / "seen.png"), render_boards((board,), lens, camera, T[None], rng=np.random.default_rng(0))
    )
    found = detect_corners(tmp_path, [board])

    def projected(one):
        R, t = np.tile(T[:3, :3], (30, 1, 1)), np.tile(T[:3, 3], (30, 1))
        return project(PINHOLE, camera * np.repeat([1e3, 1.0], [4, 5]), R, t, one.corners())[0][found.id]

    np.testing.assert_allclose(found.pixel, projected(board), atol=0.3)
    assert np.abs(found.pixel - projected(replace(board, bend_m=(0.0, 0.0, 0.0)))).max() > 2.0
