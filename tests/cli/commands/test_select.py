"""taskcal select."""

from pathlib import Path

import pytest

from tests.cli.conftest import IRB6660, Run


def test_the_choice_and_its_reasons(run: Run, cell: Path) -> None:
    ended = run("select", "--robot", IRB6660, "--task", cell / "task.toml", "--json")
    assert (ended.status, ended.err) == (0, "")
    result = ended.json
    assert len(result["kept"]) + len(result["dropped"]) == 45
    assert all(result["dropped"].values())
    assert [nested["size"] for nested in result["ladder"]] == list(range(45, -1, -1))
    assert {"size", "expected_mm", "cross_validated_mm"} <= set(result["ladder"][0])


def test_an_accuracy_in_millimetres_decides(run: Run, cell: Path) -> None:
    task = ["select", "--robot", IRB6660, "--task", cell / "task.toml", "--json"]
    rough, fine = (run(*task, "--accuracy-mm", mm).json for mm in (0.5, 0.1))
    assert len(rough["kept"]) < len(fine["kept"])
    size = {nested["size"]: nested["expected_mm"] for nested in fine["ladder"]}
    assert size[len(fine["kept"])] <= 0.1 < size[len(fine["kept"]) - 1]


def test_the_report_for_people(run: Run, cell: Path) -> None:
    ended = run("select", "--robot", IRB6660, "--task", cell / "task.toml")
    assert ended.status == 0
    assert "chosen" in ended.out
    assert "published" in ended.out


def test_the_effects_of_a_calibration_compete_too(run: Run, cell: Path, tmp_path: Path) -> None:
    cal = tmp_path / "cal.json"
    effects = ["--effects", "compliance,gain"]
    assert run("identify", "--robot", IRB6660, cell / "one.csv", "-o", cal, *effects).status == 0
    task = ["--task", cell / "task.toml", "--json"]
    result = run("select", "--calibration", cal, *task).json
    names = {*result["kept"], *result["dropped"]}
    assert len(result["ladder"]) == len(names) + 1
    assert {"J2.gain", "J3.sag_tool", "J2.tx"} <= names
    assert result["references"]["published"]["size"] == 33
    both = run("select", "--calibration", cal, "--robot", IRB6660, *task)
    assert (both.status, both.out) == (2, "")
    assert run("select", *task).status == 2


@pytest.mark.slow
def test_a_campaign_cross_validates_every_size(run: Run, cell: Path) -> None:
    task = ["select", "--robot", IRB6660, "--task", cell / "task.toml", "--campaign", cell / "one.csv", "--json"]
    ended = run(*task)
    assert "cross-validating 46 model sizes" in ended.err
    assert all(nested["cross_validated_mm"] > 0 for nested in ended.json["ladder"])


def test_what_cannot_be_had(run: Run, cell: Path) -> None:
    task = ["select", "--robot", IRB6660, "--task", cell / "task.toml"]
    assert run(*task, "--accuracy-mm", "0").status == 2
    ended = run(*task, "--accuracy-mm", "0.0001")
    assert (ended.status, ended.out) == (1, "")
    assert "out of reach" in ended.err
    assert run("select", "--robot", IRB6660, "--task", cell / "nowhere.toml").status == 1


def test_a_page_makes_its_design_once(run: Run, cell: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from taskcal.planning import selection

    made: list[object] = []
    design = selection.design
    monkeypatch.setattr(selection, "design", lambda *given, **options: made.append(1) or design(*given, **options))
    page = tmp_path / "select.html"
    assert run("select", "--robot", IRB6660, "--task", cell / "task.toml", "--report", page, "--json").status == 0
    assert page.stat().st_size > 1e6
    assert len(made) == 1
