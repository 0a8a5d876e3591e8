"""Poses tell no less of positions than their points do, also where the instrument's rotations stand askew."""

import numpy as np
import pytest

from taskcal.geometry import se3
from taskcal.identification.calibration import load_calibration
from taskcal.identification.identify import identify
from tests.identification.six_d import KINDS, ROBOTS, virtual


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ROBOTS)
def test_poses_predict_positions_no_worse_than_their_points_do(name, kind):
    errors = np.array([virtual(name, kind, seed).errors_mm(auto=False) for seed in range(3)])
    ratio = errors[:, 0] / errors[:, 1]
    assert np.median(ratio) < 1.02
    assert ratio.max() < 1.1


@pytest.mark.long
def test_auto_poses_beat_points_with_rotated_instrument():
    """With all effects and a rotated instrument, full poses predict better than points."""
    poses, points = virtual("abb-irb120", "turned instrument", 0).errors_mm(auto=True)
    assert poses < points


def test_instrument_rotation_is_saved_but_not_predicted(tmp_path):
    """The instrument's rotation is identified and saved, and does not enter a prediction."""
    case, sound = (virtual("ur5", kind, 1) for kind in ("turned instrument", "sound instrument"))
    found, plain = identify(case.model, case.fitted), identify(sound.model, sound.fitted)
    turn, width = found.z[-3:], np.sqrt(np.diag(found.z_covariance)[-3:])
    expected = se3.log(case.fitted.rotations @ np.swapaxes(sound.fitted.rotations, 1, 2)).mean(axis=0)
    assert found.all_names[-3:] == ("orientation.rx", "orientation.ry", "orientation.rz")
    assert (np.abs(turn - expected) < 4.0 * width).all()
    q = case.unseen.q
    np.testing.assert_allclose(found.predict(q), plain.predict(q), rtol=0, atol=2e-5)
    found.save(tmp_path / "cal.json")
    loaded = load_calibration(tmp_path / "cal.json")
    np.testing.assert_array_equal(loaded.residuals_on(case.fitted), found.residuals_on(case.fitted))


def test_the_left_jacobian_is_the_derivative_of_the_rotation():
    rng = np.random.default_rng(0)
    for size in (1e-6, 1e-2, 1.0, 3.0):
        w, d = size * rng.normal(size=3), 1e-6 * rng.normal(size=3)
        moved = se3.log(se3.exp(w + d) @ se3.exp(w - d).T) / 2.0
        np.testing.assert_allclose(se3.left_jacobian(w) @ d, moved, rtol=0, atol=1e-14)
