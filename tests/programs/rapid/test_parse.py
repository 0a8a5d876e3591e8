import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.programs.rapid.expressions import DEPTH
from taskcal.programs.rapid.parse import parse
from taskcal.programs.rapid.syntax import Branches, Instruction, Loop
from taskcal.programs.rapid.tokens import tokenize
from tests.laws.robots import generators
from tests.programs.rapid.generator import generate


@given(st.text(max_size=300) | generators.map(lambda rng: generate(rng).sources[0].text))
def test_words_are_parts_of_the_text_in_order(text):
    at = 0
    for token in tokenize(text):
        assert token.start >= at
        assert text[token.start : token.end] == token.text
        at = token.end
    assert at == len(text)


def test_words_of_each_kind():
    text = '%%%VERSION:1%%%\nMODULE m ! "no" string\n x1:=-.5E+3<>0x1F;"a ""b"" c!"\\Y'
    assert [token.text for token in tokenize(text)] == [
        "MODULE", "m", "x1", ":=", "-", ".5E+3", "<>", "0x1F", ";", '"a ""b"" c!"', "\\", "Y", "",
    ]  # fmt: skip


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


@pytest.mark.parametrize(
    "body", ["x:=" + "(" * 5000, "x:=" + "-" * 5000 + "1;", "IF a THEN " * 5000, "x:=" + "[" * 5000 + "]" * 5000 + ";",
             "IF a " * 5000 + "Stop;", "x:=a{" + "a{" * 5000],
)  # fmt: skip
def test_deep_nesting_is_reported(body):
    _, problems = parse(f"MODULE m PROC main() {body} ENDPROC ENDMODULE")
    assert any(f"nested deeper than {DEPTH}" in problem.text for problem in problems)


@pytest.mark.parametrize(
    "piece", ['"', "!", "[", "%%%", "MODULE ", "IF ", "x:=1;", "\\a ", "PROC p() ", '"a""', "1.", "9e", "ENDIF "]
)
def test_the_time_to_read_grows_with_the_length(piece):
    def seconds(count: int) -> float:
        begin = time.process_time()
        parse("MODULE m PROC main() " + piece * count)
        return time.process_time() - begin

    shortest = np.min([seconds(1000) for _ in range(2)])
    assert np.min([seconds(8000) for _ in range(2)]) < 30 * max(shortest, 4e-3)
