"""Rendered images of boards: OpenCV finds the corners where the camera projects them."""

import numpy as np
import pytest

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.kernels.projection import PINHOLE, project
from taskcal.observations.camera import KILO, Lens
from taskcal.virtual.rendering import Exposure, render_boards
from tests.observations.test_board_drawing import BOARDS, found

LENS = Lens(model="pinhole", width=800, height=600)
CAMERA = np.array([0.75, 0.752, 0.41, 0.29, -0.2, 0.1, 0.001, -0.002, 0.0])
PIXELS = CAMERA * np.repeat([KILO, 1.0], [4, 5])


def before_camera(board, seed: int) -> np.ndarray:
    """The board in the middle of the image, turned by some 20°."""
    turn = se3.exp(np.random.default_rng(seed).normal(0.0, 0.3, 3))
    middle = board.corners().mean(axis=0)
    distance = 1.9 * np.ptp(board.corners(), axis=0).max()
    return se3.pose(turn, np.array([0.0, 0.0, distance]) - turn @ middle)


@pytest.mark.parametrize("name", ["charuco", "aprilgrid", "checkerboard"])
def test_corners_of_a_rendered_board_are_where_they_project(name):
    """Within 0.1 px, and on the mean within 0.02 px."""
    board, ids = BOARDS[name], BOARDS[name].ids()
    T = before_camera(board, seed=1)
    image = render_boards((board,), LENS, CAMERA, T[None], rng=np.random.default_rng(1))
    corners = found(image, board)
    assert len(corners) >= 0.8 * len(ids)
    R, t = np.tile(T[:3, :3], (len(ids), 1, 1)), np.tile(T[:3, 3], (len(ids), 1))
    projected = dict(zip(ids.tolist(), project(PINHOLE, PIXELS, R, t, board.corners())[0], strict=True))
    off = np.array([corner - projected[k] for k, corner in corners.items()])
    assert np.abs(off).max() < 0.1
    assert np.abs(off.mean(axis=0)).max() < 0.02


def test_dots_are_drawn_where_they_project():
    """Centres of gravity of the ink of a board seen from the front, without noise."""
    board = BOARDS["asymmetric circles"]
    turn, distance = np.eye(3), 0.3
    T = se3.pose(turn, np.array([0.0, 0.0, distance]) - board.corners().mean(axis=0))
    plain = Exposure(noise=0.0, gradient=0.0)
    image = render_boards((board,), LENS, CAMERA, T[None], rng=np.random.default_rng(0), exposure=plain).astype(float)
    n = len(board.ids())
    projected = project(PINHOLE, PIXELS, np.tile(T[:3, :3], (n, 1, 1)), np.tile(T[:3, 3], (n, 1)), board.corners())[0]
    radius = int(0.6 * board.square_m / distance * PIXELS[0])
    for u, v in projected[(np.abs(projected - [400, 300]) < [340, 240]).all(axis=1)]:
        x, y = np.arange(int(u) - radius, int(u) + radius + 1), np.arange(int(v) - radius, int(v) + radius + 1)
        ink = np.maximum(plain.white - image[np.ix_(y, x)], 0.0)
        centre = np.array([(ink.sum(axis=0) * x).sum(), (ink.sum(axis=1) * y).sum()]) / ink.sum()
        assert np.abs(centre - [u, v]).max() < 0.15


def test_a_board_behind_the_camera_is_refused():
    board = BOARDS["checkerboard"]
    with pytest.raises(CampaignError, match="behind the camera"):
        render_boards((board,), LENS, CAMERA, np.eye(4)[None], rng=np.random.default_rng(0))
