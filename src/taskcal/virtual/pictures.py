"""A virtual robot with a camera on its wrist, before a printed board: the corners that it sees, projected with noise."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.kernels.projection import project
from taskcal.observations import Scene
from taskcal.observations.board import Boards
from taskcal.observations.calibration_board import Board
from taskcal.observations.camera import KILO, LENSES, Lens
from taskcal.observations.pixels import EDGE_PX
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr
from taskcal.virtual.cell import (
    MAX_CELLS,
    OutOfReachError,
    SimulationOptions,
    TrueRobot,
    Truth,
    Visit,
    draw_defects,
    visit,
)
from taskcal.virtual.rendering import render_board

FLATTEST = np.radians(75.0)
"""Angle between line of sight and the board's normal from which on corners are not found."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class VirtualCamera:
    """A camera as it is."""

    lens: Lens
    numbers: Float[np.ndarray, " k"]
    """As `Lens.unknowns`."""
    noise_px: float = 0.15
    """Standard deviation of a corner in each direction; those of detected corners are 0.05 to 0.3 pixels."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Shots:
    """What a virtual camera saw."""

    q: Float[np.ndarray, "n joints"]
    """Joints as the controller says, radians."""
    T_camera_board: Float[np.ndarray, "n 4 4"]
    image: Int[np.ndarray, " c"]
    """Number of each corner's image."""
    id: Int[np.ndarray, " c"]
    """Number of each corner on the board."""
    pixel: Float[np.ndarray, "c 2"]


def take_shots(
    model: ErrorModel,
    q: Float[np.ndarray, "n joints"],
    board: Board,
    camera: VirtualCamera,
    *,
    rng: np.random.Generator,
    options: SimulationOptions | None = None,
) -> tuple[Shots, Truth]:
    """Take images of a board that stands before a virtual robot, from postures near those given.

    Args:
        model: the model that the true robot follows.
        q: joint positions, radians.
        board: in the size that was measured.
        camera: on the wrist.
        rng: source of the defects and of the noise.
        options: defects, errors of joints and of the model; what is of other instruments is not asked.

    Raises:
        CampaignError: the robot cannot look at the board from all postures, in none of some places of it.
    """
    chosen = options or SimulationOptions()
    robot = TrueRobot(
        model=model,
        x=draw_defects(model, rng) if chosen.x is None else chosen.x,
        T_tracker_base=np.eye(4),
        joint_error=np.broadcast_to(np.asarray(chosen.joint_error, dtype=float), q.shape[1:]),
        model_error=chosen.model_error,
    )
    scene, found = _visited(robot, q, chosen, rng)
    corners = board.corners()
    middle = se3.pose(se3.exp(scene.unknown[3:]), scene.unknown[:3])
    T_base_board = middle @ se3.translation(*-corners.mean(axis=0))
    T = se3.inverse(found.target) @ T_base_board
    n, m, lens = len(q), len(corners), camera.lens
    each, numbers = (
        np.repeat(T, m, axis=0),
        camera.numbers * np.concatenate([np.full(4, KILO), np.ones(len(camera.numbers) - 4)]),
    )
    pixel, _ = project(LENSES[lens.model], numbers, each[:, :3, :3], each[:, :3, 3], np.tile(corners, (n, 1)))
    pixel = (pixel + camera.noise_px * rng.normal(size=pixel.shape)).reshape(n, m, 2)
    seen = ((pixel > EDGE_PX) & (pixel < np.array([lens.width, lens.height]) - EDGE_PX)).all(axis=2)
    sight = T[:, :3, 3] + T[:, :3, :3] @ corners.mean(axis=0)
    seen &= ((sight * T[:, :3, 2]).sum(axis=1) > np.cos(FLATTEST) * np.linalg.norm(sight, axis=1))[:, None]
    if not board.markers:  # found as a whole, or not at all
        seen &= seen.all(axis=1, keepdims=True)
    image, corner = np.nonzero(seen)
    at = np.concatenate([T_base_board[:3, 3], se3.log(T_base_board[:3, :3])])
    names = [f"board {board.name}.{axis}" for axis in ("tx", "ty", "tz", "rx", "ry", "rz")]
    names += [f"camera.{name}" for name in lens.unknowns]
    truth = Truth(
        model=model,
        x=robot.x,
        T_tracker_base=np.eye(4),
        T_tool_target=scene.T_tool_target[None],
        unknowns=dict(zip(names, np.concatenate([at, camera.numbers]).tolist(), strict=True)),
    )
    shots = Shots(q=found.q, T_camera_board=T, image=image, id=board.ids()[corner], pixel=pixel[image, corner])
    return shots, truth


def _visited(
    robot: TrueRobot, q: Float[np.ndarray, "n joints"], options: SimulationOptions, rng: np.random.Generator
) -> tuple[Scene, Visit]:
    """The first of some places of the board at which the robot can look at it from all postures."""
    for _ in range(MAX_CELLS - 1):
        scene = Boards.stage(robot.model.nominal.poses(q), 1, rng)
        try:
            return scene, visit(robot, scene, q, conditions=options.conditions, rng=rng)
        except OutOfReachError:
            continue
    scene = Boards.stage(robot.model.nominal.poses(q), 1, rng)
    return scene, visit(robot, scene, q, conditions=options.conditions, rng=rng)


def render_shots(shots: Shots, board: Board, camera: VirtualCamera, rng: np.random.Generator) -> Iterator[bytes]:
    """The images as PNG, one after another.

    Raises:
        TaskcalError: OpenCV is not installed.
    """
    try:
        from cv2 import imencode
    except ImportError as error:
        raise TaskcalError("images are written by OpenCV: pip install 'taskcal[images]'") from error
    for T in shots.T_camera_board:
        yield imencode(".png", render_board(board, camera.lens, camera.numbers, T, rng=rng))[1].tobytes()
