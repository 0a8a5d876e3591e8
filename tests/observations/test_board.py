import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taskcal.errors import FileError
from taskcal.geometry import se3
from taskcal.observations import Boards, Measured
from taskcal.reading.reader import read_campaign
from taskcal.reading.writer import write_campaign
from tests.observations.files import ROBOT, written

seeds = st.integers(0, 2**32 - 1)
HEADER = "sx_mm,sy_mm,sz_mm,sqx,sqy,sqz,sqw,board"


def seen_boards(seed, rows=40):
    """Poses of a tool that carries a camera, and two boards as the camera sees them."""
    rng = np.random.default_rng(seed)
    tool = se3.pose(se3.exp(rng.uniform(-1.5, 1.5, (rows, 3))), rng.uniform(-0.6, 0.6, (rows, 3)))
    X = se3.pose(se3.exp(rng.normal(size=3)), rng.uniform(-0.2, 0.2, 3))
    boards = se3.pose(se3.exp(rng.normal(size=(2, 3))), rng.uniform(-1, 1, (2, 3)))
    of = np.arange(rows) % 2
    Y = se3.inverse(tool @ X) @ boards[of]
    return tool, Measured(Y[:, :3, 3], Y[:, :3, :3]), Boards(landmarks=("a", "b"), of=of), X, boards


@given(seeds)
@settings(max_examples=5)
def test_board_registration_finds_camera_despite_wrong_row(seed):
    """Camera and boards are located without initial values, despite one wrong row."""
    tool, measured, kind, X, boards = seen_boards(seed)
    measured.points[7] += 0.2
    measured.rotations[7] = np.eye(3)
    placed = kind.place(tool, measured)
    np.testing.assert_allclose(placed.T_tool_target, X, atol=1e-6)
    unknown = placed.unknown.reshape(-1, 6)
    np.testing.assert_allclose(se3.pose(se3.exp(unknown[:, 3:]), unknown[:, :3]), boards, atol=1e-6)
    assert np.argmax(placed.distance) == 7


def test_boards_settle_where_the_camera_is_known():
    tool, measured, kind, X, boards = seen_boards(4)
    found = kind.settle(tool @ X, measured, np.zeros(12)).reshape(-1, 6)
    np.testing.assert_allclose(se3.pose(se3.exp(found[:, 3:]), found[:, :3]), boards, atol=1e-9)
    np.testing.assert_allclose(kind.differentiate(tool @ X, found.reshape(-1), measured).residual, 0.0, atol=1e-9)


def test_boards_are_read_and_written(tmp_path):
    file = written(tmp_path, HEADER, "1,2,300,0,0,0.6,0.8,left", ",,,,,,,", "4,5,310,1,0,0,0,right")
    campaign = read_campaign(file, ROBOT)
    (kind,) = campaign.observations
    assert (kind.key, kind.landmarks, kind.of.tolist()) == ("board", ("left", "right"), [0, -1, 1])
    np.testing.assert_allclose(se3.log(campaign.rotations[0]), [0.0, 0.0, 2.0 * np.arcsin(0.6)])
    write_campaign(tmp_path / "again.csv", campaign, ROBOT)
    again = read_campaign(tmp_path / "again.csv", ROBOT)
    np.testing.assert_allclose(again.points, campaign.points)
    np.testing.assert_allclose(again.rotations, campaign.rotations, atol=1e-9)
    assert again.observations[0].describe() == kind.describe()


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("1,2,300,0,,0.6,0.8,left", "campaign.csv:2: column 'sqx': a board seen here needs all of sqx sqy sqz sqw"),
        ("1,2,300,0,0,0.6,0.9,left", "campaign.csv:2: column 'sqx': the quaternion has length 1.0817; it must be 1"),
    ],
)
def test_a_wrong_cell_is_refused(tmp_path, row, message):
    with pytest.raises(FileError, match=re.escape(message)):
        read_campaign(written(tmp_path, HEADER, row), ROBOT)
