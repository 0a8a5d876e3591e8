"""taskcal fleet."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from taskcal.report import fleet as fleet_tables
from tests.cli.conftest import Run
from tests.laws.fleets import lay_calibrations, lay_campaigns


@pytest.fixture
def fleet(tmp_path: Path) -> Path:
    return lay_calibrations(tmp_path / "fleet")


def test_the_table_the_json_and_the_csv_say_the_same(run: Run, fleet: Path, tmp_path: Path) -> None:
    ended = run("fleet", fleet, "--json", "-o", tmp_path / "t.csv")
    assert ended.status == 0, ended.err
    rows = ended.json["calibrations"]
    assert [(row["robot"], row["change"]) for row in rows] == [
        ("a", ""), ("a", "unchanged"), ("b", ""), ("b", "changed"), ("c", ""),
    ]  # fmt: skip
    table = pd.read_csv(tmp_path / "t.csv")
    assert list(table["file"]) == [row["file"] for row in rows]
    np.testing.assert_allclose(table["fitted_mm"], [row["fitted_mm"] for row in rows])
    (change,) = [one for one in ended.json["changes"] if one["verdict"] == "changed"]
    assert change["resembles"][0]["name"] == "J3.rz"
    shown = run("fleet", fleet)
    assert shown.status == 0
    for row in rows:
        assert f"{row['fitted_mm']:.3f}" in shown.out
    assert f"{change['rms_mm']:.3f}" in shown.out


def test_campaigns_are_identified_and_judged_by_the_accuracy(run: Run, tmp_path: Path) -> None:
    folder = lay_campaigns(tmp_path / "fleet")
    (folder / "b" / "2026-03-01.csv").write_text("nonsense\n")
    told = run("fleet", folder)
    assert told.status == 1
    assert "holds 5 campaigns" in told.err
    small = ["--identify", "--robot", "abb-irb120", "--folds", 2, "--engine", "sequential"]
    ended = run("fleet", folder, *small, "--accuracy-mm", 1, "--json")
    assert ended.status == 1  # for the file that is none
    assert [one["file"] for one in ended.json["skipped"]] == ["b/2026-03-01.csv"]
    assert ended.err.count("b/2026-03-01.csv") == 1
    assert "identified 4 of 5 campaigns" in ended.err
    assert {row["verdict"] for row in ended.json["calibrations"]} <= {"good", "too few rows"}
    (folder / "b" / "2026-03-01.csv").unlink()
    assert run("fleet", folder, *small, "--accuracy-mm", 1).status == 0
    row = ended.json["calibrations"][-1]
    assert row["held_out_rms_mm"] > row["held_out_mm"]
    between = 0.5 * (row["held_out_rms_mm"] + row["held_out_mm"])
    assert row["robot"] in run("fleet", folder, "--accuracy-mm", between, "--json").json["beyond"]
    ended = run("fleet", folder, "--accuracy-mm", 0.01, "--json")
    assert (ended.status, ended.json["beyond"]) == (1, ["a", "b", "c"])


def test_of_many_only_those_that_need_a_look_are_shown(run: Run, fleet: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet_tables, "MAX_ROWS", 3)
    monkeypatch.setattr("taskcal.planning.fleet._verdict", lambda *_: "good")
    shown = run("fleet", fleet).out
    assert "the 1 of 3 robots that need a look" in " ".join(shown.split())
    assert [line.split()[0] for line in shown.splitlines() if "2026-" in line and ".json" not in line] == ["b", "b"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--identify"], "--identify needs --robot"),
        (["--robot", "ur5"], "--robot requires --identify"),
        (["--accuracy-mm", "0"], "0 is not above 0"),
        (["--engine", "dask"], "needs --scheduler"),
    ],
)
def test_wrong_usage(run: Run, fleet: Path, options: list[str], said: str) -> None:
    ended = run("fleet", fleet, *options)
    assert (ended.status, ended.out) == (2, "")
    assert said in " ".join(ended.err.split())


def test_a_table_that_is_not_its_own_is_not_replaced(run: Run, fleet: Path, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("mine")
    assert run("fleet", fleet, "-o", tmp_path / "t.csv").status == 1
    assert (tmp_path / "t.csv").read_text() == "mine"
