"""What a folder shows, and for whom a module is there."""

import ast
import re
from collections import defaultdict
from functools import cache
from pathlib import Path

from taskcal.observations import kinds

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = [*sorted(path for path in (ROOT / "src").iterdir() if path.is_dir()), ROOT / "examples" / "taskcal_demo"]
MODULES = {
    ".".join(path.relative_to(package.parent).with_suffix("").parts): path
    for package in PACKAGES
    for path in sorted(package.rglob("*.py"))
    if path.name != "__init__.py"
}
MAX_FILES = 20
"""That a folder shows: what a person takes in at one look."""
MANY_ALIKE = {
    "taskcal.cli.commands": "one file for each command",
    "taskcal_studio.pages": "one file for each page, and for an editor on one",
}
"""Folders that may show more, and whose files need no second importer."""
ONE_IMPORTER = {
    "a step of its own in the way of a file, or of a fit": {
        "robot_programs.apt.rewrite",
        "robot_programs.core.folded",
        "robot_programs.krl.meaning",
        "robot_programs.krl.rewrite",
        "robot_programs.tp.meaning",
        "taskcal.correction.run_time",
        "taskcal.correction.subdivision",
        "taskcal.cli.options.fit",
        "taskcal.diagnosis.drift",
        "taskcal.diagnosis.images",
        "taskcal.identification.group_search",
        "taskcal_devices.abb",
        "taskcal.observations.flatness",
        "taskcal.planning.experiment",
        "taskcal.reading.inference",
        "taskcal.reading.orientations",
        "taskcal.reading.unnamed",
        "taskcal_studio.server",
    },
    "one of many alike, which a table names": {
        "taskcal_devices.folder",
        "taskcal.live.hand",
        "taskcal_devices.natnet",
        "taskcal_devices.opcua",
        "taskcal_devices.ros",
        "taskcal_devices.rsi",
        "taskcal_devices.rtde",
        "taskcal_devices.tcp",
        "taskcal.live.virtual",
        "taskcal.robot.importers.mjcf",
        "robot_programs.apt.read",
        "robot_programs.csv_path.read",
        "robot_programs.krl.read",
        "robot_programs.rapid.read",
        "robot_programs.rapid.rewrite",
        "robot_programs.tp.read",
        "robot_programs.urscript.read",
        "robot_programs.urscript.rewrite",
        "taskcal.tables.reports",
        "taskcal.tables.spreadsheet",
        "taskcal_studio.command",
    },
    "the page of one subject": {
        "taskcal.report.certificate",
        "taskcal.report.fleet",
        "taskcal.report.performance",
        "taskcal.report.placement",
        "taskcal.report.selection",
        "taskcal.report.study",
    },
    "arithmetic that knows no robot": {
        "taskcal.estimation.trimmed_squares",
        "taskcal.geometry.polyline",
    },
    "entered by name": {"robot_programs.__main__", "taskcal.__main__", "taskcal.effects", "taskcal.performance"},
}
"""Modules that fewer than two others import and that have no public name, by the reason for which they are there."""


@cache
def imported(path: Path) -> set[str]:
    """Modules that a file imports, wherever it does so; by its lines, for syntax trees of all files take seconds."""
    found: set[str] = set()
    text = path.read_text(encoding="utf-8")
    for module, names in re.findall(r"^[ \t]*from ([\w.]+) import (\([^)]*\)|.*)", text, re.MULTILINE):
        found |= {module, *(f"{module}.{name}" for name in re.findall(r"\w+", names))}
    for names in re.findall(r"^[ \t]*import (.*)", text, re.MULTILINE):
        found |= set(re.findall(r"[\w.]+", names))
    return found & set(MODULES)


def test_folders_show_few_files() -> None:
    """A folder shows at most twenty modules, unless it holds many of one kind."""
    shown = defaultdict(int)
    for module in MODULES:
        shown[module.rpartition(".")[0]] += 1
    assert len(shown) > 20
    assert {folder: count for folder, count in shown.items() if count > MAX_FILES}.keys() <= MANY_ALIKE.keys()


def test_modules_have_two_importers_or_a_reason() -> None:
    """A module that one other imports belongs to it, unless users import from it or a reason is given here."""
    importers: dict[str, set[str]] = defaultdict(set)
    for module, path in MODULES.items():
        for other in imported(path):
            importers[other].add(module)
    doors = [path for package in PACKAGES for path in package.rglob("__init__.py*")]
    public = set().union(*(imported(path) for path in doors))
    alone = {
        module
        for module in MODULES
        if len(importers[module]) < 2 and module not in public and module.rpartition(".")[0] not in MANY_ALIKE
    }
    reasoned = set().union(*ONE_IMPORTER.values())
    assert alone == reasoned


WHOLE = {
    "CORNER_COLUMNS[:5]": "columns that a file needs, of more that it may have",
    "usual[:3]": "what a line looks like",
}
"""Beginnings of rows of texts that messages name, and that are no list cut short."""


def test_no_message_cuts_a_list_in_silence():
    """Where a list is joined into words, `listed` cuts it, which says how many more there are."""
    silent: list[str] = []
    for name, path in MODULES.items():
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            match call:
                case ast.Call(func=ast.Attribute(value=ast.Constant(value=", " | "; "), attr="join"), args=[joined]):
                    cut = (
                        ast.unparse(part)
                        for part in ast.walk(joined)
                        if isinstance(part, ast.Subscript)
                        and isinstance(part.slice, ast.Slice)
                        and part.slice.lower is None
                        and isinstance(part.slice.upper, ast.Constant | ast.Name)
                    )
                    silent += [f"{name}:{call.lineno}: {text}" for text in cut if text not in WHOLE]
                case _:
                    pass
    assert not silent, "\n".join(silent)


def test_planning_has_no_rows_of_its_own():
    """What a plan foresees, and parameters are chosen by, are rows and noise of a fit: `problem_of` makes them."""
    for name, path in MODULES.items():
        if name.startswith("taskcal.planning."):
            text = path.read_text(encoding="utf-8")
            assert not re.findall(r"\.(?:differentiate|covariances)\(", text), name
    assert "problem_of(" in MODULES["taskcal.planning.experiment"].read_text(encoding="utf-8")


def test_kinds_are_asked_not_told_apart_outside_observations():
    """What differs from kind to kind is a question that a kind answers: another package's kind is served as the project's own."""
    told, kind = list[str](), re.compile(rf"\b({'|'.join(one.__name__ for one in kinds())})\b")
    for name, path in MODULES.items():
        if name.startswith("taskcal") and not name.startswith("taskcal.observations."):
            for call in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                match call:
                    case ast.Call(func=ast.Name(id="isinstance"), args=[_, asked]):
                        told += [f"{name}:{call.lineno}"] if kind.search(ast.unparse(asked)) else []
                    case _:
                        pass
    assert not told, "\n".join(told)


NAMESAKES = {"Frame", "Instrument", "Measured", "Plan", "Program", "Robot", "Source", "Wanted"}
"""Names of two classes, of which each is public in its package, or is asked for by a compiled kernel or a device's protocol."""


def test_class_names_stand_once():
    where = defaultdict[str, list[str]](list)
    for name, path in MODULES.items():
        if not name.startswith("taskcal_demo."):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ClassDef):
                    where[node.name].append(name)
    twice = {name: modules for name, modules in where.items() if len(modules) > 1}
    assert twice.keys() == NAMESAKES, twice
    assert all(len(modules) == 2 for modules in twice.values())
