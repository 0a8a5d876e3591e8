"""Sensitivity of the TCP to every parameter, at every pose."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from taskcal.arguments import checked
from taskcal.campaigns.campaign import Campaign
from taskcal.geometry import se3
from taskcal.observations.base import TrackerNoise
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import ModelError, model_error_of
from taskcal.tables.frame import frame_of
from taskcal.virtual.cell import TRACKER_POSE

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, kw_only=True)
class Sensitivity:
    """S = ∂(TCP)/∂ξ in base axes (Gutiérrez et al., eq. 4)."""

    model: ErrorModel
    matrix: Float[np.ndarray, "n 3 p"]
    """Metres per metre and metres per radian."""

    def __repr__(self) -> str:
        return f"Sensitivity({self.model.robot.name}: {len(self.matrix)} poses, {len(self.model)} parameters)"

    def maximum(self, *, scaled: bool = False) -> Float[np.ndarray, "3 p"]:
        """Largest influence of each parameter on |X|, |Y| and |Z| over the poses.

        Args:
            scaled: multiply by each parameter's tolerance: metres that the defect to be expected moves the tool.
        """
        return self._weighted(np.abs(self.matrix).max(axis=0), scaled)

    def maximum_in_space(self, *, scaled: bool = False) -> Float[np.ndarray, " p"]:
        """Largest influence of each parameter in space over the poses."""
        return self._weighted(np.linalg.norm(self.matrix, axis=1).max(axis=0), scaled)

    def rms(self, *, scaled: bool = False) -> Float[np.ndarray, " p"]:
        """Root mean square influence in space over the poses."""
        return self._weighted(np.sqrt((self.matrix**2).sum(axis=1).mean(axis=0)), scaled)

    def rms_per_axis(self, *, scaled: bool = False) -> Float[np.ndarray, "3 p"]:
        """Root mean square influence on X, Y and Z over the poses."""
        return self._weighted(np.sqrt((self.matrix**2).mean(axis=0)), scaled)

    def _weighted(self, values: np.ndarray, scaled: bool) -> np.ndarray:
        return values * self.model.tolerances if scaled else values

    def to_shown(self) -> Float[np.ndarray, " p"]:
        """Factors from metres per SI unit to millimetres per shown unit of each parameter."""
        return np.array([1e3 / p.shown.factor for p in self.model.parameters])

    def to_frame(self) -> "pd.DataFrame":
        """A row per parameter: `columns`.

        Raises:
            TaskcalError: pandas is not installed.
        """
        return frame_of(self.columns())

    def columns(self) -> dict[str, Any]:
        """Largest influences of the parameters per unit (mm per mm, mm per mrad) and for their tolerances (µm)."""
        to_shown = self.to_shown()
        raw, scaled = self.maximum() * to_shown, self.maximum(scaled=True) * 1e6
        return {
            "parameter": self.model.names,
            "symbol": [p.symbol for p in self.model.parameters],
            "unit": [p.shown.influence for p in self.model.parameters],
            "max_x": raw[0],
            "max_y": raw[1],
            "max_z": raw[2],
            "max_space": self.maximum_in_space() * to_shown,
            "tolerance": [p.stated_tolerance for p in self.model.parameters],
            "max_x_um": scaled[0],
            "max_y_um": scaled[1],
            "max_z_um": scaled[2],
            "max_space_um": self.maximum_in_space(scaled=True) * 1e6,
            "rms_space_um": self.rms(scaled=True) * 1e6,
        }


@checked
def sensitivity(
    model: ErrorModel, q: Float[np.ndarray, "n joints"], x: Float[np.ndarray, " p"] | None = None
) -> Sensitivity:
    """Sensitivity of the TCP over some poses.

    Args:
        model: the model.
        q: joint positions, radians.
        x: parameter values; the nominal robot by default.

    Raises:
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    return Sensitivity(model=model, matrix=model.jacobian(q, x, angular=False))


# How far a measured point is off per axis: the tracker's noise, and what no parameter explains.


@dataclass(frozen=True, kw_only=True)
class MeasuringNoise:
    """Standard deviations per axis at every pose, metres."""

    tracker: float
    model_error: ModelError

    @property
    def total(self) -> float:
        """Standard deviation of both together, metres."""
        return float(np.hypot(self.tracker, self.model_error.position))

    def describe(self) -> str:
        """The parts in words, with the source of the model error."""
        return (
            f"{self.total * 1e3:.3g} mm per axis at every pose: tracker {self.tracker * 1e3:.2g} mm, model error "
            f"{self.model_error.position * 1e3:.3g} mm ({self.model_error.source})"
        )

    def summary(self) -> dict[str, Any]:
        """The report, in millimetres."""
        return {
            "noise_mm": self.total * 1e3,
            "tracker_mm": self.tracker * 1e3,
            "model_error_mm": self.model_error.position * 1e3,
            "model_error_origin": self.model_error.source,
        }


def measuring_noise(
    model: ErrorModel,
    q: Float[np.ndarray, "n joints"],
    campaign: Campaign | None = None,
    model_error: float | None = None,
) -> MeasuringNoise:
    """The noise of a campaign, or of one that a tracker four metres away would measure.

    Args:
        model: the model.
        q: joint positions, radians.
        campaign: measured there, if it was; its stated uncertainties count.
        model_error: standard deviation per axis, metres; by default that of the robot's file, or of a typical robot.
    """
    if campaign is None:
        covariance = TrackerNoise().covariance(se3.apply(TRACKER_POSE, model.poses(q)[:, :3, 3]))
    else:
        covariance = campaign.covariances()[campaign.valid][:, :3, :3]
    tracker = float(np.sqrt(np.trace(covariance, axis1=-2, axis2=-1).mean() / 3.0))
    return MeasuringNoise(tracker=tracker, model_error=model_error_of(model.robot, model_error))
