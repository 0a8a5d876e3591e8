"""A workspace: where the TCP is, and how the tool is turned."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float

from taskcal.arguments import checked
from taskcal.geometry import se3
from taskcal.short_repr import short_repr


@checked
@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Orientation:
    """A direction of the tool, possibly with room around it."""

    rotation: Float[np.ndarray, "3 3"]
    """Of the tool frame in the workspace's frame."""
    cone: float = 0.0
    """Largest tilt of the tool's z axis, radians."""
    spin: float = 0.0
    """Largest turn about the tool's z axis, radians; π where it is free."""

    def sample(self, u: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3 3"]:
        """Rotations for numbers u in [0, 1): tilts uniform over the cone's cap, in every direction, and turns."""
        cosine = 1.0 - u[:, 0] * (1.0 - np.cos(self.cone))
        tilt, around = np.arccos(np.clip(cosine, -1.0, 1.0)), 2.0 * np.pi * u[:, 1]
        axis = np.stack([np.cos(around), np.sin(around), np.zeros(len(u))], axis=1)
        turn = np.zeros((len(u), 3))
        turn[:, 2] = self.spin * (2.0 * u[:, 2] - 1.0)
        return self.rotation @ se3.exp(tilt[:, None] * axis) @ se3.exp(turn)


@checked
@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Workspace:
    """A box or a cylinder of TCPs, with the orientations the tool takes in it."""

    T_base_frame: Float[np.ndarray, "4 4"]
    """Pose of the workspace's frame in the robot's base."""
    shape: Literal["box", "cylinder"]
    center: Float[np.ndarray, " 3"]
    """In the frame, metres."""
    size: Float[np.ndarray, " 3"]
    """Edges of the box; or diameter twice and height of the cylinder, whose axis is z of `turned`; metres."""
    turned: Float[np.ndarray, "3 3"]
    """Of the shape in the frame."""
    orientations: tuple[Orientation, ...]

    def sample(self, count: int, seed: int = 0) -> Float[np.ndarray, "count 4 4"]:
        """Poses of the tool in the base, spread evenly (scrambled Halton sequence), orientations in turn."""
        from scipy.stats import qmc

        return self.place(qmc.Halton(6, rng=seed).random(count))

    def place(self, u: Float[np.ndarray, "count 6"]) -> Float[np.ndarray, "count 4 4"]:
        """Poses of the tool in the base for numbers u in [0, 1), orientations in turn."""
        count = len(u)
        if self.shape == "box":
            local = (u[:, :3] - 0.5) * self.size
        else:
            radius, angle = 0.5 * self.size[0] * np.sqrt(u[:, 0]), 2.0 * np.pi * u[:, 1]
            local = np.stack([radius * np.cos(angle), radius * np.sin(angle), (u[:, 2] - 0.5) * self.size[2]], axis=1)
        p = self.center + local @ self.turned.T
        R = np.empty((count, 3, 3))
        for k, orientation in enumerate(self.orientations):
            mine = slice(k, None, len(self.orientations))
            R[mine] = orientation.sample(u[mine, 3:])
        return self.T_base_frame @ se3.pose(R, p)

    def contains(self, T: Float[np.ndarray, "n 4 4"]) -> Bool[np.ndarray, " n"]:
        """Whether tool poses in the base lie in the shape, in one of the orientations; rounding forgiven."""
        local = se3.inverse(self.T_base_frame) @ T
        p = (local[:, :3, 3] - self.center) @ self.turned
        half = 0.5 * self.size * (1.0 + 1e-9)
        if self.shape == "box":
            inside = (np.abs(p) <= half).all(axis=1)
        else:
            inside = (np.hypot(p[:, 0], p[:, 1]) <= half[0]) & (np.abs(p[:, 2]) <= half[2])
        turned = np.zeros(len(T), dtype=bool)
        for o in self.orientations:
            relative = o.rotation.T @ local[:, :3, :3]
            tilt = np.arccos(np.clip(relative[:, 2, 2], -1.0, 1.0))
            # the turn that is left when z is brought back by the shortest way
            axis = np.stack([-relative[:, 1, 2], relative[:, 0, 2], np.zeros(len(T))], axis=1)
            length = np.maximum(np.linalg.norm(axis, axis=1), 1e-300)[:, None]
            back = se3.exp(-tilt[:, None] * axis / length) @ relative
            spin = np.abs(np.arctan2(back[:, 1, 0], back[:, 0, 0]))
            turned |= (tilt <= o.cone + 1e-6) & (spin <= o.spin + 1e-6)
        return inside & turned

    def middle(self) -> Float[np.ndarray, "orientations 4 4"]:
        """Poses of the tool at the centre, one for each orientation."""
        return self.T_base_frame @ np.stack([se3.pose(o.rotation, self.center) for o in self.orientations])
