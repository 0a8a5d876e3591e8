"""taskcal sensitivity."""

from pathlib import Path

import numpy as np
import pytest

from taskcal.tables.forms import read_csv
from tests.cli.conftest import IRB6660, Run


def test_influences_and_identifiability_of_a_task(run: Run, cell: Path) -> None:
    result = run("sensitivity", "--robot", IRB6660, "--task", cell / "task.toml", "--json").json
    assert len(result["parameters"]) == 45
    first = result["parameters"][0]
    assert (first["name"], first["symbol"], first["unit"]) == ("J1.tx", "t1x", "mm/mm")
    assert first["tolerance_scaled_um"]["space"] == pytest.approx(first["max_space"] * 300.0)
    found = result["identifiability"]
    assert found["rank"] == len(found["kept"]) == 25
    assert found["zero"] == ["tool.rx", "tool.ry", "tool.rz"]
    assert found["dependent"]["J3.rz"] == pytest.approx({"J1.tz": 0.3, "J1.ry": 1.0, "J2.ty": -0.7})
    assert len(found["singular_values"]) == 45
    assert found["condition_number"] > 1.0
    assert set(found["observability"]) == {"O1", "O2", "O3", "O4", "O5"}
    assert len(result["published"]["kept"]) == 33


def test_the_poses_of_a_campaign_do_as_well(run: Run, cell: Path) -> None:
    by_task = run("sensitivity", "--robot", IRB6660, "--task", cell / "task.toml", "--json").json
    by_campaign = run("sensitivity", "--robot", IRB6660, "--campaign", cell / "one.csv", "--json").json
    expected = [p["max_space"] for p in by_task["parameters"]]
    np.testing.assert_allclose([p["max_space"] for p in by_campaign["parameters"]], expected, atol=1e-8)
    some = run("sensitivity", "--robot", IRB6660, "--campaign", cell / "one.csv", "--rows", "0:20", "--json").json
    assert (by_campaign["poses"], some["poses"]) == (60, 20)


def test_sensitivity_text_table_and_file_sorted_by_influence(run: Run, cell: Path, tmp_path: Path) -> None:
    """The text table and the file are sorted by influence."""
    path = tmp_path / "table.csv"
    ended = run("sensitivity", "--robot", IRB6660, "--task", cell / "task.toml", "--sort", "influence", "-o", path)
    assert ended.status == 0
    assert "0.3·t1z + psi1 − 0.7·t2y" in ended.out
    influence = read_csv(path).numbers("max_space_um")
    assert len(influence) == 45
    assert np.all(np.diff(influence) <= 0)


def test_a_robot_without_publication(run: Run, cell: Path, tmp_path: Path) -> None:
    task = (cell / "task.toml").read_text().replace("[1711.0, 30.0, 1489.0]", "[300.0, 200.0, 400.0]")
    (tmp_path / "near.toml").write_text(task.replace("[500.0, 700.0, 500.0]", "[100.0, 100.0, 100.0]"))
    ended = run("sensitivity", "--robot", "ur5", "--task", tmp_path / "near.toml", "--count", "20")
    assert ended.status == 0
    assert "published" not in ended.out


@pytest.mark.parametrize("given", [[], ["--task", "task.toml", "--campaign", "one.csv"]])
def test_exactly_one_source_of_poses(run: Run, given: list[str]) -> None:
    ended = run("sensitivity", "--robot", IRB6660, *given)
    assert ended.status == 2
    assert "exactly one" in ended.err


def test_a_task_partly_out_of_reach_says_so(run: Run, cell: Path, tmp_path: Path) -> None:
    task = (cell / "task.toml").read_text().replace("[500.0, 700.0, 500.0]", "[3000.0, 700.0, 500.0]")
    (tmp_path / "wide.toml").write_text(task)
    ended = run("sensitivity", "--robot", IRB6660, "--task", tmp_path / "wide.toml", "--json")
    assert ended.status == 0
    assert 0 < ended.json["unreachable_share"] < 1
    assert "out of the robot's reach" in ended.err


@pytest.mark.parametrize(
    ("options", "status", "said"),
    [
        (["--robot", "ur5"], 1, "ur5 does not reach"),
        (["--robot", IRB6660, "--model-error-mm", "-1"], 2, "--model-error-mm"),
        (["--robot", IRB6660, "--rows", "0:9"], 2, "--campaign"),
    ],
)
def test_sensitivity_refuses_what_it_cannot_analyse(
    run: Run, cell: Path, options: list[str], status: int, said: str
) -> None:
    ended = run("sensitivity", "--task", cell / "task.toml", *options)
    assert (ended.status, ended.out) == (status, "")
    assert said in ended.err


def test_what_the_noise_tells_apart_stands_beside_the_exact_rank(run: Run, cell: Path) -> None:
    """The less noise, the more is told apart, up to the rank; the noise is the tracker's and the model error together."""
    asked = ("sensitivity", "--robot", IRB6660, "--task", cell / "task.toml")
    typical, exact = run(*asked, "--json").json, run(*asked, "--model-error-mm", "0", "--json").json
    found, ideal = typical["told_apart"], exact["told_apart"]
    assert found["rank"] == ideal["rank"] == typical["identifiability"]["rank"] == len(found["directions"])
    assert found["count"] < ideal["count"] <= ideal["rank"]
    assert ideal["noise_mm"] == ideal["tracker_mm"] == found["tracker_mm"]
    assert found["noise_mm"] == pytest.approx(np.hypot(found["tracker_mm"], found["model_error_mm"]))
    assert found["count"] == sum(direction["left"] ** 2 < 0.5 for direction in found["directions"])
    ended = run(*asked)
    assert f"{found['count']} of {found['rank']}" in ended.out
    assert found["model_error_origin"][:20] in ended.out


def test_sensitivity_uses_uncertainty_of_campaign_as_noise(run: Run, cell: Path, tmp_path: Path) -> None:
    """The uncertainty stated in a campaign is the noise of the distinguishable directions."""
    lines = (cell / "one.csv").read_text().splitlines()
    head = next(i for i, line in enumerate(lines) if not line.startswith("#"))
    stated = [*lines[:head], lines[head] + ",u_mm", *(line + ",0.5" for line in lines[head + 1 :])]
    (tmp_path / "stated.csv").write_text("\n".join(stated) + "\n")
    asked = ("sensitivity", "--robot", IRB6660, "--model-error-mm", "0", "--json", "--campaign")
    own, modelled = run(*asked, tmp_path / "stated.csv").json, run(*asked, cell / "one.csv").json
    assert own["told_apart"]["noise_mm"] == pytest.approx(0.5)
    assert own["told_apart"]["count"] < modelled["told_apart"]["count"]
