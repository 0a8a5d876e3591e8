"""Where a program may change its data."""

from robot_programs.rapid.read import read_rapid
from tests.robot_programs.rapid.diagnosed import reasons
from tests.robot_programs.rapid.samples import POINTS, source


def test_what_a_routine_is_given_does_not_change_its_data_unless_the_routine_does_so():
    routine = "PROC go(PERS tooldata t, INOUT robtarget a, INOUT robtarget b) b:=a; ENDPROC\n"
    declarations = "VAR" + POINTS.splitlines()[0][5:] + "VAR" + POINTS.splitlines()[1][5:]
    main = "PROC main()\ngo tool0,p1,p2;\nMoveL p1,v5,fine,tool0;\nMoveL p2,v5,fine,tool0;\nENDPROC\n"
    text = f"MODULE m {declarations}\n{main}{routine}ENDMODULE"
    program = read_rapid([source(text)])
    assert [move.end.name for move in program.moves] == ["p1"]
    assert any("'p2' is assigned to in part.mod:3" in text for text in reasons(program))
