"""A calibration put to the test by a campaign that it has not seen: point by point, with what it stated of its own uncertainty."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import CampaignError
from taskcal.identification.calibration import Calibration
from taskcal.identification.outlier import Outlier, shared_with_neighbours, studentise
from taskcal.identification.prediction_errors import Validation
from taskcal.identification.validation import errors_on, reregister_frames, validate
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.tracker import TrackerNoise
from taskcal.short_repr import short_repr

REGION = 0.95
"""Share of points that a stated region is to hold."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Examination:
    """Every measured point beside what was predicted of it."""

    campaign: Campaign
    validation: Validation
    targets: Int[np.ndarray, " points"]
    """Number of each point's target in the campaign."""
    uncertainty: Float[np.ndarray, " points"]
    """Standard uncertainty of the measurement along each error, metres."""
    signed: Float[np.ndarray, " points"]
    """Each error with its sign where one number was measured, metres; NaN where more were."""
    studentised: Float[np.ndarray, " points"] | None
    """Length of each error (rotation included, for poses) over its stated standard deviation; None where the frames were
    refitted, or what stands was found anew, for which the calibration states nothing."""
    inside: Bool[np.ndarray, " points"] | None
    """Whether each position is in the 95 % region that is stated for it, the tracker's noise included."""
    rotation_inside: Bool[np.ndarray, " points"] | None
    """The same of each rotation; None for points."""
    outliers: tuple[Outlier, ...]
    """Points too far off for chance, the worst first."""
    shared: tuple[bool, ...] = ()
    """Whether neighbouring rows or poses have much the same error as each outlier, as those do that a model leaves."""

    @property
    def worst_first(self) -> Int[np.ndarray, " points"]:
        """Numbers of the points by their error."""
        return np.argsort(-self.validation.errors, kind="stable")

    def points(self) -> list[dict[str, Any]]:
        """Every point in millimetres and milliradians, in the order of the campaign.

        Of a kind that measures one number its error with its sign; along the axes of the base only what was measured along them.
        """
        return [self._point(k) for k in range(len(self.validation))]

    def _point(self, k: int) -> dict[str, Any]:
        validation, row = self.validation, self.validation.rows[k]
        out: dict[str, Any] = {
            "row": self.campaign.row_of(row),
            "line": self.campaign.line_of(row),
            "id": self.campaign.ids[row],
            "target": self.campaign.targets[self.targets[k]],
            "error_mm": float(validation.errors[k]) * 1e3,
        }
        if np.isfinite(self.signed[k]):
            out["signed_mm"] = float(self.signed[k]) * 1e3
        if np.isfinite(validation.components[k]).all():
            out |= {
                f"{axis}_mm": float(value) * 1e3 for axis, value in zip("xyz", validation.components[k], strict=True)
            }
        if validation.rotations is not None:
            out["error_mrad"] = float(validation.rotations[k]) * 1e3
        if self.studentised is not None and self.inside is not None:
            out |= {"studentised": float(self.studentised[k]), "inside": bool(self.inside[k])}
        return out

    def summary(self) -> dict[str, Any]:
        """What `Validation.summary` says, the share inside the stated regions, the outliers, and every point."""
        compared = [
            {"name": one.name, "stated_mm": one.stated * 1e3, "found_mm": one.found * 1e3}
            for one in self.validation.compared
        ]
        return {
            **self.validation.summary(),
            "inside_share": None if self.inside is None else float(self.inside.mean()),
            "rotation_inside_share": None if self.rotation_inside is None else float(self.rotation_inside.mean()),
            "outliers": [
                {
                    "row": outlier.row,
                    "line": outlier.line,
                    "id": outlier.id,
                    "target": outlier.target,
                    "residual_mm": outlier.residual * 1e3,
                    "studentised": outlier.studentised,
                }
                for outlier in self.outliers
            ],
            **({"distances": compared} if compared else {}),
            "rows": self.points(),
        }


def examine(
    calibration: Calibration,
    campaign: Campaign,
    *,
    reregister: bool = False,
    noise: TrackerNoise | None = None,
    level: float = 0.01,
) -> Examination:
    """Compare a campaign with the calibration's predictions, point by point.

    Args:
        calibration: the calibration.
        campaign: measurements, of the calibration's own targets unless `reregister`.
        reregister: refit tracker frame and targets to this campaign, with the robot's geometry frozen.
        noise: the tracker's, where the campaign does not state uncertainties.
        level: chance of naming any outlier where there is none.

    Raises:
        CampaignError: nothing was measured, or the targets are not the calibration's.
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    fitted = reregister_frames(calibration, campaign, noise=noise) if reregister else calibration
    validation = validate(fitted, campaign)
    residual = errors_on(fitted, campaign)
    width = residual.shape[2]
    covariance = campaign.covariances(noise)[..., :width, :width]
    rows, targets = np.nonzero(campaign.valid)
    error = residual[rows, targets, :3]
    direction = error / np.maximum(np.linalg.norm(error, axis=1), 1e-300)[:, None]
    along = np.einsum("ki,kij,kj->k", direction, covariance[rows, targets, :3, :3], direction)
    studentised = inside = rotation_inside = None
    outliers: tuple[Outlier, ...] = ()
    shared: tuple[bool, ...] = ()
    if not (reregister or campaign.observations):
        known = [calibration.targets.index(name) for name in campaign.targets]
        stated = calibration.predict_covariance(campaign.q, campaign.conditions)[:, known, :width, :width] + covariance
        lengths, outliers = studentise(residual, stated, stated, campaign, level)
        shared = shared_with_neighbours(outliers, residual, lengths, campaign.q)
        studentised = lengths[rows, targets]
        inside = _is_inside(error, stated[rows, targets, :3, :3])
        if width == 6:
            rotation_inside = _is_inside(residual[rows, targets, 3:], stated[rows, targets, 3:, 3:])
    one_number = np.array([kind.width == 1 for kind in campaign.kinds] or [False] * len(campaign.targets))
    return Examination(
        campaign=campaign,
        validation=validation,
        targets=targets,
        signed=np.where(one_number[targets], error[:, 0], np.nan),
        uncertainty=np.sqrt(along),
        studentised=studentised,
        inside=inside,
        rotation_inside=rotation_inside,
        outliers=outliers,
        shared=shared,
    )


def _is_inside(error: Float[np.ndarray, "points 3"], covariance: Float[np.ndarray, "points 3 3"]) -> np.ndarray:
    """Whether each error is in the ellipsoid that holds 95 % of a normal distribution of this covariance."""
    try:
        solved = np.linalg.solve(covariance, error[..., None])[..., 0]
    except np.linalg.LinAlgError as singular:
        raise CampaignError(
            "the calibration and the campaign state no uncertainty at some point; state one (column u_mm)"
        ) from singular
    from scipy.special import chdtri

    return np.einsum("ki,ki->k", error, solved) <= chdtri(3, 1.0 - REGION)
