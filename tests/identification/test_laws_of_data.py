"""Laws of data and certainty: what is known exactly is predicted exactly, and more data never leave less certainty."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from taskcal.estimation.prior import GaussianPrior
from taskcal.identification.calibration import load_calibration
from taskcal.identification.identify import identify
from tests.laws.cells import STRUCTURES, cell, unseen

EXACT = {"model_error": 0.0, "prior_scale": 1.0, "gross_errors": "keep"}


@cache
def exactly(structure):
    """A cell that was measured without noise, and its calibration."""
    some = cell(structure, noise=1e-9)
    return some, identify(some.model, some.campaign, **EXACT)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_noise_free_data_give_true_predictions_to_1_nm(structure):
    """Data without noise give the true predictions to a nanometre."""
    some, calibration = exactly(structure)
    q = unseen(some, 100)
    nominal = some.model.poses(q) @ some.truth.T_tool_target[0]
    true = some.model.poses(q, some.truth.x) @ some.truth.T_tool_target[0]
    assert np.linalg.norm((true - nominal)[:, :3, 3], axis=1).min() > 1e-5
    np.testing.assert_allclose(calibration.predict(q), some.true_points(q), rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_calibration_of_any_structure_round_trips_bit_for_bit(structure, tmp_path):
    """A calibration of any structure is saved and loaded to the last bit."""
    some, made = exactly(structure)
    made.save(tmp_path / "cal.json")
    loaded, q = load_calibration(tmp_path / "cal.json"), unseen(some)
    np.testing.assert_array_equal(loaded.predict(q), made.predict(q))
    np.testing.assert_array_equal(loaded.predict_covariance(q), made.predict_covariance(q))
    loaded.save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "cal.json").read_bytes()


def no_more_certain(less, more, scale):
    """Whether a covariance is at least another one, along every direction."""
    difference = (less - more) / np.outer(scale, scale) if less.ndim == 2 else (less - more) / scale**2
    return np.linalg.eigvalsh(difference).min() > -1e-4


@pytest.mark.parametrize("structure", STRUCTURES)
def test_more_rows_and_more_targets_leave_nothing_less_certain(structure):
    """Defects of a micrometre, so that all fits are linear alike."""
    some = cell(structure, noise=1e-6, tolerance=1e-3, rows=60)
    model, q, target = some.model, unseen(some), some.campaign.targets[:1]
    known = {"model_error": 1e-6, "prior_scale": 1.0, "gross_errors": "keep"}
    campaigns = [some.campaign.take(slice(rows)).of_targets(target) for rows in (35, 45, 60)] + [some.campaign]
    fits = [identify(model, campaign, **known) for campaign in campaigns]
    for less, more in pairwise(fits):
        a, b = less.predict_covariance(q)[:, 0], more.predict_covariance(q)[:, 0]
        assert no_more_certain(a, b, np.sqrt(np.abs(a).max()))
        assert no_more_certain(less.covariance, more.covariance, model.tolerances)
    assert np.trace(fits[-1].covariance) < np.trace(fits[0].covariance)


def independent(model, q, order):
    """Columns that are independent, the first ones of an order preferred; and what all of them add to these."""
    J = model.jacobian(q).reshape(-1, len(model))
    J = J / np.linalg.norm(J, axis=0).max()
    kept, basis = [], np.zeros((len(J), 0))
    for k in order:
        rest = J[:, k] - basis @ (basis.T @ J[:, k])
        rest -= basis @ (basis.T @ rest)
        if np.linalg.norm(rest) > 1e-7:
            kept.append(k)
            basis = np.c_[basis, rest / np.linalg.norm(rest)]
    kept = np.sort(kept)
    return kept, np.linalg.lstsq(J[:, kept], J, rcond=None)[0]


@pytest.mark.parametrize("structure", ["seven axes", "coupled axes", "four-bar", "effects"])
def test_any_choice_of_independent_parameters_predicts_the_same(structure):
    some = cell(structure, noise=1e-6, tolerance=1e-3)
    model, q = some.model, unseen(some)
    rng, prior = np.random.default_rng(5), GaussianPrior.of_deviations(model.tolerances)
    known = {"model_error": 1e-6, "prior_scale": 1.0, "gross_errors": "keep"}
    whole = identify(model, some.campaign, prior=prior, **known)
    poses = np.concatenate([some.campaign.q, unseen(some, 100)])
    chosen = set()
    for _ in range(2):
        kept, B = independent(model, poses, rng.permutation(len(model)))
        less = identify(model, some.campaign, keep=[model.names[k] for k in kept], prior=prior.mapped(B), **known)
        np.testing.assert_allclose(less.predict(q), whole.predict(q), rtol=0.0, atol=1e-9)
        chosen.add(tuple(kept))
    assert len(chosen) == 2
