"""Expressions, however deep."""

import pytest

from robot_programs.rapid.parse import MAX_DEPTH
from robot_programs.rapid.read import read_rapid
from tests.robot_programs.rapid.samples import module


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
