"""The flow of KRL: loops, branches, jumps and calls, as KUKA System Software, Operating and Programming Instructions for System
Integrators, describes them (program flow control: FOR, WHILE, REPEAT, LOOP, EXIT, SWITCH, GOTO, RETURN, RESUME)."""

import numpy as np
import pytest

from robot_programs.core.flow import FlowWalk
from robot_programs.core.program import Waypoint
from tests.robot_programs.krl.samples import FRAMES, POSE, ROBOT, Q, read, texts

HIGH = POSE.replace("Z 800", "Z 900")
POINTS = "\n".join(["DECL E6POS Q[4]", *(f"Q[{i}]={POSE.replace('Z 800', f'Z {800 + 10 * i}')}" for i in range(1, 5))])
DECLARED = "DECL E6POS P\nINT I,J\n"


def heights(body: str, dat: str = POINTS, more: str = "") -> list[float]:
    """Heights of all motions, in the order of the text."""
    program = read(DECLARED + FRAMES + body, dat=dat, more=more)
    assert not texts(program)
    return [round(float(move.end.T[2, 3]) * 1e3, 6) for move in program.motions]


@pytest.mark.parametrize(
    ("body", "wanted"),
    [
        ("FOR I=4 TO 1 STEP -2\nLIN Q[I]\nENDFOR", [840, 820]),
        ("FOR I=3 TO 1\nLIN Q[2]\nENDFOR\nLIN Q[I]", [820, 830]),
        ("FOR I=1 TO 4\nLIN Q[I]\nI=I+1\nENDFOR", [810, 830]),
        ("FOR I=1 TO 3\nENDFOR\nFOR I=1 TO 2\nHALT\nLIN Q[I]\nENDFOR\nLIN Q[I]", [810, 820, 830]),
        ("FOR I=1 TO 2\nFOR J=1 TO 2\nLIN Q[2*I-2+J]\nENDFOR\nENDFOR", [810, 820, 830, 840]),
        ("FOR I=1 TO 4\nIF I==3 THEN\nEXIT\nENDIF\nLIN Q[I]\nENDFOR", [810, 820]),
        ("I=1\nREPEAT\nLIN Q[I]\nI=I+1\nUNTIL I>2", [810, 820]),
        ("I=1\nLOOP\nIF I>2 THEN\nEXIT\nENDIF\nLIN Q[I]\nI=I+1\nENDLOOP\nLIN Q[I]", [810, 820, 830]),
        ("I=2\nSWITCH I\nCASE 1\nLIN Q[1]\nCASE 2,3\nLIN Q[2]\nDEFAULT\nLIN Q[3]\nENDSWITCH", [810, 820, 830]),
        ("I=1\nGOTO ON\nAGAIN:\nI=I+1\nON:\nLIN Q[I]\nIF I<3 THEN\nGOTO AGAIN\nENDIF", [810, 820, 830]),
        (f"P={POSE}\nIF $IN[1] THEN\nGOTO ON\nENDIF\nHALT\nON:\nLIN P", [800]),
        (f"P={POSE}\nAGAIN:\nLIN P\nIF $IN[1] THEN\nGOTO AGAIN\nENDIF", [800]),
        (f"P={POSE}\nWHILE $IN[1]\nLIN P\nP={POSE}\nENDWHILE", [800]),
        (f"P={POSE}\nLOOP\nLIN P\nWAIT SEC 1\nENDLOOP", [800]),
        (f"P={POSE}\nGOTO OVER\nP.Z=0\nOVER:\nLIN P", [800]),
    ],
)
def test_motions_go_where_the_flow_leads(body, wanted):
    """Motions go where the lines before lead."""
    assert heights(body) == wanted  # what is never taken is read, too


@pytest.mark.parametrize(
    "body",
    [
        "FOR I=1 TO $NUM\nLIN Q[I]\nENDFOR",
        "I=1\nREPEAT\nLIN Q[I]\nI=I+1\nUNTIL $IN[1]",
        "I=1\nLOOP\nLIN Q[I]\nI=I+1\nIF $IN[1] THEN\nEXIT\nENDIF\nENDLOOP",
        "I=1\nAGAIN:\nLIN Q[I]\nI=I+1\nIF $IN[1] THEN\nGOTO AGAIN\nENDIF",
        "FOR I=1 TO 3\nIF $IN[1] THEN\nI=J\nENDIF\nLIN Q[I]\nENDFOR",
        "I=1\nFOR J=1 TO 2\nLIN Q[I]\nIF $IN[1] THEN\nI=2\nENDIF\nENDFOR",
        "I=1\nIF UP THEN\nI=2\nENDIF\nLIN Q[I]",
        "FOR I=1 TO COUNT\nLIN Q[I]\nENDFOR",
        "I=1\nIF Q[1].Z>5 THEN\nI=2\nENDIF\nLIN Q[I]",
        "P=Q[1]\nI=1\nIF P.Z>5 THEN\nI=2\nENDIF\nLIN Q[I]",
        "J=COUNT\nFOR I=1 TO J\nLIN Q[I]\nENDFOR",
        "J=COUNT+1\nI=J\nJ=1\nIF I==3 THEN\nJ=2\nENDIF\nLIN Q[J]",
        f"P={POSE}\nP.X=COUNT\nI=1\nIF P.Z>5 THEN\nI=2\nENDIF\nLIN Q[I]",
        "SWITCH $ANIN[1]\nCASE 1\nI=1\nDEFAULT\nI=2\nENDSWITCH\nLIN Q[I]",
        "I=1\nIF $IN[1] THEN\nI=2\nENDLOOP\nENDIF\nLIN Q[I]",
    ],
)
def test_motion_known_on_some_ways_only_is_left(body):
    """What is known on some ways only is left."""
    program = read(
        DECLARED + FRAMES + body, dat=f"{POINTS}\nDECL BOOL UP=TRUE\nDECL INT COUNT=2"
    )  # set by hand as well
    assert not program.motions
    assert any("LIN stays as it is: " in text for text in texts(program))


def test_copy_of_a_data_list_number_decides_nothing():
    """A copy of a number that may be set by hand decides nothing either."""
    dat = f"{POINTS}\nDECL INT COUNT=2"
    given = "DEF GO(N :IN)\nINT N\nIF N==2 THEN\nLIN Q[2]\nELSE\nLIN Q[1]\nENDIF\nEND\n"
    returned = "DEFFCT INT MANY( )\nRETURN COUNT\nENDFCT\n"
    back = "DEF SET(N :OUT)\nINT N\nN=COUNT\nEND\n"
    branch = "IF I==2 THEN\nLIN Q[2]\nELSE\nLIN Q[1]\nENDIF"
    for body, more in (("I=COUNT\nGO(I)", given), (f"I=MANY()\n{branch}", returned), (f"SET(I)\n{branch}", back)):
        assert sorted(heights(body, dat, more)) == [810, 820]  # both ways
    assert heights("I=COUNT\nLIN Q[I]", dat) == [820]
    assert heights("I=COUNT\nI=3\nIF I==3 THEN\nLIN Q[3]\nENDIF", dat) == [830]


def test_blocks_that_do_not_match_are_named():
    program = read(f"{FRAMES}IF $IN[1] THEN\nLIN {POSE}\nENDFOR\nLIN {POSE}")
    assert any("part.src:6: ENDFOR does not match the blocks of PART" in text for text in texts(program))
    assert not program.motions


@pytest.mark.parametrize(
    "lines", [f"LOOP\nLIN {POSE}\nENDLOOP", f"REPEAT\nLIN {POSE}\nUNTIL FALSE", f"WHILE I<2\nLIN {POSE}\nENDWHILE"]
)
def test_turns_that_leave_all_as_it_was_are_not_taken_again(monkeypatch, lines):
    """A loop that never ends is gone through a few times."""
    taken, turn = [], FlowWalk.turn
    monkeypatch.setattr(FlowWalk, "turn", lambda self, *given: taken.append(given) or turn(self, *given))
    assert len(read(f"{DECLARED}{FRAMES}I=1\n{lines}").motions) == 1
    assert len(taken) < 9


def test_unreached_motions_are_read_with_their_own_settings():
    """Palletizing programs teach their points behind a GOTO to the end."""
    body = f"{FRAMES}GOTO FINAL\nBAS(#TOOL,1)\nBAS(#BASE,2)\n$IPO_MODE=#BASE\nPTP {POSE}\nFINAL:\nPTP {POSE}"
    assert [(move.tool.name, move.part.name) for move in read(body).motions] == [
        ("TOOL_DATA[1]", "BASE_DATA[2]"), ("$TOOL", "$NULLFRAME")
    ]  # fmt: skip
    (diagnostic,) = texts(read(f"{FRAMES}RETURN\nLIN {POSE}"))
    assert "nothing leads to it" in diagnostic


def test_variables_that_a_call_hands_over_come_back():
    shift = "DEF SHIFT(P,D :IN)\nDECL E6POS P\nREAL D\nP.Z=P.Z+D\nEND\n"
    assert heights(f"P={POSE}\nSHIFT(P,25)\nLIN P\nSHIFT(P,25)\nLIN P", more=shift) == [825, 850]
    both = "DEF SHIFT(P,D :IN)\nDECL E6POS P\nREAL D\nP.Z=P.Z+D\nXG.Z=0\nEND\n"
    program = read(f"{FRAMES}XG={POSE}\nSHIFT(XG,25)\nLIN XG", dat=f"DECL GLOBAL E6POS XG={POSE}", more=both)
    assert not program.motions


def test_resuming_interrupt_may_leave_a_call():
    """Behind an interrupt that resumes a call may have been left."""
    search = f"DEF SEARCH( )\nLIN {HIGH}\n$BASE=BASE_DATA[1]\nEND\nDEF FOUND( )\nBRAKE\nRESUME\nEND\n"
    body = f"INTERRUPT DECL 5 WHEN $IN[1] DO FOUND( )\n{FRAMES}INTERRUPT ON 5\nSEARCH( )\nLIN {POSE}"
    program = read(body, more=search)
    assert [move.routine for move in program.motions] == ["SEARCH"]
    assert "an interrupt may resume behind it" in texts(program)[0]
    assert len(read(body, more=search.replace("RESUME", "HALT")).motions) == 2


@pytest.mark.parametrize("seed", range(40))
def test_call_that_may_be_left_anywhere_leaves_what_holds_in_all(seed):
    """Random routines, each line of which may be its last: what is known behind is what all of these leave, where it is on."""
    rng = np.random.default_rng(seed)
    choices = [f"$BASE={{X {k},Y 0,Z 0,A 0,B 0,C 0}}" for k in (1, 1, 2)] + ["H=1", "H=2", "IN_IT( )", f"LIN {POSE}"]
    lines, inner = ([choices[k] for k in rng.integers(0, n, size=4)] for n in (7, 5))
    on = bool(rng.integers(2))
    flat = [own for line in lines for own in (inner if line == "IN_IT( )" else [line])]
    states, state = {("1", "1")}, ("1", "1")  # base and H, as left before or behind each line
    for line in flat:
        state = (line[9] if line.startswith("$") else state[0], line[2] if line.startswith("H") else state[1])
        states.add(state)
    states = states if on else {state}
    more = "DEF SEARCH( )\n{}\nEND\nDEF IN_IT( )\n{}\nEND\nDEF FOUND( )\nBRAKE\nRESUME\nEND\n"
    body = (
        f"INTERRUPT DECL 5 WHEN $IN[1] DO FOUND( )\n{FRAMES}H=1\n$BASE={{X 1,Y 0,Z 0,A 0,B 0,C 0}}\n"
        f"INTERRUPT O{'N' if on else 'FF'} 5\nSEARCH( )\nLIN {{X 900,Y 0,Z H,A 0,B 90,C 0}}"
    )
    program = read(body, more=more.format("\n".join(lines), "\n".join(inner)))
    found = [move for move in program.motions if move.routine == "PART"]
    assert len(found) == (len(states) == 1)
    for move in found:
        ((base, height),) = states
        assert (round(move.part.T[0, 3] * 1e3), round(move.end.T[2, 3] * 1e3)) == (int(base), int(height))


@pytest.mark.parametrize(
    ("one", "other", "known"),
    [("H", "900", 1), ("900", "H", 1), ("H", "H", 1), ("900", "900.0", 2), ("H", "901", 0), ("900", "901", 0)],
)
def test_value_that_both_branches_give_is_known(one, other, known):
    """A copy of a data list's number is that number; and it decides no way."""
    line = "LIN {X 900,Y 0,Z N,A 0,B 90,C 0}"
    body = (
        f"{FRAMES}IF $IN[1] THEN\nN={one}\nELSE\nN={other}\nENDIF\n{line}\nIF N>5 THEN\n$BASE=$ROBROOT\nENDIF\n{line}"
    )
    program = read(f"DECL REAL N\n{body}", dat="DECL CONST INT H=900")
    assert [move.end.T[2, 3] for move in program.motions] == [0.9] * known


def test_known_index_changes_one_element():
    """A computed index that is known changes that element alone."""
    body = "INT N\nN=10\nTOOL_DATA[N]={X 0,Y 0,Z 50,A 0,B 0,C 0}\nBAS(#TOOL,1)\n$BASE=$NULLFRAME\nLIN " + POSE
    (move,) = read(body).motions
    assert move.tool.name == "TOOL_DATA[1]"
    program = read(body.replace("N=10", "N=$ANIN[1]"))
    assert not program.motions


def test_robot_position_is_known_after_a_known_motion():
    """Where the robot is counts where the motion before says it."""
    body = f"LIN {HIGH}\nP=$POS_ACT\nP.Z=P.Z-50\nLIN P\nP=$POS_ACT:{{X 0,Y 0,Z 10,A 0,B 0,C 0}}\nLIN P\nPTP $POS_ACT"
    assert heights(body) == [900, 850, 850]
    program = read(f"{DECLARED}{FRAMES}P=$POS_ACT\nP.Z=P.Z-50\nLIN P")
    assert not program.motions
    program = read(f"{DECLARED}{FRAMES}LIN {HIGH}\n$BASE=BASE_DATA[1]\nP=$POS_ACT\nP.Z=P.Z-50\nLIN P")
    assert len(program.motions) == 1


def test_point_from_the_robot_position_is_written_whole():
    """What counts from the place of the robot is written whole where that moves."""
    program = read(f"{DECLARED}{FRAMES}LIN {HIGH}\nP=$POS_ACT\nP.Z=P.Z-50\nLIN P")
    T = program.motions[0].end.T.copy()
    T[2, 3] += 1e-3
    again = program.reread(program.rewrite(ROBOT, {0: (Waypoint(kind="linear", q=Q, T=T),)}))
    np.testing.assert_allclose([move.end.T[2, 3] for move in again.motions], [0.901, 0.85], atol=1e-9)
