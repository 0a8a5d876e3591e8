"""A virtual robot with a camera on its wrist, before a printed board: the corners that it sees, projected with noise."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from taskcal.arguments import joints_checked
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.kernels.projection import project
from taskcal.observations import Scene
from taskcal.observations.board import Boards
from taskcal.observations.calibration_board import Board
from taskcal.observations.camera import KILO, LENSES, Lens
from taskcal.observations.pixels import COMPONENTS, EDGE_PX
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
from taskcal.virtual.rendering import render_boards

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
    T_camera_board: Float[np.ndarray, "n boards 4 4"]
    image: Int[np.ndarray, " c"]
    """Number of each corner's image."""
    board: Int[np.ndarray, " c"]
    """Number of each corner's board."""
    id: Int[np.ndarray, " c"]
    """Number of each corner on the board."""
    pixel: Float[np.ndarray, "c 2"]


@joints_checked
def take_shots(
    model: ErrorModel,
    q: Float[np.ndarray, "n joints"],
    boards: Sequence[Board],
    camera: VirtualCamera,
    *,
    rng: np.random.Generator,
    options: SimulationOptions | None = None,
) -> tuple[Shots, Truth]:
    """Take images of boards that stand side by side before a virtual robot, from postures near those given.

    Args:
        model: the model that the true robot follows.
        q: joint positions, radians.
        boards: in the sizes that were measured.
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
    middle = se3.pose(se3.exp(scene.unknown[3:]), scene.unknown[:3])
    lens, numbers = camera.lens, camera.numbers * np.repeat([KILO, 1.0], [4, len(camera.numbers) - 4])
    T_base_board = middle @ _side_by_side(boards)
    T = se3.inverse(found.target)[:, None] @ T_base_board
    parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for b, board in enumerate(boards):
        corners, n, m = board.corners(), len(q), len(board.ids())
        each = np.repeat(T[:, b], m, axis=0)
        pixel, _ = project(LENSES[lens.model], numbers, each[:, :3, :3], each[:, :3, 3], np.tile(corners, (n, 1)))
        pixel = (pixel + camera.noise_px * rng.normal(size=pixel.shape)).reshape(n, m, 2)
        with np.errstate(invalid="ignore"):
            seen = ((pixel > EDGE_PX) & (pixel < np.array([lens.width, lens.height]) - EDGE_PX)).all(axis=2)
        sight = T[:, b, :3, 3] + T[:, b, :3, :3] @ corners.mean(axis=0)
        seen &= ((sight * T[:, b, :3, 2]).sum(axis=1) > np.cos(FLATTEST) * np.linalg.norm(sight, axis=1))[:, None]
        if not board.markers:  # found as a whole, or not at all
            seen &= seen.all(axis=1, keepdims=True)
        image, corner = np.nonzero(seen)
        parts.append((image, board.ids()[corner], pixel[image, corner]))
    unknowns = {f"camera.{name}": float(value) for name, value in zip(lens.unknowns, camera.numbers, strict=True)}
    for board, at in zip(boards, T_base_board, strict=True):
        place = zip(COMPONENTS, [*at[:3, 3], *se3.log(at[:3, :3])], strict=True)
        unknowns |= {f"board {board.name}.{name}": float(value) for name, value in place}
    truth = Truth(
        model=model,
        x=robot.x,
        T_tracker_base=np.eye(4),
        T_tool_target=scene.T_tool_target[None],
        unknowns=unknowns,
    )
    image, ids, pixel = (np.concatenate(part) for part in zip(*parts, strict=True))
    of = np.repeat(np.arange(len(boards)), [len(own) for own, *_ in parts])
    order = np.argsort(image, kind="stable")
    shots = Shots(q=found.q, T_camera_board=T, image=image[order], board=of[order], id=ids[order], pixel=pixel[order])
    return shots, truth


APART = 3.0
"""Squares from the last corner of a board to the first of the next beside it, whose sheets have half a square of white around."""


def _side_by_side(boards: Sequence[Board]) -> Float[np.ndarray, "boards 4 4"]:
    """Boards in one plane, the middle of all at the origin."""
    out, x, end = list[np.ndarray](), 0.0, 0.0
    for board in boards:
        (left, top, _), (right, bottom, _) = board.corners().min(axis=0), board.corners().max(axis=0)
        out.append(se3.translation(x - left, -0.5 * (top + bottom), 0.0))
        end = x + right - left
        x = end + APART * board.square_m
    return se3.translation(-0.5 * end, 0.0, 0.0) @ np.stack(out)


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


def render_shots(
    shots: Shots, boards: Sequence[Board], camera: VirtualCamera, rng: np.random.Generator
) -> Iterator[bytes]:
    """The images as PNG, one after another.

    Raises:
        TaskcalError: OpenCV is not installed.
    """
    try:
        from cv2 import imencode
    except ImportError as error:
        raise TaskcalError("images are written by OpenCV: pip install 'taskcal[images]'") from error
    for T in shots.T_camera_board:
        yield imencode(".png", render_boards(boards, camera.lens, camera.numbers, T, rng=rng))[1].tobytes()
