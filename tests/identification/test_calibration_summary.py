"""The report of a calibration: correlations as the covariance has them, parameters in the units of their keys."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.identification.calibration import Calibration, largest_correlations
from taskcal.identification.held_out import LeftOut, Outlier
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


@pytest.mark.parametrize(("rows", "few"), [(9, True), (10, False)])
def test_fewer_than_two_numbers_for_each_unknown_are_remarked(rows: int, few: bool) -> None:
    """Fifteen unknowns: six parameters, the tracker frame and a target."""
    model, rng = ErrorModel(load_robot("ur5")), np.random.default_rng(1)
    campaign, _ = simulate(model, rng.uniform(-1.0, 1.0, (rows, 6)), rng=rng)
    found = identify(model, campaign, keep=["J3"])
    said = [remark for remark in found.remarks if "measured numbers for 15 unknowns" in remark]
    assert len(said) == few
    assert all(remark.startswith(f"{3 * rows} ") for remark in said)


def test_what_does_not_fit_is_reported_in_millimetres(calibration: Calibration) -> None:
    outlier = Outlier(row=7, line=9, id="p7", target="tool", studentised=5.5, residual=2.5e-3)
    left_out = LeftOut(row=3, line=5, id="p3", distance=0.0625, studentised=40.0)
    summary = replace(calibration, outliers=(outlier,), left_out=(left_out,)).summary()
    assert summary["outliers"] == [
        {"row": 7, "line": 9, "id": "p7", "target": "tool", "residual_mm": 2.5, "studentised": 5.5}
    ]
    assert summary["left_out"] == [{"row": 3, "line": 5, "id": "p3", "distance_mm": 62.5, "studentised": 40.0}]
    poses = replace(calibration, model_error=(2.0**-10, 2.0**-11)).summary()
    assert (poses["model_error_mm"], poses["model_error_mrad"]) == (1e3 * 2.0**-10, 1e3 * 2.0**-11)
