"""The walk in plain NumPy, a chunk of poses at a time: what one would write without a compiler.

It shares the robot's description with Taskcal, but no computation. Arrays hold the poses along their last axis.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from taskcal.kernels.chain import ErrorFrame, Fixed, Joint, Step
from taskcal.robot.joint_side import FourBarDrive
from taskcal.robot.robot import Robot

CHUNK = 2048
"""Poses at a time: their sensitivities stay in the second-level cache."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PlainWalk:
    """Where a chunk of poses ends, and every axis and origin it passed."""

    R: np.ndarray
    """Rotation of the end (3, 3, n)."""
    p: np.ndarray
    """Position of the end (3, n)."""
    joints: list[tuple[np.ndarray, np.ndarray]]
    """Axis and origin of every joint."""
    frames: list[tuple[np.ndarray, np.ndarray, np.ndarray]]
    """Axes of translation (3, 3, n), axes of rotation and origin of every error frame; axes are columns."""


def chunks(n: int) -> Iterator[slice]:
    """Slices that cover n poses."""
    return (slice(i, min(i + CHUNK, n)) for i in range(0, n, CHUNK))


def joint_side(robot: Robot, q: np.ndarray, xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Chain coordinates (joints, n) and ∂s/∂ξ of the four-bar's three lengths (joints, 3, n)."""
    s = robot.joint_map.matrix @ q.T + robot.joint_map.offset[:, None]
    drive = robot.four_bar
    assert drive is not None
    turn, by_length = _close(drive, q @ drive.arm, q @ drive.crank, xi)
    return s + drive.output[:, None] * turn, drive.output[:, None, None] * by_length


def _close(drive: FourBarDrive, alpha: np.ndarray, kappa: np.ndarray, xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """θ − κ and its derivatives by crank, rod and rocker: the rod from crank to lever keeps its length."""
    bar = drive.bar
    L1, L2, L3 = bar.crank + xi[0], bar.rod + xi[1], bar.rocker + xi[2]
    arm, crank = np.exp(1j * alpha), np.exp(1j * (kappa + bar.crank_angle))
    w = bar.arm * arm - L1 * crank
    length = np.abs(w)
    inside = np.arccos((L2**2 - length**2 - L3**2) / (2.0 * L3 * length))
    lever = np.exp(1j * (np.angle(w) - bar.assembly * inside))
    rod = w + L3 * lever

    def along(direction: np.ndarray) -> np.ndarray:
        return (rod.conj() * direction).real

    slope = L3 * along(1j * lever)
    turn = np.angle(lever * np.exp(-1j * (kappa + bar.rocker_angle)))
    return turn, np.stack([along(crank), np.full_like(slope, L2), -along(lever)]) / slope


def walk(steps: list[Step], s: np.ndarray, e: np.ndarray) -> PlainWalk:
    """Walk a chunk of poses along the chain; s is (joints, n), e (frames, 6)."""
    n = s.shape[1]
    R = np.broadcast_to(np.eye(3)[:, :, None], (3, 3, n)).copy()
    p = np.zeros((3, n))
    joints: list[tuple[np.ndarray, np.ndarray]] = []
    frames: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for step in steps:
        match step:
            case Fixed(T):
                p, R = p + np.matmul(T[:3, 3], R), np.matmul(T[:3, :3].T, R)
            case Joint():
                angle = s[len(joints)]
                joints.append((R[:, 2], p))
                c, v = np.cos(angle), np.sin(angle)
                R = np.stack([c * R[:, 0] + v * R[:, 1], c * R[:, 1] - v * R[:, 0], R[:, 2]], axis=1)
            case ErrorFrame():
                E, axes = _error(e[len(frames)])
                p = p + np.matmul(E[:3, 3], R)
                frames.append((R, np.matmul(axes.T, R), p))
                R = np.matmul(E[:3, :3].T, R)
    return PlainWalk(R=R, p=p, joints=joints, frames=frames)


def _error(e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """T(tx, ty, tz)·Rx·Ry·Rz, and the axes of the three rotations as columns."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(e[3:]), np.sin(e[3:])
    Rx = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    Ry = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    Rz = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rx @ Ry @ Rz, e[:3]
    return T, np.stack([np.eye(3)[0], Rx[:, 1], (Rx @ Ry)[:, 2]], axis=1)


def poses(steps: list[Step], robot: Robot, q: np.ndarray, e: np.ndarray, xi: np.ndarray) -> np.ndarray:
    """Poses of the chain's end (n, 4, 4)."""
    out = np.zeros((len(q), 4, 4))
    for rows in chunks(len(q)):
        end = walk(steps, joint_side(robot, q[rows], xi)[0], e)
        out[rows, :3, :3], out[rows, :3, 3] = end.R.transpose(2, 0, 1), end.p.T
        out[rows, 3, 3] = 1.0
    return out


def sensitivities(
    steps: list[Step], robot: Robot, q: np.ndarray, e: np.ndarray, xi: np.ndarray, extra: int = 0
) -> Iterator[tuple[slice, PlainWalk, np.ndarray]]:
    """Chunks of ∂p (columns, 3, n): six of each error frame in order, three of the four-bar, `extra` empty ones."""
    for rows in chunks(len(q)):
        s, by_length = joint_side(robot, q[rows], xi)
        end = walk(steps, s, e)
        count = 6 * len(end.frames)
        J = np.zeros((count + 3 + extra, 3, s.shape[1]))
        for f, (along, about, origin) in enumerate(end.frames):
            arm = end.p - origin
            for c in range(3):
                J[6 * f + c] = along[:, c]
                J[6 * f + 3 + c] = _cross(about[:, c], arm)
        for (axis, origin), slopes in zip(end.joints, by_length, strict=True):
            if slopes.any():
                J[count : count + 3] += slopes[:, None] * _cross(axis, end.p - origin)
        yield rows, end, J


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    out = np.empty_like(b)
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
    return out
