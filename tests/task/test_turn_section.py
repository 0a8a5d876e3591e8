"""Orientations of a task file."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taskcal.errors import FileError
from taskcal.task.task import load_task

R = Rotation.from_euler("ZYX", [30.0, -20.0, 10.0], degrees=True)


TASK = """name = "t"
[workspace]
center_mm = [500.0, 0.0, 500.0]
size_mm = [100.0, 100.0, 100.0]
frame = "part"
[[workspace.orientation]]
{turn}
[frames.part]
position_mm = [10.0, 0.0, 0.0]
{frame}
"""


def load(folder, turn, frame=""):
    path = folder / "task.toml"
    path.write_text(TASK.format(turn=turn, frame=frame), encoding="utf-8")
    return load_task(path).workspace


@pytest.mark.parametrize(
    "turn", ["rpy_deg = [10.0, -20.0, 30.0]", "abc_deg = [30.0, -20.0, 10.0]", "wpr_deg = [10.0, -20.0, 30.0]"]
)
def test_a_task_takes_angles_for_tools_and_frames(turn, tmp_path):
    workspace = load(tmp_path, turn, turn)
    np.testing.assert_allclose(workspace.orientations[0].rotation, R.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(workspace.T_base_frame[:3, :3], R.as_matrix(), atol=1e-12)


def test_a_direction_of_a_task_leaves_the_spin_free(tmp_path):
    orientation = load(tmp_path, "direction = [0.0, 0.0, -2.0]").orientations[0]
    np.testing.assert_allclose(orientation.rotation[:, 2], [0.0, 0.0, -1.0], atol=1e-15)
    assert orientation.spin == pytest.approx(np.pi)


@pytest.mark.parametrize(
    ("turn", "message"),
    [
        ("cone_deg = 5.0", r"says no orientation; give quaternion, rpy_deg"),
        ("rpy_deg = [0.0, 0.0, 0.0]\ndirection = [0.0, 0.0, 1.0]", r"as rpy_deg and as direction; keep one"),
        ('direction = [0.0, 0.0, 1.0]\nspin = "fixed"', r"a direction leaves the turn about it free"),
    ],
)
def test_a_task_that_says_its_orientation_not_once_is_refused(turn, message, tmp_path):
    with pytest.raises(FileError, match=message):
        load(tmp_path, turn)
