"""Rigid transforms as 4×4 arrays, rotations as 3×3 arrays; every function takes one or a batch of them.

SciPy's rotations would do as much, but their import takes longer than all else that refuses a wrong file.
"""

import math
from typing import Any

import numpy as np
from jaxtyping import Float


def translation(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Float[np.ndarray, "4 4"]:
    """Pure translation, metres."""
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def rotation(axis: str, angle: float) -> Float[np.ndarray, "4 4"]:
    """Pure rotation about the ``x``, ``y`` or ``z`` axis, radians; exact at multiples of 90°."""
    quarter = angle / (np.pi / 2)
    if abs(quarter - round(quarter)) < 1e-12:  # cos(π/2) is 6e-17 in floating point; a right angle is exact here
        c, s = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[round(quarter) % 4]
    else:
        c, s = np.cos(angle), np.sin(angle)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    T = np.eye(4)
    T[i, i] = T[j, j] = c
    T[i, j], T[j, i] = -s, s
    return T


def pose(R: Float[np.ndarray, "*b 3 3"], p: Float[np.ndarray, "*b 3"]) -> Float[np.ndarray, "*b 4 4"]:
    """Homogeneous transform of a rotation and a position."""
    T = np.zeros((*np.broadcast_shapes(R.shape[:-2], p.shape[:-1]), 4, 4))
    T[..., :3, :3] = R
    T[..., :3, 3] = p
    T[..., 3, 3] = 1.0
    return T


def inverse(T: Float[np.ndarray, "*b 4 4"]) -> Float[np.ndarray, "*b 4 4"]:
    """Inverse of a rigid transform."""
    Rt = np.swapaxes(T[..., :3, :3], -1, -2)
    return pose(Rt, -(Rt @ T[..., :3, 3:])[..., 0])


MAX_SKEW = 1e-6
"""Of a rotation's columns from unit length and right angles; numbers with seven digits have less."""


def is_pose(T: object) -> bool:
    """Whether something is a pose: a rotation of right-handed axes, and a position."""
    if not isinstance(T, np.ndarray) or T.shape != (4, 4) or not np.isfinite(T).all():
        return False
    R = T[:3, :3]
    return bool(
        np.abs(R.T @ R - np.eye(3)).max() < MAX_SKEW and np.linalg.det(R) > 0.0 and (T[3] == [0, 0, 0, 1]).all()
    )


def apply(T: Float[np.ndarray, "*b 4 4"], points: Float[np.ndarray, "*c 3"]) -> Float[np.ndarray, "*d 3"]:
    """Points seen from the frame on the transform's left."""
    return (T[..., :3, :3] @ points[..., None])[..., 0] + T[..., :3, 3]


def exp(w: Float[np.ndarray, "*b 3"]) -> Float[np.ndarray, "*b 3 3"]:
    """Rotation of a rotation vector, radians."""
    angle = np.linalg.norm(w, axis=-1, keepdims=True)
    scale = 0.5 * np.sinc(angle / (2.0 * np.pi))  # sin(angle/2)/angle
    return _of_unit(np.concatenate([scale * w, np.cos(0.5 * angle)], axis=-1))


def log(R: Float[np.ndarray, "*b 3 3"]) -> Float[np.ndarray, "*b 3"]:
    """Rotation vector of a rotation, radians, of length at most π."""
    q = to_quaternion(R)
    half_sine = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    half = np.arctan2(half_sine, q[..., 3:])
    return q[..., :3] * (2.0 / np.sinc(half / np.pi))  # angle/sin(angle/2)


def from_quaternion(xyzw: Float[np.ndarray, "*b 4"]) -> Float[np.ndarray, "*b 3 3"]:
    """Rotations of quaternions with the scalar last; they need not be of unit length.

    Raises:
        ValueError: a quaternion of length zero.
    """
    length = np.sqrt(
        np.add.reduce(xyzw * xyzw, axis=-1, keepdims=True)
    )  # norm(), which takes longer for one than the sum
    if not length.all():
        raise ValueError("a quaternion of length zero is not a rotation")
    return _of_unit(xyzw / length)


def to_quaternion(R: Float[np.ndarray, "*b 3 3"]) -> Float[np.ndarray, "*b 4"]:
    """Unit quaternions of rotations, scalar last and not negative (Shepperd 1978)."""
    # four times the products of q's elements; the row of the largest square loses no digits
    products = np.empty((*R.shape[:-2], 4, 4))
    products[..., :3, :3] = R + np.swapaxes(R, -1, -2)
    trace = np.trace(R, axis1=-2, axis2=-1)
    for k, (i, j) in enumerate(((2, 1), (0, 2), (1, 0))):
        products[..., k, k] += 1.0 - trace
        products[..., 3, k] = products[..., k, 3] = R[..., i, j] - R[..., j, i]
    products[..., 3, 3] = 1.0 + trace
    largest = np.argmax(np.diagonal(products, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(q[..., 3:] < 0.0, -q, q)


def _of_unit(q: Float[np.ndarray, "*b 4"]) -> Float[np.ndarray, "*b 3 3"]:
    """Rotations of quaternions of unit length, scalar last."""
    R = np.empty((*q.shape[:-1], 3, 3))
    for i, row in enumerate(_rows(*(q[..., k] for k in range(4)))):
        for j, element in enumerate(row):
            R[..., i, j] = element
    return R


def _rows(x: Any, y: Any, z: Any, w: Any) -> tuple[tuple[Any, ...], ...]:
    """The elements of the same, of numbers or of arrays."""
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (z * z + x * x), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


def pose_of(xyz: tuple[float, float, float], xyzw: tuple[float, float, float, float]) -> Float[np.ndarray, "4 4"]:
    """One pose of numbers, in a tenth of the time of `pose` and `from_quaternion`.

    Args:
        xyz: position, metres.
        xyzw: quaternion with the scalar last; need not be of unit length, but of more than zero.
    """
    x, y, z, w = xyzw
    length = math.sqrt(x * x + y * y + z * z + w * w)
    rows = _rows(x / length, y / length, z / length, w / length)
    return np.array([*((*row, p) for row, p in zip(rows, xyz, strict=True)), (0.0, 0.0, 0.0, 1.0)])
