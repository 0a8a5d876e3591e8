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
        ("validate table.csv table.csv", "table.csv: is not JSON, and no calibration"),
        ("validate other.json table.csv", "other.json: is JSON, but not a calibration"),
        ("compare later.json later.json", "later.json: has format version 99"),
        ("correct -c table.csv table.csv -o x.csv", "table.csv: is not JSON, and no calibration"),
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


WRONG = (
    "identify --robot abb-irb120 text.csv -o x.json",
    "identify --robot robot.toml text.csv -o x.json",
    "validate calibration.json text.csv",
    "register --robot abb-irb120 text.csv -o x.json",
    "convert --robot abb-irb120 text.csv -o x.csv",
    "doctor --robot abb-irb120 text.csv",
    "robots robot.toml",
    "performance text.csv",
    "simulate --robot abb-irb120 --task robot.toml -o x.csv",
    "plan --robot abb-irb120 --task robot.toml -o x.csv",
    "study --robot abb-irb120 --task robot.toml",
    "select --robot abb-irb120 --task robot.toml",
    "report calibration.json --task robot.toml -o x.html",
    "correct -c calibration.json program.mod -o x.mod",
)


def test_invalid_files_are_rejected_before_heavy_imports(tmp_path: Path, cell: Path) -> None:
    """Files with invalid content are rejected before compiler, solvers and plotting are imported."""
    names = ",".join(f"J{joint}_deg" for joint in range(1, 7))
    (tmp_path / "text.csv").write_text(f"id,{names},x_mm,y_mm,z_mm\n0,0,0,0,0,abc,0,1,2,3\n")
    (tmp_path / "robot.toml").write_text('name = "nothing else"\n')
    (tmp_path / "program.mod").write_text("MODULE m\n PROC main()\n  MoveL nowhere, v100")
    (tmp_path / "calibration.json").write_bytes((cell / "cal.json").read_bytes())
    code = (
        "import sys; from taskcal.cli import main\n"
        f"statuses = [main(line.split()) for line in {WRONG!r}]\n"
        "heavy = ('scipy', 'numba', 'pandas', 'jinja2', 'rich', 'joblib')\n"
        "print(statuses, [name for name in heavy if name in sys.modules])"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=tmp_path, env={**os.environ}
    )
    assert ended.stdout == f"{[1] * len(WRONG)} []\n", ended.stderr
