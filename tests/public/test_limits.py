"""What is read at one go fits on a screen: bodies of functions, lists of parameters, modules."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = sorted((ROOT / "src" / "taskcal").rglob("*.py"))
TESTS = sorted((ROOT / "tests").rglob("*.py"))

BODY_LINES = 60
"""Of a function, without its docstring."""
PARAMETERS = 8
"""Of a function, without self or cls."""
MODULE_LINES = 350

Function = ast.FunctionDef | ast.AsyncFunctionDef


def body_lines(function: Function) -> int:
    first, *others = function.body
    documented = (
        isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and isinstance(first.value.value, str)
    )
    body = others if documented else function.body
    return function.end_lineno - body[0].lineno + 1 if body and function.end_lineno else 0


def parameters(function: Function) -> int:
    arguments = function.args
    named = [a.arg for a in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)]
    bound = bool(named) and named[0] in {"self", "cls"}
    return len(named) + (arguments.vararg is not None) + (arguments.kwarg is not None) - bound


def functions(text: str) -> list[Function]:
    return [node for node in ast.walk(ast.parse(text)) if isinstance(node, Function)]


def test_lines_and_parameters_are_counted_without_docstring_and_self() -> None:
    text = """
class A:
    def f(self, a, /, b, *c, d=1, **e):
        '''One.

        Two.
        '''
        x = 1

        return x
"""
    (function,) = functions(text)
    assert (body_lines(function), parameters(function)) == (3, 5)


@pytest.mark.parametrize(("measure", "most"), [(body_lines, BODY_LINES), (parameters, PARAMETERS)])
def test_functions_are_short(measure, most: int) -> None:
    found = {
        f"{path.relative_to(ROOT)}:{function.lineno} {function.name}": measure(function)
        for path in SOURCES
        for function in functions(path.read_text(encoding="utf-8"))
    }
    assert len(found) > 1000
    assert {where: size for where, size in found.items() if size > most} == {}


def test_modules_are_short() -> None:
    lines = {
        str(path.relative_to(ROOT)): len(path.read_text(encoding="utf-8").splitlines()) for path in (*SOURCES, *TESTS)
    }
    assert len(lines) > 300
    assert {path: count for path, count in lines.items() if count > MODULE_LINES} == {}
