"""Closure of a planar four-bar: the rocker's angle from the arm's and the crank's, with first derivatives.

Angles are measured in the loop's plane from one common direction. The crank, of length L1, and the arm, of length d,
turn about one ground axis; the rocker, of length L3, turns on the arm's end; a rod of length L2 joins crank and rocker:

    | d·u(α) + L3·u(θ + ρ) − L1·u(κ + γ) | = L2

with κ + γ the crank's lever and θ + ρ the rocker's.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from jaxtyping import Bool, Float

from taskcal.errors import ClosureError
from taskcal.kernels.closure import (
    BY_ANGLE,
    BY_LENGTH,
    MIN_TURN,
    NUMBERS,
    OPEN,
    ROUNDING,
    STATE,
    TURN,
    Coordinates,
    Drive,
    LoopNumbers,
    Wanted,
    fill_coordinates,
)

REMEDY = (
    "the loop is singular where rod and arm line up with the levers: keep the two angles well under 90° apart and check the "
    "joint columns, their order and signs"
)
"""What errors about a loop say that does not close, or has folded over."""

MARGIN_SHARE = 1e-3
"""Share of the range in which a loop closes that the place where it was built keeps from its ends."""


@dataclass(frozen=True, kw_only=True)
class FourBar:
    """Lengths in metres, angles in radians."""

    crank: float
    """L1, from the ground axis to the rod."""
    rod: float
    """L2."""
    rocker: float
    """L3, from the arm's end to the rod."""
    arm: float
    """d, from the ground axis to the rocker's axis."""
    crank_angle: float = -np.pi / 2
    """γ, of the crank's lever against κ."""
    rocker_angle: float = -np.pi / 2
    """ρ, of the rocker's lever against θ."""
    assembly: Literal[1, -1] = 1
    """+1 where the rod, seen from the crank, points to the side of the rocker's lever turned by +90°; −1 for the other."""

    def describe(self, arm_angle: float, crank_angle: float) -> str:
        """The loop at one arm angle α and crank angle κ, radians, as errors name it."""
        alpha, kappa = np.degrees((arm_angle, crank_angle))
        return (
            f"arm at {alpha:.3f}°, crank at {kappa:.3f}° ({kappa - alpha:+.3f}° apart), with crank {self.crank * 1e3:g}, rod "
            f"{self.rod * 1e3:g}, rocker {self.rocker * 1e3:g} and arm {self.arm * 1e3:g} mm"
        )


@dataclass(frozen=True, eq=False)
class Closure:
    """Angle of the rocker, and its derivatives."""

    angle: Float[np.ndarray, " n"]
    """θ, within half a turn of κ, radians."""
    by_length: Float[np.ndarray, "n 4"]
    """∂θ/∂(L1, L2, L3, d), radians per metre."""
    by_angle: Float[np.ndarray, "n 2"]
    """∂θ/∂(α, κ)."""


@dataclass(frozen=True, kw_only=True)
class Side:
    """The positions that a loop comes to from where it was built, without passing a singular one."""

    lever: float
    """Side of the arm that the crank's lever is on, +1 or −1, where the loop cannot bring it to the other."""
    turn: float
    """Whether the rocker turns with the crank, +1, or against it, −1: the sign of ∂θ/∂κ."""


def loop_numbers(bar: FourBar, side: Side) -> LoopNumbers:
    """The loop as the compiled closure takes it."""
    nearest, farthest = _lever_cosines(bar)
    passes = nearest > 1.0 + ROUNDING or farthest < -1.0 - ROUNDING  # the crank's lever, the line of the arm
    lengths = float(bar.crank), float(bar.rod), float(bar.rocker), float(bar.arm)
    angles = float(bar.crank_angle), float(bar.rocker_angle)
    return LoopNumbers(*lengths, *angles, float(bar.assembly), float(side.lever), float(side.turn), 2.0 * passes)


def closure_numbers(
    bar: FourBar, side: Side, q: Float[np.ndarray, "n joints"], angles: Float[np.ndarray, "2 joints"]
) -> Float[np.ndarray, "n 8"]:
    """Results of the compiled closure at joint positions q, of which α and κ are linear combinations."""
    q = np.ascontiguousarray(q, dtype=float)
    numbers = np.empty((len(q), NUMBERS))
    drive = Drive(np.empty((0, q.shape[1])), np.empty(0), angles, np.empty(0))
    out = Coordinates(np.empty((len(q), 0)), np.empty((len(q), 0)), numbers)
    fill_coordinates(q, drive, loop_numbers(bar, side), NOTHING_WANTED, out)
    return numbers


def expect_closed(
    numbers: Float[np.ndarray, "n 8"],
    bar: FourBar,
    q: Float[np.ndarray, "n joints"],
    angles: Float[np.ndarray, "2 joints"],
) -> None:
    """Refuse numbers of `closure_numbers` where the rod cannot reach.

    Raises:
        ClosureError: it cannot at some pose; the message names the first such pose.
    """
    is_open = numbers[:, STATE] == OPEN
    if is_open.any():
        first = int(np.argmax(is_open))
        raise ClosureError(first, f"{bar.describe(*(angles @ q[first]))}; {REMEDY}")


NOTHING_WANTED = Wanted(np.empty(0, dtype=np.int64), np.empty(0))


def rocker_turn(loop: LoopNumbers, alpha: Any, kappa: Any) -> tuple[Any, Any, Any]:
    """θ − κ of a loop in NumPy, for expressions; and two numbers that are positive where it closes as it was built."""
    ca, sa = np.cos(alpha), np.sin(alpha)
    ck, sk = np.cos(kappa + loop.gamma), np.sin(kappa + loop.gamma)
    cr, sr = np.cos(kappa + loop.rho), np.sin(kappa + loop.rho)
    wx, wy = loop.d * ca - loop.L1 * ck, loop.d * sa - loop.L1 * sk
    square = wx * wx + wy * wy
    by_w = 1.0 / np.sqrt(square)
    cosine = (loop.L2**2 - loop.L3**2 - square) * (0.5 / loop.L3) * by_w
    sine = -loop.assembly * np.sqrt((1.0 - cosine) * (1.0 + cosine))
    cl, sl = (wx * cosine - wy * sine) * by_w, (wy * cosine + wx * sine) * by_w
    vx, vy = wx + loop.L3 * cl, wy + loop.L3 * sl
    turned = loop.L1 * (vy * ck - vx * sk) / (loop.L3 * (vy * cl - vx * sl))
    turn = np.arctan2(sl * cr - cl * sr, cl * cr + sl * sr)
    return turn, loop.passes + loop.lever * (sk * ca - ck * sa), loop.turn * turned - MIN_TURN


_ANY_SIDE = Side(lever=0.0, turn=0.0)


def close_four_bar(bar: FourBar, arm_angle: Float[np.ndarray, " n"], crank_angle: Float[np.ndarray, " n"]) -> Closure:
    """Rocker angle θ and its derivatives for arm angles α and crank angles κ, radians.

    Raises:
        ClosureError: the rod cannot reach at some pose; the message names the first such pose.
    """
    q, angles = np.stack([arm_angle, crank_angle], axis=1), np.eye(2)
    numbers = closure_numbers(bar, _ANY_SIDE, q, angles)
    expect_closed(numbers, bar, q, angles)
    return Closure(angle=crank_angle + numbers[:, TURN], by_length=numbers[:, BY_LENGTH], by_angle=numbers[:, BY_ANGLE])


def can_close(
    bar: FourBar, arm_angle: Float[np.ndarray, " n"], crank_angle: Float[np.ndarray, " n"]
) -> Bool[np.ndarray, " n"]:
    """Whether the rod reaches, by more than rounding, for arm angles α and crank angles κ, radians."""
    crank = crank_angle + bar.crank_angle
    wx = bar.arm * np.cos(arm_angle) - bar.crank * np.cos(crank)
    wy = bar.arm * np.sin(arm_angle) - bar.crank * np.sin(crank)
    square = wx * wx + wy * wy
    return np.abs(bar.rod**2 - square - bar.rocker**2) < (1.0 - ROUNDING) * 2.0 * bar.rocker * np.sqrt(square)


def built_side(bar: FourBar) -> Side:
    """Side on which a loop was built: with its levers as they are at κ = α, or as near to that as it closes."""
    low, high = np.arccos(np.clip(_lever_cosines(bar), -1.0, 1.0))
    gamma = float(np.angle(np.exp(1j * bar.crank_angle)))
    lever = -1.0 if gamma < 0.0 else 1.0
    if not low < high:
        return Side(lever=lever, turn=1.0)  # it closes nowhere
    inside = MARGIN_SHARE * (high - low)
    angle = lever * np.clip(abs(gamma), low + inside, high - inside)
    closure = close_four_bar(bar, np.zeros(1), np.array([angle - bar.crank_angle]))
    return Side(lever=lever, turn=-1.0 if closure.by_angle[0, 1] < 0.0 else 1.0)


def _lever_cosines(bar: FourBar) -> tuple[float, float]:
    """Cosines of the angle between arm and crank's lever where rod and rocker line up, folded and stretched."""
    square, twice = bar.arm**2 + bar.crank**2, 2.0 * bar.arm * bar.crank
    return (square - (bar.rod - bar.rocker) ** 2) / twice, (square - (bar.rod + bar.rocker) ** 2) / twice


def curvature(
    bar: FourBar, closure: Closure, arm_angle: Float[np.ndarray, " n"], crank_angle: Float[np.ndarray, " n"]
) -> Float[np.ndarray, "n 2 2"]:
    """Second derivatives of θ by α and κ, per radian, where the loop closes.

    With F = ½ |v|², constant as the loop moves: θ_ab = −(F_ab + F_aψ θ_b + F_bψ θ_a + F_ψψ θ_a θ_b) / F_ψ.
    """
    d, L1, L3 = bar.arm, bar.crank, bar.rocker
    a, k, psi = arm_angle, crank_angle + bar.crank_angle, closure.angle + bar.rocker_angle
    vx = d * np.cos(a) + L3 * np.cos(psi) - L1 * np.cos(k)
    vy = d * np.sin(a) + L3 * np.sin(psi) - L1 * np.sin(k)

    def along(angle: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        return vx * np.cos(angle) + vy * np.sin(angle)

    F_psi = L3 * (vy * np.cos(psi) - vx * np.sin(psi))
    F = np.empty((len(a), 2, 2))
    F[:, 0, 0], F[:, 1, 1] = d * d - d * along(a), L1 * L1 + L1 * along(k)
    F[:, 0, 1] = F[:, 1, 0] = -d * L1 * np.cos(a - k)
    mixed = (
        np.stack([d * L3 * np.cos(a - psi), -L1 * L3 * np.cos(k - psi)], axis=1)[:, :, None] * closure.by_angle[:, None]
    )
    both = (L3 * L3 - L3 * along(psi))[:, None, None] * closure.by_angle[:, :, None] * closure.by_angle[:, None]
    return -(F + mixed + np.swapaxes(mixed, 1, 2) + both) / F_psi[:, None, None]
