"""Plans that go on from a campaign or a calibration."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import CampaignError
from taskcal.identification.identify import identify
from taskcal.planning.plan import plan
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Compliance, EncoderGain
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import reach_task
from taskcal.virtual.cell import simulate
from taskcal_demo.procedure import reference_task
from tests.planning.measuring_cell import TASK, cell


def test_a_calibration_stands_for_the_campaign_it_is_from(model, listed, pool):
    """Effects included: the poses added are worth the same, whether the rows are given or what they taught."""
    extended = model + Compliance() + EncoderGain()
    campaign, _ = simulate(extended, pool[:40], rng=np.random.default_rng(4))
    fitted = identify(extended, campaign)
    assert fitted.model_error[0] == 0.0
    by_rows = plan(extended, listed, 6, candidates=pool, campaign=campaign)
    by_covariance = plan(extended, listed, 6, candidates=pool, calibration=fitted)
    assert by_covariance.expected == pytest.approx(by_rows.expected, rel=0.02)
    np.testing.assert_allclose(by_covariance.by_count, by_rows.by_count, rtol=0.05)
    assert by_covariance.expected < by_covariance.random.min()
    assert by_covariance.by_count[0] < by_covariance.before
    # what it starts from is what the calibration says of its own predictions
    goal = reach_task(extended, listed, 200, 0)
    said = np.trace(fitted.predict_covariance(goal.q)[:, 0], axis1=1, axis2=2)
    assert by_covariance.before == pytest.approx(np.sqrt(goal.weights @ said), rel=2e-3)
    # and what it promises is what the covariance becomes with the poses added, frames and effects included
    more, _ = simulate(
        extended, np.concatenate([campaign.q, by_covariance.q]), rng=np.random.default_rng(0), x=fitted.estimate
    )
    again = identify(extended, more, prior_scale=fitted.prior_scale, model_error=0.0)
    said = np.trace(again.predict_covariance(goal.q)[:, 0], axis1=1, axis2=2)
    assert by_covariance.expected == pytest.approx(np.sqrt(goal.weights @ said), rel=0.03)


def test_a_calibration_of_some_parameters_plans_for_these(model, listed, pool):
    campaign, _ = simulate(model, pool[:40], rng=np.random.default_rng(4))
    fitted = identify(model, campaign, keep=["J2", "J3"])
    made = plan(model, listed, 4, candidates=pool, calibration=fitted)
    assert made.expected < made.before < plan(model, listed, 4, candidates=pool).before


def test_calibrations_that_cannot_be_planned_on_are_refused(model, pool):
    def calibrate(**options):
        campaign, _ = simulate(model, pool[:30], rng=np.random.default_rng(0), **options)
        return campaign, identify(model, campaign)

    campaign, fitted = calibrate()
    with pytest.raises(ValueError, match="count it twice"):
        plan(model, TASK, 6, candidates=pool, campaign=campaign, calibration=fitted)
    with pytest.raises(CampaignError, match="another robot or model"):
        plan(model + EncoderGain(), TASK, 6, candidates=pool, calibration=fitted)
    with pytest.raises(CampaignError, match="this one is from poses"):
        plan(model, TASK, 6, candidates=pool, calibration=calibrate(pose=True)[1])
    with pytest.raises(CampaignError, match="held tracker frame"):
        plan(model, TASK, 6, candidates=pool, calibration=identify(model, campaign, frames="fixed"))
    with pytest.raises(CampaignError, match="has no prior"):
        plan(model, TASK, 6, candidates=pool, calibration=identify(model, campaign, keep=["J2.tx"], prior=None))
    several = calibrate(targets={"smr": np.zeros(3), "ball": np.full(3, 0.1)})[1]
    with pytest.raises(CampaignError, match="several targets; say with a station"):
        plan(model, TASK, 6, candidates=pool, calibration=several)
    with pytest.raises(CampaignError, match="another order than the calibration's targets; write smr, ball"):
        plan(model, TASK, 6, candidates=pool, calibration=several, station=cell())


def test_campaigns_that_do_not_fit_the_station_are_refused(model):
    q = reach_task(model, TASK, 20).q
    poses, _ = simulate(model, q, rng=np.random.default_rng(0), pose=True)
    with pytest.raises(CampaignError, match="campaign of points; this one measured poses"):
        plan(model, TASK, 6, candidates=50, campaign=poses)
    several, _ = simulate(model, q, rng=np.random.default_rng(0), targets={"a": np.zeros(3), "b": np.full(3, 0.1)})
    with pytest.raises(CampaignError, match="several targets; say with a station"):
        plan(model, TASK, 6, candidates=50, campaign=several)
    with pytest.raises(CampaignError, match="targets are a, b, the station's reflectors ball, smr; name them alike"):
        plan(model, TASK, 6, candidates=50, campaign=several, station=cell())


@pytest.mark.parametrize("within", [1.0, 0.005])
def test_a_plan_expects_what_the_fit_will_state_of_unlocated_targets(within):
    """Of poses in one tool orientation, over a task in others: the target is 0.1 m off along each axis, or less."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    turned, one_orientation = reference_task(np.radians(40.0)), reach_task(model, reference_task(), 200).q
    made = plan(model, turned, 30, candidates=one_orientation, model_error=1e-4, target_within=within)
    campaign, _ = simulate(model, made.q, rng=np.random.default_rng(0), model_error=1e-4)
    fitted = identify(model, campaign, model_error=1e-4, prior_scale=1.0, target_within=within, gross_errors="keep")
    goal = reach_task(model, turned, 300)
    covariance = replace(fitted, range_growth=0.0).predict_covariance(goal.q, model_error=False)[:, 0]
    stated = np.sqrt(goal.weights @ np.trace(covariance, axis1=1, axis2=2))
    assert made.expected == pytest.approx(stated, rel=0.02)
