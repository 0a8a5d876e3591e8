"""Clouds of points on a tool, as a tracker sees them from a frame that is known."""

import numpy as np
from scipy.spatial.transform import Rotation


def cloud(rng, n=40, count=2, noise=0.0):
    """Rotations and positions of a tool, the points measured, their targets, and the truth Z, t, offsets."""
    R = Rotation.random(n * count, random_state=rng).as_matrix()
    p, target = rng.normal(size=(n * count, 3)), np.repeat(np.arange(count), n)
    Z, t, offsets = Rotation.random(random_state=rng).as_matrix(), rng.normal(size=3), 0.2 * rng.normal(size=(count, 3))
    y = (p + np.einsum("nij,nj->ni", R, offsets[target])) @ Z.T + t + noise * rng.normal(size=p.shape)
    return R, p, y, target, (Z, t, offsets)
