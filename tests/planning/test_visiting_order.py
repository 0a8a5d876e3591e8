"""The order of visits: all poses once, and a short way."""

import itertools

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from taskcal.planning.plan import REVERSAL_RAD, order_visits
from taskcal.robot.robot_file import robot_from
from tests.laws.robots import generators, industrial


def cost(q: np.ndarray) -> float:
    """The largest joint movement of every step, and a price for every joint that turns back."""
    way = sum(max(abs(b - a)) for a, b in itertools.pairwise(q))
    turns = sum(
        int((b[k] - a[k]) * (c[k] - b[k]) < 0)
        for a, b, c in zip(q, q[1:], q[2:], strict=False)
        for k in range(q.shape[1])
    )
    return way + REVERSAL_RAD * turns


@given(generators, st.integers(0, 14))
def test_visiting_order_keeps_every_pose_and_no_longer_path(rng, n):
    """Every pose is visited once, on a path no longer than the given one."""
    robot = robot_from(industrial(rng))
    q = rng.uniform(-2, 2, (n, 6))
    order = order_visits(robot, q)
    assert sorted(order) == list(range(n))
    assert cost(q[order]) <= cost(q) * (1 + 1e-9)
    np.testing.assert_array_equal(order_visits(robot, q), order)


@given(generators)
@settings(max_examples=15)
def test_visiting_order_keeps_optimum_and_nearly_finds_it(rng):
    """An optimal order is kept, and a random one is improved to nearly the optimum."""
    robot = robot_from(industrial(rng))
    q = rng.uniform(-2, 2, (6, 6))
    best = q[list(min(itertools.permutations(range(6)), key=lambda order: cost(q[list(order)])))]
    assert cost(best[order_visits(robot, best)]) <= cost(best) * (1 + 1e-9)
    assert cost(q[order_visits(robot, q)]) <= 1.25 * cost(best)


def test_poses_along_a_line_are_visited_along_it():
    rng = np.random.default_rng(0)
    robot = robot_from(industrial(rng))
    q = np.linspace(-1, 1, 20)[:, None] * np.array([1.0, 0.5, -0.5, 0.2, 0.1, 0.0])
    shuffled = q[rng.permutation(20)]
    found = shuffled[order_visits(robot, shuffled)]
    assert cost(found) <= 2.0 + 1e-9  # from end to end, without turning back


@given(generators, st.integers(3, 25))
@settings(max_examples=15)
def test_no_part_visited_the_other_way_round_shortens_the_way(rng, n):
    robot = robot_from(industrial(rng))
    q = rng.uniform(-2, 2, (n, 6))
    found = q[order_visits(robot, q)]
    for i in range(n - 1):
        for j in range(i + 2, n + 1):
            assert cost(np.concatenate([found[:i], found[i:j][::-1], found[j:]])) >= cost(found) - 2e-9
