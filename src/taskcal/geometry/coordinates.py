"""From joint positions to the coordinates of a chain, through couplings and a four-bar, eight poses at a time."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from taskcal.geometry.chunks import in_chunks
from taskcal.geometry.compiled import compiled
from taskcal.geometry.four_bar_closure import KEPT, NUMBERS, STATE, LoopNumbers, close_loop
from taskcal.geometry.lanes import LANES, as_lanes, least_of, rooms, take_lanes, where_less


class Drive(NamedTuple):
    """How joint positions turn into chain coordinates, as the compiled pass takes it: s = matrix·q + offset + output·(θ − κ)."""

    matrix: Float[np.ndarray, "coordinates joints"]
    offset: Float[np.ndarray, " coordinates"]
    angles: Float[np.ndarray, "angles joints"]
    """α and κ of the four-bar as linear combinations of joint positions; no rows where there is none."""
    output: Float[np.ndarray, " coordinates"]


class Wanted(NamedTuple):
    """Which derivatives by the loop's lengths are asked for: number `which` of a pose's, `times` what the loop's output is."""

    which: Int[np.ndarray, " pairs"]
    times: Float[np.ndarray, " pairs"]


class Coordinates(NamedTuple):
    """What the pass fills."""

    s: Float[np.ndarray, "n joints"]
    """Chain coordinates, radians or metres; those that nothing moves are zero."""
    factor: Float[np.ndarray, "n pairs"]
    """The derivatives that are wanted."""
    loop: Float[np.ndarray, "n numbers"]
    """The numbers of the closure; no columns where they are not wanted."""


class CoordinateRoom(NamedTuple):
    """What the pass fills on the way."""

    q: Float[np.ndarray, "joints lanes"]
    s: Float[np.ndarray, "coordinates lanes"]
    loop: Float[np.ndarray, "numbers lanes"]


@compiled
def fill_lanes(q, drive, numbers, wanted, room, out):
    """Fill `out`; whether the loop closes where it was built at all poses."""
    joints, s, loop = as_lanes(room.q), as_lanes(room.s), as_lanes(room.loop)
    matrix, n = drive.matrix, q.shape[0]
    least = KEPT
    for first in range(0, n, LANES):
        take_lanes(q, first, room.q)
        for c in range(matrix.shape[0]):
            v = drive.offset[c]
            for j in range(matrix.shape[1]):
                if matrix[c, j] != 0.0:
                    v += matrix[c, j] * joints[j]
            s[c] = v
        if drive.angles.shape[0] > 0:
            alpha, kappa = drive.angles[0, 0] * joints[0], drive.angles[1, 0] * joints[0]
            for j in range(1, matrix.shape[1]):
                alpha += drive.angles[0, j] * joints[j]
                kappa += drive.angles[1, j] * joints[j]
            close_loop(alpha, kappa, numbers, loop)
            least = where_less(loop[STATE], least, loop[STATE], least)
            for c in range(matrix.shape[0]):
                if drive.output[c] != 0.0:
                    s[c] += drive.output[c] * loop[0]
        for lane in range(min(LANES, n - first)):
            for c in range(matrix.shape[0]):
                out.s[first + lane, c] = room.s[c, lane]
            for k in range(out.loop.shape[1]):
                out.loop[first + lane, k] = room.loop[k, lane]
            for k in range(wanted.which.shape[0]):
                out.factor[first + lane, k] = wanted.times[k] * room.loop[wanted.which[k], lane]
    return least_of(least) == KEPT


def coordinate_room(joints: int, coordinates: int) -> CoordinateRoom:
    """For so many joints and coordinates."""
    return CoordinateRoom(*rooms((joints,), (coordinates,), (NUMBERS,)))


def fill_coordinates(
    q: Float[np.ndarray, "n joints"], drive: Drive, numbers: LoopNumbers, wanted: Wanted, out: Coordinates
) -> bool:
    """Fill `out` at joint positions q, in radians or metres; whether the loop, if there is one, closes at all as it was built."""

    def fill(rows: slice) -> bool:
        lanes = coordinate_room(q.shape[1], len(drive.offset))
        part = Coordinates(out.s[rows], out.factor[rows], out.loop[rows])
        return fill_lanes(q[rows], drive, numbers, wanted, lanes, part)

    return all(in_chunks(fill, len(q)))
