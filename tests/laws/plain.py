"""Kinematics written out plainly, one matrix product after another, for real and complex numbers.

The reference for the compiled walk and the robot description: it shares no code with Taskcal. Everything here is
analytic, so that a derivative is the imaginary part after a step of 1e-30 along the imaginary axis, exact to rounding.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import scipy.linalg

STEP = 1e-30


def turn(axis: int, angle: complex) -> np.ndarray:
    i, j = (axis + 1) % 3, (axis + 2) % 3
    T = np.eye(4, dtype=np.result_type(type(angle), float))
    T[i, i] = T[j, j] = np.cos(angle)
    T[i, j], T[j, i] = -np.sin(angle), np.sin(angle)
    return T


def shift(axis: int, length: complex) -> np.ndarray:
    T = np.eye(4, dtype=np.result_type(type(length), float))
    T[axis, 3] = length
    return T


def product(factors: Sequence[np.ndarray]) -> np.ndarray:
    T = np.eye(4)
    for factor in factors:
        T = T @ factor
    return T


def error_frame(e: np.ndarray) -> np.ndarray:
    """T(tx, ty, tz)·Rx·Ry·Rz."""
    return product([shift(0, e[0]), shift(1, e[1]), shift(2, e[2]), turn(0, e[3]), turn(1, e[4]), turn(2, e[5])])


def derivatives(function: Callable[[np.ndarray], np.ndarray], x: np.ndarray) -> np.ndarray:
    """∂function/∂x_k by complex step, k in the last axis."""
    x = np.asarray(x, dtype=float)
    if not len(x):
        return np.empty((*np.shape(function(x)), 0))
    columns = []
    for k in range(len(x)):
        moved = x.astype(complex)
        moved[k] += 1j * STEP
        columns.append(np.imag(function(moved)) / STEP)
    return np.stack(columns, axis=-1)


def twists(T: np.ndarray, dT: np.ndarray) -> np.ndarray:
    """Rows vx vy vz wx wy wz of the derivatives (4, 4, p) of a pose T."""
    W = np.einsum("ijp,kj->ikp", dT[:3, :3], T[:3, :3])
    return np.stack([dT[0, 3], dT[1, 3], dT[2, 3], W[2, 1], W[0, 2], W[1, 0]])


def rotation_of(w: np.ndarray) -> np.ndarray:
    """Exponential of a rotation vector, which may be complex."""
    x, y, z = w
    return scipy.linalg.expm(np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]))


def rotation_vector(R: np.ndarray) -> np.ndarray:
    """Logarithm of a rotation by less than half a turn."""
    v = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine, cosine = np.sqrt(v @ v), 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)
    return v * (2.0 * np.arctan(sine / (1.0 + cosine)) / sine)


def elementary(step: Mapping[str, Any]) -> np.ndarray:
    """One step of a robot file, such as {"tx_mm": 300.0}."""
    (key,) = set(step) - {"symbol"}
    axis = "xyz".index(key[1])
    return turn(axis, np.radians(step[key])) if key.endswith("_deg") else shift(axis, step[key] / 1e3)


def around(joint: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Fixed transforms before a joint of a robot file, and behind its error frame."""
    before = after = np.eye(4)
    if "steps" in joint:
        before = product([elementary(step) for step in joint["steps"]])
    for key in ("dh", "mdh"):
        if key in joint:
            row = joint[key]
            alpha, a, d = (
                turn(0, np.radians(row.get("alpha_deg", 0.0))),
                shift(0, row.get("a_mm", 0.0) / 1e3),
                shift(2, row.get("d_mm", 0.0) / 1e3),
            )
            if key == "dh":
                after = product([d, a, alpha])
            else:
                before = product([alpha, a, d])
    return before, after


def coordinates(robot: Mapping[str, Any], q: np.ndarray, loop: Sequence[complex] = (0.0, 0.0, 0.0)) -> list[complex]:
    """Chain coordinates of a robot file's robot at controller joints q."""
    by_name = {joint["name"]: value for joint, value in zip(robot["joint"], q, strict=True)}
    s = []
    for joint in robot["joint"]:
        offset = np.radians(joint.get("offset_deg", 0.0)) + joint.get("offset_mm", 0.0) / 1e3
        s.append(eval(joint.get("angle") or joint["name"], {}, by_name) + offset)
    if robot.get("four_bar"):
        bar = robot["four_bar"]
        alpha, kappa = eval(bar["arm"], {}, by_name), eval(bar["crank"], {}, by_name)
        driven = [joint["name"] for joint in robot["joint"]].index(bar["drives"])
        s[driven] += rocker_angle(bar, alpha, kappa, loop) - kappa
    return s


def rocker_angle(bar: Mapping[str, Any], alpha: complex, kappa: complex, loop: Sequence[complex]) -> complex:
    """θ of |d·u(α) + L3·u(θ + ρ) − L1·u(κ + γ)| = L2 by Newton's method from the nominal θ = κ."""
    L1, L2, L3 = (bar[f"{part}_mm"] / 1e3 + xi for part, xi in zip(("crank", "rod", "rocker"), loop, strict=True))
    d = bar["arm_mm"] / 1e3
    gamma, rho = np.radians(bar.get("crank_angle_deg", -90.0)), np.radians(bar.get("rocker_angle_deg", -90.0))
    wx = d * np.cos(alpha) - L1 * np.cos(kappa + gamma)
    wy = d * np.sin(alpha) - L1 * np.sin(kappa + gamma)
    theta = kappa + 0.0 * (L1 + L2 + L3)
    for _ in range(60):
        c, s = np.cos(theta + rho), np.sin(theta + rho)
        vx, vy = wx + L3 * c, wy + L3 * s
        theta = theta - (vx * vx + vy * vy - L2 * L2) / (2.0 * L3 * (vy * c - vx * s))
    return theta


def pose(robot: Mapping[str, Any], q: np.ndarray, x: np.ndarray | None = None) -> np.ndarray:
    """Pose of a robot file's tool in its base, with the defects x: six a joint, six of the tool, three loop lengths."""
    count = len(robot["joint"])
    x = np.zeros(6 * count + 9) if x is None else x
    s = coordinates(robot, q, x[6 * count + 6 : 6 * count + 9] if robot.get("four_bar") else (0.0, 0.0, 0.0))
    factors = []
    for j, joint in enumerate(robot["joint"]):
        before, after = around(joint)
        moved = shift(2, s[j]) if joint.get("type") == "prismatic" else turn(2, s[j])
        factors += [before, moved, error_frame(x[6 * j : 6 * j + 6]), after]
    factors += [elementary(step) for step in robot.get("tool", ())]
    return product([*factors, error_frame(x[6 * count : 6 * count + 6])])


def poses(robot: Mapping[str, Any], q: np.ndarray, x: np.ndarray | None = None) -> np.ndarray:
    return np.array([pose(robot, row, x) for row in q])
