import re

import numpy as np
import pytest

from taskcal.errors import FileError
from taskcal.observations import Point, Sockets
from taskcal.reading.options import ReadOptions
from taskcal.reading.reader import read_campaign, read_measurements
from taskcal.reading.writer import readings_text, write_campaign
from tests.observations.files import ROBOT, written


@pytest.mark.parametrize("place", ["place", "Tool_Position", "block"])
def test_sockets_are_read_with_the_place_of_their_block(tmp_path, place):
    file = written(tmp_path, f"{place},Socket", "left,0", "left,1", "right,0", ",")
    campaign = read_campaign(file, ROBOT)
    (kind,) = campaign.observations
    assert isinstance(kind, Sockets)
    assert campaign.targets == ("ball",)
    assert kind.sockets == ("left/0", "left/1", "right/0")
    assert kind.of.tolist() == [0, 1, 2, -1]
    assert campaign.valid[:, 0].tolist() == [True, True, True, False]
    assert repr(campaign).startswith("Campaign(campaign.csv: 4 sockets of ball, 1 beams lost")


def test_one_block_needs_no_place(tmp_path):
    (kind,) = read_campaign(written(tmp_path, "socket", "a", "b"), ROBOT).observations
    assert kind.sockets == ("a", "b")


def test_a_tracker_s_points_stand_beside_them(tmp_path):
    file = written(tmp_path, "socket,u_mm,x_mm,y_mm,z_mm", "a,0.03,400,1,2", "b,0.03,,,", ",0.03,410,1,2")
    campaign = read_campaign(file, ROBOT)
    assert campaign.targets == ("tool", "ball")
    assert [one.key for one in campaign.observations] == ["point", "socket"]
    np.testing.assert_array_equal(campaign.valid, [[True, True], [False, True], [True, False]])
    np.testing.assert_allclose(campaign.uncertainty, 3e-5)
    assert read_campaign(file, ROBOT, targets=["ball"]).targets == ("ball",)
    alone = read_campaign(file, ROBOT, targets=["tool"])
    assert (alone.targets, alone.kinds) == (("tool",), (Point,))


@pytest.mark.parametrize(
    ("header", "row", "message"),
    [
        ("place,socket", ",0", "campaign.csv:2: column 'place': the cell is empty; name the place"),
        ("socket", "a/b", "campaign.csv:2: column 'socket': 'a/b' has a /, which parts place and socket"),
    ],
)
def test_a_wrong_cell_is_refused(tmp_path, header, row, message):
    with pytest.raises(FileError, match=re.escape(message)):
        read_campaign(written(tmp_path, header, row), ROBOT)


def test_distances_come_from_another_file(tmp_path):
    file = tmp_path / "d.csv"
    file.write_text("socket_a,socket_b,distance_mm\na,b,50\n")
    options = ReadOptions(distances=file)
    (kind,) = read_campaign(written(tmp_path, "socket", "a", "b"), ROBOT, options=options).observations
    assert kind.distances[0].distance == 0.05


def test_what_is_written_is_read_back(tmp_path):
    file = written(tmp_path, "place,socket,u_mm,x_mm,y_mm,z_mm", "l,a,0.03,400,1,2", "r,b,0.03,,,", ",,0.03,410,1,2")
    campaign = read_campaign(file, ROBOT)
    write_campaign(tmp_path / "again.csv", campaign, ROBOT)
    again = read_campaign(tmp_path / "again.csv", ROBOT)
    assert again.targets == campaign.targets
    np.testing.assert_array_equal(again.points, campaign.points)
    assert again.observations[1].sockets == ("l/a", "r/b")
    assert again.observations[1].of.tolist() == campaign.observations[1].of.tolist()
    np.testing.assert_allclose(again.uncertainty, campaign.uncertainty)


def test_a_file_of_sockets_alone_keeps_them_when_it_is_converted(tmp_path):
    readings = read_measurements(written(tmp_path, "place,socket", "l,a", "r,b", ","), ROBOT)
    header, *rows = readings_text(readings, ROBOT).splitlines()
    assert header.endswith(",place,socket")
    assert [row.rpartition("000,")[2] for row in rows] == ["l,a", "r,b", ","]


def test_a_column_place_alone_means_nothing(tmp_path):
    campaign = read_campaign(written(tmp_path, "place,x_mm,y_mm,z_mm", "hall 3,1,2,3"), ROBOT)
    assert campaign.tracked
    assert any("place" in note for note in campaign.notes)


@pytest.mark.parametrize("header", ["d_mm,anchor", "sx_mm,sy_mm,sz_mm,landmark", "place,socket"])
def test_a_plan_that_nobody_filled_in_is_refused(tmp_path, header):
    empty = "," * header.count(",")
    with pytest.raises(FileError, match=f"{header.replace(',', ', ')}: no row is filled in"):
        read_campaign(written(tmp_path, header, empty, empty), ROBOT)
