"""How far an arm stretches: no posture leads beyond, so that a pose out there needs no search.

Neighbouring axes of a serial chain stay at one distance, however its joints turn. From a point on the first axis to a point on the
last, which the pose of the tool tells, it is never farther than along points of all axes. Where those lie on their axes is free;
they are chosen so that the way is shortest. A joint that slides adds half its travel, counted from the middle.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float

from taskcal.geometry import se3
from taskcal.geometry.chain import FIXED, PRISMATIC, REVOLUTE
from taskcal.robot.error_model import ErrorModel

SLACK = 1e-6
"""Share of the longest way, and metres, by which a pose may lie farther for all that rounding does."""

SMOOTH_M = 1e-6
"""Distances are rounded off below this while the points are chosen, metres."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Stretch:
    """A ball that a point of the tool never leaves, of the nominal robot."""

    centre: Float[np.ndarray, "3"]
    """In the base, metres."""
    point: Float[np.ndarray, "3"]
    """In the tool's frame, metres."""
    longest: float
    """Metres; infinite where a joint slides without limits."""

    def admits(self, T: Float[np.ndarray, "n 4 4"]) -> Bool[np.ndarray, " n"]:
        """Whether tool poses in the base are near enough to be reached at all; none that is reached is left out."""
        points = T[:, :3, :3] @ self.point + T[:, :3, 3]
        distance = np.linalg.norm(points - self.centre, axis=1)
        return ~(distance > self.longest * (1.0 + SLACK) + SLACK)


@lru_cache(maxsize=16)
def stretch_of(model: ErrorModel) -> Stretch:
    """How far the arm of a nominal robot stretches."""
    places, directions, middle, half, T_tool = _axes_at_home(model)
    if not len(places) or not np.isfinite(half).all():
        return Stretch(centre=np.zeros(3), point=np.zeros(3), longest=np.inf)

    def ways(along: Float[np.ndarray, " joints"]) -> Float[np.ndarray, "parts 3"]:
        """From a point of each joint, behind its motion, to the one of the next, before it."""
        behind = places + along[:, None] * directions
        before = behind + middle[:, None] * directions
        return before[1:] - behind[:-1]

    def length(along: Float[np.ndarray, " joints"]) -> float:
        return float(np.sqrt((ways(along) ** 2).sum(axis=1) + SMOOTH_M**2).sum())

    from scipy.optimize import minimize

    along = minimize(length, np.zeros(len(places)), method="BFGS").x
    behind = places + along[:, None] * directions
    return Stretch(
        centre=behind[0] + middle[0] * directions[0],
        point=(se3.inverse(T_tool) @ [*behind[-1], 1.0])[:3],
        longest=float(np.linalg.norm(ways(along), axis=1).sum() + half.sum()),
    )


def _axes_at_home(
    model: ErrorModel,
) -> tuple[
    Float[np.ndarray, "joints 3"],
    Float[np.ndarray, "joints 3"],
    Float[np.ndarray, " joints"],
    Float[np.ndarray, " joints"],
    Float[np.ndarray, "4 4"],
]:
    """Places and directions of all axes with every chain coordinate at zero, the middle and half of their travel, and the tool."""
    chain, T = model.chain, np.eye(4)
    places: list[np.ndarray] = []
    directions: list[np.ndarray] = []
    travel: list[tuple[float, float]] = []
    for kind, index in zip(chain.kind, chain.index, strict=True):
        if kind == FIXED:
            T = T @ np.vstack([chain.fixed[index], [0.0, 0.0, 0.0, 1.0]])
        elif kind in (REVOLUTE, PRISMATIC):
            places.append(T[:3, 3].copy())
            directions.append(T[:3, 2].copy())
            travel.append(_travel(model, int(index)) if kind == PRISMATIC else (0.0, 0.0))
    low, high = np.array(travel).reshape(-1, 2).T
    bounded = np.isfinite(low) & np.isfinite(high)
    middle = np.where(bounded, 0.5 * (np.where(bounded, low, 0.0) + np.where(bounded, high, 0.0)), 0.0)
    half = np.where(bounded, 0.5 * (high - low), np.inf) if len(low) else np.zeros(0)
    return np.array(places).reshape(-1, 3), np.array(directions).reshape(-1, 3), middle, half, T


def _travel(model: ErrorModel, coordinate: int) -> tuple[float, float]:
    """Smallest and largest value of a chain coordinate that slides, metres; infinite where that is not known."""
    joint_map = model.robot.joint_map
    if model.robot.four_bar is not None or coordinate >= len(joint_map.offset):
        return -np.inf, np.inf
    factors = joint_map.matrix[coordinate]
    used = factors != 0.0
    ends = factors[used, None] * model.robot.limits[used]
    offset = float(joint_map.offset[coordinate])
    return offset + float(ends.min(axis=1).sum()), offset + float(ends.max(axis=1).sum())
