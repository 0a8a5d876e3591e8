"""A UR5's poses and points, known to the last digit, and files of them in any form."""

import numpy as np
from scipy.spatial.transform import Rotation

from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel

ROBOT = load_robot("ur5")
N = 12
Q = np.random.default_rng(0).uniform(-2, 2, (N, 6))
T = ErrorModel(ROBOT).poses(Q)
R = Rotation.from_euler("z", 0.7).as_matrix() @ T[:, :3, :3]
P = T[:, :3, 3] @ Rotation.from_euler("z", 0.7).as_matrix().T + R @ [0.02, 0.03, 0.1] + [2, -1, 0.3]
DEG, MM, WXYZ = np.degrees(Q), P * 1e3, Rotation.from_matrix(R).as_quat()[:, [3, 0, 1, 2]]
BARE = [f"J{k}" for k in range(1, 7)]
JOINTS, XYZ = [f"{joint}_deg" for joint in BARE], ["x_mm", "y_mm", "z_mm"]


def lines(*parts, separator=","):
    """The rows of a table from columns of numbers or one text a row."""
    columns = [np.reshape(part, (N, -1)) for part in parts]
    return [
        separator.join(f"{v:.9g}" if isinstance(v, float) else str(v) for c in columns for v in c[k].tolist())
        for k in range(N)
    ]


def write(folder, header, rows, encoding="utf-8"):
    path = folder / "file.csv"
    head = [",".join(header)] if header else []
    path.write_bytes("\r\n".join([*head, *rows, ""]).encode(encoding))
    return path
