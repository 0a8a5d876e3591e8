"""The command line on measured robots."""

from pathlib import Path

import pytest

from tests.cli.conftest import Run

pytestmark = pytest.mark.realdata


def test_an_imported_table_calibrates_the_ur5(run: Run, data_folder: Path, tmp_path: Path) -> None:
    folder, robot, calibration = data_folder / "ur5_tracker", tmp_path / "robot.toml", tmp_path / "cal.json"
    assert run("robots", "import", folder / "nominal_dh.csv", "--convention", "dh", "-o", robot).status == 0
    fit = ["--holdout", "0.3", "--json"]
    result = run("identify", "--robot", robot, folder / "measurements.csv", "-o", calibration, *fit).json
    assert result["held_out"]["n"] == 300
    assert result["held_out"]["mean_mm"] < 0.12
    own = run("validate", calibration, folder / "measurements.csv", "--json").json
    assert own["mean_mm"] == pytest.approx(0.7 * result["fitted"]["mean_mm"] + 0.3 * result["held_out"]["mean_mm"])


def test_poses_of_the_ur10(run: Run, data_folder: Path, tmp_path: Path) -> None:
    campaign = data_folder / "ur10_tmac" / "measurements.csv"
    result = run(
        "identify", "--robot", "ur10", campaign, "-o", tmp_path / "cal.json", "--holdout", "0.3", "--json"
    ).json
    assert result["held_out"]["mean_mm"] < 0.45
    assert result["held_out"]["mean_mrad"] < 5


def test_targets_and_nests_of_the_irb120(run: Run, data_folder: Path, tmp_path: Path) -> None:
    campaign, calibration = data_folder / "irb120_faro" / "measurements.csv", tmp_path / "cal.json"
    chosen = ["--targets", "smr1", "--reference-points", "base1,base2,base3", "--rows", "0:60", "--json"]
    result = run("identify", "--robot", "abb-irb120", campaign, "-o", calibration, *chosen).json
    assert list(result["targets"]) == ["smr1"]
    assert result["held_out"]["mean_mm"] < 0.8


def test_the_coupled_axes_of_the_fanuc(run: Run, data_folder: Path, tmp_path: Path) -> None:
    """36 poses only, so that single divisions of the rows tell little: the median of several."""
    folder, robot = data_folder / "fanuc_r2000_tracker", tmp_path / "robot.toml"
    assert run("robots", "import", folder / "nominal_mdh.csv", "--convention", "mdh", "-o", robot).status == 0
    fit = [
        "identify",
        folder / "measurements.csv",
        "-o",
        tmp_path / "cal.json",
        "--holdout",
        "0.3",
        "--json",
        "--robot",
    ]
    means = [run(*fit, robot, "--seed", seed).json["held_out"]["mean_mm"] for seed in range(9)]
    assert sorted(means)[4] < 0.5
    catalogued = run(*fit, "fanuc-r2000ic-165f", "--seed", 0).json["held_out"]["mean_mm"]
    assert catalogued == pytest.approx(means[0])


def test_seven_joints_of_the_wam(run: Run, data_folder: Path, tmp_path: Path) -> None:
    campaign = data_folder / "wam_tracker" / "measurements.csv"
    result = run(
        "identify", "--robot", "barrett-wam", campaign, "-o", tmp_path / "a.json", "--holdout", "0.3", "--json"
    ).json
    assert result["held_out"]["mean_mm"] < 3.5


def test_the_panda_by_a_ball_in_sockets_from_the_csv_and_the_urdf(run: Run, data_folder: Path, tmp_path: Path) -> None:
    folder, out = data_folder / "panda_sockets", tmp_path / "cal.json"
    distances = tmp_path / "distances.csv"
    distances.write_text("socket_a,socket_b,distance_mm\n0,1,50.0\n")
    campaign = folder / "measurements.csv"
    fit = ["--robot", folder / "nominal.urdf", campaign, "--distances", distances, "-o", out, "--json"]
    result = run("identify", *fit).json
    assert result["tracker_frame"] is None
    assert result["fitted"]["mean_mm"] < 0.46
    assert [one["kind"] for one in result["observations"]] == ["socket"]
    assert len(result["observations"][0]["unknowns"]) == 18
    checked = run("validate", out, campaign, "--distances", distances, "--json").json
    assert checked["mean_mm"] == pytest.approx(result["fitted"]["mean_mm"])
    assert [round(one["stated_mm"], 6) for one in checked["distances"]] == [50.0] * 3
    assert checked["distance_max_mm"] < 0.6
    shown = " ".join(run("validate", out, campaign, "--distances", distances).out.split())
    assert "stated distances off by" in shown
