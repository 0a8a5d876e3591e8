"""Where sockets, anchors or landmarks could stand for a task, where nobody says where they do."""

import numpy as np
from jaxtyping import Float

from taskcal.adaptation.camera_way import FARTHEST, NEAREST
from taskcal.adaptation.socket_way import BELOW
from taskcal.adaptation.wire_way import LONGEST, SHORTEST
from taskcal.measurement.observation import Way
from taskcal.measurement.observation.socket_distance import CALLIPER, SocketDistance
from taskcal.measurement.standing import Standing
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, reach_task

POSES = 60
"""Of the task, whose tool points say where to stand."""

PLACES = ("first", "second", "third")
"""Where a block stands, one after another."""

APART = 0.1
"""Distance of the two sockets of a block, metres."""

NEARLY_UP = np.radians(30.0)
"""A block whose sockets would lean less stands upright."""

ANCHORS: dict[str, tuple[float, float]] = {"front": (0.0, 30.0), "left": (80.0, 0.0), "right": (-80.0, 15.0)}
"""Each anchor's angle about the direction in which the tool points, from the way out from the robot, and its angle towards
that direction; degrees."""

FAR_SHARE = 0.5
"""How far an anchor stands from the middle of the task, over the robot's reach, as far as the wire allows."""

LANDMARKS = ("a", "b", "c")


def stand_by_default(
    way: Way,
    model: ErrorModel,
    task: Task,
    T_tool_tip: Float[np.ndarray, "4 4"],
    limits: tuple[float, float] | None = None,
) -> Standing:
    """Sockets where the tool works, anchors around it, or landmarks before it.

    Args:
        way: of measuring, not with a tracker.
        model: of the robot.
        task: what the robot has to do.
        T_tool_tip: what the tool carries; its z axis points away from the tool.
        limits: lengths of a wire, or distances of a camera, metres; their defaults where none are given.

    Raises:
        ReachError: the robot does not reach the task.
    """
    tip = model.poses(reach_task(model, task, POSES).q) @ T_tool_tip
    p, pointing = tip[:, :3, 3], tip[:, :3, 2].mean(axis=0)
    pointing = tip[0, :3, 2] if np.linalg.norm(pointing) < 0.1 else pointing / np.linalg.norm(pointing)
    if way == "socket":
        return _blocks(p, pointing)
    if way == "wire":
        low, high = limits or (SHORTEST, LONGEST)
        return _anchors(
            p, pointing, float(np.clip(FAR_SHARE * model.robot.reach, low + (high - low) / 4, (low + high) / 2))
        )
    low, high = limits or (NEAREST, FARTHEST)
    return _landmarks(p, pointing, 0.5 * (low + high))


def block_distances() -> tuple[SocketDistance, ...]:
    """Known of the block that is assumed: how far apart its sockets are, as a good calliper tells it."""
    return tuple(
        SocketDistance(a=f"{place}/a", b=f"{place}/b", distance=APART, uncertainty=CALLIPER, statement="a,b")
        for place in PLACES
    )


def _blocks(p: Float[np.ndarray, "n 3"], pointing: Float[np.ndarray, " 3"]) -> Standing:
    """A block with two sockets at three places, as far from one another as the task has room."""
    up = np.array([0.0, 0.0, 1.0])
    axis = up if -pointing @ up > np.cos(NEARLY_UP) else -pointing
    side = _outward(p.mean(axis=0), axis)[1]
    names: list[str] = []
    position: list[np.ndarray] = []
    for place, middle in zip(PLACES, _far_apart(p, len(PLACES)), strict=True):
        middle = np.maximum(middle, [-np.inf, -np.inf, BELOW])
        names += [f"{place}/a", f"{place}/b"]
        position += [middle - 0.5 * APART * side, middle + 0.5 * APART * side]
    return Standing(names=tuple(names), position=np.stack(position), direction=np.tile(axis, (len(names), 1)))


def _anchors(p: Float[np.ndarray, "n 3"], pointing: Float[np.ndarray, " 3"], length: float) -> Standing:
    """Three anchors on different sides of the task, and at different heights."""
    middle = p.mean(axis=0)
    outward, side = _outward(middle, pointing)
    position = [
        middle + length * (np.cos(lean) * (np.cos(around) * outward + np.sin(around) * side) + np.sin(lean) * pointing)
        for around, lean in np.radians(list(ANCHORS.values()))
    ]
    return Standing(
        names=tuple(ANCHORS),
        position=_on_the_floor(np.stack(position)),
        direction=np.tile(-pointing, (len(ANCHORS), 1)),
    )


def _landmarks(p: Float[np.ndarray, "n 3"], pointing: Float[np.ndarray, " 3"], distance: float) -> Standing:
    """Three landmarks before the tool, as far from one another as the task has room, all facing it."""
    position = _on_the_floor(_far_apart(p, len(LANDMARKS)) + distance * pointing)
    return Standing(names=LANDMARKS, position=position, direction=np.tile(-pointing, (len(LANDMARKS), 1)))


def _on_the_floor(position: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Not lower than the robot's base, which may stand on a table."""
    return np.maximum(position, [-np.inf, -np.inf, 0.0])


def _outward(
    middle: Float[np.ndarray, " 3"], axis: Float[np.ndarray, " 3"]
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Across an axis: away from the robot's base, and to the left of that."""
    for wish in (middle * [1.0, 1.0, 0.0], np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])):
        across = wish - (wish @ axis) * axis
        if np.linalg.norm(across) > 0.3 * max(float(np.linalg.norm(wish)), 1e-3):
            outward = across / np.linalg.norm(across)
            return outward, np.cross(axis, outward)
    raise AssertionError("no axis is along both x and z")


def _far_apart(p: Float[np.ndarray, "n 3"], count: int) -> Float[np.ndarray, "count 3"]:
    """Some of the points, each the one farthest from those before; the first is farthest from the middle."""
    chosen = [int(np.argmax(np.linalg.norm(p - p.mean(axis=0), axis=1)))]
    while len(chosen) < count:
        chosen.append(int(np.argmax(np.linalg.norm(p[:, None] - p[chosen], axis=2).min(axis=1))))
    return p[chosen]
