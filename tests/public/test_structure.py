"""What a folder shows, and for whom a module is there."""

import re
from collections import defaultdict
from functools import cache
from pathlib import Path

SOURCES = Path(__file__).resolve().parents[2] / "src"
MODULES = {
    ".".join(path.relative_to(SOURCES).with_suffix("").parts): path
    for path in sorted(SOURCES.rglob("*.py"))
    if path.name != "__init__.py"
}
MAX_FILES = 20
"""That a folder shows: what a person takes in at one look."""
MANY_ALIKE = {"taskcal.cli.commands": "one file for each command", "taskcal.studio.pages": "one file for each page"}
"""Folders that may show more, and whose files need no second importer."""
ONE_IMPORTER = {
    "a step of its own in the way of a file, or of a fit": {
        "robot_programs.apt.rewrite",
        "robot_programs.core.folded",
        "robot_programs.krl.computed",
        "robot_programs.rapid.computed",
        "robot_programs.urscript.computed",
        "taskcal.correction.run_time",
        "taskcal.correction.subdivision",
        "taskcal.diagnosis.drift",
        "taskcal.diagnosis.images",
        "taskcal.identification.chunked_fit",
        "taskcal.identification.group_search",
        "taskcal.live.abb",
        "taskcal.observations.flatness",
        "taskcal.planning.experiment",
        "taskcal.reading.inference",
        "taskcal.studio.cell_editor",
        "taskcal.studio.column_editor",
        "taskcal.studio.server",
    },
    "one of many alike, which a table names": {
        "taskcal.live.folder",
        "taskcal.live.hand",
        "taskcal.live.natnet",
        "taskcal.live.opcua",
        "taskcal.live.ros",
        "taskcal.live.rsi",
        "taskcal.live.rtde",
        "taskcal.live.tcp",
        "taskcal.live.virtual",
        "taskcal.robot.importers.mjcf",
        "robot_programs.apt.read",
        "robot_programs.csv_path.read",
        "robot_programs.krl.read",
        "robot_programs.rapid.read",
        "robot_programs.rapid.rewrite",
        "robot_programs.tp.read",
        "robot_programs.tp.rewrite",
        "robot_programs.urscript.read",
        "robot_programs.urscript.rewrite",
        "taskcal.robot.importers.ur",
        "taskcal.tables.spreadsheet",
    },
    "the page of one subject": {
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
    packages = SOURCES.rglob("__init__.py*")
    public = set().union(*(imported(path) for path in packages))
    alone = {
        module
        for module in MODULES
        if len(importers[module]) < 2 and module not in public and module.rpartition(".")[0] not in MANY_ALIKE
    }
    reasoned = set().union(*ONE_IMPORTER.values())
    assert alone == reasoned
