"""The joint side: from controller joint positions to the coordinates of the chain, and what its parameters move."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

from taskcal.errors import ClosureError
from taskcal.geometry.four_bar import (
    NOTHING_WANTED,
    REMEDY,
    FourBar,
    Side,
    built_side,
    close_four_bar,
    closure_numbers,
    curvature,
    expect_closed,
    loop_numbers,
    rocker_turn,
)
from taskcal.kernels.closure import (
    BY_ANGLE,
    BY_LENGTH,
    KEPT,
    MIN_TURN,
    STATE,
    TURN,
    Coordinates,
    Drive,
    LoopNumbers,
    Wanted,
    fill_coordinates,
)

Slope = Callable[[], Float[np.ndarray, "n coordinates joints"]]


@dataclass(frozen=True, eq=False)
class Shift:
    """Contribution of a joint-side term to the chain coordinates."""

    value: Float[np.ndarray, "n coordinates"]
    """δs, radians or metres."""
    jacobian: Float[np.ndarray, "n pairs"]
    """∂δs/∂ξ for each of the term's pairs."""
    slope: Slope
    """Computes ∂δs/∂q, which few need."""

    @cached_property
    def by_joint(self) -> Float[np.ndarray, "n coordinates joints"]:
        """∂δs/∂q."""
        return self.slope()


@dataclass(frozen=True, eq=False)
class Walk:
    """Everything the compiled walk needs at some joint positions and parameter values."""

    s: Float[np.ndarray, "n coordinates"]
    e: Float[np.ndarray, "frames 6"]
    factor: Float[np.ndarray, "n pairs"]
    slopes: tuple[Slope, ...]
    """Compute ∂s/∂q of what each joint-side term adds to s, which few need."""


@dataclass(frozen=True, eq=False, kw_only=True)
class JointMap:
    """Linear part of the joint side: s = matrix·q + offset."""

    matrix: Float[np.ndarray, "coordinates joints"]
    """Signs, ratios and linear couplings."""
    offset: Float[np.ndarray, " coordinates"]
    """Chain coordinates at zero joint positions, radians or metres."""

    def __call__(self, q: Shaped[np.ndarray, "n joints"]) -> Shaped[np.ndarray, "n coordinates"]:
        """Chain coordinates at joint positions q; complex where those are, for derivatives by complex steps."""
        return q @ self.matrix.T + self.offset

    def after(self, first: "JointMap") -> "JointMap":
        """Both maps as one, the other one first."""
        return JointMap(matrix=self.matrix @ first.matrix, offset=self(first.offset[None])[0])


NO_LOOP = LoopNumbers(*[0.0] * len(LoopNumbers._fields))
"""For a robot without one."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FourBarDrive:
    """A four-bar between a motor's crank and its link, which turns by θ where a parallelogram would turn it by κ.

    It was built with its levers as they stand at κ = α, or as near to that as it closes, and comes from there to all
    positions before a singular one. The equations have solutions beyond those, too: where rod and crank line up a
    parallelogram becomes an antiparallelogram, which no robot is driven into, and a mirrored loop would have to be taken apart.
    """

    bar: FourBar
    """Nominal lengths."""
    arm: Float[np.ndarray, " joints"]
    """The arm's angle α as a linear combination of joint positions."""
    crank: Float[np.ndarray, " joints"]
    """The crank's angle κ as a linear combination of joint positions."""
    output: Float[np.ndarray, " coordinates"]
    """What θ − κ adds to each chain coordinate."""

    names = ("loop.crank", "loop.rod", "loop.rocker")
    units = ("m", "m", "m")

    @cached_property
    def moved(self) -> Int[np.ndarray, " moved"]:
        """Chain coordinates that the loop moves."""
        return np.flatnonzero(self.output)

    @cached_property
    def side(self) -> Side:
        """Side on which the nominal loop was built."""
        return built_side(self.bar)

    @property
    def pairs(self) -> Int[np.ndarray, "pairs 2"]:
        """Each of the three lengths moves every coordinate that the loop moves."""
        return np.stack([np.tile(self.moved, 3), np.repeat(np.arange(3), len(self.moved))], axis=1)

    def shift(self, q: Float[np.ndarray, "n joints"], xi: Float[np.ndarray, " 3"]) -> Shift:
        """δs = output·(θ − κ), with ξ the deviations of crank, rod and rocker from nominal, metres.

        Raises:
            ClosureError: the loop does not close at some pose, or only folded over.
        """
        numbers, bar = self._numbers(q, xi), self._built(xi)
        expect_closed(numbers, bar, q, self.angles)
        beyond = numbers[:, STATE] != KEPT
        if beyond.any():
            first = int(np.argmax(beyond))
            turns = "against" if self.side.turn > 0.0 else "with"
            how = (
                f"folded over, its rocker turning {turns} the crank"
                if numbers[first, BY_ANGLE][1] * self.side.turn <= MIN_TURN
                else "mirrored, as it does not come without being taken apart"
            )
            raise ClosureError(first, f"{bar.describe(*(self.angles @ q[first]))}, but {how}; {REMEDY}")

        by_length = numbers[:, BY_LENGTH][:, :3, None]
        return Shift(
            value=numbers[:, TURN, None] * self.output,
            jacobian=(by_length * self.output[self.moved]).reshape(len(q), 3 * len(self.moved)),
            slope=lambda: self._slope(numbers),
        )

    def curvature(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n coordinates joints joints"]:
        """∂²δs/∂q² of the nominal loop."""
        alpha, kappa = q @ self.arm, q @ self.crank
        second = curvature(self.bar, close_four_bar(self.bar, alpha, kappa), alpha, kappa)
        out = np.zeros((len(q), len(self.output), q.shape[1], q.shape[1]))
        for (a, by_i), (b, by_j) in product(enumerate(self.angles), repeat=2):
            of_loop = second[:, a, b, None] * self.output[self.moved]
            out[:, self.moved] += of_loop[:, :, None, None] * by_i[:, None] * by_j
        return out

    def closes(self, q: Float[np.ndarray, "n joints"], xi: Float[np.ndarray, " 3"]) -> Bool[np.ndarray, " n"]:
        """Whether the loop closes at each pose on the side it is built on.

        Args:
            q: joint positions, radians.
            xi: deviations of crank, rod and rocker from nominal, metres.
        """
        return self._numbers(q, xi)[:, STATE] == KEPT

    def slope(
        self, q: Float[np.ndarray, "n joints"], xi: Float[np.ndarray, " 3"]
    ) -> Float[np.ndarray, "n coordinates joints"]:
        """∂δs/∂q alone, at positions where the loop closes; arguments as of `shift`."""
        return self._slope(self._numbers(q, xi))

    def _slope(self, numbers: Float[np.ndarray, "n 8"]) -> Float[np.ndarray, "n coordinates joints"]:
        by_angle = numbers[:, BY_ANGLE] - [0.0, 1.0]
        return self.output[:, None] * (by_angle @ self.angles)[:, None, :]

    def loop_numbers(self, xi: Float[np.ndarray, " 3"]) -> LoopNumbers:
        """The loop with these deviations from nominal, as the compiled pass takes it."""
        return loop_numbers(self._built(xi), self.side)

    @cached_property
    def angles(self) -> Float[np.ndarray, "2 joints"]:
        """α and κ as linear combinations of joint positions."""
        return np.stack([self.arm, self.crank])

    @cached_property
    def wanted(self) -> Wanted:
        """The derivatives of all pairs, as the compiled pass takes them."""
        return Wanted(1 + self.pairs[:, 1], self.output[self.pairs[:, 0]])

    def _numbers(self, q: Float[np.ndarray, "n joints"], xi: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "n 8"]:
        return closure_numbers(self._built(xi), self.side, q, self.angles)

    def _built(self, xi: Float[np.ndarray, " 3"]) -> FourBar:
        bar = self.bar
        return replace(bar, crank=bar.crank + xi[0], rod=bar.rod + xi[1], rocker=bar.rocker + xi[2])


@dataclass(frozen=True, eq=False, kw_only=True)
class JointSide:
    """Couplings and four-bar of a robot together, without effects."""

    joint_map: JointMap
    four_bar: FourBarDrive | None

    @cached_property
    def drive(self) -> Drive:
        """The joint side as the compiled pass takes it."""
        matrix, offset = (np.ascontiguousarray(a, dtype=float) for a in (self.joint_map.matrix, self.joint_map.offset))
        if self.four_bar is None:
            return Drive(matrix, offset, np.empty((0, matrix.shape[1])), np.zeros(len(offset)))
        return Drive(matrix, offset, self.four_bar.angles, self.four_bar.output)

    def loop_numbers(self, xi: Float[np.ndarray, " 3"]) -> LoopNumbers:
        """The loop with these deviations from nominal, as the compiled pass takes it."""
        return NO_LOOP if self.four_bar is None else self.four_bar.loop_numbers(xi)

    def traced(self, q: Any, loop: Any) -> tuple[Any, list[Any]]:
        """Chain coordinates as expressions (1, coordinates), and what is positive where the loop closes as it was built.

        Args:
            q: joint positions, expressions (1, joints).
            loop: as of `loop_numbers`, numbers or expressions.
        """
        s, bar = self.joint_map(q), self.four_bar
        if bar is None:
            return s, []
        turn, *kept = rocker_turn(loop, *(bar.angles @ q[0]))
        return s + bar.output * turn, kept

    def wanted(self, used: Bool[np.ndarray, " pairs"]) -> Wanted:
        """The derivatives by the loop's lengths that are asked for, as the compiled pass takes them."""
        if self.four_bar is None or not len(used):
            return NOTHING_WANTED
        return Wanted(self.four_bar.wanted.which[used], self.four_bar.wanted.times[used])

    def at(
        self,
        q: Float[np.ndarray, "n joints"],
        xi: Float[np.ndarray, " 3"],
        used: Bool[np.ndarray, " pairs"],
        coordinates: int,
    ) -> tuple[Float[np.ndarray, "n coordinates"], Float[np.ndarray, "n used"]]:
        """Chain coordinates, and their derivatives by the loop's lengths.

        Args:
            q: joint positions, radians (metres where a joint slides).
            xi: deviations of the loop's crank, rod and rocker from nominal, metres.
            used: which of the loop's pairs are asked for; none for a robot without one.
            coordinates: of the chain; those beyond the robot's own are zero.

        Raises:
            ClosureError: the loop does not close at some pose, or only folded over.
        """
        n, bar, wanted = len(q), self.four_bar, self.wanted(used)
        s = np.empty((n, coordinates)) if coordinates == len(self.drive.offset) else np.zeros((n, coordinates))
        out = Coordinates(s, np.empty((n, len(wanted.which))), np.empty((n, 0)))
        if not fill_coordinates(q, self.drive, self.loop_numbers(xi), wanted, out) and bar is not None:
            bar.shift(q, xi)  # which says where it does not close
        return out.s, out.factor
