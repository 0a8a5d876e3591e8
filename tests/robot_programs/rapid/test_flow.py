"""The flow of RAPID: which motion comes before, what values are known, and what routines are given."""

from itertools import permutations

import pytest

from robot_programs.core.flow import SOMEWHERE
from robot_programs.core.interpreter import Moment
from robot_programs.core.values import Lost, Structure
from robot_programs.rapid.read import read_rapid
from robot_programs.rapid.values import TracedOrigin
from tests.robot_programs.rapid.samples import POINTS, module, reasons, source


def move(k: int) -> str:
    return f"MoveL p{k},v100,z1,tool0;"


@pytest.mark.parametrize(
    ("body", "follows"),
    [
        (f"{move(1)}SetDO doA,1;WaitTime 2;reg1:=reg1+Abs(-2);{move(2)}", [None, 0]),
        (f"{move(1)}again:{move(2)}", [None, 0]),
        (f"{move(1)}again:{move(2)}{move(3)}GOTO again;", [None, None, 1]),
        (f"a:=0;{move(1)}again:{move(2)}Incr a;IF a<3 GOTO again;{move(3)}", [None, None, 1]),
        (f"{move(1)}Weld;{move(2)}", [None, None]),
        (f"{move(1)}reg1:=Measure();{move(2)}", [None, None]),
        (f"{move(1)}%\"weld\"+ValToStr(3)%;{move(2)}", [None, None]),
        (f"{move(1)}TriggL p2,v100,gun,fine,tool0;{move(3)}", [None, 0, 1]),
        (f"{move(1)}SearchL diFound,p2,p4,v100,tool0;{move(3)}", [None, 0, None]),
        (f"{move(1)}MoveExtJ jOut,vrot10,fine;{move(3)}", [None, None]),
        (f"{move(1)}Glue p2,v100,gun,fine,tool0;{move(3)}", [None, None]),
        (f"{move(1)}IF a=1 THEN {move(2)} ELSEIF a=2 THEN {move(3)} ENDIF {move(4)}", [None, 0, 0, None]),
        (f"{move(1)}IF a=1 {move(2)} {move(3)}", [None, 0, None]),
        (f"{move(1)}IF a=1 THEN Reset doA; ENDIF {move(2)}", [None, 0]),
        (f"{move(1)}IF a=1 THEN {move(2)} RETURN; ENDIF {move(3)}", [None, 0, 0]),
        (f"{move(1)}IF Measure()=1 THEN {move(2)} ENDIF", [None, None]),
        (f"{move(1)}TEST a CASE 1,2: {move(2)} CASE 3: {move(3)} DEFAULT: {move(4)} ENDTEST {move(5)}", [None, 0, 0, 0, None]),
        (f"{move(1)}TEST a CASE 1: {move(2)} DEFAULT: RETURN; ENDTEST {move(3)}", [None, 0, 1]),
        (f"{move(1)}FOR i FROM 1 TO n DO {move(2)} {move(3)} ENDFOR {move(4)}", [None, None, 1, None]),
        (f"{move(1)}FOR i FROM 3 TO 1 STEP 1 DO {move(2)} ENDFOR {move(3)}", [None, None, 0]),
        (f"{move(1)}IF 1>2 THEN {move(2)} ELSE {move(3)} ENDIF {move(4)}", [None, None, 0, 2]),
        (f"{move(1)}WHILE TRUE DO {move(2)} {move(3)} ENDWHILE {move(4)}", [None, None, 1, None]),
        (f"{move(1)}WHILE a<3 DO Incr a; ENDWHILE {move(2)}", [None, 0]),
        (f"{move(1)}WHILE a<3 DO IF b {move(2)} ENDWHILE {move(3)}", [None, None, None]),
        (f"{move(1)}GOTO far;{move(2)}far:{move(3)}", [None, None, 0]),
        (f"{move(1)}{move(2)} ERROR TRYNEXT;", [None, 0]),
        (f"{move(1)}{move(2)} ERROR {move(3)} RETRY;", [None, None, None]),
        (f"{move(1)}<SMT>{move(2)}", [None, None]),
    ],
)  # fmt: skip
def test_which_motion_comes_before(body, follows):
    assert [found.follows for found in read_rapid([module(body, POINTS)]).motions] == follows


def test_a_routine_begins_anywhere():
    body = f"{move(1)}\nENDPROC\nPROC other()\n{move(2)}{move(3)}"
    program = read_rapid([module(body, POINTS)])
    assert [found.follows for found in program.motions] == [None, None, 1]
    assert [found.routine for found in program.motions] == ["main", "other", "other"]


def test_routine_named_like_a_motion_is_a_call():
    """A routine of the program that is named like a motion is a call."""
    body = f"{move(1)}MoveHome;{move(2)}\nENDPROC\nPROC MoveHome()\n{move(3)}"
    program = read_rapid([module(body, POINTS)])
    assert [found.follows for found in program.motions] == [None, 2, 0]
    assert not program.diagnostics


def test_a_routine_that_calls_itself_begins_anywhere():
    body = f"{move(1)}again;\nENDPROC\nPROC again()\n{move(2)}\nIF diAny=1 again;\n{move(3)}"
    program = read_rapid([module(body, POINTS)])
    assert [found.follows for found in program.motions] == [None, None, None]


@pytest.mark.parametrize(
    ("body", "x"),
    [
        ("FOR i FROM 3 TO 1 DO MoveL a{i},v5,fine,tool0; ENDFOR", [30, 20, 10]),
        ("FOR i FROM 1 TO 3 STEP 2 DO MoveL a{i},v5,fine,tool0; ENDFOR", [10, 30]),
        ("FOR i FROM 1 TO Dim(a,1) DO IF i<>2 MoveL a{i},v5,fine,tool0; ENDFOR", [10, 30]),
        ("Clear n; WHILE n<3 DO Incr n; MoveL a{n},v5,fine,tool0; ENDWHILE", [10, 20, 30]),
        ("n:=3; WHILE n>1 DO MoveL a{n},v5,fine,tool0; Decr n; ENDWHILE", [30, 20]),
        ("n:=1; Add n,2; MoveL a{n},v5,fine,tool0; Add n,-1; MoveL a{n},v5,fine,tool0;", [30, 20]),
        ("MoveL q,v5,fine,tool0; Add q.trans.x,10; MoveL q,v5,fine,tool0;", [10, 20]),
        ("q:=Offs(q,n+5,0,0); q.trans.x:=q.trans.x*2; MoveL q,v5,fine,tool0;", [30]),
        ("TEST diAny CASE 1: n:=3; CASE 2: n:=3; DEFAULT: n:=3; ENDTEST MoveL a{n},v5,fine,tool0;", [30]),
    ],
)  # fmt: skip
def test_values_are_followed_through_the_statements_of_a_routine(body, x):
    elements = ",".join(line.split(":=")[1].rstrip(";") for line in POINTS.splitlines()[:3])
    own = f"CONST robtarget a{{3}}:=[{elements}];\n"
    first = POINTS.splitlines()[0].split(":=")[1]
    program = read_rapid([module(f"VAR robtarget q:={first} VAR num n;\n{body}", POINTS + own)])
    assert not program.diagnostics
    numbers = range(len(program.motions))
    order = [next(i for i in numbers if program.motions[i].follows is None)]
    while len(order) < len(numbers):  # from each to the one that follows it
        order.append(next(i for i in numbers if program.motions[i].follows == order[-1]))
    assert [round(program.motions[i].end.T[0, 3] * 1e3) for i in order] == x


def test_module_variable_keeps_its_value_only_if_main_does():
    """A variable of the module holds its declared value only if main leaves it so."""
    variable = "VAR" + POINTS.splitlines()[0][5:].replace("p1", "q") + "\n"
    stays = read_rapid(
        [
            module(
                "MoveL q,v5,fine,tool0;\nWHILE TRUE DO other; ENDWHILE\nENDPROC\nPROC other() q:=p2;", POINTS + variable
            )
        ]
    )
    assert [found.end.name for found in stays.motions] == ["q"]
    again = read_rapid([module("MoveL q,v5,fine,tool0;\nother;\nENDPROC\nPROC other() q:=p2;", POINTS + variable)])
    assert not again.motions


@pytest.mark.parametrize(
    ("connects", "trap", "follows"),
    [
        ("CONNECT alarm WITH t;", move(5), [None, 0, None, None, None]),
        ("CONNECT alarm WITH t", move(5), [None, 0, None, None, None]),
        ("CONNECT alarm WITH t;", "a:=1;", [None, 0, 1, 2]),
        ("", move(5), [None, 0, 1, 2, None]),
    ],
)
def test_what_comes_before_is_not_known_while_a_trap_may_move(connects, trap, follows):
    body = f"{move(1)}{move(2)}{connects}\nIF a=1 Stop;\n{move(3)}{move(4)}\nENDPROC\nTRAP t\n{trap}\nENDTRAP\nPROC other()"
    assert [found.follows for found in read_rapid([module(body, POINTS)]).motions] == follows


def test_assigned_tool_has_the_name_of_its_source():
    """A tool that is assigned goes by the name of the one it is."""
    data = "[TRUE,[[0,0,%d],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n"
    tool = f"PERS tooldata tA:={data % 100}PERS tooldata tNow:={data % 0}"
    (found,) = read_rapid([module("tNow:=tA;MoveL p1,v5,fine,tNow;", POINTS + tool)]).motions
    assert (found.tool.name, found.tool.T[2, 3]) == ("tA", 0.1)


@pytest.mark.parametrize(
    "body",
    [
        "IF bSide THEN q:=p2; ELSE q:=p1; ENDIF",
        "b:=NOT bSide; IF b THEN q:=p2; ELSE q:=p1; ENDIF",
        "choose bSide;",
        "FOR i FROM 1 TO nParts DO q:=Offs(q,i,0,0); ENDFOR",
    ],
)
def test_persistent_data_decide_nothing(body):
    """Nothing is decided by persistent data that an operator may set."""
    first = POINTS.splitlines()[0].split(":=")[1]
    own = f"VAR robtarget q:={first}\nPERS bool bSide:=FALSE;PERS num nParts:=3;VAR bool b;\n"
    choose = "\nENDPROC\nPROC choose(bool which)\nIF which THEN q:=p2; ELSE q:=p1; ENDIF"
    program = read_rapid([module(f"{body} MoveL q,v5,fine,tool0;{choose}", POINTS + own)])
    assert not program.motions
    decided = read_rapid(
        [module(f"b:=TRUE; {body.replace('bSide', 'b')} MoveL q,v5,fine,tool0;{choose}", POINTS + own)]
    )
    assert len(decided.motions) == ("nParts" not in body)


def test_local_routine_of_another_module_is_not_called():
    """A local routine of another module is not the one that is called."""
    other = source("MODULE Other\nLOCAL PROC go(robtarget p)\nMoveL p,v5,fine,tool0;\nENDPROC\nENDMODULE", "other.mod")
    program = read_rapid([module("go p1;", POINTS), other])
    assert not program.motions


# What holds behind several ways through a program.


def test_joined_state_holds_what_all_ways_agree_on():
    """Of several ways only data with one value, and a motion that was the last on all of them, are known behind."""
    one = Moment(last=1, variables={"a": 1.0, "b": 2.0})
    other = Moment(last=2, variables={"a": 1.0, "b": 3.0})
    both = one.joined([other], "")
    assert both.last == SOMEWHERE
    assert one.joined([Moment(last=None)], "").last is None
    assert {key: value for key, value in both.variables.items() if not isinstance(value, Lost)} == {"a": 1.0}
    assert one.joined([one], "").last == 1
    for ways in permutations([one, one, other]):
        first, *others = ways
        assert first.joined(others, "") == both, "it matters in which order ways join, or that two are one"


def test_joined_state_names_data_only_if_all_ways_do():
    """A name of what was assigned is kept where all ways assign it."""
    p, q = (
        Moment(
            variables={
                "a": Structure(kind="", parts={0: 1.0}, origin=TracedOrigin(at=(0, 0, 0), owner=None, name=name))
            }
        )
        for name in ("p", "q")
    )
    assert p.joined([q], "").variables["a"].origin is None
    assert p.joined([p], "").variables["a"].origin.name == "p"


# What routines are given, and what comes of their motions.


ROUTINE = "PROC go(robtarget p)\nMoveL p,v5,fine,tool0;\nENDPROC\n"


def program(main: str, routines: str = ROUTINE):
    return read_rapid([source(f"MODULE m\n{POINTS}PROC main()\n{main}\nENDPROC\n{routines}ENDMODULE")])


def ends(read) -> list[float]:
    return [round(move.end.T[0, 3] * 1e3, 3) for move in read.motions]


@pytest.mark.parametrize(
    ("routines", "x"),
    [
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
    assert [(move.texts_motions, move.divisible) for move in read.motions] == [(2, False)]


@pytest.mark.parametrize(
    ("main", "routine", "x", "said"),
    [
        (
            "go tool0;\ngo tUnknown;",
            "PROC go(PERS tooldata t)\nMoveL p1,v5,fine,t;\nENDPROC\n",
            [],
            "'t' is a parameter",
        ),
        ('go p1;\n%"go"%;', ROUTINE, [10], "in some calls"),  # which may give it anything
        ("go p1;", ROUTINE.replace("ENDPROC", "go Offs(p,1,0,0);\nENDPROC"), [10], "in some calls"),  # without end
    ],
)
def test_what_some_calls_give_is_not_known(main, routine, x, said):
    read = program(main, routine)
    assert ends(read) == x
    assert said in "".join(reasons(read))


def test_many_calls_in_each_other_end_somewhere():
    calls = "".join(f"PROC r{k}()\nr{k + 1};\nr{k + 1};\nENDPROC\n" for k in range(40))
    read = program("r0;\nMoveL p2,v5,fine,tool0;", f"{calls}PROC r40()\nMoveL p1,v5,fine,tool0;\nENDPROC\n")
    assert sorted(ends(read)) == [10, 20]
