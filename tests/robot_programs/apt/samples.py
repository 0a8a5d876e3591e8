"""APT texts as programs."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from robot_programs.apt.read import AptProgram, read_apt
from robot_programs.core.program import Frame, Motion, Waypoint
from robot_programs.core.source import Source
from taskcal.robot.catalogue import load_robot

TOOL = Frame(name="mill", T=np.eye(4))
ROBOT = load_robot("abb-irb120")


def read(text: str | bytes) -> AptProgram:
    data = text if isinstance(text, bytes) else text.encode()
    return read_apt([Source.of(Path("path.apt"), data)], tool=TOOL)


def points(program: AptProgram) -> np.ndarray:
    return np.array([move.end.T[:3, 3] for move in program.motions])


def axes(program: AptProgram) -> np.ndarray:
    return np.array([-move.end.T[:3, 2] for move in program.motions])


def moved(move: Motion, shift: np.ndarray, turn: np.ndarray) -> Waypoint:
    def pose(T: np.ndarray) -> np.ndarray:
        out = T.copy()
        out[:3, :3] = Rotation.from_rotvec(turn).as_matrix() @ T[:3, :3]
        out[:3, 3] += shift
        return out

    via = None if move.via is None else Waypoint(kind="circular", q=np.zeros(6), T=pose(move.via.T))
    return Waypoint(kind=move.kind, q=np.zeros(6), T=pose(move.end.T), via=via)


CATIA = """$$ -----------------------------------------------------------------
$$*CATIA0
$$ Part Operation.1
$$    1.00000    0.00000    0.00000    0.00000
$$    0.00000    1.00000    0.00000    0.00000
$$    0.00000    0.00000    1.00000    0.00000
PARTNO Part Operation.1
LOADTL/1,1
SPINDL/ 70.0000,RPM,CLW
MULTAX
RAPID
GOTO  /   50.00000,    0.00000,  100.00000, 0.000000, 0.000000, 1.000000
FEDRAT/  300.0000,MMPM
GOTO  /   50.00000,    0.00000,    0.00000, 0.000000, 0.600000, 0.800000PT    12
MULTAX/OFF
AUTOPS
INDIRV/  0.00000, -1.00000,  0.00000
TLON,GOFWD/ (CIRCLE/    0.00000,    0.00000,    0.00000,$               CIR    1
   50.00000),ON,2,INTOF,$
 (LINE/    0.00000,    0.00000,    0.00000,$
    0.00000,   50.00000,    0.00000)
FINI
"""
