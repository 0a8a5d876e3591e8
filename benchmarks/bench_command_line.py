"""Whole commands, in processes of their own, and an update of a page, against the start of Python and NumPy."""

import subprocess
import sys
from collections.abc import Callable
from importlib import import_module

import pytest

from taskcal.reading.writer import write_campaign
from taskcal_demo.procedure import reference_task

START = [sys.executable, "-c", "import numpy"]


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "taskcal", *arguments]


def runs(line: list[str]) -> Callable[[], str]:
    """A call that runs a command line, and fails with what it said if it fails."""

    def call() -> str:
        done = subprocess.run(line, capture_output=True, text=True, timeout=300, stdin=subprocess.DEVNULL, check=False)
        assert done.returncode == 0, f"{' '.join(line[2:])} exits {done.returncode}: {done.stderr[-2000:]}"
        return done.stdout

    return call


@pytest.fixture(scope="module", autouse=True)
def _command_line() -> None:
    try:
        cli = import_module("taskcal.cli")
    except ModuleNotFoundError as error:
        if not (error.name or "").startswith("taskcal.cli"):
            raise
        pytest.skip(f"the command line is not complete: {error}")
    if not hasattr(cli, "main"):
        pytest.skip("there is no command line yet: taskcal.cli has no main")


@pytest.mark.guard
def test_help_against_start(race):
    race("taskcal --help", runs(command("--help")), {"python -c 'import numpy'": runs(START)})


@pytest.mark.guard
def test_identify_against_start(race, model, campaign, tmp_path):
    if "identify" not in runs(command("--help"))():
        pytest.skip("taskcal has no subcommand identify yet")
    points, out = tmp_path / "campaign.csv", tmp_path / "calibration.json"
    write_campaign(points, campaign, model.robot)
    identify = runs(command("identify", "--robot", model.robot.name, str(points), "-o", str(out)))
    race("taskcal identify, 60 rows", identify, {"python -c 'import numpy'": runs(START)})
    assert out.stat().st_size > 0


@pytest.mark.guard
def test_update_of_a_dragged_box_against_start(race, model):
    """What the studio computes each time while the task's box is dragged."""
    pytest.importorskip("nicegui")
    weigh, task = import_module("taskcal_studio.pages.weight_page").weigh, reference_task()
    race("update of what matters", lambda: weigh(model, task), {"python -c 'import numpy'": runs(START)})
