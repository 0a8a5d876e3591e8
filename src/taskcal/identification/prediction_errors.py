"""What measured points lie off what was predicted, in the form a metrologist reports it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.measurement.observation import Compared, Observation


@dataclass(frozen=True, eq=False, kw_only=True)
class Validation:
    """Errors, measured less predicted."""

    errors: Float[np.ndarray, " points"]
    """Length of every point's error, metres."""
    components: Float[np.ndarray, "points 3"]
    """The errors in the axes of the robot's base, metres; NaN for kinds of observation that measure along no axes of it."""
    rotations: Float[np.ndarray, " points"] | None
    """Angle of every pose's orientation error, radians; None for points."""
    rows: tuple[int, ...]
    """Row of the campaign that each point belongs to."""
    in_space: bool = True
    """Whether every error is a distance in space; of a kind that measures one number, such as a length, it is that number's."""
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
        cls,
        residual: Float[np.ndarray, "n targets b"],
        base: Float[np.ndarray, "3 3"],
        kinds: Sequence[type[Observation]] = (),
    ) -> "Validation":
        """Errors from residuals in the tracker's frame.

        Args:
            residual: measured less predicted, metres (then radians, for poses); NaN for lost beams.
            base: rotation of the robot's base in the tracker frame.
            kinds: of observation of each target; none where a tracker measured all.
        """
        rows, targets = np.nonzero(~np.isnan(residual[..., 0]))
        error, turn = residual[rows, targets, :3], residual[rows, targets, 3:]
        components = error @ base
        components[~np.array([kind.along_axes for kind in kinds] or [True] * residual.shape[1])[targets]] = np.nan
        return cls(
            errors=np.linalg.norm(error, axis=1),
            components=components,
            rotations=np.linalg.norm(turn, axis=1) if turn.shape[1] else None,
            rows=tuple(int(row) for row in rows),
            in_space=all(kind.width >= 3 for kind in kinds),
        )

    def __len__(self) -> int:
        return len(self.errors)

    @property
    def mean(self) -> float:
        """Mean error, metres."""
        return float(self.errors.mean())

    @property
    def rms(self) -> float:
        """Root mean square of the error, metres."""
        return float(np.sqrt(np.mean(self.errors**2)))

    @property
    def p95(self) -> float:
        """Error that 95 % of the points stay below, metres."""
        return float(np.percentile(self.errors, 95))

    @property
    def maximum(self) -> float:
        """Largest error, metres."""
        return float(self.errors.max())

    @property
    def per_axis(self) -> Float[np.ndarray, " 3"]:
        """Largest |x|, |y| and |z| in the robot's base axes, metres; NaN where nothing was measured along them."""
        along = self.components[~np.isnan(self.components[:, 0])]
        return np.abs(along).max(axis=0) if len(along) else np.full(3, np.nan)

    @property
    def has_axes(self) -> bool:
        """Whether anything was measured along the axes of the robot's base."""
        return not np.isnan(self.components).all()

    def summary(self) -> dict[str, float | int]:
        """The report in millimetres (and milliradians), without the axes where nothing was measured along them."""
        out: dict[str, float | int] = {
            "mean_mm": self.mean * 1e3,
            "rms_mm": self.rms * 1e3,
            "p95_mm": self.p95 * 1e3,
            "max_mm": self.maximum * 1e3,
        }
        if self.has_axes:
            out |= {f"max_{axis}_mm": float(value) * 1e3 for axis, value in zip("xyz", self.per_axis, strict=True)}
        out["n"] = len(self)
        if self.rotations is not None:
            out["mean_mrad"] = float(self.rotations.mean() * 1e3)
            out["max_mrad"] = float(self.rotations.max() * 1e3)
        if self.compared:
            off = np.abs([one.found - one.stated for one in self.compared]) * 1e3
            out["distance_mean_mm"], out["distance_max_mm"] = float(off.mean()), float(off.max())
        return out
