"""Cubes of a virtual cell, and where a probe touches them."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from taskcal.geometry import se3
from taskcal.measurement.observation.cube_size import CubeSize
from taskcal.measurement.observation.spots import spots

EDGE, TIP = 0.1, 2e-3
"""Edge of a cube, and radius of the ball that touches it, metres."""

STANDING = ("+x", "-x", "+y", "-y", "+z")
"""Faces that can be touched of a cube that stands."""

UNLEVEL = 0.1
"""Radians by which a cube stands askew at most."""

TOUCHED_SHARE = 0.9
"""Of the width of a face, that is touched."""


class StagedCubes(NamedTuple):
    """Cubes and touches."""

    sizes: tuple[CubeSize, ...]
    faces: tuple[str, ...]
    of: Int[np.ndarray, " n"]
    """Face of each row."""
    pose: Float[np.ndarray, "cubes 6"]
    """Middle and rotation vector of every cube."""
    goals: Float[np.ndarray, "n 3"]
    """Of the ball's centre, were the cubes made as they are stated."""


def stage_cubes(tool: Float[np.ndarray, "n 4 4"], places: int, rng: np.random.Generator) -> StagedCubes:
    """A nearly level cube at each of some places, touched on five faces one after another."""
    middle, rows = tool[spots(tool[:, :3, 3], places), :3, 3], np.arange(len(tool))
    count = len(middle)
    faces = tuple(f"{cube}/{face}" for cube in range(1, count + 1) for face in STANDING)
    sizes = tuple(CubeSize(name=str(cube), edge=EDGE, tip=TIP) for cube in range(1, count + 1))
    limit = np.array([UNLEVEL, UNLEVEL, np.pi])
    turned = rng.uniform(-limit, limit, (count, 3))
    of = rows % len(faces)
    sign, axis = np.array([1, -1, 1, -1, 1])[of % 5], np.array([0, 0, 1, 1, 2])[of % 5]
    inside = 0.5 * TOUCHED_SHARE * EDGE * rng.uniform(-1.0, 1.0, (len(tool), 3))
    inside[rows, axis] = sign * (0.5 * EDGE + TIP)
    goals = se3.apply(se3.pose(se3.exp(turned), middle)[of // 5], inside)
    return StagedCubes(sizes, faces, of, np.concatenate([middle, turned], axis=1), goals)
