"""A rigid transform as the elementary steps of a robot file."""

from typing import Any

import numpy as np
from jaxtyping import Float

NOTHING = 1e-15
"""Metres and radians that rounding leaves."""

DIGITS = 12
"""Of millimetres and degrees behind the point: a femtometre, and 2e-14 rad."""


def steps_of(T: Float[np.ndarray, "4 4"], number: str = "") -> list[dict[str, Any]]:
    """Elementary steps that make a transform: its translation, then rotations about z, y and x.

    The angles are taken one after another from what the one before has left (Givens), so that their product is the rotation
    to rounding even where z and x line up.

    Args:
        T: the transform, metres.
        number: what follows ``x``, ``y`` and ``z`` in the symbols of its lengths; none by default.
    """
    steps: list[dict[str, Any]] = []
    for axis, value in zip("xyz", T[:3, 3], strict=True):
        if abs(value) > NOTHING:
            symbol = {"symbol": f"{axis}{number}"} if number else {}
            steps.append({f"t{axis}_mm": round(float(value) * 1e3, DIGITS), **symbol})
    R = T[:3, :3]
    yaw = np.arctan2(R[1, 0], R[0, 0]) if np.hypot(R[0, 0], R[1, 0]) > 1e-9 else 0.0
    c, s = np.cos(yaw), np.sin(yaw)
    pitch = np.arctan2(-R[2, 0], c * R[0, 0] + s * R[1, 0])
    roll = np.arctan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    for axis, angle in (("z", yaw), ("y", pitch), ("x", roll)):
        if abs(angle) > NOTHING:
            steps.append({f"r{axis}_deg": round(float(np.degrees(angle)), DIGITS)})
    return steps
