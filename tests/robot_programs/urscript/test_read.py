"""What motions of URScript programs are read as."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot_programs.core.program import Frame
from robot_programs.urscript.read import read_urscript
from taskcal.errors import FileError
from taskcal.geometry import se3
from taskcal.robot.error_model import ErrorModel
from tests.robot_programs.urscript.samples import UR5, read, source

Q = np.array([0.1, -1.2, 1.5, -1.8, -1.4, 0.3])
JOINTS = "[0.1, -1.2, 1.5, -1.8, -1.4, 0.3]"
P1 = (-0.143968656714, -0.435620060803, 0.202030025428, -0.001221359682, 3.116276528482, 0.038891915637)


def transform(x, y, z, rx, ry, rz):
    return se3.pose(Rotation.from_rotvec([rx, ry, rz]).as_matrix(), np.array([x, y, z], dtype=float))


def only(*lines, **given):
    """The one motion of a program that has nothing to diagnose."""
    program = read(*lines, **given)
    assert not program.diagnostics
    (move,) = program.motions
    return move


def test_a_move_to_joints_needs_no_tcp():
    move = only(f"movej({JOINTS}, a=1.4, v=1.05)", tcp=False)
    assert (move.kind, move.stops, move.speed) == ("axes", True, None)
    np.testing.assert_array_equal(move.end.q, Q)


def test_a_pose_is_metres_and_a_rotation_vector_in_the_base():
    move = only("movel(p[.4, -0.1, 3e-1, 1.0, -2.0, 0.5], a=1.2, v=0.2, r=0.02)")
    np.testing.assert_allclose(move.end.T, transform(0.4, -0.1, 0.3, 1.0, -2.0, 0.5), atol=1e-12)
    assert (move.kind, move.part.name, move.tool.name) == ("linear", "Base", "TCP")
    assert (move.speed, move.stops, move.zone.distance) == (0.2, False, 0.02)
    np.testing.assert_allclose(move.tool.T, se3.translation(0, 0, 0.1))


def test_the_inverse_near_to_joints_states_the_posture():
    move = only("movej(get_inverse_kin(Waypoint_1_p, qnear=Waypoint_1_q), a=1.39)")
    assert (move.kind, move.end.name) == ("joint", "Waypoint_1_p")
    np.testing.assert_allclose(move.end.T, transform(*P1), atol=1e-12)
    near = move.end.posture
    other = near.q + 2.0 * np.eye(6)[4]
    assert list(near.agrees(UR5, np.stack([near.q + 1e-3, other]))) == [True, False]
    assert near.miss(UR5, np.stack([near.q, other]))[1] == pytest.approx(2.0)
    assert only("movej(Waypoint_1_p)").end.posture is None


def test_a_line_to_joints_goes_to_their_pose():
    move = only(f"movel({JOINTS})")
    np.testing.assert_allclose(move.end.T, ErrorModel(UR5).poses(Q[None])[0] @ se3.translation(0, 0, 0.1), atol=1e-12)
    program = read_urscript((source(f"set_tcp(p[0,0,0,0,0,0])\nmovel({JOINTS})\n"),))
    assert not program.motions
    assert "kinematics" in program.diagnostics[0].text


def test_a_feature_is_the_frame_of_its_part():
    move = only("movel(pose_trans(Plane_1, p[.1, 0, .2, 0, 3, 0]))")
    np.testing.assert_allclose(move.part.T, transform(0.4, -0.2, 0.1, 0, 0, 0.5), atol=1e-12)
    assert move.part.name == "Plane_1"
    np.testing.assert_allclose(move.end.T, transform(0.1, 0, 0.2, 0, 3, 0), atol=1e-12)


def test_a_given_part_is_that_of_motions_without_a_feature():
    part = Frame(name="table", T=transform(0.3, 0.1, 0, 0, 0, 1))
    move = only("movel(Waypoint_1_p)", part=part)
    assert move.part is part
    np.testing.assert_allclose(part.T @ move.end.T, transform(*P1), atol=1e-12)


def test_an_arc_has_the_position_of_its_first_point():
    move = only("movec(p[.1, .2, .3, 0, 0, 0], p[.4, .1, .1, 0, 3, 0], v=0.1, mode=0)")
    assert move.kind == "circular"
    np.testing.assert_allclose(move.via.T[:3, 3], [0.1, 0.2, 0.3])


def test_the_tool_turns_with_an_arc_of_mode_one():
    """Three quarters of a circle about z in a turned feature: the stated orientation is not taken."""
    end = "pose_trans(Plane_1, p[0, -.1, 0, 1, 1, 0])"
    program = read(
        "movel(pose_trans(Plane_1, p[.1, 0, 0, 0.3, 3, 0.2]))",
        f"movec(pose_trans(Plane_1, p[-.1, 0, 0, 0, 0, 0]), {end}, mode=1)",
    )
    start, arc = program.motions
    turned = Rotation.from_euler("z", 270, degrees=True).as_matrix() @ start.end.T[:3, :3]
    np.testing.assert_allclose(arc.end.T, se3.pose(turned, np.array([0, -0.1, 0])), atol=1e-12)
    waypoint = replace(arc.own_waypoint(), T=arc.end.T @ se3.translation(0, 0, 0.001))
    assert ", 1, 1, 0]), mode=1)" in program.rewrite(UR5, {1: (waypoint,)})[0].text


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("pose_trans(p[.2,.5,.1,1.57,0,0], p[.2,.5,.6,1.57,0,0])", (0.4, -0.0996, 0.60048, 3.14, 0, 0)),
        ("pose_add(p[.2,.5,.1,1.57,0,0], p[.2,.5,.6,1.57,0,0])", (0.4, 1.0, 0.7, 3.14, 0, 0)),
        ("pose_add(pose_sub(p[.2,.5,.1,1,.3,0], p[.3,.1,.6,0,0,2]), p[.3,.1,.6,0,0,2])", (0.2, 0.5, 0.1, 1, 0.3, 0)),
        ("pose_trans(pose_inv(p[.2,.5,.1,1,.3,0]), p[.2,.5,.1,1,.3,0])", (0, 0, 0, 0, 0, 0)),
        ("interpolate_pose(p[.2,.4,.6,0,0,0], p[.4,.5,.9,0,0,1], 0.5)", (0.3, 0.45, 0.75, 0, 0, 0.5)),
        (
            "p[2*.1 - 1/2.0, d2r(90), sqrt(0.25), rpy2rotvec([0,0,1])[2], -(-1), cos(0)]",
            (-0.3, math.pi / 2, 0.5, 1, 1, 1),
        ),
    ],
)
def test_poses_are_computed_as_the_manual_states(expression, expected):
    """The first two are the manual's own examples, which it rounds."""
    move = only(f"movel({expression})")
    np.testing.assert_allclose(move.end.T, transform(*expected), atol=2e-3 if "1.57" in expression else 1e-12)


def test_calls_bind_parameters_defaults_and_results():
    program = read(
        "def above(wp, h=0.1):", "return pose_add(wp, p[0, 0, h, 0, 0, 0])", "end",
        "def goto(target, speed=0.1, blend=0):", "movel(target, v=speed, r=blend)", "end",
        "goto(above(Waypoint_1_p))", "goto(above(Waypoint_1_p, h=0.2), blend=0.01, speed=0.3)",
    )  # fmt: skip
    assert not program.diagnostics
    assert [(m.end.T[2, 3], m.speed, m.stops, m.texts_motions) for m in program.motions] == [
        (pytest.approx(P1[2] + 0.1), 0.1, True, 2), (pytest.approx(P1[2] + 0.2), 0.3, False, 2),
    ]  # fmt: skip


def test_a_loop_over_a_list_goes_to_each_element():
    program = read("list = [Waypoint_1_p, p[.1, .2, .3, 0, 0, 1]]", "i = 0", "while i < length(list):", "movel(list[i])",
                   "i = i + 1", "if i == 1:", "continue", "end", "sleep(1)", "end")  # fmt: skip
    assert not program.diagnostics
    assert [m.end.T[0, 3] for m in program.motions] == [P1[0], 0.1]
    assert [m.follows for m in program.motions] == [None, 0]


@pytest.mark.parametrize(
    ("lines", "value"),
    [
        (("x = 0.1", "if x > 1:", "x = 0.2", "elif x == 0.1:", "x = 0.3", "else:", "x = 0.4", "end"), 0.3),
        (("x = 0.1", "def set():", "global x = 0.7", "end", "set()"), 0.7),
        (("global x = 0.1", "def other():", "local x = 0.7", "end", "other()"), 0.1),
        (("global x = 0.1", "def other(x):", "x = 0.7", "end", "other(3)"), 0.1),
        (("x = 0.1", "while True:", "x = x + 0.1", "if x > 0.25:", "break", "end", "end"), 0.1 + 0.1 + 0.1),
        (("q = p[0.6,0,0,0,0,0]", "q[0] = 0.8", "x = q[0]"), 0.8),
        (("x = 0.1", "if True:", "x = 0.2 end"), 0.2),
        (("x = 0.1", 'textmsg("it\'s")'), 0.1),
        (("x = 0.1", "thread t():", "y = 2", "end", "handle = run t()", "kill handle"), 0.1),
        (("s = struct(at=0.1, to=p[0.5, 0, 0, 0, 0, 0])", "s.at = s.to[0] + 0.2", "x = s.at"), 0.7),
        (("global n = 0.5", "def next():", "n = n + 0.1", "return n", "end", "x = n + next()"), 1.1),
        (
            ("def one():", "return 0.1", "end", "x = 0", "while x < one() * 4:", "x = x + one()", "end"),
            0.1 + 0.1 + 0.1 + 0.1,
        ),
        (
            (
                "n = 0.1",
                "def is_on():",
                "n = n + 0.1",
                "return n > 1",
                "end",
                "if n > 0:",
                "x = n",
                "elif is_on():",
                "x = 0",
                "end",
            ),
            0.1,
        ),
    ],
)
def test_variables_are_followed(lines, value):
    assert only(*lines, "movel(p[x, 0, 0, 0, 0, 0])").end.T[0, 3] == value


@pytest.mark.parametrize(
    ("lines", "reason"),
    [
        (("movel(get_actual_tcp_pose())",), "get_actual_tcp_pose returns"),
        (("x = read_port_register(3)", "movel(p[x, 0, 0, 0, 0, 0])"), "read_port_register returns"),
        (("x = socket_read_ascii_float(6)", "movel(p[x[1], 0, 0, 0, 0, 0])"), "socket_read_ascii_float returns"),
        (("x = rg_width()", "movel(p[x, 0, 0, 0, 0, 0])"), "rg_width returns"),
        (("x = 1", "if get_digital_in(0):", "x = 2", "end", "movel(p[x, 0, 0, 0, 0, 0])"), "in one branch"),
        (("x = 1", "thread t():", "x = 2", "end", "run t()", "movel(p[x, 0, 0, 0, 0, 0])"), "in a thread"),
        (("thread t():", "set_tcp(p[0,0,0,0,0,0])", "end", "run t()", "movel(Waypoint_1_p)"), "a thread"),
        (("x = 1 / 2", "movel(p[x, 0, 0, 0, 0, 0])"), "whole numbers"),
        (("set_tcp(get_tcp_offset())", "movel(Waypoint_1_p)"), "TCP that is not known"),
        (("force_mode(Plane_1, [0,0,1,0,0,0], [0,0,9,0,0,0], 2, [1,1,1,1,1,1])", "movel(Waypoint_1_p)"), "force mode"),
        (("movec(Waypoint_1_p, Plane_1, mode=1)",), "in which it begins is not known"),
        (("movec(Waypoint_1_p, Plane_1, mode=get_digital_in(0))",), "neither 0 nor 1"),
        (("movel(nowhere)",), "nowhere is not known"),
        (("movel(p[0, 0, 0, 0, 0])",), "not six numbers"),
        (("movel(Waypoint_1_p, speed=3)",), "arguments"),
        (("movel(get_inverse_kin(Waypoint_1_p, nowhere))",), "qnear is not known"),
        (("servoj(Waypoint_1_q, t=0.1)",), "steered"),
        (("speedl([0, 0, 0.1, 0, 0, 0], 0.5)",), "steered"),
        (("movel(x = = 2)",), "not understood"),
        (("a = movel(Waypoint_1_p)",), "part of an expression"),
        (("movel(" + "+".join(["x"] * 5000) + ")",), "not understood"),
        (("movel(" + "[" * 5000 + "x" + "]" * 5000 + ")",), "not understood"),
        (("movel(x" + "[0]" * 5000 + ")",), "not understood"),
        (("movel(" + "-" * 5000 + "x)",), "not understood"),
        (("x = [1, 2]", "while read_port_bit(1):", "x = [x, x]", "end", "movel(x)"), "neither a pose"),
        (("x = [1]", "n = 0", "while n < 900:", "n = n + 1", "x = [x, x]", "end", "movel(x)"), "neither a pose"),
        (("x = [1]", "n = 0", "while n < 900:", "n = n + 1", "x[0] = x", "end", "movel(x)"), "movel stays as it is"),
        (("def f(n):", "return f(n) + 1", "end", "movel(p[f(1), 0, 0, 0, 0, 0])"), "the value of f()"),
    ],
)
def test_what_only_the_controller_knows_is_diagnosed(lines, reason):
    program = read(*lines)
    assert not program.motions
    assert any(reason in diagnostic.text for diagnostic in program.diagnostics)


def test_without_a_tcp_a_pose_asks_for_it_or_takes_the_given_one():
    program = read("movel(Waypoint_1_p)", tcp=False)
    assert not program.motions
    assert "--tool" in program.diagnostics[0].text
    tool = Frame(name="gripper", T=se3.translation(0, 0, 0.2))
    assert only("movel(Waypoint_1_p)", tcp=False, tool=tool).tool is tool
    assert only("movel(Waypoint_1_p)", tool=tool).tool.name == "TCP"


def test_tools_are_called_as_the_program_calls_them():
    names = [
        only(line, "movel(Waypoint_1_p)").tool.name
        for line in ("set_tcp(Plane_1)", "set_tcp(p[0,0,0,0,0,0], 'mill')", "set_tcp(p[0,0,0,0,0,0])")
    ]
    assert names == ["Plane_1", "mill", "TCP"]


def test_a_function_that_no_file_has_is_named_once():
    program = read("movel(Waypoint_1_p)", "rq_close()", "rq_close()", "movel(Plane_1)")
    (diagnostic,) = program.diagnostics
    assert "rq_close is not in the files given (2 times)" in diagnostic.text
    assert [m.follows for m in program.motions] == [None, None]


@pytest.mark.parametrize(
    ("call", "known"), [("set_payload(0.5)", True), ("set_gripper(3)", False), ("get_part()", False), ("set_pos(home)", None),
                        ("arm.go()", False), ("server.ask()", True)],
)  # fmt: skip
def test_where_the_robot_is_after_a_function_by_what_the_manual_states(call, known):
    """Names that begin alike tell nothing: what is neither in the manual nor in the files is said, and may move the robot."""
    program = read("server = rpc_factory('xmlrpc', 'http://10.0.0.1')", "movel(Waypoint_1_p)", call, "movel(Plane_1)")
    assert program.motions[1].follows == (0 if known else None)
    assert bool(program.diagnostics) == (known is False)


def test_many_branches_with_functions_are_read():
    lines = [line for k in range(300) for line in (f"elif is_on({k}):", "n = 1")]
    move = only(
        "def is_on(n):", "return get_digital_in(n)", "end", "if is_on(0):", "n = 0", *lines, "end", "movel(Plane_1)"
    )
    np.testing.assert_allclose(move.end.T[:3, 3], [0.4, -0.2, 0.1])


def test_motions_behind_a_bracket_that_is_open_are_named():
    program = read("movel(Waypoint_1_p", "movel(Plane_1)", "movej(Waypoint_1_q)")
    assert not program.motions
    assert [one.place.line for one in program.diagnostics if one.unread] == [6, 7, 8]


def test_time_takes_the_place_of_speed_and_is_not_divided():
    move = only("movel(Waypoint_1_p, v=0.1, t=2)")
    assert (move.speed, move.divisible) == (None, False)


def test_functions_outside_see_what_stands_before_them():
    text = "set_tcp(p[0,0,0.1,0,0,0])\nhome = p[.1,.2,.3,0,0,0]\n"
    text += "def unused():\nmovel(home)\nend\ndef prog():\nmovel(home)\nend\nprog()\n"
    assert len(read_urscript((source(text),)).motions) == 2


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("def prog():\n  movel(p[0,0,0,0,0,0])\n", 1, "is not closed by 'end'"),
        ("def prog():\nend\nend\n", 3, "closes nothing"),
        ("def prog():\n  else:\nend\n", 2, "belongs to no 'if'"),
        ("def prog():\n  if x:\n    break\n  end\nend\n", 3, "is in no loop"),
        ("x = 1\n", None, "not URScript"),
        ("\0\0", None, "binary"),
        ("if x:\n" * 60 + "movel(y)\n" + "end\n" * 60, 42, "lies in more than 40 blocks"),
    ],
)
def test_what_is_no_program_is_refused_with_its_place(text, line, words):
    with pytest.raises(FileError, match=words) as refused:
        read_urscript((source(text),))
    assert refused.value.line == line
    assert "prog.script" in str(refused.value)


THREADS = {
    "in a thread": ("thread t():", "while True:", "{0}", "sleep(0.1)", "{1}", "end", "end"),
    "in a function of a thread": ("def hand():", "{0}", "{1}", "end", "thread t():", "hand()", "end"),
    "in a branch of a thread": ("thread t():", "if get_standard_digital_in(0):", "{0}", "else:", "{1}", "end", "end"),
}
BY_HAND = ("freedrive_mode()", "end_freedrive_mode()"), ("teach_mode()", "end_teach_mode()")
MOVING_OFF = ("path_offset_enable()", "path_offset_disable()"), ("force_mode(x, y, z, 2, w)", "end_force_mode()")


@pytest.mark.parametrize("kind", THREADS)
@pytest.mark.parametrize("calls", [*BY_HAND, *MOVING_OFF])
def test_a_thread_unreads_motions_only_if_it_moves_the_tool_off_their_targets(kind, calls):
    """A person who moves the arm leaves the targets where they are, which is said."""
    lines = [line.format(*calls) for line in THREADS[kind]]
    motions = ["handle = run t()", "movej(Waypoint_1_q)", "movel(Waypoint_1_p)", "movep(Waypoint_1_p)"]
    program, plain = read(*lines, *motions), read(*motions[1:])
    said = [one for one in program.diagnostics if "a thread may let a person move the arm" in one.text]
    if calls in BY_HAND:
        assert [(move.kind, move.follows) for move in program.motions] == [(m.kind, m.follows) for m in plain.motions]
        assert [program.sources[0].text.split("\n")[one.place.line - 1].strip() for one in said] == [calls[0]]
    else:
        assert not program.motions
        assert not said


@pytest.mark.parametrize("calls", BY_HAND)
def test_no_motion_is_read_while_the_program_itself_lets_a_person_move_the_arm(calls):
    begin, end = calls
    program = read("movel(Waypoint_1_p)", begin, "movel(Waypoint_1_p)", end, "movel(Waypoint_1_p)")
    lines = [move.place.line for move in program.motions]
    assert len(lines) == 2
    assert lines[1] - lines[0] == 4
    assert program.motions[1].follows is None
