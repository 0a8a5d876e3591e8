import numpy as np
import pytest
from pytransform3d.rotations import matrix_from_quaternion

from taskcal.errors import FileError
from taskcal.geometry import se3
from taskcal.programs.rapid.read import read_rapid
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from tests.programs.rapid.samples import IRC5, IRC5_FRAMES, POINTS, S4C, module, source


def reasons(program) -> list[str]:
    return [str(diagnostic) for diagnostic in program.diagnostics]


def pose(xyz_mm, wxyz) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = matrix_from_quaternion(np.array(wxyz))
    T[:3, 3] = np.array(xyz_mm) / 1e3
    return T


def test_the_path_of_a_postprocessor_with_its_frames():
    program = read_rapid([source(IRC5, "Path_10.mod"), source(IRC5_FRAMES, "CalibData.sys")])
    assert [move.kind for move in program.moves] == ["joint", "linear", "linear", "linear", "circular"]
    assert [move.end.name for move in program.moves] == ["Target_10", "Line{1}", "Line{2}", "Line{3}", "Arc_end"]
    assert [move.follows for move in program.moves] == [None, 0, 1, 2, 3]
    assert [move.stops for move in program.moves] == [False, True, False, False, True]
    assert [move.speed for move in program.moves] == pytest.approx([1.0, 0.1, 0.0333, 0.0333, 0.0333])
    assert {move.routine for move in program.moves} == {"Path_10"}
    third = program.moves[3]
    np.testing.assert_allclose(third.end.T, pose([100, 80, 0], [0, 0, 1, 0]), atol=1e-15)
    np.testing.assert_allclose(
        third.part.T, pose([1500, -200, 600], [0.9961947, 0, 0, 0.0871557]) @ pose([5, 5, 0], [1, 0, 0, 0]), atol=1e-9
    )
    np.testing.assert_allclose(third.tool.T, pose([250, 30, 120], [0.70710678, 0, 0.70710678, 0]), atol=1e-9)
    assert third.end.place.line == 10
    arc = program.moves[4]
    assert arc.via is not None
    np.testing.assert_allclose(arc.via.T[:3, 3], [0.05, 0.1, 0.0])


def test_what_is_not_resolved_is_said_by_file_and_line():
    program = read_rapid([source(IRC5, "Path_10.mod"), source(IRC5_FRAMES, "CalibData.sys")])
    assert reasons(program) == [
        "Path_10.mod:20: MoveL stays as it is: the work object 'wTurn' is moved by another mechanical unit (ufprog is FALSE)",
        "Path_10.mod:21: TriggL stays as it is: it is not among the motions that are read: MoveJ, MoveL, MoveC and MoveAbsJ",
        "Path_10.mod:22: MoveL stays as it is: \\T gives it a time, which a changed way would not keep",
        "Path_10.mod:24: MoveL stays as it is: 'i' counts a loop",
        "Path_10.mod:26: MoveL stays as it is: 'Target_20' is not declared in the files; pass the module that declares it",
    ]


def test_without_the_module_of_its_frames_a_path_stays_as_it_is():
    program = read_rapid([source(IRC5)])
    assert not program.moves
    assert reasons(program)[0] == (
        "part.mod:15: MoveJ stays as it is: unknown tool 'tSpindle'; pass the module that declares it"
    )


def test_a_part_in_the_hand_at_a_tool_that_stands_still():
    program = read_rapid([source(S4C, "grind.prg")])
    home, offset, at, out, turned = program.moves
    assert home.kind == "axes"
    np.testing.assert_allclose(np.degrees(home.end.q), [0, -20, 30, 0, 45, 0])
    assert all(move.part_in_hand for move in program.moves)
    np.testing.assert_allclose(offset.end.T, pose([12.5, -40, -47], [0.5, 0.5, -0.5, 0.5]), atol=1e-12)
    # the tool in the base is the flange times the part in the hand times the target
    flange = at.flange(at.end.T)
    np.testing.assert_allclose(flange @ at.part.T @ at.end.T, at.tool.T, atol=1e-12)
    np.testing.assert_allclose(at.tool.T, pose([1450.5, -220, 910], [0.707107, 0, 0.707107, 0]), atol=1e-6)
    np.testing.assert_allclose(at.part.T, pose([0, 0, 180], [1, 0, 0, 0]) @ pose([10, 0, 0], [0, 1, 0, 0]), atol=1e-12)
    expected = out.end.T @ pose([0, 0, -50], [1, 0, 0, 0]) @ se3.rotation("z", np.radians(15))
    np.testing.assert_allclose(turned.end.T, expected, atol=1e-12)
    assert [move.follows for move in program.moves] == [None, None, 1, 2, 3]
    assert reasons(program) == [
        "grind.prg:29: MoveL stays as it is: 'pLater' is assigned to in grind.prg:28, so its value is not known",
    ]


def test_offs_goes_along_the_work_object_and_reltool_along_the_tool():
    declarations = (
        "CONST robtarget p:=[[10,20,30],[0.5,0.5,0.5,0.5],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];CONST num h:=7;"
    )
    body = "MoveL Offs(p,1,-2,h+1),v100,fine,tool0;MoveL RelTool(p,1,2,h\\Rx:=10\\Ry:=-20\\Rz:=30),v100,fine,tool0;"
    a, b = read_rapid([module(body, declarations)]).moves
    np.testing.assert_allclose(a.end.T, pose([11, 18, 38], [0.5, 0.5, 0.5, 0.5]), atol=1e-12)
    turned = pose([10, 20, 30], [0.5, 0.5, 0.5, 0.5]) @ pose([1, 2, 7], [1, 0, 0, 0])
    for axis, angle in zip("xyz", (10, -20, 30), strict=True):
        turned = turned @ se3.rotation(axis, np.radians(angle))
    np.testing.assert_allclose(b.end.T, turned, atol=1e-12)


def test_the_zero_position_of_an_irb_120():
    """ABB's product specification: the flange is 374 mm in front of and 630 mm above the base, its z forward."""
    nine = "[9E9,9E9,9E9,9E9,9E9,9E9]"
    home = f"[[374,0,630],[0.7071068,0,0.7071068,0],[0,0,0,0],{nine}]"
    body = f"MoveAbsJ [[0,0,0,0,0,0],{nine}],v5,fine,tool0;MoveJ {home},v5,fine,tool0;"
    axes, pose_ = read_rapid([module(body)]).moves
    robot = load_robot("abb-irb120")
    flange = ErrorModel(robot).poses(axes.end.q[None])[0] @ se3.inverse(robot.T_flange_tool)
    np.testing.assert_allclose(flange, pose_.flange(pose_.end.T), atol=1e-7)
    assert pose_.end.posture.agrees(robot, axes.end.q[None])[0]


NINE = "[9E9,9E9,9E9,9E9,9E9,9E9]"


@pytest.mark.parametrize(
    ("declarations", "body", "reason"),
    [
        ("VAR" + POINTS.splitlines()[0][5:], "p1:=p1;MoveL p1,v100,fine,tool0;", "'p1' is assigned to in part.mod:4"),
        ("VAR" + POINTS.splitlines()[0][5:], "p1.trans.x:=3;MoveL p1,v100,fine,tool0;", "'p1' is assigned to in part.mod:4"),
        ("VAR" + POINTS.splitlines()[0][5:], "Elsewhere p1;MoveL p1,v100,fine,tool0;", "'p1' is assigned to in part.mod:4"),
        (POINTS, "MoveL p1,v100,fine,tool0\\Mine:=10;", "\\mine is not provided for"),
        (POINTS, "MoveL p1\\ID:=10,v100,fine,tool0;", "\\ID synchronises"),
        (POINTS, "MoveL p1,v100,fine,tool0\\WObj:=w7;", "unknown work object 'w7'"),
        (POINTS, "MoveL p1,v100,fine,tool0\\WObj:=p2;", "'p2' is robtarget, not wobjdata"),
        (POINTS, "MoveL *,v100,fine,tool0;", ""),
        (POINTS, "MoveL p1{2},v100,fine,tool0;", ""),
        (POINTS, "MoveAbsJ p1,v100,fine,tool0;", "'p1' is robtarget, not jointtarget"),
        (POINTS, "MoveL Offs(p1,0,0),v100,fine,tool0;", "Offs() is not given a target and three distances"),
        (POINTS, "PDispSet shift;MoveL p1,v100,fine,tool0;", "a program displacement may shift it (PDispSet in part.mod:13)"),
        ("", f"MoveL [[0,0,0],[1,1,0,0],[0,0,0,0],{NINE}],v100,fine,tool0;", "is not a unit quaternion: its length is 1.414"),
        ("", f"MoveL [[0,0],[1,0,0,0],[0,0,0,0],{NINE}],v100,fine,tool0;", "is not made of 3 numbers"),
        ("", f"MoveL [[0,0,9E9],[1,0,0,0],[0,0,0,0],{NINE}],v100,fine,tool0;", "is out of any range"),
        ("", f"MoveAbsJ [[0,0,0,0,0,9E9],{NINE}],v100,fine,tool0;", "does not say the position of every axis"),
        ("CONST num a:=b;CONST num b:=a;", f"MoveL [[a,0,0],[1,0,0,0],[0,0,0,0],{NINE}],v100,fine,tool0;", "in a circle"),
        (POINTS, "MoveL p1,v100,fine,CTool();", "CTool() is known only at run time"),
        (POINTS, "MoveJDO p1,v100,fine,tool0,doGun,1;", "it is not among the motions that are read"),
        (POINTS, "SearchL diFound,p2,p1,v100,tool0;", "it is not among the motions that are read"),
        (POINTS, "SomeGlue p1,v100,fine,tool0;", "it is not among the motions that are read"),
    ],
)  # fmt: skip
def test_reasons_for_leaving_a_motion(declarations, body, reason):
    program = read_rapid([module(body, declarations)])
    assert not program.moves
    assert any(reason in text for text in reasons(program)), reasons(program)


@pytest.mark.parametrize("odd", [False, True])
@pytest.mark.parametrize("shift", ["PDispOn p1,tool0", "PDispOn\\Rot\\ExeP:=p2,p1,tool0", "PDispSet shift"])
def test_a_program_displacement_is_why_motions_to_poses_stay(shift, odd):
    home = f"MoveAbsJ [[0,0,0,0,0,0],{NINE}],v5,fine,tool0;"
    body = f"MoveL p1,v5,fine,tool0;\n{shift}{',,' if odd else ''};\nMoveL p2,v5,fine,tool0;\n{home}"
    program = read_rapid([module(body, POINTS)])
    assert [move.kind for move in program.moves] == ["axes"]
    name = shift[:7] if shift.startswith("PDispOn") else "PDispSet"
    why = f"MoveL stays as it is: a program displacement may shift it ({name} in part.mod:14)"
    told = [text for text in reasons(program) if "displacement" in text]
    assert told == [
        f"part.mod:13: {why}",
        f"part.mod:14: {name} begins a program displacement, which may shift any motion to a pose; none is read",
        f"part.mod:15: {why}",
    ]
    assert len(reasons(program)) == 3 + odd


@pytest.mark.parametrize(
    ("option", "turns"),
    [("\\Wrist", True), ("\\LockAxis4", True), ("\\LOCKAXIS4", True), ("\\Off", False), ("", False)],
)
def test_a_wrist_that_follows_its_own_axes_is_pointed_out_at_each_line(option, turns):
    body = f"MoveL p1,v5,fine,tool0;\nSingArea{option};\nMoveL p2,v5,fine,tool0;\nSingArea\\Off;\nSingArea {option};"
    program = read_rapid([module(body, POINTS)])
    assert [move.follows for move in program.moves] == [None, 0]
    why = "SingArea lets the tool turn in another way along lines and arcs; its orientation between targets is not as predicted"
    assert reasons(program) == ([f"part.mod:14: {why}", f"part.mod:17: {why}"] if turns else [])


def test_frames_that_contradict_each_other():
    held = 'PERS wobjdata w:=[TRUE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];'
    program = read_rapid([module("MoveL p1,v100,fine,tool0\\WObj:=w;", POINTS + held)])
    assert "both held by the robot" in reasons(program)[0]


def test_what_a_routine_is_given_does_not_change_its_data_unless_the_routine_does_so():
    routine = "PROC go(PERS tooldata t, INOUT robtarget a, INOUT robtarget b) b:=a; ENDPROC\n"
    declarations = "VAR" + POINTS.splitlines()[0][5:] + "VAR" + POINTS.splitlines()[1][5:]
    main = "PROC main()\ngo tool0,p1,p2;\nMoveL p1,v5,fine,tool0;\nMoveL p2,v5,fine,tool0;\nENDPROC\n"
    text = f"MODULE m {declarations}\n{main}{routine}ENDMODULE"
    program = read_rapid([source(text)])
    assert [move.end.name for move in program.moves] == ["p1"]
    assert any("'p2' is assigned to in part.mod:3" in text for text in reasons(program))


def test_the_target_of_a_routine_that_is_given_it_is_reported():
    text = f"MODULE m\n{POINTS}PROC main()\ngo p1;\nENDPROC\nPROC go(robtarget p)\nMoveL p,v5,fine,tool0;\nENDPROC\nENDMODULE"
    assert reasons(read_rapid([source(text)])) == [
        "part.mod:12: the target that 'go' is given stays as it is: motions to a routine's parameter are not read",
        "part.mod:15: MoveL stays as it is: 'p' is a parameter of the routine 'go'",
    ]


def test_each_module_has_its_own_local_data():
    one = source(
        f"MODULE a\nLOCAL {POINTS.splitlines()[0]}\nPROC pa()\nMoveL p1,v5,fine,tool0;\nENDPROC\nENDMODULE", "a.mod"
    )
    two = source(
        f"MODULE b\nLOCAL {POINTS.splitlines()[1].replace('p2', 'p1')}\nPROC pb()\nMoveL p1,v5,fine,tool0;\nENDPROC\nENDMODULE",
        "b.mod",
    )
    three = source("MODULE c\nPROC pc()\nMoveL p1,v5,fine,tool0;\nENDPROC\nENDMODULE", "c.mod")
    program = read_rapid([one, two, three])
    assert [move.end.T[0, 3] for move in program.moves] == pytest.approx([0.01, 0.02])
    assert reasons(program) == [
        "c.mod:3: MoveL stays as it is: 'p1' is not declared in the files; pass the module that declares it"
    ]


def test_elements_of_a_table_are_named_by_row_and_column():
    values = ",".join(f"[[{x},0,0],[1,0,0,0],[0,0,0,0],{NINE}]" for x in range(6))
    rows = values.replace("]],[[", "]]|[[").split("|")
    table = f"CONST robtarget t{{2,3}}:=[[{','.join(rows[:3])}],[{','.join(rows[3:])}]];"
    (move,) = read_rapid([module("MoveL t{2,1},v5,fine,tool0;", table)]).moves
    assert move.end.name == "t{2,1}"
    assert move.end.T[0, 3] == pytest.approx(0.003)


def test_names_of_one_scope_that_are_declared_twice_are_not_guessed():
    program = read_rapid([module("MoveL p1,v5,fine,tool0;", POINTS + POINTS)])
    assert "'p1' is declared 2 times" in reasons(program)[0]


def test_components_of_records_of_the_program():
    declarations = (
        "RECORD station robtarget pick; num id; ENDRECORD\n"
        f"CONST station s{{2}}:=[[[[1,2,3],[1,0,0,0],[0,0,0,0],{NINE}],1],[[[4,5,6],[1,0,0,0],[0,0,0,0],{NINE}],2]];\n"
    )
    body = "MoveL s{2}.pick,v5,fine,tool0;MoveL Offs(S{last-1}.Pick,0,0,1),v5,fine,tool0;"
    move, shifted = read_rapid([module(body, declarations + "CONST num last:=2;")]).moves
    assert (move.end.name, shifted.end.name) == ("s{2}.pick", "s{1}.pick")
    np.testing.assert_allclose(move.end.T[:3, 3], [0.004, 0.005, 0.006])


def test_postures_where_the_controller_is_told_not_to_check_them():
    program = read_rapid(
        [module("ConfL\\Off;MoveL p1,v5,fine,tool0;MoveL p2,v5,fine,tool0;MoveJ p3,v5,fine,tool0;", POINTS)]
    )
    assert [move.end.posture is None for move in program.moves] == [False, True, False]


def test_the_reorientation_speed_is_v_ori():
    slow = "CONST speeddata slow:=[50,20,5000,1000];\n"
    moves = ["p1,slow,fine", "p2,slow\\V:=7,fine", "p3,[50,30,1,1],fine", "p4,unheardof,fine"]
    program = read_rapid([module("".join(f"MoveL {move},tool0;" for move in moves), POINTS + slow)])
    assert [move.turn_speed for move in program.moves] == [pytest.approx(np.radians(v)) for v in (20, 20, 30)] + [None]


def test_speeds_and_stops():
    moves = ["p1,vmax,z0", "p2,v5\\V:=12,z10\\Z:=3", "p3,v50,z10\\Inpos:=inpos50", "p4,v7000,zMine"]
    program = read_rapid([module("".join(f"MoveL {move},tool0;" for move in moves), POINTS)])
    assert [move.speed for move in program.moves] == [None, 0.012, 0.05, 7.0]
    assert [move.turn_speed for move in program.moves] == [None] + [pytest.approx(np.radians(500.0))] * 3
    assert [move.stops for move in program.moves] == [False, False, True, True]
    assert "the zone of a motion is not known, which is taken as a stop: 'zMine'" in reasons(program)[0]


def test_external_axes_are_pointed_out_once():
    body = "MoveL [[0,0,0],[1,0,0,0],[0,0,0,0],[100,9E9,9E9,9E9,9E9,9E9]],v5,fine,tool0;\nMoveL p1,v5,fine,tool0;"
    program = read_rapid([module(body, POINTS)])
    assert len(program.moves) == 2
    assert len(program.diagnostics) == 1
    assert "external axes are in use" in reasons(program)[0]


def test_text_that_is_not_understood_is_passed_over_line_by_line():
    lines = ["MoveL p1,v5", 'TPWrite "never closed;\nMoveL p2,v5', "MoveL [[1,2,3],v5", "MoveL p3,v5"]
    body = "\n".join(f"{line},fine,tool0;" for line in lines)
    program = read_rapid([module(body, POINTS)])
    assert [move.end.name for move in program.moves] == ["p1", "p3"]
    assert [move.follows for move in program.moves] == [None, None]
    text = "\n".join(reasons(program))
    assert "part.mod:14: the string that begins here does not end in its line" in text
    assert "part.mod:15: MoveL stays as it is: the text around it is not understood" in text
    assert "part.mod:16: MoveL stays as it is: the text around it is not understood" in text


@pytest.mark.parametrize("text", ["", "hello", "PROC main() ENDPROC", "\0\1\2"])
def test_files_that_are_no_modules(text):
    with pytest.raises(FileError, match=r"part\.mod: (has no MODULE|is a binary file)"):
        read_rapid([source(text)])
