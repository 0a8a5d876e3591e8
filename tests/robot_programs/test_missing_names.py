"""Names that the files of a program use and do not declare: those of its text, and no word of a sentence."""

import pickle

import pytest

from robot_programs.core.program import Cause, Program, Unresolved, missing_from, missing_in
from robot_programs.krl.read import read_krl
from robot_programs.rapid.read import read_rapid
from tests.robot_programs.krl import samples as krl
from tests.robot_programs.rapid import samples as rapid
from tests.robot_programs.tp import samples as tp
from tests.robot_programs.urscript import samples as urscript


def of_rapid(declared: str, *body: str) -> Program:
    return read_rapid([rapid.module("\n".join(body), declared)])


def of_krl(*body: str) -> Program:
    return read_krl([krl.source("p.src", "\n".join(["DEF P( )", *body, "END", ""]))])


POSE = "[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
PROGRAMS = {
    "rapid's point": (lambda: of_rapid("", "MoveL pOne,v50,fine,tool0;"), {("pOne", "other")}),
    "rapid's frames": (
        lambda: of_rapid("", f"MoveL {POSE},v50,fine,tMill\\WObj:=wFix;"),
        {("tMill", "tool"), ("wFix", "part")},
    ),
    "rapid's point, and frames": (
        lambda: of_rapid("", "MoveL pOne,v50,fine,tMill;"),
        {("pOne", "other"), ("tMill", "tool")},
    ),
    "what a strange procedure is lent": (
        lambda: of_rapid(f"PERS robtarget p1:={POSE};", "Elsewhere p1;", "MoveL p1,v50,fine,tool0;"),
        {("Elsewhere", "other")},
    ),
    "a procedure by name": (lambda: of_rapid("VAR string s;", "%s%;", f"MoveL {POSE},v50,fine,tool0;"), set()),
    "krl's point": (lambda: of_krl("PTP XHOME"), {("XHOME", "data")}),
    "krl's frames": (
        lambda: of_krl("$TOOL=TOOL_DATA[3]", "$BASE=FIX", "LIN {X 1,Y 2,Z 3,A 0,B 0,C 0}"),
        {("TOOL_DATA[3]", "tool"), ("FIX", "part")},
    ),
    "krl's routine": (lambda: of_krl("ELSEWHERE( )"), {("ELSEWHERE", "other")}),
    "krl's coordinate": (
        lambda: of_krl("$TOOL=$NULLFRAME", "$BASE=$NULLFRAME", "$IPO_MODE=#BASE", "LIN {X HIGH,Y 2,Z 3,A 0,B 0,C 0}"),
        {("HIGH", "data")},
    ),
    "tp's program": (
        lambda: tp.read("CALL ELSEWHERE", "L PR[1] 100mm/sec FINE"),
        {("ELSEWHERE", "other")},
    ),
    "tp's frames": (
        lambda: tp.read("L P[1] 100mm/sec FINE", positions={"1": tp.pose(1, 2, 3, frames="UF : 7, UT : 8")}),
        {("UFRAME 7", "part"), ("UTOOL 8", "tool")},
    ),
    "urscript's function": (lambda: urscript.read("elsewhere()"), {("elsewhere", "other")}),
}


@pytest.mark.parametrize("program", PROGRAMS)
def test_names_of_the_text_are_missing_and_no_others(program):
    read, expected = PROGRAMS[program]
    assert {(one.name, one.kind) for one in missing_from(read().diagnostics)} == expected


def test_a_reason_keeps_its_names_in_every_form():
    tool = Cause("unknown tool 'a'", ("a", "tool"))
    both = Cause(f"{tool}; and more", ("b", "data"), of=[Unresolved(tool)])
    assert missing_in(both) == (("b", "data"), ("a", "tool"))
    assert missing_in(str(Unresolved(both))) == missing_in(both)
    assert missing_in(pickle.loads(pickle.dumps(both))) == missing_in(both)
    assert both == "unknown tool 'a'; and more"
    assert missing_in("unknown tool 'a'") == ()
