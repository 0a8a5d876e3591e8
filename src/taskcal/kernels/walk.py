"""The compiled walk along a chain: poses, and the twist of the tool for every parameter, in one pass over blocks of poses.

At each joint and error frame the walk notes the axes and origins about which, or along which, the rest of the chain
moves. A translation along a moves the TCP p by a, a rotation about a through o by a × (p − o); a joint-side
parameter moves joints, so its column is a combination of theirs.

There is one kernel, `walk_points`: whether its result is poses, columns or the whitened rows of measured points, the code of
the walk is compiled once.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.kernels.blocks import BLOCK, cosine_and_sine, take_block
from taskcal.kernels.chain import ERROR_FRAME, FIXED, REVOLUTE, Chain, ColumnArrays, Columns, Steps
from taskcal.kernels.chunks import in_chunks
from taskcal.kernels.compiled import compiled, inlined, part

TILE = 512
"""Poses of one call, whose rows stay in the second cache: 0.6 MB with 50 columns."""


class Points(NamedTuple):
    """Where the targets sit in the end's frame, and which columns belong to that."""

    position: Float[np.ndarray, "targets 3"]
    """Target centres, metres."""
    columns: Int[np.ndarray, "targets 3"]
    """Column of each coordinate, −1 where it is held fixed."""


class SeenPoints(NamedTuple):
    """Points fixed to the chain's end, as measured in the frame of its start."""

    position: Float[np.ndarray, "n targets 3"]
    """Metres."""
    valid: Bool[np.ndarray, "n targets"]
    """False where the beam was lost."""

    def take(self, rows: slice) -> "SeenPoints":
        """Some of the poses."""
        return SeenPoints(self.position[rows], self.valid[rows])


NOT_MEASURED = SeenPoints(np.empty((0, 0, 3)), np.empty((0, 0), dtype=bool))
NOT_WHITENED = np.empty((0, 0, 3, 3))


class WalkArrays(NamedTuple):
    """A chain with everything that a pass over poses needs besides measurements."""

    steps: Steps
    s: Float[np.ndarray, "n joints"]
    """Chain coordinates, radians or metres."""
    e: Float[np.ndarray, "frames 6"]
    """Values of the error frames, metres and radians."""
    layout: ColumnArrays
    factor: Float[np.ndarray, "n pairs"]
    """∂s/∂ξ of each joint-side pair of the layout."""
    points: Points


class Buffers(NamedTuple):
    """Numbers of one block on the way; the poses are along each row."""

    s: Float[np.ndarray, "joints poses"]
    factor: Float[np.ndarray, "pairs poses"]
    error_frames: Float[np.ndarray, "frames 22"]
    """Transform of each error frame, its axes of rotation in columns, and one if its six values are exactly zero."""
    joints: Float[np.ndarray, "2*joints 3*poses"]
    """Axis of each joint, and its origin."""
    frames: Float[np.ndarray, "7*frames 3*poses"]
    """Three axes of translation and three of rotation of each error frame; its origin."""
    slides: Bool[np.ndarray, " joints"]
    """Whether a joint is prismatic."""
    T: Float[np.ndarray, " 12*poses"]
    """Pose of the end: rotation and translation, row by row."""
    poses: Float[np.ndarray, "12 1 poses"]
    """The same memory."""
    point: Float[np.ndarray, " 3*poses"]
    """A point of the end in the frame of the start."""
    whitener: Float[np.ndarray, " 6*poses"]
    """Lower triangles, row by row."""

    @classmethod
    def of(cls, joints: int, frames: int, pairs: int) -> "Buffers":
        """For so many joints, error frames and joint-side pairs."""
        T = np.empty(12 * BLOCK)
        return cls(
            s=np.empty((joints, BLOCK)),
            factor=np.empty((pairs, BLOCK)),
            error_frames=np.empty((frames, 22)),
            joints=np.empty((2 * joints, 3 * BLOCK)),
            frames=np.empty((7 * frames, 3 * BLOCK)),
            slides=np.empty(joints, dtype=bool),
            T=T,
            poses=T.reshape(12, 1, BLOCK),
            point=np.empty(3 * BLOCK),
            whitener=np.empty(6 * BLOCK),
        )


class WalkOutput(NamedTuple):
    """What a pass fills; arrays without poses are left out."""

    poses: Float[np.ndarray, "n 1 16"]
    """The first twelve numbers of each pose of the end."""
    columns: Float[np.ndarray, "n rows p"]
    """Columns of each pose's last target."""
    rows: Float[np.ndarray, "p+1 blocks rows*poses"]
    """The same column by column, one block of a target behind another, and the residuals of measured points at last. With fewer
    blocks than there are, the latest ones take the place of the first."""


@part
def expand_error_frames(e, out):
    """Everything about the error frames that does not depend on the pose."""
    for f in range(e.shape[0]):
        cx, sx = np.cos(e[f, 3]), np.sin(e[f, 3])
        cy, sy = np.cos(e[f, 4]), np.sin(e[f, 4])
        cz, sz = np.cos(e[f, 5]), np.sin(e[f, 5])
        M = out[f]
        M[0], M[1], M[2], M[3] = cy * cz, -cy * sz, sy, e[f, 0]
        M[4], M[5], M[6], M[7] = cx * sz + sx * sy * cz, cx * cz - sx * sy * sz, -sx * cy, e[f, 1]
        M[8], M[9], M[10], M[11] = sx * sz - cx * sy * cz, sx * cz + cx * sy * sz, cx * cy, e[f, 2]
        M[12], M[13], M[14] = 1.0, 0.0, sy
        M[15], M[16], M[17] = 0.0, cx, -sx * cy
        M[18], M[19], M[20] = 0.0, sx, cx * cy
        M[21] = 1.0
        for c in range(6):
            if e[f, c] != 0.0:
                M[21] = 0.0


@part
def _note_error_frame(T, M, f, frames):
    """Note axes and origin of an error frame of transform M, which begins at T; its origin is behind its translation."""
    origin, is_zero = frames[7 * f + 6], M[21] == 1.0
    for c in range(3):
        along, about = frames[7 * f + c], frames[7 * f + 3 + c]
        for i in range(BLOCK):
            for a in range(3):
                along[a * BLOCK + i] = T[(4 * a + c) * BLOCK + i]
        if is_zero:
            for i in range(3 * BLOCK):
                about[i] = along[i]
        else:
            u, v, w = M[12 + c], M[15 + c], M[18 + c]
            for i in range(BLOCK):
                for a in range(3):
                    k = 4 * a * BLOCK + i
                    about[a * BLOCK + i] = T[k] * u + T[k + BLOCK] * v + T[k + 2 * BLOCK] * w
    x, y, z = M[3], M[7], M[11]
    for i in range(BLOCK):
        for a in range(3):
            k = 4 * a * BLOCK + i
            origin[a * BLOCK + i] = T[k] * x + T[k + BLOCK] * y + T[k + 2 * BLOCK] * z + T[k + 3 * BLOCK]


@part
def walk_block(steps, buffers, frames):
    """Walk one block: fill the poses of the end, the axes and origins of joints and, where `frames` is true, of error frames."""
    kind, which, T = steps.kind, steps.which, buffers.T
    for k in range(12):
        for i in range(BLOCK):
            T[k * BLOCK + i] = 1.0 if k in (0, 5, 10) else 0.0
    for step in range(kind.shape[0]):
        what, number = kind[step], which[step]
        if what in (FIXED, ERROR_FRAME):
            if what == ERROR_FRAME:
                M = buffers.error_frames[number]
                if frames:
                    _note_error_frame(T, M, number, buffers.frames)
                if M[21] == 1.0:
                    continue
            else:
                M = steps.fixed[number]
            m0, m1, m2, m3, m4, m5, m6, m7 = M[0], M[1], M[2], M[3], M[4], M[5], M[6], M[7]
            m8, m9, m10, m11 = M[8], M[9], M[10], M[11]
            for i in range(BLOCK):
                for a in range(3):
                    k = 4 * a * BLOCK + i
                    u, v, w = T[k], T[k + BLOCK], T[k + 2 * BLOCK]
                    T[k], T[k + BLOCK] = u * m0 + v * m4 + w * m8, u * m1 + v * m5 + w * m9
                    T[k + 2 * BLOCK] = u * m2 + v * m6 + w * m10
                    T[k + 3 * BLOCK] += u * m3 + v * m7 + w * m11
        else:
            s, axis, origin = buffers.s[number], buffers.joints[2 * number], buffers.joints[2 * number + 1]
            buffers.slides[number] = what != REVOLUTE
            for i in range(BLOCK):
                for a in range(3):
                    axis[a * BLOCK + i] = T[(4 * a + 2) * BLOCK + i]
                    origin[a * BLOCK + i] = T[(4 * a + 3) * BLOCK + i]
            if what == REVOLUTE:
                for i in range(BLOCK):
                    cosine, sine = cosine_and_sine(s[i])
                    for a in range(3):
                        k = 4 * a * BLOCK + i
                        u, v = T[k], T[k + BLOCK]
                        T[k], T[k + BLOCK] = cosine * u + sine * v, cosine * v - sine * u
            else:
                for i in range(BLOCK):
                    for a in range(3):
                        T[(4 * a + 3) * BLOCK + i] += s[i] * T[(4 * a + 2) * BLOCK + i]


@part
def fill_columns(buffers, layout, rows, row):
    """Columns of the point of a block: rows vx vy vz, and wx wy wz where there is room for six."""
    frames, joints, point = buffers.frames, buffers.joints, buffers.point
    angular = rows.shape[2] == 6 * BLOCK
    for f in range(layout.frames.shape[0]):
        origin = frames[7 * f + 6]
        for c in range(6):
            k = layout.frames[f, c]
            if k < 0:
                continue
            axis, out = frames[7 * f + c], rows[k, row]
            if c < 3:
                for i in range(3 * BLOCK):
                    out[i] = axis[i]
            else:
                for i in range(BLOCK):
                    a, b, g = axis[i], axis[BLOCK + i], axis[2 * BLOCK + i]
                    dx, dy = point[i] - origin[i], point[BLOCK + i] - origin[BLOCK + i]
                    dz = point[2 * BLOCK + i] - origin[2 * BLOCK + i]
                    out[i], out[BLOCK + i], out[2 * BLOCK + i] = b * dz - g * dy, g * dx - a * dz, a * dy - b * dx
            if angular:
                turns = 0.0 if c < 3 else 1.0
                for i in range(3 * BLOCK):
                    out[3 * BLOCK + i] = turns * axis[i]
    for pair in range(layout.joint.shape[0]):
        out = rows[layout.column[pair], row]
        for i in range(out.shape[0]):
            out[i] = 0.0
    for pair in range(layout.joint.shape[0]):
        joint, out, t = layout.joint[pair], rows[layout.column[pair], row], buffers.factor[pair]
        axis, origin = joints[2 * joint], joints[2 * joint + 1]
        if buffers.slides[joint]:
            for i in range(BLOCK):
                for a in range(3):
                    out[a * BLOCK + i] += t[i] * axis[a * BLOCK + i]
            continue
        for i in range(BLOCK):
            a, b, g = t[i] * axis[i], t[i] * axis[BLOCK + i], t[i] * axis[2 * BLOCK + i]
            dx, dy = point[i] - origin[i], point[BLOCK + i] - origin[BLOCK + i]
            dz = point[2 * BLOCK + i] - origin[2 * BLOCK + i]
            out[i] += b * dz - g * dy
            out[BLOCK + i] += g * dx - a * dz
            out[2 * BLOCK + i] += a * dy - b * dx
        if angular:
            for i in range(BLOCK):
                for a in range(3):
                    out[(3 + a) * BLOCK + i] += t[i] * axis[a * BLOCK + i]


@part
def _fill_target(points, t, buffers, rows, row):
    """Place target t in the frame of the start, and fill the columns that belong to where targets sit."""
    T, point, position = buffers.T, buffers.point, points.position
    a, b, c = position[t, 0], position[t, 1], position[t, 2]
    for i in range(BLOCK):
        for r in range(3):
            k = 4 * r * BLOCK + i
            point[r * BLOCK + i] = T[k + 3 * BLOCK] + T[k] * a + T[k + BLOCK] * b + T[k + 2 * BLOCK] * c
    for other in range(points.columns.shape[0]):
        for d in range(3):
            k = points.columns[other, d]
            if k >= 0:
                out, own = rows[k, row], 1.0 if other == t else 0.0
                for i in range(BLOCK):
                    for r in range(3):
                        out[r * BLOCK + i] = own * T[(4 * r + d) * BLOCK + i]


@part
def _fill_residual(seen, first, t, point, out):
    """Fill measured less predicted; where nothing was measured, zero counts as measured, and beyond the last pose, that one."""
    for i in range(BLOCK):
        row = min(first + i, seen.valid.shape[0] - 1)
        for a in range(3):
            y = seen.position[row, t, a] if seen.valid[row, t] else 0.0
            out[a * BLOCK + i] = y - point[a * BLOCK + i]


@part
def _take_whitener(valid, whitener, first, t, out):
    """Copy lower triangles to the places of a block; zeros where nothing was measured, and beyond the last pose."""
    n = valid.shape[0]
    for i in range(BLOCK):
        row = min(first + i, n - 1)
        there = first + i < n and valid[row, t]
        for k, a, b in ((0, 0, 0), (1, 1, 0), (2, 1, 1), (3, 2, 0), (4, 2, 1), (5, 2, 2)):
            out[k * BLOCK + i] = whitener[row, t, a, b] if there else 0.0


@inlined
def whiten(W, source, out):
    """Fill three rows of a block with lower triangles times those of another, which may be the same."""
    for i in range(BLOCK):
        u, v, w = source[i], source[BLOCK + i], source[2 * BLOCK + i]
        out[i], out[BLOCK + i] = W[i] * u, W[BLOCK + i] * u + W[2 * BLOCK + i] * v
        out[2 * BLOCK + i] = W[3 * BLOCK + i] * u + W[4 * BLOCK + i] * v + W[5 * BLOCK + i] * w


@part
def _by_pose(source, row, first, out):
    """Copy a block to where the numbers of each pose lie together; poses beyond the last are left out."""
    for i in range(min(BLOCK, out.shape[0] - first)):
        for a in range(out.shape[1]):
            for k in range(source.shape[0]):
                out[first + i, a, k] = source[k, row, a * BLOCK + i]


@compiled
def walk_points(walk, seen, whitener, buffers, out):
    """Walk all poses, and linearise the targets at each; whiten the rows where there is a whitener."""
    expand_error_frames(walk.e, buffers.error_frames)
    targets, rows = walk.points.position.shape[0], out.rows
    for first in range(0, walk.s.shape[0], BLOCK):
        take_block(walk.s, first, buffers.s)
        take_block(walk.factor, first, buffers.factor)
        walk_block(walk.steps, buffers, walk.layout.frames.shape[0] > 0)
        if out.poses.shape[0] > 0:
            _by_pose(buffers.poses, first % buffers.poses.shape[1], first, out.poses)
        for t in range(targets):
            row = (first // BLOCK * targets + t) % rows.shape[1]
            _fill_target(walk.points, t, buffers, rows, row)
            fill_columns(buffers, walk.layout, rows, row)
            if seen.valid.shape[0] > 0:
                _fill_residual(seen, first, t, buffers.point, rows[rows.shape[0] - 1, row])
            if whitener.shape[0] > 0:
                _take_whitener(seen.valid, whitener, first, t, buffers.whitener)
                for k in range(rows.shape[0]):
                    whiten(buffers.whitener, rows[k, row], rows[k, row])
            if out.columns.shape[0] > 0:
                _by_pose(rows, row, first, out.columns)


NO_POSES, NO_COLUMNS, NO_ROWS = np.empty((0, 1, 16)), np.empty((0, 0, 0)), np.empty((0, 1, 0))
NO_LAYOUT = ColumnArrays(np.empty((0, 6), dtype=np.int64), np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))
NO_POINTS = Points(np.empty((0, 3)), np.empty((0, 3), dtype=np.int64))


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
    T[:, 3] = 0.0, 0.0, 0.0, 1.0

    def fill(rows: slice) -> None:
        at = WalkArrays(chain.steps, s[rows], e, NO_LAYOUT, np.empty((0, 0)), NO_POINTS)
        filled = WalkOutput(T[rows].reshape(-1, 1, 16), NO_COLUMNS, NO_ROWS)
        walk_points(at, NOT_MEASURED, NOT_WHITENED, Buffers.of(s.shape[1], len(e), 0), filled)

    in_chunks(fill, len(s))
    return T


def allocate_columns(
    layout: Columns, n: int, *, angular: bool, out: Float[np.ndarray, "n rows p"] | None = None
) -> Float[np.ndarray, "n rows p"]:
    """An array for the columns of n poses, new or as given.

    Raises:
        ValueError: what is given has another shape or type, or does not lie in one piece.
    """
    shape = (n, 6 if angular else 3, layout.count)
    if out is None:
        return np.empty(shape)
    if type(out) is not np.ndarray or out.shape != shape or out.dtype != float or not out.flags.carray:
        given = f"has shape {out.shape} and type {out.dtype}" if hasattr(out, "dtype") else f"is a {type(out).__name__}"
        raise ValueError(f"out {given}; it has to be a writable, contiguous array of {shape} doubles")
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
    poses: Float[np.ndarray, "n 4 4"] | None = None,
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
        poses: where to write the poses of the end, too.
    """
    at_point = Points(np.zeros((1, 3)) if point is None else point.reshape(1, 3), np.full((1, 3), -1))
    J = allocate_columns(layout, len(s), angular=angular) if out is None else out
    if poses is not None:
        poses[:, 3] = 0.0, 0.0, 0.0, 1.0

    def fill(rows: slice) -> None:
        at = WalkArrays(chain.steps, s[rows], e, layout.arrays, factor[rows], at_point)
        block = np.zeros((layout.count, 1, J.shape[1] * BLOCK))
        T = NO_POSES if poses is None else poses[rows].reshape(-1, 1, 16)
        buffers = Buffers.of(s.shape[1], len(e), factor.shape[1])
        walk_points(at, NOT_MEASURED, NOT_WHITENED, buffers, WalkOutput(T, J[rows], block))

    in_chunks(fill, len(s))
    return J
