"""Measuring programs of a plan."""

from pathlib import Path

import numpy as np
import pytest

from robot_programs.reading import read_program
from taskcal.robot.catalogue import load_robot
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


def test_programs_wait_for_an_input_that_goes_off_and_on(run: Run, ask: list[object], tmp_path: Path) -> None:
    """Or are refused, where the language has another form of it; and visit poses that chance chose beside those of the fit."""
    paths = [tmp_path / f"Measure{suffix}" for suffix in (".src", ".ls", ".script")]
    programs = [text for path in paths for text in ("--program", path)]
    assert run(*ask, *programs, "--kept-out", "3", "--wait-input", "7").status == 0
    ids = [line.split(",")[0] for line in (tmp_path / "plan.csv").read_text().splitlines()[1:]]
    assert [one for one in ids if "-" in one] == ["5-kept-out", "10-kept-out", "11-reference", "15-kept-out"]
    planned = np.array([move.end.q for move in read_program(tmp_path / "plan.csv").motions])
    assert np.array_equal(planned[10], planned[0])
    for path, waits in zip(
        paths, ("WAIT FOR NOT $IN[7]", "WAIT DI[7]=OFF", "while get_standard_digital_in(7)"), strict=True
    ):
        np.testing.assert_allclose(
            [move.end.q for move in read_program(path, robot=load_robot(IRB6660)).motions], planned, atol=1e-5
        )
        assert path.read_text().count(waits) == len(ids) == 16
    refused = run(*ask, "--program", tmp_path / "Measure.mod", "--wait-input", "7")
    assert (refused.status, "the name of its signal" in " ".join(refused.err.split())) == (1, True)


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
