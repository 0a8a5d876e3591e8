"""KRL for `tests.robot_programs.fuzz`."""

import numpy as np

from robot_programs.krl.read import KrlProgram, read_krl
from taskcal.robot.catalogue import load_robot
from tests.robot_programs.fuzz import Language
from tests.robot_programs.krl.generator import generate
from tests.robot_programs.krl.rewriting import Q, nearby_waypoints


def _posture(program: KrlProgram, number: int) -> np.ndarray | None:
    """Any where its points have no added frame, which would be contained in a copy, and no status, which follows the joints."""
    written = program.sites[number].written
    return Q if all(len(w.aggregates) == 1 and w.aggregates[0].field("S") is None for w in written) else None


LANGUAGE = Language(
    generate=lambda rng: generate(rng).sources,
    read=read_krl,
    waypoints=lambda rng, program: nearby_waypoints(rng, program, most=2),
    posture=_posture,
    robot=load_robot("kuka-kr16-2"),
)
