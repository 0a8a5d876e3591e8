"""KRL for `tests.programs.fuzz`."""

from taskcal.programs.krl.read import read_krl
from taskcal.robot.catalogue import load_robot
from tests.programs.fuzz import Language
from tests.programs.krl.generator import generate
from tests.programs.krl.rewriting import nearby_waypoints

LANGUAGE = Language(
    generate=lambda rng: generate(rng).sources,
    read=read_krl,
    waypoints=lambda rng, program: nearby_waypoints(rng, program, most=2),
    robot=load_robot("kuka-kr16-2"),
)
