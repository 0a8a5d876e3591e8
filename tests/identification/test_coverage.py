"""What a calibration says of its own uncertainty holds, over many true robots drawn from the prior."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.analysis.identifiability import identifiability, published_kept
from taskcal.identification.identify import identify
from taskcal.planning.expected_error import design
from taskcal.planning.selection import select
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import reach_task
from taskcal.virtual.cell import simulate
from taskcal_demo.procedure import reference_task

MANY = pytest.param(100, marks=pytest.mark.long)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("spread_deg", "campaigns"),
    [(20.0, 60), *(pytest.param(spread, 300, marks=pytest.mark.long) for spread in (20.0, 0.0))],
)
def test_interval_coverage_is_nominal_and_error_is_near_bound(spread_deg, campaigns):
    """Intervals have their nominal coverage, and the error is near its lower bound.

    Of 300 robots the coverage has a standard error of 0.0035, a sixth of what is allowed, and the ratio to the bound one of 1.8 %;
    of 60, 0.008 and 4 %.
    """
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    task = reference_task(np.radians(spread_deg))
    measured, unseen = reach_task(model, task, 60), reach_task(model, task, 50, seed=1)
    simulated = [simulate(model, measured.q, rng=np.random.default_rng(seed)) for seed in range(campaigns)]
    inside, square = np.zeros(3), 0.0
    for campaign, truth in simulated:
        estimate = identify(model, campaign)
        error = (truth.points(unseen.q) - estimate.predict(unseen.q))[:, 0]
        deviation = np.sqrt(np.einsum("ntii->nti", estimate.predict_covariance(unseen.q)))[:, 0]
        inside += (np.abs(error) < 1.959964 * deviation).mean(axis=0)
        square += (error**2).sum(axis=1).mean()
    coverage, rms = inside / campaigns, np.sqrt(square / campaigns)
    # for a linear model with known noise and prior the full model's expected error is the Bayesian Cramér–Rao bound
    bound = design(model, simulated[0][0], unseen).expected_error(np.arange(len(model)))
    assert np.all((coverage > 0.93) & (coverage < 0.97)), coverage
    assert 0.95 < rms / bound < 1.05, (rms, bound)


@pytest.mark.parametrize("robots", [pytest.param(12, marks=pytest.mark.slow), MANY])
def test_intervals_hold_whichever_parameters_are_estimated(robots):
    """Of a robot that varies in all 45, measured in one orientation, there and where the tool is turned away from it."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = reach_task(model, reference_task(), 60).q
    places = {
        "measured": reach_task(model, reference_task(), 20, seed=1).q,
        "turned": reach_task(model, reference_task(np.radians(40.0)), 20, seed=1).q,
    }
    kept = {
        "all": None,
        "published": published_kept(model),
        "identifiable": identifiability(model, q).kept,
        "selected": select(model, reference_task(), model_error=0.0).kept,
    }
    assert [len(kept[name] or model.names) for name in kept] == [45, 33, 24, 18]
    covered = {(name, place, way): [] for name in kept for place in places for way in ("stated", "within")}
    for seed in range(robots):
        campaign, truth = simulate(model, q, rng=np.random.default_rng(seed))
        for name, names in kept.items():
            calibration = identify(model, campaign, keep=names, gross_errors="keep", target_within=1e-5)
            for place, there in places.items():
                error = (truth.points(there) - calibration.predict(there))[:, 0]
                for way, one in (("stated", calibration), ("within", replace(calibration, range_growth=0.0))):
                    deviation = np.sqrt(np.einsum("ntii->nti", one.predict_covariance(there)))[:, 0]
                    covered[name, place, way].append((np.abs(error) < 1.959964 * deviation).mean())
    share = {key: float(np.mean(values)) for key, values in covered.items()}
    # beyond the measured range of the joints what is stated allows for more than these robots have; without that it holds as often
    # as anywhere
    assert all(0.9 < share[key] < 0.98 for key in share if "within" in key), share
    assert all(0.9 < share[name, "measured", "stated"] < 0.98 for name in kept), share
    assert all(share[name, "turned", "stated"] >= share[name, "turned", "within"] for name in kept), share
