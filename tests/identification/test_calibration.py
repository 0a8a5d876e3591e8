from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taskcal.errors import CampaignError
from taskcal.identification.calibration import Calibration
from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from tests.laws.campaigns import measure
from tests.laws.robots import irb6660_positions

KINDS = {
    "one target": {},
    "lost beams": {"targets": 3, "lost": 0.2},
    "poses": {"pose": True, "rotation_sigma": 5e-5},
}


def calibration(seed=0, *, kind="one target", **options) -> Calibration:
    rng = np.random.default_rng(seed)
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    x = rng.normal(size=len(model)) * model.tolerances
    campaign, _ = measure(rng, model, irb6660_positions(rng, 50), x, sigma=3e-5, **KINDS[kind])
    return identify(model, campaign, **options)


def test_calibration_estimate_is_zero_for_fixed_parameters():
    """Fixed parameters have an estimate of zero, and standard errors come from the covariance."""
    found = calibration(keep=["J2", "J4.rz"])
    kept = found.model.indices(["J2", "J4.rz"])
    others = np.setdiff1d(np.arange(45), kept)
    np.testing.assert_array_equal(found.estimate, found.z[:45])
    assert found.estimate[kept].all()
    assert not found.estimate[others].any()
    np.testing.assert_allclose(found.standard_errors, np.sqrt(np.diag(found.z_covariance)[:45]))
    np.testing.assert_allclose(found.standard_errors[others], found.prior_scale * found.model.tolerances[others])
    np.testing.assert_allclose(np.diag(found.correlation), 1.0)
    np.testing.assert_allclose(found.z_covariance, found.z_covariance.T)


@pytest.mark.parametrize("kind", KINDS)
def test_predicted_covariance_grows_by_the_model_error_alone(kind):
    found = calibration(kind=kind, model_error=(1e-4, 2e-4) if kind == "poses" else 1e-4)
    q = irb6660_positions(np.random.default_rng(1), 5)
    geometry, whole = found.predict_covariance(q, model_error=False), found.predict_covariance(q)
    expected = np.diag(np.repeat([1e-4**2, 2e-4**2][: 2 if kind == "poses" else 1], 3))
    np.testing.assert_allclose(whole - geometry, np.broadcast_to(expected, whole.shape), atol=1e-20)
    assert (np.linalg.eigvalsh(geometry) > 0).all()


def test_a_calibration_shows_robot_size_and_model_error():
    assert repr(calibration()).startswith(
        "Calibration(abb-irb6660-205-1.9: 45 parameters from 50 rows, model error 0.0"
    )


@pytest.mark.parametrize("kind", KINDS)
def test_residuals_are_measured_minus_predicted_on_campaign(kind):
    """Residuals on a campaign are measured minus predicted positions."""
    rng = np.random.default_rng(4)
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    campaign, _ = measure(rng, model, irb6660_positions(rng, 50), sigma=3e-5, **KINDS[kind])
    found, unseen = identify(model, campaign.take(range(40))), campaign.take(range(40, 50))
    np.testing.assert_allclose(found.residuals_on(campaign.take(range(40))), found.residuals, atol=1e-12)
    tracker, base = found.residuals_on(unseen), found.residuals_on(unseen, frame="base")
    ends, predicted = found.target_poses(unseen.q), found.predict(unseen.q)
    if unseen.rotations is None:
        np.testing.assert_allclose(ends[..., :3, 3], predicted, atol=1e-15)
        np.testing.assert_allclose(tracker, unseen.points - predicted, atol=1e-15)
    else:
        np.testing.assert_allclose(ends[:, 0], predicted, atol=1e-15)
        # the instrument's rotations may be turned against the axes of its positions
        seen = Rotation.from_rotvec(found.layout.unknowns(found.z)[0]).as_matrix() @ predicted[:, :3, :3]
        turned = Rotation.from_rotvec(tracker[:, 0, 3:]).as_matrix() @ seen
        np.testing.assert_allclose(turned, unseen.rotations, atol=1e-12)
    for part in range(0, tracker.shape[2], 3):
        rotated = tracker[..., part : part + 3] @ found.T_tracker_base[:3, :3]
        np.testing.assert_allclose(base[..., part : part + 3], rotated, atol=1e-15)
    assert np.abs(base - tracker)[unseen.valid].max() > 1e-6


def test_residuals_of_some_targets_are_told_by_their_names():
    rng = np.random.default_rng(5)
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    campaign, _ = measure(rng, model, irb6660_positions(rng, 50), sigma=3e-5, targets=3)
    found = identify(model, campaign)
    swapped = campaign.of_targets(("smr3", "smr1"))
    np.testing.assert_array_equal(found.residuals_on(swapped), found.residuals_on(campaign)[:, [2, 0]])
    other = replace(campaign, targets=("smr1", "smr2", "smr4"))
    with pytest.raises(CampaignError, match=r"target 'smr4' is not in the calibration, which knows smr1, smr2, smr3"):
        found.residuals_on(other)
