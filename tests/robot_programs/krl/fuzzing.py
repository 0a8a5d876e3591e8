"""KRL for `tests.robot_programs.fuzz`."""

from functools import partial

import numpy as np

from robot_programs.krl.read import KrlProgram, read_krl
from tests.robot_programs.fuzz import Language, nearby_waypoints
from tests.robot_programs.krl.generator import generate
from tests.robot_programs.krl.samples import ROBOT, Q


def _posture(program: KrlProgram, number: int) -> np.ndarray | None:
    """Any where its points have no added frame, which would be contained in a copy, and no status, which follows the joints."""
    written = program.sites[number].written
    return Q if all(len(w.stated) == 1 and "S" not in w.first.parts for w in written) else None


LANGUAGE = Language(
    generate=lambda rng: generate(rng).sources,
    read=read_krl,
    waypoints=partial(nearby_waypoints, postures=True),
    posture=_posture,
    robot=ROBOT,
    place=(0.0, 1.1e-8),
    turn=5e-8,
    joints=1.1e-8,
    postures=True,
    leans=lambda program, number: program.sites[number].leans,
)
