"""Motions of one path that go to one target, or above it: all are corrected, or none, in every language."""

from pathlib import Path

import numpy as np
import pytest

from robot_programs.core.program import Program, angles
from robot_programs.core.source import Source
from robot_programs.krl.read import read_krl
from robot_programs.rapid.read import read_rapid
from robot_programs.rapid.resolve import Confdata
from robot_programs.tp.read import read_tp
from taskcal.correction.correct import correct
from taskcal.correction.options import Bounds
from taskcal.errors import FileError
from taskcal.geometry import se3
from taskcal.kinematics.inverse import find_posture
from taskcal.robot.error_model import ErrorModel
from tests.correction.test_tp import true_robot
from tests.robot_programs.tp.samples import R2000, backup, listing, pose
from tests.robot_programs.written import krl_frame, krl_joints, rapid_pose

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
def krl(shifted, robot):
    """A KRL program with two points, from its lines; it begins at joint positions."""

    def build(*lines: str) -> Program:
        head = [
            "DEF P( )",
            "DECL FRAME A",
            f"$TOOL={krl_frame(robot.T_flange_tool)}",
            "$BASE=$NULLFRAME",
            "$VEL.CP=0.05",
        ]
        head.append(f"PTP {krl_joints(find_posture(ErrorModel(robot), shifted(0, 0, 0)))}")
        data = [f"DECL FRAME XP{k}={krl_frame(shifted(x, 0, 0))}" for k, x in ((1, 0.0), (2, 150.0))]
        files = ("p.src", [*head, *lines, "END", ""]), ("p.dat", ["DEFDAT P", *data, "ENDDAT", ""])
        return read_krl([Source.of(Path(name), "\n".join(text).encode()) for name, text in files])

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


ABOVE = f"MoveL Offs(p1,0,0,80),{SLOW}"
AT, OTHER = f"MoveL p1,{SLOW}", f"MoveL p2,{SLOW}"
PICK = (
    f"PROC pick(robtarget p)\nMoveL Offs(p,0,0,80),{SLOW}\nMoveL p,{SLOW}\nMoveL RelTool(p,0,0,-60),{SLOW}\nENDPROC\n"
)


def one_refused(calibration, program: Program) -> list[tuple[set[int], list[set[int]]]]:
    """Which motions are refused where a bound refuses those that move farthest, and which share a target."""
    moved = correct(calibration, program, bounds=FREE).shift
    together: dict[object, set[int]] = {}
    for visit in program.visits():
        if visit.number is not None:
            together.setdefault(visit.target, set()).add(visit.number)
    cuts = np.unique(moved.round(9))
    bounds = [Bounds(tolerance=1.0, shift=float(cut)) for cut in (cuts[1:] + cuts[:-1]) / 2]
    found = [correct(calibration, program, bounds=bound) for bound in bounds]
    return [(set(range(len(moved))) - set(one.corrected.tolist()), list(together.values())) for one in found]


def check_law(calibration, program: Program, expected: set[int]):
    """Where some of the motions that share a target are refused, all of them are; others are not."""
    cases = one_refused(calibration, program)
    assert cases
    for refused, together in cases:
        assert any(expected <= group for group in together)
        assert expected <= refused or not expected & refused
    return cases


@pytest.mark.parametrize(
    ("main", "routines"),
    [
        (f"{ABOVE}\n{AT}\nMoveL RelTool(p1,0,0,-60),{SLOW}\n{OTHER}", ""),
        (f"h:=80;\npick p1;\n{OTHER}", PICK),
        (
            f"VAR robtarget pA;\npA:=Offs(p1,0,0,80);\nMoveL pA,{SLOW}\n{AT}\npA:=p1;\npA.trans.z:=pA.trans.z+60;\n"
            f"MoveL pA,{SLOW}\n{OTHER}",
            "",
        ),
    ],
)
def test_rapid_motions_to_one_target_are_corrected_together(main, routines, rapid, calibration):
    program = rapid(main, routines)
    assert len(program.motions) == 4
    check_law(calibration, program, {i for i, move in enumerate(program.motions) if move.end.name != "p2"})


@pytest.mark.parametrize(
    "lines",
    [
        ["LIN XP1:{X 0,Y 0,Z -80,A 0,B 0,C 0}", "LIN XP1", "LIN XP1:{X 0,Y 0,Z -60,A 0,B 0,C 0}"],
        ["A=XP1", "A.Z=A.Z+80", "LIN A", "LIN XP1", "A.Z=A.Z-20", "LIN A"],
        ["LIN XP1:{X 0,Y 0,Z -80,A 0,B 0,C 0}", "LIN XP1", "LIN_REL {Z 60} #BASE"],
    ],
)
def test_krl_motions_to_one_point_are_corrected_together(lines, krl, calibration):
    program = krl("PTP XP2", *lines)
    assert [str(d) for d in program.diagnostics] == []
    assert len(program.motions) == 5
    moved = correct(calibration, program, bounds=FREE)
    assert not moved.rejected
    for refused, _ in one_refused(calibration, program):
        assert {2, 3, 4} <= refused or not {2, 3, 4} & refused


def test_tp_motions_to_one_position_are_corrected_together(tp):
    up = "L P[1] 9mm/sec FINE Offset,PR[2]"
    program = tp(up, "L P[1] 9mm/sec FINE", "L P[1] 9mm/sec FINE Tool_Offset,PR[2]", "L P[2] 9mm/sec FINE")
    assert len(program.motions) == 4
    check_law(true_robot()[0], program, {0, 1, 2})


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
