import time
from unittest.mock import Mock, patch

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.core.flow import Branches, Loop
from robot_programs.rapid.parse import StatementParser, parse
from robot_programs.rapid.read import read_rapid
from robot_programs.rapid.syntax import Instruction, number, tokenize
from tests.laws.robots import generators
from tests.robot_programs.rapid.generator import generate
from tests.robot_programs.rapid.samples import module


@given(st.text(max_size=300) | generators.map(lambda rng: generate(rng).sources[0].text))
def test_words_are_parts_of_the_text_in_order(text):
    at = 0
    for token in tokenize(text):
        assert token.start >= at
        assert text[token.start : token.end] == token.text
        at = token.end
    assert at == len(text)


def test_text_outside_of_modules_is_said_once():
    modules, problems = parse("stray words;\nMODULE m\nENDMODULE\nmore\nMODULE n\nENDMODULE\n")
    assert [found.name.text for found in modules] == ["m", "n"]
    ((position, text),) = [(problem.position, problem.text) for problem in problems]
    assert (position, text.split()[0]) == (0, "'stray'")


def test_words_of_each_kind():
    text = '%%%VERSION:1%%%\nMODULE m ! "no" string\n x1:=-.5E+3<>0x1F;"a ""b"" c!"\\Y'
    assert [token.text for token in tokenize(text)] == [
        "MODULE", "m", "x1", ":=", "-", ".5E+3", "<>", "0x1F", ";", '"a ""b"" c!"', "\\", "Y", "",
    ]  # fmt: skip


def test_data_that_refer_to_each_other_deeply():
    chain = "".join(f"CONST num a{k}:={'(' * 20}a{k + 1}+1{')' * 20};" for k in range(90)) + "CONST num a90:=1;"
    body = "MoveL [[a0,0,0],[1,0,0,0],[0,0,0,0],[9,9,9,9,9,9]],v5,fine,tool0;"
    assert "in a circle, or too deeply" in read_rapid([module(body, chain)]).diagnostics[0].text
    doubled = "".join(f"CONST num a{k}:=a{k + 1}+a{k + 1};" for k in range(40)) + "CONST num a40:=1;"
    move = "MoveL [[a30,0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v5,fine,tool0;"
    (found,) = read_rapid([module(move, doubled)]).motions
    assert found.end.T[0, 3] == pytest.approx(1.024)


@pytest.mark.parametrize(
    "piece", ['"', "!", "[", "%%%", "MODULE ", "IF ", "x:=1;", "\\a ", "PROC p() ", '"a""', "1.", "9e", "ENDIF "]
)
def test_the_time_to_read_grows_with_the_length(piece):
    def seconds(count: int) -> float:
        begin = time.process_time()
        parse("MODULE m PROC main() " + piece * count)
        return time.process_time() - begin

    shortest = max(seconds(1000), 4e-3)
    assert any(seconds(8000) < 30 * shortest for _ in range(2))


PIECES = [
    "MoveL p,v,z,t\\WObj:=w;",
    "MoveC p,[1],v,z,t;",
    "VAR num a:=[1];",
    "a",
    "MoveL",
    "TRUE",
    ",",
    "\\",
    "\\b:=",
    ":=",
    "[",
    "]",
    "1",
    ";",
    ";",
    " ",
    "\n",
    "!c\n",
    "(",
    ")",
    "+",
    "[[1,2],[-3]]",
    "[4]",
]


@given(
    st.lists(st.sampled_from(PIECES), max_size=30).map(lambda pieces: "MODULE m PROC p() " + "".join(pieces))
    | generators.map(lambda rng: generate(rng).sources[0].text)
)
def test_plain_instructions_mean_the_same_word_by_word(text):
    at_once = repr(parse(text)).replace("plain=True", "plain=False")
    word_by_word = {"_plain": Mock(return_value=None), "_plain_declaration": Mock(return_value=None)}
    with patch.multiple(StatementParser, **word_by_word):
        assert repr(parse(text)) == at_once


def test_instructions_of_names_and_lists_are_plain():
    lines = [
        "MoveL [[1,2,3],[4]] , v5,\n z1,t\\WObj:=w;",
        "Stop;",
        "MoveL Offs(p,1,2,3),v5,z1,t;",
        "MoveL p!c\n,v5,z1,t;",
    ]
    ((module,), ()) = parse(f"MODULE m PROC p() {' '.join(lines)} ENDPROC ENDMODULE")
    assert [node.line.plain for node in module.routines[0].body] == [True, True, False, False]


# Statements as a tree.


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
    assert [type(node) for node in main.body] == [Branches, Loop, Loop, Branches]
    assert [len(handler) for handler in main.handlers] == [1, 1]
    assert isinstance(trap.body[0].line, Instruction)


# Words of RAPID: each stands where it says, and nothing but blanks, comments and the header lies between them.


pieces = st.sampled_from(
    ["MoveL", "p1", "10", "0x1F", "1.5E-3", ":=", "<=", "[", ",", '"a ""b"" !c"', "!x\n", " ", "\n", "\\"]
)


@given(st.lists(pieces, max_size=20).map("".join) | st.text(max_size=40))
def test_words_and_blanks_make_up_the_text(text):
    """Words stand where they say and only blanks and comments lie between."""
    *tokens, end = tokenize(text)
    assert (end.kind, end.start) == ("end", len(text))
    position = 0
    for token in (*tokens, end):
        between = text[position : token.start]
        if not between.lstrip("\ufeff \t\r\n").startswith("%%%"):
            left = "".join(line.split("!")[0] for line in between.splitlines())
            assert not left.replace("\ufeff", "").strip()
        assert text[token.start : token.end] == token.text
        position = token.end


@pytest.mark.parametrize(
    ("text", "value"), [("12", 12.0), (".5", 0.5), ("1e3", 1e3), ("0xFf", 255.0), ("0b101", 5.0), ("0o17", 15.0)]
)
def test_numbers_have_their_value_in_every_base(text, value):
    token, _ = tokenize(text)
    assert token.kind == "number"
    assert number(token) == value


def test_letter_case_counts_in_strings_only():
    """Letter case counts in strings only and a header has no words."""
    name, text, _ = tokenize('%%%\n VERSION:1\n%%%\nMoveL "Abc"')
    assert (name.text, name.key) == ("MoveL", "movel")
    assert (text.kind, text.key) == ("text", '"Abc"')
