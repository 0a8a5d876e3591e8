"""APT for `tests.programs.fuzz`."""

from pathlib import Path

import numpy as np

from taskcal.programs.apt.read import read_apt
from taskcal.programs.program import Frame
from taskcal.programs.source import Source
from taskcal.robot.catalogue import load_robot
from tests.programs.apt.generator import generate, nearby_waypoints
from tests.programs.fuzz import Language

LANGUAGE = Language(
    generate=lambda rng: (Source.of(Path("path.apt"), generate(rng)),),
    read=lambda sources: read_apt(sources, tool=Frame(name="mill", T=np.eye(4))),
    waypoints=lambda rng, program: nearby_waypoints(rng, program, most=3),
    robot=load_robot("abb-irb120"),
)
