"""Variables of KRL that the program sets: a program reads as the same program with the values written out."""

import numpy as np
import pytest

from taskcal.programs.program import Waypoint
from tests.programs.krl.rewriting import Q
from tests.programs.krl.samples import source
from tests.programs.krl.small_programs import FRAMES, POSE, read, texts

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
        (f"P={POSE}\nIF UP THEN\nP.Z=800.0+H\nENDIF\nLIN P", f"LIN {SHIFTED}"),
        (f"P={POSE}\nIF $IN[1] THEN\nP.Z=850\nELSE\nP.Z=850.0\nENDIF\nLIN P", f"LIN {SHIFTED}"),
        ("I=800\nLIN {X 900,Y 0,Z I+50,A 0,B 90,C 0}", f"LIN {SHIFTED}"),
        (f"LIN {POSE}\nHOME=$AXIS_ACT\nPTP HOME\nLIN {SHIFTED}", f"LIN {POSE}\nLIN {SHIFTED}"),
        ("HOME={AXIS: A1 0,A2 -90,A3 90,A4 0,A5 30,A6 0}\nPTP HOME", "PTP {A1 0,A2 -90,A3 90,A4 0,A5 30,A6 0}"),
    ],
)  # fmt: skip
def test_constants_are_followed(body, written_out):
    found, expected = read(DECLARED + FRAMES + body, dat=POINTS), read(FRAMES + written_out)
    assert not texts(found)
    assert len(found.moves) == len(expected.moves)
    for a, b in zip(found.moves, expected.moves, strict=True):
        assert (a.kind, a.follows) == (b.kind, b.follows)
        one, other = (a.end.q, b.end.q) if a.end.T is None else (a.end.T, b.end.T)
        np.testing.assert_allclose(one, other, atol=1e-12)


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        (f"P={POSE}\nP.Z=$ANIN[1]\nLIN P", "P is a variable of the program's own"),
        (f"P={POSE}\nIF $IN[1] THEN\nP.Z=850\nENDIF\nLIN P", "P is a variable of the program's own"),
        (f"P={POSE}\nFOR I=1 TO 3\nP.Z=P.Z+1\nLIN P\nENDFOR", "P is a variable of the program's own"),
        (f"P={POSE}\nAGAIN:\nLIN P\nP.Z=900\nGOTO AGAIN", "P is a variable of the program's own"),
        ("FOR I=1 TO 2\nLIN Q[I]\nENDFOR", "which element of Q is meant is known only at run time"),
        (f"P={POSE}\nMEASURE(P)\nLIN P", "P is a variable of the program's own"),
        (f"P={POSE}\nI=MEASURE(P)\nLIN P", "P is a variable of the program's own"),
        (f"P={POSE}\nIF MEASURE(P) THEN\nENDIF\nLIN P", "P is a variable of the program's own"),
        ("I=2\nQ[$IN[1]]=XP1\nLIN Q[I]", "Q[2] is changed by the program"),
        ("P={X 1,Y 2}\nLIN P", "P is a variable of the program's own"),
        ("I=1.5\nLIN Q[I]", "which element of Q is meant is known only at run time"),
        ("LIN XP1\nXP1.Z=900", "XP1 is changed by the program"),
    ],
)  # fmt: skip
def test_what_is_computed_at_run_time_is_not_taken_for_a_constant(body, reason):
    program = read(DECLARED + FRAMES + body, dat=POINTS)
    assert not program.moves
    assert any(reason in text for text in texts(program))


def test_what_an_interrupt_assigns_is_not_known():
    body = f"{FRAMES}INTERRUPT DECL 4 WHEN $IN[1]==TRUE DO FOUND( )\nXP1={POSE}\nLIN XP1"
    program = read(body, dat=f"DECL E6POS XP1={POSE}", more="DEF FOUND( )\nXP1.Z=0\nEND\n")
    assert not program.moves


def test_tools_and_bases_that_the_program_sets_count():
    """As a widespread postprocessor writes them."""
    body = (
        "BASE_DATA[7] = {FRAME: X 500,Y 0,Z 300,A 0,B 0,C 0}\nTOOL_DATA[7] = {FRAME: X 0,Y 0,Z 100,A 0,B 0,C 0}\n"
        f"BAS(#TOOL,7)\n$BASE = BASE_DATA[7]\nLIN {POSE}"
    )
    (move,) = read(body).moves
    assert (move.tool.name, move.part.name) == ("TOOL_DATA[7]", "BASE_DATA[7]")
    np.testing.assert_allclose(move.tool.T[:3, 3], [0, 0, 0.1])
    np.testing.assert_allclose(move.part.T[:3, 3], [0.5, 0, 0.3])


def test_a_computed_point_is_written_into_the_motion():
    program = read(DECLARED + FRAMES + "P=XP1\nP.Z=P.Z+50\nLIN P C_DIS", dat=POINTS)
    (move,) = program.moves
    T = move.end.T.copy()
    T[0, 3] += 1e-3
    from taskcal.robot.catalogue import load_robot

    after = program.rewrite(load_robot("kuka-kr16-2"), {0: (Waypoint(kind="linear", q=Q, T=T),)})
    assert "LIN {E6POS: X 901.00000,Y 0.00000,Z 850.00000," in after[0].text
    assert after[0].text.count("P=XP1\r\nP.Z=P.Z+50\r\n") == 1
    np.testing.assert_allclose(program.reread(after).moves[0].end.T, T, atol=1e-8)


def test_a_tool_that_another_program_changes_is_taken_as_the_data_list_has_it():
    lines = f"BAS(#TOOL,1)\n$BASE=$NULLFRAME\nLIN {POSE}"
    other = "DEF RESET( )\nINT I\nFOR I=1 TO 16\nTOOL_DATA[I]=$NULLFRAME\nENDFOR\nEND\n"
    program = read(lines, more=other)
    assert len(program.moves) == 1
    assert texts(program) == [
        "part.src:9: TOOL_DATA[1] is changed here, in a program of its own; motions are corrected for the value in the data list"
    ]
    program = read(f"RESET( )\n{lines}", more=other)
    assert not program.moves
    assert any("TOOL_DATA[1] is changed by the program" in text for text in texts(program))


@pytest.mark.parametrize(("sets", "tool"), [("TOOL(0)", "$NULLFRAME"), ("$TOOL=TOOL_DATA[1]", "TOOL_DATA[1]")])
def test_what_initmov_sets_is_read_from_the_file_that_says_it(sets, tool):
    from taskcal.programs.krl.read import read_krl
    from tests.programs.krl.samples import CONFIG_DAT

    part = source("part.src", f"DEF PART( )\nBAS(#INITMOV,0)\nLIN {POSE}\nEND\n")
    config = source("$config.dat", CONFIG_DAT)
    bas = source(
        "bas.src", f"DEF BAS(COMMAND :IN,VALUE :IN)\nEND\nDEF INITMOV( )\nBASE(0)\n{sets}\nEND\nDEF X()\nBASE(3)\nEND\n"
    )
    (move,) = read_krl([part, config, bas]).moves
    assert (move.tool.name, move.part.name) == (tool, "$NULLFRAME")
    assert not read_krl([part, config]).moves
