"""Files of one simulated campaign, written in many forms."""

import numpy as np
from scipy.spatial.transform import Rotation

from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel

ROBOT = load_robot("ur5")


T_TRACKER_BASE = np.block(
    [[Rotation.from_euler("z", 0.7).as_matrix(), np.array([[2.0], [-1.0], [0.3]])], [np.zeros((1, 3)), 1]]
)


OFFSETS = {"A": np.array([0.02, 0.03, 0.1]), "B": np.array([-0.08, 0.0, 0.12])}


def measured(n=30, seed=0):
    """Joints, and where the nominal robot's targets are."""
    q = np.random.default_rng(seed).uniform(-2.0, 2.0, (n, 6))
    T = T_TRACKER_BASE @ ErrorModel(ROBOT).poses(q)
    return q, T, {name: (T[:, :3, :3] @ t) + T[:, :3, 3] for name, t in OFFSETS.items()}


def write(folder, name, header, rows):
    path = folder / name
    lines = [] if header is None else [header]
    path.write_text("\n".join([*lines, *(" ".join(map(str, row)) for row in rows)]) + "\n")
    return path


NAMED = " ".join(f"J{k}_deg" for k in range(1, 7))
