from dataclasses import replace

import numpy as np
import pytest
import scipy.optimize

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import CampaignError, FitError, UnknownName
from taskcal.identification.identify import attempt, identify
from taskcal.identification.layout import BASE_PRIOR, TARGET_PRIOR
from taskcal.identification.options import FitOptions
from taskcal.observations.base import TrackerNoise
from taskcal.observations.pose import TURN_PRIOR
from taskcal.registration.registration import Registration, register
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import COMPONENTS, ErrorModel
from tests.identification.arms import KINDS, arm, defects, true_points
from tests.laws import plain
from tests.laws.campaigns import measure
from tests.laws.robots import industrial_positions, irb6660_positions


class Reference:
    """The same least-squares problem written out plainly, for SciPy."""

    def __init__(self, model, campaign, registration, model_error, prior_scale):
        self.model, self.campaign, self.registration = model, campaign, registration
        self.pose = campaign.rotations is not None
        self.p, targets = len(model), len(campaign.targets)
        covariance = campaign.covariances(TrackerNoise()) + np.diag(np.repeat(np.square(model_error), 3))
        self.white = np.linalg.inv(np.linalg.cholesky(covariance))
        per_target = 6 if self.pose else 3
        self.sizes = np.concatenate(
            [
                prior_scale * model.tolerances,
                np.full(6, BASE_PRIOR),
                np.full(per_target * targets, TARGET_PRIOR),
                np.full(3 * self.pose, TURN_PRIOR),
            ]
        )
        self.start = np.zeros(len(self.sizes))
        if not self.pose:
            self.start[self.p + 6 :] = registration.T_tool_target[:, :3, 3].reshape(-1)

    def ends(self, z, q):
        """Poses of the targets in the tracker frame."""
        base = self.registration.T_tracker_base @ plain.error_frame(z[self.p : self.p + 6])
        if self.pose:
            tools = (self.registration.T_tool_target[0] @ plain.error_frame(z[self.p + 6 : self.p + 12]))[None]
        else:
            tools = np.tile(np.eye(4), (len(self.campaign.targets), 1, 1))
            tools[:, :3, 3] = z[self.p + 6 :].reshape(-1, 3)
        return base @ self.model.poses(q, z[: self.p])[:, None] @ tools

    def whitened(self, z):
        """One row per block that was seen."""
        ends = self.ends(z, self.campaign.q)
        r = self.campaign.points - ends[..., :3, 3]
        if self.pose:
            predicted = plain.rotation_of(z[self.p + 12 :]) @ ends[..., :3, :3]
            turned = self.campaign.rotations[:, None] @ predicted.swapaxes(-1, -2)
            r = np.concatenate([r, np.array([[plain.rotation_vector(R) for R in row] for row in turned])], axis=-1)
        return np.einsum("ntij,ntj->nti", self.white, r)[self.campaign.valid]

    def solve(self):
        def residuals(z):
            return np.concatenate([self.whitened(z).reshape(-1), (z - self.start) / self.sizes])

        tight = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15}
        scale = np.minimum(self.sizes, 1e-3)
        return scipy.optimize.least_squares(
            residuals, self.start, jac="3-point", x_scale=scale, max_nfev=200, **tight
        ).x


@pytest.mark.parametrize("kind", KINDS)
def test_the_fit_agrees_with_scipys_least_squares(kind):
    rng, model = arm(1)
    q = industrial_positions(rng, 30)
    campaign, _ = measure(rng, model, q, defects(rng, model), sigma=3e-5, **KINDS[kind])
    model_error = (4e-5, 1e-4) if campaign.rotations is not None else 4e-5
    calibration = identify(model, campaign, model_error=model_error, prior_scale=1.5)
    reference = Reference(model, campaign, register(model, campaign), model_error, 1.5)
    z = reference.solve()
    unseen = industrial_positions(rng, 50)
    predicted, expected = calibration.predict(unseen), reference.ends(z, unseen)
    if campaign.rotations is None:
        np.testing.assert_allclose(predicted, expected[..., :3, 3], rtol=1e-8, atol=1e-8)
    else:
        np.testing.assert_allclose(predicted, expected[:, 0], rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(calibration.estimate / model.tolerances, z[: len(model)] / model.tolerances, atol=1e-4)


@pytest.mark.parametrize("spread_deg", [0, 20])
@pytest.mark.parametrize("seed", range(2))
def test_irb6660_without_prior_converges_in_one_orientation(spread_deg, seed):
    """Without a prior the IRB 6660 measured in nearly one orientation does not diverge."""
    rng = np.random.default_rng(seed)
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = irb6660_positions(rng, 60)
    wrist = np.radians([20.0, 60.0, -30.0])
    q[:, 3:] = wrist + np.radians(spread_deg) * rng.uniform(-1, 1, (60, 3))
    x = defects(rng, model)
    campaign, truth = measure(rng, model, q, x, sigma=2e-5, uncertainty=2e-5)
    for prior in (None, "tolerances"):
        calibration = identify(model, campaign, prior=prior)
        assert np.abs(calibration.estimate).max() < 6.0 * np.abs(x).max()
        seen = calibration.predict(q) - true_points(model, truth, q)
        assert np.linalg.norm(seen, axis=-1).mean() < 5e-5


OUTLIERS = {4: 3e-3, 17: 1.5e-3, 40: 5e-3}


@pytest.mark.parametrize("kind", KINDS)
def test_outliers_are_named_and_leaving_them_out_recovers_robot(kind):
    """Outliers are named by row where they are kept; left out by the fit, they do no harm."""
    rng, model = arm(3)
    campaign, truth = measure(rng, model, industrial_positions(rng, 80), defects(rng, model), sigma=2e-5, **KINDS[kind])
    clean = identify(model, campaign)
    assert not {o.row for o in clean.outliers} & set(OUTLIERS)
    points = campaign.points.copy()
    for row, size in OUTLIERS.items():
        points[row] += size * np.array([0.6, -0.64, 0.48])
    spoilt = replace(campaign, points=points)
    found = identify(model, spoilt, gross_errors="keep")
    named = [o.row for o in found.outliers]
    assert found.outliers[0].studentised == max(o.studentised for o in found.outliers)
    assert all(o.id == campaign.ids[o.row] and o.target in campaign.targets for o in found.outliers)
    assert 40 in named
    found = identify(model, spoilt)
    assert {row.row for row in found.left_out} == set(OUTLIERS)
    q = industrial_positions(rng, 100)
    T = found.predict(q)
    predicted = T[:, None, :3, 3] if found.layout.pose else T
    error = np.linalg.norm(predicted - true_points(model, truth, q), axis=-1)
    assert error.mean() < 4e-5


def test_the_stated_covariance_is_that_of_repeated_campaigns():
    rng, model = arm(7)
    measured, unseen = industrial_positions(rng, 40), industrial_positions(rng, 10)
    square, parameter_square = [], []
    for _ in range(80):
        campaign, truth = measure(rng, model, measured, defects(rng, model), sigma=3e-5, uncertainty=3e-5)
        calibration = identify(model, campaign, model_error=0.0, prior_scale=1.0)
        error = (true_points(model, truth, unseen) - calibration.predict(unseen))[:, 0]
        covariance = calibration.predict_covariance(unseen)[:, 0]
        square.append(np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance), error) / 3)
        deviation = calibration.estimate - truth.x
        parameter_square.append(deviation @ np.linalg.solve(calibration.covariance, deviation) / len(model))
    assert 0.85 < np.mean(square) < 1.18
    assert 0.9 < np.mean(parameter_square) < 1.1


def test_the_model_error_is_found_and_a_sound_campaign_has_none():
    rng, model = arm(8)
    q = industrial_positions(rng, 200)
    sound, _ = measure(rng, model, q, defects(rng, model), sigma=2e-5, uncertainty=2e-5)
    assert identify(model, sound).model_error[0] < 1e-5
    noisy, _ = measure(rng, model, q, defects(rng, model), sigma=1e-4, uncertainty=2e-5)
    assert identify(model, noisy).model_error[0] == pytest.approx(np.sqrt(1e-4**2 - 2e-5**2), rel=0.15)


def test_fixed_frames_stay_as_registered():
    """Frames that are held fixed keep their registered values."""
    rng, model = arm(4)
    campaign, truth = measure(rng, model, industrial_positions(rng, 60), defects(rng, model), targets=2, sigma=1e-5)
    held = Registration(
        T_tracker_base=truth.T_tracker_base, T_tool_target=truth.T_tool_target, rms=0.0, unobservable=np.zeros((6, 6))
    )
    calibration = identify(model, campaign, registration=held, frames="fixed")
    assert calibration.all_names == model.names
    np.testing.assert_array_equal(calibration.T_tracker_base, truth.T_tracker_base)
    np.testing.assert_array_equal(calibration.T_tool_target, truth.T_tool_target)
    q = industrial_positions(rng, 50)
    np.testing.assert_allclose(calibration.predict(q), true_points(model, truth, q), atol=1e-4)


@pytest.mark.parametrize(
    ("keep", "expected"),
    [
        (["J3.tx", "J1.rz"], ["J1.rz", "J3.tx"]),
        (["t3x", "alf6"], ["J3.tx", "J6.rz"]),
        (["J5"], [f"J5.{c}" for c in COMPONENTS]),
        (["loop", "tool.tx"], ["tool.tx", "loop.crank", "loop.rod", "loop.rocker"]),
    ],
)
def test_parameters_are_kept_by_name_symbol_or_joint(keep, expected):
    rng = np.random.default_rng(0)
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    campaign, _ = measure(rng, model, irb6660_positions(rng, 30), sigma=1e-4)
    calibration = identify(model, campaign, keep=keep)
    assert list(calibration.kept) == expected
    others = np.setdiff1d(np.arange(45), model.indices(keep))
    assert not calibration.estimate[others].any()
    without = identify(model, campaign, keep=keep, prior=None)
    assert not without.covariance[others].any()  # without a prior nothing is believed of them


def test_an_unknown_parameter_cannot_be_kept():
    rng, model = arm(0)
    campaign, _ = measure(rng, model, industrial_positions(rng, 30))
    with pytest.raises(
        UnknownName, match=r"no parameter 'J7\.tx' in random-6R; joint frames run from J1 to J6, then tool"
    ):
        identify(model, campaign, keep=["J3.tx", "J7.tx"])


def test_a_fit_is_the_same_whatever_the_order_of_the_rows():
    rng, model = arm(6)
    campaign, _ = measure(rng, model, industrial_positions(rng, 40), defects(rng, model), sigma=2e-5)
    order = rng.permutation(40)
    q = industrial_positions(rng, 20)
    a, b = identify(model, campaign), identify(model, campaign.take(order))
    np.testing.assert_allclose(a.predict(q), b.predict(q), atol=1e-8)
    np.testing.assert_allclose(a.residuals[order], b.residuals, atol=1e-8)


@pytest.mark.parametrize("kind", KINDS)
def test_residuals_are_measured_minus_predicted_or_nan(kind):
    """Residuals are measured minus predicted, and NaN for rows with a lost beam."""
    rng, model = arm(2)
    campaign, _ = measure(rng, model, industrial_positions(rng, 40), defects(rng, model), sigma=2e-5, **KINDS[kind])
    calibration = identify(model, campaign)
    T = calibration.predict(campaign.q)
    predicted = T[:, None, :3, 3] if campaign.rotations is not None else T
    np.testing.assert_allclose(calibration.residuals[..., :3], campaign.points - predicted, atol=1e-12)
    np.testing.assert_array_equal(np.isnan(calibration.studentised), ~campaign.valid)


def test_a_campaign_that_is_another_robots_is_refused():
    rng, model = arm(0)
    campaign, _ = measure(rng, model, industrial_positions(rng, 40))
    with pytest.raises(CampaignError, match="joint values and points are inconsistent with ur5"):
        identify(ErrorModel(load_robot("ur5")), campaign)


def test_a_fit_that_does_not_converge_says_what_to_try(monkeypatch):
    from taskcal.identification import hyperparameters as module

    rng, model = arm(0)
    campaign, _ = measure(rng, model, industrial_positions(rng, 40), defects(rng, model), sigma=1e-4)
    whole = module.fit

    def impatient(*args):
        return whole(*args[:5], replace(args[5], iterations=1), *args[6:])

    monkeypatch.setattr(module, "fit", impatient)
    with pytest.raises(FitError, match=r"did not converge: no convergence in 1 iterations .*taskcal doctor"):
        attempt(model, campaign, FitOptions(model_error=1e-4, prior_scale=1.0)).learnt()
    with pytest.raises(FitError, match="keep the prior"):
        identify(model, campaign, model_error=1e-4, prior=None)


def test_a_robot_far_from_its_tolerances_is_remarked():
    rng, model = arm(0)
    x = 20.0 * rng.normal(size=len(model)) * model.tolerances
    campaign, _ = measure(rng, model, industrial_positions(rng, 60), x, sigma=1e-5)
    found = identify(model, campaign)
    assert any("times as much as its tolerances say" in remark for remark in found.remarks)


@pytest.mark.parametrize("sigma", [0.0, 3e-5])
def test_points_calculated_in_the_base_are_remarked(sigma):
    rng, model = arm(0)
    q = industrial_positions(rng, 60)
    points = model.poses(q, rng.normal(size=len(model)) * model.tolerances)[:, None, :3, 3]
    points = points + sigma * rng.normal(size=points.shape)
    found = identify(model, Campaign(ids=tuple(map(str, range(60))), q=q, targets=("tool",), points=points))
    assert any("a frame that is the robot's own base" in remark for remark in found.remarks) == (sigma == 0.0)


def test_step_is_shortened_if_loop_does_not_close():
    """Near its singular position the loop turns ever faster with its lengths, so that the first step goes too far."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    rng = np.random.default_rng(0)
    q = irb6660_positions(rng, 30)
    q[:, 2] = q[:, 1] + np.radians(82.0)
    x, rod = np.zeros(len(model)), model.indices(["loop.rod"])
    x[rod] = 15e-3
    drive = model.robot.four_bar
    assert drive.closes(q, x[-3:]).all()
    assert not drive.closes(q, 1.2 * x[-3:]).any()
    campaign, truth = measure(rng, model, q, x, sigma=3e-5)
    frames = Registration(
        T_tracker_base=truth.T_tracker_base,
        T_tool_target=truth.T_tool_target,
        rms=0.0,
        unobservable=np.zeros((3, 3)),
    )
    found = identify(model, campaign, keep=["loop.rod"], registration=frames, frames="fixed", prior_scale=10.0)
    np.testing.assert_allclose(found.estimate[rod], x[rod], atol=1e-5)


def test_open_loop_row_is_named_if_frames_are_given():
    """A row at which the loop does not close is named although the frames are given."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    campaign, _ = measure(np.random.default_rng(0), model, irb6660_positions(np.random.default_rng(1), 30))
    frames, q = register(model, campaign), campaign.q.copy()
    q[7, 2] = q[7, 1] + np.radians(100.0)
    folded = replace(campaign, q=q)
    for registration in (None, frames):
        with pytest.raises(CampaignError, match=r"four-bar does not close at row 7 \(id 7\): .*folded over"):
            identify(model, folded, registration=registration, model_error=0.0)
