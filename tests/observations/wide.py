"""Corners of a board before a wide-angle lens, at poses that reach the edges of the picture."""

import numpy as np

from taskcal.geometry import se3
from taskcal.kernels.projection import FISHEYE, PINHOLE, project
from taskcal.observations.camera import KILO, Lens
from tests.observations.pictured import CORNERS

FISHEYE_LENS = Lens(model="fisheye", width=1600, height=1200)
FISHEYE_CAMERA = np.array([0.62, 0.622, 0.81, 0.6, 0.03, -0.01, 0.004, -0.001])
"""About 148° across."""


def take_wide(seed: int, lens: Lens, camera: np.ndarray, count: int = 20, noise: float = 0.15) -> np.ndarray:
    """Pixels of all corners of a board in so many pictures, whole in each."""
    rng, out = np.random.default_rng(seed), list[np.ndarray]()
    numbers = camera * np.repeat([KILO, 1.0], [4, len(camera) - 4])
    code = FISHEYE if lens.model == "fisheye" else PINHOLE
    while len(out) < count:
        # the board's middle anywhere in the picture, turned towards the camera and by up to 35° away from it
        side = np.append(rng.uniform(-1.0, 1.0, 2) * np.array([1.1, 0.9]), 0.0)
        ahead = se3.exp(side)
        turn = ahead @ se3.exp(rng.uniform(-0.6, 0.6, 3) * [1.0, 1.0, 5.0])
        place = rng.uniform(0.25, 0.45) * ahead[:, 2] - turn @ CORNERS.mean(axis=0)
        pixel = project(code, numbers, np.tile(turn, (54, 1, 1)), np.tile(place, (54, 1)), CORNERS)[0]
        if np.isfinite(pixel).all() and ((pixel > 10) & (pixel < [lens.width - 10, lens.height - 10])).all():
            out.append(pixel)
    pixel = np.concatenate(out)
    return pixel + noise * rng.normal(size=pixel.shape)
