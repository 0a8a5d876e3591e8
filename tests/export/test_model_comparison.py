"""A model that someone uses beside the calibrated robot: how far it is off, with its own frames and with the best ones."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from taskcal.errors import FileError, TaskcalError
from taskcal.export.descriptions import Tree, export_urdf, urdf_text
from taskcal.export.forms import CalibratedChain, export_dh, spread_poses
from taskcal.export.model_comparison import compare_model, read_model
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.robot.catalogue import load_robot
from tests.laws.calibrations import calibrated


@pytest.fixture(scope="module")
def ur5() -> Calibration:
    return calibrated("ur5")


def test_an_exported_model_is_the_calibrated_robot(ur5, tmp_path):
    """A URDF as it stands; a table once base and tool are where they are best."""
    for form, write in {"urdf": export_urdf, "csv": lambda one: export_dh(one, "dh")}.items():
        path = tmp_path / f"robot.{form}"
        path.write_text(write(ur5).text, encoding="utf-8")
        compared = compare_model(ur5, read_model(str(path), None if form == "urdf" else "dh"))
        assert compared.frames_fitted.position.max() < 1e-9
        assert compared.frames_fitted.rotation.max() < 1e-7
        assert compared.as_it_stands.position.max() < (1e-9 if form == "urdf" else 2e-2)
        assert compared.nominal.position.mean() > 1e-4


@pytest.mark.parametrize("seed", range(6))
def test_frames_of_a_model_are_found_wherever_they_are(seed, ur5, tmp_path):
    """Any base, any tool, and other names of the joints."""
    rng = np.random.default_rng(seed)
    base, tool = (se3.pose(se3.exp(3.0 * rng.normal(size=3)), size * rng.normal(size=3)) for size in (1.0, 0.3))
    chain = CalibratedChain.of(ur5, ur5.q)
    first = replace(chain.joints[0], before=base @ chain.joints[0].before)
    moved = replace(chain, joints=(first, *chain.joints[1:]), end=chain.end @ tool)
    path = tmp_path / "robot.urdf"
    path.write_text(urdf_text(Tree.of(moved)).replace('"J', '"axis_'), encoding="utf-8")
    compared = compare_model(ur5, load_robot(path), joints=[f"axis_{k}" for k in range(1, 7)])
    np.testing.assert_allclose(compared.frames_fitted.position, 0.0, atol=1e-9)
    np.testing.assert_allclose(compared.frames_fitted.rotation, 0.0, atol=1e-7)
    np.testing.assert_allclose(compared.base @ base, np.eye(4), atol=1e-7)
    np.testing.assert_allclose(tool @ compared.tool, np.eye(4), atol=1e-7)


def test_the_fitted_frames_are_the_best_ones(ur5):
    """As SciPy finds them; and the distances are those of the poses, in the units that their keys name."""
    model, q = load_robot("ur5"), spread_poses(ur5, 60)
    T, own = ur5.tool_in_base(q), model.tool_poses(q)

    def left(x):
        moved = se3.pose(se3.exp(x[3:6]), x[:3]) @ own
        return (se3.apply(moved, x[6:]) - T[:, :3, 3]).ravel()

    best = least_squares(left, np.zeros(9), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    compared = compare_model(ur5, model, q)
    position = np.linalg.norm(left(best.x).reshape(-1, 3), axis=1)
    np.testing.assert_allclose(compared.frames_fitted.position, position, atol=1e-8)
    off = np.linalg.norm(own[:, :3, 3] - T[:, :3, 3], axis=1)
    turned = [np.linalg.norm(se3.log(a[:3, :3].T @ b[:3, :3])) for a, b in zip(own, T, strict=True)]
    said = compared.summary()["as_it_stands"]
    assert said["mean_mm"] == pytest.approx(1e3 * off.mean())
    assert said["max_deg"] == pytest.approx(np.degrees(max(turned)))
    worst = compared.summary()["worst"]
    assert worst["joints"]["J2_deg"] == pytest.approx(np.degrees(q[position.argmax(), 1]))


def test_other_joints_are_refused_or_named(ur5, tmp_path):
    with pytest.raises(TaskcalError, match=r"barrett-wam has the joints J1, .*J7, ur5 J1, .*J6$"):
        compare_model(ur5, load_robot("barrett-wam"))
    with pytest.raises(TaskcalError, match=r"named were a, b; name the model's .*--joints J1,J2,J3,J4,J5,J6"):
        compare_model(ur5, load_robot("ur5"), joints=["a", "b"])
    swapped = compare_model(ur5, load_robot("ur5"), joints=["J2", "J1", "J3", "J4", "J5", "J6"])
    assert swapped.frames_fitted.position.mean() > 0.1
    path = tmp_path / "table.csv"
    path.write_text(export_dh(ur5, "dh").text, encoding="utf-8")
    with pytest.raises(FileError, match="--convention"):
        read_model(str(path))
