"""One model of geometry and effects: what is fitted, found and said of new poses."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, multivariate_t

from taskcal.estimation.noisy_rows import FREEDOM, log_weights, weigh
from taskcal.identification import holdout
from taskcal.identification.calibration import load_calibration
from taskcal.identification.effects import explain
from taskcal.identification.group_search import DRAWS, Sharpened, find_group_model, posterior_of, prove_lines
from taskcal.identification.holdout import split_postures, stretch_of
from taskcal.identification.identify import identify
from taskcal.identification.options import FitOptions
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import SPECTRUM, EncoderGain, Harmonics
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate
from tests.realdata.scores import gears, splits

GAIN = EncoderGain()


def measured(count=60, *, pose=False, true=GAIN, x=None, seed=0):
    model = ErrorModel(load_robot("abb-irb120"))
    rng = np.random.default_rng(seed)
    limits = np.clip(model.robot.limits, -1.2, 1.2)
    q, unseen = (rng.uniform(limits[:, 0], limits[:, 1], (n, 6)) for n in (count, 40))
    return model, *simulate(model + true, q, rng=rng, pose=pose, x=x), unseen


@pytest.mark.parametrize("pose", [False, True], ids=["points", "poses"])
def test_group_model_calibration_round_trips_bit_for_bit(tmp_path, pose):
    """A calibration of the group model is saved and loaded to the last bit."""
    model, campaign, _, unseen = measured(pose=pose)
    made = explain(model, campaign, candidates=(EncoderGain(), Harmonics(orders=(1, 2))), folds=3).calibration
    assert len(made.joint_error) == 6
    made.save(tmp_path / "cal.json")
    loaded = load_calibration(tmp_path / "cal.json")
    assert loaded.joint_error == made.joint_error
    np.testing.assert_array_equal(loaded.group_deviations, made.group_deviations)
    np.testing.assert_array_equal(loaded.predict(unseen), made.predict(unseen))
    np.testing.assert_array_equal(loaded.predict_covariance(unseen), made.predict_covariance(unseen))
    made.save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "cal.json").read_bytes()


def test_an_error_of_a_joint_turns_and_shifts_what_it_carries():
    model, campaign, _, unseen = measured(pose=True)
    made = replace(explain(model, campaign, candidates=(EncoderGain(),), folds=3).calibration, range_growth=0.0)
    C = made.predict_covariance(unseen) - made.predict_covariance(unseen, model_error=False)
    J = np.concatenate(
        [
            made.T_tracker_base[:3, :3] @ part
            for part in np.split(made.model.joint_jacobian(unseen, made.estimate), 2, axis=1)
        ],
        axis=1,
    )
    lever = made.T_tracker_base[:3, :3] @ made.tool_in_base(unseen)[:, :3, :3] @ made.T_tool_target[0, :3, 3]
    J[:, :3] += np.cross(J[:, 3:], lever[:, :, None], axis=1)
    white = np.diag(np.repeat(np.square(made.model_error), 3))
    expected = white + J @ np.diag(np.square(made.joint_error)) @ np.swapaxes(J, 1, 2)
    np.testing.assert_allclose(C[:, 0], expected, rtol=2e-3, atol=1e-13)


def test_dominant_gear_order_gets_its_own_variance():
    """Order 20 of one joint: among thirty that share a size it would be taken for noise, or they for as large."""
    tone = Harmonics(joints=("J2",), orders=(20,))
    model = ErrorModel(load_robot("abb-irb120"))
    x = np.zeros(len(model + tone))
    x[-2:] = 1.2e-4, -0.8e-4
    model, campaign, truth, unseen = measured(60, true=tone, x=x)
    found = explain(model, campaign, candidates=(SPECTRUM,), folds=3).calibration
    size = dict(zip(found.model.names, found.group_deviations, strict=True))
    assert size["J2.cos20"] == size["J2.sin20"] > 1e-5 > 2.0 * max(size["J2.cos19"], size["J2.cos21"], size["J3.cos20"])
    assert found.estimate[found.model.names.index("J2.cos20")] == pytest.approx(1.2e-4, abs=2e-5)
    error = np.linalg.norm(found.predict(unseen) - truth.points(unseen), axis=2).mean()
    told = identify(model + tone, campaign)
    assert error < 1.25 * np.linalg.norm(told.predict(unseen) - truth.points(unseen), axis=2).mean()


def test_non_integer_motor_order_is_identified():
    """A motor order is identified although it is not an integer."""
    tone = Harmonics(joints=("J2",), orders=(101.37,))
    model = ErrorModel(load_robot("abb-irb120"))
    x = np.zeros(len(model + tone))
    x[-2:] = 1.5e-4, -1e-4
    model, campaign, truth, unseen = measured(150, true=tone, x=x)
    found = explain(model, campaign, candidates=(SPECTRUM,), folds=3)
    sharp = [effect for effect in found.calibration.model.effects if effect.joints == ("J2",)]
    assert len(sharp) == 1
    assert min(abs(order - 101.37) for order in sharp[0].orders) < 0.5
    error = np.linalg.norm(found.calibration.predict(unseen) - truth.points(unseen), axis=2).mean()
    assert error < 3e-5


def test_a_line_that_lower_orders_would_follow_is_found_first():
    """A robot with lines of two gears beside low orders: the spectrum, fitted before them, follows that of J2."""
    model, campaign = gears(3)
    rows = next(iter(splits(model, campaign, (1, 0, 0))))[1]
    found = explain(model, campaign.take(rows))
    assert {name for effect in found.effects for name in effect.joints} == {"J2", "J3"}


def test_lines_need_the_evidence_of_the_whole_model():
    """A line that is not there does not stand beside the effects that are."""
    model, campaign, *_ = measured(40, true=Harmonics(orders=(1,)))
    start = fit_of(model, campaign, Harmonics(orders=(1,)))
    kept = prove_lines(identify(model, campaign), campaign, [("J2", 60.5)], start, FitOptions(), None)
    assert kept is start


def fit_of(model, campaign, effect):
    """Of geometry and an effect."""
    parts, base = split_postures(campaign.q, 3, 0), identify(model, campaign)
    found = find_group_model(base, campaign, [effect], [], parts, FitOptions(), seed=0, progress=[].append)
    return Sharpened(others=(effect,), lines=[], fitted=found.fitted)


def test_left_out_rows_are_judged_by_the_covariance_that_a_calibration_states(monkeypatch):
    """Were no row left out, folds and ends would be judged by what the calibration of the same draws predicts."""
    model, campaign, *_ = measured(40)
    fitted = fit_of(model, campaign, GAIN).fitted
    monkeypatch.setattr(holdout, "VALIDATION_DRAWS", DRAWS)
    part = np.arange(len(campaign))
    stated = holdout._judge(fitted, part, fitted.found, np.random.default_rng(0))[1]
    made = posterior_of(fitted, campaign, FitOptions(), 1.0, 0.0, np.random.default_rng(0)).calibration
    expected = made.predict_covariance(campaign.q) + campaign.covariances()
    np.testing.assert_allclose(stated, expected, rtol=1e-3, atol=1e-14)


@pytest.mark.parametrize("tracker", [0.01, 1.0, 3.0])
def test_regions_are_stretched_to_hold_what_they_say(tracker):
    """However much of the errors is the tracker's noise, which is known and not stretched."""
    rng = np.random.default_rng(0)
    for scale, nu in ((1.0, 1e3), (2.0, 8.0), (0.5, 1e3)):
        A = rng.normal(size=(2, 3000, 3, 3))
        predicted, noise = A @ np.swapaxes(A, 2, 3) * np.array([1.0, tracker**2])[:, None, None, None]
        covariance = noise + scale * predicted
        error = (np.linalg.cholesky(covariance) @ rng.normal(size=(3000, 3, 1)))[..., 0]
        error *= np.sqrt(nu / chi2.rvs(nu, size=(3000, 1), random_state=rng))
        held = noise + stretch_of(error, noise, predicted) * predicted
        square = np.einsum("ni,ni->n", error, np.linalg.solve(held, error[..., None])[..., 0])
        assert np.mean(square < chi2.ppf(0.95, 3)) == pytest.approx(0.95, abs=0.015)


def test_a_few_rows_that_are_far_off_hardly_move_the_others():
    model, campaign, truth, unseen = measured(60)
    points = campaign.points.copy()
    far = np.random.default_rng(1).permutation(60)[:4]
    points[far] += 2e-4 * np.random.default_rng(2).choice([-1.0, 1.0], (4, 1, 3))
    errors = [
        np.linalg.norm(
            explain(model, c, candidates=(GAIN,), folds=3).calibration.predict(unseen) - truth.points(unseen), axis=2
        )
        for c in (campaign, replace(campaign, points=points))
    ]
    assert errors[1].mean() < 1.3 * errors[0].mean()


def test_weights_of_poses_are_those_of_a_t_distribution():
    rng, size = np.random.default_rng(0), 1.7
    for numbers in (3, 9):
        error = rng.standard_t(5.0, size=(40, numbers))
        square = (error**2).sum(axis=1) / size
        weights = weigh(square, np.full(40, numbers))

        def likelihood(log, error=error, numbers=numbers):
            return multivariate_t.logpdf(error, shape=np.exp(log) * np.eye(numbers), df=FREEDOM).sum()

        slope = (likelihood(np.log(size) + 1e-5) - likelihood(np.log(size) - 1e-5)) / 2e-5
        assert 0.5 * (weights * square - numbers).sum() == pytest.approx(slope, rel=1e-6)
        normal = 0.5 * (numbers * np.log(weights) - weights * square).sum() + log_weights(weights)
        other = weights * np.exp(1e-3 * rng.standard_normal(40))
        assert 0.5 * (numbers * np.log(other) - other * square).sum() + log_weights(other) < normal
