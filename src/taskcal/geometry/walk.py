"""The compiled walk along a chain: poses, and the twist of the tool for every parameter, in one scalar pass a pose.

At each joint and error frame the walk notes the axes and origins about which, or along which, the rest of the chain
moves. A translation along a moves the tool point p by a, a rotation about a through o by a × (p − o); a joint-side
parameter moves joints, so its column is a combination of theirs.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import ClosureError
from taskcal.geometry.chain import ERROR_FRAME, FIXED, REVOLUTE, Chain
from taskcal.geometry.compiled import compiled, inlined, part

CHUNK = 8192
"""Poses a thread takes at a time; fewer are walked in the calling thread."""


class Layout(NamedTuple):
    """The arrays of `Columns` as the compiled passes take them."""

    frames: Int[np.ndarray, "frames 6"]
    joint: Int[np.ndarray, " pairs"]
    column: Int[np.ndarray, " pairs"]


@dataclass(frozen=True, eq=False)
class Columns:
    """Which column of the Jacobian each movement of the chain belongs to."""

    frames: Int[np.ndarray, "frames 6"]
    """Column of each error-frame parameter, −1 where it is not asked for."""
    joint: Int[np.ndarray, " pairs"]
    """Joint moved by the k-th joint-side pair …"""
    column: Int[np.ndarray, " pairs"]
    """… and the column it adds to; the factor ∂s/∂ξ comes with each pose."""
    count: int
    """Number of columns."""

    @cached_property
    def arrays(self) -> Layout:
        """For the compiled passes."""
        return Layout(self.frames, self.joint, self.column)

    @classmethod
    def of_joints(cls, chain: Chain) -> "Columns":
        """One column for each joint of the chain, none for error frames."""
        joints = np.arange(chain.joints)
        return cls(frames=np.full((chain.frames, 6), -1), joint=joints, column=joints, count=chain.joints)


class ErrorFrames(NamedTuple):
    """The error frames of a walk, which are the same at every pose."""

    value: Float[np.ndarray, "frames 6"]
    """Translations and angles, metres and radians."""
    rotation: Float[np.ndarray, "frames 3 3"]
    axes: Float[np.ndarray, "frames 3 3"]
    """Axes of the three rotations, in columns."""
    is_zero: Bool[np.ndarray, " frames"]
    """Whether all six values are exactly zero."""


class Axes(NamedTuple):
    """About which, or along which, the rest of the chain moves at one pose; a walk fills them in."""

    joints: Float[np.ndarray, "joints 3 3"]
    """1 in the first number of a revolute joint and 0 of a prismatic one; its axis; its origin."""
    frames: Float[np.ndarray, "frames 7 3"]
    """Three axes of translation and three of rotation of each error frame; its origin."""


@part
def expand_error_frames(e):
    """Everything about the error frames that does not depend on the pose."""
    rotation = np.empty((e.shape[0], 3, 3))
    axes = np.empty((e.shape[0], 3, 3))
    is_zero = np.empty(e.shape[0], dtype=np.bool_)
    for f in range(e.shape[0]):
        cx, sx = np.cos(e[f, 3]), np.sin(e[f, 3])
        cy, sy = np.cos(e[f, 4]), np.sin(e[f, 4])
        cz, sz = np.cos(e[f, 5]), np.sin(e[f, 5])
        axes[f, 0, 0], axes[f, 0, 1], axes[f, 0, 2] = 1.0, 0.0, sy
        axes[f, 1, 0], axes[f, 1, 1], axes[f, 1, 2] = 0.0, cx, -sx * cy
        axes[f, 2, 0], axes[f, 2, 1], axes[f, 2, 2] = 0.0, sx, cx * cy
        R = rotation[f]
        R[0, 0], R[0, 1], R[0, 2] = cy * cz, -cy * sz, sy
        R[1, 0], R[1, 1], R[1, 2] = cx * sz + sx * sy * cz, cx * cz - sx * sy * sz, -sx * cy
        R[2, 0], R[2, 1], R[2, 2] = sx * sz - cx * sy * cz, sx * cz + cx * sy * sz, cx * cy
        is_zero[f] = True
        for c in range(6):
            is_zero[f] = is_zero[f] and e[f, c] == 0.0
    return ErrorFrames(e, rotation, axes, is_zero)


@part
def allocate_axes(joints, frames):
    """Room for the axes of one pose."""
    return Axes(np.zeros((joints, 3, 3)), np.zeros((frames, 7, 3)))


@inlined
def _row_product(a, b, g, M):
    """The row (a, b, g) times the rotation in M."""
    return (
        a * M[0, 0] + b * M[1, 0] + g * M[2, 0],
        a * M[0, 1] + b * M[1, 1] + g * M[2, 1],
        a * M[0, 2] + b * M[1, 2] + g * M[2, 2],
    )


@part
def walk_pose(steps, s, error_frames, axes, T):
    """Walk one pose: fill the axes and origins of joints and error frames, and the pose T (3, 4) of the end."""
    kind, index, fixed = steps.kind, steps.which, steps.fixed
    e, e_rotation, e_axes, is_zero = error_frames.value, error_frames.rotation, error_frames.axes, error_frames.is_zero
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0
    x, y, z = 0.0, 0.0, 0.0
    for k in range(kind.shape[0]):
        what, i = kind[k], index[k]
        if what in (FIXED, ERROR_FRAME):
            if what == FIXED:
                tx, ty, tz = fixed[i, 0, 3], fixed[i, 1, 3], fixed[i, 2, 3]
            else:
                tx, ty, tz = e[i, 0], e[i, 1], e[i, 2]
            x += r00 * tx + r01 * ty + r02 * tz
            y += r10 * tx + r11 * ty + r12 * tz
            z += r20 * tx + r21 * ty + r22 * tz
            if what == ERROR_FRAME:
                frame = axes.frames[i]
                frame[0, 0], frame[0, 1], frame[0, 2] = r00, r10, r20
                frame[1, 0], frame[1, 1], frame[1, 2] = r01, r11, r21
                frame[2, 0], frame[2, 1], frame[2, 2] = r02, r12, r22
                frame[6, 0], frame[6, 1], frame[6, 2] = x, y, z
                if is_zero[i]:
                    for c in range(3):
                        for d in range(3):
                            frame[3 + c, d] = frame[c, d]
                    continue
                for c in range(3):
                    a, b, g = e_axes[i, 0, c], e_axes[i, 1, c], e_axes[i, 2, c]
                    frame[3 + c, 0] = r00 * a + r01 * b + r02 * g
                    frame[3 + c, 1] = r10 * a + r11 * b + r12 * g
                    frame[3 + c, 2] = r20 * a + r21 * b + r22 * g
                M = e_rotation[i]
            else:
                M = fixed[i]
            r00, r01, r02 = _row_product(r00, r01, r02, M)
            r10, r11, r12 = _row_product(r10, r11, r12, M)
            r20, r21, r22 = _row_product(r20, r21, r22, M)
        else:
            joint = axes.joints[i]
            joint[1, 0], joint[1, 1], joint[1, 2] = r02, r12, r22
            joint[2, 0], joint[2, 1], joint[2, 2] = x, y, z
            if what == REVOLUTE:
                joint[0, 0] = 1.0
                c, v = np.cos(s[i]), np.sin(s[i])
                r00, r01 = c * r00 + v * r01, c * r01 - v * r00
                r10, r11 = c * r10 + v * r11, c * r11 - v * r10
                r20, r21 = c * r20 + v * r21, c * r21 - v * r20
            else:
                joint[0, 0] = 0.0
                x += s[i] * r02
                y += s[i] * r12
                z += s[i] * r22
    T[0, 0], T[0, 1], T[0, 2], T[0, 3] = r00, r01, r02, x
    T[1, 0], T[1, 1], T[1, 2], T[1, 3] = r10, r11, r12, y
    T[2, 0], T[2, 1], T[2, 2], T[2, 3] = r20, r21, r22, z


@part
def fill_columns(axes, layout, factor, x, y, z, out):
    """Columns of the point (x, y, z): rows vx vy vz, and wx wy wz where `out` has six rows."""
    frames, joint, column = layout.frames, layout.joint, layout.column
    angular = out.shape[0] == 6
    for f in range(frames.shape[0]):
        frame = axes.frames[f]
        dx, dy, dz = x - frame[6, 0], y - frame[6, 1], z - frame[6, 2]
        for c in range(6):
            k = frames[f, c]
            if k < 0:
                continue
            a, b, g = frame[c, 0], frame[c, 1], frame[c, 2]
            if c < 3:
                out[0, k], out[1, k], out[2, k] = a, b, g
                if angular:
                    out[3, k], out[4, k], out[5, k] = 0.0, 0.0, 0.0
            else:
                out[0, k], out[1, k], out[2, k] = b * dz - g * dy, g * dx - a * dz, a * dy - b * dx
                if angular:
                    out[3, k], out[4, k], out[5, k] = a, b, g
    for i in range(joint.shape[0]):
        for row in range(out.shape[0]):
            out[row, column[i]] = 0.0
    for i in range(joint.shape[0]):
        moved, k, t = axes.joints[joint[i]], column[i], factor[i]
        a, b, g = t * moved[1, 0], t * moved[1, 1], t * moved[1, 2]
        if moved[0, 0] == 0.0:
            out[0, k] += a
            out[1, k] += b
            out[2, k] += g
        else:
            dx, dy, dz = x - moved[2, 0], y - moved[2, 1], z - moved[2, 2]
            out[0, k] += b * dz - g * dy
            out[1, k] += g * dx - a * dz
            out[2, k] += a * dy - b * dx
            if angular:
                out[3, k] += a
                out[4, k] += b
                out[5, k] += g


@compiled
def _poses(steps, s, e, out):
    error_frames, axes = expand_error_frames(e), allocate_axes(s.shape[1], e.shape[0])
    for i in range(s.shape[0]):
        walk_pose(steps, s[i], error_frames, axes, out[i])
        out[i, 3, 0], out[i, 3, 1], out[i, 3, 2], out[i, 3, 3] = 0.0, 0.0, 0.0, 1.0


@compiled
def _columns(steps, s, e, factor, layout, point, out):
    error_frames, axes = expand_error_frames(e), allocate_axes(s.shape[1], e.shape[0])
    T = np.empty((3, 4))
    a, b, c = point
    for i in range(s.shape[0]):
        walk_pose(steps, s[i], error_frames, axes, T)
        x = T[0, 3] + T[0, 0] * a + T[0, 1] * b + T[0, 2] * c
        y = T[1, 3] + T[1, 0] * a + T[1, 1] * b + T[1, 2] * c
        z = T[2, 3] + T[2, 0] * a + T[2, 1] * b + T[2, 2] * c
        fill_columns(axes, layout, factor[i], x, y, z, out[i])


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(os.cpu_count(), thread_name_prefix="taskcal-walk")


def in_chunks(walk_rows: Callable[[slice], Any], n: int, size: int = CHUNK) -> list[Any]:
    """Call `walk_rows` with slices that cover n poses, so many each, on a thread pool where there are several; results in order.

    Raises:
        ClosureError: as `walk_rows` does, its pose counted among all n.
    """

    def count(rows: slice) -> Any:
        try:
            return walk_rows(rows)
        except ClosureError as error:
            raise error.counted_from(rows.start) from None

    if n <= size:
        return [count(slice(0, n))]
    return list(_pool().map(count, [slice(i, min(i + size, n)) for i in range(0, n, size)]))


def poses(
    chain: Chain,
    s: Float[np.ndarray, "n joints"],
    e: Float[np.ndarray, "frames 6"],
    out: Float[np.ndarray, "n 4 4"] | None = None,
) -> Float[np.ndarray, "n 4 4"]:
    """Poses of the chain's end in its start.

    Args:
        chain: the chain.
        s: chain coordinates, radians or metres.
        e: values of the error frames, metres and radians.
        out: where to write them.
    """
    T = np.empty((len(s), 4, 4)) if out is None else out
    in_chunks(lambda rows: _poses(chain.steps, s[rows], e, T[rows]), len(s))
    return T


def allocate(layout: Columns, n: int, *, angular: bool) -> Float[np.ndarray, "n rows p"]:
    """Room for the columns of n poses; cleared only where the walk would not fill it."""
    full = np.count_nonzero(layout.frames >= 0) + len(np.unique(layout.column)) == layout.count
    return (np.empty if full else np.zeros)((n, 6 if angular else 3, layout.count))


def columns(
    chain: Chain,
    s: Float[np.ndarray, "n joints"],
    e: Float[np.ndarray, "frames 6"],
    layout: Columns,
    factor: Float[np.ndarray, "n pairs"],
    *,
    angular: bool,
    point: Float[np.ndarray, "3"] | None = None,
    out: Float[np.ndarray, "n rows p"] | None = None,
) -> Float[np.ndarray, "n rows p"]:
    """Derivative of a point fixed to the chain's end, in the axes of its start.

    Args:
        chain: the chain.
        s: chain coordinates, radians or metres.
        e: values of the error frames, metres and radians.
        layout: which column each parameter has.
        factor: ∂s/∂ξ of each joint-side pair of the layout, at every pose.
        angular: six rows vx vy vz wx wy wz, else the first three.
        point: the point in the end's frame, metres; its origin by default.
        out: where to write them, from `allocate`.
    """
    point = np.zeros(3) if point is None else point
    J = allocate(layout, len(s), angular=angular) if out is None else out

    def fill(rows: slice) -> None:
        _columns(chain.steps, s[rows], e, factor[rows], layout.arrays, point, J[rows])

    in_chunks(fill, len(s))
    return J
