"""Plans and studies of a tracker that is moved."""

import numpy as np
import pytest

from taskcal.errors import CampaignError
from taskcal.observations.base import TrackerNoise
from taskcal.planning.expected_error import design
from taskcal.planning.options import PlanOptions
from taskcal.planning.plan import PoseChoice, plan
from taskcal.planning.study import study
from taskcal.task.task import reach_task
from taskcal.virtual.cell import simulate
from tests.planning.measuring_cell import TASK

EVEN = TrackerNoise(range_m=4e-5, range_per_m=0.0, transverse_m=4e-5, transverse_per_m=0.0)
"""The same from wherever a point is seen."""


@pytest.fixture(scope="module")
def moved(model):
    return plan(model, TASK, 24, candidates=400, refine=0, stations=2, noise=EVEN)


def test_a_planned_move_costs_a_little_of_the_expected_error(model, moved):
    one = plan(model, TASK, 24, candidates=400, refine=0, noise=EVEN)
    assert moved.station.tolist() == [0] * 12 + [1] * 12
    assert one.expected < moved.expected < 1.5 * one.expected
    assert one.grid < moved.grid
    assert one.random.mean() < moved.random.mean()
    assert moved.summary()["stations"] == 2
    assert moved.by_count[-1] == pytest.approx(moved.expected, rel=0.25)


def test_the_expected_error_is_that_of_a_campaign_of_two_stations(model, moved):
    exact = TrackerNoise(range_m=1e-12, range_per_m=0.0, transverse_m=1e-12, transverse_per_m=0.0)
    campaign, _ = simulate(
        model, moved.q, rng=np.random.default_rng(0), x=np.zeros(len(model)), noise=exact, stations=2
    )
    made = design(model, campaign, reach_task(model, TASK, 200, 0), noise=EVEN, model_error=(moved.model_error,))
    assert moved.expected == pytest.approx(made.expected_error(np.arange(len(model))), rel=2e-3)
    assert moved.before == pytest.approx(made.before, rel=2e-3)


def test_a_plan_that_goes_on_from_two_stations_knows_that_there_were_two(model):
    poses = reach_task(model, TASK, 40, 3).q
    errors = []
    for stations in (1, 2):
        campaign, _ = simulate(model, poses, rng=np.random.default_rng(1), stations=stations)
        errors.append(plan(model, TASK, 6, candidates=200, refine=0, campaign=campaign).expected)
    assert 0.9 * errors[0] < errors[1] < 2.0 * errors[0]


def test_what_stations_do_not_go_with_is_said(model):
    with pytest.raises(ValueError, match="stations: 0 is not 1 or more"):
        PlanOptions(stations=0)
    with pytest.raises(CampaignError, match="too few"):
        plan(model, TASK, 5, stations=2)


def test_a_study_moves_the_tracker(model):
    one, two = (
        study(model, TASK, robots=4, counts=[20], plans=["random"], stations=k, engine="sequential") for k in (1, 2)
    )
    first, second = (np.mean([row["rms_mm"] for row in found.rows]) for found in (one, two))
    assert first != second
    assert 0.5 * first < second < 2.0 * first


def test_a_plan_that_goes_on_counts_noise_as_each_station_saw_it(model):
    campaign, _ = simulate(model, reach_task(model, TASK, 40, 3).q, rng=np.random.default_rng(1), stations=2)
    noise, stations = (
        TrackerNoise(range_m=1e-6, range_per_m=0.0, transverse_m=1e-6, transverse_per_m=1e-5),
        campaign.stations,
    )
    choice = PoseChoice.among(model, TASK, PlanOptions(candidates=100, campaign=campaign, noise=noise))
    foreseen = choice.judged.linear.problem(campaign.q, campaign.valid, stations.of).noise[:, 0]
    for k, T in enumerate(stations.T_first_station):
        rows = stations.of == k
        seen = noise.covariance((campaign.points[rows, 0] - T[:3, 3]) @ T[:3, :3])
        np.testing.assert_allclose(foreseen[rows], T[:3, :3] @ seen @ T[:3, :3].T, rtol=0.02, atol=1e-13)
    near, far = sorted(np.trace(foreseen[stations.of == k], axis1=1, axis2=2).mean() for k in (0, 1))
    assert far > 1.1 * near
