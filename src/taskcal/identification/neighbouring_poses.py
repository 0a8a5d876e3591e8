"""Groups of poses that lie next to each other, by cutting what was measured in two again and again.

Each cut is square to the direction in which the joint positions spread most, so that a trajectory falls into pieces and a
cloud of poses into cells, all with about as many rows.
"""

import numpy as np
from jaxtyping import Float, Int

from taskcal.measurement.repeated_poses import group_postures

SAME_POSTURE_RAD = float(np.radians(0.5))
"""Rows whose joints all differ by less are one posture, radians (metres where a joint slides)."""

WIDEST = 3.0
"""Times that angle, over which a chain of rows may reach and still be one posture; a longer one is a trajectory."""


def group_neighbours(q: Float[np.ndarray, "n joints"], count: int) -> Int[np.ndarray, " n"]:
    """The group of every row, counted from 0; rows of one posture are in one group.

    Args:
        q: joint positions, radians (metres where a joint slides).
        count: of the groups; there are fewer where there are fewer postures.
    """
    posture = single_postures(q)
    rows = np.bincount(posture)
    centres = np.stack([np.bincount(posture, weights=column) for column in q.T], axis=1) / rows[:, None]
    group = np.empty(len(rows), dtype=int)
    for number, members in enumerate(_cut(centres, rows, np.arange(len(rows)), min(count, len(rows)))):
        group[members] = number
    return group[posture]


def single_postures(q: Float[np.ndarray, "n joints"]) -> Int[np.ndarray, " n"]:
    """The posture of every row, counted from 0: rows half a degree apart, but every row of a trajectory for itself."""
    chain = group_postures(q, SAME_POSTURE_RAD)
    reach = np.zeros(chain.max(initial=-1) + 1)
    for label in np.flatnonzero(np.bincount(chain) > 1):
        reach[label] = np.ptp(q[chain == label], axis=0).max()
    alone = reach[chain] > WIDEST * SAME_POSTURE_RAD
    label = np.where(alone, len(reach) + np.arange(len(q)), chain)
    return np.unique(label, return_inverse=True)[1].reshape(-1)


def _cut(
    centres: Float[np.ndarray, "k joints"], rows: Int[np.ndarray, " k"], members: Int[np.ndarray, " m"], count: int
) -> list[Int[np.ndarray, " _"]]:
    """Members in `count` groups of about as many rows."""
    if count == 1:
        return [members]
    first = count // 2
    away = centres[members] - np.average(centres[members], axis=0, weights=rows[members])
    along = np.linalg.svd(away, full_matrices=False)[2][0]
    order = np.argsort(away @ along * np.sign(along[np.argmax(np.abs(along))]), kind="stable")
    reached = np.cumsum(rows[members][order])
    cut = int(np.argmin(np.abs(reached - reached[-1] * first / count))) + 1
    cut = min(max(cut, first), len(members) - (count - first))
    return [
        *_cut(centres, rows, members[order[:cut]], first),
        *_cut(centres, rows, members[order[cut:]], count - first),
    ]
