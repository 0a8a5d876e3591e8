"""A station that the studio begins and moves: what the library reads of it."""

from pathlib import Path

import numpy as np
import pytest

from taskcal.observations.point import load_station
from taskcal.robot.catalogue import load_robot
from taskcal_studio.editors import first_station, move_tracker
from taskcal_studio.pages.plan_page import arguments_of
from taskcal_studio.project import Choices


@pytest.mark.parametrize("robot", ["ur5", "abb-irb6660-205-1.9"])
def test_a_station_that_is_begun_stands_out_of_the_robot_s_reach(tmp_path: Path, robot: str) -> None:
    described = load_robot(robot)
    (tmp_path / "station.toml").write_text(first_station(described))
    station = load_station(tmp_path / "station.toml")
    assert described.reach < np.linalg.norm(station.position) < station.reach
    np.testing.assert_array_equal(station.offsets, np.zeros((1, 3)))


def test_a_moved_tracker_leaves_all_else_as_it_was(tmp_path: Path) -> None:
    file = tmp_path / "station.toml"
    file.write_text(
        first_station(load_robot("ur5")) + "[[keep_out]]\ncenter_mm = [0.0, 1.0, 2.0]\nsize_mm = [3.0, 4.0, 5.0]\n"
    )
    move_tracker(file, np.array([1000.0, -2000.5, 300.0]))
    station = load_station(file)
    np.testing.assert_allclose(station.position, [1.0, -2.0005, 0.3])
    np.testing.assert_allclose(station.keep_out[0].size, [0.003, 0.004, 0.005])
    assert [reflector.name for reflector in station.reflectors] == ["smr1"]


def test_a_chosen_station_is_planned_with() -> None:
    choices = Choices(name="x", robot="ur5", task="tasks/a.toml")
    assert not any(argument.startswith("--station") for argument in arguments_of(choices))
    assert "--station=stations/s.toml" in arguments_of(choices.model_copy(update={"station": "stations/s.toml"}))
