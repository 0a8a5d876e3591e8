"""What measured points lie off what was predicted, in the form a metrologist reports it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.measurement.observation import Compared


@dataclass(frozen=True, eq=False, kw_only=True)
class Validation:
    """Position errors, measured less predicted."""

    errors: Float[np.ndarray, " points"]
    """Length of every point's error, metres."""
    components: Float[np.ndarray, "points 3"]
    """The errors in the axes of the robot's base, metres."""
    rotations: Float[np.ndarray, " points"] | None
    """Angle of every pose's orientation error, radians; None for points."""
    rows: tuple[int, ...]
    """Row of the campaign that each point belongs to."""
    remarks: tuple[str, ...] = ()
    """What a user should look at before believing the result."""
    compared: tuple[Compared, ...] = ()
    """Lengths that are stated, such as distances of sockets, beside those that were found."""

    def __repr__(self) -> str:
        remarks = f", {len(self.remarks)} remarks" if self.remarks else ""
        return (
            f"Validation({len(self)} points: mean {self.mean * 1e3:.4f} mm, rms {self.rms * 1e3:.4f} mm, 95 % "
            f"{self.p95 * 1e3:.4f} mm, largest {self.maximum * 1e3:.4f} mm{remarks})"
        )

    @classmethod
    def of_residuals(
        cls, residual: Float[np.ndarray, "n targets b"], base: Float[np.ndarray, "3 3"], remarks: tuple[str, ...] = ()
    ) -> "Validation":
        """Errors from residuals in the tracker's frame.

        Args:
            residual: measured less predicted, metres (then radians, for poses); NaN for lost beams.
            base: rotation of the robot's base in the tracker frame.
            remarks: what a user should look at before believing the result.
        """
        rows, targets = np.nonzero(~np.isnan(residual[..., 0]))
        error, turn = residual[rows, targets, :3], residual[rows, targets, 3:]
        return cls(
            errors=np.linalg.norm(error, axis=1),
            components=error @ base,
            rotations=np.linalg.norm(turn, axis=1) if turn.shape[1] else None,
            rows=tuple(int(row) for row in rows),
            remarks=remarks,
        )

    def __len__(self) -> int:
        return len(self.errors)

    @property
    def mean(self) -> float:
        """Mean error in space, metres."""
        return float(self.errors.mean())

    @property
    def rms(self) -> float:
        """Root mean square of the error in space, metres."""
        return float(np.sqrt(np.mean(self.errors**2)))

    @property
    def p95(self) -> float:
        """Error in space that 95 % of the points stay below, metres."""
        return float(np.percentile(self.errors, 95))

    @property
    def maximum(self) -> float:
        """Largest error in space, metres."""
        return float(self.errors.max())

    @property
    def per_axis(self) -> Float[np.ndarray, " 3"]:
        """Largest |x|, |y| and |z| in the robot's base axes, metres."""
        return np.abs(self.components).max(axis=0)

    def summary(self) -> dict[str, float | int]:
        """The report in millimetres (and milliradians)."""
        x, y, z = self.per_axis * 1e3
        out: dict[str, float | int] = {
            "mean_mm": self.mean * 1e3,
            "rms_mm": self.rms * 1e3,
            "p95_mm": self.p95 * 1e3,
            "max_mm": self.maximum * 1e3,
            "max_x_mm": float(x),
            "max_y_mm": float(y),
            "max_z_mm": float(z),
            "n": len(self),
        }
        if self.rotations is not None:
            out["mean_mrad"] = float(self.rotations.mean() * 1e3)
            out["max_mrad"] = float(self.rotations.max() * 1e3)
        if self.compared:
            off = np.abs([one.found - one.stated for one in self.compared]) * 1e3
            out["distance_mean_mm"], out["distance_max_mm"] = float(off.mean()), float(off.max())
        return out
