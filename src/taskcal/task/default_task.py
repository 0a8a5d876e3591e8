"""A task to begin with: a box in front of a robot, in which it works with the tool down."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import tomli_w
from jaxtyping import Float

from taskcal.arguments import checked
from taskcal.errors import ReachError
from taskcal.geometry import se3
from taskcal.kinematics.inverse import closes, find_posture, freedom_of, posture_margin, spread_postures
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import MEASURING_TURN, Task, follow_inside
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

CONE = np.radians(20.0)
"""Tilt that the tool takes anywhere in the box, of robots that command all directions: others cannot tilt it wherever it is."""

ENOUGH, MIN_REACHED = 0.95, 0.5
"""Share of the poses of a box that have to be reached on one branch; and where no box has so many, the least that makes one."""

MIN_ARM_SHARE, MIN_MOTION_M = 0.1, 1e-6
"""How far an arm on a rail gets over the rail's length, else it is a carriage with a wrist; and the motion of its tool, metres per
radian, from which a joint counts as moving it."""

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
    whole = freedom_of(model).whole
    reached = _postures(model)
    best: tuple[float, Workspace] | None = None
    for direction in (*DIRECTIONS, None):
        if direction is None:
            middles, turn = (
                [_comfortable(model, reached)],
                Orientation(rotation=np.eye(3), cone=MEASURING_TURN, spin=np.pi),
            )
        else:
            middles = sorted(_middles(model, reached, float(direction)), key=lambda one: -one[0])[:TRIED]
            turn = Orientation(rotation=np.eye(3), cone=CONE if whole else 0.0)
        for edge, (_, T, q) in product(EDGES, middles):
            space = _box(T, edge * reached.size, turn)
            share = float(follow_inside(model, space, _grid(space), q).reached.mean())
            if best is None or share > best[0]:
                best = share, space
            if share >= ENOUGH:
                return Task(name="task", workspace=space, accuracy=ACCURACY_M)
        if direction == DIRECTIONS[-1] and best is not None and best[0] >= MIN_REACHED:
            break
    if best is None or best[0] < MIN_REACHED:
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
    whole = freedom_of(model).whole
    turn = Orientation(rotation=np.eye(3), cone=CONE if whole else MEASURING_TURN, spin=0.0 if whole else np.pi)
    return Task(name="task", workspace=_box(middle, np.full(3, MEASURED_EDGE * model.robot.reach), turn))


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
                    | ({"spin": "free"} if o.spin == np.pi else {})
                    for o in space.orientations
                ],
            },
        }
        | ({} if task.accuracy is None else {"accuracy": {"position_mm": task.accuracy * 1e3}})
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class _Postures:
    """What the tool reaches from all over the joint ranges; an arm on a rail from the middle of the rail."""

    q: Float[np.ndarray, "n joints"]
    T: Float[np.ndarray, "n 4 4"]
    foot: Float[np.ndarray, " 3"]
    """Of the arm, at the height of the base, metres."""
    low: float
    high: float
    """Above the foot, metres."""
    far: float
    """How far from the foot's axis, metres."""
    carriage: bool
    """Whether the first axes slide and carry no arm: there is no front."""

    @property
    def size(self) -> Float[np.ndarray, " 3"]:
        """Edges of which boxes have a share, metres."""
        return np.array([self.far, self.far, min(self.far, self.high - self.low)])


def _postures(model: ErrorModel) -> _Postures:
    """Postures all over the joint ranges."""
    robot, q = model.robot, spread_postures(model.robot, SEEDS)
    q = q[closes(model, q)]
    slides = [*robot.prismatic, False].index(False)
    middle, span = robot.bounded_limits().mean(axis=1), np.ptp(robot.bounded_limits()[:slides], axis=1)
    still = q.copy()
    still[:, :slides] = middle[:slides]
    still = still[closes(model, still)]
    on_rail, T, foot = False, model.poses(q), np.zeros(3)
    if 0 < slides < len(middle) and len(still):
        J = model.joint_jacobian(still)[:, :3, slides:]
        moved = np.linalg.matrix_rank(J, tol=MIN_MOTION_M).max(initial=0)
        own, at = model.poses(still), robot.joint_frames(middle[None])[0, slides, :3, 3] * [1.0, 1.0, 0.0]
        on_rail = moved == 3 and np.linalg.norm(own[:, :2, 3] - at[:2], axis=1).max() > MIN_ARM_SHARE * span.max()
        if on_rail:
            q, T, foot = still, own, at
    z, far = T[:, 2, 3], float(np.linalg.norm(T[:, :2, 3] - foot[:2], axis=1).max())
    low, high = float(z.min()), float(z.max())
    return _Postures(
        q=q,
        T=T,
        foot=foot,
        low=max(low, 0.0) if high > 0.0 else low,
        high=high,
        far=far,
        carriage=slides > 0 and not on_rail,
    )


def _comfortable(
    model: ErrorModel, reached: _Postures
) -> tuple[float, Float[np.ndarray, "4 4"], Float[np.ndarray, " joints"]]:
    """The pose farthest from limits and singular postures, with the distance and the joint positions."""
    margin = posture_margin(model, reached.q)
    best = int(np.argmax(margin))
    return float(margin[best]), reached.T[best], reached.q[best]


def _middles(
    model: ErrorModel, reached: _Postures, direction: float
) -> Iterator[tuple[float, Float[np.ndarray, "4 4"], Float[np.ndarray, " joints"]]]:
    """Poses of the tool that are reached, with the distance from limits and singular postures, and the joint positions."""
    down, (x, y, z) = model.robot.statics.gravity, np.eye(3)
    forward = x if abs(down @ x) < 0.5 else y  # hung on a wall, x may be up or down
    across = np.cross(down, forward)
    across /= np.linalg.norm(across)
    along = np.cos(direction) * down + np.sin(direction) * np.cross(across, down)
    R = np.column_stack([np.cross(across, along), across, along])
    if (reached.T[:, :3, 2] @ along).max() < NEAR:
        return
    turns, up = TURNS, reached.high - reached.low
    places = [
        reached.foot + distance * reached.far * forward + (reached.low + height * up) * z
        for distance, height in product(DISTANCES, HEIGHTS)
    ]
    if reached.carriage:
        corners = reached.T[:, :3, 3].min(axis=0), reached.T[:, :3, 3].max(axis=0)
        places.append(0.5 * (corners[0] + corners[1]))
    for place in np.round(places, DECIMALS):
        found: list[tuple[float, float, Float[np.ndarray, "4 4"], Float[np.ndarray, " joints"]]] = []
        for turn in turns:
            T = se3.pose(R @ se3.exp(np.array([[0.0, 0.0, turn]]))[0], place)
            with suppress(ReachError):
                q = find_posture(model, T)
                found.append((float(posture_margin(model, q[None])[0]), turn, T, q))
        if found:
            margin, turn, T, q = max(found, key=lambda one: one[0])
            turns = np.array(
                [turn]
            )  # what is best at one place is about as good at the others, and each takes a search
            yield margin, T, q


def _box(T: Float[np.ndarray, "4 4"], size: Float[np.ndarray, " 3"], turn: Orientation) -> Workspace:
    """A box about a pose of the tool, which is turned as freely as stated."""
    return Workspace(
        T_base_frame=np.eye(4),
        shape="box",
        center=T[:3, 3],
        size=np.maximum(np.round(size, DECIMALS), 10.0**-DECIMALS),
        turned=np.eye(3),
        orientations=(replace(turn, rotation=T[:3, :3]),),
    )


def _grid(space: Workspace) -> Float[np.ndarray, "n 4 4"]:
    """Poses of the tool over a box, its faces included: straight and tilted to either side, in turn."""
    at = np.array(list(product(np.linspace(0.0, 1.0, ALONG), repeat=3)))
    tilts = np.arange(len(at)) % 5
    u = np.column_stack([at, np.where(tilts, 1.0, 0.0), tilts / 4.0, np.full(len(at), 0.5)])
    return space.place(u)
