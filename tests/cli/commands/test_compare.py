"""taskcal compare."""

from pathlib import Path

import pytest

from tests.cli.conftest import IRB6660, Run


@pytest.fixture(scope="module")
def pair(cell: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The same robot measured again, with other targets and parameters."""
    from taskcal.cli import main

    folder = tmp_path_factory.mktemp("pair")
    fit = ["identify", "--robot", IRB6660, str(cell / "three.csv"), "--json"]
    assert main([*fit, "-o", str(folder / "again.json")]) == 0
    assert main([*fit, "-o", str(folder / "few.json"), "--keep", "J2,J3"]) == 0
    return folder / "again.json", folder / "few.json"


def test_the_same_robot_has_not_changed(run: Run, cell: Path, pair: tuple[Path, Path]) -> None:
    ended = run("compare", cell / "cal.json", *pair, "--json")
    assert (ended.status, ended.err) == (0, "")
    again, few = ended.json["comparisons"]
    assert (again["verdict"], again["due"]) == ("unchanged", None)
    assert {p["name"] for p in few["parameters"]} <= {p["name"] for p in again["parameters"]}
    text = run("compare", cell / "cal.json", pair[0]).out
    assert "no significant change" in " ".join(text.split())


def test_compare_states_whether_task_accuracy_is_exceeded(run: Run, cell: Path, pair: tuple[Path, Path]) -> None:
    """With a task and its accuracy, `compare` states whether the robot is due for calibration."""
    options = ["--task", cell / "list.toml"]
    result = run("compare", cell / "cal.json", pair[0], *options, "--json").json
    assert result["accuracy_mm"] == pytest.approx(0.1)
    assert result["comparisons"][0]["due"] is False
    assert result["comparisons"][0]["poses"] <= 40
    text = run("compare", cell / "cal.json", pair[0], *options, "--accuracy-mm", "0.2", "--parameters").out
    assert "no significant change against 0.2 mm" in " ".join(text.split())
    assert "J2.tx" in text


def test_a_single_calibration_is_wrong_usage(run: Run, cell: Path) -> None:
    assert run("compare", cell / "cal.json").status == 2
    assert run("compare", cell / "cal.json", cell / "cal.json", "--accuracy-mm", "0").status == 2
    assert run("compare", cell / "cal.json", cell / "one.csv").status == 1
