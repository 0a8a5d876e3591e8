"""TP for `tests.robot_programs.fuzz`."""

from robot_programs.tp.read import read_tp
from tests.robot_programs.fuzz import Language
from tests.robot_programs.tp.generator import generate, nearby_waypoints
from tests.robot_programs.tp.samples import R2000

LANGUAGE = Language(
    generate=generate,
    read=lambda sources: read_tp(sources, robot=R2000),
    waypoints=lambda rng, program: nearby_waypoints(rng, program, most=3),
    robot=R2000,
)
