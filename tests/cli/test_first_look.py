"""Files that are not there, or cannot be what they should, are refused before anything heavy is imported."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

HEAVY = ("numpy", "scipy", "numba", "pandas")


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("identify --robot ur5 none.csv -o x.json", "none.csv: cannot be read: No such file or directory"),
        ("validate table.csv table.csv", "table.csv:1: is not a whole JSON file"),
        ("validate other.json table.csv", "other.json: is JSON, but no calibration"),
        ("compare later.json later.json", "later.json: has format version 99"),
        ("correct -c table.csv table.csv -o x.csv", "table.csv:1: is not a whole JSON file"),
    ],
)
def test_a_wrong_file_is_refused_without_them(tmp_path: Path, command: str, said: str) -> None:
    (tmp_path / "table.csv").write_text("a,b\n1,2\n")
    (tmp_path / "other.json").write_text("{}")
    (tmp_path / "later.json").write_text('{"format": "taskcal-calibration", "format_version": 99}')
    code = (
        "import sys; from taskcal.cli import main; status = main(sys.argv[1:]); "
        f"print([m for m in {HEAVY!r} if m in sys.modules]); sys.exit(status)"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code, *command.split()],
        capture_output=True, text=True, check=False, cwd=tmp_path, env={**os.environ},
    )  # fmt: skip
    assert (ended.returncode, ended.stdout) == (1, "[]\n")
    assert ended.stderr.startswith("error: ")
    assert said in ended.stderr
