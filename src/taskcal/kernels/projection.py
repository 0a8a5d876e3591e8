"""Pictures of known corners, compiled: projection through a lens, and the pose of every picture eliminated.

A corner x of a board is at R·x + t in the camera's frame, x forward along z. Lenses are those of OpenCV: ``pinhole`` with the
distortion k1 k2 p1 p2 k3 of Brown (1966) and Conrady (1919), and ``fisheye`` with k1 … k4 of Kannala and Brandt (2006).
"""

import numpy as np
from jaxtyping import Float, Int

from taskcal.kernels.compiled import compiled, part

PINHOLE, FISHEYE = 0, 1
"""Lenses, by the codes that the kernels take."""

POSE = 6
"""Numbers of a pose: a move of the board's origin in the camera's axes, metres, and a turn about it, radians."""

BEHIND = 1e-6
"""Depth, metres, from which on a corner is before the camera."""

SMALL = 1e-9
"""Tangent of an angle to the optical axis, under which a fisheye is a pinhole to rounding."""

SETTLED = 1e-12
"""Square of a step in standard deviations, with which a pose is found: far less than any figure of a fit shows."""


@part
def _distort(lens, camera, x, y, by_xy, by_camera):
    """The point of the picture over focal lengths and centre, and its derivatives by x and y and by the distortion."""
    r2 = x * x + y * y
    if lens == FISHEYE:
        r = np.sqrt(r2)
        if r < SMALL:
            by_xy[0, 0], by_xy[0, 1], by_xy[1, 0], by_xy[1, 1] = 1.0, 0.0, 0.0, 1.0
            by_camera[:, 4:] = 0.0
            return x, y
        angle = np.arctan(r)
        a2 = angle * angle
        series = 1.0 + a2 * (camera[4] + a2 * (camera[5] + a2 * (camera[6] + a2 * camera[7])))
        slope = 1.0 + a2 * (3 * camera[4] + a2 * (5 * camera[5] + a2 * (7 * camera[6] + a2 * 9 * camera[7])))
        s = angle * series / r
        by_r = (slope / (1.0 + r2) - s) / r2  # over r once more, as it meets x·x, x·y and y·y
        by_xy[0, 0], by_xy[0, 1] = s + x * x * by_r, x * y * by_r
        by_xy[1, 0], by_xy[1, 1] = x * y * by_r, s + y * y * by_r
        power = angle / r
        for k in range(4):
            power *= a2
            by_camera[0, 4 + k], by_camera[1, 4 + k] = x * power, y * power
        return x * s, y * s
    k1, k2, p1, p2, k3 = camera[4], camera[5], camera[6], camera[7], camera[8]
    s = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    by_r2 = k1 + r2 * (2 * k2 + r2 * 3 * k3)
    by_xy[0, 0] = s + 2 * x * x * by_r2 + 2 * p1 * y + 6 * p2 * x
    by_xy[0, 1] = by_xy[1, 0] = 2 * x * y * by_r2 + 2 * p1 * x + 2 * p2 * y
    by_xy[1, 1] = s + 2 * y * y * by_r2 + 6 * p1 * y + 2 * p2 * x
    by_camera[0, 4], by_camera[1, 4] = x * r2, y * r2
    by_camera[0, 5], by_camera[1, 5] = x * r2 * r2, y * r2 * r2
    by_camera[0, 6], by_camera[1, 6] = 2 * x * y, r2 + 2 * y * y
    by_camera[0, 7], by_camera[1, 7] = r2 + 2 * x * x, 2 * x * y
    by_camera[0, 8], by_camera[1, 8] = x * r2 * r2 * r2, y * r2 * r2 * r2
    return x * s + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * s + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y


@part
def _look(lens, camera, R, t, corner, uv, jacobian, by_xy, by_camera):
    """Fill in a corner's pixel and its derivatives by pose and camera; False behind the camera."""
    ax = R[0, 0] * corner[0] + R[0, 1] * corner[1] + R[0, 2] * corner[2]
    ay = R[1, 0] * corner[0] + R[1, 1] * corner[1] + R[1, 2] * corner[2]
    az = R[2, 0] * corner[0] + R[2, 1] * corner[1] + R[2, 2] * corner[2]
    z = az + t[2]
    if z < BEHIND:
        return False
    x, y = (ax + t[0]) / z, (ay + t[1]) / z
    u, v = _distort(lens, camera, x, y, by_xy, by_camera)
    uv[0], uv[1] = camera[0] * u + camera[2], camera[1] * v + camera[3]
    for i in range(2):
        f = camera[i]
        by_x, by_y = f * by_xy[i, 0] / z, f * by_xy[i, 1] / z
        by_z = -(x * by_x + y * by_y)
        jacobian[i, 0], jacobian[i, 1], jacobian[i, 2] = by_x, by_y, by_z
        # a turn w moves the corner by w × a
        jacobian[i, 3] = by_z * ay - by_y * az
        jacobian[i, 4] = by_x * az - by_z * ax
        jacobian[i, 5] = by_y * ax - by_x * ay
        jacobian[i, POSE + i], jacobian[i, POSE + 1 - i] = (u if i == 0 else v), 0.0
        jacobian[i, POSE + 2 + i], jacobian[i, POSE + 3 - i] = 1.0, 0.0
        for k in range(4, len(camera)):
            jacobian[i, POSE + k] = f * by_camera[i, k]
    return True


@part
def _normal(lens, camera, R, t, corners, pixels, weight, H, g):
    """Fill in the normal equations of a picture, and return its cost; infinite where a corner is behind the camera."""
    uv, by_xy, by_camera = np.empty(2), np.empty((2, 2)), np.zeros((2, len(camera)))
    jacobian, cost, size = np.zeros((2, len(g))), 0.0, len(g)
    H[:], g[:] = 0.0, 0.0
    for c in range(len(corners)):
        if not _look(lens, camera, R, t, corners[c], uv, jacobian, by_xy, by_camera):
            return np.inf
        for i in range(2):
            residual = pixels[c, i] - uv[i]
            cost += 0.5 * weight[c] * residual * residual
            for a in range(size):
                scaled = weight[c] * jacobian[i, a]
                g[a] += scaled * residual
                for b in range(a + 1):
                    H[a, b] += scaled * jacobian[i, b]
    for a in range(size):
        for b in range(a):
            H[b, a] = H[a, b]
    return cost


@part
def _step(H, g, damping, L, d):
    """Solve (H + damping·diag H)·d = g of a pose by Cholesky; return g·d, or −1 where that is singular."""
    for a in range(POSE):
        for b in range(a + 1):
            value = H[a, b] * (1.0 + damping if a == b else 1.0)
            for k in range(b):
                value -= L[a, k] * L[b, k]
            if a == b:
                if value <= 0.0:
                    return -1.0
                L[a, a] = np.sqrt(value)
            else:
                L[a, b] = value / L[b, b]
    for a in range(POSE):
        value = g[a]
        for k in range(a):
            value -= L[a, k] * d[k]
        d[a] = value / L[a, a]
    for a in range(POSE - 1, -1, -1):
        value = d[a]
        for k in range(a + 1, POSE):
            value -= L[k, a] * d[k]
        d[a] = value / L[a, a]
    total = 0.0
    for a in range(POSE):
        total += g[a] * d[a]
    return total


@part
def _turned(R, wx, wy, wz, out):
    """Fill in exp(w)·R."""
    angle2 = wx * wx + wy * wy + wz * wz
    angle = np.sqrt(angle2)
    a = np.sin(angle) / angle if angle > SMALL else 1.0
    b = (1.0 - np.cos(angle)) / angle2 if angle > SMALL else 0.5
    for j in range(3):
        x, y, z = R[0, j], R[1, j], R[2, j]
        cx, cy, cz = wy * z - wz * y, wz * x - wx * z, wx * y - wy * x
        out[0, j] = x + a * cx + b * (wy * cz - wz * cy)
        out[1, j] = y + a * cy + b * (wz * cx - wx * cz)
        out[2, j] = z + a * cz + b * (wx * cy - wy * cx)


@compiled
def settle_pictures(lens, camera, corners, pixels, weight, first, steps, R, t, H, g, cost):
    """Find the pose of every picture at a camera, by Levenberg and Marquardt, and its normal equations there.

    Args:
        lens: code of the lens.
        camera: fx fy cx cy and the distortion, pixels.
        corners: on their boards, metres, those of one picture behind another.
        pixels: where each was seen.
        weight: of each, per square pixel.
        first: number of the first corner of each picture, and of all.
        steps: at most, of each picture.
        R: rotations of the boards in the camera's frame; changed in place.
        t: places of the boards; changed in place.
        H: information of pose and camera, filled in.
        g: gradient, filled in.
        cost: of each picture, filled in.
    """
    size = POSE + len(camera)
    H2, g2, L, d = np.empty((size, size)), np.empty(size), np.zeros((POSE, POSE)), np.zeros(POSE)
    R2, t2 = np.empty((3, 3)), np.empty(3)
    for p in range(len(first) - 1):
        own, damping = slice(first[p], first[p + 1]), 0.0
        cost[p] = _normal(lens, camera, R[p], t[p], corners[own], pixels[own], weight[own], H[p], g[p])
        for _ in range(steps):
            gain = _step(H[p], g[p], damping, L, d)
            if 0.0 <= gain < SETTLED or not np.isfinite(cost[p]):
                break
            better = np.inf
            if gain > 0.0:
                _turned(R[p], d[3], d[4], d[5], R2)
                for k in range(3):
                    t2[k] = t[p, k] + d[k]
                better = _normal(lens, camera, R2, t2, corners[own], pixels[own], weight[own], H2, g2)
            if better <= cost[p]:
                R[p], t[p], H[p], g[p], cost[p] = R2, t2, H2, g2, better
                damping *= 0.1
            elif damping > 1e8:
                break
            else:
                damping = max(10.0 * damping, 1e-4)


@compiled
def look_at_corners(lens, camera, R, t, corners, pixels, jacobian):
    """Fill in the pixels of corners, each with a pose of its own, and their derivatives; NaN behind the camera."""
    by_xy, by_camera = np.empty((2, 2)), np.zeros((2, len(camera)))
    for c in range(len(corners)):
        if not _look(lens, camera, R[c], t[c], corners[c], pixels[c], jacobian[c], by_xy, by_camera):
            pixels[c] = np.nan


def project(
    lens: int,
    camera: Float[np.ndarray, " k"],
    R: Float[np.ndarray, "n 3 3"],
    t: Float[np.ndarray, "n 3"],
    corners: Float[np.ndarray, "n 3"],
) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, "n 2 p"]]:
    """Pixels of corners, each with a pose of its board, and their derivatives by pose and camera; NaN behind the camera."""
    pixels, jacobian = np.empty((len(corners), 2)), np.zeros((len(corners), 2, POSE + len(camera)))
    camera, R, t, corners = (np.ascontiguousarray(a, dtype=float) for a in (camera, R, t, corners))
    look_at_corners(lens, camera, R, t, corners, pixels, jacobian)
    return pixels, jacobian


def eliminate_poses(
    lens: int,
    camera: Float[np.ndarray, " k"],
    corners: Float[np.ndarray, "c 3"],
    pixels: Float[np.ndarray, "c 2"],
    weight: Float[np.ndarray, " c"],
    first: Int[np.ndarray, " n1"],
    poses: Float[np.ndarray, "n 4 4"],
    steps: int,
) -> tuple[Float[np.ndarray, "n 4 4"], Float[np.ndarray, "n p p"], Float[np.ndarray, "n p"], Float[np.ndarray, " n"]]:
    """Poses of boards in the camera's frame that fit best, and the normal equations and the cost there; as `settle_pictures`."""
    T, size = poses.copy(), POSE + len(camera)
    R, t = np.ascontiguousarray(T[:, :3, :3]), np.ascontiguousarray(T[:, :3, 3])
    H, g, cost = np.zeros((len(T), size, size)), np.zeros((len(T), size)), np.zeros(len(T))
    camera = np.ascontiguousarray(camera, dtype=float)
    settle_pictures(lens, camera, corners, pixels, weight, first, steps, R, t, H, g, cost)
    T[:, :3, :3], T[:, :3, 3] = R, t
    return T, H, g, cost
