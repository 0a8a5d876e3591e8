"""Which tests run a line, the nearest and quickest first, as a run of all tests with coverage saw it."""

import ast
import random
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from coverage import CoverageData

MIN_SECONDS = 0.005
"""Seconds that a test takes of which nothing else is known."""


@dataclass(frozen=True)
class CoveringTests:
    """Tests of every line, and how long each takes.

    Attributes:
        by_line: of every module, from the folder of the repository, the tests that run each line.
        seconds: of every test.
        importing: of every module, those that import it.
    """

    by_line: dict[Path, dict[int, frozenset[str]]]
    seconds: dict[str, float]
    importing: dict[Path, frozenset[Path]]

    def of(self, path: Path, line: int, *, longest: float) -> list[str]:
        """Tests that may notice a change of a line; those of its own folder first, of ever other files.

        A kernel runs as machine code, in which no lines are seen: it is left to the tests of what imports it, of its folder and of
        those above it.

        Args:
            path: the module, from the folder of the repository.
            line: of the change.
            longest: seconds that all of them may take.
        """
        seen = self.by_line.get(path, {})
        tests = seen.get(line, frozenset())
        if not tests:
            near = {path.parts[2], *(("kinematics", "robot", "identification") if path.parts[2] == "geometry" else ())}
            tests = frozenset(test for test in self.seconds if _file(test).parts[1] in near)
        modules = {path} if seen.get(line) else {path, *self.importing.get(path, ())}
        own = [test for test in tests if _file(test).stem in {f"test_{module.stem}" for module in modules}]
        near = [test for test in tests.difference(own) if _file(test).parts[1] == path.parts[2]]
        rest = sorted(tests.difference(own, near))
        chosen: list[str] = []
        for part in (own, near, rest):
            left = longest - sum(self.seconds.get(test, MIN_SECONDS) for test in chosen)
            chosen += self._quick(_in_turns(sorted(part)), left)
        return chosen

    def _quick(self, tests: Iterable[str], longest: float) -> list[str]:
        out: list[str] = []
        for test in tests:
            longest -= self.seconds.get(test, MIN_SECONDS)
            if longest < 0:
                break
            out.append(test)
        return out


def _file(test: str) -> Path:
    return Path(test.partition("::")[0])


def _in_turns(tests: Sequence[str]) -> list[str]:
    """One of every file, then another of every file, and so on."""
    files: dict[str, list[str]] = defaultdict(list)
    for test in tests:
        files[test.partition("::")[0]].append(test)
    order = [(place, file, test) for file, of_file in files.items() for place, test in enumerate(_shuffled(of_file))]
    return [test for _, _, test in sorted(order)]


def _shuffled(tests: Sequence[str]) -> list[str]:
    return random.Random(len(tests)).sample(tests, len(tests))


def read_covering_tests(root: Path) -> CoveringTests:
    """What `make coverage` left: its data, with a context for each test, and the times that pytest printed.

    Raises:
        FileNotFoundError: it was not run.
    """
    data = CoverageData(basename=str(root / ".coverage"))
    data.read()
    if not data.measured_files():
        raise FileNotFoundError("no coverage with contexts: run make coverage first")
    by_line: dict[Path, dict[int, frozenset[str]]] = {}
    for file in data.measured_files():
        _, package, module = file.rpartition("src/taskcal/")
        lines = data.contexts_by_lineno(file)
        by_line[Path(f"{package}{module}")] = {
            line: frozenset(context.rpartition("|")[0] for context in contexts if context)
            for line, contexts in lines.items()
        }
    cases = ElementTree.parse(root / "build" / "coverage" / "tests.xml").iter("testcase")
    seconds = {
        f"{case.attrib['classname'].replace('.', '/')}.py::{case.attrib['name']}": float(case.attrib["time"])
        for case in cases
    }
    return CoveringTests(by_line, seconds, _importing(root))


def _importing(root: Path) -> dict[Path, frozenset[Path]]:
    out: dict[Path, set[Path]] = defaultdict(set)
    for path in (root / "src" / "taskcal").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                imported = Path("src", *node.module.split(".")).with_suffix(".py")
                out[imported].add(path.relative_to(root))
    return {path: frozenset(paths) for path, paths in out.items()}
