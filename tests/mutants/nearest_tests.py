"""Tests that may notice a change of a module: those that need it, the nearest first, by what files import (tests/touched.py)."""

from collections.abc import Mapping, Sequence
from pathlib import Path

APART = ("tests/mutants/", "tests/readers/", "tests/realdata/", "tests/examples/")
"""Folders whose tests are left out: of these mistakes themselves, of damaged files, of measured robots, of the documentation."""
MAX_FILES = 24
"""Files, at most, outside the module's own folder. A convention: those further off reach every module, and take minutes to load."""


def nearest_tests(path: Path, imports: Mapping[str, set[str]]) -> tuple[list[str], list[str]]:
    """Files of tests of the folder that a module lies in, and others: both the nearest first, of equally near ones the smallest.

    Args:
        path: the module, from the folder of the repository.
        imports: of every file those that it needs, from there.
    """
    steps = steps_to(str(path), imports)
    files = [file for file in steps if "/test_" in file and not file.startswith(APART)]
    own = f"tests/{package_of(path).rpartition('/')[2]}/"

    def order(file: str) -> tuple[bool, int, int, str]:
        stem = Path(file).stem.removeprefix("test_")
        return (stem != path.stem, steps[file], _bytes(file), file)

    inside = sorted((file for file in files if file.startswith(own)), key=order)
    return inside, sorted((file for file in files if not file.startswith(own)), key=order)[:MAX_FILES]


def steps_to(file: str, imports: Mapping[str, set[str]]) -> dict[str, int]:
    """Imports, at least, from each file that needs this one down to it."""
    steps, reached = {file: 0}, [file]
    for needed in reached:
        for importing in sorted(other for other, files in imports.items() if needed in files and other not in steps):
            steps[importing] = steps[needed] + 1
            reached.append(importing)
    return steps


def package_of(path: Path) -> str:
    """Of a module of `src`: `taskcal/planning`, `robot_programs`; `taskcal` for one that lies in no folder."""
    _, top, *folders, _ = path.parts
    return f"{top}/{folders[0]}" if top == "taskcal" and folders else top


def shares(count: int, weights: Mapping[str, int]) -> dict[str, int]:
    """A count given out in proportion to weights, what is left over to the largest remainders."""
    total = sum(weights.values())
    exact = {name: count * weight / total for name, weight in weights.items()}
    out = {name: int(value) for name, value in exact.items()}
    behind: Sequence[str] = sorted(exact, key=lambda name: (out[name] - exact[name], name))
    return out | {name: out[name] + 1 for name in behind[: count - sum(out.values())]}


def _bytes(file: str) -> int:
    return Path(file).stat().st_size if Path(file).is_file() else 0
