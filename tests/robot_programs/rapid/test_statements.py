"""Statements as a tree."""

from robot_programs.rapid.parse import parse
from robot_programs.rapid.syntax import Branches, Instruction, Loop


def test_the_tree_of_a_routine():
    text = (
        "MODULE m(SYSMODULE)\n"
        "RECORD pair num a; robtarget b; ENDRECORD\n"
        "LOCAL CONST num n{2,2}:=[[1,2],[3,4]];\n"
        "FUNC num f(num x \\num y|switch z, INOUT robtarget p{*}) RETURN x; ENDFUNC\n"
        "PROC main() VAR bool b:=TRUE; IF b THEN ELSEIF NOT b THEN Stop; ELSE Stop; ENDIF\n"
        "WHILE TRUE DO Stop; ENDWHILE FOR i FROM 1 TO 2 DO Stop; ENDFOR TEST 1 CASE 1: Stop; ENDTEST\n"
        "UNDO Stop; ERROR(ERR_A,10) TRYNEXT; ENDPROC\n"
        "TRAP t Stop; ENDTRAP\n"
        "ENDMODULE"
    )
    (module,), problems = parse(text)
    assert not problems
    assert [record.components for record in module.records] == [(("a", "num"), ("b", "robtarget"))]
    assert [declaration.name.text for declaration in module.declarations] == ["n"]
    function, main, trap = module.routines
    assert [(p.name.text, p.optional, p.changed) for p in function.parameters] == [
        ("x", False, False), ("y", True, False), ("z", False, False), ("p", False, True),
    ]  # fmt: skip
    assert [type(statement) for statement in main.body] == [Branches, Loop, Loop, Branches]
    assert [len(handler) for handler in main.handlers] == [1, 1]
    assert isinstance(trap.body[0], Instruction)
