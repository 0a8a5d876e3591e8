"""The one model does no harm where there is little to find, and its regions hold: a sample of `tests.identification.no_harm`."""

import numpy as np
import pytest

from tests.identification.no_harm import KINDS, ROBOTS, WITH, WITHOUT, draw


@pytest.mark.long
@pytest.mark.parametrize(("kind", "seed"), [("nothing", 42), ("gain", 1)])
def test_auto_is_nearly_as_accurate_as_known_robot_class(kind, seed):
    """One robot of a class is predicted nearly as well as with the effects of its class known."""
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
def test_auto_loses_at_most_a_tenth_of_known_effect_gain():
    """But for single orders of the gears: who is told the order knows one of thirty."""
    kinds = [WITH[kind] for kind in WITH if not kind.startswith("order")]
    outcomes = [draw(ROBOTS[seed % len(ROBOTS)], kinds[seed // len(ROBOTS) % len(kinds)], seed) for seed in range(60)]
    assert np.median([outcome.auto / outcome.told for outcome in outcomes]) <= 1.1
    assert 0.93 <= np.mean([outcome.inside for outcome in outcomes]) <= 0.97
