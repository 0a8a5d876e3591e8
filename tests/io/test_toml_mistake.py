"""What is said of a text that is not TOML."""

import re
import tomllib

import pytest

from taskcal.errors import FileError
from taskcal.io.toml_file import find_mistake
from taskcal.task.task import load_task

MISTAKES = {
    "name = pocket": (1, 'text needs quotes, such as "text"'),
    "name = True": (1, "write true in small letters"),
    "name = “pocket”": (1, "write straight quotes"),
    'name = "pocket\nb = 1': (1, "no end; close it on the same line"),
    'name = "pocket': (1, "no end; close it"),
    "name = 'pocket": (1, "no end; close it"),
    "a = '''\nb": (2, "no end; close it"),
    'name: "pocket"': (1, "write = between name and value, not a colon"),
    "größe = 3": (1, "write names with the letters a to z"),
    "the size = 3": (1, "write = between name and value"),
    "a = 1\nsize_mm =": (2, "a value is missing; write one"),
    "a = 1\nsize_mm = 1,5": (2, "write a point in numbers, not a comma"),
    "size_mm = 1.5 mm": (1, "leave out 'mm'; keys name their unit"),
    "size_mm = .5": (1, "write a digit before the point, such as 0.5"),
    "size_mm = 012": (1, "leave out the zero before the number"),
    'name = "a" // pocket': (1, "write # before a comment"),
    'name = "a" pocket': (1, "leave out 'pocket', or write it on a line of its own"),
    "a = [1.0, 2.0\nb = 3": (2, "a list is not closed before this, or lacks a comma"),
    "a = [1.0, , 2.0]": (1, "a value is missing before it"),
    "a = { b = 1\nc = 2 }": (1, "braces are not closed on their line"),
    "a = 1\na = 2": (2, "'a' is given a second time"),
    "[a]\n\n[a]": (3, r"\[a\] stands here a second time"),
    "a.b = 1\n[a.b.c]": (2, r"\[a.b.c\] stands here a second time"),
    "[workspace": (1, r"write a section as \[name\]"),
    "[[workspace.orientation]": (1, r"as \[\[name\]\]"),
    'file = "C:\\parts"': (1, "for a backslash in double quotes"),
    "a = 2026-02-31": (1, "there is no such date"),
    "a = 1\n= 2": (2, "write"),
    'a = "\x07"': (1, "take out this character"),
}


@pytest.mark.parametrize("text", MISTAKES)
def test_the_line_the_place_and_what_to_write_are_said(tmp_path, text):
    line, remedy = MISTAKES[text]
    path = tmp_path / "task.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(
        FileError, match=rf"task\.toml:{line}: is not TOML: column \d+( of '.*')?: .*{remedy}"
    ) as refusal:
        load_task(path)
    with pytest.raises(tomllib.TOMLDecodeError) as of_the_parser:
        tomllib.loads(text)
    # in words of its own
    assert str(of_the_parser.value).partition(" (at")[0] not in str(refusal.value)
    assert refusal.value.line == line


OPEN = re.compile("no end|closed")
"""What the next line has a part in."""


@pytest.mark.parametrize("text", [text for text, (_, remedy) in MISTAKES.items() if not OPEN.search(remedy)])
def test_the_remedy_is_the_same_before_a_comment_and_in_a_longer_file(text):
    line, remedy = MISTAKES[text]
    rows = text.split("\n")
    rows[line - 1] += "  # of 2024, see below"
    said = []
    for written in (text, "\n".join(["# head", "", *rows])):
        with pytest.raises(tomllib.TOMLDecodeError) as error:
            tomllib.loads(written)
        said.append(find_mistake(str(error.value), written))
    assert said[1].line == said[0].line + 2
    assert re.search(remedy, said[1].said)


def test_unknown_parser_error_still_explains_toml():
    """An error with unknown wording is still explained with the form of TOML."""
    assert find_mistake("Something new (at line 2, column 3)", "a = 1\nb = 2").line == 2
    assert find_mistake("Something new", "a").line is None
    assert "name = value" in find_mistake("Something new", "a").said
