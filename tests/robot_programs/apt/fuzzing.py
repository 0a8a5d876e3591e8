"""APT for `tests.robot_programs.fuzz`."""

from pathlib import Path

import numpy as np

from robot_programs.apt.read import read_apt
from robot_programs.core.program import Frame
from robot_programs.core.source import Source
from taskcal.robot.catalogue import load_robot
from tests.robot_programs.apt.generator import generate, nearby_waypoints
from tests.robot_programs.fuzz import Language

LANGUAGE = Language(
    generate=lambda rng: (Source.of(Path("path.apt"), generate(rng)),),
    read=lambda sources: read_apt(sources, tool=Frame(name="mill", T=np.eye(4))),
    waypoints=lambda rng, program: nearby_waypoints(rng, program, most=3),
    robot=load_robot("abb-irb120"),
    place=(0.0, 2e-8),
    turn=2e-6,
    joints=0.0,
    leans=lambda program, number: program.instructions[number].relative or program.instructions[number].half,
)
