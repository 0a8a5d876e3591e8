"""RAPID that is rewritten: targets, clones, and their numbers."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.core.program import Waypoint
from robot_programs.rapid.read import read_rapid
from robot_programs.rapid.resolve import Confdata
from robot_programs.rapid.values import quaternion_texts, real
from taskcal.errors import TaskcalError
from taskcal.robot.catalogue import load_robot
from tests.laws.robots import generators
from tests.robot_programs.rapid.generator import generate
from tests.robot_programs.rapid.samples import (
    IRC5,
    IRC5_FRAMES,
    POINTS,
    ROBOT,
    Q,
    module,
    rewritten,
    shifted,
    source,
)


def lines_that_differ(a: str, b: str) -> list[str]:
    return [line for line in b.splitlines() if line not in a.splitlines()]


@given(generators)
def test_a_program_is_read_as_it_is_meant(rng):
    made = generate(rng)
    program = read_rapid(made.sources)
    assert not program.diagnostics
    assert [move.kind for move in program.motions] == [meant.kind for meant in made.motions]
    for move, meant in zip(program.motions, made.motions, strict=True):
        np.testing.assert_allclose(move.tool.T, meant.tool, atol=1e-12)
        np.testing.assert_allclose(move.part.T, meant.part, atol=1e-12)
        assert move.stops == meant.stops
        if meant.T is None:
            np.testing.assert_allclose(move.end.q, meant.q, atol=1e-15)
        else:
            np.testing.assert_allclose(move.end.T, meant.T, atol=1e-12)


@pytest.mark.parametrize(
    "other", ["reg1:=p1.trans.x;", "pLast:=p1;", "Remember p1;", "IF Distance(p1.trans,p2.trans)>3 Stop;", "<p1>"]
)
def test_a_target_that_is_read_elsewhere_stays(other):
    before = module(f"MoveL p1,v100,fine,tool0;\n{other}", POINTS)
    after = rewritten(before, 0)
    assert before.text.splitlines()[1] in after.splitlines()
    assert "MoveL p1_2,v100" in after


def test_rewrite_replaces_shifted_targets_by_own_ones():
    """Targets under offs and reltool are replaced by targets of their own."""
    body = "MoveL Offs(p1,0,0,50),v100,fine,tool0;\nMoveL RelTool(p1,0,0,-50),v100,fine,tool0;\nMoveL p1,v100,z1,tool0;"
    before = module(body, POINTS)
    after = rewritten(before, 0, 1)
    assert lines_that_differ(before.text, after) == [
        "CONST robtarget p1_2:=[[11,0,50],[1,0,0,0],[0,-2,2,0],[9E9,9E9,9E9,9E9,9E9,9E9]];",
        "CONST robtarget p1_3:=[[11,0,-50],[1,0,0,0],[0,-2,2,0],[9E9,9E9,9E9,9E9,9E9,9E9]];",
        "MoveL p1_2,v100,fine,tool0;",
        "MoveL p1_3,v100,fine,tool0;",
    ]


def test_rewrite_edits_elements_and_clones_indexed_ones():
    """Elements of arrays are edited in place and those read by index are cloned."""
    three = ",\n".join(f"[[{k},0,0],[1,0,0,0],[0,-2,2,0],[9E9,9E9,9E9,9E9,9E9,9E9]]" for k in (1, 2, 3))
    declaration = f"PERS robtarget way{{3}}:=[{three}];"
    own = rewritten(module("MoveL way{2},v100,fine,tool0;", declaration), 0)
    assert "[[3,0,0],[1,0,0,0],[0,-2,2,0],[9E9,9E9,9E9,9E9,9E9,9E9]],\n[[3,0,0]" in own
    shared = rewritten(module("MoveL way{2},v100,fine,tool0;\nMoveL way{i},v100,fine,tool0;", declaration), 0)
    assert declaration in shared
    assert "PERS robtarget way_2:=[[3,0,0],[1,0,0,0],[0,-2,2,0],[9E9,9E9,9E9,9E9,9E9,9E9]];" in shared
    assert "MoveL way_2,v100" in shared


def test_computed_numbers_are_not_edited():
    declaration = (
        "CONST num h:=20;CONST robtarget p:=[[h+1,0,0],[1,0,0,0],[0,-2,2,0],[9E9,9E9,9E9,9E9,9E9,9E9]]; ! at the edge"
    )
    after = rewritten(module("MoveL p,v100,fine,tool0;", declaration), 0)
    assert f"{declaration}\nCONST robtarget p_2:=[[22,0,0],[1,0,0,0],[0,-2,2,0],[9E+09," in after


@pytest.mark.parametrize(
    ("name", "others", "clone"),
    [
        ("p" * 32, ["p" * 30 + "_2"], "p" * 30 + "_3"),
        ("pApproachLeft_1", [], "pApproachLeft__2"),  # short enough for old controllers
    ],
)
def test_names_of_clones_are_free_and_not_too_long(name, others, clone):
    text = POINTS
    for old, new in zip(("p1:", "p2:"), (name, *others), strict=False):
        text = text.replace(old, f"{new}:")
    after = rewritten(module(f"MoveL {name},v100,fine,tool0;MoveL {name},v5,fine,tool0;", text), 0)
    assert f"CONST robtarget {clone}:=" in after


def test_local_data_of_a_routine_are_cloned_where_they_are():
    body = f"VAR {POINTS.splitlines()[0][6:]}\n  MoveL p1,v100,fine,tool0;\nMoveL Offs(p1,0,0,1),v5,fine,tool0;"
    after = rewritten(module(body), 1)
    assert "VAR robtarget p1_2:=[[11,0,1]" in after
    assert read_rapid([source(after)]).motions[1].end.T[0, 3] == pytest.approx(0.011)


def test_inserted_motions_fly_by_with_the_same_arguments():
    """Further points stop nowhere and take the arguments of the motion."""
    body = (
        "  MoveL\\Conc,p1,v100\\V:=30,z5\\Z:=3,tool0\\WObj:=wobj0; ! down\n"
        "\tMoveJ p2,v100,z20\\Inpos:=inpos20,tool0;\n"
        "  MoveAbsJ\n[[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]]\\NoEOffs,v5,fine,tool0;"
    )
    program = read_rapid([module(body.replace("\n", "\r\n"), POINTS)])
    waypoints = {i: path * 2 for i, path in shifted(program, 0, 1).items()}
    waypoints[2] = (
        Waypoint(kind="axes", q=Q, T=None),
        Waypoint(kind="linear", q=Q, T=np.eye(4)),
        Waypoint(kind="axes", q=Q, T=None),
    )
    pose, nine = "[[{},0,0],[1,0,0,0],[0,-2,2,0],[9E9,9E9,9E9,9E9,9E9,9E9]]", "[9E9,9E9,9E9,9E9,9E9,9E9]"
    text = program.rewrite(ROBOT, waypoints)[0].text
    assert text[text.index("PROC main()\n") :] == (
        "PROC main()\n"
        f"  MoveL {pose.format(11)},v100\\V:=30,z5\\Z:=3,tool0\\WObj:=wobj0;\r\n"
        "  MoveL\\Conc,p1,v100\\V:=30,z5\\Z:=3,tool0\\WObj:=wobj0; ! down\r\n"
        f"\tMoveJ {pose.format(21)},v100,z0,tool0;\r\n"
        "\tMoveJ p2,v100,z20\\Inpos:=inpos20,tool0;\r\n"
        f"  MoveAbsJ [[10,20,15,-100,40,200],{nine}]\\NoEOffs,v5,z0,tool0;\r\n"
        f"  MoveL {pose.format(0)},v5,z0,tool0;\r\n"
        f"  MoveAbsJ\r\n[[10,20,15,-100,40,200],{nine}]\\NoEOffs,v5,fine,tool0;\nENDPROC\nENDMODULE\n"
    )


def test_what_an_if_without_then_governs_stays_together():
    program = read_rapid([module("  IF a=1 MoveL p1,v100,fine,tool0;\n  MoveL p2,v100,fine,tool0;", POINTS)])
    waypoints = {0: shifted(program, 0)[0] * 2}
    after = read_rapid(program.rewrite(ROBOT, waypoints))
    assert [move.follows for move in after.motions] == [None, 0, None]
    assert not after.diagnostics


def test_an_arc_becomes_lines_or_stays_an_arc():
    program = read_rapid([source(IRC5, "Path_10.mod"), source(IRC5_FRAMES, "CalibData.sys")])
    arc = program.motions[4]
    line = Waypoint(kind="linear", q=Q, T=arc.via.T)
    end = Waypoint(kind="linear", q=Q, T=arc.end.T)
    as_lines = program.reread(program.rewrite(ROBOT, {4: (line, end)}))
    assert [move.kind for move in as_lines.motions[4:6]] == ["linear", "linear"]
    np.testing.assert_allclose(as_lines.motions[4].end.T, arc.via.T, atol=1e-9)
    via = arc.via.T.copy()
    via[:3, 3] += 1e-3
    as_arc = program.rewrite(
        ROBOT, {4: (Waypoint(kind="circular", q=Q, T=arc.end.T, via=Waypoint(kind="circular", q=Q, T=via)),)}
    )
    assert "MoveC Arc_via,Arc_end,vCut,fine" in as_arc[0].text
    assert "Arc_via:=[[51,101,1]" in as_arc[0].text
    two = {3: (Waypoint(kind="circular", q=Q, T=arc.end.T, via=line),)}
    third = program.reread(program.rewrite(ROBOT, two)).motions[3]
    assert third.kind == "circular"
    np.testing.assert_allclose(third.via.T, arc.via.T, atol=1e-9)


def test_rewrite_never_calls_a_routine_named_like_a_motion():
    """No routine of the programs own is called in place of a motion."""
    own = '  MoveAbsJ [[0,10,20,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool0;\nENDPROC\nPROC MoveL()\n  TPWrite "mine";'
    program = read_rapid([module(own, POINTS)])
    pose = np.eye(4)
    waypoints = (Waypoint(kind="linear", q=Q, T=pose), Waypoint(kind="axes", q=Q, T=None))
    with pytest.raises(
        TaskcalError, match=r"part\.mod:\d+: cannot become a MoveL, which is a routine of the program's own"
    ):
        program.rewrite(ROBOT, {0: waypoints})


def test_a_robot_without_six_joints_is_refused():
    program = read_rapid([module("MoveL p1,v5,fine,tool0;", POINTS)])
    with pytest.raises(TaskcalError, match="has 7 joints"):
        program.rewrite(load_robot("barrett-wam"), shifted(program, 0))


def test_configurations_are_those_of_the_posture():
    program = read_rapid([module("MoveL p1,v5,fine,tool0;", POINTS)])
    robot = load_robot("abb-irb120")
    q = np.radians([-100.0, 0, 0, 95, -5, 185])
    text = program.rewrite(robot, shifted(program, 0, q=q))[0].text
    assert "[11,0,0],[1,0,0,0],[-2,1,2,1]" in text
    assert str(Confdata.of(robot, q)) == "[-2,1,2,1]"


# Numbers of rewritten targets.


def test_unchanged_numbers_keep_text_and_sign():
    """Numbers that stay keep their text and the quaternion its sign."""
    declaration = "CONST robtarget p:=[[1.500,-0.0,7e1],[-0.707,0,-.7072136,0],[0,-2,2,0],[9E9,9E9,9E9,9E9,9E9,9E9]];"
    body = "MoveL p,v100,fine,tool0;"
    assert "[[2.5,-0.0,7e1],[-0.707,0,-.7072136,0]" in rewritten(module(body, declaration), 0)
    program = read_rapid([module(body, declaration)])
    T = program.motions[0].end.T @ np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])
    text = program.rewrite(ROBOT, {0: (Waypoint(kind="linear", q=Q, T=T),)})[0].text
    q = [float(v) for v in re.search(r"7e1\],\[([^]]*)\]", text)[1].split(",")]
    assert q[0] < 0.0
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=6e-8)


def test_clones_are_written_in_the_style_of_their_declaration():
    declaration = (
        "PERS  robtarget p := [ [ 1.5, 2, 3 ],\n    [ 1,0,0,0 ], ! upright\n"
        "    [ 0,-2,2,0 ], [9E9,9E9,9E9,9E9,9E9,9E9] ] ; ! first\nVAR num n;"
    )
    after = rewritten(module("MoveL p,v100,fine,tool0;MoveL p,v5,fine,tool0;", declaration), 0)
    clone = "PERS  robtarget p_2 := [ [ 2.5, 2, 3 ],\n    [ 1,0,0,0 ], ! upright\n    [ 0,-2,2,0 ], [9E9,9E9,9E9,9E9,9E9,9E9] ];"
    assert f"! first\n{clone}\nVAR num n;" in after


def test_external_axes_keep_their_text():
    target = "[[0,0,0],[1,0,0,0],[0,-2,2,0],[ 100.50,9E9,9E+09,9E9,9E9,9E9]]"
    program = read_rapid([module(f"MoveL {target},v5,fine,tool0;")])
    waypoints = {0: shifted(program, 0)[0] * 2}
    assert program.rewrite(ROBOT, waypoints)[0].text.count("[100.50,9E9,9E+09,9E9,9E9,9E9]") == 1
    assert program.rewrite(ROBOT, waypoints)[0].text.count("[ 100.50,9E9,9E+09,9E9,9E9,9E9]") == 1


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (-1e-9, "0"), (-0.0, "0"), (600.0, "600"), (0.1, "0.1"), (1711.03125, "1711.0312"), (-12.34567, "-12.34567"),
     (9e9, "9E+09"), (1e6, "1000000"), (0.00002, "0.00002")],
)  # fmt: skip
def test_numbers_by_hand(value, text):
    assert real(value, 5) == text


@given(st.floats(-1e6, 1e6))
def test_the_text_gives_the_single_precision_value_back(value):
    text = real(value, 6)
    assert np.float32(text) == np.float32(round(value, 6))
    assert len(text.strip("-0.").replace(".", "")) <= 9


@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 1e-3))
def test_quaternions_stay_of_unit_length(q):
    unit = np.array(q) / np.linalg.norm(q)
    written = np.array([float(text) for text in quaternion_texts(tuple(unit))])
    np.testing.assert_allclose(written, unit, atol=1.2e-7)
    assert abs(np.linalg.norm(written) - 1.0) < 6.1e-8
