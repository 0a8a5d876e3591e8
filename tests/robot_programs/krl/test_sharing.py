"""Texts that stand for several motions: rewritten where all of them can be, left where not."""

import re

import numpy as np
import pytest

from robot_programs.core.program import Waypoint
from robot_programs.krl.read import KrlProgram
from taskcal.errors import TaskcalError
from tests.robot_programs.krl.samples import FRAMES, POSE, ROBOT, Q, read

DECLARED = "DECL E6POS P\nINT I\n"
POINTS = "\n".join(["DECL E6POS Q[3]", *(f"Q[{i}]={POSE.replace('Z 800', f'Z {800 + i}')}" for i in (1, 2, 3))])


def moved(program: KrlProgram, *by: float) -> dict[int, tuple[Waypoint, ...]]:
    """Waypoints of the first motions, shifted along z, metres."""
    out: dict[int, tuple[Waypoint, ...]] = {}
    for i, dz in enumerate(by):
        T = program.motions[i].end.T.copy()
        T[2, 3] += dz
        out[i] = (Waypoint(kind=program.motions[i].kind, q=Q, T=T),)
    return out


def test_elements_get_their_numbers_in_the_data_list():
    program = read(f"{DECLARED}{FRAMES}FOR I=1 TO 3\nLIN Q[I]\nENDFOR", dat=POINTS)
    waypoints = moved(program, 1e-3, 2e-3, 3e-3)
    assert not program.unwritable(ROBOT, waypoints, 0.0)
    after = program.rewrite(ROBOT, waypoints)
    assert after[0].text == program.sources[0].text
    again = program.reread(after)
    np.testing.assert_allclose([m.end.T[2, 3] for m in again.motions], [0.802, 0.804, 0.806], atol=1e-9)


@pytest.mark.parametrize(
    ("lines", "why"),
    [
        ("FOR I=1 TO 3\nLIN Q[I]\nENDFOR\nP=Q[1]\nLIN P", "and the numbers in part.dat:3 have to stay for part.src:9"),
        (
            "FOR I=1 TO 3\nLIN Q[I]\nENDFOR\n$BASE=BASE_DATA[1]\nFOR I=1 TO 3\nLIN Q[I]\nENDFOR",
            "and the numbers in part.dat:3 have to stay for part.src:11",
        ),
    ],
)  # fmt: skip
def test_what_would_move_others_is_left_and_says_why(lines, why):
    program = read(f"{DECLARED}{FRAMES}{lines}", dat=POINTS)
    waypoints = moved(program, 1e-3, 2e-3, 3e-3)
    cannot = program.unwritable(ROBOT, waypoints, 0.0)
    assert set(cannot) == {0, 1, 2}
    assert why in cannot[0]
    with pytest.raises(TaskcalError, match=rf"part\.src:\d+: {re.escape(cannot[0])}"):
        program.rewrite(ROBOT, waypoints)


def test_shared_text_is_not_divided():
    """A motion of several is not divided and keeps those that count from others."""
    program = read(f"{DECLARED}{FRAMES}FOR I=1 TO 2\nLIN Q[I]\nLIN_REL {{Z 5}}\nENDFOR", dat=POINTS)
    waypoints = moved(program, 1e-3)
    assert "counts from where it ends" in program.unwritable(ROBOT, waypoints, 0.0)[0]
    program = read(f"{DECLARED}{FRAMES}FOR I=1 TO 2\nLIN Q[I]\nENDFOR", dat=POINTS)
    (path,) = moved(program, 1e-3).values()
    assert "none gets points of its own" in program.unwritable(ROBOT, {0: path * 2}, 0.0)[0]


def test_own_text_follows_shared_elements():
    """A text of its own goes with the elements that others share, as long as it needs the same."""
    body = f"{DECLARED}{FRAMES}LIN Q[2]\nFOR I=1 TO 3\nLIN Q[I]\nENDFOR"
    program = read(body, dat=POINTS)
    waypoints = moved(program, 2e-3, 1e-3, 2e-3, 3e-3)
    again = program.reread(program.rewrite(ROBOT, waypoints))
    np.testing.assert_allclose([m.end.T[2, 3] for m in again.motions], [0.804, 0.802, 0.804, 0.806], atol=1e-9)
    assert again.sources[0].text == program.sources[0].text
    waypoints = moved(program, 1e-3, 1e-3, 2e-3, 3e-3)
    assert not program.unwritable(ROBOT, waypoints, 0.0)
    again = program.reread(program.rewrite(ROBOT, waypoints))
    np.testing.assert_allclose([m.end.T[2, 3] for m in again.motions], [0.803, 0.802, 0.804, 0.806], atol=1e-9)
    assert "LIN {" in again.sources[0].text


# Turns of a loop that are written out, or get an array.


def ends(body: str, **more: str) -> list[tuple[float, ...]]:
    """Places to which a body leads, millimetres."""
    program = read(f"DECL INT I,J,H\n{FRAMES}{body}", **more)
    assert not program.diagnostics
    return places(program)


def places(program: KrlProgram) -> list[tuple[float, ...]]:
    return sorted(tuple((move.end.T[:3, 3] * 1e3).round(6).tolist()) for move in program.motions)


BOX = "LIN XP1:{{X {},Y {},Z -40,A 0,B 0,C 0}}\n"
AT = "LIN XP1:{{X {},Y {},Z 0,A 0,B 0,C 0}}\n"
POINT = f"DECL FRAME XP1={POSE}"


ROWS = f"FOR J=0 TO 1 ; rows\nFOR I=0 TO 4 STEP 2\n{BOX}{AT}ENDFOR\nENDFOR"
JUMPS = f"BOX:\n{BOX}IF $IN[1] THEN\nGOTO BOX\nENDIF\n{AT}IF $IN[2] THEN\nGOTO READY\nENDIF\n"
JUMPS = f"FOR J=0 TO 3\nFOR I=0 TO 2\n{JUMPS}ENDFOR\nJ=J+1\nENDFOR\nREADY:"


@pytest.mark.parametrize(
    ("loop", "cells"),
    [
        (ROWS, [(i * 20, -50 * j) for j in (0, 1) for i in (0, 2, 4)]),
        (JUMPS, [(i * 20, -50 * j) for j in (0, 2) for i in (0, 1, 2)]),
    ],
)
def test_turns_of_loops_in_each_other_are_written_one_by_one(loop, cells):
    """With another step, and with jumps inside a turn and out of the loop that only inputs decide."""
    program = read(f"DECL INT I,J\n{FRAMES}{loop.format(*('I*20', 'J*-50') * 2)}", dat=POINT)
    again = program.reread(program.written_out(range(len(program.motions))))
    assert {move.texts_motions for move in again.motions} == {1}
    assert places(again) == ends("".join(line.format(*cell) for cell in cells for line in (BOX, AT)), dat=POINT)


@pytest.mark.parametrize(
    ("turns", "listed"), [((1, 1, "(I-1)*60"), True), ((3, -1, "(3-I)*60"), True), ((2, 2, "I*30-60"), False)]
)
def test_targets_of_a_long_loop_stand_in_an_array(turns, listed, monkeypatch):
    """In the data list of the module, or in the routine where that is not given."""
    first, step, place = turns
    monkeypatch.setattr("robot_programs.core.written_out.MAX_NEW_LINES", 30)
    long = "".join(f"H=H+{k}\n" for k in range(9))
    head = f"DECL INT I,J,H\n{FRAMES}H=0\nFOR J=0 TO 1\nFOR I={first} TO {first + 2 * step} STEP {step}\n"
    row = f"{BOX}{AT}".format(*(place, "J*-50") * 2)
    data = {"dat": POINT} if listed else {"config": f"DEFDAT $CONFIG\n{POINT}\nENDDAT\n"}
    program = read(f"{head}{row}{long}ENDFOR\nENDFOR", **data)
    numbers = range(len(program.motions))
    assert program.written_out(numbers) is None
    found = program.tabled(numbers)
    assert ["DECL E6POS TASKCAL_TARGETS[" in one.text for one in found.sources[:2]] == [not listed, listed]
    expected = ends(
        "".join(line.format(60 * i, -50 * j) for j in (0, 1) for i in range(3) for line in (BOX, AT)), **data
    )
    assert places(found) == expected
    assert set(long.split("\n")) <= set(found.sources[0].text.split("\r\n"))


@pytest.mark.parametrize(
    "turn",
    [
        "PTP XP1:{X I*60,Y 0,Z 0,A 0,B 0,C 0}",  # without status and turn, which an element would have
        "I=I+1\nLIN XP1:{X I*60,Y 0,Z 0,A 0,B 0,C 0}\nI=I-1",
        "LIN XP1:{X I*60,Y 0,Z 0,A 0,B 0,C 0}\nIF I==2 THEN\nI=4\nENDIF",
        "FOR J=1 TO I\nLIN XP1:{X J*60,Y I*20,Z 0,A 0,B 0,C 0}\nENDFOR",
        "LIN XP1:{X I*60,Y 0,Z 0,A 0,B 0,C 0}\nLIN XP1:{X $ANIN[1],Y 0,Z 0,A 0,B 0,C 0}",  # of one path
    ],
)
def test_target_that_the_counters_do_not_tell_gets_no_array(turn):
    program = read(f"DECL INT I,J\n{FRAMES}FOR I=1 TO 5\n{turn}\nENDFOR", dat=POINT)
    assert len(program.motions) > 1
    assert program.tabled(range(len(program.motions))) is None


def test_loop_that_is_left_at_a_known_turn_has_an_array():
    turn = "LIN XP1:{X I*30,Y 0,Z 0,A 0,B 0,C 0}\nH=H+1\nIF H>=5 THEN\nGOTO READY\nENDIF"
    program = read(f"DECL INT I,H\n{FRAMES}H=0\nFOR I=1 TO 9\n{turn}\nENDFOR\nREADY:", dat=POINT)
    assert program.written_out(range(5)) is None
    found = program.tabled(range(5))
    assert "TASKCAL_TARGETS[5]" in found.sources[1].text
    assert places(program) == places(found)
    assert len(program.motions) == 5
