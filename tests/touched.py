"""Files of tests that a change touches, for pytest's command line: `python -m tests.touched`; all of them where it cannot tell.

The change is against where this branch left the main one; on the main one itself, against the commit before. A file of tests is
touched where it changed, or imports what changed, at once or through other modules and the settings of its folder.
"""

import re
import subprocess
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).parents[1]
MAIN = ("origin/main", "origin/master", "main", "master")
PREFIX = re.compile(r"(\w+\.)+")
"""A text to which the name of a module is added before it is loaded."""
IMPORT = re.compile(r"^[ \t]*import (.+)", re.MULTILINE)
FROM = re.compile(r"^[ \t]*from (\.*)([\w.]*) import (\([^)]*\)|.+)", re.MULTILINE)
QUOTED = re.compile(r"""["']([\w.]+)(?=[:"'{])""")
READ_PAGES = ("tests/examples", "tests/realdata")
"""Folders of tests that read pages of the documentation."""


def changed_files() -> set[str] | None:
    """Files from the root that differ, those not committed yet among them; None where git cannot tell."""
    try:
        head = _git("rev-parse", "HEAD")
        bases = [_git("merge-base", "HEAD", name) for name in MAIN if _git("branch", "--all", "--list", f"*{name}")]
        base = next((base for base in bases if base != head), None) or _git("rev-parse", "HEAD~1")
        return {
            *_git("diff", "--name-only", base).split("\n"),
            *_git("ls-files", "-o", "--exclude-standard").split("\n"),
        } - {""}
    except (OSError, subprocess.CalledProcessError):
        return None


def _git(*arguments: str) -> str:
    return subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()


def touched_tests(changed: Iterable[str] | None, imports: Mapping[str, set[str]]) -> list[str]:
    """Files or folders of tests, from the root.

    Args:
        changed: files from the root; None where that is not known.
        imports: for each module's file the files of the modules that it needs.
    """
    if changed is None:
        return ["tests"]
    pages = {file for file in changed if file.endswith(".md")}
    reached = set(changed) - pages
    shared = ("__init__.py", "conftest.py", "touched.py")
    if any(file not in imports or file.endswith(shared) or file.count("/") < 2 for file in reached):
        return ["tests"]
    while more := {file for file, needed in imports.items() if file not in reached and needed & reached}:
        reached |= more
    tests = {file for file in reached if file.startswith("tests/") and "/test_" in file and (ROOT / file).is_file()}
    return sorted(tests.union(READ_PAGES if pages else ()))


def imports_of_files() -> dict[str, set[str]]:
    """For each module of the sources and the tests the files of those that it names, from the root."""
    files = dict(_modules())
    return {str(path.relative_to(ROOT)): _needed(path, files) for path in files.values()}


def _modules() -> Iterator[tuple[str, Path]]:
    for folder, above in (("src", "src"), ("tests", "."), ("benchmarks", "."), ("docs", "."), ("examples", "examples")):
        for path in sorted((ROOT / folder).rglob("*.py")):
            parts = path.relative_to(ROOT / above).with_suffix("").parts
            yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), path


def _needed(path: Path, files: Mapping[str, Path]) -> set[str]:
    """Those that its imports and its texts name; a package whose names load late names them in its stub."""
    source = path.with_suffix(".pyi") if path.with_suffix(".pyi").is_file() else path
    text = source.read_text(encoding="utf-8")
    named = {name for names in IMPORT.findall(text) for name in re.findall(r"[\w.]+", names)}
    for dots, module, names in FROM.findall(text):
        above = path.relative_to(ROOT / "src" if path.is_relative_to(ROOT / "src") else ROOT).parts[
            : -len(dots) or None
        ]
        whole = ".".join([*above, *module.split(".")] if dots and module else above if dots else [module])
        named |= {whole, *(f"{whole}.{name}" for name in re.findall(r"\w+", names))}
    for name in QUOTED.findall(text):  # loaded by name, or started
        if name in files:
            named.add(name)
        elif PREFIX.fullmatch(name):
            named |= {other for other in files if other.startswith(name)}
    if path.is_relative_to(ROOT / "src"):
        named -= {"taskcal"}  # inside the package nothing is imported from its root but the version
    needed = {str(files[name].relative_to(ROOT)) for name in named if name in files}
    settings = [path.parent / "conftest.py", path.parents[1] / "conftest.py"]
    needed |= {str(file.relative_to(ROOT)) for file in settings if file.is_file() and file.parent != ROOT / "tests"}
    return needed - {str(path.relative_to(ROOT))}


if __name__ == "__main__":
    print(*touched_tests(changed_files(), imports_of_files()))
