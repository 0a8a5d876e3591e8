"""The command line on measured robots."""

from pathlib import Path

import pytest

from tests.cli.conftest import Run

pytestmark = pytest.mark.realdata


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


def test_identify_takes_targets_and_nests_of_the_irb120(run: Run, data_folder: Path, tmp_path: Path) -> None:
    campaign, calibration = data_folder / "irb120_faro" / "measurements.csv", tmp_path / "cal.json"
    chosen = ["--targets", "smr1", "--nests", "base1,base2,base3", "--rows", "0:60", "--json"]
    result = run("identify", "--robot", "abb-irb120", campaign, "-o", calibration, *chosen).json
    assert list(result["targets"]) == ["smr1"]
    assert result["held_out"]["mean_mm"] < 0.8


def test_validate_compares_stated_distances_of_sockets(run: Run, data_folder: Path, tmp_path: Path) -> None:
    """The Panda by a ball in sockets, from the CSV and the URDF of its authors."""
    folder, out, distances = data_folder / "panda_sockets", tmp_path / "cal.json", tmp_path / "distances.csv"
    distances.write_text("socket_a,socket_b,distance_mm\n0,1,50.0\n")
    measured = [folder / "measurements.csv", "--distances", distances]
    result = run("identify", "--robot", folder / "nominal.urdf", *measured, "-o", out, "--json").json
    assert (result["tracker_frame"], result["fitted"]["mean_mm"] < 0.46) == (None, True)
    (observed,) = result["observations"]
    assert (observed["kind"], len(observed["unknowns"])) == ("socket", 18)
    checked = run("validate", out, *measured, "--json").json
    assert checked["mean_mm"] == pytest.approx(result["fitted"]["mean_mm"])
    assert [round(one["stated_mm"], 6) for one in checked["distances"]] == [50.0] * 3
    assert checked["distance_max_mm"] < 0.6
    assert "stated distances" in run("validate", out, *measured).out
