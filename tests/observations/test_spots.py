import numpy as np
import pytest

from taskcal.observations.base import spots


@pytest.mark.parametrize("count", [1, 2, 5])
def test_spots_are_inside_and_far_from_each_other(count):
    position = np.random.default_rng(0).normal(size=(200, 3))
    chosen = spots(position, count)
    away = np.linalg.norm(position - np.median(position, axis=0), axis=1)
    assert (away[chosen] <= np.median(away) + 1e-12).all()
    assert len(set(chosen.tolist())) == count
    random = np.random.default_rng(1).permutation(np.flatnonzero(away <= np.median(away)))[: max(count, 2)]

    def nearest(numbers):
        apart = np.linalg.norm(position[numbers][:, None] - position[numbers], axis=2)
        return (apart + 10.0 * np.eye(len(numbers))).min()

    assert count == 1 or nearest(chosen) > nearest(random)


def test_there_may_be_more_spots_than_positions():
    assert spots(np.zeros((2, 3)), 4).shape == (4,)
