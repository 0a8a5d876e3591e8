"""taskcal validate."""

import json
from pathlib import Path

import numpy as np
import pytest

from taskcal.geometry import se3
from taskcal.reading.reader import read_campaign
from taskcal.reading.writer import write_campaign
from taskcal.robot.catalogue import load_robot
from tests.cli.conftest import IRB6660, Run

KEYS = ["mean_mm", "rms_mm", "p95_mm", "max_mm", "max_x_mm", "max_y_mm", "max_z_mm", "n"]


MORE = [
    "inside_share", "rotation_inside_share", "outside_points", "off_stored_mm", "measured_range", "outliers", "rows", "acceptance",
]  # fmt: skip


@pytest.mark.parametrize(("limit", "status", "decision"), [(0.5, 0, "pass"), (0.001, 1, "fail")])
def test_a_limit_is_kept_or_not_and_the_exit_status_says_so(
    run: Run, cell: Path, limit: float, status: int, decision: str
) -> None:
    ended = run("validate", cell / "cal.json", cell / "other.csv", "--accept", limit, "--json")
    assert (ended.status, ended.json["acceptance"]["decision"]) == (status, decision)
    assert ended.json["acceptance"]["value_mm"] == ended.json["rms_mm"]
    read = run("validate", cell / "cal.json", cell / "other.csv", "--accept", limit, "--accept-of", "mean")
    assert read.status == status
    assert decision.upper() in read.out
    assert "JCGM 106" in " ".join(read.out.split())


def test_the_fitted_campaign_decides_nothing(run: Run, cell: Path) -> None:
    ended = run("validate", cell / "cal.json", cell / "one.csv", "--accept", "0.5")
    assert ended.status == 1
    assert "all 60 rows are those that the calibration was fitted to" in ended.err
    assert (
        "60 of 60 rows are those that the calibration was fitted to"
        in run("validate", cell / "cal.json", cell / "one.csv").err
    )


def test_the_worst_rows_are_listed_or_all(run: Run, cell: Path) -> None:
    out = run("validate", cell / "cal.json", cell / "one.csv").out
    assert "The 10 worst of 60 points" in out
    every = run("validate", cell / "cal.json", cell / "one.csv", "--all-rows").out
    assert len([line for line in every.splitlines() if " tool " in line]) == 60


def test_a_point_that_is_wrong_is_named(run: Run, cell: Path, tmp_path: Path) -> None:
    lines = (cell / "one.csv").read_text().splitlines()
    cells = lines[8].split(",")
    cells[-3] = str(float(cells[-3]) + 0.4)
    lines[8] = ",".join(cells)
    (tmp_path / "bad.csv").write_text("\n".join(lines))
    ended = run("validate", cell / "cal.json", tmp_path / "bad.csv", "--json")
    assert [(o["row"], o["line"], o["id"]) for o in ended.json["outliers"]] == [(7, 9, "7")]
    text = run("validate", cell / "cal.json", tmp_path / "bad.csv").out
    assert "Outliers" in text
    assert "1 outlier, 1 isolated" in " ".join(text.split())


def test_text_table_output(run: Run, cell: Path) -> None:
    """The text table lists the worst points."""
    ended = run("validate", cell / "cal.json", cell / "one.csv")
    assert ended.status == 0
    assert "The 10 worst of 60 points" in ended.out


def test_a_moved_tracker_needs_a_new_registration(run: Run, cell: Path, tmp_path: Path) -> None:
    from dataclasses import replace

    robot = load_robot(IRB6660)
    campaign = read_campaign(cell / "one.csv", robot)
    moved = se3.apply(se3.pose(se3.exp(np.array([0.01, 0.02, 0.5])), np.array([0.4, -0.2, 0.1])), campaign.points)
    write_campaign(tmp_path / "moved.csv", replace(campaign, points=moved), robot)
    assert run("validate", cell / "cal.json", tmp_path / "moved.csv", "--json").json["mean_mm"] > 100
    assert run("validate", cell / "cal.json", tmp_path / "moved.csv", "--reregister", "--json").json["max_mm"] < 0.1
    refitted = run("validate", cell / "cal.json", tmp_path / "moved.csv", "--reregister")
    assert "not judged: tracker frame and targets were refitted" in " ".join(refitted.out.split())


def test_poses_bring_rotations(run: Run, cell: Path, tmp_path: Path) -> None:
    assert run("identify", "--robot", IRB6660, cell / "poses.csv", "-o", tmp_path / "cal.json").status == 0
    result = run("validate", tmp_path / "cal.json", cell / "poses.csv", "--rows", "0:10", "--json").json
    assert list(result) == [*KEYS, "mean_mrad", "max_mrad", *MORE]
    assert result["n"] == 10
    assert min(result["inside_share"], result["rotation_inside_share"]) >= 0.7
    assert [(row["row"], row["line"]) for row in result["rows"]] == [(i, i + 2) for i in range(10)]
    assert max(row["error_mm"] for row in result["rows"]) == result["max_mm"]
    assert max(row["error_mrad"] for row in result["rows"]) == result["max_mrad"]


def test_other_targets_are_left_out_with_a_note(run: Run, cell: Path, tmp_path: Path) -> None:
    fit = ["identify", "--robot", IRB6660, cell / "three.csv", "-o", tmp_path / "cal.json", "--targets", "smr2"]
    assert run(*fit).status == 0
    ended = run("validate", tmp_path / "cal.json", cell / "three.csv", "--json")
    assert ended.json["n"] == 30
    assert ended.json["max_mm"] < 0.1
    assert "leaving out smr1, smr3" in ended.err
    refused = run("validate", tmp_path / "cal.json", cell / "three.csv", "--targets", "smr1")
    assert refused.status == 1
    assert "the campaign's target 'smr1' is not in the calibration, which knows smr2" in refused.err
    refitted = run("validate", tmp_path / "cal.json", cell / "three.csv", "--targets", "smr1", "--reregister", "--json")
    assert refitted.json["max_mm"] < 0.2


@pytest.mark.parametrize("limit", ["0", "-1", "nan"])
def test_limit_not_above_zero_is_wrong_usage(run: Run, cell: Path, limit: str) -> None:
    assert run("validate", cell / "cal.json", cell / "one.csv", "--accept", limit).status == 2


@pytest.mark.parametrize(
    ("share", "message"), [(0.01, "cut off"), (0.3, "cut off"), (0.99, "cut off"), (None, "'estimate' changed")]
)
def test_validate_refuses_a_damaged_calibration(
    run: Run, cell: Path, tmp_path: Path, share: float | None, message: str
) -> None:
    """A file cut off anywhere, and one of which an estimate was deleted."""
    whole, path = (cell / "cal.json").read_text(), tmp_path / "cal.json"
    data = json.loads(whole)
    edited = json.dumps({**data, "estimate": data["estimate"][:-1]})
    path.write_text(edited if share is None else whole[: int(share * len(whole))])
    ended = run("validate", path, cell / "one.csv")
    assert (ended.status, ended.out) == (1, "")
    assert ended.err.startswith(f"error: {path}")
    assert message in ended.err


def test_validate_refuses_exchanged_files_and_a_folder(run: Run, cell: Path) -> None:
    for files in ((cell / "one.csv", cell / "cal.json"), (cell, cell / "one.csv"), (cell / "cal.json", cell)):
        ended = run("validate", *files)
        assert (ended.status, ended.out) == (1, "")
        assert ended.err.startswith(f"error: {files[files[0].name == 'cal.json']}")
