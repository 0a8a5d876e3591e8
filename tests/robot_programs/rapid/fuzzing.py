"""RAPID for `tests.robot_programs.fuzz`."""

import numpy as np

from robot_programs.core.program import Program, Waypoint
from robot_programs.rapid.read import read_rapid
from taskcal.robot.catalogue import load_robot
from tests.robot_programs.fuzz import Language
from tests.robot_programs.rapid.generator import generate
from tests.robot_programs.rapid.rewriting import nearby_waypoints

ROBOT = load_robot("abb-irb6660-205-1.9")


def _waypoints(rng: np.random.Generator, program: Program) -> dict[int, tuple[Waypoint, ...]]:
    waypoints = nearby_waypoints(rng, program, most=2)
    cannot = program.unwritable(ROBOT, waypoints, tolerance=0.0)
    return {i: path for i, path in waypoints.items() if i not in cannot}


def _posture(program: Program, number: int) -> np.ndarray | None:
    move = program.motions[number]
    if move.end.q is not None:
        return move.end.q
    c = move.end.posture
    if move.via is not None and move.via.posture != c:
        return None
    return np.array([c.cf1, 0.0, 0.0, c.cf4, 0.0, c.cf6]) * np.pi / 2 + 0.1


LANGUAGE = Language(
    generate=lambda rng: generate(rng).sources,
    read=read_rapid,
    waypoints=_waypoints,
    posture=_posture,
    robot=ROBOT,
)
