"""Statics written out plainly: the energy of a robot with elastic drives, and where it comes to rest.

It shares no code with Taskcal but the robot file's description.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.optimize import minimize

from tests.laws import plain

GRAVITY = 9.80665


def weighed(description: Mapping[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """The robot with random masses, a payload beyond its flange, and stiff drives."""
    joints = [
        {
            **joint,
            "mass_kg": float(rng.uniform(5, 80)),
            "centre_mm": rng.uniform(-200, 200, 3).tolist(),
            "stiffness_n_mm" if joint.get("type") == "prismatic" else "stiffness_nm_rad": float(rng.uniform(1e6, 4e6)),
        }
        for joint in description["joint"]
    ]
    payload = {"mass_kg": float(rng.uniform(5, 60)), "centre_mm": rng.uniform(-200, 200, 3).tolist()}
    return {**description, "joint": joints, "payload": payload, "flange": [{"rx_deg": 35.0}, {"tz_mm": 90.0}]}


def coordinates(robot: Mapping[str, Any], q: np.ndarray, turned: np.ndarray) -> list[complex]:
    """Chain coordinates where the drives have turned beside the controller's joints: cranks of a four-bar, or own axes."""
    if robot.get("four_bar"):
        return plain.coordinates(robot, q + turned)
    return [s + t for s, t in zip(plain.coordinates(robot, q), turned, strict=True)]


def link_frames(robot: Mapping[str, Any], s: list[complex]) -> list[np.ndarray]:
    """Frame of every joint's row in the base, then the flange and the tool."""
    T, out = np.eye(4), []
    for joint, value in zip(robot["joint"], s, strict=True):
        before, after = plain.around(joint)
        T = T @ before @ (plain.shift(2, value) if joint.get("type") == "prismatic" else plain.turn(2, value)) @ after
        out.append(T)
    ends = [plain.product([plain.elementary(step) for step in robot.get(part, ())]) for part in ("flange", "tool")]
    return [*out, *(T @ end for end in ends)]


def energy(
    robot: Mapping[str, Any], q: np.ndarray, turned: np.ndarray, force: np.ndarray, payload: Mapping[str, Any] | None
) -> complex:
    """Potential energy of all weights, of a constant force at the TCP, and of the robot's spring, joules."""
    s = coordinates(robot, q, turned)
    *frames, tool = link_frames(robot, s)
    down = np.array(robot.get("gravity", [0.0, 0.0, -1.0]))
    down = GRAVITY * down / np.linalg.norm(down)
    bodies = [*robot["joint"], payload or robot.get("payload", {"mass_kg": 0.0, "centre_mm": [0.0, 0.0, 0.0]})]
    total = 0.0
    for T, body in zip(frames, bodies, strict=True):
        centre = T @ np.array([*np.array(body["centre_mm"]) / 1e3, 1.0])
        total = total - body["mass_kg"] * (down @ centre[:3])
    total = total - force @ tool[:3, 3]
    spring = robot.get("spring")
    if spring:
        names = [joint["name"] for joint in robot["joint"]]
        j = names.index(spring["joint"])
        phi = s[j] - np.radians(robot["joint"][j].get("offset_deg", 0.0)) - np.radians(spring["aligned_deg"])
        r, a = spring["crank_mm"] / 1e3, spring["anchor_mm"] / 1e3
        length = np.sqrt(r**2 + a**2 - 2 * r * a * np.cos(phi))
        total = total + 0.5 * spring["rate_n_mm"] * 1e3 * (length - spring["free_length_mm"] / 1e3) ** 2
    return total


def torques(
    robot: Mapping[str, Any], q: np.ndarray, force: np.ndarray, payload: Mapping[str, Any] | None = None
) -> np.ndarray:
    """−∂U/∂(drives) by complex step."""
    return -plain.derivatives(lambda turned: energy(robot, q, turned, force, payload), np.zeros(len(q)))


def at_rest(
    robot: Mapping[str, Any], q: np.ndarray, force: np.ndarray, payload: Mapping[str, Any] | None = None
) -> np.ndarray:
    """Turns of the drives in equilibrium: the least energy of weights, force and elastic drives, by SciPy."""
    stiffness = np.array(
        [joint.get("stiffness_nm_rad", joint.get("stiffness_n_mm", 0.0) * 1e3) for joint in robot["joint"]]
    )
    size = np.sqrt(stiffness)
    rest = energy(robot, q, np.zeros(len(q)), force, payload)

    def total(y: np.ndarray) -> float:
        return float(energy(robot, q, y / size, force, payload) - rest + 0.5 * y @ y)

    def slope(y: np.ndarray) -> np.ndarray:
        return y + plain.derivatives(lambda turned: energy(robot, q, turned, force, payload), y / size) / size

    found = minimize(total, np.zeros(len(q)), jac=slope, method="BFGS", options={"gtol": 1e-9})
    return found.x / size


def tool_pose(robot: Mapping[str, Any], q: np.ndarray, turned: np.ndarray) -> np.ndarray:
    """Pose of the tool where the drives have turned."""
    return link_frames(robot, coordinates(robot, q, turned))[-1]
