"""A small robot's cell without a tracker, and virtual robots that are measured in it."""

from dataclasses import replace
from functools import cache

import numpy as np

from taskcal.campaigns.campaign import Campaign
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.kinematics.inverse import solve_near
from taskcal.observations import Board, Fixtures, Measured, SocketInstrument, StatedCamera
from taskcal.observations.base import TrackerNoise
from taskcal.observations.calibration_board import Ruler
from taskcal.observations.camera import Lens, calibrate_camera
from taskcal.observations.instrument import Instrument, instrument_class
from taskcal.planning.plan import Plan, plan
from taskcal.task.task import reach_task
from taskcal.task.workspace import Orientation
from tests.reading.virtual_task import MODEL, box_before_the_robot

TIP = se3.translation(0.01, -0.02, 0.1)
TASK = box_before_the_robot(
    "cell", [0.4, 0.0, 0.3], [0.25, 0.4, 0.2], Orientation(rotation=np.diag([1.0, -1.0, -1.0]), cone=0.3, spin=0.5)
)
INSTRUMENTS = ("socket", "wire", "camera")
GOAL = reach_task(MODEL, TASK, 60, 1)
COUNT, CANDIDATES = 36, 300


LENS = Lens(model="pinhole", width=1600, height=1200)
CAMERA = StatedCamera(lens=LENS, numbers=LENS.start(0.9), focus=(0.3, 0.8))
BOARD = Board(
    kind="charuco", columns=10, rows=7, square_m=0.03, marker_m=0.022, dictionary="5X5_100",
    measured=Ruler(length_mm=100.0, u_mm=0.02),
)  # fmt: skip


@cache
def instrument_of(way: str) -> Instrument:
    """By default of the task; sockets at two places; images of a board from a camera on the wrist."""
    stated = {"board": (BOARD,), "camera": CAMERA} if way == "pixels" else {}
    made = instrument_class(way).set_up(MODEL, TASK, TIP, **stated)
    if not isinstance(made, SocketInstrument):
        return made
    few = {name: getattr(made.fixtures, name)[:4] for name in ("names", "position", "direction")}
    return replace(made, fixtures=Fixtures(**few), distances=made.distances[:2])


@cache
def plan_of(way: str) -> Plan:
    """A small plan; few postures see all of a board."""
    candidates = 5 * CANDIDATES if way == "pixels" else CANDIDATES
    return plan(MODEL, TASK, COUNT, observe=instrument_of(way), candidates=candidates)


def measure(
    way: Instrument, q: np.ndarray, of: np.ndarray, x: np.ndarray, rng: np.random.Generator, error: float
) -> Campaign:
    """A virtual robot measured in postures: what each reads, with the kind's noise and a model error at the tip."""
    if way.name == "pixels":
        return photograph(way, q, of, x, rng, error)
    kind, things = way.observation(of), way.fixtures.position
    n = len(q)
    off = error * rng.normal(size=(n, 3))
    T = MODEL.poses(q, x)
    tip = T @ way.T_tool_tip
    points = np.zeros((n, 3))
    if way.name == "socket":
        noise = kind.covariance(Measured(points), None, TrackerNoise())[0, 0, 0] ** 0.5
        T[:, :3, 3] += things[of] + off + noise * rng.normal(size=(n, 3)) - tip[:, :3, 3]
        q = solve_near(MODEL, T, q, x).q
    else:
        tip[:, :3, 3] += off
        noise = kind.covariance(Measured(points), None, TrackerNoise())[0, 0, 0] ** 0.5
        if way.name == "wire":
            points[:, 0] = np.linalg.norm(tip[:, :3, 3] - things[of], axis=1) + noise * rng.normal(size=n)
        else:
            points = se3.apply(se3.inverse(tip), things[of]) + noise * rng.normal(size=(n, 3))
    return Campaign(ids=tuple(map(str, range(n))), q=q, targets=("tool",), points=points[:, None], observations=(kind,))


def photograph(
    way: Instrument, q: np.ndarray, of: np.ndarray, x: np.ndarray, rng: np.random.Generator, error: float
) -> Campaign:
    """Images that a virtual robot takes; it errs at single poses by the error, and turns by as much at half its reach."""
    size = np.repeat([error, error / (0.5 * MODEL.robot.reach)], 3)
    T = MODEL.poses(q, x) @ se3.error_transform(size * rng.normal(size=(len(q), 6))) @ way.T_tool_targets[0]
    kind = way.observation(of, T)
    (seen,) = kind.pictures
    pixel = seen.pixel + seen.noise * rng.normal(size=seen.pixel.shape)
    found = calibrate_camera(seen.lens, seen.names, seen.board, seen.first, seen.corner, pixel)
    kind = replace(kind, pictures=(found,))
    rows = np.flatnonzero(kind.of >= 0)
    M = kind.views(kind.start).moving.T
    return Campaign(
        ids=tuple(map(str, rows)),
        q=q[rows],
        targets=("camera",),
        points=M[:, None, :3, 3],
        rotations=np.ascontiguousarray(M[:, :3, :3]),
        observations=(replace(kind, of=np.arange(len(rows))),),
    )


def aligned_error(calibration: Calibration, x: np.ndarray, T_tool_tip: np.ndarray) -> float:
    """Of the predicted tip over the task, wherever the base stands, metres."""
    true = (MODEL.poses(GOAL.q, x) @ T_tool_tip)[:, :3, 3]
    placed = calibration.layout.frames(calibration.z)[1][0]
    found = (calibration.model.poses(GOAL.q, calibration.layout.parameters(calibration.z)) @ placed)[:, :3, 3]
    true, found = true - true.mean(axis=0), found - found.mean(axis=0)
    R = se3.nearest_rotation(true.T @ found)
    return float(np.sqrt(np.mean(((found @ R.T - true) ** 2).sum(axis=1))))
