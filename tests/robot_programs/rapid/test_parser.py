"""RAPID: words, statements, lists of numbers, and modules that are larger or deeper than any program."""

import contextlib
import io
import re
import time
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.core.flow import Branches, Loop
from robot_programs.core.form import Lit
from robot_programs.core.kit import Token
from robot_programs.core.source import Source
from robot_programs.rapid import lower, syntax
from robot_programs.rapid import parse as parser
from robot_programs.rapid.lower import LoweredRapid, Reading, lowered
from robot_programs.rapid.names import ModuleFile, procedures
from robot_programs.rapid.parse import MAX_DEPTH, Notes, parse
from robot_programs.rapid.read import read_rapid
from robot_programs.rapid.resolve import MoveInstruction
from robot_programs.rapid.syntax import AggregateText, number, tokenize
from robot_programs.rapid.values import plain
from taskcal.errors import FileError
from tests.laws.robots import generators
from tests.readers.rapid_modules import modules
from tests.robot_programs.rapid.generator import generate
from tests.robot_programs.rapid.samples import module


def test_text_outside_of_modules_is_said_once():
    notes = noted("stray words;\nMODULE m\nENDMODULE\nmore\nMODULE n\nENDMODULE\n")
    modules = parse(notes)
    assert [found.name.text for found in modules] == ["m", "n"]
    ((position, text),) = [(problem.position, problem.text) for problem in notes.problems]
    assert (position, text.split()[0]) == (0, "'stray'")


def test_words_of_each_kind():
    text = '%%%VERSION:1%%%\nMODULE m ! "no" string\n x1:=-.5E+3<>0x1F;"a ""b"" c!"\\Y[[1, - 2],[3]][a]'
    assert [token.text for token in tokenize(text)] == [
        "MODULE", "m", "x1", ":=", "-", ".5E+3", "<>", "0x1F", ";", '"a ""b"" c!"', "\\", "Y", "[[1, - 2],[3]]", "[", "a", "]",
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
    "piece",
    [
        '"',
        "!",
        "[",
        "%%%",
        "MODULE ",
        "IF ",
        "x:=1;",
        "\\a ",
        "PROC p() ",
        "x ENDPROC PROC p() ",
        '"a""',
        "1.",
        "9e",
        "ENDIF ",
    ],
)
def test_the_time_to_read_grows_with_the_length(piece):
    def seconds(count: int) -> float:
        begin = time.process_time()
        read("MODULE m PROC main() " + piece * count)
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


def noted(text: str) -> Notes:
    return Notes(Source(path=Path("m.mod"), text=text, encoding="utf-8"))


def read(text: str) -> tuple[LoweredRapid, Notes]:
    """A module in the one form, and what is not understood of it."""
    notes = noted(text)
    file = ModuleFile(source=notes.source, number=0)
    return lowered({file: notes}, procedures({file: parse(notes)})), notes


def told(thing: Any) -> Any:
    """All that the form says, in plain values."""
    match thing:
        case Lit():
            return thing.at, plain(thing.value)
        case _ if is_dataclass(thing) and type(thing).__module__ != "robot_programs.rapid.names":
            return type(thing).__name__, *(
                told(getattr(thing, f.name)) for f in fields(thing) if f.name not in ("shared", "scope")
            )
        case str() | bytes():
            return thing
        case Mapping():
            return [(told(key), told(value)) for key, value in thing.items()]
        case tuple() | list():
            return [told(one) for one in thing]
        case set() | frozenset():
            return sorted(map(str, thing))
        case _:
            return getattr(thing, "name", thing)


def read_and_told(text: str) -> Any:
    form, notes = read(text)
    routines = [(one.name, told(one.nodes), told(one.handlers)) for one in form.all]
    return routines, told(form.values), told(form.sizes), sorted((one.position, one.text) for one in notes.problems)


NEVER = re.compile("(?!)")
WORD_BY_WORD = re.compile(syntax.WORD.pattern.replace(syntax.LIST, "(?!)"), syntax.WORD.flags)
"""Words without lists of numbers as one."""


@given(
    st.lists(st.sampled_from(PIECES), max_size=30).map(lambda pieces: "MODULE m PROC p() " + "".join(pieces))
    | generators.map(lambda rng: generate(rng).sources[0].text)
)
def test_what_is_read_at_once_means_the_same_word_by_word(text):
    at_once = read_and_told(text)
    with patch.object(parser, "_PLAIN", NEVER), patch.object(lower, "_MOVE", NEVER):
        assert read_and_told(text) == at_once
        with patch.object(syntax, "WORD", WORD_BY_WORD):
            again = read_and_told(text)
    assert again[1:] == at_once[1:]
    assert [(name, _motions(nodes)) for name, nodes, _ in again[0]] == [
        (name, _motions(nodes)) for name, nodes, _ in at_once[0]
    ]


def _motions(nodes: Any) -> list[Any]:
    """Motions among what was told of nodes: text that is not understood has other words."""
    if isinstance(nodes, list):
        return [motion for node in nodes for motion in _motions(node)]
    if isinstance(nodes, tuple):
        return [nodes] if nodes[:1] == ("MoveInstruction",) else [motion for node in nodes for motion in _motions(node)]
    return []


def test_motions_that_differ_in_their_targets_share_the_rest():
    lines = [
        "MoveL [[1,2,3],[4]] , v5,\n z1,tool0\\WObj:=w;",
        "MoveL p , v5,\n z1,tool0\\WObj:=w;",
        "MoveL Offs(p,1,2,3),v5,z1,tool0;",
        "MoveL p!c\n,v5,z1,tool0;",
        "MoveL p,v5,z1,tool0\\WObj:=a{1};",
    ]
    data = "PERS wobjdata w;PERS wobjdata a{1};VAR robtarget p;"
    form, _ = read(f"MODULE m {data} PROC p1() {' '.join(lines)} ENDPROC ENDMODULE")
    found = [line for line in form.procedures[0].lines if isinstance(line, MoveInstruction)]
    assert [line.shared for line in found] == [True, True, False, True, False]
    assert found[0].settings is found[1].settings


# Statements of a module in the one form.


def test_the_nodes_of_a_routine():
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
    form, notes = read(text)
    assert not notes.problems
    (scope,) = {id(one.scope.types): one.scope for one in form.modules}.values()
    assert scope.types["pair"] == (("a", "num"), ("b", "robtarget"))
    assert [symbol.name for one in form.modules for symbol in one.declared] == ["n"]
    function, main, trap = form.procedures
    assert [(p.name.text, p.optional, p.changed) for p in function.given] == [
        ("x", False, False), ("y", True, False), ("z", False, False), ("p", False, True),
    ]  # fmt: skip
    assert [type(node) for node in main.nodes] == [Branches, Loop, Loop, Branches]
    assert [len(handler) for handler in main.handlers] == [1, 1]
    assert isinstance(trap.nodes[0].line, Reading)


# Words of RAPID: each stands where it says, and nothing but blanks, comments and the header lies between them.


pieces = st.sampled_from(
    ["MoveL", "p1", "10", "0x1F", "1.5E-3", ":=", "<=", "[", ",", '"a ""b"" !c"', "!x\n", " ", "\n", "\\"]
)


@given(
    st.lists(pieces, max_size=20).map("".join)
    | st.text(max_size=40)
    | generators.map(lambda rng: generate(rng).sources[0].text)
)
def test_words_and_blanks_make_up_the_text(text):
    """Words stand where they say and only blanks and comments lie between."""
    position = 0
    for token in (*tokenize(text), Token("end", "", len(text))):
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
    (token,) = tokenize(text)
    assert token.kind == "number"
    assert number(token.text) == value


def test_letter_case_counts_in_strings_only():
    """Letter case counts in strings only and a header has no words."""
    name, text = tokenize('%%%\n VERSION:1\n%%%\nMoveL "Abc"')
    assert (name.text, syntax.key_of(name)) == ("MoveL", "movel")
    assert (text.kind, text.text) == ("text", '"Abc"')


# Expressions, however deep.


@pytest.mark.parametrize(
    "body",
    [
        "x:=" + "(" * 5000,
        "x:=" + "-" * 5000 + "1;",
        "x:=1" + "+1" * 5000 + ";",
        "x:=" + "(" * 9 + "1" + ("+1" * 50 + ")") * 9 + ";",
        "x:=" + "[" * 5000 + "]" * 5000 + ";",
        "x:=a{" + "a{" * 5000,
        "x:=f(" + "f(" * 5000,
        "Set " + "f(\\a:=" * 5000,
        "IF a THEN " * 5000,
        "IF a " * 5000 + "Stop;",
    ],
)
def test_deep_nesting_is_reported(body):
    program = read_rapid([module(body)])
    assert any(f"nested deeper than {MAX_DEPTH}" in diagnostic.text for diagnostic in program.diagnostics)


# Modules that hold far more of something than any program are refused, and named are file, line, count and remedy.


@pytest.mark.parametrize(
    ("bound", "text", "line", "said"),
    [
        ("words", "CONST num a{9}:=\n" + "[1,[2]],\n" * 9, 2, "20 words in the statement that begins here"),
        ("values", "CONST num a{30}:=[" + "[1],\n" * 30, 20, "20 values"),
        ("statements", "VAR num a;\n" * 30, 22, "20 statements and declarations"),
        ("problems", "PROC p()\n" + "1;\n" * 30, 3, "at more than 20 places"),
        ("passed over", "PROC p()\n" + "<a>\n" * 30, 9, "in more than 20 words"),
        ("routines", "PROC p() ENDPROC\n" * 30, 21, "20 modules and routines"),
        ("arguments", "PROC p()\nF " + "1,\n" * 30 + "1;\n", 23, "20 arguments in one call"),
    ],
)
def test_oversized_programs_are_refused_by_name(bound, text, line, said, tmp_path, monkeypatch):
    """More of something than any program has is refused by name."""
    whole = f"MODULE M\n{text}\nENDMODULE\n"
    monkeypatch.setitem(parser.LIMITS, bound, (20, parser.LIMITS[bound][1]))
    with pytest.raises(FileError) as refused:
        read_rapid([Source.of(tmp_path / "part.mod", whole.encode())])
    assert refused.value.line == line, refused.value
    assert str(tmp_path / "part.mod") in str(refused.value)
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("name", "write"), list(modules(2000)), ids=lambda value: value if isinstance(value, str) else ""
)
def test_a_small_module_of_the_same_is_read_or_refused(name, write, tmp_path):
    content = io.BytesIO()
    write(content)
    text = content.getvalue()
    # its beginning and its end, as one block is far longer
    with contextlib.suppress(FileError):
        assert not read_rapid([Source.of(tmp_path / "part.mod", text[:3000] + b"\nENDMODULE\n")]).motions


@pytest.mark.parametrize("blanks", ["", " ", "\n", "\t \r\n"])
def test_list_of_numbers_holds_each_with_its_place(blanks):
    """A list of numbers holds what each of them says where it stands."""
    numbers = ["0", "-0", "+.5", "- 1.5E-3", "12.", "9E+09"]
    text = (
        "MODULE M\nCONST num a{6}:=[" + ",".join(f"{blanks}{number}{blanks}" for number in numbers) + "];\nENDMODULE\n"
    )
    slow = text.replace("[", "[!\n")
    plain, whole = written(text), written(slow)
    assert (plain.is_literal, plain.is_nested, whole.is_literal) == (True, False, False)
    values = [repr(value) for _, _, value in whole.leaves()]
    assert [repr(value) for value in plain.values] == [repr(value) for _, _, value in plain.leaves()] == values
    assert [text[start:end] for start, end, _ in plain.leaves()] == numbers
    assert [slow[start:end] for start, end, _ in whole.leaves()] == numbers


def written(text: str) -> AggregateText:
    """The list of a module's only data, of which all is understood."""
    notes = Notes(Source.of(Path("part.mod"), text.encode()))
    (module,) = parse(notes)
    assert not notes.problems
    (declaration,) = module.declarations
    assert declaration.literal is not None
    return declaration.literal.value.origin.literal


@pytest.mark.parametrize("blanks", ["", " ", "\n\t"])
def test_target_of_numbers_is_the_same_as_word_by_word(blanks):
    target = "[[1,-2.5,3E2],[1,0,0,0],[0,-1,- 1,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
    target = target.replace(",", f"{blanks},{blanks}").replace("[", f"[{blanks}").replace("]", f"{blanks}]")
    text = f"MODULE M\nCONST robtarget p:={target};\nENDMODULE\n"
    slow = text.replace("[", "[!\n")
    one, two = written(text), written(slow)
    assert (one.is_literal, one.is_nested, two.is_literal) == (True, True, False)
    values = [value for _, _, value in two.leaves()]
    assert [value for part in one.values for value in part] == [value for _, _, value in one.leaves()] == values
    assert [text[a:b] for a, b, _ in one.leaves()] == [slow[a:b] for a, b, _ in two.leaves()]
    assert text[one.start : one.end] == target
