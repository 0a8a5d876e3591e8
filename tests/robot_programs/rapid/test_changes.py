"""Where a program may change its data: lines that are not understood, routines that are not in the files, calls by name."""

import pytest

from robot_programs.rapid.read import read_rapid
from tests.robot_programs.rapid.samples import POINTS, module, reasons, source

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


# Targets from where the robot stood, which a function at run time leaves as they are.


@pytest.mark.parametrize(
    ("change", "routine"),
    [
        ("a:=CRobT();kept{2}:=a;b:=kept{k};", ""),
        ("a:=CRobT();give a,b;", "PROC give(robtarget x,VAR robtarget y)\ny:=x;\nENDPROC"),
        ("a:=CRobT();give a,b;", "PROC give(robtarget x,INOUT robtarget y)\ny:=raised(x);\nENDPROC\n{raised}"),
        ("a:=CRobT();b:=raised(a);", "{raised}"),
        ("a:=CRobT();put a;get b;", "PROC put(robtarget x)\nkept{k}:=x;\nENDPROC\nPROC get(VAR robtarget x)\nx:=kept{1};\nENDPROC"),
    ],
)  # fmt: skip
def test_a_measured_target_stays_one_whatever_hands_it_on(change, routine):
    raised = "FUNC robtarget raised(robtarget x)\nx.trans.z:=300;\nRETURN x;\nENDFUNC"
    declared = "VAR num k;VAR robtarget a;VAR robtarget b;PERS robtarget kept{5};\n"
    text = f"MODULE m\n{declared}PROC main()\n{change}\nMoveL b,v5,fine,tool0;\nENDPROC\n{routine}\nENDMODULE\n"
    wrapped = read_rapid([source(text.replace("{raised}", raised))]).wrap("Corrected", None)
    assert not wrapped.wrapped
    assert "'b' comes from where the robot stood" in wrapped.left[0].text


# Routines that are not in the files, calls by name, soft servos and shifted external axes.


LENT = (
    "PERS tooldata tA:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n"
    "PERS tooldata tB:=[TRUE,[[0,0,200],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n"
    'PERS wobjdata wA:=[FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n'
    "VAR robtarget pV:=[[5,0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\nPERS num n:=1;\n"
)
USE_TOOL = "PROC useTool1()\ntA:=tB;\nENDPROC\n"


def program(*main: str, routines: str = ""):
    body = "\n".join(main)
    return read_rapid([source(f"MODULE m\n{POINTS}{LENT}PROC main()\n{body}\nENDPROC\n{routines}ENDMODULE")])


def move(to: str = "p1", tool: str = "tA") -> str:
    return f"MoveL {to},v5,fine,{tool}\\WObj:=wA;"


@pytest.mark.parametrize("given", ["tA", "wA", "p2,tA", "\\Tool:=tA"])
def test_strange_routine_may_change_its_tool_or_work_object(given):
    read = program(f"Setup {given};", move())
    assert not read.motions
    assert "may be changed by Setup, which is not in the files given, in part.mod:17" in "".join(reasons(read))


def test_strange_function_may_change_its_tool():
    read = program("n:=Measured(tA);", move())
    assert not read.motions
    assert "may be changed by Measured" in "".join(reasons(read))


@pytest.mark.parametrize(("target", "known"), [("p1", True), ("pV", False)])
def test_strange_routine_may_change_a_target_unless_constant(target, known):
    read = program(f"Setup {target};", move(target, "tB"))
    assert len(read.motions) == known


def test_strange_routine_is_named_and_changes_no_other_data():
    read = program(move(), "Setup;", move("p2"))
    assert len(read.motions) == 2
    assert read.motions[1].follows is None
    assert reasons(read) == [
        "part.mod:18: Setup is not in the files given; it is taken to leave all data as they are that it is not given"
    ]


@pytest.mark.parametrize(
    "known",
    ["SetDO doA,1;", "WaitLoad load1;", "LoadId ParIdRobValid,WRIST_MOVE,tA;", "ArcLStart p2,v5,seam1,weld1,fine,tA;"],
)
def test_instructions_of_the_system_leave_their_tool(known):
    read = program(known, move())
    assert [m.end.name for m in read.motions][-1] == "p1"
    assert "not in the files given" not in "".join(reasons(read))


def test_tool_changed_in_a_program_of_its_own_is_known_in_others():
    service = f"PROC service()\nSetup tA;\n{move('p2')}\nENDPROC\n"
    read = program(move(), routines=service)
    assert [m.end.name for m in read.motions] == ["p1"]
    assert "stays as it is: 'tA' may be changed by Setup" in "".join(reasons(read))
    assert not program("service;", move(), routines=service).motions


@pytest.mark.parametrize("call", ['CallByVar "useTool",n;', '%"useTool1"%;', '%"useTool"+"1"%;'])
@pytest.mark.parametrize("nested", [False, True])
def test_call_by_name_may_change_what_any_routine_changes(call, nested):
    """The tool is known before; behind the call it is what a routine may have set."""
    inner = f"PROC inner()\n{call}\nENDPROC\n" if nested else ""
    read = program("tA:=tB;", move(), "inner;" if nested else call, move("p2"), routines=USE_TOOL + inner)
    assert [m.end.name for m in read.motions] == ["p1"]
    assert "calls a procedure whose name is known only at run time" in "".join(reasons(read))


def test_call_by_name_in_a_loop_may_change_any_data():
    read = program("tA:=tB;", "WHILE n>0 DO", move(), 'CallByVar "useTool",n;', "ENDWHILE", routines=USE_TOOL)
    assert not read.motions


def test_call_by_name_may_lead_to_a_strange_routine():
    read = program('CallByVar "path",n;', move(), routines="PROC path1()\nSetup tA;\nENDPROC\n")
    assert not read.motions


def soft(read) -> list[int]:
    return [d.place.line for d in read.diagnostics if "a servo may be soft here (SoftAct in part.mod:" in d.text]


def test_motions_behind_softact_are_remarked_up_to_softdeact():
    read = program(move(), "SoftAct 3,20;", move("p2"), move("p3"), "SoftDeact;", move("p4"))
    assert len(read.motions) == 4
    assert soft(read) == [19, 20]


def test_softact_in_a_branch_or_a_call_is_remarked():
    routine = "PROC yield()\nSoftAct 3,20;\nENDPROC\n"
    assert soft(program("IF n=1 SoftAct 3,20;", move(), "SoftDeact;", move("p2"))) == [18]
    assert soft(program("yield;", move(), "SoftDeact;", move("p2"), routines=routine)) == [18]
    assert soft(program(move(), "SoftAct 3,20;")) == [17]  # main begins again


@pytest.mark.parametrize("shift", ["EOffsSet [100,0,0,0,0,0];", "EOffsOn \\ExeP:=p1,p2;"])
def test_motions_know_what_shifts_external_axes(shift):
    read = program(shift, move(), "MoveAbsJ [[0,0,0,0,9,0],[0,9E9,9E9,9E9,9E9,9E9]]\\NoEOffs,v5,fine,tA;", "EOffsOff;")
    name = shift.split()[0]
    assert [m.external_offset for m in read.motions] == [f"{name} in part.mod:17", ""]
    assert f"part.mod:17: {name} shifts the external axes by what is not read" in reasons(read)[0]


def test_data_set_by_name_are_named():
    assert "SetDataVal sets data by their names" in reasons(program('SetDataVal "tA",tB;', move()))[0]


@pytest.mark.parametrize(
    "filling",
    [
        'GetDataVal "x",tA;',
        "RMQGetMsgData msg1,tA;",
        "UnpackRawBytes raw1,1,tA.tframe.trans.z\\Float4;",
        'bOK:=StrToVal("[1,2]",tA);',
        'IF StrToVal("[1,2]",tA) THEN\nENDIF',
    ],
)
def test_system_instruction_that_returns_values_changes_tool(filling):
    assert not program(filling, move()).motions


@pytest.mark.parametrize(
    "returning",
    [
        'bOK:=StrToVal("5",nV);',
        'IF StrToVal("5",nV) THEN\nENDIF',
        "WaitDI di1,1\\MaxTime:=2\\TimeFlag:=bV;\nIF bV nV:=5;",
        "WaitAI ai1\\GT,3\\MaxTime:=2\\ValueAtTimeout:=nV;",
        'UIMsgBox "x"\\Buttons:=btnOKCancel\\Result:=nV;',
        "n:=UINumEntry(\\MaxTime:=3\\BreakFlag:=nV);",
    ],
)
def test_system_call_returns_values_by_its_arguments(returning):
    routine = f"PROC at()\nVAR num nV:=0;\nVAR bool bV:=FALSE;\nVAR bool bOK;\n{returning}\n{move('Offs(p1,0,0,nV)')}\nENDPROC\n"
    assert not program("at;", routines=routine).motions
    assert program("at;", routines=routine.replace(returning, 'bOK:=StrPart("5",1,1)="5";')).motions


def test_data_that_setdataval_hands_over_stay():
    assert len(program('SetDataVal "q",pV;', move("pV"), move("p2")).motions) == 2
