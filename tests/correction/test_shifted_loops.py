"""Targets that loops shift, beside motions to them and others that only the running program knows: no self-check fails.

What is corrected reads as it should, and every other motion is as it was, with a reason.
"""

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from robot_programs.core.source import Source
from robot_programs.rapid.resolve import Confdata
from robot_programs.reading import parse_program
from taskcal.correction.correct import correct
from taskcal.correction.options import Bounds
from taskcal.geometry import se3
from tests.correction.by_pinocchio import defective
from tests.robot_programs.written import krl_frame, krl_joints, rapid_pose, urscript_pose

NEAR = np.radians([10.0, 20.0, 10.0, 10.0, 60.0, 20.0])
PIECES = ("direct", "other frame", "loop", "unread", "second loop")


@pytest.fixture(scope="module")
def calibration():
    return defective("abb-irb120", NEAR)[0]


def scaled(calibration, share):
    base, targets = calibration.layout.frames(share * calibration.z)
    return replace(calibration, z=share * calibration.z, T_tracker_base=base, T_tool_target=targets)


def rapid(robot, T, pieces):
    written = {
        "direct": "MoveJ p10,v50,fine,tMill;",
        "other frame": "MoveL p10,v50,fine,tMill\\WObj:=wPal;",
        "loop": "FOR i FROM 1 TO 3 DO\nMoveL Offs(p10,0,i*15,25),v50,fine,tMill;\nENDFOR",
        "unread": "MoveL Offs(p10,AInput(ai1),0,80),v50,fine,tMill;",
        "second loop": "FOR i FROM 1 TO 2 DO\nMoveL RelTool(p10,0,0,-i*9),v50,fine,tMill;\nENDFOR",
    }
    lines = [
        "MODULE m", f"CONST robtarget p10:={rapid_pose(T)[:-1]},{Confdata.of(robot, NEAR)},[9E9,9E9,9E9,9E9,9E9,9E9]];",
        "PERS tooldata tMill:=[TRUE,[[0,0,0],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];",
        'PERS wobjdata wPal:=[FALSE,TRUE,"",[[20,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];',
        *(f"PROC r{k}()\n{written[piece]}\nENDPROC" for k, piece in enumerate(pieces)), "ENDMODULE", "",
    ]  # fmt: skip
    return parse_program((Source.of(Path("m.mod"), "\n".join(lines).encode()),))


def krl(robot, T, pieces):
    written = {
        "direct": "LIN XP1",
        "other frame": "$BASE={X 20,Y 0,Z 0,A 0,B 0,C 0}\nLIN XP1\n$BASE=$NULLFRAME",
        "loop": "FOR I=1 TO 3\nLIN XP1:{X 0,Y I*15,Z 25,A 0,B 0,C 0}\nENDFOR",
        "unread": "LIN XP1:{X $ANIN[1],Y 0,Z 80,A 0,B 0,C 0}\nPTP HOME",
        "second loop": "FOR I=1 TO 2\nLIN XP1:{X 0,Y 0,Z I*9,A 0,B 0,C 0}\nENDFOR",
    }
    home = krl_joints(NEAR)
    lines = ["DEF P ( )", "$TOOL=$NULLFRAME", "$BASE=$NULLFRAME", "$VEL.CP=0.1", f"PTP {home}"]
    lines += [f"R{k} ( )" for k in range(len(pieces))]
    for k, piece in enumerate(pieces):
        lines += ["END", f"DEF R{k} ( )", "DECL INT I", written[piece].replace("HOME", home)]
    data = f"DEFDAT P\nDECL FRAME XP1={krl_frame(T)}\nENDDAT\n"
    files = ("p.src", "\n".join([*lines, "END", ""])), ("p.dat", data)
    return parse_program(tuple(Source.of(Path(name), text.encode()) for name, text in files))


def urscript(robot, T, pieces):
    shifted = "movel(pose_trans(point, p[{}, {}, {}, 0, 0, 0]))"
    written = {
        "direct": ["movel(point)"],
        "other frame": ["plane = p[0.02, 0, 0, 0, 0, 0]", "movel(pose_trans(plane, point))"],
        "loop": ["i = 1", "while i < 4:", shifted.format(0, "i*0.015", 0.025), "i = i + 1", "end"],
        "unread": [shifted.format("get_standard_analog_in(0)", 0, 0.08), "movej(home)"],
        "second loop": ["i = 1", "while i < 3:", shifted.format(0, 0, "i*0.009"), "i = i + 1", "end"],
    }
    lines = [
        "def p():",
        "set_tcp(p[0,0,0,0,0,0])",
        f"point = {urscript_pose(T)}",
        f"home = {NEAR.tolist()}",
        "movej(home)",
    ]
    for k, piece in enumerate(pieces):
        lines += [f"def r{k}():", *written[piece], "end", f"r{k}()"]
    return parse_program((Source.of(Path("p.script"), "\n".join([*lines, "end", ""]).encode()),), robot=robot)


@pytest.mark.parametrize(("share", "tolerance"), [(0.1, 1e-4), (0.3, 1e-3), (0.3, 2e-5)])
@pytest.mark.parametrize("language", [rapid, krl, urscript])
def test_no_program_fails_its_self_check(language, share, tolerance, calibration):
    own, robot = scaled(calibration, share), calibration.model.robot
    T = calibration.model.poses(NEAR[None])[0] @ se3.inverse(robot.T_flange_tool)
    for count in (2, 3):
        for pieces in combinations(PIECES, count):
            program = language(robot, T, pieces)
            found = correct(own, program, bounds=Bounds(tolerance=tolerance), accept_uncertain=True)
            assert found.rejected.keys().isdisjoint(found.corrected.tolist()), pieces
            again = found.program.reread(found.sources)
            assert len(again.motions) == len(found.motions), pieces
            for i, why in found.rejected.items():
                assert why
                (k,) = [k for k, (number, _, end) in enumerate(found.origin) if number == i and end == 1.0]
                assert np.abs(again.motions[k].end.T - program.motions[i].end.T).max() < 1e-9, pieces
            if "unread" not in pieces and "other frame" not in pieces:
                assert len(found.corrected) == len(found.program.motions), pieces
