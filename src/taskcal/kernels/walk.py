"""The compiled walk along a chain: poses, and the twist of the tool for every parameter, in one scalar pass a pose.

At each joint and error frame the walk notes the axes and origins about which, or along which, the rest of the chain
moves. A translation along a moves the tool point p by a, a rotation about a through o by a × (p − o); a joint-side
parameter moves joints, so its column is a combination of theirs.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from taskcal.kernels.chain import ERROR_FRAME, FIXED, REVOLUTE, Chain, Columns
from taskcal.kernels.chunks import in_chunks
from taskcal.kernels.compiled import compiled, part
from taskcal.kernels.lanes import LANES, allocate_lanes, as_lanes, cosine_and_sine, unravel


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

    joints: Float[np.ndarray, "joints 2 3"]
    """Axis and origin of each joint."""
    frames: Float[np.ndarray, "frames 7 3"]
    """Three axes of translation and three of rotation of each error frame; its origin."""
    slides: Bool[np.ndarray, " joints"]
    """Whether a joint is prismatic."""


@part
def take_lanes(rows, first, out):
    """Copy some rows of an array to the lanes of a buffer, its last row to the lanes beyond it."""
    for lane in range(LANES):
        row = min(first + lane, rows.shape[0] - 1)
        for k in range(rows.shape[1]):
            out[k, lane] = rows[row, k]


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
    """Axes to be filled in, those of one pose."""
    return Axes(np.zeros((joints, 2, 3)), np.zeros((frames, 7, 3)), np.zeros(joints, dtype=np.bool_))


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
                    u, v, w = e_axes[i, 0, c], e_axes[i, 1, c], e_axes[i, 2, c]
                    frame[3 + c, 0] = r00 * u + r01 * v + r02 * w
                    frame[3 + c, 1] = r10 * u + r11 * v + r12 * w
                    frame[3 + c, 2] = r20 * u + r21 * v + r22 * w
                M = e_rotation[i]
            else:
                M = fixed[i]
            m00, m01, m02, m10, m11, m12 = M[0, 0], M[0, 1], M[0, 2], M[1, 0], M[1, 1], M[1, 2]
            m20, m21, m22 = M[2, 0], M[2, 1], M[2, 2]
            a, b, g = r00, r01, r02
            r00, r01, r02 = a * m00 + b * m10 + g * m20, a * m01 + b * m11 + g * m21, a * m02 + b * m12 + g * m22
            a, b, g = r10, r11, r12
            r10, r11, r12 = a * m00 + b * m10 + g * m20, a * m01 + b * m11 + g * m21, a * m02 + b * m12 + g * m22
            a, b, g = r20, r21, r22
            r20, r21, r22 = a * m00 + b * m10 + g * m20, a * m01 + b * m11 + g * m21, a * m02 + b * m12 + g * m22
        else:
            joint = axes.joints[i]
            joint[0, 0], joint[0, 1], joint[0, 2] = r02, r12, r22
            joint[1, 0], joint[1, 1], joint[1, 2] = x, y, z
            axes.slides[i] = what != REVOLUTE
            if what == REVOLUTE:
                cosine, sine = cosine_and_sine(s[i])
                r00, r01 = cosine * r00 + sine * r01, cosine * r01 - sine * r00
                r10, r11 = cosine * r10 + sine * r11, cosine * r11 - sine * r10
                r20, r21 = cosine * r20 + sine * r21, cosine * r21 - sine * r20
            else:
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
        a, b, g = t * moved[0, 0], t * moved[0, 1], t * moved[0, 2]
        if axes.slides[joint[i]]:
            out[0, k] += a
            out[1, k] += b
            out[2, k] += g
        else:
            dx, dy, dz = x - moved[1, 0], y - moved[1, 1], z - moved[1, 2]
            out[0, k] += b * dz - g * dy
            out[1, k] += g * dx - a * dz
            out[2, k] += a * dy - b * dx
            if angular:
                out[3, k] += a
                out[4, k] += b
                out[5, k] += g


class Buffers(NamedTuple):
    """What a pass over lanes fills on the way; the lanes are along each array's last axis, where it has any."""

    s: Float[np.ndarray, "joints lanes"]
    factor: Float[np.ndarray, "pairs lanes"]
    joints: Float[np.ndarray, "joints 2 3 lanes"]
    frames: Float[np.ndarray, "frames 7 3 lanes"]
    slides: Bool[np.ndarray, " joints"]
    T: Float[np.ndarray, "4 4 lanes"]
    J: Float[np.ndarray, "rows p lanes"]
    r: Float[np.ndarray, "3 lanes"]
    y: Float[np.ndarray, "3 lanes"]
    """A measured point."""
    work: Float[np.ndarray, "3 3 lanes"]
    """For the pass itself."""

    @classmethod
    def of(cls, s: np.ndarray, e: np.ndarray, pairs: int = 0, columns: tuple[int, int] = (0, 0)) -> "Buffers":
        """For chain coordinates and error frames such as these, joint-side pairs, and columns of a shape (rows, p)."""
        joints = s.shape[1]
        shapes = (joints,), (pairs,), (joints, 2, 3), (len(e), 7, 3), (4, 4), columns, (3,), (3,), (3, 3)
        own_s, factor, axes, along, T, *others = allocate_lanes(*shapes)
        T[3, 3] = 1.0
        return cls(own_s, factor, axes, along, np.empty(joints, dtype=bool), T, *others)


@part
def axes_of(buffers):
    """The axes that a pass over lanes fills."""
    return Axes(as_lanes(buffers.joints), as_lanes(buffers.frames), buffers.slides)


@compiled
def _poses(steps, s, e, buffers, out):
    error_frames, axes, flat = expand_error_frames(e), axes_of(buffers), buffers.T.reshape(-1)
    for first in range(0, s.shape[0], LANES):
        take_lanes(s, first, buffers.s)
        walk_pose(steps, as_lanes(buffers.s), error_frames, axes, as_lanes(buffers.T))
        unravel(flat, out, first, s.shape[0])


@compiled
def _columns(steps, s, e, factor, layout, point, buffers, out):
    error_frames, axes = expand_error_frames(e), axes_of(buffers)
    T, J, flat = as_lanes(buffers.T), as_lanes(buffers.J), buffers.J.reshape(-1)
    a, b, c = point
    for first in range(0, s.shape[0], LANES):
        take_lanes(s, first, buffers.s)
        take_lanes(factor, first, buffers.factor)
        walk_pose(steps, as_lanes(buffers.s), error_frames, axes, T)
        x = T[0, 3] + T[0, 0] * a + T[0, 1] * b + T[0, 2] * c
        y = T[1, 3] + T[1, 0] * a + T[1, 1] * b + T[1, 2] * c
        z = T[2, 3] + T[2, 0] * a + T[2, 1] * b + T[2, 2] * c
        fill_columns(axes, layout, as_lanes(buffers.factor), x, y, z, J)
        unravel(flat, out, first, s.shape[0])


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

    def fill(rows: slice) -> None:
        _poses(chain.steps, s[rows], e, Buffers.of(s, e), T[rows].reshape(-1))

    in_chunks(fill, len(s))
    return T


def allocate_columns(
    layout: Columns, n: int, *, angular: bool, out: Float[np.ndarray, "n rows p"] | None = None
) -> Float[np.ndarray, "n rows p"]:
    """An array for the columns of n poses, new or as given; cleared only where the walk would not fill it.

    Raises:
        ValueError: what is given has another shape or type, or does not lie in one piece.
    """
    shape = (n, 6 if angular else 3, layout.count)
    if out is None:
        out = np.empty(shape)
    elif out.shape != shape or out.dtype != float or not (out.flags.c_contiguous and out.flags.writeable):
        raise ValueError(
            f"out has shape {out.shape} and type {out.dtype}; it has to be a writable, contiguous array of {shape} doubles"
        )
    if not layout.fills:
        out.fill(0.0)
    return out


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
        out: where to write them, from `allocate_columns`.
    """
    point = np.zeros(3) if point is None else point
    J = allocate_columns(layout, len(s), angular=angular) if out is None else out

    def fill(rows: slice) -> None:
        buffers = Buffers.of(s, e, factor.shape[1], (J.shape[1], J.shape[2]))
        _columns(chain.steps, s[rows], e, factor[rows], layout.arrays, point, buffers, J[rows].reshape(-1))

    in_chunks(fill, len(s))
    return J
