"""Targets that several motions share are written as all of them need, or not at all."""

import time

import numpy as np
import pytest

from robot_programs.rapid.read import read_rapid
from tests.robot_programs.rapid.samples import POINTS, ROBOT, shifted, source

TOOL = "PERS tooldata tA:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n"
GO = "PROC go(robtarget p,PERS tooldata t)\nMoveL p,v5,fine,t;\nENDPROC\n"
PICK = "PROC go(robtarget p,PERS tooldata t)\nMoveL Offs(p,0,0,50),v5,fine,t;\nMoveL p,v5,fine,t;\nENDPROC\n"


def rewritten(main: str, routine: str, *by_mm: float, declared: str = ""):
    """By how much each motion is moved, why others cannot be, and the text."""
    text = f"MODULE m\n{POINTS}{TOOL}{declared}PROC main()\n{main}\nENDPROC\n{routine}ENDMODULE"
    program = read_rapid([source(text)])
    waypoints = {}
    for i, mm in enumerate(by_mm):
        waypoints |= shifted(program, i, mm=(mm, 0, 0)) if mm else {}
    cannot = program.unwritable(ROBOT, waypoints, tolerance=2e-5)
    kept = {i: path for i, path in waypoints.items() if i not in cannot}
    (again,) = program.rewrite(ROBOT, kept)
    moved = [
        (new.end.T - old.end.T)[0, 3] * 1e3
        for new, old in zip(program.reread((again,)).motions, program.motions, strict=True)
    ]
    return moved, cannot, again.text


TWICE = "PROC go(robtarget p,PERS tooldata t)\nMoveL p,v5,fine,t;\nMoveL p,v5,fine,tool0;\nENDPROC\n"
STATED = "[[{},0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"


@pytest.mark.parametrize(
    ("calls", "routine", "texts"),
    [
        (f"go {STATED.format(40)},tool0;\ngo {STATED.format(50)},tool0;", GO, ["go [[41,0,0],", "go [[52,0,0],"]),
        ("go p1,tool0;\ngo p1,tA;", GO, ["go p1_2,tA;"]),  # a copy where the call is
        ("go p1,tA;", TWICE, ["CONST robtarget p1:=[[11,0,0]", "MoveL p,v5,fine,t;\nMoveL [[12,0,0],[1,0,0,0]"]),
    ],
)
def test_motions_of_calls_get_targets_of_their_own(calls, routine, texts):
    """In the calls, or in the motions of a routine that is called for them alone."""
    moved, cannot, text = rewritten(calls, routine, 1.0, 2.0)
    np.testing.assert_allclose(moved, [1, 2], atol=1e-6)
    assert not cannot
    assert all(one in text for one in texts)


def test_call_with_conflicting_motions_is_refused_with_its_place():
    """One call that stands for motions with different needs, whose text others have, is refused."""
    moved, cannot, _ = rewritten("go p1,tA;\ngo p2,tA;", TWICE, 1.0, 1.0, 2.0, 1.0)
    np.testing.assert_allclose(moved, [0, 1, 0, 1], atol=1e-6)
    assert cannot.keys() == {0, 2}
    assert cannot[0] == "its text in part.mod:13 stands for 2 motions, which need different numbers"


@pytest.mark.parametrize("other", ["", 'TPWrite ""\\Num:=a{2}.trans.x;\n'])
def test_elements_of_an_array_that_a_call_gives(other):
    """They get their numbers in the array, or in the motions where the routine reads them for something else."""
    elements = ",".join(line.split(":=")[1].rstrip(";") for line in POINTS.splitlines()[:2])
    routine = f"PROC go(robtarget a{{*}})\nMoveL Offs(a{{1}},0,0,5),v5,fine,tool0;\nMoveL a{{2}},v5,fine,tool0;\n{other}ENDPROC\n"
    moved, cannot, text = rewritten("go way;", routine, 1.0, 2.0, declared=f"CONST robtarget way{{2}}:=[{elements}];\n")
    np.testing.assert_allclose(moved, [1, 2], atol=1e-6)
    assert not cannot
    assert "MoveL [[11,0,5]," in text
    assert ("MoveL [[22,0,0]," if other else "MoveL a{2},") in text


def test_argument_read_for_something_else_is_not_changed():
    """What the routine reads for something else is not changed."""
    routine = 'PROC go(robtarget p,PERS tooldata t)\nMoveL p,v5,fine,t;\nTPWrite ""\\Num:=p.trans.x;\nENDPROC\n'
    moved, cannot, _ = rewritten("go p1,tool0;\ngo p2,tool0;", routine, 1.0, 2.0)
    np.testing.assert_array_equal(moved, [0, 0])
    assert "read for something else in part.mod:18" in cannot[0]


def test_approach_in_a_variable_and_its_target_state_their_own():
    """Of a routine that is called once, whose parameter the variable is computed of."""
    routine = (
        "PROC go(robtarget p,PERS tooldata t)\nVAR robtarget a;\na:=Offs(p,0,0,80);\nMoveJ a,v5,fine,t;\n"
        "MoveL p,v5,fine,t;\nMoveL a,v5,fine,t;\nENDPROC\n"
    )
    moved, cannot, text = rewritten("go p1,tool0;", routine, 1.1, 1.0, 1.2)
    np.testing.assert_allclose(moved, [1.1, 1.0, 1.2], atol=1e-6)
    assert not cannot
    assert "go p1,tool0;" in text
    assert "a:=Offs(p,0,0,80);" in text


@pytest.mark.parametrize(("approach", "refused"), [(1.01, set()), (1.03, {0, 2})])
def test_approach_follows_its_target_within_the_tolerance(approach, refused):
    """An approach goes with its target if that brings it to where it should be."""
    moved, cannot, _ = rewritten("go p1,tool0;\ngo p2,tool0;", PICK, approach, 1.0, 1.0, 1.0)
    assert cannot.keys() == refused
    np.testing.assert_allclose(moved, [0 if i in refused else 1 for i in range(4)], atol=1e-6)


def test_elements_of_a_loop_are_written_one_by_one():
    """The elements of an array in a loop are written one by one."""
    elements = ",".join(line.split(":=")[1].rstrip(";") for line in POINTS.splitlines()[:3])
    loop = "FOR i FROM 1 TO Dim(a,1) DO MoveL a{i},v5,fine,tool0; ENDFOR"
    moved, cannot, text = rewritten(loop, "", 1.0, 2.0, 3.0, declared=f"CONST robtarget a{{3}}:=[{elements}];\n")
    np.testing.assert_allclose(moved, [1, 2, 3], atol=1e-6)
    assert not cannot
    assert loop in text


@pytest.mark.parametrize(("first", "step", "place"), [(1, 1, "(i-1)*60"), (0, 2, "i*30"), (3, -1, "(3-i)*60")])
def test_targets_of_a_long_loop_stand_in_an_array(first, step, place, monkeypatch):
    """Where it is too long to be written out; by the counters, whatever their first value and step."""
    monkeypatch.setattr("robot_programs.core.written_out.MAX_NEW_LINES", 20)
    rows = [f"MoveL Offs(p1,{place},j*-50,{z}),v5,fine,tool0;" for z in (40, 0)]
    long = [f"h:=h+{k};" for k in range(9)]
    head = ["FOR j FROM 0 TO 1 DO", f"FOR i FROM {first} TO {first + 2 * step} STEP {step} DO"]
    body = "\n".join([*head, *rows, *long, "ENDFOR", "ENDFOR"])
    program = read_rapid([source(f"MODULE m\n{POINTS}PROC main()\nVAR num h;\n{body}\nENDPROC\nENDMODULE")])
    assert program.written_out(range(12)) is None
    again = program.tabled(range(12))
    ends = sorted(tuple((move.end.T[:3, 3] * 1e3).round(6)) for move in again.motions)
    assert ends == sorted((10 + 60 * i, -50 * j, z) for i in range(3) for j in (0, 1) for z in (40, 0))
    assert {*head, *long} <= set(again.sources[0].text.split("\n"))


def test_a_shifted_target_that_stays_keeps_the_one_that_it_shifts():
    loop = "MoveJ p1,v5,fine,tool0;\nFOR i FROM 1 TO 2 DO MoveL Offs(p1,10*i,0,0),v5,fine,tool0; ENDFOR"
    moved, cannot, text = rewritten(loop, "", 1.0)
    np.testing.assert_allclose(moved, [1, 0, 0], atol=1e-6)
    assert not cannot
    assert "MoveJ p1_2,v5" in text


def test_a_target_with_a_motion_beside_it_that_is_written_as_it_is_gets_a_clone():
    body = "MoveL p1,v5,fine,tool0;\nMoveL Offs(p1,0,0,9),v5,fine,tool0;"
    program = read_rapid([source(f"MODULE m\n{POINTS}PROC main()\n{body}\nENDPROC\nENDMODULE")])
    paths = shifted(program, 0) | shifted(program, 1, mm=(0, 0, 0), q=np.radians([10.0, 20, 15, 10, 40, 20]))
    assert not program.unwritable(ROBOT, paths, tolerance=2e-5)
    (again,) = program.rewrite(ROBOT, paths)
    moved = [(a.end.T - b.end.T)[0, 3] for a, b in zip(program.reread((again,)).motions, program.motions, strict=True)]
    np.testing.assert_allclose(moved, [1e-3, 0.0], atol=1e-9)
    assert "Offs(p1,0,0,9)" in again.text


def test_calls_that_give_targets_take_time_by_their_number():
    def seconds(count: int) -> float:
        calls = "go p1,tool0;\n" * count
        program = read_rapid([source(f"MODULE m\n{POINTS}PROC main()\n{calls}ENDPROC\n{GO}ENDMODULE")])
        begin = time.process_time()
        assert len(list(program.visits())) == count
        return time.process_time() - begin

    shortest = max(seconds(300), 4e-3)
    assert any(seconds(2400) < 30 * shortest for _ in range(2))
