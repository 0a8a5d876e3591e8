"""RAPID for `tests.programs.fuzz`."""

from taskcal.programs.rapid.read import read_rapid
from taskcal.robot.catalogue import load_robot
from tests.programs.fuzz import Language
from tests.programs.rapid.generator import generate
from tests.programs.rapid.rewriting import nearby_waypoints

LANGUAGE = Language(
    generate=lambda rng: generate(rng).sources,
    read=read_rapid,
    waypoints=lambda rng, program: nearby_waypoints(rng, program, most=2),
    robot=load_robot("abb-irb6660-205-1.9"),
)
