"""taskcal --import MODULE: effects of one's own on the command line."""

import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from taskcal.reading.writer import write_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import base as registry
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate
from tests.cli.conftest import Run

BELT = Path(__file__).parents[2] / "examples" / "belt.py"


@pytest.fixture
def forget(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[], None]]:
    """Undo what was imported, as a new process would; behind each test it is undone."""
    before = dict(registry._KINDS)

    def undo() -> None:
        monkeypatch.setattr(registry, "_KINDS", dict(before))
        sys.modules.pop("belt", None)

    monkeypatch.setattr(sys, "path", list(sys.path))
    undo()
    yield undo
    sys.modules.pop("belt", None)


pytestmark = pytest.mark.usefixtures("forget")


def test_an_imported_effect_is_identified_saved_and_read(run: Run, forget: Callable[[], None], tmp_path: Path) -> None:
    robot, rng = load_robot("abb-irb120"), np.random.default_rng(0)
    campaign, _ = simulate(ErrorModel(robot), rng.uniform(-1.0, 1.0, (40, 6)), rng=rng)
    write_campaign(tmp_path / "campaign.csv", campaign, robot)
    cal = tmp_path / "cal.json"
    identify = [
        "identify",
        "--robot",
        "abb-irb120",
        tmp_path / "campaign.csv",
        "-o",
        cal,
        "--effects",
        "belt",
        "--json",
    ]
    validate = ["validate", cal, tmp_path / "campaign.csv", "--json"]
    ended = run(*identify)
    assert ended.status == 2
    assert "'belt' is not an effect" in ended.err
    assert run("--import", BELT, *identify).json["effects"][0] == {
        "kind": "Belt", "module": "belt", "joints": None, "tolerance": 3e-4, "rounds": 6.5,
    }  # fmt: skip
    assert "belt: toothed belts" in " ".join(run("identify", "--help").out.split())
    assert run(*validate).status == 0
    forget()
    ended = run(*validate)
    assert (ended.status, ended.out) == (1, "")
    assert f"error: {cal}: the effect 'Belt' comes from the module 'belt', which is not imported" in ended.err
    assert "taskcal --import MODULE" in ended.err
    assert "belt: toothed" not in " ".join(run("identify", "--help").out.split())
    assert json.loads(run("--import", BELT, *validate).out)["n"] == 40


def test_the_environment_names_modules_too(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TASKCAL_IMPORT", str(BELT))
    assert "belt: toothed belts" in " ".join(run("identify", "--help").out.split())


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("no_such_module", None, "there is no module no_such_module"),
        ("missing.py", None, "there is no file missing.py"),
        ("json.py", "", "another module is called json"),
        ("broken.py", "1 / 0", "broken.py fails: ZeroDivisionError"),
        ("needy.py", "import no_such_module", "needy.py imports no_such_module, which is not installed"),
        (
            "twice.py",
            "from taskcal.robot.effects import Effect\nclass My(Effect):\n    key = label = 'gain'",
            "cannot be called",
        ),
    ],
)
def test_what_cannot_be_imported_is_said(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, text: str | None, words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    if text is not None:
        Path(name).write_text(text)
    ended = run("--import", name, "robots", "--help")
    assert (ended.status, ended.out) == (2, "")
    assert words in " ".join(ended.err.replace("│", " ").split())
