"""Orders of gears and motors that the rows prove: found in a spectrum over each joint's angle, at any frequency.

A strain-wave gear errs some hundred times in a turn of the joint, not always a whole number of times. The spectrum is that
of score tests: for joint j and order f, with a_i = c_ijᵀR_i⁻¹r_i of every pose i,

    χ² = |Σ_i a_i·exp(i·f·q_ij)|² / (½ Σ_i c_ijᵀR_i⁻¹c_ij),

which has two degrees of freedom where nothing recurs (Lomb 1976, Astrophysics and Space Science 39, in the form for noise of
uneven size). An order is taken where χ² is beyond chance among all orders of all joints (Bonferroni).
"""

import numpy as np
from jaxtyping import Float

from taskcal.identification.one_model import OneFit
from taskcal.robot.effects.harmonics import Harmonics

HIGHEST = 640.0
"""Order that is looked for: four times in a turn of the motor behind a gear of 160."""

CHANCE = 0.01
"""Of taking any order where none recurs."""

FINENESS = 0.1
"""Step of the search, in periods over the whole range of a joint."""

APART = 1.5
"""Periods over the whole range by which orders found at once differ at least."""

AT_ONCE = 3
"""Orders of a joint that are taken before the others are looked at again."""

SMALLEST_RANGE = 0.2
"""Of a joint that is searched, radians."""

SHARP_TOLERANCE = 3e-5
"""Amplitude expected of each, radians: six seconds of arc."""


def find_sharp_orders(fitted: OneFit, lowest: float) -> list[tuple[str, float]]:
    """Joints and orders that the fit's residuals prove, the clearest first.

    Args:
        fitted: the fit.
        lowest: order from which on the search begins.
    """
    robot, at = fitted.one.problem.frames.model.robot, fitted.at
    q = robot.joint_map(fitted.one.problem.q)
    # the fit was linearised where it ended
    left = np.einsum("nji,nj->ni", fitted.whitener, np.einsum("nij,nj->ni", fitted.whitener, at.residual))
    weighted = np.einsum("nij,nik->njk", fitted.whitener, fitted.whitener @ at.by_joint)
    pull = np.einsum("nik,ni->nk", at.by_joint, left)
    size = 0.5 * np.einsum("nik,nik->k", at.by_joint, weighted)
    ranges = np.ptp(q, axis=0)
    joints = [j for j in range(len(ranges)) if not robot.prismatic[j] and ranges[j] > SMALLEST_RANGE and size[j] > 0.0]
    tried = sum((HIGHEST - lowest) * ranges[j] / np.pi for j in joints)
    beyond_chance = 2.0 * np.log(max(tried, 1.0) / CHANCE)
    found: list[tuple[float, int, float]] = []
    for j in joints:
        period = 2.0 * np.pi / ranges[j]
        orders = np.arange(lowest, HIGHEST, FINENESS * period)
        test = _spectrum(q[:, j], pull[:, j], orders) / size[j]
        for _ in range(AT_ONCE):
            k = int(test.argmax())
            if test[k] < beyond_chance:
                break
            found.append((float(test[k]), j, float(orders[k])))
            test[np.abs(orders - orders[k]) < APART * period] = 0.0
    return [(robot.joint_names[j], round(order, 2)) for _, j, order in sorted(found, reverse=True)]


def find_clear_orders(fitted: OneFit, effect: str) -> dict[str, tuple[str, float]]:
    """Parameters of orders that are far beyond what the others of their joint let expect, with a name and a tolerance for each.

    An estimate x̂ of a parameter of variance v, with the posterior variance s, is itself of variance v − s. Cosine and sine of an
    order are χ²-distributed together, and an order stands out where χ² is beyond chance among all of them (Bonferroni).

    Args:
        fitted: the fit.
        effect: whose orders share a size for each joint.
    """
    one, found = fitted.one, fitted.found
    own = found.reduced.groups.own
    x, S = found.evidence.mean(own), np.square(found.evidence.spread).sum(axis=1)
    v = np.exp(found.evidence.log_variances)[own]
    labels, names = [one.labels[g] for g in own], [one.problem.frames.names[i] for i in one.groups.grouped]
    chance = x**2 / np.maximum(v - S, 1e-6 * v)
    both: dict[str, list[int]] = {}
    for k, (label, name) in enumerate(zip(labels, names, strict=True)):
        if label.effect == effect and not label.part:
            both.setdefault(name.replace(".cos", ".").replace(".sin", "."), []).append(k)
    beyond = 2.0 * np.log(max(len(both), 1) / CHANCE)
    return {
        names[k]: (order, SHARP_TOLERANCE)
        for order, members in both.items()
        if chance[members].sum() > beyond
        for k in members
    }


def _spectrum(
    angle: Float[np.ndarray, " n"], pull: Float[np.ndarray, " n"], orders: Float[np.ndarray, " k"]
) -> Float[np.ndarray, " k"]:
    """|Σ pull·exp(i·order·angle)|² at evenly spaced orders."""
    out = np.empty(len(orders))
    turned = pull * np.exp(1j * orders[0] * angle)
    step = np.exp(1j * (orders[1] - orders[0]) * angle)
    for k in range(len(orders)):
        total = turned.sum()
        out[k] = total.real**2 + total.imag**2
        turned *= step
    return out


def as_effects(orders: list[tuple[str, float]]) -> list[Harmonics]:
    """One effect for each joint that has such orders."""
    by_joint: dict[str, list[float]] = {}
    for joint, order in orders:
        by_joint.setdefault(joint, []).append(order)
    return [
        Harmonics(joints=(joint,), orders=tuple(sorted(set(own))), tolerance=SHARP_TOLERANCE)
        for joint, own in sorted(by_joint.items())
    ]
