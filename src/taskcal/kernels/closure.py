"""The closure of a four-bar for eight poses at a time; `four_bar` says what it computes."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from taskcal.kernels.chunks import in_chunks
from taskcal.kernels.compiled import compiled, part
from taskcal.kernels.lanes import (
    LANES,
    allocate_lanes,
    angle_of,
    as_lanes,
    cosine_and_sine,
    least_of,
    square_root,
    where_less,
)
from taskcal.kernels.walk import take_lanes

MIN_TURN = 1e-9
"""∂θ/∂κ that counts as none; a rhombus that folds over leaves the rocker standing, to rounding."""

ROUNDING = 1e-12
"""Of a cosine, and of the share by which a rod must reach."""

OPEN, BEYOND, KEPT = 0.0, 1.0, 2.0
"""A loop whose rod does not reach; one that closes, but not where it was built; one that does there."""

TURN, BY_LENGTH, BY_ANGLE, STATE, NUMBERS = 0, slice(1, 5), slice(5, 7), 7, 8
"""What is found for a pose: θ − κ; its derivatives by L1, L2, L3 and d; ∂θ/∂(α, κ); whether it closes; so many in all."""


class LoopNumbers(NamedTuple):
    """A `FourBar` and the `Side` it was built on, as the compiled closure takes them."""

    L1: float
    L2: float
    L3: float
    d: float
    gamma: float
    rho: float
    assembly: float
    lever: float
    turn: float
    passes: float
    """2 where the crank's lever may pass the line of the arm, else 0."""


@part
def lengthened(loop, crank, rod, rocker):
    """The loop with other lengths, by so much from its own."""
    L1, L2, L3, d = loop.L1 + crank, loop.L2 + rod, loop.L3 + rocker, loop.d
    square, twice = d * d + L1 * L1, 2.0 * d * L1
    folded, stretched = (square - (L2 - L3) * (L2 - L3)) / twice, (square - (L2 + L3) * (L2 + L3)) / twice
    passes = 2.0 if folded > 1.0 + ROUNDING or stretched < -1.0 - ROUNDING else 0.0
    return LoopNumbers(L1, L2, L3, d, loop.gamma, loop.rho, loop.assembly, loop.lever, loop.turn, passes)


@part
def close_loop(alpha, kappa, loop, out):
    """Fill `out` with the numbers of one loop at arm angles α and crank angles κ."""
    L1, L2, L3, d = loop.L1, loop.L2, loop.L3, loop.d
    (ca, sa), (ck, sk) = cosine_and_sine(alpha), cosine_and_sine(kappa + loop.gamma)
    cr, sr = cosine_and_sine(kappa + loop.rho)
    wx, wy = d * ca - L1 * ck, d * sa - L1 * sk
    square = wx * wx + wy * wy
    by_w = 1.0 / square_root(square)  # divisions take longest of all
    cosine = (L2 * L2 - square - L3 * L3) * (0.5 / L3) * by_w
    closes = (1.0 - cosine) * (1.0 + cosine)
    sine = -loop.assembly * square_root(closes)
    cl, sl = (wx * cosine - wy * sine) * by_w, (wy * cosine + wx * sine) * by_w
    vx, vy = wx + L3 * cl, wy + L3 * sl
    # differentiating |v|² = L2² : L3·(v·u′(ψ)) dψ = L2·dL2 − v·(everything else that moves v)
    by_slope = 1.0 / (L3 * (vy * cl - vx * sl))
    out[0] = angle_of(sl * cr - cl * sr, cl * cr + sl * sr)
    out[1] = (vx * ck + vy * sk) * by_slope
    out[2] = L2 * by_slope
    out[3] = -(vx * cl + vy * sl) * by_slope
    out[4] = -(vx * ca + vy * sa) * by_slope
    out[5] = -d * (vy * ca - vx * sa) * by_slope
    turned = L1 * (vy * ck - vx * sk) * by_slope
    out[6] = turned
    side = where_less(0.0, loop.passes + loop.lever * (sk * ca - ck * sa), KEPT, BEYOND)
    kept = where_less(MIN_TURN, loop.turn * turned, side, BEYOND)
    out[7] = where_less(0.0, closes, kept, OPEN)


# From joint positions to the coordinates of a chain, through couplings and a four-bar, eight poses at a time.


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


class CoordinateBuffers(NamedTuple):
    """What the pass fills on the way."""

    q: Float[np.ndarray, "joints lanes"]
    s: Float[np.ndarray, "coordinates lanes"]
    loop: Float[np.ndarray, "numbers lanes"]


@compiled
def fill_lanes(q, drive, numbers, wanted, buffers, out):
    """Fill `out`; whether the loop closes where it was built at all poses."""
    joints, s, loop = as_lanes(buffers.q), as_lanes(buffers.s), as_lanes(buffers.loop)
    matrix, n = drive.matrix, q.shape[0]
    least = KEPT
    for first in range(0, n, LANES):
        take_lanes(q, first, buffers.q)
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
                out.s[first + lane, c] = buffers.s[c, lane]
            for k in range(out.loop.shape[1]):
                out.loop[first + lane, k] = buffers.loop[k, lane]
            for k in range(wanted.which.shape[0]):
                out.factor[first + lane, k] = wanted.times[k] * buffers.loop[wanted.which[k], lane]
    return least_of(least) == KEPT


def allocate_coordinates(joints: int, coordinates: int) -> CoordinateBuffers:
    """For so many joints and coordinates."""
    return CoordinateBuffers(*allocate_lanes((joints,), (coordinates,), (NUMBERS,)))


def fill_coordinates(
    q: Float[np.ndarray, "n joints"], drive: Drive, numbers: LoopNumbers, wanted: Wanted, out: Coordinates
) -> bool:
    """Fill `out` at joint positions q, in radians or metres; whether the loop, if there is one, closes at all as it was built."""

    def fill(rows: slice) -> bool:
        lanes = allocate_coordinates(q.shape[1], len(drive.offset))
        part = Coordinates(out.s[rows], out.factor[rows], out.loop[rows])
        return fill_lanes(q[rows], drive, numbers, wanted, lanes, part)

    return all(in_chunks(fill, len(q)))
