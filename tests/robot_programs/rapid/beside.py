"""Motions that end a little beside."""

import numpy as np

from robot_programs.core.program import Program, Waypoint
from robot_programs.core.source import Source
from robot_programs.rapid.read import read_rapid
from taskcal.robot.catalogue import load_robot

ROBOT = load_robot("abb-irb6660-205-1.9")


Q = np.radians([10.0, 20.0, 15.0, -100.0, 40.0, 200.0])  # quadrants 0, -2, 2


def shifted(program: Program, *numbers: int, mm=(1.0, 0.0, 0.0), q=Q) -> dict[int, tuple[Waypoint, ...]]:
    """Motions that end a little beside."""
    out = {}
    for i in numbers:
        T = program.motions[i].end.T.copy()
        T[:3, 3] += np.array(mm) / 1e3
        out[i] = (Waypoint(kind=program.motions[i].kind, q=q, T=T, via=None),)
    return out


def rewritten(source_: Source, *numbers: int, **how) -> str:
    program = read_rapid([source_])
    return program.rewrite(ROBOT, shifted(program, *numbers, **how))[0].text
