"""Which frame, which tool: how what the robot holds stands to what stands still, on the robot as calibrated.

A path is accurate relative to something. What stands still is known in the calibrated base as the controller has it, or was
measured by the tracker, or was touched by the robot itself, whose errors there then cancel in part. What the robot holds is
known where the controller has it in the flange, or by the reflectors that were measured on it.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.correction.cell import Cell
from taskcal.correction.fixed_frame import FixedFrame, fixed_frame
from taskcal.correction.grasped_frame import GraspedFrame, columns_of, grasped_frame
from taskcal.correction.placement import Placement
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.programs.program import Move
from taskcal.robot.conditions import Conditions

CHUNK_POSES = 4096
"""Poses whose derivatives are held at once; those of 10⁵ would take 300 MB."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FrameCalibration:
    """A tool and a part, on the robot as calibrated."""

    calibration: Calibration
    grasped: GraspedFrame
    fixed: FixedFrame
    part_in_hand: bool

    @property
    def statement(self) -> str:
        """What the accuracy is relative to, in words."""
        return f"{self.grasped.statement}; {self.fixed.statement}"

    @property
    def placement(self) -> Placement:
        """Where both are."""
        return Placement(
            T_tool_grasped=self.grasped.T_tool_grasped,
            T_base_fixed=self.fixed.T_base_fixed,
            part_in_hand=self.part_in_hand,
        )

    def covariance(
        self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None
    ) -> Float[np.ndarray, "n 3 3"]:
        """Covariance of where the grasped frame's origin is against the fixed frame, in the fixed frame's axes, metres².

        The model error of a single new pose is not in it.

        Args:
            q: joint positions, radians.
            conditions: how the poses are reached, for effects that depend on it.
        """
        calibration = self.calibration
        J = self.grasped.twists(q, conditions)[:, :3]
        if self.fixed.follows_base:
            J = J.copy()
            J[:, :, columns_of(calibration, "base.")] = 0.0
        elif self.fixed.twist is not None:
            T = self._grasped_poses(q)
            twist = np.broadcast_to(self.fixed.twist, (len(q), *self.fixed.twist.shape))
            J = J - se3.carry(twist, T[:, :3, 3])[:, :3]
        R = (calibration.T_tracker_base @ self.fixed.T_base_fixed)[:3, :3]
        J = R.T @ J
        by_estimate = J @ calibration.z_covariance @ np.swapaxes(J, 1, 2)
        R_fixed_grasped = R.T @ self._grasped_poses(q)[:, :3, :3]
        grasped = R_fixed_grasped @ self.grasped.covariance @ np.swapaxes(R_fixed_grasped, 1, 2)
        return by_estimate + grasped + R.T @ self._fixed_covariance(q) @ R

    def points(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 3"]:
        """The grasped frame's origin in the fixed frame, metres."""
        return (se3.inverse(self.calibration.T_tracker_base @ self.fixed.T_base_fixed) @ self._grasped_poses(q))[
            :, :3, 3
        ]

    def spread(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 3 k"]:
        """Errors of the grasped frame's origin by independent causes of one standard deviation each, metres.

        They go together at all poses, so that what poses have in common can be taken out; in the fixed frame's axes, and without
        what is not known of the fixed frame itself.
        """
        R = (self.calibration.T_tracker_base @ self.fixed.T_base_fixed)[:3, :3].T
        values, vectors = np.linalg.eigh(self.calibration.z_covariance)
        by_estimate = R @ self.grasped.twists(q, None)[:, :3] @ (vectors * np.sqrt(np.maximum(values, 0.0)))
        values, vectors = np.linalg.eigh(self.grasped.covariance)
        held = R @ self._grasped_poses(q)[:, :3, :3] @ (vectors * np.sqrt(np.maximum(values, 0.0)))
        return np.concatenate([by_estimate, held], axis=2)

    def _grasped_poses(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 4 4"]:
        """Poses of the grasped frame in the tracker's."""
        return self.calibration.predict_tool(q) @ self.grasped.T_tool_grasped

    def _fixed_covariance(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 3 3"]:
        """Of what stands still, at the grasped frame's origin, by how it was measured; tracker axes, metres²."""
        at = self._grasped_poses(q)[:, :3, 3]
        arm = se3.carry(np.broadcast_to(np.eye(6), (len(q), 6, 6)), at)[:, :3]
        return arm @ self.fixed.covariance @ np.swapaxes(arm, 1, 2)

    def uncertainty(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, " n"]:
        """Root mean square of the error in space that the calibration must expect at joint positions, metres.

        What the parameters do not tell, and what the model cannot explain at a new pose.
        """
        return np.sqrt(self.variances(q).sum(axis=1))

    def variances(
        self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None
    ) -> Float[np.ndarray, "n sources"]:
        """The square of the uncertainty by where it comes from, in the order of `SOURCES`, metres².

        Of the geometry is what the calibration does not know of its own targets in the tracker's frame; of the tool, what
        comes to that for what is held; of the part, what comes to that for what stands still. What falls, because both are
        in error alike, is counted as nothing.

        Args:
            q: joint positions, radians.
            conditions: how the poses are reached, for effects that depend on it.
        """
        geometry, grasped, total = (np.zeros(len(q)) for _ in range(3))
        for part in _chunks(len(q)):
            there = None if conditions is None else conditions.take(part)
            covariance = self.calibration.predict_covariance(q[part], there, model_error=False)[..., :3, :3]
            geometry[part] = _total(covariance).mean(axis=1)
            grasped[part] = _total(self._grasped_covariance(q[part], there))
            total[part] = _total(self.covariance(q[part], there))
        parts = np.stack([geometry, grasped - geometry, total - grasped], axis=1)
        parts = np.maximum(parts, 0.0)
        parts *= (total / np.maximum(parts.sum(axis=1), 1e-300))[:, None]
        return np.stack([parts[:, 0], self.model_variance(q), parts[:, 1], parts[:, 2]], axis=1)

    def _grasped_covariance(
        self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None
    ) -> Float[np.ndarray, "n 3 3"]:
        """Of what is held, in the tracker's frame, metres²."""
        J = self.grasped.twists(q, conditions)[:, :3]
        R = self._grasped_poses(q)[:, :3, :3]
        by_estimate = J @ self.calibration.z_covariance @ np.swapaxes(J, 1, 2)
        return by_estimate + R @ self.grasped.covariance @ np.swapaxes(R, 1, 2)

    def model_variance(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, " n"]:
        """Of what the model cannot explain at a new pose, in space, metres²."""
        if self.calibration.field is None:
            return np.full(len(q), 3.0 * self.calibration.model_error[0] ** 2)
        return self.calibration.field.variance(q)[:, :3].sum(axis=1)


def _chunks(n: int) -> list[slice]:
    return [slice(first, first + CHUNK_POSES) for first in range(0, n, CHUNK_POSES)]


def _total(covariance: Float[np.ndarray, "*b 3 3"]) -> Float[np.ndarray, "*b"]:
    return np.trace(covariance, axis1=-2, axis2=-1)


def calibrate_frames(calibration: Calibration, move: Move, cell: Cell) -> FrameCalibration:
    """Where a motion's tool and part are, on the robot as calibrated.

    Raises:
        TaskcalError: what was measured of them does not fit to what they are used for, or to the calibration.
    """
    tool, part = cell.tool(move.tool.name), cell.part(move.part.name)
    grasped, fixed = (part, tool) if move.part_in_hand else (tool, part)
    stated_grasped, stated_fixed = (move.part, move.tool) if move.part_in_hand else (move.tool, move.part)
    if stated_fixed.moved and (fixed.in_tracker is not None or fixed.touched is not None):
        raise TaskcalError(
            f"{move.place}: '{fixed.name}' was measured with the external axes at zero, and here one is away from it: take tracker "
            "or touched_deg out of the cell file, or give the axes' positions at zero a program of their own"
        )
    return FrameCalibration(
        calibration=calibration,
        grasped=grasped_frame(calibration, grasped, stated_grasped.T),
        fixed=fixed_frame(calibration, fixed, stated_fixed.T, cell),
        part_in_hand=move.part_in_hand,
    )
