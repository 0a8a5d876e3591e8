"""Calls of KRL routines: a call leaves what the routine's lines would leave in its place."""

import numpy as np
import pytest

from robot_programs.krl.read import read_krl
from tests.robot_programs.krl.samples import source
from tests.robot_programs.krl.small_programs import FRAMES, POSE, read, texts

SETTINGS = """\
DEF SETTINGS (NBASE :IN,NTOOL :IN,SPEED :IN)
INT NBASE,NTOOL
REAL SPEED
FDAT_ACT=FDEFAULT
FDAT_ACT.BASE_NO=NBASE
FDAT_ACT.TOOL_NO=NTOOL
BAS(#FRAMES)
$VEL.CP=SPEED/1000.0
IF NBASE==0 THEN
$BASE=$NULLFRAME
ENDIF
END
"""
DEFAULT = "DECL FDAT FDEFAULT={TOOL_NO 0,BASE_NO 0,IPO_FRAME #BASE}"
HIGH = POSE.replace("Z 800", "Z 900")


def test_a_routine_sets_what_its_parameters_say():
    body = f"INT N\nN=1\nSETTINGS(N+1,1,50.5)\nLIN {POSE}\nSETTINGS(0,2,200.5)\nLIN {POSE}"
    program = read(body, dat=DEFAULT.replace("DECL", "DECL GLOBAL"), more=SETTINGS)
    assert not texts(program)
    assert [(m.tool.name, m.part.name, m.speed) for m in program.motions] == [
        ("TOOL_DATA[1]", "BASE_DATA[2]", 0.0505),
        ("TOOL_DATA[2]", "$NULLFRAME", 0.2005),
    ]


def test_motions_are_followed_into_routines_and_out_of_them():
    more = f"DEF FIRST( )\nLIN {POSE}\nSECOND( )\nLIN {POSE}\nEND\nDEF SECOND( )\nLIN {HIGH}\nEND\nDEF IDLE( )\nWAIT SEC 1\nEND\n"
    program = read(f"{FRAMES}PTP {POSE}\nFIRST( )\nIDLE( )\nLIN {HIGH}", more=more)
    home, last, first, behind, second = range(5)
    assert [move.follows for move in program.motions] == [None, behind, home, second, first]
    assert not texts(program)
    assert last == 1


def test_variable_given_by_value_in_a_condition_stays_known():
    more = "DEFFCT BOOL NEAR(P :IN)\nDECL E6POS P\nRETURN $IN[1]\nENDFCT\n"
    body = f"DECL E6POS P\n{FRAMES}P={POSE}\nIF NEAR(P) THEN\nHALT\nENDIF\nLIN P"
    assert len(read(body, more=more).motions) == 1
    assert not read(body, more=more.replace(" :IN", "")).motions


def test_relative_point_counts_across_calls():
    """A point that counts from the motion before counts across calls."""
    program = read(f"{FRAMES}LIN {POSE}\nUP( )\nLIN {{Z 850}}", more="DEF UP( )\nLIN_REL {Z 100}\nEND\n")
    assert [round(float(move.end.T[2, 3]), 9) for move in program.motions] == [0.8, 0.85, 0.9]
    assert [move.follows for move in program.motions] == [None, 2, 0]


def test_call_with_other_arguments_is_another_motion():
    """A text stands for a motion of each call that gives it something else."""
    routine = "DEF TO(P :IN)\nDECL E6POS P\nLIN P\nEND\n"
    points = f"DECL E6POS XP1={POSE}\nDECL E6POS XP2={HIGH}"
    program = read(f"{FRAMES}TO(XP1)\nTO(XP1)", dat=points, more=routine)
    (move,) = program.motions
    np.testing.assert_allclose(move.end.T[:3, 3], [0.9, 0, 0.8])
    assert move.follows is None
    program = read(f"{FRAMES}TO(XP1)\nTO(XP2)", dat=points, more=routine)
    assert [round(float(move.end.T[2, 3]), 9) for move in program.motions] == [0.8, 0.9]
    assert [(move.follows, move.texts_motions, move.divisible) for move in program.motions] == [
        (None, 2, False),
        (0, 2, False),
    ]


@pytest.mark.parametrize(("mode", "known"), [("IN", True), ("OUT", False), ("", False)])
def test_what_is_given_by_value_stays(mode, known):
    routine = f"DEF TAKE(P{' :' + mode if mode else ''})\nDECL E6POS P\nP.Z=0\nEND\n"
    program = read(f"{FRAMES}TAKE(XP1)\nLIN XP1", dat=f"DECL E6POS XP1={POSE}", more=routine)
    assert len(program.motions) == known


def test_a_routine_that_calls_itself_ends():
    program = read(
        f"{FRAMES}AGAIN(3)\nLIN {POSE}",
        more=f"DEF AGAIN(N :IN)\nINT N\n$BASE=BASE_DATA[1]\nLIN {POSE}\nAGAIN(N-1)\nAGAIN(N-2)\nEND\n",
    )
    assert not program.motions
    assert [text.partition(": ")[2] for text in texts(program)] == [
        "LIN stays as it is: AGAIN sets it",
        "LIN stays as it is: AGAIN is called where that is not followed",
    ]  # fmt: skip


def test_what_holds_at_a_return_counts():
    routine = "DEF MAYBE( )\nIF $IN[1] THEN\nRETURN\nENDIF\n$BASE=BASE_DATA[1]\nEND\n"
    program = read(f"{FRAMES}MAYBE( )\nLIN {POSE}", more=routine)
    assert not program.motions
    assert "it differs between the ends of MAYBE" in texts(program)[0]


def test_functions_in_expressions_count_as_calls():
    function = f"DEFFCT BOOL LIFT( )\nLIN {HIGH}\n$BASE=BASE_DATA[1]\nRETURN TRUE\nENDFCT\n"
    program = read(f"{FRAMES}BOOL OK\nLIN {POSE}\nOK=LIFT( )\nLIN {POSE}", more=function)
    assert [(m.routine, m.follows, m.part.name) for m in program.motions] == [
        ("PART", None, "$NULLFRAME"), ("PART", 2, "BASE_DATA[1]"), ("LIFT", 0, "$NULLFRAME")
    ]  # fmt: skip
    program = read(f"{FRAMES}BOOL OK\nLIN {POSE}\nOK=NOT LIFT( )\nLIN {POSE}", more=function)
    assert len(program.motions) == 1
    assert any("LIFT sets it" in text for text in texts(program))


# Routines and those that call them.


def test_frames_pass_from_a_caller_to_what_it_calls():
    more = f"DEF SUB( )\nLIN {POSE}\nEND\n"
    program = read(f"{FRAMES}SUB( )\nLIN {POSE}", more=more)
    assert [(m.routine, m.follows) for m in program.motions] == [("PART", 1), ("SUB", None)]
    program = read(f"SUB( )\n{FRAMES}SUB( )", more=more)
    assert not program.motions
    assert "$TOOL is not set before it" in texts(program)[0]
    program = read(f"{FRAMES}SUB( )\nLIN {POSE}", more="DEF SUB( )\n$BASE=BASE_DATA[1]\nEND\n")
    assert [m.part.name for m in program.motions] == ["BASE_DATA[1]"]
    program = read(f"{FRAMES}LIN {POSE}\nSUB( )", more=f"DEF SUB( )\nLIN {POSE}\nSUB( )\nEND\n")
    assert "SUB is called where that is not followed" in texts(program)[0]


def test_routines_of_one_name_in_two_files_count_as_one():
    one, two = (
        source(f"{name}.src", f"DEF {name}( )\n{FRAMES}SUB( )\nLIN {POSE}\nEND\nDEF SUB( )\n{line}\nEND\n")
        for name, line in (("one", "HALT"), ("two", "$BASE=$NULLFRAME"))
    )
    assert [m.routine for m in read_krl([one]).motions] == ["ONE"]
    assert not read_krl([one, two]).motions
