"""The publication's chain as its equations print it, misprint included, for tests of what its authors may have computed.

Gutiérrez, Chanal, Durieux, Duc, eq. 1 and 2: ⁴T₅ is printed with −cos q5 in row 3, column 2, where a rotation has
+cos q5. Nothing of the product is built from this.
"""

from dataclasses import dataclass

import numpy as np

from taskcal.geometry import se3
from taskcal.geometry.four_bar import FourBar, close_four_bar

RL1, D2, D3, D4, RL4, RL6 = 0.8145, 0.3, 0.7, 0.28, 0.893, 0.2
SPINDLE = np.array([[0.0, 0.0, 1.0, 0.25], [0.0, 1.0, 0.0, 0.03], [-1.0, 0.0, 0.0, 0.12], [0.0, 0.0, 0.0, 1.0]])
STEP = 1e-6
"""Of central differences, metres and radians."""


@dataclass(frozen=True)
class PrintedChain:
    """The 45 parameters in the publication's order: six of each joint, six of the spindle, L1, L2, L3."""

    misprint: bool
    """⁴T₅ as printed; else as a rotation."""
    loop: tuple[float, float, float]
    """Nominal crank, rod and rocker, metres."""

    def poses(self, q: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Spindle in the base, (n, 4, 4), at motor angles q (n, 6) and parameters x (45), radians and metres."""
        crank, rod, rocker = np.array(self.loop) + x[42:]
        theta = close_four_bar(FourBar(crank=crank, rod=rod, rocker=rocker, arm=D3), q[:, 1], q[:, 2]).angle
        chain = [
            _matrices(q[:, 0], "c -s 0", "s c 0", "0 0 1", (0.0, 0.0, RL1)),
            _matrices(q[:, 1] - np.pi / 2, "c -s 0", "0 0 1", "-s -c 0", (D2, 0.0, 0.0)),
            _matrices(theta - q[:, 1], "c -s 0", "s c 0", "0 0 1", (D3, 0.0, 0.0)),
            _matrices(q[:, 3], "c -s 0", "0 0 1", "-s -c 0", (D4, RL4, 0.0)),
            _matrices(q[:, 4], "c -s 0", "0 0 -1", "s -c 0" if self.misprint else "s c 0", (0.0, 0.0, 0.0)),
            _matrices(q[:, 5] + np.pi, "c -s 0", "0 0 1", "-s -c 0", (0.0, RL6, 0.0)),
        ]
        T = np.eye(4)
        for joint, matrices in enumerate(chain):
            T = T @ matrices @ se3.error_transform(x[6 * joint : 6 * joint + 6])
        return T @ SPINDLE @ se3.error_transform(x[36:42])

    def sensitivity(self, q: np.ndarray) -> np.ndarray:
        """∂X/∂ξ of the TCP by central differences, stacked: (3n, 45)."""
        steps = STEP * np.eye(45)
        columns = [(self.poses(q, e)[:, :3, 3] - self.poses(q, -e)[:, :3, 3]).reshape(-1) / (2.0 * STEP) for e in steps]
        return np.stack(columns, axis=1)


def _matrices(angle: np.ndarray, *rows: str | tuple[float, float, float]) -> np.ndarray:
    """Matrices from printed rows such as ``c -s 0``, and a translation last."""
    values = {
        "c": np.cos(angle),
        "s": np.sin(angle),
        "-c": -np.cos(angle),
        "-s": -np.sin(angle),
        "0": 0.0,
        "1": 1.0,
        "-1": -1.0,
    }
    T = np.zeros((len(angle), 4, 4))
    for i, row in enumerate(rows[:3]):
        assert isinstance(row, str)
        for j, entry in enumerate(row.split()):
            T[:, i, j] = values[entry]
    T[:, :3, 3] = rows[3]
    T[:, 3, 3] = 1.0
    return T
