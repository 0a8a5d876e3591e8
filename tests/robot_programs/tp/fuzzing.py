"""TP for `tests.robot_programs.fuzz`."""

import numpy as np

from robot_programs.tp.read import TpProgram, read_tp
from tests.robot_programs.fuzz import Language
from tests.robot_programs.tp.generator import generate, nearby_waypoints
from tests.robot_programs.tp.samples import R2000


def _posture(program: TpProgram, number: int) -> np.ndarray | None:
    """None of a register, which becomes a position, and where an arc's first point is stated by joints."""
    move, written = program.motions[number], program.sites[number].written
    if written[-1].operand.register or not written[0].stated.is_pose:
        return None
    return getattr(move.end.posture, "q", np.radians([0, 10, -20, 0, -60, 0]))


LANGUAGE = Language(
    generate=generate,
    read=lambda sources: read_tp(sources, robot=R2000),
    waypoints=lambda rng, program: nearby_waypoints(rng, program, most=3),
    posture=_posture,
    robot=R2000,
    place=(0.0, 1e-7),
    turn=3e-7,
    joints=1.1e-7,
    as_wanted=lambda program, number, point: program.sites[number].written[point].stated.is_pose,  # else as joints
)
