"""KRL for `tests.robot_programs.fuzz`."""

from robot_programs.krl.read import read_krl
from taskcal.robot.catalogue import load_robot
from tests.robot_programs.fuzz import Language
from tests.robot_programs.krl.generator import generate
from tests.robot_programs.krl.rewriting import nearby_waypoints

LANGUAGE = Language(
    generate=lambda rng: generate(rng).sources,
    read=read_krl,
    waypoints=lambda rng, program: nearby_waypoints(rng, program, most=2),
    robot=load_robot("kuka-kr16-2"),
)
