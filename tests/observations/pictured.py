"""Corners of a board in the pictures of a virtual robot, projected, with noise."""

from dataclasses import dataclass, replace

import numpy as np

from taskcal.campaigns.campaign import Campaign
from taskcal.geometry import se3
from taskcal.kernels.projection import PINHOLE, project
from taskcal.observations import Pixels
from taskcal.observations.camera import KILO, Lens, calibrate_camera
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel

LENS = Lens(model="pinhole", width=1600, height=1200)
CAMERA = np.array([1.45, 1.452, 0.81, 0.6, -0.12, 0.08, 0.0005, -0.0008, 0.0])
PIXELS = CAMERA * np.repeat([KILO, 1.0], [4, 5])
COLUMNS, ROWS, SQUARE = 10, 7, 0.03
CORNERS = SQUARE * np.array([[c + 1.0, r + 1.0, 0.0] for r in range(ROWS - 1) for c in range(COLUMNS - 1)])
MODEL = ErrorModel(load_robot("ur5"))
MIDDLE = np.array([0.3, -1.5, 1.6, -1.7, -1.57, 0.2])
"""Joints, radians, about which pictures are taken."""
OTHER = ErrorModel(load_robot("abb-irb120"))
MIDDLE_OF_OTHER = np.array([0.3, 0.1, 0.1, 0.2, 1.2, 0.2])


@dataclass(frozen=True, kw_only=True)
class Pictured:
    """What is true, and what is seen."""

    x: np.ndarray
    """Parameters of the robot."""
    moving: np.ndarray
    """Camera on the wrist, or board on it."""
    standing: np.ndarray
    q: np.ndarray
    pixel: np.ndarray
    """Of every corner of every picture."""
    on_wrist: bool
    gears: np.ndarray
    """Amplitudes of what each drive errs once and twice a turn, as cosine and sine, radians."""
    model: ErrorModel = MODEL

    def poses(self, q: np.ndarray) -> np.ndarray:
        """Of the tool."""
        return arm_poses(q, self.x, self.gears, self.model)

    def moved(self, by: float) -> "Pictured":
        """The same with what stands so many metres to the side, along the board, without noise."""
        T = _board_in_camera(
            self.poses(self.q) @ self.moving, self.standing @ se3.translation(by, 0.0, 0.0), self.on_wrist
        )
        T = T.repeat(len(CORNERS), axis=0)
        pixel = project(PINHOLE, PIXELS, T[:, :3, :3], T[:, :3, 3], np.tile(CORNERS, (len(self.q), 1)))[0]
        return replace(self, pixel=pixel)

    def campaign(self, u_scale: float = 0.0) -> Campaign:
        """As it is read from a file."""
        n, m = len(self.q), len(CORNERS)
        names = tuple(map(str, range(n)))
        first = m * np.arange(n + 1)
        pictures = calibrate_camera(LENS, names, np.zeros(n, int), first, np.tile(CORNERS, (n, 1)), self.pixel)
        kind = Pixels(
            images=names,
            of=np.arange(n),
            boards=("floor",),
            u_scale=(u_scale,),
            lenses=(LENS,),
            moving=("camera",) if self.on_wrist else ("board floor",),
            pictures=(pictures,),
        )
        kind = replace(kind, start=kind.on_robot(self.model.poses(self.q)))
        M = kind.views(kind.start).moving.T
        return Campaign(
            ids=names,
            q=self.q,
            targets=("camera" if self.on_wrist else "board",),
            points=M[:, None, :3, 3],
            rotations=np.ascontiguousarray(M[:, :3, :3]),
            observations=(kind,),
        )


def arm_poses(q: np.ndarray, x: np.ndarray, gears: np.ndarray, model: ErrorModel = MODEL) -> np.ndarray:
    turned = np.stack([np.cos(q), np.sin(q), np.cos(2 * q), np.sin(2 * q)])
    return model.poses(q + (gears[:, None] * turned).sum(axis=0), x)


def take_pictures(
    seed: int,
    count: int = 20,
    *,
    on_wrist: bool = True,
    noise: float = 0.15,
    error: float = 0.0,
    gears: float = 0.0,
    model: ErrorModel = MODEL,
    middle: np.ndarray = MIDDLE,
) -> Pictured:
    """Pictures of a board, whole in each, by a robot that is off as its tolerances say.

    Args:
        seed: of all that is random.
        count: of pictures.
        on_wrist: whether the camera is, or the board.
        noise: of corners, pixels.
        error: of single poses, per axis, metres, and as many radians.
        gears: of the drives once and twice a turn, standard deviation of cosines and sines, radians.
        model: of the robot.
        middle: joints about which they are taken, radians.
    """
    rng = np.random.default_rng(seed)
    x, periodic = model.tolerances * rng.normal(size=len(model)), gears * rng.normal(size=(4, 6))
    sensor = se3.pose(se3.exp(0.1 * rng.normal(size=3)), np.array([0.03, -0.06, 0.05]) + 0.01 * rng.normal(size=3))
    # the board half a metre before the camera, its middle in sight, a little turned
    before = se3.pose(se3.exp(np.array([0.1, 0.05, 0.3])), np.array([0.0, 0.0, 0.5]))
    before = before @ se3.translation(*-CORNERS.mean(axis=0))
    there = model.poses(middle[None])[0] @ sensor
    moving, standing = (sensor, there @ before) if on_wrist else (sensor @ before, there)
    found: list[np.ndarray] = []
    while sum(map(len, found)) < count:
        q = middle + rng.uniform(-0.6, 0.6, (2000, 6)) * np.array([0.8, 0.5, 0.5, 1.0, 1.0, 2.0])
        T = _board_in_camera(arm_poses(q, x, periodic, model) @ moving, standing, on_wrist)
        seen = np.ones(len(q), dtype=bool)
        for corner in CORNERS[[0, COLUMNS - 2, -COLUMNS + 1, -1]]:
            pixel = project(PINHOLE, PIXELS, T[:, :3, :3], T[:, :3, 3], np.tile(corner, (len(q), 1)))[0]
            seen &= ((pixel > 20) & (pixel < [LENS.width - 20, LENS.height - 20])).all(axis=1)
        found.append(q[seen & (np.abs(T[:, 2, 2]) > 0.5) & (T[:, 2, 3] < 0.8)])
    q = np.concatenate(found)[:count]
    off = se3.error_transform(error * rng.normal(size=(count, 6)))
    T = _board_in_camera(arm_poses(q, x, periodic, model) @ off @ moving, standing, on_wrist).repeat(
        len(CORNERS), axis=0
    )
    pixel = project(PINHOLE, PIXELS, T[:, :3, :3], T[:, :3, 3], np.tile(CORNERS, (count, 1)))[0]
    pixel = pixel + noise * rng.normal(size=pixel.shape)
    return Pictured(
        x=x, moving=moving, standing=standing, q=q, pixel=pixel, on_wrist=on_wrist, gears=periodic, model=model
    )


def _board_in_camera(moving: np.ndarray, standing: np.ndarray, on_wrist: bool) -> np.ndarray:
    return se3.inverse(moving) @ standing if on_wrist else se3.inverse(standing) @ moving
