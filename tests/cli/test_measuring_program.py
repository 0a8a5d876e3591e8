"""Measuring programs of a plan."""

from pathlib import Path

import numpy as np
import pytest

from robot_programs.reading import read_program
from tests.cli.conftest import IRB6660, Run


@pytest.fixture
def ask(cell: Path, tmp_path: Path) -> list[object]:
    small = ["--count", "12", "--candidates", "200", "-o", tmp_path / "plan.csv"]
    return ["plan", "--robot", IRB6660, "--task", cell / "list.toml", *small]


def test_programs_drive_to_the_joints_of_the_plan_in_its_order(run: Run, ask: list[object], tmp_path: Path) -> None:
    rapid, krl = tmp_path / "Measure.mod", tmp_path / "measure.src"
    ended = run(*ask, "--program", rapid, "--program", krl, "--wait-s", "4", "--speed-mm-s", "100", "--json")
    assert (ended.status, ended.err) == (0, "")
    assert ended.json["programs"] == [str(rapid), str(krl)]
    planned = [move.end.q for move in read_program(tmp_path / "plan.csv").motions]
    for path in (rapid, krl):
        program = read_program(path)
        assert not program.diagnostics
        assert all(move.stops for move in program.motions)
        np.testing.assert_allclose([move.end.q for move in program.motions], planned, atol=2e-7)
        text = path.read_text(encoding="utf-8")
        assert [k for k in range(12) if f" pose {k}\n" in text.replace("\r\n", "\n")] == list(range(12))
    assert rapid.read_text().count("WaitTime 4;") == krl.read_text().count("WAIT SEC 4") == 12
    assert ",v100,fine," in rapid.read_text()


def test_the_table_names_the_programs(run: Run, ask: list[object], tmp_path: Path) -> None:
    ended = run(*ask, "--program", tmp_path / "Measure.mod")
    assert f"wrote {tmp_path / 'Measure.mod'}, 12 poses" in " ".join(ended.out.split())


@pytest.mark.parametrize(
    ("name", "options", "status", "said"),
    [
        (
            "measure.apt",
            [],
            1,
            "cannot be composed; programs are written as .mod, .prg, .modx, .src, .ls, .script, .csv",
        ),
        ("2measure.mod", [], 1, "'2measure' is not a name of a RAPID module"),
        ("plan.csv", [], 2, "cannot be one"),
        ("none/measure.src", [], 1, "cannot be written: there is no folder"),
        ("measure.src", ["--wait-s", "nan"], 2, "--wait-s"),
        ("measure.src", ["--speed-percent", "0"], 2, "--speed-percent"),
    ],
)
def test_unwritable_measuring_program_is_rejected_before_plan(
    run: Run, ask: list[object], tmp_path: Path, name: str, options: list[str], status: int, said: str
) -> None:
    """Measuring programs that cannot be written are rejected before the plan is computed."""
    ended = run(*ask, "--program", tmp_path / name, *options, "--json")
    assert (ended.status, ended.out) == (status, "")
    assert said in " ".join(ended.err.split())
    assert not (tmp_path / "plan.csv").exists()
