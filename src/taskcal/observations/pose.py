"""A frame on the tool, measured in the tracker's frame."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.observations.base import Differential, Measured, Observation, TrackerNoise
from taskcal.observations.point import Point

TURN_PRIOR = 1e-3
"""Expected size of the turn between an instrument's rotations and positions, radians: a twentieth of a degree."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Pose(Observation):
    """Y = T: a six-dimensional target, or a board on the tool in front of a fixed camera."""

    key: ClassVar[str] = "pose"
    width: ClassVar[int] = 6
    angles: ClassVar[int] = 3
    oriented: ClassVar[bool] = True
    turned: ClassVar[bool] = True
    along_axes: ClassVar[bool] = True
    in_tracker: ClassVar[bool] = True
    aligned: bool = False
    """Whether rotations are known to be measured in the axes of the positions."""

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Rotation of the instrument's rotations against the axes of its positions."""
        return () if self.aligned else ("orientation.rx", "orientation.ry", "orientation.rz")

    @property
    def deviations(self) -> Float[np.ndarray, " u"]:
        """A twentieth of a degree."""
        return np.full(len(self.unknowns), TURN_PRIOR)

    def differentiate(
        self, target: Float[np.ndarray, "n 4 4"], unknown: Float[np.ndarray, " u"], measured: Measured
    ) -> Differential:
        """Residual and derivatives."""
        assert measured.rotations is not None
        n, seen, unknown = len(target), measured.valid, np.zeros(3) if self.aligned else unknown
        turned = np.zeros((n, 3))
        turn = se3.exp(unknown)
        turned[seen] = se3.log(measured.rotations[seen] @ np.swapaxes(turn @ target[seen, :3, :3], 1, 2))
        by_target, by_unknown = np.zeros((n, 6, 6)), np.zeros((n, 6, 3))
        by_target[:, :3, :3] = np.eye(3)
        by_turn = turn_by_rotation(turned)
        by_target[:, 3:, 3:], by_unknown[:, 3:] = by_turn @ turn, by_turn @ se3.left_jacobian(unknown)
        residual = np.concatenate([measured.points - target[:, :3, 3], turned], axis=1)
        return Differential(residual, by_target, by_unknown[:, :, : len(self.unknowns)])

    def covariance(
        self, measured: Measured, uncertainty: Float[np.ndarray, " n"] | None, tracker: TrackerNoise
    ) -> Float[np.ndarray, "n w w"]:
        """Covariance of the noise of each row."""
        out = np.zeros((len(measured.points), 6, 6))
        out[:, :3, :3] = Point().covariance(measured, uncertainty, tracker)
        out[:, 3:, 3:] = tracker.rotation**2 * np.eye(3)
        return out


def turn_by_rotation(r: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3 3"]:
    """Derivative of −log(exp(r)·exp(−w)) by the rotation w at zero: the inverse of the right Jacobian, 1 + [r]/2 + c·[r]².

    c = 1/θ² − (1 + cos θ)/(2·θ·sin θ) (Solà, Deray and Atchuthan 2018, eq. 144).
    """
    angle = np.linalg.norm(r, axis=1)
    safe = np.where(angle > 1e-4, angle, 1.0)
    c = np.where(angle > 1e-4, 1.0 / safe**2 - (1.0 + np.cos(safe)) / (2.0 * safe * np.sin(safe)), 1.0 / 12.0)
    cross = np.cross(np.eye(3), r[:, None, :])
    return np.eye(3) + 0.5 * cross + c[:, None, None] * (cross @ cross)
