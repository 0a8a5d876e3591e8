"""Wide lenses: the fisheye of a fit is that of OpenCV, and a wrongly chosen lens is named."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.observations.camera import Lens, Pictures, calibrate_camera, noise_with
from taskcal.reading.pictures import MAX_NOISE_RATIO
from tests.observations.pictured import CAMERA, CORNERS, LENS, take_pictures
from tests.observations.wide import FISHEYE_CAMERA, FISHEYE_LENS, take_wide

COUNT = 16
PINHOLE_LENS = replace(FISHEYE_LENS, model="pinhole")
WIDE_CAMERA = np.array([0.9, 0.9, 0.81, 0.6, -0.25, 0.08, 0.0005, -0.0008, -0.01])
"""A pinhole of 83° with a strong barrel."""


def fitted(lens: Lens, pixel: np.ndarray) -> Pictures:
    n, m = len(pixel) // len(CORNERS), len(CORNERS)
    names, first = tuple(map(str, range(n))), m * np.arange(n + 1)
    return calibrate_camera(lens, names, np.zeros(n, int), first, np.tile(CORNERS, (n, 1)), pixel)


@pytest.mark.parametrize("seed", range(3))
def test_fisheye_of_pictures_is_that_of_opencv(seed):
    """And is the true one, as sure as it says."""
    cv2 = pytest.importorskip("cv2")
    pixel = take_wide(seed, FISHEYE_LENS, FISHEYE_CAMERA, COUNT)
    own = fitted(FISHEYE_LENS, pixel)
    flags = [getattr(cv2, name, None) or getattr(cv2.fisheye, name) for name in OPENCV_FLAGS]
    seen = [one.reshape(1, -1, 2) for one in pixel.reshape(COUNT, -1, 2)]
    rms, K, distortion, _, _ = cv2.fisheye.calibrate(
        [CORNERS.reshape(1, -1, 3)] * COUNT, seen, (1600, 1200), np.zeros((3, 3)), np.zeros((4, 1)), flags=sum(flags)
    )
    opencv = np.array([K[0, 0] / 1e3, K[1, 1] / 1e3, K[0, 2] / 1e3, K[1, 2] / 1e3, *distortion.ravel()])
    settled = own.settle(own.camera)
    C = np.linalg.inv(settled.of_camera[0].sum(axis=0))
    # apart by what Huber's weights leave out of Gaussian noise
    assert (np.abs(own.camera - opencv) < 0.5 * np.sqrt(np.diag(C))).all()
    assert np.sqrt((own.residual(settled, own.camera) ** 2).sum(axis=1).mean()) == pytest.approx(rms, rel=0.01)
    off = own.camera - FISHEYE_CAMERA
    assert off @ np.linalg.solve(C, off) < 26.1  # of eight numbers: once in a thousand


OPENCV_FLAGS = ("CALIB_RECOMPUTE_EXTRINSIC", "CALIB_FIX_SKEW")


@pytest.mark.parametrize(
    ("lens", "camera", "wrong"),
    [(FISHEYE_LENS, FISHEYE_CAMERA, PINHOLE_LENS), (PINHOLE_LENS, WIDE_CAMERA, FISHEYE_LENS)],
    ids=["fisheye", "pinhole"],
)
def test_the_other_lens_is_named_where_it_fits(lens, camera, wrong):
    pixel = take_wide(0, lens, camera, COUNT)
    mistaken, right = fitted(wrong, pixel), fitted(lens, pixel)
    assert noise_with(mistaken, lens.model) < MAX_NOISE_RATIO * mistaken.noise
    assert noise_with(mistaken, lens.model) == pytest.approx(0.15, rel=0.05)
    assert noise_with(right, wrong.model) > right.noise


def test_a_lens_without_much_distortion_may_be_either():
    seen = take_pictures(0, COUNT)
    for model in ("pinhole", "fisheye"):
        own = fitted(replace(LENS, model=model), seen.pixel)
        other = "fisheye" if model == "pinhole" else "pinhole"
        assert noise_with(own, other) > MAX_NOISE_RATIO * own.noise
    assert abs(CAMERA[4]) > 0.1  # though not without any
