"""A program is corrected once: what ``taskcal correct`` wrote is known again, and what it left as it was is no correction."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from taskcal.identification.identify import identify
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import load_task, reach_task
from taskcal.virtual.cell import simulate
from tests.cli.commands.test_correct import part, robot
from tests.cli.conftest import Run

__all__ = ["part", "robot"]


@pytest.fixture
def corrected(run: Run, cell: Path, part: Path, tmp_path: Path) -> Path:
    out = tmp_path / "corrected.mod"
    assert run("correct", "--accept-uncertain", "-c", cell / "cal.json", part, "-o", out).status == 0
    assert out.read_bytes() != part.read_bytes()
    return out


@pytest.mark.parametrize("option", ["--output", "--dry-run"])
def test_corrected_program_is_rejected_under_any_name(
    option: str, run: Run, cell: Path, part: Path, corrected: Path, tmp_path: Path
) -> None:
    """A corrected program is rejected under any name, and the message names its original."""
    copy, out = tmp_path / "innocent.mod", tmp_path / "twice.mod"
    shutil.copy(corrected, copy)
    where = ["--output", out] if option == "--output" else ["--dry-run"]
    for path in (corrected, copy):
        ended = run("correct", "--accept-uncertain", "-c", cell / "cal.json", path, *where)
        assert ended.status != 0
        assert f"was written by taskcal correct from '{part.resolve()}'" in ended.err
    assert not out.exists()
    assert run("correct", "--again", "--accept-uncertain", "-c", cell / "cal.json", corrected, *where).status == 0


def test_original_program_can_be_corrected_repeatedly(run: Run, cell: Path, part: Path, corrected: Path) -> None:
    """The original program can be corrected any number of times."""
    first = corrected.read_bytes()
    assert run("correct", "--accept-uncertain", "-c", cell / "cal.json", part, "-o", corrected).status == 0
    assert corrected.read_bytes() == first


def test_unchanged_program_does_not_count_as_corrected(run: Run, cell: Path, part: Path, robot, tmp_path: Path) -> None:
    """A program without any change does not count as corrected."""
    model = ErrorModel(robot)
    q = reach_task(model, load_task(cell / "task.toml"), 30, seed=1).q
    campaign, _ = simulate(model, q, rng=np.random.default_rng(0), x=np.zeros(len(model)))
    identify(model, campaign, keep=[]).save(tmp_path / "nothing.json")
    once, twice = tmp_path / "once.mod", tmp_path / "twice.mod"
    for given, out in ((part, once), (once, twice)):
        ended = run("correct", "--accept-uncertain", "-c", tmp_path / "nothing.json", given, "-o", out)
        assert ended.status == 0, ended.err
        assert out.read_bytes() == part.read_bytes()
