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
    improved = True
    while improved:
        improved = False
        for i in range(n - 1):
            j = i + 2
            while j <= n:
                shorter = np.flatnonzero(_changes(q[best], i, np.arange(j, n + 1)) < -1e-9)
                if not len(shorter):
                    break
                j += int(shorter[0])
                best[i:j] = best[i:j][::-1].copy()
                improved, j = True, j + 1
    return best


def _changes(q: Float[np.ndarray, "n joints"], i: int, ends: Int[np.ndarray, " k"]) -> Float[np.ndarray, " k"]:
    """By how much the cost changes where the poses from i up to each of some ends are visited the other way round.

    Only the steps into that part and out of it change, and the turns beside them.
    """
    nowhere = np.full((2, q.shape[1]), np.nan)
    around = np.concatenate([nowhere, q, nowhere])
    j, k = ends + 2, np.full(len(ends), i + 2)
    before = np.stack([[k - 2, k - 1, k, k + 1], [j - 2, j - 1, j, j + 1]])
    after = np.stack([[k - 2, k - 1, j - 1, j - 2], [k + 1, k, j, j + 1]])
    first, then = (_cost(around[part.transpose(0, 2, 1)]).sum(axis=0) for part in (before, after))
    return then - first


def _cost(q: Float[np.ndarray, "*ways n joints"]) -> Float[np.ndarray, "*ways"]:
    """Of every way through n poses; steps from or to a pose that is not a number cost nothing."""
    step = np.diff(q, axis=-2)
    turns = np.count_nonzero(step[..., 1:, :] * step[..., :-1, :] < 0.0, axis=(-2, -1))
    return np.asarray(np.nan_to_num(np.abs(step).max(axis=-1)).sum(axis=-1) + REVERSAL * turns)
