"""Rotations as three angles, in the ways in which robots and ROS write them."""

from typing import Literal

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3

AngleForm = Literal["rpy", "abc", "wpr"]

ANGLES: dict[AngleForm, tuple[str, str, str]] = {
    "rpy": ("roll", "pitch", "yaw"),
    "abc": ("a", "b", "c"),
    "wpr": ("w", "p", "r"),
}
"""Roll, pitch and yaw about fixed x, y, z, as URDF has them; KUKA's A, B, C about z, then the turned y, then the turned x;
FANUC's W, P, R about fixed x, y, z. All three are Rz·Ry·Rx; KUKA writes the turn about z first."""


def from_angles(form: AngleForm, angles: Float[np.ndarray, "*b 3"]) -> Float[np.ndarray, "*b 3 3"]:
    """Rotations of angles in radians."""
    about_zyx = angles if form == "abc" else angles[..., ::-1]
    return se3.turns("zyx", about_zyx)


def to_angles(form: AngleForm, R: Float[np.ndarray, "*b 3 3"]) -> Float[np.ndarray, "*b 3"]:
    """Angles of rotations, radians; the one about y within ±90°, and where it is ±90°, none about x."""
    level = np.hypot(R[..., 0, 0], R[..., 1, 0]) < 1e-9
    z = np.where(level, np.arctan2(-R[..., 0, 1], R[..., 1, 1]), np.arctan2(R[..., 1, 0], R[..., 0, 0]))
    y = np.arctan2(-R[..., 2, 0], np.hypot(R[..., 0, 0], R[..., 1, 0]))
    x = np.where(level, 0.0, np.arctan2(R[..., 2, 1], R[..., 2, 2]))
    return np.stack([z, y, x] if form == "abc" else [x, y, z], axis=-1)
