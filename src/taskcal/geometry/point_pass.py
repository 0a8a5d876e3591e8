"""Passes over measured points alone, eight poses at a time: what normal equations and covariances share."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from taskcal.geometry.compiled import part
from taskcal.geometry.lanes import LANES, rooms
from taskcal.geometry.observations import Walked


class PointRoom(NamedTuple):
    """What a pass over points fills on the way; the lanes are along each array's last axis, where it has any."""

    s: Float[np.ndarray, "joints lanes"]
    factor: Float[np.ndarray, "pairs lanes"]
    joints: Float[np.ndarray, "joints 2 3 lanes"]
    frames: Float[np.ndarray, "frames 7 3 lanes"]
    slides: Bool[np.ndarray, " joints"]
    T: Float[np.ndarray, "3 4 lanes"]
    r: Float[np.ndarray, "3 lanes"]
    J: Float[np.ndarray, "3 p lanes"]
    y: Float[np.ndarray, "3 lanes"]
    """Measured."""
    work: Float[np.ndarray, "3 3 lanes"]
    """For the pass itself."""


def allocate_points(walked: Walked) -> PointRoom:
    """Room for a pass over a walk."""
    joints, frames, pairs = walked.s.shape[1], len(walked.e), walked.factor.shape[1]
    s, factor, axes, along, T, r, J, y, work = rooms(
        (joints,), (pairs,), (joints, 2, 3), (frames, 7, 3), (3, 4), (3,), (3, walked.layout.count), (3,), (3, 3)
    )
    return PointRoom(s, factor, axes, along, np.empty(joints, dtype=bool), T, r, J, y, work)


@part
def take_points(position, valid, first, t, out):
    """Copy the positions of target t to lanes, zero where nothing was measured, and those of the last pose beyond it."""
    for lane in range(LANES):
        i = min(first + lane, valid.shape[0] - 1)
        for a in range(3):
            out[a, lane] = position[i, t, a] if valid[i, t] else 0.0
