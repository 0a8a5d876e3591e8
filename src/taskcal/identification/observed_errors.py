"""What a calibration says of observations of any kind: their residuals, and how sure it is of what it predicts of them."""

from typing import TYPE_CHECKING, Literal

import numpy as np
from jaxtyping import Float

from taskcal.geometry.covariance_propagation import propagate
from taskcal.identification.observation_layout import ObservationLayout
from taskcal.identification.problem import observe
from taskcal.measurement.campaign import Campaign

if TYPE_CHECKING:
    from taskcal.identification.calibration import Calibration


def residuals_by_kind(
    calibration: "Calibration",
    campaign: Campaign,
    frame: Literal["tracker", "base"] = "tracker",
    *,
    settled: bool = False,
) -> Float[np.ndarray, "n targets b"]:
    """Measured less predicted; NaN where nothing was measured, zero for what a kind does not measure of its block.

    Args:
        calibration: of these targets.
        campaign: observations of them.
        frame: whose axes the first three numbers are in.
        settled: let what stands (sockets, anchors …) be where this campaign says, given the calibrated robot; else only what the
            calibration does not know of it.

    Raises:
        CampaignError: a target that the calibration does not know.
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    ends = calibration.target_poses(campaign.q, campaign.conditions)[:, calibration.rows_of(campaign.targets)]
    unknowns = unknowns_of(calibration, campaign, settled=settled)
    b = 3 if campaign.rotations is None else 6
    out = np.full((*campaign.valid.shape, b), np.nan)
    R = calibration.T_tracker_base[:3, :3] if frame == "base" else np.eye(3)
    for t, (kind, unknown) in enumerate(zip(campaign.observations, unknowns, strict=True)):
        seen = campaign.valid[:, t]
        residual = kind.differentiate(ends[:, t], unknown, campaign.read(t)).residual[seen]
        out[seen, t] = 0.0
        out[seen, t, : residual.shape[1]] = residual
        if kind.along_axes:
            for first in range(0, kind.width, 3):
                out[seen, t, first : first + 3] = out[seen, t, first : first + 3] @ R
    return out


def unknowns_of(
    calibration: "Calibration", campaign: Campaign, *, settled: bool = False
) -> tuple[Float[np.ndarray, " _"], ...]:
    """What each kind does not know, from the calibration, or from the campaign's own rows where the calibration cannot tell.

    Args:
        calibration: of these targets.
        campaign: observations of them.
        settled: take all from the campaign's rows.
    """
    numbers = calibration.rows_of(campaign.targets)
    ends = calibration.target_poses(campaign.q, campaign.conditions)[:, numbers]
    out: list[np.ndarray] = []
    layout = calibration.layout
    for t, kind in enumerate(campaign.observations):
        known = np.full(len(kind.unknowns), np.nan)
        if isinstance(layout, ObservationLayout) and layout.kinds[numbers[t]].key == kind.key:
            known = kind.named_like(layout.kinds[numbers[t]], layout.unknowns(calibration.z)[numbers[t]])
        if not settled and np.isfinite(known).all():
            out.append(known)
            continue
        found = kind.settle(ends[:, t], campaign.read(t), known)
        first, second = (found, known) if settled else (known, found)
        out.append(np.where(np.isnan(first), second, first))
    return tuple(out)


def covariance_by_kind(calibration: "Calibration", campaign: Campaign) -> Float[np.ndarray, "n targets b b"]:
    """Covariance of each observation about what the calibration predicts, its own noise not included.

    Raises:
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    layout = calibration.layout
    assert isinstance(layout, ObservationLayout)
    kinds = tuple(
        kind.numbered_like(layout.kinds[t])
        for kind, t in zip(campaign.observations, calibration.rows_of(campaign.targets), strict=True)
    )
    at = layout.walked(campaign.q, calibration.z, calibration.model.prepare(campaign.q, campaign.conditions))
    covariance = propagate(
        at, layout.linearised(at, calibration.z, observe(campaign), kinds), calibration.z_covariance
    )[1]
    for t, kind in enumerate(kinds):
        error = np.repeat(np.square(calibration.model_error), 3)[: kind.width]
        covariance[:, t, range(kind.width), range(kind.width)] += error
    return np.where(campaign.valid[..., None, None], covariance, np.eye(covariance.shape[2]))
