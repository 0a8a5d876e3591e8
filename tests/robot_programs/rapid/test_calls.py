"""What routines are given, and what comes of their motions."""

import pytest

from robot_programs.rapid.read import read_rapid
from tests.robot_programs.rapid.diagnosed import reasons
from tests.robot_programs.rapid.samples import POINTS, source

ROUTINE = "PROC go(robtarget p)\nMoveL p,v5,fine,tool0;\nENDPROC\n"


def program(main: str, routines: str = ROUTINE):
    return read_rapid([source(f"MODULE m\n{POINTS}PROC main()\n{main}\nENDPROC\n{routines}ENDMODULE")])


def ends(read) -> list[float]:
    return [round(move.end.T[0, 3] * 1e3, 3) for move in read.motions]


def test_a_motion_goes_to_what_each_call_gives():
    read = program("go p1;\ngo Offs(p2,1,0,0);\ngo [[7,0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];")
    assert ends(read) == [10, 21, 7]
    assert [move.end.name for move in read.motions] == ["p1", "", ""]
    assert [move.follows for move in read.motions] == [None, 0, 1]
    assert [move.texts_motions for move in read.motions] == [3, 3, 3]
    assert not any(move.divisible for move in read.motions)
    assert not read.diagnostics


def test_each_call_has_a_motion_before_its_own():
    read = program("MoveL p3,v5,fine,tool0;\ngo p1;\nMoveL p3,v5,fine,tool0;\ngo p1;")
    assert [(move.end.name, move.follows, move.texts_motions) for move in read.motions] == [
        ("p3", None, 1), ("p3", 2, 1), ("p1", 0, 2), ("p1", 1, 2),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("routines", "x"),
    [
        ("PROC go(robtarget p)\nshift p,5;\nENDPROC\nPROC shift(robtarget q,num n)\nMoveL Offs(q,n,0,0),v5,z1,tool0;ENDPROC\n", 15),
        ("PROC go(robtarget p)\np.trans.x:=p.trans.x+1;\nMoveL p,v5,fine,tool0;\nENDPROC\n", 11),
        ("PROC go(robtarget p)\nVAR num n:=3;\nMoveL Offs(p,n,0,0),v5,fine,tool0;\nn:=4;\nENDPROC\n", 13),
        ("PROC go(robtarget p,\\num by)\nMoveL p,v5,fine,tool0;\nENDPROC\n", 10),
    ],
)  # fmt: skip
def test_parameters_are_followed_into_and_through_routines(routines, x):
    read = program("go p1;\ngo p1;", routines)
    assert set(ends(read)) == {x}
    assert not read.diagnostics


def test_what_is_given_in_some_calls_only_is_said():
    read = program("go p1;\ngo CRobT();")
    assert ends(read) == [10]
    assert reasons(read) == ["part.mod:16: MoveL stays as it is in some calls: 'p' is a parameter of the routine 'go'"]


def test_routine_with_unknown_calls_is_not_divided():
    """No motion is put into a routine of which some calls are not understood."""
    read = program("go p1;\ngo CRobT();")
    assert [(move.texts_motions, move.divisible) for move in read.motions] == [(2, False)]


def test_own_target_stays_if_a_call_has_an_unknown_tool():
    """Its own target stays where some call gives an unknown tool."""
    routine = "PROC go(PERS tooldata t)\nMoveL p1,v5,fine,t;\nENDPROC\n"
    read = program("go tool0;\ngo tUnknown;", routine)
    assert not read.motions
    assert "'t' is a parameter" in reasons(read)[0]


def test_a_routine_that_may_be_called_by_name_is_given_anything():
    read = program('go p1;\n%"go"%;')
    assert ends(read) == [10]
    assert "in some calls" in "".join(reasons(read))


def test_calls_without_end_are_not_followed():
    routines = "PROC go(robtarget p)\nMoveL p,v5,fine,tool0;\ngo Offs(p,1,0,0);\nENDPROC\n"
    read = program("go p1;", routines)
    assert ends(read) == [10]
    assert "in some calls" in reasons(read)[0]


def test_many_calls_in_each_other_end_somewhere():
    calls = "".join(f"PROC r{k}()\nr{k + 1};\nr{k + 1};\nENDPROC\n" for k in range(40))
    read = program("r0;\nMoveL p2,v5,fine,tool0;", f"{calls}PROC r40()\nMoveL p1,v5,fine,tool0;\nENDPROC\n")
    assert sorted(ends(read)) == [10, 20]
