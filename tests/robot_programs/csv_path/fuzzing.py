"""Paths in CSV for `tests.robot_programs.fuzz`."""

from pathlib import Path

import numpy as np

from robot_programs.core.program import Frame
from robot_programs.core.source import Source
from robot_programs.csv_path.read import read_csv_path
from taskcal.robot.catalogue import load_robot
from tests.robot_programs.csv_path.generator import generate
from tests.robot_programs.fuzz import Language

LANGUAGE = Language(
    generate=lambda rng: (Source.of(Path("path.csv"), generate(rng)),),
    read=lambda sources: read_csv_path(sources, tool=Frame(name="mill", T=np.eye(4))),
    robot=load_robot("abb-irb120"),
    place=(0.0, 1e-9),
    turn=1e-8,
    joints=1e-11,
)
