"""Rigid transforms as 4×4 arrays, rotations as 3×3 arrays; every function takes one or a batch of them."""

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation


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
    return Rotation.from_rotvec(w.reshape(-1, 3)).as_matrix().reshape(*w.shape, 3)


def log(R: Float[np.ndarray, "*b 3 3"]) -> Float[np.ndarray, "*b 3"]:
    """Rotation vector of a rotation, radians, of length at most π."""
    return Rotation.from_matrix(R.reshape(-1, 3, 3)).as_rotvec().reshape(R.shape[:-1])


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
    """Rotations of quaternions with the scalar last; they need not be of unit length."""
    return Rotation.from_quat(xyzw.reshape(-1, 4)).as_matrix().reshape(*xyzw.shape[:-1], 3, 3)


def to_quaternion(R: Float[np.ndarray, "*b 3 3"]) -> Float[np.ndarray, "*b 4"]:
    """Unit quaternions of rotations, scalar last and not negative."""
    q = Rotation.from_matrix(R.reshape(-1, 3, 3)).as_quat(canonical=True)
    return q.reshape(*R.shape[:-2], 4)


def error_transform(e: Float[np.ndarray, "*b 6"]) -> Float[np.ndarray, "*b 4 4"]:
    """T(tx, ty, tz)·Rx·Ry·Rz of six small defects, metres and radians."""
    R = Rotation.from_euler("XYZ", e[..., 3:].reshape(-1, 3)).as_matrix().reshape(*e.shape[:-1], 3, 3)
    return pose(R, e[..., :3])
