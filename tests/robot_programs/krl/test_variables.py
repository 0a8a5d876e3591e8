"""Variables of KRL that the program sets: a program reads as the same program with the values written out."""

import numpy as np
import pytest

from robot_programs.core.program import Waypoint
from robot_programs.krl.read import read_krl
from tests.robot_programs.krl.samples import CONFIG_DAT, FRAMES, POSE, ROBOT, Q, read, source, texts

DECLARED = "DECL E6POS P\nDECL FRAME F\nINT I\nDECL E6AXIS HOME\n"
SHIFTED = "{X 900,Y 0,Z 850,A 0,B 90,C 0}"
POINTS = f"DECL E6POS XP1={POSE}\nDECL E6POS Q[3]\nQ[1]={POSE}\nQ[2]={SHIFTED}\nREAL H=50.0\nBOOL UP=TRUE"


@pytest.mark.parametrize(
    ("body", "written_out"),
    [
        (f"P={POSE}\nP.Z=P.Z+50\nLIN P", f"LIN {SHIFTED}"),
        ("P=XP1\nP.Z=P.Z+H\nLIN P", f"LIN {SHIFTED}"),
        (f"I=1\nI=I+1\nLIN Q[I]\nLIN {POSE}", f"LIN {SHIFTED}\nLIN {POSE}"),
        (f"F={{X 0,Y 0,Z 50,A 0,B 0,C 0}}\nP=F:{POSE}\nLIN P", f"LIN {SHIFTED}"),
        (f"P={POSE}\nUP=TRUE\nIF UP THEN\nP.Z=800.0+H\nENDIF\nLIN P", f"LIN {SHIFTED}"),
        (f"P={POSE}\nIF $IN[1] THEN\nP.Z=850\nELSE\nP.Z=850.0\nENDIF\nLIN P", f"LIN {SHIFTED}"),
        ("I=800\nLIN {X 900,Y 0,Z I+50,A 0,B 90,C 0}", f"LIN {SHIFTED}"),
        (f"LIN {POSE}\nHOME=$AXIS_ACT\nPTP HOME\nLIN {SHIFTED}", f"LIN {POSE}\nLIN {SHIFTED}"),
        (f"F=INV_POS({{X 0,Y 0,Z 50,A 0,B 0,C 0}})\nP=F:{SHIFTED}\nLIN P", f"LIN {POSE}"),
        (f"P=INV_POS($BASE):{POSE}:INV_POS($TOOL)\n$TOOL=$NULLFRAME\nLIN P", f"$TOOL=$NULLFRAME\nLIN {POSE}:{{Z -100}}"),
        (f"P=inv_pos({POSE}):{POSE}:XP1\nLIN P", f"LIN {POSE}"),
        (f"$BASE=INV_POS({{X 0,Y 0,Z 50,A 0,B 0,C 0}}):$WORLD\nLIN {POSE}", f"$BASE={{X 0,Y 0,Z -50,A 0,B 0,C 0}}\nLIN {POSE}"),
        ("LIN XP1:INV_POS(XP1)", "LIN {X 0,Y 0,Z 0,A 0,B 0,C 0}"),
        (f"LIN {POSE}\nLIN $POS_ACT:{{X 0,Y 0,Z 50,A 0,B 0,C 0}}", f"LIN {POSE}\nLIN {POSE}:{{X 0,Y 0,Z 50}}"),
        (f"BAS(#BASE,1)\nP=INV_POS($BASE):{POSE}\nLIN P", f"BAS(#BASE,1)\nP=INV_POS(BASE_DATA[1]):{POSE}\nLIN P"),
        (f"BAS(#TOOL,1)\n$TOOL=$TOOL:$TOOL\nLIN {POSE}", f"$TOOL=TOOL_DATA[1]:TOOL_DATA[1]\nLIN {POSE}"),
        (f"$BASE.X=5\nLIN {POSE}", f"$BASE={{X 5,Y 0,Z 0,A 0,B 0,C 0}}\nLIN {POSE}"),
        (f"BAS(#BASE,2)\n$BASE.Z=$BASE.Z+10\nLIN {POSE}", f"$BASE={{X 0,Y 0,Z 10,A 0,B 0,C 0}}:BASE_DATA[2]\nLIN {POSE}"),
        ("HOME={AXIS: A1 0,A2 -90,A3 90,A4 0,A5 30,A6 0}\nPTP HOME", "PTP {A1 0,A2 -90,A3 90,A4 0,A5 30,A6 0}"),
    ],
)  # fmt: skip
def test_constants_are_followed(body, written_out):
    found, expected = read(DECLARED + FRAMES + body, dat=POINTS), read(FRAMES + written_out)
    assert not texts(found)
    assert len(found.motions) == len(expected.motions)
    for a, b in zip(found.motions, expected.motions, strict=True):
        assert (a.kind, a.follows) == (b.kind, b.follows)
        one, other = (a.end.q, b.end.q) if a.end.T is None else (a.end.T, b.end.T)
        np.testing.assert_allclose(one, other, atol=1e-12)
        np.testing.assert_allclose(a.part.T, b.part.T, atol=1e-12)
        np.testing.assert_allclose(a.tool.T, b.tool.T, atol=1e-12)


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        (f"P={POSE}\nP.Z=$ANIN[1]\nLIN P", "$ANIN[1] is known only at run time"),
        ("IF $IN[1] THEN\nBAS(#BASE,1)\nENDIF\nP=INV_POS($BASE):XP1\nLIN P", "is set in one branch of the IF before"),
        (f"IF $IN[1] THEN\nBAS(#TOOL,1)\nENDIF\n$TOOL=$TOOL:$TOOL\nLIN {POSE}", "is set in one branch of the IF before"),
        ("P=INV_POS({X 5}):XP1\nLIN P", "Y is not stated"),
        ("LIN MEASURE(XP1)", "what MEASURE() gives is known only at run time"),
        ("LIN SQRT(4)", "what stands for its point is not a position"),
        (f"$BASE=INV_POS(5)\nLIN {POSE}", "what INV_POS is given is not a frame alone"),
        (f"P={POSE}\nIF $IN[1] THEN\nP.Z=850\nENDIF\nLIN P", "P is a variable of the program's own"),
        (f"P={POSE}\nFOR I=1 TO $NUM\nP.Z=P.Z+1\nLIN P\nENDFOR", "P.Z is set further down in the same loop"),
        (f"P={POSE}\nAGAIN:\nLIN P\nP.Z=900\nGOTO AGAIN", "P is a variable of the program's own"),
        ("FOR I=1 TO $NUM\nLIN Q[I]\nENDFOR", "which element of Q is meant is known only at run time"),
        (f"P={POSE}\nMEASURE(P)\nLIN P", "P is a variable of the program's own"),
        (f"P={POSE}\nI=MEASURE(P)\nLIN P", "P is a variable of the program's own"),
        (f"P={POSE}\nIF MEASURE(P) THEN\nENDIF\nLIN P", "P is a variable of the program's own"),
        ("I=2\nQ[$IN[1]]=XP1\nLIN Q[I]", "which element of Q is set before it is known only at run time"),
        ("P={X 1,Y 2}\nLIN P", "P keeps components of before"),
        ("I=1.5\nLIN Q[I]", "which element of Q is meant is known only at run time"),
        ("LIN XP1\nXP1.Z=900", "XP1 is changed by the program"),
    ],
)  # fmt: skip
def test_values_of_the_run_time_are_no_constants(body, reason):
    """What is computed at run time is not taken for a constant."""
    program = read(DECLARED + FRAMES + body, dat=POINTS)
    assert not program.motions
    assert any(reason in text for text in texts(program))


@pytest.mark.parametrize("line", ["MOVES XP1", "MOVES P,XP1[1]", f"MOVES XP1={SHIFTED}"])
def test_what_stands_behind_an_unknown_word_is_not_declared_but_may_be_changed(line):
    program = read(f"{DECLARED}{FRAMES}{line}\nLIN XP1\nLIN Q[1]", dat=POINTS)
    assert len(program.motions) == 1
    unknown, changed = texts(program)
    assert "MOVES is not read" in unknown
    assert f"XP1 is changed by the program, at {unknown.partition(': ')[0]}" in changed


def test_lines_outside_of_any_routine_count_as_run_at_any_time():
    """Their head may be what is damaged."""
    line = f"BAS(#TOOL,1)\n$BASE=$NULLFRAME\nLIN {POSE}"
    assert len(read(line).motions) == 1
    assert not read(line, more="TOOL_DATA[1].X=5\n").motions
    assert not read(f"{FRAMES}LIN XP1", dat=POINTS, more="XP1.X=5\n").motions


def test_tools_and_bases_that_the_program_sets_count():
    """As a widespread postprocessor writes them."""
    body = (
        "BASE_DATA[7] = {FRAME: X 500,Y 0,Z 300,A 0,B 0,C 0}\nTOOL_DATA[7] = {FRAME: X 0,Y 0,Z 100,A 0,B 0,C 0}\n"
        f"BAS(#TOOL,7)\n$BASE = BASE_DATA[7]\nLIN {POSE}"
    )
    (move,) = read(body).motions
    assert (move.tool.name, move.part.name) == ("TOOL_DATA[7]", "BASE_DATA[7]")
    np.testing.assert_allclose(move.tool.T[:3, 3], [0, 0, 0.1])
    np.testing.assert_allclose(move.part.T[:3, 3], [0.5, 0, 0.3])


def test_a_computed_point_is_written_into_the_motion():
    program = read(DECLARED + FRAMES + "P=XP1\nP.Z=P.Z+50\nLIN P C_DIS", dat=POINTS)
    (move,) = program.motions
    T = move.end.T.copy()
    T[0, 3] += 1e-3
    after = program.rewrite(ROBOT, {0: (Waypoint(kind="linear", q=Q, T=T),)})
    assert "LIN {E6POS: X 901.00000,Y 0.00000,Z 850.00000," in after[0].text
    assert after[0].text.count("P=XP1\r\nP.Z=P.Z+50\r\n") == 1
    np.testing.assert_allclose(program.reread(after).motions[0].end.T, T, atol=1e-8)


def test_tool_set_elsewhere_is_that_of_the_data_list():
    """A tool that another program changes is taken as the data list has it."""
    lines = f"BAS(#TOOL,1)\n$BASE=$NULLFRAME\nLIN {POSE}"
    other = "DEF RESET( )\nINT I\nFOR I=1 TO 16\nTOOL_DATA[I]=$NULLFRAME\nENDFOR\nEND\n"
    program = read(lines, more=other)
    assert len(program.motions) == 1
    assert texts(program) == [
        "part.src:9: TOOL_DATA[1] is changed here, in a program of its own; motions are corrected for the value in the data list"
    ]
    (move,) = read(f"RESET( )\n{lines}", more=other).motions
    np.testing.assert_allclose(move.tool.T, np.eye(4))
    program = read(f"RESET( )\n{lines}", more=other.replace("I=1", "I=$ANIN[1]"))
    assert not program.motions
    assert any("TOOL_DATA[1] is changed by the program" in text for text in texts(program))


@pytest.mark.parametrize(("sets", "tool"), [("TOOL(0)", "$NULLFRAME"), ("$TOOL=TOOL_DATA[1]", "TOOL_DATA[1]")])
def test_what_initmov_sets_is_read_from_the_file_that_says_it(sets, tool):
    part = source("part.src", f"DEF PART( )\nBAS(#INITMOV,0)\nLIN {POSE}\nEND\n")
    config = source("$config.dat", CONFIG_DAT)
    bas = source(
        "bas.src", f"DEF BAS(COMMAND :IN,VALUE :IN)\nEND\nDEF INITMOV( )\nBASE(0)\n{sets}\nEND\nDEF X()\nBASE(3)\nEND\n"
    )
    (move,) = read_krl([part, config, bas]).motions
    assert (move.tool.name, move.part.name) == (tool, "$NULLFRAME")
    assert not read_krl([part, config]).motions


def test_own_name_hides_the_data_list_in_its_routine_only():
    """KUKA System Software, validity of variables: a local one hides one of the same name of the data list, where it is valid."""
    above = "DEFFCT FRAME ABOVE(XP1:IN)\nDECL FRAME XP1\nXP1.Z=XP1.Z+50\nRETURN XP1\nENDFCT\n"
    own = "DEF OWN()\nDECL E6POS XP1\nLIN XP1\nEND\nDEF GIVEN(XP1 :OUT)\nXP1={X 0}\nEND\n"
    found = read(FRAMES + "LIN XP1\nOWN()", dat=POINTS, more=above + own)
    assert [move.place.line for move in found.motions] == [4]
    np.testing.assert_allclose(found.motions[0].end.T, read(f"{FRAMES}LIN {POSE}").motions[0].end.T, atol=1e-12)
    assert any("XP1 is a variable of the program's own" in text for text in texts(found))


ABOVE = "DEFFCT E6POS ABOVE(P:IN,D:IN)\nDECL E6POS P\nDECL REAL D\nP.Z=P.Z+D\nRETURN P\nENDFCT\n"
NEXT = "DEFFCT E6POS NEXT( )\nN=N+1\nRETURN Q[1]\nENDFCT\n"


def test_what_a_function_in_a_motion_changes_is_not_lost():
    """Its call would be, if numbers took its place; and what it sets holds behind the motion."""
    program = read(f"{FRAMES}N=1\nLIN NEXT( )\nLIN Q[N]", dat=f"{POINTS}\nINT N=0", more=NEXT)
    (move,) = program.motions
    np.testing.assert_allclose(move.end.T, read(f"{FRAMES}LIN {SHIFTED}").motions[0].end.T, atol=1e-12)
    assert any("LIN stays as it is: its point comes from NEXT, which does more" in text for text in texts(program))


def test_point_changed_by_a_function_is_unknown():
    """What a function changes that is a part of a point is not known."""
    program = read(f"{FRAMES}N=1\nLIN NEXT( ):XP1\nLIN Q[N]", dat=f"{POINTS}\nINT N=0", more=NEXT)
    assert not program.motions


@pytest.mark.parametrize("line", ["WAIT SEC 0.5", "$OUT[1]=TRUE", "LIN XP1", "OTHER( )", "P=BESIDE(P)"])
def test_a_function_that_does_more_than_compute_keeps_its_call(line):
    more = ABOVE.replace("P.Z=P.Z+D", line) + "DEFFCT E6POS BESIDE(P:IN)\nDECL E6POS P\nRETURN P\nENDFCT\n"
    program = read(f"{FRAMES}LIN ABOVE(XP1,50.0)", dat=POINTS, more=more)
    assert all(move.place.line > 5 for move in program.motions)
