"""TP for `tests.programs.fuzz`."""

from taskcal.programs.tp.read import read_tp
from tests.programs.fuzz import Language
from tests.programs.tp.generator import generate, nearby_waypoints
from tests.programs.tp.samples import R2000

LANGUAGE = Language(
    generate=generate,
    read=lambda sources: read_tp(sources, robot=R2000),
    waypoints=lambda rng, program: nearby_waypoints(rng, program, most=3),
    robot=R2000,
)
