"""Targets that motions share, beside what test_conformance says of them: positions of TP, frames that are not read."""

from pathlib import Path

import numpy as np
import pytest

from robot_programs.core.program import Program, angles
from robot_programs.core.source import Source
from robot_programs.rapid.read import read_rapid
from robot_programs.rapid.resolve import Confdata
from robot_programs.tp.read import read_tp
from taskcal.correction.correct import correct
from taskcal.correction.options import Bounds
from taskcal.errors import FileError
from taskcal.geometry import se3
from taskcal.kinematics.inverse import find_posture
from taskcal.robot.error_model import ErrorModel
from tests.correction.test_conformance import one_refused
from tests.correction.test_tp import true_robot
from tests.robot_programs.tp.samples import R2000, backup, listing, pose
from tests.robot_programs.written import rapid_pose

FREE = Bounds(tolerance=1.0, shift=0.02)
SLOW = "v50,fine,tMill\\WObj:=wobj0;"


@pytest.fixture
def rapid(shifted, robot):
    """A RAPID program with two targets, from the lines of its routines."""
    conf = Confdata.of(robot, find_posture(ErrorModel(robot), shifted(0, 0, 0)))

    def build(main: str, routines: str = "") -> Program:
        targets = "".join(
            f"CONST robtarget p{k}:={rapid_pose(shifted(x, 0, 0), 4)[:-1]},{conf},[9E9,9E9,9E9,9E9,9E9,9E9]];\n"
            for k, x in ((1, 0.0), (2, 150.0))
        )
        tool = f"PERS tooldata tMill:=[TRUE,{rapid_pose(robot.T_flange_tool, 4)},[1,[0,0,1],[1,0,0,0],0,0,0]];\n"
        text = f"MODULE m\n{targets}{tool}VAR num h;\nPROC main()\n{main}\nENDPROC\n{routines}ENDMODULE\n"
        return read_rapid([Source.of(Path("m.mod"), text.encode())])

    return build


@pytest.fixture
def tp():
    """A TP program with two positions, from its instructions."""
    flange = ErrorModel(R2000).poses(np.radians([[0.0, 25.0, -30.0, 10.0, -60.0, 20.0]]))[0] @ se3.inverse(
        R2000.T_flange_tool
    )

    def build(*instructions: str) -> Program:
        (move,) = read_tp([listing(["L P[1] 9mm/sec FINE"], {"1": pose(0, 0, 0)}), *backup()], robot=R2000).motions
        T = move.target(flange)
        r, p, w = angles(T[:3, :3])
        x, y, z = T[:3, 3] * 1e3
        positions = {str(k): pose(x + dx, y, z, w, p, r) for k, dx in ((1, 0.0), (2, 100.0))}
        return read_tp([listing(list(instructions), positions), *backup()], robot=R2000)

    return build


AT, OTHER = f"MoveL p1,{SLOW}", f"MoveL p2,{SLOW}"


def test_tp_motions_to_one_position_are_corrected_together(tp):
    up = "L P[1] 9mm/sec FINE Offset,PR[2]"
    program = tp(up, "L P[1] 9mm/sec FINE", "L P[1] 9mm/sec FINE Tool_Offset,PR[2]", "L P[2] 9mm/sec FINE")
    assert len(program.motions) == 4
    same, cases = {0, 1, 2}, one_refused(true_robot()[0], program)
    assert all(same <= refused or not same & refused for refused in cases)
    assert any(same <= refused for refused in cases)


def test_a_tp_position_stays_below_an_offset_that_is_not_read(tp):
    program = tp("L P[1] 9mm/sec FINE Offset,PR[3]", "L P[1] 9mm/sec FINE", "L P[2] 9mm/sec FINE")
    ((refused, why),) = correct(true_robot()[0], program, bounds=FREE).rejected.items()
    assert program.motions[refused].end.name == "P[1]"
    assert "shares its target with the motion in" in why


def test_motion_in_another_frame_that_is_not_read_keeps_none(rapid, calibration):
    program = rapid(f"MoveL p1,v50,fine,tMill\\WObj:=wElsewhere;\n{AT}\n{OTHER}")
    assert len(correct(calibration, program, bounds=FREE).corrected) == 2


def test_write_refuses_a_program_of_which_nothing_was_corrected(rapid, calibration, tmp_path):
    found = correct(calibration, rapid(f"{AT}\n{OTHER}"), bounds=Bounds(shift=1e-9))
    with pytest.raises(FileError, match=r"is not written: no motion was corrected.*m\.mod:7: would move by"):
        found.write(tmp_path / "out.mod")
    assert not list(tmp_path.iterdir())
