"""Programs with a helper that corrects at run time."""

import re
from pathlib import Path

import numpy as np
import pytest

from robot_programs.core.program import Composition, Frame
from robot_programs.core.source import Source
from robot_programs.krl.points import StatusTurn
from robot_programs.krl.read import read_krl
from robot_programs.rapid.read import read_rapid
from robot_programs.rapid.rewrite import RapidProgram, compose_rapid
from taskcal.correction.cell import Cell, ExternalAxis, Measured
from taskcal.correction.correct import correct
from taskcal.correction.options import Bounds
from taskcal.correction.run_time import FUNCTION, MODULE, helper_for
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.kinematics.inverse import find_posture
from taskcal.robot.error_model import ErrorModel
from taskcal_groundwork.errors import InputError
from tests.robot_programs.written import krl_frame

COMPUTED = """
  PROC main()
    VAR robtarget p;
    VAR robtarget here;
    MoveJ p10,v100,fine,tSpindle\\WObj:=wTable;
    Ask p;
    MoveL p,v100,z10,tSpindle\\WObj:=wTable;
    MoveL Offs(p10,0,0,height()),v100,fine,tSpindle\\WObj:=wTable;
    MoveC p,Offs(p,1,1,0),v100,fine,tSpindle\\WObj:=wTable;
    here:=CRobT(\\Tool:=tSpindle\\WObj:=wTable);
    MoveL Offs(here,0,0,50),v100,fine,tSpindle\\WObj:=wTable;
    MoveAbsJ CalcJointT(p,tSpindle\\WObj:=wTable),v100,fine,tSpindle;
    SearchL\\Stop,di1,here,p,v100,tSpindle\\WObj:=wTable;
    MoveL p\\T:=10,v100,fine,tSpindle\\WObj:=wTable;
    MoveL p,v100,fine,tOther\\WObj:=wTable;
  ENDPROC
ENDMODULE
"""
"""Lines 7 to 9 are to be wrapped."""


@pytest.fixture
def program(robot, shifted, make_moves):
    part, tool = (
        Frame(name="wTable", T=shifted(-300, 20, -40)),
        Frame(name="tSpindle", T=robot.T_flange_tool @ se3.translation(z=0.01)),
    )
    poses = [se3.inverse(part.T) @ shifted(0, 0, 0) @ se3.translation(z=0.01)]
    motions = make_moves(poses, tool=tool, part=part)
    posture = find_posture(ErrorModel(robot), motions[0].flange(poses[0]) @ robot.T_flange_tool)
    source = compose_rapid(Composition(name="Cell", robot=robot, motions=motions, q=posture[None]))
    head = source.text[: source.text.index("  PROC")].rstrip()
    other = head[head.index("  PERS tooldata") :].split("\n")[0].replace("tSpindle", "tOther")
    return read_rapid([Source.of(Path("cell.mod"), f"{head}\n{other}{COMPUTED}".encode())])


def test_computed_targets_alone_are_wrapped(program, calibration):
    measured = Cell(tools={"tother": Measured(name="tOther", in_flange=np.eye(4))})
    found = correct(calibration, program, cell=measured, bounds=Bounds(tolerance=1.0), helper=True)
    assert [source.path.name for source in found.sources] == ["cell.mod", f"{MODULE}.mod"]
    before, after = (found.sources[0].text.splitlines() for found in (program, found))
    new = [line.strip() for line in after if line not in before]
    wrapped = [line for line in new if FUNCTION in line]
    plain = [line.replace(f"{FUNCTION}(", "").replace(",tSpindle,wTable)", "") for line in wrapped]
    assert set(plain) <= {line.strip() for line in before}
    assert [line.split(",")[0] for line in plain] == ["MoveL p", "MoveL Offs(p10", "MoveC p"]
    assert [line.count(FUNCTION) for line in wrapped] == [1, 1, 2]
    # the declaration stays for Offs
    assert [re.split("[:,]", line)[0] for line in new if FUNCTION not in line] == [
        "CONST robtarget p10_2",
        "MoveJ p10_2",
    ]
    assert len(found.helper.motions) == found.summary()["at_run_time"] == 3
    assert not [one for one in found.diagnostics if one.place.path.name.startswith(MODULE)]


def test_motions_whose_text_others_have_are_corrected_at_run_time(program, calibration, monkeypatch):
    """Where it cannot be written out, nor has an array."""
    for way in ("written_out", "tabled"):
        monkeypatch.setattr(RapidProgram, way, lambda self, numbers: None)
    text = program.sources[0].text.split("  PROC")[0]
    text += "  PROC main()\n    VAR robtarget p;\n    MoveJ p10,v100,fine,tSpindle\\WObj:=wTable;\n    FOR i FROM 1 TO 3 DO\n"
    text += "      MoveJ Offs(p10,90*i,0,0),v100,fine,tSpindle\\WObj:=wTable;\n    ENDFOR\n  ENDPROC\nENDMODULE\n"
    pallet = read_rapid([Source.of(Path("cell.mod"), text.encode())])
    found = correct(calibration, pallet, bounds=Bounds(tolerance=1e-6), helper=True)
    assert f"MoveJ {FUNCTION}(Offs(p10,90*i,0,0),tSpindle,wTable)," in found.sources[0].text
    assert not found.rejected


def test_all_else_is_what_it_is_without_a_helper(program, calibration):
    text = program.sources[0].text.split("\n    Ask p")[0] + "\n  ENDPROC\nENDMODULE\n"
    plain = read_rapid([Source.of(Path("cell.mod"), text.encode())])
    found = correct(calibration, plain, bounds=Bounds(tolerance=1.0), helper=True)
    assert [source.text for source in found.sources] == [
        source.text for source in correct(calibration, plain, bounds=Bounds(tolerance=1.0)).sources
    ]
    assert found.helper is None


def test_a_program_of_computed_targets_alone_is_written(calibration, tmp_path):
    text = "MODULE a\nPROC main()\nVAR robtarget p;\nAsk p;\nMoveL p,v100,fine,tool0;\nENDPROC\nENDMODULE\n"
    program = read_rapid([Source.of(Path("a.mod"), text.encode())])
    found = correct(calibration, program, helper=True)
    paths = found.write(tmp_path / "b.mod")
    assert [path.name for path in paths] == ["b.mod", f"{MODULE}.mod"]
    assert paths[0].read_text() == text.replace("MoveL p", f"MoveL {FUNCTION}(p,tool0,wobj0)")


SWINGING = {"rejected": "jHome", "out of reach": "jFar", "kept": "jHome"}


@pytest.mark.parametrize("case", SWINGING)
def test_a_program_with_a_rejected_home_and_computed_targets_is_written(case, calibration, tmp_path):
    """Nothing is corrected by its text; what is corrected at run time is worth writing."""
    text = (
        "MODULE a\nCONST jointtarget jHome:=[[0,0,0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n"
        "CONST jointtarget jFar:=[[0,0,0,0,0,9000],[9E9,9E9,9E9,9E9,9E9,9E9]];\n"
        f"PROC main()\nVAR robtarget p;\nMoveAbsJ {SWINGING[case]},v100,fine,tool0;\nAsk p;\nMoveL p,v100,fine,tool0;\n"
        "ENDPROC\nENDMODULE\n"
    )
    program = read_rapid([Source.of(Path("a.mod"), text.encode())])
    given = {"bounds": Bounds(joint=1e-9), "keep_joints": case == "kept", "accept_uncertain": True}
    found = correct(calibration, program, helper=True, **given)
    assert bool(found.rejected) == (case != "kept")
    assert not len(found.corrected)
    paths = found.write(tmp_path / "b.mod")
    assert paths[0].read_text() == text.replace("MoveL p", f"MoveL {FUNCTION}(p,tool0,wobj0)")
    plain = correct(calibration, program, **given)
    assert bool(plain.why_unwritten) == (case != "kept")
    assert not [one for one in found.diagnostics if "no motion of this file" in one.text]


def test_a_helper_is_refused_where_the_controller_does_not_know_enough(program, lost_motion, calibration):
    with pytest.raises(TaskcalError, match=r"backlash .*approach"):
        correct(lost_motion, program, helper=True)
    again = helper_for(calibration, program, Cell(), Bounds(), None).wrap(program).program
    with pytest.raises(InputError, match=f"has a function {FUNCTION} already"):
        correct(calibration, again, helper=True)
    carried = Cell(axes=(ExternalAxis(number=1, carries="robot", slides_along=np.array([1.0, 0.0, 0.0])),))
    with pytest.raises(TaskcalError, match="carries the robot"):
        correct(calibration, program, cell=carried, helper=True)


KRL = """DEF CELL ( )
DECL E6POS PICK, THERE
DECL FRAME OFF
$TOOL={TOOL}
$BASE=$NULLFRAME
PTP {FIRST}
LIN {SECOND}
Ask(PICK, OFF)
PTP PICK C_PTP
LIN PICK
CIRC PICK, OFF
PTP OFF
LIN PICK:OFF
PTP OFF:PICK
LIN XP1
THERE=$POS_ACT
LIN THERE
END
"""
"""Lines 9 to 13 are to be wrapped, and 15."""

KRL_WRAPPED = """
PTP TaskcalCorrected(PICK) C_PTP
LIN TaskcalCorrectedPath(PICK)
CIRC TaskcalCorrectedPath(PICK), TaskcalCorrectedFrame(OFF)
PTP TaskcalCorrectedFrame(OFF)
LIN TaskcalCorrectedFrame(PICK:OFF:$NULLFRAME)
LIN TaskcalCorrectedFrame(XP1:$NULLFRAME)
"""


def test_krl_points_of_the_running_program_alone_are_wrapped(krl_calibration):
    robot = krl_calibration.model.robot
    tool = robot.T_flange_tool @ se3.translation(z=0.01)
    q = np.radians([10.0, -80.0, 100.0, 20.0, 40.0, 30.0])
    first = ErrorModel(robot).poses(q[None])[0] @ se3.translation(z=0.01)
    posture = StatusTurn(S=0, T=0).of(robot, q)

    own = KRL.replace("{TOOL}", krl_frame(tool)).replace("{FIRST}", krl_frame(first, f",S {posture.S},T {posture.T}"))
    own = own.replace("{SECOND}", krl_frame(se3.translation(x=0.03) @ first))
    program = read_krl([Source.of(Path("cell.src"), own.encode())])
    found = correct(krl_calibration, program, bounds=Bounds(shift=0.02, tolerance=1.0), helper=True)
    assert [source.path.name for source in found.sources] == ["cell.src", f"{MODULE}.src"]
    pairs = zip(program.sources[0].text.splitlines(), found.sources[0].text.splitlines(), strict=True)
    changed = [new for old, new in pairs if old != new]
    assert [new for new in changed if FUNCTION in new] == KRL_WRAPPED.split("\n")[1:-1]
    assert len(changed) == 6 + len(found.corrected) == 8
    assert not [one for one in found.diagnostics if one.place.path.name.startswith(MODULE)]
    assert len(found.helper.motions) == 6


def test_krl_helper_is_refused_for_a_robot_without_a_closed_form(calibration):
    """Its wrist does not tell what status means, or a rod moves its arm."""
    program = read_krl([Source.of(Path("a.src"), b"DEF A ( )\nDECL FRAME P\nPTP P\nEND\n")])
    with pytest.raises(TaskcalError, match="spherical wrist"):
        correct(calibration, program, helper=True)
