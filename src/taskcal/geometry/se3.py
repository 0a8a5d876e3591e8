"""Rigid transforms: those of the library of programs, with what calibrating needs beside them, and transforms in files."""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from jaxtyping import Float

from taskcal.errors import TaskcalError
from taskcal.io.codec import LACKS, InFile
from taskcal.io.toml_file import Direction, Quaternion
from taskcal_groundwork.se3 import apply as apply
from taskcal_groundwork.se3 import exp as exp
from taskcal_groundwork.se3 import from_quaternion as from_quaternion
from taskcal_groundwork.se3 import inverse as inverse
from taskcal_groundwork.se3 import log as log
from taskcal_groundwork.se3 import pose as pose
from taskcal_groundwork.se3 import rotation as rotation
from taskcal_groundwork.se3 import to_quaternion as to_quaternion
from taskcal_groundwork.se3 import translation as translation


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
    nearest = U @ Vt
    mirrored = np.linalg.det(nearest) < 0.0
    if mirrored.any():
        nearest = nearest - 2.0 * mirrored[..., None, None] * U[..., :, 2:] @ Vt[..., 2:, :]
    return nearest


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


# Rigid transforms and directions in files.

RIGID_TOLERANCE = 1e-6
"""How far a transform's rotation may be from one; files keep sixteen digits."""


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


def placement(T: Float[np.ndarray, "4 4"]) -> dict[str, Any]:
    """A pose for people: position in millimetres, orientation as a quaternion ``qx qy qz qw``."""
    position = [round(float(value) * 1e3, 9) for value in T[:3, 3]]
    return {"position_mm": position, "quaternion": to_quaternion(T[None, :3, :3])[0].tolist()}


RIGID = InFile(read=rigid)
"""Of a field that holds transforms."""


@dataclass(frozen=True, eq=False, kw_only=True)
class StatedPose:
    """A pose as people write it."""

    position: Annotated[Float[np.ndarray, " 3"], InFile(unit="mm")]
    quaternion: Annotated[Quaternion, LACKS] = (0.0, 0.0, 0.0, 1.0)

    @classmethod
    def of(cls, T: Float[np.ndarray, "4 4"]) -> "StatedPose":
        """Of a transform."""
        qx, qy, qz, qw = to_quaternion(T[:3, :3]).tolist()
        return cls(position=T[:3, 3], quaternion=(qx, qy, qz, qw))

    def transform(self) -> Float[np.ndarray, "4 4"]:
        """The transform."""
        return pose(from_quaternion(np.array(self.quaternion)), self.position)


POSE = InFile(kind=StatedPose, write=StatedPose.of, read=lambda _, stated: stated.transform())
"""Of a transform that people write."""

DIRECTION = InFile(kind=Direction, write=np.ndarray.tolist, read=lambda _, way: np.array(way) / np.linalg.norm(way))
"""Of a direction of unit length, which people write in any."""
