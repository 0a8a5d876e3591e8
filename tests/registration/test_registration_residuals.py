"""What the nominal robot leaves in a registered frame, against distances worked out point by point."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import CampaignError
from taskcal.observations.base import TrackerNoise
from taskcal.registration.registration import RegistrationResiduals, register, registration_residuals
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate


def test_residuals_are_distances_from_the_nominal_targets() -> None:
    model, rng = ErrorModel(load_robot("ur5")), np.random.default_rng(0)
    q = rng.uniform(-1.0, 1.0, (20, 6))
    targets = {"a": np.array([0.0, 0.0, 0.1]), "b": np.array([0.1, 0.0, 0.0])}
    campaign, _ = simulate(model, q, rng=rng, targets=targets, noise=TrackerNoise())
    points = campaign.points.copy()
    points[3, 0] = np.nan
    campaign = replace(campaign, points=points)
    found = register(model, campaign)
    residuals = registration_residuals(found, model, campaign)
    for i, T in enumerate(model.poses(q)):
        for t in range(2):
            place = (found.T_tracker_base @ T @ found.T_tool_target[t])[:3, 3]
            assert residuals.distances[i, t] == pytest.approx(np.linalg.norm(points[i, t] - place), nan_ok=True)
    assert residuals.summary()["max_mm"] == pytest.approx(residuals.by_row.max() * 1e3)


def test_residuals_of_sockets_are_distances_from_their_sockets() -> None:
    """Without a tracker the file holds no positions: what is left is measured against the sockets that registration found."""
    model, rng = ErrorModel(load_robot("ur5")), np.random.default_rng(0)
    campaign, _ = simulate(model, rng.uniform(-1.0, 1.0, (40, 6)), rng=rng, observe="socket")
    found = register(model, campaign)
    residuals = registration_residuals(found, model, campaign)
    assert residuals.rms == pytest.approx(found.rms)
    assert residuals.maximum < 0.02
    with pytest.raises(CampaignError, match="the registration lacks the fixed objects"):
        registration_residuals(replace(found, unknowns=()), model, campaign)


def test_statistics_are_those_of_the_targets_seen() -> None:
    residuals = RegistrationResiduals(np.array([[3e-3, np.nan], [4e-3, 5e-3], [np.nan, np.nan]]))
    assert residuals.summary() == pytest.approx({"mean_mm": 4.0, "rms_mm": np.sqrt(50.0 / 3.0), "max_mm": 5.0})
    np.testing.assert_array_equal(residuals.by_row, [3e-3, 5e-3, 0.0])
