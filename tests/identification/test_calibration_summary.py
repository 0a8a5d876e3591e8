"""The report of a calibration: correlations as the covariance has them, parameters in the units of their keys."""

import numpy as np
import pytest

from taskcal.identification.calibration import Calibration, largest_correlations
from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    model, rng = ErrorModel(load_robot("ur5")), np.random.default_rng(0)
    campaign, _ = simulate(model, rng.uniform(-1.0, 1.0, (40, 6)), rng=rng)
    return identify(model, campaign, keep=["J2", "J3", "J4.rz"])


def test_the_largest_correlations_are_those_of_the_covariance(calibration: Calibration) -> None:
    largest = largest_correlations(calibration, 8)
    names = list(calibration.all_names)
    for a, b, value in largest:
        i, j = names.index(a), names.index(b)
        variance = calibration.z_covariance[i, i] * calibration.z_covariance[j, j]
        assert value == pytest.approx(calibration.z_covariance[i, j] / np.sqrt(variance))
    sizes = [abs(value) for _, _, value in largest]
    assert sizes == sorted(sizes, reverse=True)
    fitted = {*calibration.kept, *names[len(calibration.model) :]}
    assert {name for a, b, _ in largest for name in (a, b)} <= fitted
    free = [i for i, name in enumerate(names) if name in fitted]
    every = np.abs(calibration.correlation[np.ix_(free, free)][np.triu_indices(len(free), 1)])
    np.testing.assert_allclose(sizes, np.sort(every)[::-1][:8])


def test_parameters_are_in_the_unit_of_their_keys(calibration: Calibration) -> None:
    summary = calibration.summary()
    assert [p["name"] for p in summary["parameters"]] == list(calibration.kept)
    for p, i in zip(summary["parameters"], calibration.estimated, strict=True):
        key, factor = ("mm", 1e3) if p["name"].split(".")[1].startswith("t") else ("mrad", 1e3)
        assert p[f"estimate_{key}"] == pytest.approx(calibration.estimate[i] * factor)
        assert p[f"standard_error_{key}"] == pytest.approx(calibration.standard_errors[i] * factor)
    assert summary["model_error_mm"] == calibration.model_error[0] * 1e3
