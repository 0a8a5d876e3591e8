"""A kind of observation: two inclinations of the tool against gravity, as an inclinometer on it shows them in degrees."""

from dataclasses import dataclass

import numpy as np

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.observations import Differential, Read, Scene, Standalone, Stated
from taskcal.robot.parameter import ShownUnit

FEWEST = 8
"""Rows, to find how the inclinometer sits on the tool without a guess."""

UNIT_LENGTH = 1e-3
"""Deviation of the vertical's length from one that is allowed: it changes no prediction."""

ASKEW = 0.05
"""1σ of how far a virtual inclinometer is turned from level at the middle of the poses, radians."""

UNLEVEL = 5e-3
"""1σ of how far the z axis of the measuring frame leans from the vertical in a virtual cell, radians."""

COLUMNS = ("tilt x", "tilt y")


@dataclass(frozen=True, eq=False, kw_only=True)
class Inclinations(Standalone):
    """a = atan2(u_x, u_z), b = atan2(u_y, u_z) with the vertical u = Sᵀ·g in the axes S of the inclinometer.

    Unknown are the vertical g in the measuring frame, and how the inclinometer is turned on the tool; where it sits does not
    matter. It determines joint angles and no lengths.
    """

    key = "inclination"
    instrument = "inclinometer"
    width = 2
    angles = 2
    turned = True
    turn_resolution = np.radians(0.003)  # of a good two-axis inclinometer
    needed = COLUMNS
    columns = {name: (name, f"inclination {name[-1]}") for name in COLUMNS}  # noqa: RUF012
    units = dict.fromkeys(("gx", "gy", "gz"), ShownUnit("", 1.0))

    @property
    def unknowns(self):
        """The vertical in the measuring frame."""
        return ("vertical.gx", "vertical.gy", "vertical.gz")

    @property
    def tells_scale(self):
        """No length is known."""
        return False

    @property
    def shrinks(self):
        """A robot of any size has the same angles."""
        return True

    def differentiate(self, target, unknown, measured):
        """Residual and derivatives."""
        back = np.swapaxes(target[:, :3, :3], 1, 2)
        u = back @ unknown
        by_u = np.zeros((len(u), 2, 3))
        for row in range(2):
            square = u[:, row] ** 2 + u[:, 2] ** 2
            by_u[:, row, row], by_u[:, row, 2] = u[:, 2] / square, -u[:, row] / square
        by_target = np.zeros((len(u), 2, 6))
        by_target[:, :, 3:] = by_u @ back @ np.cross(np.eye(3), unknown)
        predicted = np.arctan2(u[:, :2], u[:, 2:])
        return Differential(measured.points[:, :2] - predicted, by_target, by_u @ back)

    def stated(self, unknown):
        """The vertical has the length one."""
        length = np.linalg.norm(unknown)
        return Stated(np.array([1.0 - length]), unknown[None] / length, np.array([UNIT_LENGTH]))

    def settle(self, target, measured, known):
        """The vertical where the inclinometer's poses are known."""
        seen = measured.valid
        mean = (target[seen, :3, :3] @ _vertical(measured.points[seen])[:, :, None]).mean(axis=0)[:, 0]
        return mean / np.linalg.norm(mean)

    def check(self, rows):
        """See that there are inclinations enough."""
        if len(rows.tool) < FEWEST:
            raise CampaignError(
                f"{len(rows.tool)} inclinations do not tell how the inclinometer is turned; read {FEWEST} or more"
            )

    def starts(self, rows):
        """From Q·u = Rᵀ·g, which is linear in the sensor's axes Q and in the vertical g; its place does not matter."""
        R, u = rows.tool[:, :3, :3], _vertical(rows.measured.points)
        A = np.zeros((len(u), 3, 12))
        for axis in range(3):
            A[:, axis, 3 * axis : 3 * axis + 3] = u
        A[:, :, 9:] = -np.swapaxes(R, 1, 2)
        x = np.linalg.svd(A.reshape(-1, 12))[2][-1]
        x = x * np.sign(np.linalg.det(x[:9].reshape(3, 3)))
        Q = se3.nearest_rotation(x[:9].reshape(3, 3))
        yield rows.about(se3.pose(Q, np.zeros(3)), x[9:] / np.linalg.norm(x[9:]))

    @classmethod
    def stage(cls, tool, places, rng):
        """An inclinometer that is nearly level at the middle of the poses."""
        middle = se3.nearest_rotation(tool[:, :3, :3].mean(axis=0))
        vertical = np.array([*(UNLEVEL * rng.normal(size=2)), 1.0])
        mounted = se3.pose(middle.T @ se3.exp(ASKEW * rng.normal(size=3)), np.zeros(3))
        return Scene(cls(), "inclinometer", mounted, vertical / np.linalg.norm(vertical))

    @classmethod
    def read(cls, columns):
        """Two inclinations in every row that has both."""
        if not all(name in columns for name in COLUMNS):
            return None
        angles = np.stack([columns.angles(name) for name in COLUMNS], axis=1)
        there = np.isfinite(angles)
        for row in np.flatnonzero(there.any(axis=1) & ~there.all(axis=1)):
            raise columns.error("an inclination in x and one in y belong together", int(row), COLUMNS[0])
        if not there.any():
            return None
        return Read("inclinometer", cls(), np.where(there[:, :1], np.pad(angles, ((0, 0), (0, 1))), np.nan))

    def cells(self, measured):
        """Both inclinations of every row."""
        degrees = np.degrees(measured.points)
        return {
            f"{name.replace(' ', '_')}_deg": ["" if np.isnan(v) else f"{v:.6f}" for v in degrees[:, axis]]
            for axis, name in enumerate(COLUMNS)
        }


def _vertical(angles):
    """Unit vectors to the zenith in the axes of the inclinometer, from its readings."""
    u = np.column_stack([np.tan(angles[:, 0]), np.tan(angles[:, 1]), np.ones(len(angles))])
    return u / np.linalg.norm(u, axis=1)[:, None]
