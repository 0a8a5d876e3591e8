"""RAPID for `tests.robot_programs.fuzz`."""

from functools import partial

import numpy as np

from robot_programs.core.program import Program
from robot_programs.rapid.read import read_rapid
from tests.robot_programs.fuzz import Language, nearby_waypoints
from tests.robot_programs.rapid.generator import generate
from tests.robot_programs.rapid.samples import ROBOT


def _posture(program: Program, number: int) -> np.ndarray | None:
    move = program.motions[number]
    if move.end.q is not None:
        return move.end.q
    c = move.end.posture
    if move.via is not None and move.via.posture != c:
        return None
    return np.array([c.cf1, 0.0, 0.0, c.cf4, 0.0, c.cf6]) * np.pi / 2 + 0.1


LANGUAGE = Language(
    generate=lambda rng: generate(rng).sources,
    read=read_rapid,
    waypoints=partial(nearby_waypoints, postures=True, kinds=("linear", "joint")),
    posture=_posture,
    robot=ROBOT,
    place=(1.2e-7, 1.6e-7),  # single precision has 24 bits
    turn=5e-7,
    joints=3.5e-8,
    postures=True,
)
