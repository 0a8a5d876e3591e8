"""Campaigns of several stations on the command line."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import taskcal as tc
from taskcal.geometry import se3
from taskcal.reading.writer import write_campaign
from tests.cli.conftest import Run


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    """What a tracker measured of a UR10 from two places."""
    robot = tc.load_robot("ur10")
    rng = np.random.default_rng(0)
    campaign, _ = tc.simulate(tc.ErrorModel(robot), rng.uniform(-1.5, 1.5, (50, 6)), rng=rng)
    T = se3.pose(se3.exp(np.array([0.02, -0.01, 1.2])), np.array([2.0, -3.0, 0.1]))
    west = campaign.take(slice(30, None))
    write_campaign(tmp_path / "east.csv", campaign.take(slice(0, 30)), robot)
    write_campaign(tmp_path / "west.csv", replace(west, points=se3.apply(T, west.points)), robot)
    return [tmp_path / "east.csv", tmp_path / "west.csv"]


def test_several_files_are_stations_and_the_output_says_so(run: Run, files: list[Path], tmp_path: Path) -> None:
    cal = tmp_path / "cal.json"
    ended = run("identify", "--robot", "ur10", *files, "-o", cal, "--json")
    assert "2 stations, each with a frame of its own: east (30 rows), west (20 rows)" in ended.err
    assert [(one["name"], one["rows"]) for one in ended.json["stations"]] == [("east", 30), ("west", 20)]
    assert ended.json["fitted"]["mean_mm"] < 0.06
    checked = run("validate", cal, *files[::-1], "--json")
    assert checked.json["n"] == 50
    assert checked.json["mean_mm"] < 0.06
    assert "name no station" in run("validate", cal, files[0], "--json").err
    text = run("identify", "--robot", "ur10", *files, "-o", cal).out
    assert "Stations of the tracker" in text
    assert "west" in text


def test_a_file_that_is_converted_keeps_its_stations(run: Run, files: list[Path], tmp_path: Path) -> None:
    robot = tc.load_robot("ur10")
    joined = tc.read_campaign(files, robot)
    write_campaign(tmp_path / "both.csv", joined, robot)
    run("convert", tmp_path / "both.csv", "--robot", "ur10", "-o", tmp_path / "again.csv")
    again = tc.read_campaign(tmp_path / "again.csv", robot)
    assert again.stations is not None
    assert again.stations.names == ("east", "west")
    np.testing.assert_allclose(again.points, joined.points, atol=1e-8)
