"""URScript for `tests.robot_programs.fuzz`."""

from robot_programs.urscript.read import read_urscript
from tests.robot_programs.fuzz import Language
from tests.robot_programs.urscript.generator import generate
from tests.robot_programs.urscript.samples import UR5

LANGUAGE = Language(
    generate=generate,
    read=lambda sources: read_urscript(sources, robot=UR5),
    robot=UR5,
    place=(0.0, 2e-7),
    turn=2e-7,
    joints=1e-8,
)
