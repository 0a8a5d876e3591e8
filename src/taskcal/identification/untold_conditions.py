"""What is uncertain of a pose where it is not known how it is reached, or how warm the robot is.

What is not told counts by its expectation, and adds its variance. With ξ the parameters of the effects that depend on conditions,
m and S their estimate and covariance, and J_c the derivative of a target by them under a condition c of mean zero,

    E[(J_c·ξ)(J_c·ξ)ᵀ] = E[J_c·(m·mᵀ + S)·J_cᵀ],

so that effects which are hardly known add their uncertainty, too.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from taskcal.identification.linearisation import joint_columns
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects import LinearTerm

if TYPE_CHECKING:
    from taskcal.identification.calibration import Calibration


def untold_covariance(
    calibration: "Calibration", q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None
) -> Float[np.ndarray, "n targets b b"]:
    """Covariance of the targets by what is not told of the poses, metres² (and radians², for poses), tracker frame.

    A joint whose side is not told came from either one with even chance. Its share of the largest move is evenly spread
    between nothing and all, so that the mean of its square is 1/3, and of its product with the side 1/2. What an effect
    needs and is not told is as far from its reference as the effect says (`Effect.off_reference`).

    Args:
        calibration: with effects that depend on conditions.
        q: joint positions, radians.
        conditions: what is told; nothing by default.
    """
    terms = [term for term in calibration.model.terms if isinstance(term, LinearTerm) and term.given is not None]
    index = {name: i for i, name in enumerate(calibration.all_names)}
    own = np.array([index[name] for term in terms for name in term.names])
    second = calibration.z_covariance[np.ix_(own, own)] + np.outer(calibration.z[own], calibration.z[own])
    at = calibration.layout.walked(q, calibration.z, calibration.model.prepare(q, conditions))
    angular = calibration.layout.pose
    columns = np.stack([joint_columns(at, offset, angular=angular) for offset in at.points.position], axis=1)
    out = np.zeros((*columns.shape[:3], columns.shape[2]))
    for probe, weight in _probes(calibration, len(q), conditions or Conditions()):
        rows = np.flatnonzero(weight)
        if not len(rows):
            continue
        J = _derivative(terms, q[rows], probe.take(rows), columns[rows])
        out[rows] += weight[rows, None, None, None] * (J @ second @ np.swapaxes(J, -1, -2))
    return out


def _derivative(
    terms: list[LinearTerm],
    q: Float[np.ndarray, "k joints"],
    conditions: Conditions,
    columns: Float[np.ndarray, "k targets b coordinates"],
) -> Float[np.ndarray, "k targets b p"]:
    """Of the targets, by the parameters of terms under conditions."""
    parts: list[np.ndarray] = []
    for term in terms:
        factor = term.prepare(q, conditions)
        part = np.zeros((*columns.shape[:3], len(term.names)))
        for k, (coordinate, parameter) in enumerate(term.pairs):
            part[..., parameter] += columns[..., coordinate] * factor[:, None, None, k]
        parts.append(part)
    return np.concatenate(parts, axis=3)


def _probes(
    calibration: "Calibration", count: int, conditions: Conditions
) -> Iterator[tuple[Conditions, Float[np.ndarray, " n"]]]:
    """Conditions, and with which weight the square of what each does counts at every pose.

    Of a side a and a move b, where neither is told, (a + b)², a² and b² with ½, ½ and −1/6 are a² + 2·½·a·b + ⅓·b².
    """
    joints = len(calibration.model.robot.joints)
    nothing = np.zeros((count, joints))
    side = nothing if conditions.approach is None else conditions.approach
    move = nothing if conditions.move is None else conditions.move
    no_side, no_move = side == 0.0, np.broadcast_to((move == 0.0).all(axis=1, keepdims=True), move.shape)
    for j in range(joints):
        way = np.zeros((count, joints))
        way[:, j] = 1.0
        a, b = no_side[:, j], no_move[:, j]
        yield Conditions(approach=way, move=way), np.where(a & b, 0.5, 0.0)
        yield Conditions(approach=way), np.where(a, np.where(b, 0.5, 1.0), 0.0)
        yield Conditions(move=way), np.where(b, np.where(a, -1.0 / 6.0, 1.0 / 3.0), 0.0)
    for effect in calibration.model.effects:
        off = effect.off_reference(count)
        if off is not None:
            told = [getattr(conditions, quantity) for quantity in effect.needs]
            yield off, np.max([np.ones(count) if t is None else ~np.isfinite(t) for t in told], axis=0).astype(float)
