"""Joint-side terms that are linear in their parameters: δs = Φ(q)·(ξ₀ + ξ)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from taskcal.robot.conditions import Conditions
from taskcal.robot.effects.complex_step import differentiate
from taskcal.robot.joint_side import Shift
from taskcal.robot.robot import Robot

Basis = Callable[[np.ndarray], np.ndarray]
ConditionedBasis = Callable[[np.ndarray, Conditions], np.ndarray]


@dataclass(frozen=True, eq=False, kw_only=True)
class LinearTerm:
    """A joint-side term that is linear in its parameters."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    tolerances: tuple[float, ...]
    """Standard deviations expected of the parameters, in their units."""
    pairs: Int[np.ndarray, "pairs 2"]
    """Which chain coordinate each parameter moves: rows (coordinate, parameter)."""
    coordinates: int
    basis: Basis
    """Joint positions (n, joints) to ∂δs/∂ξ of every pair (n, pairs)."""
    given: ConditionedBasis | None = None
    """The same where conditions are known, for effects that depend on them."""
    by_joint: Basis | None = None
    """Joint positions (n, joints) to ∂basis/∂q of every pair (n, pairs, joints); by complex steps where None."""
    nominal: Float[np.ndarray, " p"] | None = None
    """ξ₀, what is known of the effect beforehand, from which its parameters are deviations; zero where None."""

    def prepare(
        self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None
    ) -> Float[np.ndarray, "n pairs"]:
        """The factors at joint positions q and under conditions, which no parameter changes."""
        if self.given is None or conditions is None:
            return np.ascontiguousarray(self.basis(q))
        return np.ascontiguousarray(self.given(q, conditions))

    def shift(
        self,
        q: Float[np.ndarray, "n joints"],
        xi: Float[np.ndarray, " p"],
        prepared: Float[np.ndarray, "n pairs"] | None = None,
    ) -> Shift:
        """δs at joint positions q and parameters ξ."""
        factor = self.prepare(q) if prepared is None else prepared
        place = np.zeros((len(self.pairs), self.coordinates))
        value = xi if self.nominal is None else self.nominal + xi
        place[np.arange(len(self.pairs)), self.pairs[:, 0]] = value[self.pairs[:, 1]]
        return Shift(value=factor @ place, jacobian=factor, slope=lambda: self._slope(q, place))

    def _slope(
        self, q: Float[np.ndarray, "n joints"], place: Float[np.ndarray, "pairs coordinates"]
    ) -> Float[np.ndarray, "n coordinates joints"]:
        """∂δs/∂q: the derivative of the basis, weighted by the parameters."""
        by_joint = differentiate(self.basis, q) if self.by_joint is None else self.by_joint(q)
        return np.einsum("npj,pc->ncj", by_joint, place)


def at_joints(
    names: Sequence[str],
    robot: Robot,
    coordinates: Int[np.ndarray, " p"],
    tolerances: Sequence[float],
    basis: Basis,
    *,
    given: ConditionedBasis | None = None,
    by_joint: Basis | None = None,
    share: bool | Int[np.ndarray, " p"] = False,
) -> LinearTerm:
    """A term of which each parameter moves one coordinate.

    Args:
        names: of the parameters.
        robot: the robot.
        coordinates: number of the coordinate that each one moves.
        tolerances: of the parameters.
        basis: movement of its coordinate for a unit of each parameter, at joint positions q: (n, joints) to (n, p).
        given: the same under conditions, for effects that depend on them; `basis` is then where nothing is known of them.
        by_joint: derivative of `basis` by joint positions, (n, p, joints). Where it is not given, `basis` is evaluated at
            complex positions: NumPy's sums, products and analytic functions can be, but not `abs`, `arctan2` or comparisons.
        share: whether the parameters are shares of a motion, radians per radian; or the number of the coordinate whose motion
            each one is a share of, where that is another.
    """
    units = _units(robot, coordinates)
    if share is not False:
        driving = _units(robot, coordinates if isinstance(share, bool) else share)
        units = [f"{unit}/{of}" for unit, of in zip(units, driving, strict=True)]
    return LinearTerm(
        names=tuple(names),
        units=tuple(units),
        tolerances=tuple(tolerances),
        pairs=np.stack([coordinates, np.arange(len(names))], axis=1),
        coordinates=len(robot.joints),
        basis=basis,
        given=given,
        by_joint=by_joint,
    )


def _units(robot: Robot, coordinates: Int[np.ndarray, " p"]) -> list[str]:
    return ["m" if robot.prismatic[c] else "rad" for c in coordinates]
