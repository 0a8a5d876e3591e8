"""Poses and joint positions, as the languages write them."""

import warnings

import numpy as np
from scipy.spatial.transform import Rotation


def millimetres(T: np.ndarray, angles=(), digits: int = 9) -> list[str]:
    """X, Y and Z, and what else there is."""
    return [f"{value:.{digits}f}" for value in (*(T[:3, 3] * 1e3), *angles)]


def rapid_pose(T: np.ndarray, digits: int = 9) -> str:
    x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat().tolist()
    return f"[[{','.join(millimetres(T, digits=digits))}],[{','.join(f'{v:.12f}' for v in (w, x, y, z))}]]"


def krl_frame(T: np.ndarray, more: str = "") -> str:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of B = ±90°, where A and C are not unique
        values = millimetres(T, Rotation.from_matrix(T[:3, :3]).as_euler("ZYX", degrees=True))
    return "{" + ",".join(map(" ".join, zip("XYZABC", values, strict=True))) + more + "}"


def krl_joints(q: np.ndarray, more: str = "") -> str:
    return "{" + ",".join(f"A{k} {angle:.9f}" for k, angle in enumerate(np.degrees(q), 1)) + more + "}"


def urscript_pose(T: np.ndarray) -> str:
    values = (*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_rotvec())
    return f"p[{', '.join(f'{value:.12f}' for value in values)}]"


def urscript_joints(q: np.ndarray) -> str:
    return f"[{', '.join(f'{angle:.12f}' for angle in q)}]"


def tp_angles(T: np.ndarray) -> np.ndarray:
    """W, P and R, degrees: turns about the fixed x, y and z, in this order."""
    return Rotation.from_matrix(T[:3, :3]).as_euler("xyz", degrees=True)
