"""What is handed to another program, and what of the calibration is lost by its form."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.public_names import FormerName
from taskcal.short_repr import short_repr

ROUNDING = 1e-8
"""Metres at the tool that the digits of a file may cost."""


@dataclass(frozen=True, kw_only=True)
class Loss:
    """Distance of a form's tool point from the calibration's, metres."""

    rms: float
    maximum: float
    poses: int
    reasons: tuple[str, ...]
    """What the form cannot hold."""

    @classmethod
    def of(
        cls,
        calibration: Calibration,
        q: Float[np.ndarray, "n joints"],
        predicted: Float[np.ndarray, "n 4 4"],
        lacking: tuple[str, ...] = (),
    ) -> "Loss":
        """Of the poses that a form predicts at joint positions q; `lacking` is what it cannot hold of any calibration."""
        off = np.linalg.norm(predicted[:, :3, 3] - calibration.tool_in_base(q)[:, :3, 3], axis=1)
        model = calibration.model
        reasons = [*lacking, *(effect.name for effect in model.effects)]
        if model.robot.four_bar is not None:
            reasons.append("the four-bar of its drive, where it is no parallelogram")
        if calibration.field is not None:
            reasons.append("the residual field")
        rms, maximum = float(np.sqrt(np.mean(off**2))), float(off.max())
        return cls(rms=rms, maximum=maximum, poses=len(q), reasons=tuple(reasons) if maximum > ROUNDING else ())

    def refuse(self, form: str) -> None:
        """Refuse a form that loses more than its digits.

        Raises:
            TaskcalError: it does; the message says what and how much.
        """
        if self.maximum <= ROUNDING:
            return
        raise TaskcalError(
            f"{form} cannot hold {', '.join(self.reasons) or 'this chain'}: {self.rms * 1e3:.4f} mm (rms) and "
            f"{self.maximum * 1e3:.4f} mm (largest) would be lost over {self.poses} poses; identify without them for this form, "
            "correct programs with the whole model (taskcal correct), or accept the loss (--accept-loss)"
        )

    def summary(self) -> dict[str, Any]:
        """The report, in millimetres."""
        return {
            "rms_mm": self.rms * 1e3,
            "max_mm": self.maximum * 1e3,
            "poses": self.poses,
            "not_held": list(self.reasons),
        }

    to_json = FormerName("summary")


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Export:
    """A file for another program."""

    text: str
    loss: Loss
    frames: Mapping[str, Float[np.ndarray, "4 4"]]
    """Poses that belong to the file and stand beside it: of its base in the robot's, of the tool in its last frame."""
    remarks: tuple[str, ...] = ()


def placed(T: Float[np.ndarray, "4 4"]) -> dict[str, Any]:
    """A pose in millimetres, as a quaternion and as angles about fixed x, y, z (``rpy_deg``)."""
    R = T[:3, :3]
    pitch = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
    rpy = [np.arctan2(R[2, 1], R[2, 2]), pitch, np.arctan2(R[1, 0], R[0, 0])]
    return {
        "position_mm": [float(value) * 1e3 for value in T[:3, 3]],
        "quaternion": se3.to_quaternion(R[None])[0].tolist(),
        "rpy_deg": np.degrees(rpy).tolist(),
    }
