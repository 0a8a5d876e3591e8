"""Which position, tool and frame a motion has, and what it follows."""

import re

import numpy as np
import pytest

from robot_programs.tp.read import read_tp
from taskcal.geometry import se3
from taskcal.robot.error_model import ErrorModel
from tests.robot_programs.tp.samples import POSITIONS, R2000, backup, degrees, joints, listing, pose, read

SET = ("  UFRAME_NUM=1", "  UTOOL_NUM=1")


def test_motions_lead_where_the_controller_has_them():
    program = read(*SET, "J P[1] 100% FINE", "L P[2:start] 500mm/sec CNT100", "C P[3]\r\n    :  P[4] 500mm/sec FINE")
    assert program.diagnostics == ()
    home, line, arc = program.motions
    assert [move.kind for move in program.motions] == ["axes", "linear", "circular"]
    assert [move.follows for move in program.motions] == [None, 0, 1]
    np.testing.assert_allclose(home.end.q, degrees(0, 10, -20, 0, -60, 0))
    # user frame 1 in the world, and the world 670 mm above the base
    corner = np.array([1.5, -0.2, 0.07])
    c, s = np.cos(np.radians(10.0)), np.sin(np.radians(10.0))
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    flange = line.flange(line.end.T)
    tip = flange @ line.tool.T
    np.testing.assert_allclose(tip[:3, 3], corner + R @ [0.1, 0.2, 0.3], atol=1e-12)
    np.testing.assert_allclose(arc.via.T[:3, 3], [0.15, 0.25, 0.3])
    assert str(program.T_world_base[2, 3]) == "-0.67"


def test_a_line_to_joints_leads_to_their_pose():
    (move,) = read("L P[1] 100mm/sec FINE").motions
    q = degrees(0, 10, -20, 0, -60, 0)
    flange = ErrorModel(R2000).poses(q[None])[0] @ se3.inverse(R2000.T_flange_tool)
    np.testing.assert_allclose(move.flange(move.end.T), flange, atol=1e-12)
    assert move.end.posture.agrees(R2000, q[None])[0]
    assert not move.end.posture.agrees(R2000, q[None] + 0.1)[0]


def test_offsets_shift_in_the_user_frame_or_in_the_tool():
    plain, offset, tool_offset = (
        read(
            *SET, f"L P[5] 100mm/sec FINE{option}".replace("P[5]", "P[2]"), positions={"2": pose(1, 2, 3, 150, 20, 30)}
        ).motions[0]
        for option in ("", " Offset,PR[2:up]", " Tool_Offset,PR[2]")
    )
    np.testing.assert_allclose(offset.end.T[:3, 3] - plain.end.T[:3, 3], [0.0, 0.0, 0.05], atol=1e-15)
    np.testing.assert_allclose(tool_offset.end.T[:3, 3] - plain.end.T[:3, 3], 0.05 * plain.end.T[:3, 2], atol=1e-15)


def test_registers_count_in_the_active_frames():
    program = read("  UFRAME_NUM=2", "  UTOOL_NUM=1", "J PR[1:home] 50% FINE", "L PR[5] 100mm/sec FINE")
    home, table = program.motions
    np.testing.assert_allclose(home.end.q, degrees(20, 0, 0, 0, -90, 0))
    assert table.part.name == "UFRAME 2"
    np.testing.assert_allclose(table.end.T[:3, 3], [0.12, 0.03, 0.25])
    (said,) = program.diagnostics
    assert "posreg.va" in said.text


@pytest.mark.parametrize(
    ("instructions", "reason"),
    [
        (["L P[R[1]] 10mm/sec FINE"], "the P index is computed at run time; use a constant index"),
        (["L P[9] 10mm/sec FINE"], r"P\[9\] has no position of group 1 in /POS"),
        (["  P[2]=LPOS", "L P[2] 10mm/sec FINE"], r"P\[2\] is set in the program"),
        (["  P[R[1]]=LPOS", "L P[2] 10mm/sec FINE"], r"P\[2\] is set in the program"),
        (["  UFRAME_NUM=2", "L P[2] 10mm/sec FINE"], "counts from UFRAME 1, and UFRAME 2 is active"),
        (["  UFRAME[1]=PR[3]", "L P[2] 10mm/sec FINE"], r"UFRAME\[1\] is set in the program"),
        (["  $MNUTOOL[1,1]=PR[5]", "L P[2] 10mm/sec FINE"], r"UTOOL\[1\] is set in the program"),
        (["J PR[1] 10% FINE"], r"PR\[1\] counts from the active UFRAME"),
        ([*SET, "  PR[1,3]=R[4]", "J PR[1] 10% FINE"], r"PR\[1\] is set in the program"),
        ([*SET, "J PR[3] 10% FINE"], r"PR\[3\] is not known; pass the backup's posreg.va"),
        ([*SET, "J PR[6] 10% FINE"], "extended axes"),
        (["L P[2] 10mm/sec FINE Offset"], "register of its Offset is not stated"),
        (["L P[2] 10mm/sec FINE Offset,PR[4]"], "turns the position"),
        (["L P[2] 10mm/sec FINE Offset,PR[3]"], r"Offset, PR\[3\], is not known"),
        (["  PR[2]=LPOS", "L P[2] 10mm/sec FINE Tool_Offset,PR[2]"], "is set in the program"),
        (["L P[1] 10mm/sec FINE Offset,PR[2]"], "offset of a joint position is not supported"),
        (["C P[2]\r\n    :  P[5] 10mm/sec FINE"], "count from different frames"),
        (["L P[6] 10mm/sec FINE"], "UFRAME 7 is not known"),
        (["L P[7] 10mm/sec FINE"], "counts from the active UFRAME"),
        (["L P[8] 10mm/sec FINE"], "configuration 'R, 0, 0, 0' is not understood"),
    ],
)
def test_what_is_not_known_stays_and_says_why(instructions, reason):
    positions = {
        "1": joints(0, 10, -20, 0, -60, 0),
        "2": pose(100, 200, 300),
        "5": pose(100, 0, 350, frames="UF : 2, UT : 1"),
        "6": pose(1, 2, 3, frames="UF : 7, UT : 1"),
        "7": pose(1, 2, 3, frames="UF : F, UT : F"),
        "8": pose(1, 2, 3, configuration="R, 0, 0, 0"),
    }
    program = read(*instructions, positions=positions)
    assert program.motions == ()
    assert any(_has(diagnostic.text, reason) for diagnostic in program.diagnostics), program.diagnostics


def _has(text: str, pattern: str) -> bool:
    return re.search(pattern, text) is not None


@pytest.mark.parametrize(
    "between",
    ["  LBL[1]", "  LBL[R[1]]", "  CALL OTHER", "  JMP LBL[2]", "  ENDIF", "  OPEN HAND 1", "L P[99] 10mm/sec FINE"],
)
def test_start_is_unknown_after_branches_and_calls(between):
    """The start is not known behind a branch a call or a motion that is not."""
    program = read(*SET, "L P[2] 10mm/sec FINE", between, "L P[3] 10mm/sec FINE", "  IF R[1]=1,JMP LBL[1]")
    assert [move.follows for move in program.motions] == [None, None]


def test_frames_are_not_known_behind_a_call():
    program = read(*SET, "  CALL OTHER", "J PR[1] 10% FINE")
    assert program.motions == ()


def test_remarks_say_what_is_corrected_at_its_points_only():
    program = read(
        "A P[2] 10mm/sec CNT50", "L P[3] 10mm/sec FINE Wjnt", "L P[4] 10mm/sec FINE Skip,LBL[1]", "L P[2] 10mm/sec FINE"
    )
    assert [move.follows for move in program.motions] == [None, None, 1, None]
    assert [diagnostic.place.line for diagnostic in program.diagnostics] == [6, 7]


def test_comments_and_remarked_lines_move_nothing():
    assert read("  !L P[2] 10mm/sec FINE", "  //L P[2] 10mm/sec FINE").motions == ()


REMOTE = re.sub(r"\b([XYZWPR]) =", r"R\1 =", pose(100, 200, 300))


@pytest.mark.parametrize(
    ("position", "reason"),
    [
        (REMOTE, r"P\[2\] in line 10 is stated by RX, RY, RZ, RW, RP, RR: .* remote TCP \(RTCP\)"),
        (
            pose(1, 2, 3).replace("X =", "Q ="),
            r"is stated by Q, Y, Z, W, P, R, of which Q is not known; known are X Y Z",
        ),
        (
            joints(1, 2, 3, 4, 5, 6).replace("J6=", "T6="),
            "is stated by J1, J2, J3, J4, J5, T6, of which T6 is not known",
        ),
        ("   GP1:\r\n\tUF : 1, UT : 1\r\n", r"P\[2\] in line 10 states no component; known are X Y Z"),
        (pose(1, 2, 3).replace("Z =     3.000  mm,", ""), "its position does not state Z, but X, Y, W, P, R"),
    ],
)
def test_position_that_is_not_known_is_named_with_its_components(position, reason):
    program = read(*SET, "L P[2] 10mm/sec FINE", positions={"2": position})
    assert not program.motions
    (diagnostic,) = program.diagnostics
    assert re.search(reason, diagnostic.text)
    assert "0 joints" not in diagnostic.text


def test_configuration_is_read_in_german_listings():
    """Controllers set to German list it as KONFIG."""
    german = {"2": pose(100, 200, 300).replace("CONFIG", "KONFIG")}
    (move,) = read(*SET, "L P[2] 10mm/sec FINE", positions=german).motions
    (english,) = read(*SET, "L P[2] 10mm/sec FINE").motions
    assert move.end.posture == english.end.posture


UP = "L P[2] 100mm/sec FINE Offset,PR[2:up]"


@pytest.mark.parametrize(
    "call",
    [
        "  CALL OTHER", "  call OTHER(1,'x')", "  RUN OTHER", "  IF R[1]=1,CALL OTHER", "  OTHER", "  OTHER(3)",
        "L P[3] 100mm/sec CNT10 TB .10sec,CALL OTHER", "  SELECT R[1]=1,CALL OTHER",
    ],
)  # fmt: skip
def test_registers_are_not_known_behind_a_strange_call(call):
    program = read(*SET, UP, call, *SET, UP, "L P[3] 100mm/sec FINE", "J PR[1] 10% FINE")
    assert [move.end.name for move in program.motions if move.place.line != 9] == ["P[2]", "P[3]"]
    texts = [str(diagnostic) for diagnostic in program.diagnostics]
    assert any("mill.ls:9: OTHER is not in the files given; behind it the active frames" in text for text in texts)
    reason = "PR[{}]{} may be set by OTHER, which is called before and is not in the files given; pass its .ls"
    assert any(text.endswith(": its Offset, " + reason.format(2, ",")) for text in texts)
    assert any(text.endswith(": " + reason.format(1, "")) for text in texts)


@pytest.mark.parametrize(
    "instruction", ["  PAUSE", "  END", "  Weave End", "  MESSAGE[CALL OTHER]", "  !CALL OTHER", "  R[1]=2"]
)
def test_registers_are_known_behind_instructions_of_the_system(instruction):
    program = read(*SET, instruction, *SET, "J PR[1] 10% FINE")
    assert len(program.motions) == 1
    assert "not in the files" not in str(program.diagnostics)


def test_registers_are_unknown_in_a_loop_with_a_strange_call():
    program = read("  LBL[1]", *SET, UP, "  CALL OTHER", "  JMP LBL[1]")
    assert not program.motions


def test_register_of_a_motion_that_is_not_read_is_shared():
    program = read(*SET, "L PR[5] 10mm/sec FINE Offset,PR[3]", "L PR[5] 10mm/sec FINE")
    assert {(visit.number, visit.target[1]) for visit in program.visits()} == {(None, "PR[5]"), (0, "PR[5]")}


def test_call_by_a_string_register_is_named():
    assert "SR[1] is not in the files given" in str(read("  CALL SR[1]", "L P[2] 10mm/sec FINE").diagnostics)


def programs(**instructions):
    """The motions of several programs, by the name of each."""
    sources = [listing(lines, POSITIONS, name) for name, lines in instructions.items()]
    program = read_tp([*sources, *backup()], robot=R2000)
    return [move.routine for move in program.motions]


def test_registers_are_known_behind_a_program_of_the_files():
    assert programs(MAIN=["  CALL PICK", UP], PICK=[UP]) == ["MAIN", "PICK"]


def test_registers_are_unknown_behind_nested_strange_calls():
    assert programs(MAIN=["  CALL PICK", UP], PICK=[UP, "  CALL OTHER"]) == ["PICK"]
    assert programs(MAIN=["  LBL[1]", "  CALL PICK", "  JMP LBL[1]"], PICK=[UP, "  CALL OTHER"]) == []
    assert programs(MAIN=["  CALL OTHER", "  CALL PICK"], PICK=[UP]) == []
    assert programs(MAIN=[UP, "  CALL OTHER"], PICK=[UP]) == ["MAIN", "PICK"]
