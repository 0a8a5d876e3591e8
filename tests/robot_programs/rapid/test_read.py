"""What is read of RAPID, and what is said of the rest."""

import numpy as np
import pytest

from robot_programs.rapid.read import read_rapid
from robot_programs.rapid.resolve import base_frame
from taskcal.errors import FileError
from taskcal.geometry import se3
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from tests.robot_programs.rapid.samples import IRC5, IRC5_FRAMES, NINE, POINTS, S4C, module, pose, reasons, source


def test_the_path_of_a_postprocessor_with_its_frames():
    program = read_rapid([source(IRC5, "Path_10.mod"), source(IRC5_FRAMES, "CalibData.sys")])
    assert [move.kind for move in program.motions] == [
        "joint",
        "linear",
        "linear",
        "linear",
        "circular",
        *["linear"] * 5,
    ]
    names = ["Target_10", "Line{1}", "Line{2}", "Line{3}", "Arc_end", "Target_10", "Target_10"]
    assert [move.end.name for move in program.motions] == [*names, "Line{1}", "Line{2}", "Line{3}"]
    assert [move.follows for move in program.motions] == [None, 0, 1, 2, 3, 4, 5, None, 7, 8]
    assert [move.texts_motions for move in program.motions] == [1] * 7 + [3] * 3
    assert [move.stops for move in program.motions[:7]] == [False, True, False, False, True, False, False]
    assert [move.speed for move in program.motions[:7]] == pytest.approx([1.0, 0.1, 0.0333, 0.0333, 0.0333, 1.0, 1.0])
    assert {move.routine for move in program.motions} == {"Path_10"}
    third = program.motions[3]
    np.testing.assert_allclose(third.end.T, pose([100, 80, 0], [0, 0, 1, 0]), atol=1e-15)
    np.testing.assert_allclose(
        third.part.T, pose([1500, -200, 600], [0.9961947, 0, 0, 0.0871557]) @ pose([5, 5, 0], [1, 0, 0, 0]), atol=1e-9
    )
    np.testing.assert_allclose(third.tool.T, pose([250, 30, 120], [0.70710678, 0, 0.70710678, 0]), atol=1e-9)
    assert third.end.place.line == 10
    assert [move.carrier for move in program.motions] == ["", "", "", "", "", "STN1", "", "", "", ""]
    arc = program.motions[4]
    assert arc.via is not None
    np.testing.assert_allclose(arc.via.T[:3, 3], [0.05, 0.1, 0.0])


def test_what_is_not_resolved_is_said_by_file_and_line():
    program = read_rapid([source(IRC5, "Path_10.mod"), source(IRC5_FRAMES, "CalibData.sys")])
    assert reasons(program) == [
        "Path_10.mod:22: MoveL stays as it is: \\T gives it a time, which a changed way would not keep",
        "Path_10.mod:26: MoveL stays as it is: 'Target_20' is not declared in the files; pass the module that declares it",
    ]


def test_without_the_module_of_its_frames_a_path_stays_as_it_is():
    program = read_rapid([source(IRC5)])
    assert not program.motions
    assert reasons(program)[0] == (
        "part.mod:15: MoveJ stays as it is: unknown tool 'tSpindle'; pass the module that declares it; "
        "unknown work object 'wPart'; pass the module that declares it"
    )


def test_a_part_in_the_hand_at_a_tool_that_stands_still():
    program = read_rapid([source(S4C, "grind.prg")])
    home, offset, at, out, turned = program.motions
    assert home.kind == "axes"
    np.testing.assert_allclose(np.degrees(home.end.q), [0, -20, 30, 0, 45, 0])
    assert all(move.part_in_hand for move in program.motions)
    np.testing.assert_allclose(offset.end.T, pose([12.5, -40, -47], [0.5, 0.5, -0.5, 0.5]), atol=1e-12)
    # the tool in the base is the flange times the part in the hand times the target
    flange = at.flange(at.end.T)
    np.testing.assert_allclose(flange @ at.part.T @ at.end.T, at.tool.T, atol=1e-12)
    np.testing.assert_allclose(at.tool.T, pose([1450.5, -220, 910], [0.707107, 0, 0.707107, 0]), atol=1e-6)
    np.testing.assert_allclose(at.part.T, pose([0, 0, 180], [1, 0, 0, 0]) @ pose([10, 0, 0], [0, 1, 0, 0]), atol=1e-12)
    expected = out.end.T @ pose([0, 0, -50], [1, 0, 0, 0]) @ se3.rotation("z", np.radians(15))
    np.testing.assert_allclose(turned.end.T, expected, atol=1e-12)
    assert [move.follows for move in program.motions] == [None, None, 1, 2, 3]
    assert reasons(program) == [
        "grind.prg:29: MoveL stays as it is: 'pLater' is assigned to in grind.prg:28, so its value is not known",
    ]


def test_the_zero_position_of_an_irb_120():
    """ABB's product specification: the flange is 374 mm in front of and 630 mm above the base, its z forward."""
    nine = "[9E9,9E9,9E9,9E9,9E9,9E9]"
    home = f"[[374,0,630],[0.7071068,0,0.7071068,0],[0,0,0,0],{nine}]"
    body = f"MoveAbsJ [[0,0,0,0,0,0],{nine}],v5,fine,tool0;MoveJ {home},v5,fine,tool0;"
    axes, pose_ = read_rapid([module(body)]).motions
    robot = load_robot("abb-irb120")
    flange = ErrorModel(robot).poses(axes.end.q[None])[0] @ se3.inverse(robot.T_flange_tool)
    np.testing.assert_allclose(flange, pose_.flange(pose_.end.T), atol=1e-7)
    assert pose_.end.posture.agrees(robot, axes.end.q[None])[0]


@pytest.mark.parametrize("odd", [False, True])
@pytest.mark.parametrize("shift", ["PDispOn p1,tool0", "PDispOn\\Rot\\ExeP:=p2,p1,tool0", "PDispSet shift"])
def test_a_program_displacement_is_why_motions_to_poses_stay(shift, odd):
    home = f"MoveAbsJ [[0,0,0,0,0,0],{NINE}],v5,fine,tool0;"
    body = f"MoveL p1,v5,fine,tool0;\n{shift}{',,' if odd else ''};\nMoveL p2,v5,fine,tool0;\n{home}"
    program = read_rapid([module(body, POINTS)])
    assert [move.kind for move in program.motions] == ["axes"]
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
def test_wrist_interpolation_is_diagnosed_at_each_line(option, turns):
    """A wrist that follows its own axes is pointed out at each line."""
    body = f"MoveL p1,v5,fine,tool0;\nSingArea{option};\nMoveL p2,v5,fine,tool0;\nSingArea\\Off;\nSingArea {option};"
    program = read_rapid([module(body, POINTS)])
    assert [move.follows for move in program.motions] == [None, 0]
    why = "SingArea lets the tool turn in another way along lines and arcs; its orientation between targets is not as predicted"
    assert reasons(program) == ([f"part.mod:14: {why}", f"part.mod:17: {why}"] if turns else [])


def test_frames_that_contradict_each_other():
    held = 'PERS wobjdata w:=[TRUE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];'
    program = read_rapid([module("MoveL p1,v100,fine,tool0\\WObj:=w;", POINTS + held)])
    assert "both held by the robot" in reasons(program)[0]


def test_postures_where_the_controller_is_told_not_to_check_them():
    program = read_rapid(
        [module("ConfL\\Off;MoveL p1,v5,fine,tool0;MoveL p2,v5,fine,tool0;MoveJ p3,v5,fine,tool0;", POINTS)]
    )
    assert [move.end.posture is None for move in program.motions] == [False, True, False]


def test_text_that_is_not_understood_is_passed_over_line_by_line():
    lines = ["MoveL p1,v5", 'TPWrite "never closed;\nMoveL p2,v5', "MoveL [[1,2,3],v5", "MoveL p3,v5"]
    body = "\n".join(f"{line},fine,tool0;" for line in lines)
    program = read_rapid([module(body, POINTS)])
    assert [move.end.name for move in program.motions] == ["p1", "p3"]
    assert [move.follows for move in program.motions] == [None, None]
    text = "\n".join(reasons(program))
    assert "part.mod:14: the string that begins here does not end in its line" in text
    assert "part.mod:15: MoveL stays as it is: the text around it is not understood" in text
    assert "part.mod:16: MoveL stays as it is: the text around it is not understood" in text


@pytest.mark.parametrize("text", ["", "hello", "PROC main() ENDPROC", "\0\1\2"])
def test_files_that_are_no_modules(text):
    with pytest.raises(FileError, match=r"part\.mod: (has no MODULE|is a binary file)"):
        read_rapid([source(text)])


@pytest.mark.parametrize(
    ("text", "line", "why"),
    [
        (
            f"MODULE m\n{POINTS}ENDMODULE\nPROC main()\nMoveL p1,v5,fine,tool0;\nENDPROC",
            13,
            "stands outside any MODULE",
        ),
        ("MoveL p1,v5,fine,tool0;\nMODULE m\nENDMODULE", 1, "stands outside any MODULE"),
    ],
)
def test_a_motion_outside_of_modules_is_named(text, line, why):
    assert any(
        said.startswith(f"part.mod:{line}: MoveL stays as it is: it {why}")
        for said in reasons(read_rapid([source(text)]))
    )


def test_a_motion_to_which_no_way_leads_is_named():
    body = "IF diAny=1 THEN\nSet doA;\nELSE\nMoveL p1,v5,fine,tool0;\nELSE\nMoveL p2,v5,fine,tool0;\nENDIF"
    program = read_rapid([module(body, POINTS)])
    assert [move.end.name for move in program.motions] == ["p1"]
    assert any("MoveL stays as it is: no way through the program leads to it" in said for said in reasons(program))


# Values that the text gives.


def test_elements_of_a_table_are_named_by_row_and_column():
    values = ",".join(f"[[{x},0,0],[1,0,0,0],[0,0,0,0],{NINE}]" for x in range(6))
    rows = values.replace("]],[[", "]]|[[").split("|")
    table = f"CONST robtarget t{{2,3}}:=[[{','.join(rows[:3])}],[{','.join(rows[3:])}]];"
    (move,) = read_rapid([module("MoveL t{2,1},v5,fine,tool0;", table)]).motions
    assert move.end.name == "t{2,1}"
    assert move.end.T[0, 3] == pytest.approx(0.003)


def test_components_of_records_of_the_program():
    declarations = (
        "RECORD station robtarget pick; num id; ENDRECORD\n"
        f"CONST station s{{2}}:=[[[[1,2,3],[1,0,0,0],[0,0,0,0],{NINE}],1],[[[4,5,6],[1,0,0,0],[0,0,0,0],{NINE}],2]];\n"
    )
    body = "MoveL s{2}.pick,v5,fine,tool0;MoveL Offs(S{last-1}.Pick,0,0,1),v5,fine,tool0;"
    move, shifted = read_rapid([module(body, declarations + "CONST num last:=2;")]).motions
    assert (move.end.name, shifted.end.name) == ("s{2}.pick", "s{1}.pick")
    np.testing.assert_allclose(move.end.T[:3, 3], [0.004, 0.005, 0.006])


# The robot's base frame in a controller's motion parameters.


MOC = """\
MOC:CFG_1.0:6:0::

#
ARM:

      -name "rob1_1" -use_arm_type "IRB_1" -lower_joint_bound -3

#
ROBOT:

      -name "ROB_1" -use_robot_type "ROB1_140"\\
      -base_frame_pos_x 0.5 -base_frame_pos_y -1.25\\
      -base_frame_pos_z 0.7 -base_frame_orient_u0 0.70710678\\
      -base_frame_orient_u3 0.70710678 -gravity_beta 0.1

#
SINGLE:

      -name "STN1" -base_frame_pos_x 3.5
"""


def test_the_base_is_read_from_the_robots_record():
    found = base_frame(source(MOC, "MOC.cfg"))
    np.testing.assert_allclose(found, pose([500, -1250, 700], [0.5**0.5, 0, 0, 0.5**0.5]), atol=1e-9)
    plain = base_frame(source('MOC:CFG_1.0:5:0::\nROBOT:\n\n      -name "ROB_1"\n', "MOC.cfg"))
    np.testing.assert_array_equal(plain, np.eye(4))


def test_work_objects_are_counted_in_the_robots_base():
    sources = [source(IRC5, "Path_10.mod"), source(IRC5_FRAMES, "CalibData.sys")]
    alone, mounted = read_rapid(sources), read_rapid([*sources, source(MOC, "MOC.cfg")])
    base = base_frame(source(MOC, "MOC.cfg"))
    assert alone.T_world_base is None
    np.testing.assert_array_equal(mounted.T_world_base, base)
    for one, other in zip(alone.motions, mounted.motions, strict=True):
        np.testing.assert_array_equal(one.tool.T, other.tool.T)
        expected = one.part.T if one.carrier else se3.inverse(base) @ one.part.T
        np.testing.assert_allclose(other.part.T, expected, atol=1e-15)
    assert len({id(move.part) for move in mounted.motions}) == len({id(move.part) for move in alone.motions})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("EIO:CFG_1.0:6:0::\n", "of a controller's .cfg files pass MOC.cfg only"),
        ("MOC:CFG_1.0:6:0::\nARM:\n", "has no robot in its section ROBOT"),
        ("MOC:CFG_1.0:6:0::\n", "has no robot in its section ROBOT"),
        ("MOC:CFG_1.0:6:0::\nROBOT:\n", "has no robot in its section ROBOT"),
        (
            MOC.replace("-0.25", "x").replace("-1.25", "1,25"),
            "base_frame_pos_y of ROB_1 is '1,25', which is not a number",
        ),
        (MOC.replace("0.70710678", "0.5"), "its quaternion has length 0.7071"),
        (MOC.replace("-gravity_beta 0.1", '-base_frame_coordinated "TRACK1"'), "TRACK1 moves the base of ROB_1"),
        (
            MOC.replace("#\nSINGLE", '-name "ROB_2" -base_frame_pos_x 1\n#\nSINGLE'),
            r"different places \(ROB_1, ROB_2\)",
        ),
    ],
)
def test_what_does_not_say_where_one_robot_stands_is_refused(text, words):
    with pytest.raises(FileError, match=words):
        base_frame(source(text, "MOC.cfg"))


def test_parameters_go_with_a_program_and_only_once():
    with pytest.raises(FileError, match="pass the modules with the motions, too"):
        read_rapid([source(MOC, "MOC.cfg")])
    with pytest.raises(FileError, match=r"pass one MOC\.cfg"):
        read_rapid([source(IRC5, "a.mod"), source(MOC, "MOC.cfg"), source(MOC, "old/MOC.cfg")])
