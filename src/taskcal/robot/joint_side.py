"""The joint side: from controller joint positions to the coordinates of the chain, and what its parameters move."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Inexact, Int

from taskcal.errors import ClosureError
from taskcal.geometry.four_bar import (
    MIN_TURN,
    REMEDY,
    FourBar,
    Side,
    built_side,
    can_close,
    close_four_bar,
    curvature,
    keeps_side,
)
from taskcal.robot.conditions import Conditions


@dataclass(frozen=True, eq=False)
class Shift:
    """What a joint-side term adds to the chain coordinates."""

    value: Float[np.ndarray, "n coordinates"]
    """δs, radians or metres."""
    jacobian: Float[np.ndarray, "n pairs"]
    """∂δs/∂ξ for each of the term's pairs."""
    slope: Callable[[], Float[np.ndarray, "n coordinates joints"]]
    """Computes ∂δs/∂q, which few need."""

    @cached_property
    def by_joint(self) -> Float[np.ndarray, "n coordinates joints"]:
        """∂δs/∂q."""
        return self.slope()


@runtime_checkable
class JointTerm(Protocol):
    """A physical effect on the joint side: δs = φ(q, ξ), with its derivatives."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its parameters ξ, all in metres or radians as `units` says."""
        ...

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each parameter, ``m`` or ``rad``."""
        ...

    @property
    def pairs(self) -> Int[np.ndarray, "pairs 2"]:
        """Which chain coordinate each of its parameters moves: rows (coordinate, parameter)."""
        ...

    def prepare(
        self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None
    ) -> Float[np.ndarray, "n k"] | None:
        """What `shift` needs at joint positions q and no parameter changes; None where there is nothing of the kind.

        Without conditions an effect that depends on them is as in their middle.
        """
        ...

    def shift(
        self,
        q: Float[np.ndarray, "n joints"],
        xi: Float[np.ndarray, " p"],
        prepared: Float[np.ndarray, "n k"] | None = None,
    ) -> Shift:
        """Evaluate at joint positions q (radians, metres) and parameters ξ."""
        ...


@dataclass(frozen=True, eq=False, kw_only=True)
class JointMap:
    """Linear part of the joint side: s = matrix·q + offset."""

    matrix: Float[np.ndarray, "coordinates joints"]
    """Signs, ratios and linear couplings."""
    offset: Float[np.ndarray, " coordinates"]
    """Chain coordinates at zero joint positions, radians or metres."""

    def __call__(self, q: Inexact[np.ndarray, "n joints"]) -> Inexact[np.ndarray, "n coordinates"]:
        """Chain coordinates at joint positions q; complex where those are, for derivatives by complex steps."""
        return q @ self.matrix.T + self.offset


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
        """Where the nominal loop was built."""
        return built_side(self.bar)

    @property
    def pairs(self) -> Int[np.ndarray, "pairs 2"]:
        """Each of the three lengths moves every coordinate that the loop moves."""
        return np.array([(c, k) for k in range(3) for c in self.moved])

    def prepare(self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None) -> None:
        """Nothing: the closure depends on its lengths throughout."""

    def shift(
        self,
        q: Float[np.ndarray, "n joints"],
        xi: Float[np.ndarray, " 3"],
        prepared: Float[np.ndarray, "n k"] | None = None,
    ) -> Shift:
        """δs = output·(θ − κ), with ξ the deviations of crank, rod and rocker from nominal, metres.

        Raises:
            ClosureError: the loop does not close at some pose, or only folded over.
        """
        alpha, kappa, bar = q @ self.arm, q @ self.crank, self._built(xi)
        closure = close_four_bar(bar, alpha, kappa)
        beyond = ~keeps_side(bar, self.side, closure, alpha, kappa)
        if beyond.any():
            first = int(np.argmax(beyond))
            turns = "against" if self.side.turn > 0.0 else "with"
            how = (
                f"folded over, its rocker turning {turns} the crank"
                if closure.by_angle[first, 1] * self.side.turn <= MIN_TURN
                else "mirrored, as it does not come without being taken apart"
            )
            raise ClosureError(first, f"{bar.describe(alpha[first], kappa[first])}, but {how}; {REMEDY}")

        def slope() -> Float[np.ndarray, "n coordinates joints"]:
            turn = closure.by_angle[:, :1] * self.arm + (closure.by_angle[:, 1:] - 1.0) * self.crank
            return self.output[:, None] * turn[:, None, :]

        return Shift(
            value=(closure.angle - kappa)[:, None] * self.output,
            jacobian=(closure.by_length[:, :3, None] * self.output[self.moved]).reshape(len(q), 3 * len(self.moved)),
            slope=slope,
        )

    def curvature(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n coordinates joints joints"]:
        """∂²δs/∂q² of the nominal loop."""
        alpha, kappa = q @ self.arm, q @ self.crank
        second = curvature(self.bar, close_four_bar(self.bar, alpha, kappa), alpha, kappa)
        angles = np.stack([self.arm, self.crank])
        return np.einsum("c,nab,ai,bj->ncij", self.output, second, angles, angles)

    def closes(self, q: Float[np.ndarray, "n joints"], xi: Float[np.ndarray, " 3"]) -> Bool[np.ndarray, " n"]:
        """Whether the loop closes at each pose on the side it is built on.

        Args:
            q: joint positions, radians.
            xi: deviations of crank, rod and rocker from nominal, metres.
        """
        alpha, kappa, bar = q @ self.arm, q @ self.crank, self._built(xi)
        out = can_close(bar, alpha, kappa)
        alpha, kappa = alpha[out], kappa[out]
        out[out] = keeps_side(bar, self.side, close_four_bar(bar, alpha, kappa), alpha, kappa)
        return out

    def _built(self, xi: Float[np.ndarray, " 3"]) -> FourBar:
        bar = self.bar
        return replace(bar, crank=bar.crank + xi[0], rod=bar.rod + xi[1], rocker=bar.rocker + xi[2])
