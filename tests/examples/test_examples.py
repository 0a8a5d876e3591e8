"""Every example runs as it stands, in a process of its own."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

LONG = "01_virtual_cell", "03_which_parameters", "04_what_geometry_leaves", "05_closed_loop"
ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("[0-9][0-9]_*.py"))
PAGES = ROOT / "docs/examples/index.md", ROOT / "docs/how-to/write-an-effect.md"


def documented(script: Path) -> str:
    """What a page says that a script prints: the first block of text behind the script itself."""
    for page in PAGES:
        _, shown, behind = page.read_text(encoding="utf-8").partition(f"examples/{script.name}")
        if shown and (block := re.match(r"(?:(?!\{literalinclude\}).)*?```text\n(.*?)```", behind, re.DOTALL)):
            return block[1]
    raise AssertionError(f"no page says what {script.name} prints")


def without_figures(printed: str) -> list[list[str]]:
    """Words by line, any number for any other: the last digits are the processor's."""
    return [re.sub(r"\d+(\.\d+)?", "#", line).split() for line in printed.strip().splitlines()]


def test_there_are_examples():
    assert EXAMPLES


@pytest.mark.slow
@pytest.mark.parametrize(
    "script",
    [pytest.param(path, id=path.stem, marks=[pytest.mark.long] if path.stem in LONG else []) for path in EXAMPLES],
)
def test_an_example_runs(script, tmp_path):
    done = subprocess.run(
        [sys.executable, str(script)],
        cwd=tmp_path,
        env={**os.environ, "TMPDIR": str(tmp_path), "PYTHONIOENCODING": "utf-8"},
        capture_output=True,
        encoding="utf-8",
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    assert without_figures(done.stdout) == without_figures(documented(script))
    assert "Warning" not in done.stderr
