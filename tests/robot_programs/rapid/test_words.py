"""Modules that hold far more of something than any program are refused, and named are file, line, count and remedy."""

import contextlib
import io

import pytest

from robot_programs.core.source import Source
from robot_programs.rapid import parse as expressions
from robot_programs.rapid import parse as parser
from robot_programs.rapid import parse as statements
from robot_programs.rapid import syntax as words
from robot_programs.rapid.read import read_rapid
from taskcal.errors import FileError
from tests.readers.rapid_modules import modules


def read(tmp_path, text):
    return read_rapid([Source.of(tmp_path / "part.mod", text.encode())])


@pytest.mark.parametrize(
    ("module", "bound", "text", "line", "said"),
    [
        (words, "MAX_WORDS", "CONST num a{9}:=\n" + "[1,[2]],\n" * 9, 2, "20 words in the statement that begins here"),
        (words, "MAX_VALUES", "CONST num a{30}:=[" + "[1],\n" * 30, 20, "20 values"),
        (statements, "MAX_STATEMENTS", "VAR num a;\n" * 30, 22, "20 statements and declarations"),
        (statements, "MAX_PROBLEMS", "PROC p()\n" + "1;\n" * 30, 3, "at more than 20 places"),
        (statements, "MAX_UNPARSED_WORDS", "PROC p()\n" + "<a>\n" * 30, 9, "in more than 20 words"),
        (parser, "MAX_ROUTINES", "PROC p() ENDPROC\n" * 30, 21, "20 modules and routines"),
        (expressions, "MAX_ARGUMENTS", "PROC p()\nF " + "1,\n" * 30 + "1;\n", 23, "20 arguments in one call"),
    ],
)
def test_oversized_programs_are_refused_by_name(module, bound, text, line, said, tmp_path, monkeypatch):
    """More of something than any program has is refused by name."""
    whole = f"MODULE M\n{text}\nENDMODULE\n"
    monkeypatch.setattr(module, bound, 20)
    with pytest.raises(FileError) as refused:
        read(tmp_path, whole)
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
    ((module,), problems), ((other,), others) = parser.parse(text), parser.parse(slow)
    assert not problems
    assert not others
    plain, whole = module.declarations[0].value, other.declarations[0].value
    assert (plain.is_plain, whole.is_plain) == (True, False)
    assert [repr(n.value) for n in plain.items] == [repr(n.value) for n in whole.items]
    assert [text[n.start : n.end] for n in plain.items] == numbers
    assert plain.numbers == tuple(n.value for n in whole.items)
    assert plain.count == len(numbers)


@pytest.mark.parametrize("blanks", ["", " ", "\n\t"])
def test_target_of_numbers_is_the_same_as_word_by_word(blanks):
    target = "[[1,-2.5,3E2],[1,0,0,0],[0,-1,- 1,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
    target = target.replace(",", f"{blanks},{blanks}").replace("[", f"[{blanks}").replace("]", f"{blanks}]")
    text = f"MODULE M\nCONST robtarget p:={target};\nENDMODULE\n"
    slow = text.replace("[", "[!\n")
    ((module,), problems), ((other,), others) = parser.parse(text), parser.parse(slow)
    assert not problems
    assert not others
    one, two = module.declarations[0].value, other.declarations[0].value
    assert (one.is_literal, one.is_plain, two.is_literal) == (True, False, False)
    assert one.values == tuple(tuple(n.value for n in inner.items) for inner in two.items)
    spelled = [[text[n.start : n.end] for n in inner.items] for inner in one.items]
    assert spelled == [[slow[n.start : n.end] for n in inner.items] for inner in two.items]
    assert text[one.start : one.end] == target
