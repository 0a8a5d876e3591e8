"""The joint side, compiled: couplings and the closure of a four-bar; `four_bar` says what that computes."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from taskcal.kernels.blocks import BLOCK, angle_of, cosine_and_sine, take_block
from taskcal.kernels.chunks import in_chunks
from taskcal.kernels.compiled import compiled, part

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
def close_loops(alpha, kappa, loop, out):
    """Fill rows of `out` with the numbers of one loop at arm angles α and crank angles κ, a place for each pose."""
    L1, L2, L3, d = loop.L1, loop.L2, loop.L3, loop.d
    for i in range(BLOCK):
        (ca, sa), (ck, sk) = cosine_and_sine(alpha[i]), cosine_and_sine(kappa[i] + loop.gamma)
        cr, sr = cosine_and_sine(kappa[i] + loop.rho)
        wx, wy = d * ca - L1 * ck, d * sa - L1 * sk
        square = wx * wx + wy * wy
        by_w = 1.0 / np.sqrt(square)  # divisions take longest of all
        cosine = (L2 * L2 - square - L3 * L3) * (0.5 / L3) * by_w
        closes = (1.0 - cosine) * (1.0 + cosine)
        sine = -loop.assembly * np.sqrt(closes)
        cl, sl = (wx * cosine - wy * sine) * by_w, (wy * cosine + wx * sine) * by_w
        vx, vy = wx + L3 * cl, wy + L3 * sl
        # differentiating |v|² = L2² : L3·(v·u′(ψ)) dψ = L2·dL2 − v·(everything else that moves v)
        by_slope = 1.0 / (L3 * (vy * cl - vx * sl))
        out[i] = angle_of(sl * cr - cl * sr, cl * cr + sl * sr)
        out[BLOCK + i] = (vx * ck + vy * sk) * by_slope
        out[2 * BLOCK + i] = L2 * by_slope
        out[3 * BLOCK + i] = -(vx * cl + vy * sl) * by_slope
        out[4 * BLOCK + i] = -(vx * ca + vy * sa) * by_slope
        out[5 * BLOCK + i] = -d * (vy * ca - vx * sa) * by_slope
        turned = L1 * (vy * ck - vx * sk) * by_slope
        out[6 * BLOCK + i] = turned
        state = KEPT if loop.passes + loop.lever * (sk * ca - ck * sa) > 0.0 else BEYOND
        state = state if loop.turn * turned > MIN_TURN else BEYOND
        out[7 * BLOCK + i] = state if closes > 0.0 else OPEN


# From joint positions to the coordinates of a chain, through couplings and a four-bar.


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
    """Numbers of one block on the way; the poses are along each row."""

    q: Float[np.ndarray, "joints poses"]
    s: Float[np.ndarray, "coordinates poses"]
    angles: Float[np.ndarray, "2 poses"]
    """α and κ."""
    loop: Float[np.ndarray, " numbers*poses"]

    @classmethod
    def of(cls, joints: int, coordinates: int) -> "CoordinateBuffers":
        """For so many joints and coordinates."""
        sizes = (joints, BLOCK), (coordinates, BLOCK), (2, BLOCK), (NUMBERS * BLOCK,)
        return cls(*(np.empty(size) for size in sizes))


@part
def _combine(factors, offset, q, out):
    """Fill a row with a linear combination of others."""
    for i in range(BLOCK):
        out[i] = offset
    for j in range(factors.shape[0]):
        factor, row = factors[j], q[j]
        if factor != 0.0:
            for i in range(BLOCK):
                out[i] += factor * row[i]


@compiled
def close_poses(q, drive, numbers, wanted, buffers, out):
    """Fill `out`; whether the loop closes where it was built at all poses."""
    loop, n, kept = buffers.loop, q.shape[0], True
    for first in range(0, n, BLOCK):
        take_block(q, first, buffers.q)
        here = min(BLOCK, n - first)
        for c in range(drive.offset.shape[0]):
            _combine(drive.matrix[c], drive.offset[c], buffers.q, buffers.s[c])
        if drive.angles.shape[0] > 0:
            for k in range(2):
                _combine(drive.angles[k], 0.0, buffers.q, buffers.angles[k])
            close_loops(buffers.angles[0], buffers.angles[1], numbers, loop)
            for c in range(drive.output.shape[0]):
                output, row = drive.output[c], buffers.s[c]
                if output != 0.0:
                    for i in range(BLOCK):
                        row[i] += output * loop[i]
            for i in range(here):
                kept = kept and loop[STATE * BLOCK + i] == KEPT
                for k in range(out.loop.shape[1]):
                    out.loop[first + i, k] = loop[k * BLOCK + i]
                for k in range(wanted.which.shape[0]):
                    out.factor[first + i, k] = wanted.times[k] * loop[wanted.which[k] * BLOCK + i]
        for i in range(here):
            for c in range(drive.offset.shape[0]):
                out.s[first + i, c] = buffers.s[c, i]
    return kept


def fill_coordinates(
    q: Float[np.ndarray, "n joints"], drive: Drive, numbers: LoopNumbers, wanted: Wanted, out: Coordinates
) -> bool:
    """Fill `out` at joint positions q, in radians or metres; whether the loop, if there is one, closes at all as it was built."""

    def fill(rows: slice) -> bool:
        buffers = CoordinateBuffers.of(q.shape[1], len(drive.offset))
        part = Coordinates(out.s[rows], out.factor[rows], out.loop[rows])
        return close_poses(q[rows], drive, numbers, wanted, buffers, part)

    return all(in_chunks(fill, len(q)))
