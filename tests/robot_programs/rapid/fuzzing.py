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


LANGUAGE = Language(
    generate=lambda rng: generate(rng).sources,
    read=read_rapid,
    waypoints=_waypoints,
    robot=ROBOT,
)
