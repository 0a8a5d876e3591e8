"""The compiled pass over the poses of a four-bar; `four_bar` says what it computes.

It stands by itself, so that a robot with a loop can be read, and refused, before the compiler is imported.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from taskcal.geometry.compiled import compiled


class LoopNumbers(NamedTuple):
    """The numbers of a `FourBar` as the compiled closure takes them."""

    L1: float
    L2: float
    L3: float
    d: float
    gamma: float
    rho: float
    assembly: float


class ClosureArrays(NamedTuple):
    """The arrays of a `Closure`, which the compiled closure fills."""

    angle: Float[np.ndarray, " n"]
    by_length: Float[np.ndarray, "n 4"]
    by_angle: Float[np.ndarray, "n 2"]


@compiled
def close_loop(arm_angle, crank_angle, loop, out):
    """Fill the arrays, and return the first pose that does not close, or −1."""
    L1, L2, L3, d, gamma, rho, assembly = loop
    angle, by_length, by_angle = out
    for i in range(arm_angle.shape[0]):
        a, k = arm_angle[i], crank_angle[i] + gamma
        ca, sa, ck, sk = np.cos(a), np.sin(a), np.cos(k), np.sin(k)
        wx, wy = d * ca - L1 * ck, d * sa - L1 * sk
        w = np.sqrt(wx * wx + wy * wy)
        cosine = (L2 * L2 - w * w - L3 * L3) / (2.0 * L3 * w)
        if not abs(cosine) < 1.0:
            return i
        sine = -assembly * np.sqrt((1.0 - cosine) * (1.0 + cosine))
        cl, sl = (wx * cosine - wy * sine) / w, (wy * cosine + wx * sine) / w
        vx, vy = wx + L3 * cl, wy + L3 * sl
        # differentiating |v|² = L2² : L3·(v·u′(ψ)) dψ = L2·dL2 − v·(everything else that moves v)
        slope = L3 * (vy * cl - vx * sl)
        by_length[i, 0] = (vx * ck + vy * sk) / slope
        by_length[i, 1] = L2 / slope
        by_length[i, 2] = -(vx * cl + vy * sl) / slope
        by_length[i, 3] = -(vx * ca + vy * sa) / slope
        by_angle[i, 0] = -d * (vy * ca - vx * sa) / slope
        by_angle[i, 1] = L1 * (vy * ck - vx * sk) / slope
        turn = np.arctan2(sl, cl) - rho - crank_angle[i]
        angle[i] = crank_angle[i] + turn - 2.0 * np.pi * np.round(turn / (2.0 * np.pi))
    return -1
