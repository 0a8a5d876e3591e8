"""Examples and pages use public names only: what they import and what they call is on the list."""

import ast
import re
import textwrap
from importlib import import_module
from pathlib import Path

import pytest

import taskcal

ROOT = Path(__file__).parents[2]
NAMESPACES = {f"taskcal.{name}" for name in set(dir(taskcal)) - set(taskcal.__all__) - {"__version__"}}
SOURCES = [
    *sorted((ROOT / "examples").glob("*.py")),
    # the pages of commands and names are made from the command line and the package themselves, the gallery by its commands
    *(
        path
        for path in sorted((ROOT / "docs").glob("*.py"))
        if path.name not in ("api_pages.py", "command_pages.py", "draw_gallery.py")
    ),
]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^( *)```python\n(.*?)^ *```", re.DOTALL | re.MULTILINE)
SPAN = re.compile(r"`(?:tc|taskcal)((?:\.\w+)+)")
FILES = (".py", ".csv", ".toml", ".mod")


def public_names(module: str) -> set[str]:
    return {name for name in dir(import_module(module)) if not name.startswith("_")} | {"__version__"}


def not_public(code: str) -> list[str]:
    """Imports from below the public namespaces, and attributes that neither `tc` nor its namespaces offer."""
    tree = ast.parse(textwrap.dedent(code))
    wrong: list[str] = []
    roots = set[str]()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name == "taskcal":
                    roots.add(alias.asname or "taskcal")
                elif alias.name.startswith("taskcal.") and alias.name not in NAMESPACES:
                    wrong.append(alias.name)
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "taskcal":
            module = node.module or ""
            if module != "taskcal" and module not in NAMESPACES:
                wrong.append(module)
            else:
                wrong += [f"{module}.{alias.name}" for alias in node.names if alias.name not in public_names(module)]
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            path = ast.unparse(node)
            if path.split(".")[0] in (roots or {"tc"}) and re.fullmatch(r"[\w.]+", path):
                wrong += missing(path.split(".")[1:])
    return wrong


def missing(path: list[str]) -> list[str]:
    """The name that is not public on the way along `tc.a.b`, if there is one."""
    if path[0] not in public_names("taskcal"):
        return [".".join(path)]
    inside = f"taskcal.{path[0]}" in NAMESPACES and len(path) > 1
    return [".".join(path)] if inside and path[1] not in public_names(f"taskcal.{path[0]}") else []


def not_public_of_page(page: Path) -> list[str]:
    """The same in the blocks of code of a page, and in its sentences."""
    text = page.read_text(encoding="utf-8")
    wrong = [name for _, code in BLOCK.findall(text) for name in not_public(code)]
    if page.name != "CONTRIBUTING.md" and "decisions" not in page.parts:
        named = [span for span in SPAN.findall(BLOCK.sub("", text)) if not span.endswith(FILES)]
        wrong += [name for span in named for name in missing(span[1:].split("."))]
    return wrong


def test_an_example_uses_public_names_only() -> None:
    assert [(path.stem, name) for path in SOURCES for name in not_public(path.read_text(encoding="utf-8"))] == []


def test_a_page_uses_public_names_only() -> None:
    assert [(str(page.relative_to(ROOT)), name) for page in PAGES for name in not_public_of_page(page)] == []


@pytest.mark.parametrize(
    ("code", "wrong"),
    [
        ("from taskcal.reading.writer import write_campaign", ["taskcal.reading.writer"]),
        ("import taskcal.robot.effects", ["taskcal.robot.effects"]),
        (f"from taskcal.effects import {'Effct'}", ["taskcal.effects.Effct"]),
        ("import taskcal as tc\ntc.Backlash()", ["Backlash"]),
        ("import taskcal as tc\ntc.effects.Nothing()", ["effects.Nothing"]),
        ("import taskcal as tc\ntc.effects.Backlash(); tc.plan(model)", []),
        ("from robot_programs import Frame", []),
    ],
)
def test_what_is_not_public_is_found(code: str, wrong: list[str]) -> None:
    assert not_public(code) == wrong
