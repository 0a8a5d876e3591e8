"""URScript for `tests.robot_programs.fuzz`."""

from robot_programs.urscript.read import read_urscript
from tests.robot_programs.csv_path.generator import nearby_waypoints
from tests.robot_programs.fuzz import Language
from tests.robot_programs.urscript.generator import generate
from tests.robot_programs.urscript.samples import UR5

LANGUAGE = Language(
    generate=generate,
    read=lambda sources: read_urscript(sources, robot=UR5),
    waypoints=lambda rng, program: nearby_waypoints(rng, program, most=3),
    robot=UR5,
)
