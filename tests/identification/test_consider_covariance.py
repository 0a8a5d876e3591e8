"""Parameters that are not estimated: their covariance is considered (Schmidt), or they change nothing."""

import numpy as np
import pytest
from scipy.linalg import qr

from taskcal.estimation.prior import GaussianPrior
from taskcal.identification import hyperparameters
from taskcal.identification.calibration import load_calibration
from taskcal.identification.identify import identify
from taskcal.identification.layout import frame_precision
from taskcal.identification.problem import Rows, Seen
from taskcal.registration.registration import register
from tests.identification.arms import KINDS, arm, defects
from tests.laws.campaigns import measure
from tests.laws.robots import industrial_positions


def residuals(layout, campaign, z):
    at = layout.walked(campaign.q, z)
    return Rows(layout, z, at, Seen.of(campaign)).propagate(np.zeros((len(z),) * 2))[0]


def dense_jacobian(layout, campaign, z):
    """∂(predicted)/∂z of every block by central differences, rotations as the residual has them: (n, targets, b, z)."""

    def residual(z):
        return residuals(layout, campaign, z)

    steps = 1e-6 * np.eye(len(z))
    return np.stack([(residual(z - h) - residual(z + h)) / 2e-6 for h in steps], axis=-1)


def tiny_campaign(seed):
    """Defects of a micrometre, whose squares do not count, on an arm whose tolerances are as small."""
    rng, model = arm(seed, tolerance_mm=1e-3)
    q = industrial_positions(rng, 60)
    campaign, _ = measure(rng, model, q, defects(rng, model), sigma=1e-6, uncertainty=1e-6)
    return rng, model, campaign


def kept_and_relations(model, q):
    """Independent columns K by pivoted QR, and B with J = J_K·B for the whole pose, so for every target."""
    J = model.jacobian(q).reshape(-1, len(model))
    R, order = qr(J, mode="r", pivoting=True)
    diagonal = np.abs(np.diag(R))
    rank = int((diagonal > 1e-9 * diagonal[0]).sum())
    kept = np.sort(order[:rank])
    B = np.linalg.lstsq(J[:, kept], J, rcond=None)[0]
    np.testing.assert_allclose(J[:, kept] @ B, J, atol=1e-10)
    return kept, B


@pytest.mark.parametrize("seed", range(3))
def test_minimal_model_with_mapped_prior_predicts_as_full_model(seed):
    """The minimal model with the mapped prior gives the predictions of the full model."""
    rng, model, campaign = tiny_campaign(seed)
    kept, B = kept_and_relations(model, industrial_positions(rng, 200))
    assert len(kept) < len(model)
    full = GaussianPrior.of_deviations(model.tolerances)
    fixed = {"model_error": 1e-6, "prior_scale": 1.0}
    whole = identify(model, campaign, prior=full, **fixed)
    minimal = identify(model, campaign, keep=[model.names[i] for i in kept], prior=full.mapped(B), **fixed)
    q = industrial_positions(rng, 100)
    np.testing.assert_allclose(minimal.predict(q), whole.predict(q), rtol=0, atol=1e-9)
    np.testing.assert_allclose(B @ whole.estimate, minimal.estimate[kept], atol=1e-9)
    np.testing.assert_allclose(minimal.predict_covariance(q), whole.predict_covariance(q), rtol=1e-3, atol=1e-16)


@pytest.mark.parametrize("seed", range(3))
def test_dropping_dependent_parameter_keeps_predictions(seed):
    """Dropping a linearly dependent parameter leaves every prediction unchanged."""
    rng, model, campaign = tiny_campaign(seed)
    J = model.jacobian(industrial_positions(rng, 200)).reshape(-1, len(model))
    full, fixed = GaussianPrior.of_deviations(model.tolerances), {"model_error": 1e-6, "prior_scale": 1.0}
    whole, q = identify(model, campaign, prior=full, **fixed), industrial_positions(rng, 100)
    dropped = 0
    for k in rng.permutation(len(model)):
        others = np.delete(np.arange(len(model)), k)
        c, *_ = np.linalg.lstsq(J[:, others], J[:, k], rcond=1e-12)
        if np.linalg.norm(J[:, others] @ c - J[:, k]) > 1e-9:
            continue
        B = np.zeros((len(others), len(model)))
        B[np.arange(len(others)), others], B[:, k] = 1.0, c
        less = identify(model, campaign, keep=[model.names[i] for i in others], prior=full.mapped(B), **fixed)
        np.testing.assert_allclose(less.predict(q), whole.predict(q), rtol=0, atol=1e-9)
        assert less.estimate[k] == 0.0
        dropped += 1
        if dropped == 4:
            return
    raise AssertionError("the arm has no four dependent parameters")


@pytest.mark.parametrize("kind", KINDS)
def test_consider_covariance_equals_independent_calculation(monkeypatch, kind):
    """The covariance of an estimator x = G·y, whatever its gain, from the dense matrices of the whole problem.

    Variances of the measurements are taken as known, so that regions are not widened for how well they are.
    """
    monkeypatch.setattr(hyperparameters, "region_factor", lambda _: 1.0)
    rng, model = arm(6)
    campaign, _ = measure(rng, model, industrial_positions(rng, 30), defects(rng, model), sigma=3e-5, **KINDS[kind])
    keep = ["J2", "J4.rz", "tool.tx"]
    found = identify(model, campaign, keep=keep)
    whole = identify(model, campaign)
    assert found.model_error == pytest.approx(whole.model_error)
    assert found.prior_scale == pytest.approx(whole.prior_scale)
    own = GaussianPrior.of_deviations(model.tolerances[found.estimated])
    reduced = identify(model, campaign, keep=keep, prior=own)
    layout, valid = found.layout, campaign.valid
    b = campaign.covariances(None).shape[-1]
    J = dense_jacobian(layout, campaign, found.z)[valid].reshape(-1, len(found.z))
    tracker = campaign.covariances(None)[valid]
    blocks = np.arange(len(tracker) * b).reshape(-1, b)

    def noise(deviations):
        R = np.zeros((J.shape[0], J.shape[0]))
        for rows, C in zip(blocks, tracker, strict=True):
            R[np.ix_(rows, rows)] = C + np.diag(np.repeat(np.square(deviations), 3))
        return R

    k = np.concatenate([found.estimated, np.arange(len(model), len(found.z))])
    frames = frame_precision(layout)
    P = np.zeros((len(k), len(k)))
    P[: len(found.estimated), : len(found.estimated)] = np.diag(
        1.0 / (reduced.prior_scale * model.tolerances[found.estimated]) ** 2
    )
    P[len(found.estimated) :, len(found.estimated) :] = frames
    W, Jk = np.linalg.inv(noise(reduced.model_error)), J[:, k]
    gain = np.linalg.solve(Jk.T @ W @ Jk + P, Jk.T @ W)
    prior = np.zeros((len(found.z),) * 2)
    prior[: len(model), : len(model)] = np.diag((whole.prior_scale * model.tolerances) ** 2)
    prior[len(model) :, len(model) :] = np.linalg.inv(frames)
    follow = np.zeros((len(found.z), J.shape[0]))
    follow[k] = gain
    rest = np.eye(len(found.z)) - follow @ J
    expected = rest @ prior @ rest.T + follow @ noise(whole.model_error) @ follow.T
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(
        found.z_covariance / np.outer(scale, scale), expected / np.outer(scale, scale), atol=2e-5
    )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("prior", ["tolerances", None])
def test_residuals_without_parameters_equal_registration(kind, prior, tmp_path):
    """With no parameter to estimate, the residuals are those of the registration."""
    rng, model = arm(6)
    q = industrial_positions(rng, 30)
    campaign, _ = measure(rng, model, q, defects(rng, model), sigma=3e-5, **KINDS[kind])
    found = identify(model, campaign, keep=[], frames="fixed", prior=prior)
    frames = register(model, campaign)
    ends = (frames.T_tracker_base @ model.poses(q))[:, None] @ frames.T_tool_target
    np.testing.assert_allclose(found.residuals[..., :3], campaign.points - ends[..., :3, 3], atol=1e-12)
    off = found.residuals[campaign.valid][:, :3]
    assert np.sqrt((off**2).sum(axis=1).mean()) == pytest.approx(frames.rms)
    assert (found.kept, found.reason) == ((), "nothing was to be estimated")
    if prior is None:
        # nothing was fitted, so that their mean square is the model error's variance, but for the tracker's noise
        assert found.model_error[0] ** 2 == pytest.approx(np.mean(off**2), rel=0.1)
        np.testing.assert_array_equal(found.predict_covariance(q, model_error=False), 0.0)
    else:  # the robot's tolerances explain it
        stated = np.trace(found.predict_covariance(q)[..., :3, :3], axis1=2, axis2=3).mean()
        assert 0.2 < (off**2).sum(axis=1).mean() / stated < 5.0
    found.save(tmp_path / "nothing.json")
    np.testing.assert_array_equal(load_calibration(tmp_path / "nothing.json").predict(q), found.predict(q))
