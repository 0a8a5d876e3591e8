"""The one model does no harm where there is little to find, and its regions hold: a sample of `tests.identification.no_harm`."""

import numpy as np
import pytest

from tests.identification.no_harm import KINDS, ROBOTS, WITH, WITHOUT, draw


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "seed"), [pytest.param("nothing", 42, marks=pytest.mark.long), ("gain", 1)])
def test_one_robot_of_a_kind_is_predicted_nearly_as_well_as_by_who_knows_the_kind(kind, seed):
    outcome = draw(ROBOTS[seed % len(ROBOTS)], KINDS[kind], seed)
    assert outcome.auto < 1.2 * outcome.told
    assert outcome.auto < 1.1 * outcome.geometry
    assert outcome.inside > 0.85


@pytest.mark.long
def test_without_effects_nothing_is_lost():
    kinds = list(WITHOUT.values())
    outcomes = [draw(ROBOTS[seed % len(ROBOTS)], kinds[seed // len(ROBOTS) % len(kinds)], seed) for seed in range(200)]
    ratio = np.array([outcome.auto / outcome.geometry for outcome in outcomes])
    assert np.median(ratio) <= 1.02
    assert np.mean(ratio <= 1.1) >= 0.95
    assert 0.93 <= np.mean([outcome.inside for outcome in outcomes]) <= 0.97


@pytest.mark.long
def test_a_single_effect_costs_a_tenth_at_most_of_what_knowing_it_gives():
    """But for single orders of the gears: who is told the order knows one of thirty."""
    kinds = [WITH[kind] for kind in WITH if not kind.startswith("order")]
    outcomes = [draw(ROBOTS[seed % len(ROBOTS)], kinds[seed // len(ROBOTS) % len(kinds)], seed) for seed in range(60)]
    assert np.median([outcome.auto / outcome.told for outcome in outcomes]) <= 1.1
    assert 0.93 <= np.mean([outcome.inside for outcome in outcomes]) <= 0.97
