"""Reasons of a program for leaving motions, poses by hand and targets without external axes."""

import numpy as np
from pytransform3d.rotations import matrix_from_quaternion


def reasons(program) -> list[str]:
    return [str(diagnostic) for diagnostic in program.diagnostics]


def pose(xyz_mm, wxyz) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = matrix_from_quaternion(np.array(wxyz))
    T[:3, 3] = np.array(xyz_mm) / 1e3
    return T


NINE = "[9E9,9E9,9E9,9E9,9E9,9E9]"
