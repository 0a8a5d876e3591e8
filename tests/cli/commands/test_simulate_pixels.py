"""Images of a virtual robot's camera: what is written is read, and fits the truth."""

import numpy as np
import pytest

from taskcal.observations.calibration_board import read_boards
from taskcal.reading.detection import corners_of
from taskcal.reading.options import ReadOptions
from taskcal.reading.reader import read_campaign
from taskcal.robot.catalogue import load_robot
from tests.task.task_files import BOX

BOARD = """
[[board]]
kind = "charuco"
columns = 7
rows = 5
square_mm = 30.0
marker_mm = 22.0
dictionary = "5X5_100"
[board.measured]
length_mm = 100.0
u_mm = 0.01
"""
FLAGS = "simulate --robot abb-irb6660-205-1.9 --observe pixels --board board.toml --seed 2"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "board.toml").write_text(BOARD)
    (tmp_path / "task.toml").write_text(BOX)
    return tmp_path


def test_a_simulated_campaign_of_images_is_identified(run, folder):
    """The corners are left with their noise, and the camera is the true one to what the images tell."""
    ended = run(*FLAGS.split(), "--task", "task.toml", "-n", "24", "-o", "shots.csv")
    assert ended.status == 0, ended.err
    robot = load_robot("abb-irb6660-205-1.9")
    campaign = read_campaign("shots.csv", robot, options=ReadOptions(board="board.toml"))
    (kind,) = campaign.observations
    assert kind.pictures[0].noise == pytest.approx(0.15, rel=0.15)
    np.testing.assert_allclose(kind.pictures[0].camera[:4] * 1e3, [1440.0, 1440.0, 799.5, 599.5], atol=15.0)


def test_rendered_images_show_the_corners_of_the_file(run, folder):
    """Found by OpenCV within 0.3 px of those that are written with a noise of 0.01."""
    size = "--image-size 800x600 --noise-px 0.01 --images seen"
    ended = run(*FLAGS.split(), *size.split(), "--task", "task.toml", "-n", "3", "-o", "shots.csv")
    assert ended.status == 0, ended.err
    boards = read_boards("board.toml")
    (seen,) = corners_of(folder / "seen", boards)
    (written,) = corners_of(folder / "shots.csv", boards)
    there = dict(zip(zip(written.image.tolist(), written.id.tolist(), strict=True), written.pixel, strict=True))
    both = [k for k in zip(seen.image.tolist(), seen.id.tolist(), strict=True) if k in there]
    assert len(both) > 0.7 * len(there) > 20
    found = dict(zip(zip(seen.image.tolist(), seen.id.tolist(), strict=True), seen.pixel, strict=True))
    assert max(np.abs(found[k] - there[k]).max() for k in both) < 0.3


@pytest.mark.parametrize("given", ["--observe pixels", "--observe tracker --board board.toml", "--images seen"])
def test_images_need_a_board_and_a_board_images(run, folder, given):
    ended = run("simulate", "--robot", "ur5", "--task", "task.toml", *given.split(), "-o", "shots.csv")
    assert (ended.status, "--observe pixels and --board" in " ".join(ended.err.split())) == (2, True), ended.err


def test_converted_images_are_read_without_them(run, folder):
    """Joints and corners of two files become the campaign of one; a row whose image is not there is named."""
    ended = run(*FLAGS.split(), "--task", "task.toml", "-n", "12", "-o", "shots.csv")
    assert ended.status == 0, ended.err
    header, *lines = (folder / "shots.csv").read_text().splitlines()
    names, cells = header.split(","), [line.split(",") for line in lines]
    joints = [k for k, name in enumerate(names) if name.startswith("J")]
    image = names.index("image")
    own = {row[image]: [row[image], *(row[k] for k in joints)] for row in cells}
    table = [["image", *(names[k] for k in joints)], *list(own.values())[::-1], ["", *["0"] * len(joints)]]
    (folder / "joints.csv").write_text("\n".join(map(",".join, table)) + "\n")
    corners = [[one for k, one in enumerate(row) if k not in joints] for row in (names, *cells)]
    (folder / "corners.csv").write_text("\n".join(map(",".join, corners)) + "\n")
    robot = "abb-irb6660-205-1.9"
    files = ("joints.csv", "--robot", robot, "--images", "corners.csv", "--board", "board.toml", "-o", "whole.csv")
    ended = run("convert", *files, "--json")
    assert ended.status == 0, ended.err
    assert (ended.json["rows"], len(ended.json["notes"])) == (len(own), 1)
    read = [
        read_campaign(one, load_robot(robot), options=ReadOptions(board="board.toml"))
        for one in ("shots.csv", "whole.csv")
    ]
    np.testing.assert_allclose(*(campaign.q for campaign in read), atol=1e-9)
    np.testing.assert_allclose(*(campaign.points for campaign in read), atol=1e-6)
