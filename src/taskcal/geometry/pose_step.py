"""One damped Newton step of joint positions towards tool poses, many at once."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.geometry.chain import Chain
from taskcal.geometry.compiled import compiled, inlined
from taskcal.geometry.walk import Columns, expand_error_frames, fill_columns, walk_pose

WEIGHT = 2.0
"""Radians that a metre counts like: about what turns an arm's end by its own length."""

LARGEST = 0.5
"""No joint moves farther in one step, radians or metres."""


@dataclass(frozen=True, eq=False)
class Goal:
    """Where the tip of a chain shall be."""

    T: Float[np.ndarray, "n 4 4"]
    """Poses of the tip in the chain's start."""
    tip: Float[np.ndarray, "4 4"]
    """Pose of the tip in the chain's end."""
    free_spin: bool
    """Whether the tip may turn about its own z axis."""

    @property
    def rows(self) -> int:
        """How many conditions a pose sets."""
        return 5 if self.free_spin else 6


@dataclass(frozen=True, eq=False)
class Step:
    """How far poses are off, and what to do about it."""

    off: Float[np.ndarray, "n 2"]
    """Distance and angle from the goal, metres and radians."""
    step: Float[np.ndarray, "n joints"]
    """Change of the joints that leads nearer to it, radians or metres."""


@inlined
def _turn(T, target, w):
    """Rotation vector from T to the target, by way of the quaternion, so that it holds up to half a turn."""
    m00 = target[0, 0] * T[0, 0] + target[0, 1] * T[0, 1] + target[0, 2] * T[0, 2]
    m11 = target[1, 0] * T[1, 0] + target[1, 1] * T[1, 1] + target[1, 2] * T[1, 2]
    m22 = target[2, 0] * T[2, 0] + target[2, 1] * T[2, 1] + target[2, 2] * T[2, 2]
    m01 = target[0, 0] * T[1, 0] + target[0, 1] * T[1, 1] + target[0, 2] * T[1, 2]
    m02 = target[0, 0] * T[2, 0] + target[0, 1] * T[2, 1] + target[0, 2] * T[2, 2]
    m12 = target[1, 0] * T[2, 0] + target[1, 1] * T[2, 1] + target[1, 2] * T[2, 2]
    m10 = target[1, 0] * T[0, 0] + target[1, 1] * T[0, 1] + target[1, 2] * T[0, 2]
    m20 = target[2, 0] * T[0, 0] + target[2, 1] * T[0, 1] + target[2, 2] * T[0, 2]
    m21 = target[2, 0] * T[1, 0] + target[2, 1] * T[1, 1] + target[2, 2] * T[1, 2]
    # the largest component of the quaternion is the one to divide by (Shepperd 1978)
    trace = m00 + m11 + m22
    if trace >= max(m00, m11, m22):
        a, b, c, d = m21 - m12, m02 - m20, m10 - m01, 1.0 + trace
    elif m00 >= m11 and m00 >= m22:
        a, b, c, d = 1.0 + m00 - m11 - m22, m01 + m10, m02 + m20, m21 - m12
    elif m11 >= m22:
        a, b, c, d = m01 + m10, 1.0 + m11 - m00 - m22, m12 + m21, m02 - m20
    else:
        a, b, c, d = m02 + m20, m12 + m21, 1.0 + m22 - m00 - m11, m10 - m01
    if d < 0.0:
        a, b, c, d = -a, -b, -c, -d
    sine = np.sqrt(a * a + b * b + c * c)
    angle = 2.0 * np.arctan2(sine, d)
    scale = 2.0 / d if sine < 1e-12 * d else angle / sine
    w[0], w[1], w[2] = scale * a, scale * b, scale * c


@inlined
def _tilt(T, target, w):
    """Rotation vector that takes the z axis of T to the target's the short way."""
    a = T[1, 2] * target[2, 2] - T[2, 2] * target[1, 2]
    b = T[2, 2] * target[0, 2] - T[0, 2] * target[2, 2]
    c = T[0, 2] * target[1, 2] - T[1, 2] * target[0, 2]
    sine = np.sqrt(a * a + b * b + c * c)
    cosine = T[0, 2] * target[0, 2] + T[1, 2] * target[1, 2] + T[2, 2] * target[2, 2]
    if sine > 1e-12:
        scale = np.arctan2(sine, cosine) / sine
        w[0], w[1], w[2] = scale * a, scale * b, scale * c
    elif cosine > 0.0:
        w[0], w[1], w[2] = a, b, c
    else:  # opposite: any way round is as short
        w[0], w[1], w[2] = np.pi * T[0, 0], np.pi * T[1, 0], np.pi * T[2, 0]


@inlined
def _solve(A, y):
    """Replace y by A⁻¹y, A symmetric and positive but for rounding: Cholesky's L over its lower half."""
    m = y.shape[0]
    for j in range(m):
        v = A[j, j]
        least = 1e-15 * v
        for k in range(j):
            v -= A[j, k] * A[j, k]
        A[j, j] = np.sqrt(max(v, least, 1e-300))
        for i in range(j + 1, m):
            v = A[i, j]
            for k in range(j):
                v -= A[i, k] * A[j, k]
            A[i, j] = v / A[j, j]
    for i in range(m):
        for k in range(i):
            y[i] -= A[i, k] * y[k]
        y[i] /= A[i, i]
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            y[i] -= A[k, i] * y[k]
        y[i] /= A[i, i]


@compiled
def _steps(kind, index, fixed, s, e, by_joint, joint, tip, target, free_spin, weight, largest, off, step, J):
    e_rotation, e_axes, nil = expand_error_frames(e)
    coordinates, joints, rows = s.shape[1], by_joint.shape[2], J.shape[1]
    joint_axes, frame_axes = np.zeros((coordinates, 3, 3)), np.zeros((e.shape[0], 7, 3))
    frames, ones, columns = np.zeros((0, 6), np.int64), np.ones(coordinates), np.zeros((6, coordinates))
    end, T, w = np.empty((3, 4)), np.empty((3, 4)), np.empty(3)
    A, y = np.empty((rows, rows)), np.empty(rows)
    for i in range(s.shape[0]):
        walk_pose(kind, index, fixed, s[i], e, e_rotation, e_axes, nil, joint_axes, frame_axes, end)
        for a in range(3):
            for b in range(4):
                T[a, b] = end[a, 0] * tip[0, b] + end[a, 1] * tip[1, b] + end[a, 2] * tip[2, b]
            T[a, 3] += end[a, 3]
        fill_columns(joint_axes, frame_axes, frames, joint, joint, ones, T[0, 3], T[1, 3], T[2, 3], columns)
        if free_spin:
            _tilt(T, target[i], w)
            for c in range(coordinates):
                u, v, z = columns[3, c], columns[4, c], columns[5, c]
                columns[3, c] = T[0, 0] * u + T[1, 0] * v + T[2, 0] * z
                columns[4, c] = T[0, 1] * u + T[1, 1] * v + T[2, 1] * z
            y[3] = T[0, 0] * w[0] + T[1, 0] * w[1] + T[2, 0] * w[2]
            y[4] = T[0, 1] * w[0] + T[1, 1] * w[1] + T[2, 1] * w[2]
        else:
            _turn(T, target[i], w)
            y[3], y[4], y[5] = w[0], w[1], w[2]
        for a in range(3):
            y[a] = target[i, a, 3] - T[a, 3]
        off[i, 0] = np.sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2])
        off[i, 1] = np.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
        B, D = by_joint[i if by_joint.shape[0] > 1 else 0], J[i if J.shape[0] > 1 else 0]
        for a in range(rows):
            scale = weight if a < 3 else 1.0
            y[a] *= scale
            for b in range(joints):
                v = 0.0
                for c in range(coordinates):
                    v += columns[a, c] * B[c, b]
                D[a, b] = scale * v
        # damping fades with the error, so that the last steps are pure Newton; it tames singular poses (Wampler 1986)
        square = weight * weight * off[i, 0] * off[i, 0] + off[i, 1] * off[i, 1]
        damping = 1e-3 * min(square, 4.0) + 4e-16
        for a in range(rows):
            for b in range(a + 1):
                v = damping if a == b else 0.0
                for c in range(joints):
                    v += D[a, c] * D[b, c]
                A[a, b] = v
        _solve(A, y)
        far = 0.0
        for b in range(joints):
            v = 0.0
            for a in range(rows):
                v += D[a, b] * y[a]
            step[i, b] = v
            far = max(far, abs(v))
        if far > largest:
            for b in range(joints):
                step[i, b] *= largest / far


def step_towards(
    goal: Goal,
    chain: Chain,
    s: Float[np.ndarray, "n coordinates"],
    e: Float[np.ndarray, "frames 6"],
    by_joint: Float[np.ndarray, "m coordinates joints"],
) -> Step:
    """How far the tip is from its goal, and the damped least-squares step of the joints towards it.

    Args:
        goal: where the tip shall be.
        chain: the chain.
        s: chain coordinates, radians or metres.
        e: values of the chain's error frames, metres and radians.
        by_joint: ∂s/∂q at every pose, or one for all.
    """
    made = Step(off=np.empty((len(s), 2)), step=np.empty((len(s), by_joint.shape[2])))
    _run(goal, chain, s, e, by_joint, made, np.empty((1, goal.rows, by_joint.shape[2])))
    return made


def conditions(
    goal: Goal,
    chain: Chain,
    s: Float[np.ndarray, "n coordinates"],
    e: Float[np.ndarray, "frames 6"],
    by_joint: Float[np.ndarray, "m coordinates joints"],
) -> Float[np.ndarray, "n rows joints"]:
    """Derivative of what a pose asks of the tip with respect to the joints; arguments as of `step_towards`.

    Rows are the position's, times `WEIGHT`, and the angles about the axes of the chain's start; where the spin is free,
    the angles about the tip's own x and y axes.
    """
    J = np.empty((len(s), goal.rows, by_joint.shape[2]))
    _run(goal, chain, s, e, by_joint, Step(off=np.empty((len(s), 2)), step=np.empty((len(s), J.shape[2]))), J)
    return J


def _run(goal, chain, s, e, by_joint, made, J):
    arguments: tuple[Any, ...] = (
        chain.kind, chain.index, chain.fixed, s, e, by_joint, Columns.of_joints(chain).joint, goal.tip, goal.T,
        goal.free_spin, WEIGHT, LARGEST, made.off, made.step, J,
    )  # fmt: skip
    _steps(*arguments)
