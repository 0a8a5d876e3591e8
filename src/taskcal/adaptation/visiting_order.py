"""The order in which to visit poses: short ways, and joints that keep turning the same way."""

import numpy as np
from jaxtyping import Float, Int

from taskcal.robot.robot import Robot

REVERSAL = 0.1
"""What a change of direction of one joint costs, in radians of travel: gears settle on the same flank if joints come from
the same side."""


def order_visits(robot: Robot, q: Float[np.ndarray, "n joints"]) -> Int[np.ndarray, " n"]:
    """A short tour through all poses, looked for from the one nearest to the middle of the limits.

    The way between two poses costs the largest joint movement, and every reversal of a joint a little more. Nearest
    neighbours first, or the order given where that is shorter, then reversals of parts of the tour while they shorten it
    (2-opt; Croes 1958).
    """
    n = len(q)
    if n < 3:
        return np.arange(n)
    limits = np.clip(robot.limits, -np.pi, np.pi)
    left = set(range(n))
    tour = [int(np.argmin(np.abs(q - limits.mean(axis=1)).max(axis=1)))]
    left.remove(tour[0])
    while left:
        rest = np.array(sorted(left))
        tour.append(int(rest[np.argmin(np.abs(q[rest] - q[tour[-1]]).max(axis=1))]))
        left.remove(tour[-1])
    best = min(np.array(tour), np.arange(n), key=lambda order: _cost(q[order]))
    cost = _cost(q[best])
    improved = True
    while improved:
        improved = False
        for i in range(n - 1):
            for j in range(i + 2, n + 1):
                trial = np.concatenate([best[:i], best[i:j][::-1], best[j:]])
                length = _cost(q[trial])
                if length < cost - 1e-9:
                    best, cost, improved = trial, length, True
    return best


def _cost(q: Float[np.ndarray, "n joints"]) -> float:
    step = np.diff(q, axis=0)
    turns = np.count_nonzero(step[1:] * step[:-1] < 0.0)
    return float(np.abs(step).max(axis=1).sum()) + REVERSAL * turns
