"""Where options are declared."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from typer.main import get_command

import taskcal
from taskcal.cli import app
from taskcal_studio.project import Choices
from taskcal_studio.stated_options import GROUPS, NO_FIELDS, offered

SOURCE = Path(taskcal.__file__).parents[1]


def test_a_module_of_options_imports_no_numpy() -> None:
    """A wrong option is refused before what takes a second to import."""
    modules = {".".join(path.relative_to(SOURCE).with_suffix("").parts) for path in SOURCE.rglob("options.py")}
    assert "taskcal_groundwork.options" in modules
    assert "taskcal.planning.options" in modules
    line = f"import sys, {', '.join(sorted(modules))}; print('numpy' in sys.modules)"
    ended = subprocess.run([sys.executable, "-c", line], capture_output=True, text=True, check=True, timeout=60)
    assert ended.stdout.strip() == "False"


def test_what_a_command_has_and_its_page_lacks_is_listed_with_the_reason() -> None:
    """Every option of a command is asked for by its form, or listed beside the forms, once."""
    commands: Any = get_command(app)
    for command in GROUPS:
        names = [one.opts[0].lstrip("-") for one in commands.commands[command].params]
        left_out = [name for some in NO_FIELDS[command].values() for name in some]
        assert sorted([*offered(command), *left_out]) == sorted(names), command
        assert all(one.option.help for one in offered(command).values())


def bounds_beside_declarations(source: str) -> Iterator[str]:
    """Options that a class compares with a number by itself, though it declares them."""
    for kind in (one for one in ast.walk(ast.parse(source)) if isinstance(one, ast.ClassDef)):
        own = {
            one.target.id for one in kind.body if isinstance(one, ast.AnnAssign) and isinstance(one.target, ast.Name)
        }
        bodies = [one for one in kind.body if isinstance(one, ast.FunctionDef) and one.name == "__post_init__"]
        for test in (one.test for body in bodies for one in ast.walk(body) if isinstance(one, ast.If)):
            parts = list(ast.walk(test))
            about = {one.attr for one in parts if isinstance(one, ast.Attribute) and one.attr in own}
            others = {one.id for one in parts if isinstance(one, ast.Name)} - {"self"}
            numbers = [one for one in parts if isinstance(one, ast.Constant) and type(one.value) in (int, float)]
            if numbers and len(about) == 1 and not others and any(isinstance(one, ORDER) for one in parts):
                yield f"{kind.name}.{about.pop()}"


ORDER = (ast.Lt, ast.LtE, ast.Gt, ast.GtE)


def test_the_bounds_of_an_option_stand_in_one_place() -> None:
    """With its declaration: no group compares a number by itself, no command asks its parser, no page has bounds of its own."""
    wrong: list[str] = []
    for path in SOURCE.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        of_options = path.name == "options.py" or "cli" in path.parts
        wrong += [f"{path.name}: {one}" for one in bounds_beside_declarations(text)] if of_options else []
        if "cli" in path.parts and path.name != "command.py":
            wrong += [
                f"{path.name}: {one}" for one in ("min=", "max=", "click.IntRange", "FloatRange") if f"{one}" in text
            ]
    assert list(bounds_beside_declarations(EXAMPLE)) == ["Wrong.count"]
    assert wrong == []
    kept = Choices.model_json_schema()["properties"].items()
    assert [name for name, one in kept if {"minimum", "maximum", "exclusiveMinimum"} & one.keys()] == []


EXAMPLE = """
class Wrong:
    count: int = 3
    share: float = 0.5
    def __post_init__(self):
        if self.count < 1:
            raise ValueError
        if self.count > 1 and self.share:
            raise ValueError
"""
