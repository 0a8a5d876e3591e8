"""A small sample of `coverage_regimes`, whose hundreds of robots are measured by hand."""

import numpy as np
import pytest

from tests.identification.coverage_regimes import REGIMES, covered

SAMPLED_REGIMES = "15 poses", "5 % wrong by 5 mm, left out"

ROBOTS = 40
"""Of each regime, where a test may take long."""


@pytest.mark.parametrize(
    ("name", "robots"),
    [
        *((name, 5) for name in SAMPLED_REGIMES),
        *(pytest.param(name, ROBOTS, marks=pytest.mark.long) for name in REGIMES),
    ],
)
def test_intervals_hold_in_every_regime(name: str, robots: int) -> None:
    share = np.mean([covered(REGIMES[name], seed)[0] for seed in range(robots)])
    # the points of one robot err together, so that the share of few robots scatters
    low, high = (0.8, 1.0) if robots < ROBOTS else (0.9, 0.99) if REGIMES[name].outside else (0.925, 0.975)
    assert low < share <= high
