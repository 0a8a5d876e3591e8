"""The segments of a tool's path in a part's frame: lines and arcs, as a controller interpolates them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.geometry import se3

STRAIGHT = 1e-6
"""An arc whose via point is nearer to its chord than this share of the chord is a line."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Segments:
    """Many segments at once; along each, orientation turns about one axis in step with the distance travelled."""

    start: Float[np.ndarray, "m 4 4"]
    """Pose of the tool in the part's frame, metres; NaN where it is not known."""
    end: Float[np.ndarray, "m 4 4"]
    via: Float[np.ndarray, "m 3"]
    """A point on the arc, metres; NaN for a line."""

    @cached_property
    def turn(self) -> Float[np.ndarray, "m 3"]:
        """Rotation from start to end in the start's axes, radians; NaN where an end is not known."""
        out = np.full((len(self.start), 3), np.nan)
        both_known = np.isfinite(self.start[:, 0, 0] + self.end[:, 0, 0])
        if both_known.any():
            R = np.swapaxes(self.start[both_known, :3, :3], 1, 2) @ self.end[both_known, :3, :3]
            out[both_known] = se3.log(R)
        return out

    @cached_property
    def _arc(self) -> tuple[Bool[np.ndarray, " m"], Float[np.ndarray, "m 3"], Float[np.ndarray, "m 3"], np.ndarray]:
        """Whether each segment is an arc, its centre, its axis, and the angles of its via point and of its end."""
        a, v, b = self.start[:, :3, 3], self.via, self.end[:, :3, 3]
        u, w = v - a, b - a
        with np.errstate(invalid="ignore", divide="ignore"):
            normal = np.cross(u, w)
            square = (normal**2).sum(axis=1)
            chord = np.maximum((w**2).sum(axis=1), (u**2).sum(axis=1))
            is_arc = square > (STRAIGHT * chord) ** 2
            # centre of the circle through three points, from the first
            uu, ww = (u**2).sum(axis=1)[:, None], (w**2).sum(axis=1)[:, None]
            center = a + np.cross(uu * w - ww * u, normal) / (2.0 * square[:, None])
            axis = normal / np.sqrt(square)[:, None]
            angles = np.stack([_angle(a - center, point - center, axis) for point in (v, b)], axis=1)
        return is_arc, center, axis, angles

    @property
    def is_arc(self) -> Bool[np.ndarray, " m"]:
        """Whether each segment is an arc."""
        return self._arc[0]

    @property
    def arc_angle(self) -> Float[np.ndarray, " m"]:
        """Angle that each arc spans about its centre, 0 to 2π; zero for a line."""
        is_arc, _, _, angles = self._arc
        return np.where(is_arc, angles[:, 1], 0.0)

    @property
    def via_share(self) -> Float[np.ndarray, " m"]:
        """Share of an arc's length at which its via point lies; NaN for a line."""
        is_arc, _, _, angles = self._arc
        return np.where(is_arc, angles[:, 0] / np.where(is_arc, angles[:, 1], 1.0), np.nan)

    @cached_property
    def length(self) -> Float[np.ndarray, " m"]:
        """Of the tool point's path, metres."""
        is_arc, center, _, angles = self._arc
        radius = np.linalg.norm(self.start[:, :3, 3] - center, axis=1)
        straight = np.linalg.norm(self.end[:, :3, 3] - self.start[:, :3, 3], axis=1)
        return np.where(is_arc, radius * angles[:, 1], straight)

    def at(self, segment: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k 4 4"]:
        """Poses at shares of the length, 0 to 1, of some segments."""
        start, end = self.start[segment], self.end[segment]
        R = start[:, :3, :3] @ se3.exp(share[:, None] * self.turn[segment])
        p = start[:, :3, 3] + share[:, None] * (end[:, :3, 3] - start[:, :3, 3])
        is_arc, center, axis, angles = (array[segment] for array in self._arc)
        if is_arc.any():
            spoke = start[is_arc, :3, 3] - center[is_arc]
            turned = se3.exp(axis[is_arc] * (share * angles[:, 1])[is_arc, None])
            p[is_arc] = center[is_arc] + (turned @ spoke[:, :, None])[:, :, 0]
        return se3.pose(R, p)

    def direction(self, segment: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k 3"]:
        """Unit vectors along some segments; zero where the tool point stays."""
        out = self.end[segment, :3, 3] - self.start[segment, :3, 3]
        is_arc, center, axis, _ = (array[segment] for array in self._arc)
        if is_arc.any():
            spoke = self.at(segment[is_arc], share[is_arc])[:, :3, 3] - center[is_arc]
            out[is_arc] = np.cross(axis[is_arc], spoke)
        size = np.linalg.norm(out, axis=1, keepdims=True)
        return np.where(size > 1e-9, out / np.maximum(size, 1e-9), 0.0)


def _angle(
    a: Float[np.ndarray, "m 3"], b: Float[np.ndarray, "m 3"], axis: Float[np.ndarray, "m 3"]
) -> Float[np.ndarray, " m"]:
    """Angle from a to b about an axis, 0 to 2π."""
    sine = (np.cross(a, b) * axis).sum(axis=1)
    return np.arctan2(sine, (a * b).sum(axis=1)) % (2.0 * np.pi)
