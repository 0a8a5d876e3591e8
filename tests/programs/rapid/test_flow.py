import pytest

from taskcal.programs.rapid.read import read_rapid
from tests.programs.rapid.samples import POINTS, module


def move(k: int) -> str:
    return f"MoveL p{k},v100,z1,tool0;"


@pytest.mark.parametrize(
    ("body", "follows"),
    [
        (f"{move(1)}{move(2)}", [None, 0]),
        (f"{move(1)}SetDO doA,1;WaitTime 2;reg1:=reg1+Abs(-2);{move(2)}", [None, 0]),
        (f"{move(1)}again:{move(2)}", [None, None]),
        (f"{move(1)}Weld;{move(2)}", [None, None]),
        (f"{move(1)}reg1:=Measure();{move(2)}", [None, None]),
        (f"{move(1)}%\"weld\"+ValToStr(3)%;{move(2)}", [None, None]),
        (f"{move(1)}TriggL p2,v100,gun,fine,tool0;{move(3)}", [None, 0, 1]),
        (f"{move(1)}SearchL diFound,p2,p4,v100,tool0;{move(3)}", [None, 0, None]),
        (f"{move(1)}MoveExtJ jOut,vrot10,fine;{move(3)}", [None, None]),
        (f"{move(1)}Glue p2,v100,gun,fine,tool0;{move(3)}", [None, None]),
        (f"{move(1)}IF a=1 THEN {move(2)} ELSE {move(3)} ENDIF {move(4)}", [None, 0, 0, None]),
        (f"{move(1)}IF a=1 THEN {move(2)} ELSEIF a=2 THEN {move(3)} ENDIF {move(4)}", [None, 0, 0, None]),
        (f"{move(1)}IF a=1 {move(2)} {move(3)}", [None, 0, None]),
        (f"{move(1)}IF a=1 THEN Reset doA; ENDIF {move(2)}", [None, 0]),
        (f"{move(1)}IF a=1 THEN {move(2)} RETURN; ENDIF {move(3)}", [None, 0, 0]),
        (f"{move(1)}IF Measure()=1 THEN {move(2)} ENDIF", [None, None]),
        (f"{move(1)}TEST a CASE 1,2: {move(2)} CASE 3: {move(3)} DEFAULT: {move(4)} ENDTEST {move(5)}", [None, 0, 0, 0, None]),
        (f"{move(1)}TEST a CASE 1: {move(2)} DEFAULT: RETURN; ENDTEST {move(3)}", [None, 0, 1]),
        (f"{move(1)}FOR i FROM 1 TO 3 DO {move(2)} {move(3)} ENDFOR {move(4)}", [None, None, 1, None]),
        (f"{move(1)}WHILE a<3 DO Incr a; ENDWHILE {move(2)}", [None, 0]),
        (f"{move(1)}WHILE a<3 DO IF b {move(2)} ENDWHILE {move(3)}", [None, None, None]),
        (f"{move(1)}GOTO far;{move(2)}far:{move(3)}", [None, None, None]),
        (f"{move(1)}{move(2)} ERROR TRYNEXT;", [None, 0]),
        (f"{move(1)}{move(2)} ERROR {move(3)} RETRY;", [None, None, None]),
        (f"{move(1)}<SMT>{move(2)}", [None, None]),
    ],
)  # fmt: skip
def test_which_motion_comes_before(body, follows):
    assert [found.follows for found in read_rapid([module(body, POINTS)]).moves] == follows


def test_a_routine_begins_anywhere():
    body = f"{move(1)}\nENDPROC\nPROC other()\n{move(2)}{move(3)}"
    program = read_rapid([module(body, POINTS)])
    assert [found.follows for found in program.moves] == [None, None, 1]
    assert [found.routine for found in program.moves] == ["main", "other", "other"]


def test_a_routine_of_the_program_that_is_named_like_a_motion_is_a_call():
    body = f"{move(1)}MoveHome;{move(2)}\nENDPROC\nPROC MoveHome()\n{move(3)}"
    program = read_rapid([module(body, POINTS)])
    assert [found.follows for found in program.moves] == [None, None, None]
    assert not program.diagnostics
