"""Robots that command fewer than six directions: what no program can take away is said, and no pose is refused for it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot_programs.reading import read_program
from taskcal.correction.correct import correct
from taskcal.correction.tool_poses import find_joints
from taskcal.identification.calibration import Calibration
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.correction.test_correct import write_path
from tests.laws.calibrations import calibrated
from tests.laws.robots import FEW_DIRECTIONS

Q = np.radians([[0.0, 20.0, 70.0, 0.0], [5.0, 25.0, 72.0, 10.0], [10.0, 22.0, 75.0, 20.0]])


@pytest.fixture(scope="module")
def palletizer() -> Calibration:
    return calibrated(robot_from(FEW_DIRECTIONS["palletizer"]))


def tilted(T: np.ndarray, angle: float) -> np.ndarray:
    out = T.copy()
    out[:3, :3] = out[:3, :3] @ Rotation.from_rotvec([angle, 0.0, 0.0]).as_matrix()
    return out


def angles_between(T: np.ndarray, other: np.ndarray) -> np.ndarray:
    return Rotation.from_matrix(T[:, :3, :3] @ np.swapaxes(other[:, :3, :3], 1, 2)).magnitude()


def test_a_correction_takes_away_the_position_and_says_what_is_left(palletizer, tmp_path):
    from taskcal.report.correction import tabulate_correction

    T = ErrorModel(palletizer.model.robot).poses(Q)
    path = write_path(tmp_path / "path.csv", T)
    found = correct(palletizer, read_program(path, robot=palletizer.model.robot))
    assert len(found.corrected) == len(Q)
    at = found.after.at_target
    true = palletizer.tool_in_base(found.after.q[at])
    np.testing.assert_allclose(true[:, :3, 3], T[:, :3, 3], atol=1e-6)
    left = np.degrees(angles_between(true, T).max())
    assert left > 0.02
    assert dict(tabulate_correction(found.told(), palletizer.model.robot))["not corrected"].startswith(
        f"up to {left:.3f}° at targets"
    )


@pytest.mark.parametrize("target", [0, 1], ids=["first", "along a line"])
def test_a_tilted_target_is_rejected_for_its_tilt(palletizer, tmp_path, target):
    T = ErrorModel(palletizer.model.robot).poses(Q)
    T[target] = tilted(T[target], np.radians(4.0))
    path = write_path(tmp_path / "path.csv", T)
    found = correct(palletizer, read_program(path, robot=palletizer.model.robot))
    assert target in found.rejected
    assert target not in found.corrected
    assert "cannot be turned so" in found.rejected[target]
    assert "4 of six directions" in found.rejected[target]


def test_joints_are_found_for_poses_that_the_calibrated_robot_takes(palletizer):
    """Though their tilt, of defects, is more than the nominal robot may miss; one of degrees is reached by neither."""
    nominal, T = ErrorModel(palletizer.model.robot), palletizer.tool_in_base(Q)
    assert angles_between(T, nominal.poses(Q)).max() > 1e-3
    found = find_joints(palletizer, T, Q)
    assert found.reached.all()
    np.testing.assert_allclose(palletizer.tool_in_base(found.calibrated), T, atol=1e-8)
    assert not find_joints(palletizer, np.stack([tilted(T[0], np.radians(4.0))]), Q[:1]).reached.any()


def test_positions_of_a_path_are_no_joints_called_xyz(tmp_path):
    """Such joints have columns by number."""
    steps = ({"ry_deg": 90.0}, {"rx_deg": -90.0}, {"ry_deg": -90.0})
    joint = [{"name": name, "type": "prismatic", "steps": [step]} for name, step in zip("XYZ", steps, strict=True)]
    robot = robot_from({"name": "gantry", "joint": joint})
    T, q = ErrorModel(robot).poses(np.full((2, 3), 0.3)), tmp_path / "q.csv"
    path = read_program(write_path(tmp_path / "path.csv", T), robot=robot)
    assert [move.end.q for move in path.motions] == [None, None]
    np.testing.assert_allclose(np.array([move.end.T for move in path.motions]), T, atol=1e-9)
    q.write_text("q1_mm,q2_mm,q3_mm\n100,200,300\n")
    (move,) = read_program(q, robot=robot).motions
    np.testing.assert_allclose(np.array(move.end.q), [0.1, 0.2, 0.3])
