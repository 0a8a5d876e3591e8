"""One damped Newton step of joint positions towards tool poses, many at once."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from taskcal.kernels.chain import Chain, Layout
from taskcal.kernels.compiled import compiled, part
from taskcal.kernels.walk import allocate_axes, expand_error_frames, fill_columns, walk_pose

RADIANS_PER_METRE = 2.0
"""Radians that a metre counts like: about what turns an arm's end by its own length."""

MAX_JOINT_STEP = 0.5
"""No joint moves farther in one step, radians or metres."""


@dataclass(frozen=True, eq=False)
class Goal:
    """Goal pose of the chain's end."""

    T: Float[np.ndarray, "n 4 4"]
    """Poses of the tip in the chain's start."""
    tip: Float[np.ndarray, "4 4"]
    """Pose of the tip in the chain's end."""
    free_spin: bool
    """Whether the tip may turn about its own z axis."""

    @property
    def rows(self) -> int:
        """Rows of the task Jacobian."""
        return 5 if self.free_spin else 6


@dataclass(frozen=True, eq=False)
class Step:
    """How far poses are off, and what to do about it."""

    off: Float[np.ndarray, "n 2"]
    """Distance and angle from the goal, metres and radians."""
    step: Float[np.ndarray, "n joints"]
    """Change of the joints that leads nearer to it, radians or metres."""


@part
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


@part
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


@part
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


class _Aim(NamedTuple):
    """The arrays of a `Goal`."""

    tip: Float[np.ndarray, "4 4"]
    T: Float[np.ndarray, "n 4 4"]
    free_spin: bool


class _Out(NamedTuple):
    """What a pass fills: the two parts of a `Step`, and the task's Jacobian, of the last pose alone where it has one."""

    off: Float[np.ndarray, "n 2"]
    step: Float[np.ndarray, "n joints"]
    jacobian: Float[np.ndarray, "m rows joints"]


@part
def _append(end, tip, T):
    """T = end·tip."""
    for a in range(3):
        for b in range(4):
            T[a, b] = end[a, 0] * tip[0, b] + end[a, 1] * tip[1, b] + end[a, 2] * tip[2, b]
        T[a, 3] += end[a, 3]


@part
def _set_off(T, target, free_spin, columns, y, w):
    """Set the error of T: translation and angles y, rotation vector w; the angular columns in the axes of the angles."""
    if free_spin:
        _tilt(T, target, w)
        for c in range(columns.shape[1]):
            u, v, z = columns[3, c], columns[4, c], columns[5, c]
            columns[3, c] = T[0, 0] * u + T[1, 0] * v + T[2, 0] * z
            columns[4, c] = T[0, 1] * u + T[1, 1] * v + T[2, 1] * z
        y[3] = T[0, 0] * w[0] + T[1, 0] * w[1] + T[2, 0] * w[2]
        y[4] = T[0, 1] * w[0] + T[1, 1] * w[1] + T[2, 1] * w[2]
    else:
        _turn(T, target, w)
        y[3], y[4], y[5] = w[0], w[1], w[2]
    for a in range(3):
        y[a] = target[a, 3] - T[a, 3]


@part
def _weigh(columns, by_joint, y, J):
    """The task's Jacobian J by the joints, its rows and those of y weighted."""
    for a in range(y.shape[0]):
        scale = RADIANS_PER_METRE if a < 3 else 1.0
        y[a] *= scale
        for b in range(J.shape[1]):
            v = 0.0
            for c in range(columns.shape[1]):
                v += columns[a, c] * by_joint[c, b]
            J[a, b] = scale * v


@part
def _damped_step(J, y, damping, A, step):
    """The step Jᵀ(JJᵀ + damping)⁻¹y, shortened where a joint would move too far."""
    rows, joints = J.shape
    for a in range(rows):
        for b in range(a + 1):
            v = damping if a == b else 0.0
            for c in range(joints):
                v += J[a, c] * J[b, c]
            A[a, b] = v
    _solve(A, y)
    far = 0.0
    for b in range(joints):
        v = 0.0
        for a in range(rows):
            v += J[a, b] * y[a]
        step[b] = v
        far = max(far, abs(v))
    if far > MAX_JOINT_STEP:
        for b in range(joints):
            step[b] *= MAX_JOINT_STEP / far


@compiled
def _steps(steps, s, e, by_joint, layout, goal, out):
    error_frames, axes = expand_error_frames(e), allocate_axes(s.shape[1], e.shape[0])
    ones, columns = np.ones(s.shape[1]), np.zeros((6, s.shape[1]))
    end, T, w = np.empty((3, 4)), np.empty((3, 4)), np.empty(3)
    rows = out.jacobian.shape[1]
    A, y = np.empty((rows, rows)), np.empty(rows)
    for i in range(s.shape[0]):
        walk_pose(steps, s[i], error_frames, axes, end)
        _append(end, goal.tip, T)
        fill_columns(axes, layout, ones, T[0, 3], T[1, 3], T[2, 3], columns)
        _set_off(T, goal.T[i], goal.free_spin, columns, y, w)
        distance = np.sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2])
        angle = np.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
        out.off[i, 0], out.off[i, 1] = distance, angle
        J = out.jacobian[i if out.jacobian.shape[0] > 1 else 0]
        _weigh(columns, by_joint[i if by_joint.shape[0] > 1 else 0], y, J)
        # damping fades with the error, so that the last steps are pure Newton; it tames singular poses (Wampler 1986)
        square = RADIANS_PER_METRE * RADIANS_PER_METRE * distance * distance + angle * angle
        _damped_step(J, y, 1e-3 * min(square, 4.0) + 4e-16, A, out.step[i])


def step_towards(
    goal: Goal,
    chain: Chain,
    s: Float[np.ndarray, "n coordinates"],
    e: Float[np.ndarray, "frames 6"],
    by_joint: Float[np.ndarray, "m coordinates joints"],
) -> Step:
    """Error of the tip, and the damped least-squares step of the joints towards it.

    Args:
        goal: where the tip shall be.
        chain: the chain.
        s: chain coordinates, radians or metres.
        e: values of the chain's error frames, metres and radians.
        by_joint: ∂s/∂q at every pose, or one for all.
    """
    step = Step(off=np.empty((len(s), 2)), step=np.empty((len(s), by_joint.shape[2])))
    _run(goal, chain, s, e, by_joint, step, np.empty((1, goal.rows, by_joint.shape[2])))
    return step


def task_jacobian(
    goal: Goal,
    chain: Chain,
    s: Float[np.ndarray, "n coordinates"],
    e: Float[np.ndarray, "frames 6"],
    by_joint: Float[np.ndarray, "m coordinates joints"],
) -> Float[np.ndarray, "n rows joints"]:
    """Derivative of what a pose asks of the tip with respect to the joints; arguments as of `step_towards`.

    Rows are the position's, times `RADIANS_PER_METRE`, and the angles about the axes of the chain's start; where the spin is free,
    the angles about the tip's own x and y axes.
    """
    J = np.empty((len(s), goal.rows, by_joint.shape[2]))
    _run(goal, chain, s, e, by_joint, Step(off=np.empty((len(s), 2)), step=np.empty((len(s), J.shape[2]))), J)
    return J


def _run(
    goal: Goal, chain: Chain, s: np.ndarray, e: np.ndarray, by_joint: np.ndarray, step: Step, J: np.ndarray
) -> None:
    aim, out = _Aim(goal.tip, goal.T, goal.free_spin), _Out(step.off, step.step, J)
    # no error frame has a column here; the array must be empty, for the chain may be one that has some
    layout = Layout(np.zeros((0, 6), np.int64), *chain.joint_columns.arrays[1:])
    _steps(chain.steps, s, e, by_joint, layout, aim, out)
