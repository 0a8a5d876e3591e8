"""Rigid transforms as 4×4 arrays, rotations as 3×3 arrays; every function takes one or a batch of them.

SciPy's rotations would do as much, but their import takes longer than all else that refuses a wrong file.
"""

from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.errors import TaskcalError


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


def left_jacobian(w: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """Turn about fixed axes for a change of the rotation vector w: exp(w + d) = exp(J·d)·exp(w) for small d."""
    angle = float(np.linalg.norm(w))
    x, y, z = w
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if angle < 1e-4:
        return np.eye(3) + 0.5 * across + across @ across / 6.0
    first, second = (1.0 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    return np.eye(3) + first * across + second * across @ across


def nearest_rotation(M: Float[np.ndarray, "*b 3 3"]) -> Float[np.ndarray, "*b 3 3"]:
    """The proper rotation nearest to a matrix in the Frobenius norm (Umeyama 1991)."""
    U, _, Vt = np.linalg.svd(M)
    sign = np.linalg.det(U) * np.linalg.det(Vt)
    U = U.copy()
    U[..., :, 2] *= sign[..., None]
    return U @ Vt


def fit_points(a: Float[np.ndarray, "k 3"], b: Float[np.ndarray, "k 3"]) -> Float[np.ndarray, "4 4"]:
    """The rigid transform that carries points a nearest to points b (Kabsch 1976)."""
    R = nearest_rotation((b - b.mean(axis=0)).T @ (a - a.mean(axis=0)))
    return pose(R, b.mean(axis=0) - R @ a.mean(axis=0))


def carry(J: Float[np.ndarray, "n 6 k"], arm: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 6 k"]:
    """Twists, rows vx vy vz wx wy wz, of points that lie `arm` beside the ones they are given at: v + w × arm."""
    out = J.copy()
    out[:, :3] += np.cross(out[:, 3:], arm[:, :, None], axis=1)
    return out


def by_twist(points: Float[np.ndarray, "*b 3"]) -> Float[np.ndarray, "*b 3 6"]:
    """Derivative of points with respect to a twist v, w of the body at the origin: v + w × p."""
    out = np.zeros((*points.shape, 6))
    out[..., :3] = np.eye(3)
    out[..., 3:] = np.swapaxes(np.cross(np.eye(3), points[..., None, :]), -1, -2)
    return out


def from_quaternion(xyzw: Float[np.ndarray, "*b 4"]) -> Float[np.ndarray, "*b 3 3"]:
    """Rotations of quaternions with the scalar last; they need not be of unit length.

    Raises:
        ValueError: a quaternion of length zero.
    """
    length = np.linalg.norm(xyzw, axis=-1, keepdims=True)
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


def turns(axes: str, angles: Float[np.ndarray, "*b k"]) -> Float[np.ndarray, "*b 3 3"]:
    """Rotations put together from turns, each about an axis that those before it have turned.

    Args:
        axes: ``x``, ``y`` or ``z`` for each turn; the other way round they are turns about fixed axes.
        angles: radians.
    """
    R = np.broadcast_to(np.eye(3), (*angles.shape[:-1], 3, 3))
    cosine, sine = np.cos(angles), np.sin(angles)
    for k, axis in enumerate(axes):
        i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
        turned = R.copy()
        c, s = cosine[..., k, None], sine[..., k, None]
        turned[..., i] = c * R[..., i] + s * R[..., j]
        turned[..., j] = c * R[..., j] - s * R[..., i]
        R = turned
    return R


def error_transform(e: Float[np.ndarray, "*b 6"]) -> Float[np.ndarray, "*b 4 4"]:
    """T(tx, ty, tz)·Rx·Ry·Rz of six small defects, metres and radians."""
    return pose(turns("xyz", e[..., 3:]), e[..., :3])


def _of_unit(q: Float[np.ndarray, "*b 4"]) -> Float[np.ndarray, "*b 3 3"]:
    """Rotations of quaternions of unit length, scalar last."""
    x, y, z, w = np.moveaxis(q, -1, 0)
    R = np.empty((*q.shape[:-1], 3, 3))
    R[..., 0, 0] = 1.0 - 2.0 * (y * y + z * z)
    R[..., 1, 1] = 1.0 - 2.0 * (z * z + x * x)
    R[..., 2, 2] = 1.0 - 2.0 * (x * x + y * y)
    R[..., 1, 0], R[..., 0, 1] = 2.0 * (x * y + w * z), 2.0 * (x * y - w * z)
    R[..., 0, 2], R[..., 2, 0] = 2.0 * (x * z + w * y), 2.0 * (x * z - w * y)
    R[..., 2, 1], R[..., 1, 2] = 2.0 * (y * z + w * x), 2.0 * (y * z - w * x)
    return R


# Arrays and rigid transforms as files describe them: nested lists, checked.

RIGID_TOLERANCE = 1e-6
"""How far a transform's rotation may be from one; files keep sixteen digits."""


def array_of(key: str, values: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Nested lists of numbers as an array; NaN for null.

    Raises:
        TaskcalError: they have another shape, or none; the message names the key.
    """
    try:
        array = np.array(values, dtype=float)
    except ValueError as error:
        raise TaskcalError(f"the rows of '{key}' differ in length") from error
    if array.size == 0 and 0 in shape:  # nothing was estimated: JSON has no empty matrix
        array = np.zeros(shape)
    return of_shape(key, array, shape)


def of_shape(key: str, array: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """An array, where it has this shape.

    Raises:
        TaskcalError: it has another.
    """
    if array.shape != shape:
        raise TaskcalError(f"'{key}' has shape {array.shape}, not {shape}")
    return array


def rigid(key: str, T: Float[np.ndarray, "*n 4 4"]) -> Float[np.ndarray, "*n 4 4"]:
    """Transforms, where they neither scale, shear nor reflect.

    Raises:
        TaskcalError: one of them does.
    """
    for number, one in enumerate(T.reshape(-1, 4, 4), start=1):
        R = one[:3, :3]
        off = float(np.abs(R.T @ R - np.eye(3)).max())
        if off > RIGID_TOLERANCE or np.linalg.det(R) < 0.0 or (one[3] != (0.0, 0.0, 0.0, 1.0)).any():
            place = f"'{key}'" if T.ndim == 2 else f"'{key}' {number}"
            scale = float(np.linalg.norm(R) / np.sqrt(3.0))
            raise TaskcalError(
                f"{place} is not a rigid transform: its axes have length {scale:.6g} and are {off:.2g} off"
            )
    return T
