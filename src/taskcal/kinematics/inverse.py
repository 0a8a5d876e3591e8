"""Joint positions that bring the tool to given poses: damped Newton with the analytic Jacobian, many poses at once."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.stats import qmc

from taskcal.errors import ClosureError, ReachError
from taskcal.geometry import se3
from taskcal.robot.error_model import ErrorModel

POSITION, ROTATION = 1e-9, 1e-9
"""A pose is reached within these, metres and radians."""

SAME = 1e-6
"""Postures nearer to each other than this are one, radians."""

JUMP = np.pi / 3
"""Within a short step of the tool, a joint that turns farther has left its branch."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Reached:
    """Joint positions for some poses."""

    q: Float[np.ndarray, "n joints"]
    """Radians; where a pose was not reached, the closest found."""
    reached: Bool[np.ndarray, " n"]
    """Whether the pose is met, inside all limits."""


def _twist(target: np.ndarray, T: np.ndarray) -> np.ndarray:
    """Translation and rotation from T to target, in base axes."""
    turn = se3.log(target[:, :3, :3] @ np.swapaxes(T[:, :3, :3], 1, 2))
    return np.concatenate([target[:, :3, 3] - T[:, :3, 3], turn], axis=1)


def solve_near(
    model: ErrorModel,
    T: Float[np.ndarray, "n 4 4"],
    seed: Float[np.ndarray, "n joints"],
    x: Float[np.ndarray, " p"] | None = None,
    *,
    iterations: int = 25,
) -> Reached:
    """Solve each pose from its own seed, and stay on the seed's branch.

    Args:
        model: the model; the pose met is that of its tool.
        T: tool poses in the base.
        seed: joint positions to start from, radians.
        x: parameter values; the nominal robot by default.
        iterations: Newton steps at most.
    """
    q = _approach(model, T, seed, x, iterations)
    return Reached(q=q, reached=_met(model, T, q, x))


def _approach(
    model: ErrorModel,
    T: Float[np.ndarray, "n 4 4"],
    seed: Float[np.ndarray, "n joints"],
    x: Float[np.ndarray, " p"] | None,
    iterations: int,
) -> Float[np.ndarray, "n joints"]:
    """Newton steps from the seeds, each pose until it is met."""
    q = np.array(seed, dtype=float)
    weight = np.repeat([1.0, 0.5], 3)  # a metre counts like two radians, about an arm's length
    active = np.arange(len(q))
    for _ in range(iterations):
        if not len(active):
            break
        try:
            at, J = model.poses(q[active], x), model.joint_jacobian(q[active], x)
        except ClosureError:
            active = active[_closes_one_by_one(model, q[active], x)]
            continue
        error = _twist(T[active], at)
        far = (np.abs(error[:, :3]).max(axis=1) > 1e-4 * POSITION) | (
            np.abs(error[:, 3:]).max(axis=1) > 1e-4 * ROTATION
        )
        active, error, J = active[far], (error * weight)[far], J[far] * weight[:, None]
        size = np.linalg.norm(error, axis=1)
        # damping fades with the error, so that the last steps are pure Newton; it tames singular poses (Wampler 1986)
        damping = 1e-3 * np.minimum(size, 1.0) ** 2 + 1e-16
        JT = np.swapaxes(J, 1, 2)
        step = (JT @ np.linalg.solve(J @ JT + damping[:, None, None] * np.eye(6), error[:, :, None]))[:, :, 0]
        step *= np.minimum(1.0, 0.5 / np.maximum(np.abs(step).max(axis=1), 1e-12))[:, None]
        q[active] += step
    return q


def _closes_one_by_one(model: ErrorModel, q: np.ndarray, x: np.ndarray | None) -> np.ndarray:
    out = np.ones(len(q), dtype=bool)
    for i in range(len(q)):
        try:
            model.walk(q[i : i + 1], x)
        except ClosureError:
            out[i] = False
    return out


def _met(model: ErrorModel, T: np.ndarray, q: np.ndarray, x: np.ndarray | None) -> np.ndarray:
    """Whether each pose is met inside the limits."""
    ok = closes(model, q, x)
    error = np.full((len(q), 6), np.inf)
    if ok.any():
        error[ok] = _twist(T[ok], model.poses(q[ok], x))
    ok &= (np.abs(error[:, :3]).max(axis=1) < POSITION) & (np.abs(error[:, 3:]).max(axis=1) < ROTATION)
    return ok & model.robot.inside_limits(q)


def closes(
    model: ErrorModel, q: Float[np.ndarray, "n joints"], x: Float[np.ndarray, " p"] | None = None
) -> Bool[np.ndarray, " n"]:
    """Whether the closed loops of a robot assemble at each pose."""
    try:
        model.walk(q, x)
    except ClosureError:
        return _closes_one_by_one(model, q, x)
    return np.ones(len(q), dtype=bool)


def find_posture(model: ErrorModel, T: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, " joints"]:
    """A posture for one pose, of all that are found the one deepest inside the limits and farthest from singular.

    Raises:
        ReachError: no seed leads to the pose inside the limits.
    """
    return find_postures(model, T)[0]


def find_postures(model: ErrorModel, T: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "postures joints"]:
    """The postures that reach one pose inside the limits, found from seeds all over the joint ranges, the best first.

    Of a robot with more joints than a pose needs, these are some of infinitely many.

    Raises:
        ReachError: no seed leads to the pose inside the limits.
    """
    limits = np.clip(model.robot.limits, -np.pi, np.pi)
    seeds = qmc.scale(qmc.Sobol(len(limits), rng=0).random(256), limits[:, 0], limits[:, 1])
    seeds = np.concatenate([limits.mean(axis=1)[None], seeds])
    closing = closes(model, seeds, None)
    found = solve_near(model, np.broadcast_to(T, (int(closing.sum()), 4, 4)), seeds[closing], iterations=60)
    if not found.reached.any():
        x, y, z = T[:3, 3] * 1e3
        raise ReachError(
            f"{model.robot.name} does not reach the tool pose at x {x:.0f}, y {y:.0f}, z {z:.0f} mm with this orientation inside "
            "its limits; move the workspace, turn the tool, or widen the limits in the robot file"
        )
    q = found.q[found.reached]
    q = q[np.argsort(-_depth(model, q), kind="stable")]
    different: list[np.ndarray] = []
    for posture in q:
        if all(np.abs(posture - other).max() > SAME for other in different):
            different.append(posture)
    return np.stack(different)


def _depth(model: ErrorModel, q: np.ndarray) -> np.ndarray:
    """How far inside the limits and away from singular postures, 0 to 1."""
    low, high = np.clip(model.robot.limits, -2 * np.pi, 2 * np.pi).T
    room = (np.minimum(q - low, high - q) / (high - low) * 2.0).min(axis=1)
    s = np.linalg.svd(model.joint_jacobian(q), compute_uv=False)
    return np.minimum(room, 4.0 * s[:, -1] / s[:, 0])


def follow(
    model: ErrorModel, T: Float[np.ndarray, "n 4 4"], start: Float[np.ndarray, " joints"], *, steps: int = 12
) -> Reached:
    """Solve poses on the branch of a starting posture, each along a straight way from it in small steps.

    Args:
        model: the model.
        T: tool poses in the base.
        start: posture that the branch is taken from, radians.
        steps: how many steps the way is cut into.
    """
    home = model.poses(start[None])[0]
    q = np.tile(start, (len(T), 1))
    turn = se3.log(T[:, :3, :3] @ home[:3, :3].T)
    stayed = np.ones(len(T), dtype=bool)
    for k in range(1, steps):
        share = k / steps
        R = se3.exp(share * turn) @ home[:3, :3]
        p = home[:3, 3] + share * (T[:, :3, 3] - home[:3, 3])
        # on the way two Newton steps keep up; only the end must be exact
        ahead = _approach(model, se3.pose(R, p), q, None, 2)
        stayed &= np.abs(ahead - q).max(axis=1) < JUMP
        q = ahead
    found = solve_near(model, T, q)
    stayed &= np.abs(found.q - q).max(axis=1) < JUMP
    return Reached(q=found.q, reached=found.reached & stayed)
