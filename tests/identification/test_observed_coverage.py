"""A small sample of `observed_coverage`, whose hundreds of robots are measured by hand."""

import numpy as np
import pytest

from tests.identification.observed_coverage import both, covered

MANY = pytest.mark.long


@pytest.mark.parametrize(
    ("way", "robots"),
    [
        ("socket", 6),
        ("wire", 4),
        *(pytest.param(way, 80, marks=MANY) for way in ("socket", "wire", "camera", "board", "cube")),
    ],
)
def test_intervals_hold_however_the_robot_is_measured(way, robots):
    found = [covered(way, seed, 60) for seed in range(robots)]
    # of few robots, whose points err together, the share scatters
    low, high = (0.93, 0.97) if robots >= 80 else (0.8, 1.0)
    assert low < np.mean([one.parameters for one in found]) < high
    assert low < np.mean([one.alone for one in found]) <= high
    # four poses of five lie beyond the measured range of some joint, where regions allow for what these robots do not have
    assert all(one.points >= one.alone for one in found)


@pytest.mark.parametrize(
    ("ways", "robots"),
    [
        ("tracker+socket", 3),
        *(pytest.param(w, 40, marks=MANY) for w in ("tracker+socket", "socket+wire", "wire+board")),
    ],
)
def test_two_ways_at_once_are_not_worse_than_the_better_of_them(ways, robots):
    found = [both(ways, seed, 40) for seed in range(robots)]
    mean = {name: float(np.mean([one[name] for one in found])) for name in found[0]}
    best = min(mean[name] for name in ways.split("+"))
    assert mean[ways] < (1.02 if robots >= 40 else 1.15) * best
