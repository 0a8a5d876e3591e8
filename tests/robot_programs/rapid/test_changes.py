import pytest

from robot_programs.rapid.read import read_rapid
from tests.robot_programs.rapid.diagnosed import reasons
from tests.robot_programs.rapid.samples import POINTS, module, source

DATA = (
    POINTS.splitlines()[0].replace("CONST", "VAR")
    + 'PERS tooldata tM:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];PERS wobjdata wM:=[FALSE,TRUE,"",'
    "[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];VAR num k:=0;\n"
)
MOTION = "MoveL p1,v5,fine,tM\\WObj:=wM;\n"


@pytest.mark.parametrize(
    "odd",
    [
        "MoveL *,v50,fine,tM\\WObj:=wM;",
        "MoveL Offs(p1,10,,0),v5,fine,tM\\WObj:=wM;",
        "MoveL p1 v5,fine,tM\\WObj:=wM;",
        "MoveL pElsewhere,v5,,p1,tM;",
        "MoveL p1,v5,fine,tM\nMoveL p1,v5,fine,tM;",
        "TriggL pElsewhere,v5,gunOn,,tM\\WObj:=wM;",
        "TPWrite \"never closed;\nMoveL p1,v5,fine,tM;",
        "SetDO doGun,,p1;",
        "IF p1.trans.x=,1 THEN",
        "k:=p1.trans.x+;",
        "keep p1,,k;",
        "CASE p1:",
    ],
)  # fmt: skip
def test_unparsed_motions_and_questions_change_nothing(odd):
    """Motions and questions that are not understood change nothing."""
    routine = "\nENDPROC\nPROC keep(INOUT robtarget a, num b)\nWaitTime b;"
    program = read_rapid([module(f"{MOTION}{odd}{routine}", DATA)])
    assert [move.end.name for move in program.motions] == ["p1"]
    assert program.diagnostics


@pytest.mark.parametrize(
    "odd",
    [
        "p1:=CRobT(;",
        "p1.trans.x:=3 4;",
        "p1{k,}:=3;",
        "p1=CRobT();",
        "MoveL *,v5,fine,tM\np1:=CRobT();",
        "MoveL *,v5,fine,tM\nMeasure p1;",
        "IF k=,1 Measure p1;",
        "IF k=,1 THEN p1:=CRobT();",
        "Measure p1,,k;",
        "Measure *,p1;",
        "MoveL *,v5,fine,tM\\Measure p1;",
        "%\"measure\"% p1,,k;",
        "k:=Found(p1,);",
        "VAR robtarget p1 [[0,0,0],[1,0,0,0]];",
        "FOR p1 FROM 1 TOO 3 DO",
        "give k,,p1;",
    ],
)  # fmt: skip
def test_what_may_be_an_assignment_makes_a_value_unknown(odd):
    routine = "\nENDPROC\nPROC give(num a, INOUT robtarget b)\nb:=CRobT();"
    program = read_rapid([module(f"{MOTION}{odd}{routine}", DATA)])
    assert not program.motions
    line = 6 + ("\n" in odd)
    assert (
        f"part.mod:5: MoveL stays as it is: 'p1' may be assigned to in part.mod:{line}, which is not understood (line"
        in str(program.diagnostics[0])
    )


def test_the_problem_of_a_text_is_told_where_it_matters():
    program = read_rapid([module(f"{MOTION}MoveL p1,v5,fine,tM\np1:=CRobT();", DATA)])
    trouble = "line 7: a comma or a semicolon is missing before 'p1'"
    assert [str(diagnostic) for diagnostic in program.diagnostics] == [
        f"part.mod:5: MoveL stays as it is: 'p1' may be assigned to in part.mod:7, which is not understood ({trouble}), "
        "so its value is not known",
        f"part.mod:6: MoveL stays as it is: the text around it is not understood ({trouble})",
        "part.mod:7: a comma or a semicolon is missing before 'p1'",
    ]


# Where a program may change its data.


def test_arguments_stay_unless_the_routine_changes_them():
    """What a routine is given does not change its data unless the routine does so."""
    routine = "PROC go(PERS tooldata t, INOUT robtarget a, INOUT robtarget b) b:=a; ENDPROC\n"
    declarations = "VAR" + POINTS.splitlines()[0][5:] + "VAR" + POINTS.splitlines()[1][5:]
    main = "PROC main()\ngo tool0,p1,p2;\nMoveL p1,v5,fine,tool0;\nMoveL p2,v5,fine,tool0;\nENDPROC\n"
    text = f"MODULE m {declarations}\n{main}{routine}ENDMODULE"
    program = read_rapid([source(text)])
    assert [move.end.name for move in program.motions] == ["p1"]
    assert any("'p2' is assigned to in part.mod:3" in text for text in reasons(program))
