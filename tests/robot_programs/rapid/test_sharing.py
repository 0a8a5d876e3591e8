"""Targets that several motions share are written as all of them need, or not at all."""

import time

import numpy as np
import pytest

from robot_programs.rapid.read import read_rapid
from tests.robot_programs.rapid.beside import ROBOT, shifted
from tests.robot_programs.rapid.samples import POINTS, source

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


def test_what_each_call_gives_is_written_in_its_declaration():
    moved, cannot, text = rewritten("go p1,tool0;\ngo p2,tool0;", GO, 1.0, 2.0)
    np.testing.assert_allclose(moved, [1, 2], atol=1e-6)
    assert not cannot
    assert "_2" not in text


def test_targets_that_calls_state_are_written_in_the_calls():
    state = "go [[{},0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],tool0;".format
    moved, cannot, text = rewritten(f"{state(40)}\n{state(50)}", GO, 1.0, 2.0)
    np.testing.assert_allclose(moved, [1, 2], atol=1e-6)
    assert not cannot
    assert "go [[41,0,0]," in text
    assert "go [[52,0,0]," in text


def test_calls_with_other_tools_get_a_copy_of_the_target():
    """What calls with other tools need gets a copy where the call is."""
    moved, cannot, text = rewritten("go p1,tool0;\ngo p1,tA;", GO, 1.0, 2.0)
    np.testing.assert_allclose(moved, [1, 2], atol=1e-6)
    assert not cannot
    assert "go p1_2,tA;" in text


def test_call_with_conflicting_motions_is_refused_with_places():
    """One call that stands for motions with different needs is refused with their places."""
    routine = "PROC go(robtarget p,PERS tooldata t)\nMoveL p,v5,fine,t;\nMoveL p,v5,fine,tool0;\nENDPROC\n"
    moved, cannot, _ = rewritten("go p1,tA;", routine, 1.0, 2.0)
    np.testing.assert_array_equal(moved, [0, 0])
    assert cannot.keys() == {0, 1}
    assert "in common with part.mod:16, part.mod:13, part.mod:17, which need other numbers" in cannot[0]


def test_routine_text_with_conflicting_motions_is_refused():
    """A text of the routine that stands for motions with different needs is refused."""
    routine = "PROC go(PERS tooldata t)\nMoveL p1,v5,fine,t;\nENDPROC\n"
    moved, cannot, _ = rewritten("go tool0;\ngo tA;", routine, 1.0, 2.0)
    np.testing.assert_array_equal(moved, [0, 0])
    assert cannot.keys() == {0, 1}
    moved, cannot, _ = rewritten("go tool0;\ngo tA;", routine, 1.0, 1.0)
    np.testing.assert_allclose(moved, [1, 1], atol=1e-6)
    assert not cannot


def test_one_of_them_alone_is_not_changed():
    routine = "PROC go(PERS tooldata t)\nMoveL p1,v5,fine,t;\nENDPROC\n"
    moved, cannot, _ = rewritten("go tool0;\ngo tA;", routine, 1.0, 0.0)
    np.testing.assert_array_equal(moved, [0, 0])
    assert cannot.keys() == {0}


def test_argument_read_for_something_else_is_not_changed():
    """What the routine reads for something else is not changed."""
    routine = 'PROC go(robtarget p,PERS tooldata t)\nMoveL p,v5,fine,t;\nTPWrite ""\\Num:=p.trans.x;\nENDPROC\n'
    moved, cannot, _ = rewritten("go p1,tool0;\ngo p2,tool0;", routine, 1.0, 2.0)
    np.testing.assert_array_equal(moved, [0, 0])
    assert "read for something else in part.mod:18" in cannot[0]


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


def test_a_loop_that_shifts_one_target_is_refused():
    loop = "FOR i FROM 1 TO 3 DO MoveL Offs(p1,10*i,0,0),v5,fine,tool0; ENDFOR"
    moved, cannot, _ = rewritten(loop, "", 1.0, 2.0, 3.0)
    np.testing.assert_array_equal(moved, [0, 0, 0])
    assert cannot.keys() == {0, 1, 2}


def test_what_was_assigned_is_written_where_it_is_used():
    moved, cannot, text = rewritten(
        "VAR robtarget q;\nq:=p1;\nMoveL q,v5,fine,tool0;\nMoveL p1,v5,fine,tool0;", "", 1.0, 2.0
    )
    np.testing.assert_allclose(moved, [1, 2], atol=1e-6)
    assert not cannot
    assert "q:=p1;\nMoveL [[11,0,0]," in text


def test_calls_that_give_targets_take_time_by_their_number():
    def seconds(count: int) -> float:
        calls = "go p1,tool0;\n" * count
        program = read_rapid([source(f"MODULE m\n{POINTS}PROC main()\n{calls}ENDPROC\n{GO}ENDMODULE")])
        begin = time.process_time()
        assert len(list(program.visits())) == count
        return time.process_time() - begin

    shortest = max(seconds(300), 4e-3)
    assert any(seconds(2400) < 30 * shortest for _ in range(2))
