import numpy as np
import pytest

from taskcal.planning.fleet import Estimates, find_outliers, judge
from taskcal.robot.parameter import ShownUnit


def drawn(rng, robots, parameters=54, error=0.5):
    errors = error * rng.uniform(0.7, 1.3, (robots, parameters))
    return rng.standard_normal((robots, parameters)) + errors * rng.standard_normal((robots, parameters)), errors


@pytest.mark.parametrize(
    "error", [pytest.param(0.0, marks=pytest.mark.long), 0.5, pytest.param(3.0, marks=pytest.mark.long)]
)
def test_fleets_of_like_robots_have_hardly_a_false_outlier(error):
    rng = np.random.default_rng(0)
    alarms = [(judge(*drawn(rng, robots, error=error))[3] < 0.01).any() for robots in (8, 30) for _ in range(30)]
    assert np.mean(alarms) <= 0.02


def test_the_robot_that_is_unlike_the_others_is_named_alone():
    values, errors = drawn(np.random.default_rng(1), 40)
    values[7, 20] += 15.0
    names = tuple(f"p{k}" for k in range(54))
    unit = ShownUnit.of("m")
    estimates = [
        Estimates(kind="k", names=names, units=(unit,) * 54, values=own, errors=error)
        for own, error in zip(values, errors, strict=True)
    ]
    (found,) = find_outliers([f"robot {k}" for k in range(40)], estimates)
    assert (found["robot"], found["name"], found["value"]) == ("robot 7", "p20", 1e3 * values[7, 20])
    assert found["fleet_spread"] == pytest.approx(1e3, abs=5e2)


def test_fleet_ignores_poorly_measured_robots():
    """Robots with poor measurements are not outliers and do not widen the spread."""
    rng = np.random.default_rng(2)
    values, errors = drawn(rng, 40)
    errors[:15] = 15.0
    values[:15] += 15.0 * rng.standard_normal((15, 54))
    _, spread, z, chance = judge(values, errors)
    assert np.abs(z[:15]).max() < 5.0
    assert not (chance < 0.01).any()
    assert 0.8 < np.median(spread) < 1.2


def test_fleet_spread_excludes_estimation_uncertainty():
    """The spread is that of the robots without their uncertainty."""
    values, errors = drawn(np.random.default_rng(3), 4000, parameters=3, error=1.0)
    np.testing.assert_allclose(judge(values, errors)[1], 1.0, rtol=0.1)
    still = errors * np.random.default_rng(4).standard_normal(errors.shape)
    assert (judge(still, errors)[1] < 0.25).all()


def test_chances_allow_for_how_many_there_are():
    from scipy.stats import t

    values, errors = drawn(np.random.default_rng(5), 10, parameters=4)
    values[2, 1] = np.nan
    _, _, z, chance = judge(values, errors)
    count = np.isfinite(values).sum(axis=0)
    single = 2.0 * t.sf(np.abs(z), 0.45 * (count - 1))
    seen = np.sort(single[np.isfinite(single)])
    for value in seen:
        holm = min(1.0, max((len(seen) - k) * seen[k] for k in range(len(seen)) if seen[k] <= value))
        np.testing.assert_allclose(chance[single == value], holm)
    assert np.isnan(chance[2, 1])


def test_identical_robots_are_not_outliers():
    """Robots that agree to the last digit are not outliers."""
    assert not (judge(np.ones((10, 3)), np.zeros((10, 3)))[3] < 1.0).any()
