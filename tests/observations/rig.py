"""Boards and cameras, on the wrist and beside a virtual robot, each with what it sees."""

from dataclasses import dataclass, replace

import numpy as np

from taskcal.campaigns.campaign import Campaign
from taskcal.geometry import se3
from taskcal.kernels.projection import PINHOLE, project
from taskcal.observations import Board, Pixels
from taskcal.observations.calibration_board import Ruler
from taskcal.observations.camera import KILO
from taskcal.reading.pictures import Corners, with_pictures
from tests.observations.pictured import CAMERA, LENS, MIDDLE, MODEL, arm_poses

OTHER = np.array([1.3, 1.31, 0.79, 0.61, 0.05, -0.03, -0.0005, 0.0003, 0.0])
"""Numbers of a second camera."""
FLOOR, SIDE = (
    Board(
        name=name,
        kind="charuco",
        columns=7,
        rows=5,
        square_m=0.03,
        marker_m=0.022,
        dictionary="5X5_100",
        first_marker=first,
        measured=Ruler(length_mm=100.0, u_mm=0.0),
    )
    for name, first in (("floor", 0), ("side", 30))
)
SENSOR = se3.pose(se3.exp(np.array([0.05, -0.08, 0.3])), np.array([0.03, -0.06, 0.05]))
"""Of what is on the tool, in its frame."""


def ahead(x: float, y: float, z: float, *turn: float) -> np.ndarray:
    """Pose of a board whose middle is somewhere in the frame of a camera."""
    return se3.pose(se3.exp(np.array(turn or (0.0, 0.0, 0.0))), np.array([x, y, z])) @ se3.translation(
        *-FLOOR.corners().mean(axis=0)
    )


@dataclass(frozen=True, kw_only=True)
class Rig:
    """What is true, and what is seen."""

    x: np.ndarray
    q: np.ndarray
    bodies: dict[str, np.ndarray]
    """Places of cameras and boards, in the tool frame if they are on the wrist, else in the base."""
    boards: tuple[Board, ...]
    numbers: dict[str, np.ndarray]
    """Of the cameras, by their names."""
    corners: tuple[Corners, ...]
    """Of each camera."""

    def campaign(
        self,
        boards: tuple[Board, ...] | None = None,
        cameras: tuple[int, ...] | None = None,
        *,
        targets: tuple[str, ...] = (),
        judged: bool = True,
    ) -> Campaign:
        """As it is read, with some of the boards and cameras, by default all; and with the targets of a calibration."""
        names = self.corners[0].images
        blank = Pixels(images=names, of=np.arange(len(names)))
        n = len(names)
        empty = Campaign(
            ids=names,
            q=self.q,
            targets=("camera",),
            points=np.zeros((n, 1, 3)),
            rotations=np.tile(np.eye(3), (n, 1, 1)),
            observations=(blank,),
        )
        chosen = self.boards if boards is None else boards
        corners = [
            of_boards(one, [board.name for board in chosen])
            for one in (self.corners if cameras is None else [self.corners[k] for k in cameras])
        ]
        given = (None,) * len(corners)
        return with_pictures(empty, corners, chosen, MODEL.robot, "pinhole", given, targets=targets, judged=judged)


def take_rig(
    seed: int,
    count: int,
    moving: dict[str, np.ndarray],
    standing: dict[str, np.ndarray],
    boards: tuple[Board, ...],
    cameras: dict[str, np.ndarray],
    *,
    noise: float = 0.15,
    error: float = 0.0,
    gears: float = 0.0,
    look: float = 0.35,
) -> Rig:
    """Images by a robot that is off as its tolerances say.

    Args:
        seed: of all that is random.
        count: of postures.
        moving: places of cameras and boards in the tool frame.
        standing: places of those that stand, in the base, for the nominal robot at `MIDDLE`.
        boards: all of them.
        cameras: their numbers, by names.
        noise: of corners, pixels.
        error: of single poses, per axis, metres, and as many radians.
        gears: of the drives once and twice a turn, standard deviation of cosines and sines, radians.
        look: how far joints go from `MIDDLE`, radians.
    """
    rng = np.random.default_rng(seed)
    x, periodic = MODEL.tolerances * rng.normal(size=len(MODEL)), gears * rng.normal(size=(4, 6))
    q = MIDDLE + look * rng.uniform(-1.0, 1.0, (count, 6)) * np.array([0.8, 0.7, 0.7, 1.2, 1.2, 3.0])
    tool = arm_poses(q, x, periodic) @ se3.error_transform(error * rng.normal(size=(count, 6)))
    names = tuple(f"{k:04d}.png" for k in range(count))
    found: list[Corners] = []
    for camera, numbers in cameras.items():
        pixels, parts = numbers * np.repeat([KILO, 1.0], [4, 5]), []
        label = f"camera {camera}".strip()
        for board in boards:
            body, places = f"board {board.name}", board.corners()
            if (label in moving) == (body in moving):
                continue
            T = (
                se3.inverse(tool @ moving[label]) @ standing[body]
                if label in moving
                else se3.inverse(standing[label]) @ tool @ moving[body]
            )
            each = T.repeat(len(places), axis=0)
            pixel = project(PINHOLE, pixels, each[:, :3, :3], each[:, :3, 3], np.tile(places, (count, 1)))[0]
            pixel += noise * rng.normal(size=pixel.shape)
            facing = np.repeat((T[:, 2, 2] > 0.4) & (T[:, 2, 3] < 1.5), len(places))
            with np.errstate(invalid="ignore"):
                seen = facing & ((pixel > 5) & (pixel < [LENS.width - 5, LENS.height - 5])).all(axis=1)
            image, corner = np.divmod(np.flatnonzero(seen), len(places))
            parts.append((image, board.name, board.ids()[corner], pixel[seen]))
        found.append(
            Corners(
                source="shots",
                images=names,
                width=LENS.width,
                height=LENS.height,
                image=np.concatenate([image for image, *_ in parts]),
                board=tuple(name for image, name, *_ in parts for _ in image),
                id=np.concatenate([ids for *_, ids, _ in parts]),
                pixel=np.concatenate([pixel for *_, pixel in parts]),
                camera=camera,
            )
        )
    return Rig(x=x, q=q, bodies={**moving, **standing}, boards=boards, numbers=cameras, corners=tuple(found))


def two_boards(seed: int, count: int = 24, *, by: float = 0.0, **more: float) -> Rig:
    """A camera on the wrist, and two boards that stand before it, tilted to each other; the second so many metres aside."""
    there = MODEL.poses(MIDDLE[None])[0] @ SENSOR
    standing = {
        "board floor": there @ ahead(-0.1, 0.0, 0.5, 0.1, 0.05, 0.3),
        "board side": there @ ahead(0.12 + by, 0.02, 0.45, 0.3, -0.4, 0.2),
    }
    return take_rig(seed, count, {"camera": SENSOR}, standing, (FLOOR, SIDE), {"": CAMERA}, **more)


def of_boards(corners: Corners, names: list[str]) -> Corners:
    """The corners of some boards."""
    own = np.flatnonzero(np.isin(corners.board, names))
    return replace(
        corners,
        image=corners.image[own],
        board=tuple(corners.board[k] for k in own),
        id=corners.id[own],
        pixel=corners.pixel[own],
    )


def two_cameras(seed: int, count: int = 24, **more: float) -> Rig:
    """Two cameras on the wrist that see one board."""
    there = MODEL.poses(MIDDLE[None])[0] @ SENSOR
    moving = {
        "camera left": SENSOR,
        "camera right": SENSOR @ se3.pose(se3.exp(np.array([0.0, -0.15, 0.1])), np.array([0.07, 0.0, 0.0])),
    }
    standing = {"board floor": there @ ahead(0.02, 0.0, 0.5, 0.1, 0.05, 0.3)}
    return take_rig(seed, count, moving, standing, (FLOOR,), {"left": CAMERA, "right": OTHER}, **more)


def wrist_and_floor(seed: int, count: int = 24, **more: float) -> Rig:
    """A camera on the wrist that sees a board on the floor, and a camera beside the robot that sees a board on the wrist."""
    there = MODEL.poses(MIDDLE[None])[0]
    carried = se3.pose(se3.exp(np.array([0.0, 2.0, 0.5])), np.array([0.0, 0.1, 0.02]))
    beside = there @ carried @ se3.inverse(ahead(0.0, 0.0, 0.6, 0.2, -0.1, 0.4))
    moving = {"camera wrist": SENSOR, "board side": carried}
    standing = {"board floor": there @ SENSOR @ ahead(0.0, 0.0, 0.5, 0.1, 0.05, 0.3), "camera cell": beside}
    return take_rig(seed, count, moving, standing, (FLOOR, SIDE), {"wrist": CAMERA, "cell": OTHER}, **more)
