"""A task to begin with: a box in front of a robot, in which it works with the tool down."""

from collections.abc import Iterator
from contextlib import suppress
from itertools import product

import numpy as np
import tomli_w
from jaxtyping import Float

from taskcal.arguments import checked
from taskcal.errors import ReachError
from taskcal.geometry import se3
from taskcal.kinematics.inverse import closes, find_posture, follow, posture_margin
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task
from taskcal.task.workspace import Orientation, Workspace

SEEDS = 1024
"""Postures all over the joint ranges, from which is seen how far and how high the tool gets, and where it points."""

DISTANCES, HEIGHTS = (0.5, 0.6, 0.7), (0.2, 0.3, 0.45)
"""Of the middles that are tried, before the base over how far the tool gets, and above its foot over how high: no box stands on the
foot's plane, where the floor is."""

EDGES = (0.3, 0.25, 0.2, 0.15, 0.1, 0.05)
"""Of the boxes that are tried, over how far the tool gets, and upright over how high where that is less."""

DIRECTIONS = np.radians([0.0, 180.0, 45.0, 90.0])
"""From down towards forward, in which the tool's z axis is tried to point: up for a robot whose tool frame counts it backwards."""

NEAR = np.cos(np.radians(30.0))
"""Cosine of the angle within which one of the postures has to bring the tool to a direction: else it is not searched for."""

TURNS = np.radians([0.0, 90.0, 180.0, 270.0])
"""About the tool's axis."""

TRIED = 6
"""Of the middles with the most room, in which boxes are tried."""

CONE, CONE_JOINTS = np.radians(20.0), 6
"""Tilt that the tool takes anywhere in the box, of robots with at least so many joints: others cannot tilt it wherever it is."""

ENOUGH = 0.95
"""Share of the poses of a box that have to be reached on one branch."""

ALONG = 4
"""Poses along each edge of a box that is tried, its faces included."""

ACCURACY_M = 1e-4
"""Error that such a task allows, in space; a convention, to be changed."""

DECIMALS = 2
"""Of metres, to which places and edges are rounded."""


MEASURED_EDGE = 0.1
"""Of a box where a robot was measured, over its reach: smaller than what campaigns span."""


@checked
def default_task(model: ErrorModel) -> Task:
    """A task to begin with: a box in front of the robot, in which the tool points down and tilts a little.

    The largest box of some is taken of which the nominal robot reaches nearly all inside its limits without leaving its branch; of
    places alike the one with the most room to limits and singular postures. Down is where the weights of the robot's file pull.

    Args:
        model: of the robot.

    Raises:
        ReachError: the robot reaches none of the places that are tried.
    """
    model = model.nominal
    poses = _postures(model)
    far, low, high = _room(poses)
    size = np.array([far, far, min(far, high - low)])
    best: tuple[float, Workspace] | None = None
    for direction in DIRECTIONS:
        middles = sorted(_middles(model, poses, float(direction)), key=lambda one: -one[0])[:TRIED]
        for edge, (_, T, q) in product(EDGES, middles):
            space = _box(model, T, edge * size)
            share = float(follow(model, _grid(space), q).reached.mean())
            if best is None or share > best[0]:
                best = share, space
            if share >= ENOUGH:
                return Task(name="task", workspace=space, accuracy=ACCURACY_M)
    if best is None:
        raise ReachError(
            f"{model.robot.name} reaches no place in front of its base with the tool down, up or forward inside its limits; "
            "write a task file, or widen the limits in the robot file"
        )
    return Task(name="task", workspace=best[1], accuracy=ACCURACY_M)


def measured_task(model: ErrorModel, q: Float[np.ndarray, "n joints"]) -> Task:
    """A task to begin with where a robot was measured: a box about the pose nearest to the middle of all, without a tolerance.

    A calibration knows little of where nothing was measured: a verdict over a box elsewhere would be one of the place.

    Args:
        model: of the robot.
        q: measured joint positions, radians.
    """
    T = model.nominal.poses(q)
    middle = T[np.argmin(np.linalg.norm(T[:, :3, 3] - np.median(T[:, :3, 3], axis=0), axis=1))]
    cone = CONE if len(model.robot.joints) >= CONE_JOINTS else 0.0
    space = Workspace(
        T_base_frame=np.eye(4),
        shape="box",
        center=middle[:3, 3],
        size=np.full(3, MEASURED_EDGE * model.robot.reach),
        turned=np.eye(3),
        orientations=(Orientation(rotation=middle[:3, :3], cone=cone),),
    )
    return Task(name="task", workspace=space)


def task_text(task: Task) -> str:
    """The file of a task that `default_task` made."""
    space = task.workspace
    assert space is not None
    return tomli_w.dumps(
        {
            "name": task.name,
            "workspace": {
                "frame": "base",
                "shape": "box",
                "center_mm": np.round(space.center * 1e3, 1).tolist(),
                "size_mm": np.round(space.size * 1e3, 1).tolist(),
                "orientation": [
                    {
                        "quaternion": se3.to_quaternion(o.rotation[None])[0].round(9).tolist(),
                        "cone_deg": round(float(np.degrees(o.cone)), 3),
                    }
                    for o in space.orientations
                ],
            },
        }
        | ({} if task.accuracy is None else {"accuracy": {"position_mm": task.accuracy * 1e3}})
    )


def _postures(model: ErrorModel) -> Float[np.ndarray, "n 4 4"]:
    """Poses of the tool all over the joint ranges."""
    from scipy.stats import qmc

    limits = np.clip(model.robot.limits, -np.pi, np.pi)
    q = qmc.scale(qmc.Sobol(len(limits), rng=0).random(SEEDS), limits[:, 0], limits[:, 1])
    return model.poses(q[closes(model, q)])


def _room(poses: Float[np.ndarray, "n 4 4"]) -> tuple[float, float, float]:
    """How far from the base's axis the tool gets, and how low and how high above the foot, metres."""
    x, y, z = poses[:, :3, 3].T
    low, high = float(z.min()), float(z.max())
    return float(np.hypot(x, y).max()), max(low, 0.0) if high > 0.0 else low, high


def _middles(
    model: ErrorModel, poses: Float[np.ndarray, "n 4 4"], direction: float
) -> Iterator[tuple[float, Float[np.ndarray, "4 4"], Float[np.ndarray, " joints"]]]:
    """Poses of the tool that are reached, with the distance from limits and singular postures, and the joint positions."""
    far, low, high = _room(poses)
    down, (x, y, z) = model.robot.statics.gravity, np.eye(3)
    forward = x if abs(down @ x) < 0.5 else y  # hung on a wall, x may be up or down
    across = np.cross(down, forward)
    across /= np.linalg.norm(across)
    along = np.cos(direction) * down + np.sin(direction) * np.cross(across, down)
    R = np.column_stack([np.cross(across, along), across, along])
    if (poses[:, :3, 2] @ along).max() < NEAR:
        return
    turns = TURNS
    for distance, height in product(DISTANCES, HEIGHTS):
        place = np.round(distance * far * forward + (low + height * (high - low)) * z, DECIMALS)
        reached: list[tuple[float, float, Float[np.ndarray, "4 4"], Float[np.ndarray, " joints"]]] = []
        for turn in turns:
            T = se3.pose(R @ se3.exp(np.array([[0.0, 0.0, turn]]))[0], place)
            with suppress(ReachError):
                q = find_posture(model, T)
                reached.append((float(posture_margin(model, q[None])[0]), turn, T, q))
        if reached:
            margin, turn, T, q = max(reached, key=lambda one: one[0])
            turns = np.array(
                [turn]
            )  # what is best at one place is about as good at the others, and each takes a search
            yield margin, T, q


def _box(model: ErrorModel, T: Float[np.ndarray, "4 4"], size: Float[np.ndarray, " 3"]) -> Workspace:
    """A box about a pose of the tool."""
    cone = CONE if len(model.robot.joints) >= CONE_JOINTS else 0.0
    return Workspace(
        T_base_frame=np.eye(4),
        shape="box",
        center=T[:3, 3],
        size=np.maximum(np.round(size, DECIMALS), 10.0**-DECIMALS),
        turned=np.eye(3),
        orientations=(Orientation(rotation=T[:3, :3], cone=cone),),
    )


def _grid(space: Workspace) -> Float[np.ndarray, "n 4 4"]:
    """Poses of the tool over a box, its faces included: straight and tilted to either side, in turn."""
    at = np.array(list(product(np.linspace(0.0, 1.0, ALONG), repeat=3)))
    tilts = np.arange(len(at)) % 5
    u = np.column_stack([at, np.where(tilts, 1.0, 0.0), tilts / 4.0, np.full(len(at), 0.5)])
    return space.place(u)
