"""Stations of a campaign: a column of their names, and a file for each, are the same campaign."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.geometry import se3
from taskcal.reading.reader import read_campaign, read_measurements
from taskcal.reading.writer import write_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate

ROBOT = load_robot("ur5")


def test_a_column_of_stations_and_a_file_for_each_are_the_same(tmp_path):
    rng = np.random.default_rng(5)
    q = rng.uniform(-1.2, 1.2, (24, 6))
    campaign, _ = simulate(ErrorModel(ROBOT), q, rng=rng)
    moved = se3.pose(se3.exp(np.array([0.1, -0.2, 0.9])), np.array([0.5, -0.3, 0.2]))
    second = rng.permutation(24)[:11]
    points = campaign.points.copy()
    points[second] = se3.apply(moved, points[second])
    campaign = replace(campaign, points=points)
    stands = np.where(np.isin(np.arange(24), second), "north", "south")
    for name in ("north", "south"):
        write_campaign(tmp_path / f"{name}.csv", campaign.take(np.flatnonzero(stands == name)), ROBOT)
    write_campaign(tmp_path / "all.csv", campaign, ROBOT)
    head, *rows = (tmp_path / "all.csv").read_text().splitlines()
    lines = [f"{head},station", *(f"{row},{name}" for row, name in zip(rows, stands, strict=True))]
    (tmp_path / "all.csv").write_text("\n".join(lines) + "\n")
    one = read_campaign(tmp_path / "all.csv", ROBOT)
    two = read_campaign([tmp_path / "north.csv", tmp_path / "south.csv"], ROBOT)
    assert one.ids == campaign.ids
    assert [one.stations.names[k] for k in one.stations.of] == stands.tolist()
    for read in (one, two):
        assert sorted(read.stations.names) == ["north", "south"]
        for name in ("north", "south"):
            own = np.array(read.stations.of) == read.stations.names.index(name)
            np.testing.assert_allclose(np.sort(read.q[own], axis=0), np.sort(q[stands == name], axis=0), atol=1e-9)


@pytest.mark.parametrize(
    ("again", "names"), [(False, list("abcd")), (True, ["north:a", "north:b", "south:a", "south:b"])]
)
def test_points_of_two_stations_may_have_one_name(again, names, tmp_path):
    """They are poses of their own, as the two shots of one point are not."""
    rng = np.random.default_rng(0)
    ids = ["a", "b", "a", "b"] if again else list("abcd")
    points = 1e3 * rng.normal(size=(4, 3))
    lines = [
        f"{station},{name},{x + shot:.4f},{y:.4f},{z:.4f}"
        for station, name, (x, y, z) in zip(["north"] * 2 + ["south"] * 2, ids, points, strict=True)
        for shot in (-0.01, 0.01)
    ]
    path = tmp_path / "points.csv"
    path.write_text("\n".join(["station,id,x_mm,y_mm,z_mm", *lines]) + "\n")
    read = read_measurements(path, ROBOT)
    assert list(read.ids) == names
    assert list(read.stations) == ["north", "north", "south", "south"]
    np.testing.assert_allclose(read.points["tool"], 1e-3 * points, atol=1e-6)
