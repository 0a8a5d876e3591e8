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
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.programs.program import Move

CHUNK = 4096
"""Poses whose derivatives are held at once; those of 10⁵ would take 300 MB."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FrameCalibration:
    """A tool and a part, on the robot as calibrated."""

    calibration: Calibration
    held: GraspedFrame
    standing: FixedFrame
    part_in_hand: bool

    @property
    def statement(self) -> str:
        """What the accuracy is relative to, in words."""
        return f"{self.held.statement}; {self.standing.statement}"

    @property
    def placement(self) -> Placement:
        """Where both are."""
        return Placement(
            T_tool_held=self.held.T_tool_held,
            T_base_standing=self.standing.T_base_standing,
            part_in_hand=self.part_in_hand,
        )

    def covariance(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 3 3"]:
        """Covariance of where the held origin is against what stands still, in the standing frame's axes, metres².

        The model error of a single new pose is not in it.
        """
        calibration = self.calibration
        J = self.held.twists(q)[:, :3]
        if self.standing.follows_base:
            J = J.copy()
            J[:, :, columns_of(calibration, "base.")] = 0.0
        elif self.standing.twist is not None:
            T = calibration.predict_tool(q) @ self.held.T_tool_held
            twist = np.broadcast_to(self.standing.twist, (len(q), *self.standing.twist.shape))
            J = J - se3.carry(twist, T[:, :3, 3])[:, :3]
        R = (calibration.T_tracker_base @ self.standing.T_base_standing)[:3, :3]
        J = R.T @ J
        known = J @ calibration.z_covariance @ np.swapaxes(J, 1, 2)
        R_standing_held = R.T @ (calibration.predict_tool(q) @ self.held.T_tool_held)[:, :3, :3]
        held = R_standing_held @ self.held.covariance @ np.swapaxes(R_standing_held, 1, 2)
        return known + held + R.T @ self._fixed_covariance(q) @ R

    def _fixed_covariance(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 3 3"]:
        """Of what stands still, at the held origin, by how it was measured; tracker axes, metres²."""
        at = (self.calibration.predict_tool(q) @ self.held.T_tool_held)[:, :3, 3]
        arm = se3.carry(np.broadcast_to(np.eye(6), (len(q), 6, 6)), at)[:, :3]
        return arm @ self.standing.covariance @ np.swapaxes(arm, 1, 2)

    def uncertainty(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, " n"]:
        """Root mean square of the error in space that the calibration must expect at joint positions, metres.

        What the parameters do not tell, and what the model cannot explain at a new pose.
        """
        variance = np.zeros(len(q))
        for first in range(0, len(q), CHUNK):
            part = slice(first, first + CHUNK)
            variance[part] = np.trace(self.covariance(q[part]), axis1=1, axis2=2)
        if self.calibration.field is None:
            variance += 3.0 * self.calibration.model_error[0] ** 2
        else:
            variance += self.calibration.field.variance(q)[:, :3].sum(axis=1)
        return np.sqrt(variance)


def calibrate_frames(calibration: Calibration, move: Move, cell: Cell) -> FrameCalibration:
    """Where a motion's tool and part are, on the robot as calibrated.

    Raises:
        TaskcalError: what was measured of them does not fit to what they are used for, or to the calibration.
    """
    tool, part = cell.tool(move.tool.name), cell.part(move.part.name)
    held, standing = (part, tool) if move.part_in_hand else (tool, part)
    held_frame, standing_frame = (move.part, move.tool) if move.part_in_hand else (move.tool, move.part)
    return FrameCalibration(
        calibration=calibration,
        held=grasped_frame(calibration, held, held_frame.T),
        standing=fixed_frame(calibration, standing, standing_frame.T, cell),
        part_in_hand=move.part_in_hand,
    )
