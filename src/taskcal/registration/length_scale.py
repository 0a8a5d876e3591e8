"""The scale of measured lengths about the nominal robot's: of an instrument that is out of calibration, or of a target's print."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import CampaignError
from taskcal.estimation.matrices import single_threaded
from taskcal.geometry import se3
from taskcal.observations.base import TrackerNoise
from taskcal.registration.registration import FAR_MEDIANS, PLAUSIBLE_SHARE, nominal_poses, register_trimmed
from taskcal.robot.error_model import EXACT, ErrorModel
from taskcal_groundwork.said import Said

NAMED_SIGMAS = 3.0
"""Standard errors from 1 from which on a scale is named: of sound campaigns one in 370 by chance."""

MIN_FREEDOM = 12
"""Measured numbers, at least, beyond frame, targets and parameters that are not held by tolerances. A convention: of fewer the size
of what the geometry leaves is not told."""


@dataclass(frozen=True, kw_only=True)
class LengthScale:
    """How many times the nominal robot's the measured lengths are."""

    value: float
    standard_error: float
    """By the scatter of robots within their tolerances, or wider ones where these are too narrow, and what no geometry explains."""
    left: float
    """What the nominal robot leaves beside it, metres rms in space."""

    @property
    def named(self) -> bool:
        """Whether it differs from 1 by more than robots within their tolerances do."""
        return self.differs()

    def differs(self, stated: float = 0.0) -> bool:
        """Whether it is named where a length's own standard uncertainty is stated as well, as a share of it."""
        return abs(self.value - 1.0) > NAMED_SIGMAS * float(np.hypot(self.standard_error, stated))

    def said(self) -> str:
        """What it means, and the remedy."""
        return Said(
            "measured lengths are {value:.4f} times the robot's (SE {error:.4f} by its tolerances): all distances may be wrong by "
            "that. Check the instrument's scale, its compensation of temperature, the unit or the size of its target by a length "
            "that is known, or the lengths in the robot file",
            value=self.value,
            error=self.standard_error,
        )

    def summary(self) -> dict[str, float]:
        """For machines."""
        return {"value": self.value, "standard_error": self.standard_error}


def board_said(board: str, scale: float) -> str:
    """What a scale of the lengths that its images tell, to four digits as it is told, means of a board, and the remedy."""
    size = 1.0 / round(scale, 4)
    return Said(
        "by the robot's lengths {board} is {size:.4f} times as large as stated: measure its print, and state the length in its "
        "file",
        board=board,
        size=size,
    )


@single_threaded
def find_length_scale(model: ErrorModel, campaign: Campaign) -> LengthScale | None:
    """The scale of a tracker's points that fits best about the registered nominal robot; None where none is told, or none fits.

    The residual of the registered robot is c·(s − 1) + G·x + N·f + e: c the places of the points, G what the parameters in units of
    their tolerances move, N what frame and targets do, and e with the variance that frame, targets and free parameters leave. By
    generalised least squares, x standard normal and f free. Where the geometry is off by more than its tolerances, the standard
    error grows by the root of its chi-squared over its number (Birge 1932).

    Args:
        model: of the robot, without effects.
        campaign: the measurements.
    """
    names = [name for name, one in zip(campaign.targets, campaign.observations, strict=True) if one.in_tracker]
    if not names or (model.tolerances <= EXACT).all():
        return None
    part = replace(campaign.of_targets(names), rotations=None)
    try:
        T = nominal_poses(model, part)
        registration, distance = register_trimmed(T, part, model)
    except (CampaignError, np.linalg.LinAlgError):
        return None
    near = part.seen & (distance <= FAR_MEDIANS * float(np.median(distance[part.seen])))
    row, target = np.nonzero(part.valid & near[:, None])
    Z, offsets = registration.T_tracker_base[:3, :3], registration.T_tool_target[:, :3, 3]
    turned = Z @ T[row, :3, :3]
    places = (Z @ T[row, :3, 3:])[..., 0] + (turned @ offsets[target][..., None])[..., 0]
    residual = part.points[row, target] - places - registration.T_tracker_base[:3, 3]
    moved = Z @ se3.carry(model.jacobian(part.q)[row], (T[row, :3, :3] @ offsets[target][..., None])[..., 0])[:, :3]
    about = places - places.mean(axis=0)
    free = np.zeros((len(row), 3, 6 + 3 * len(names)))
    free[:, :, :6] = se3.by_twist(about)
    for t in range(len(names)):
        free[target == t, :, 6 + 3 * t : 9 + 3 * t] = turned[target == t]
    noise = float(np.mean(np.trace(TrackerNoise().covariance(part.points[row, target]), axis1=1, axis2=2))) / 3.0
    found = _estimate(
        about.reshape(-1), (moved * model.tolerances).reshape(residual.size, -1), free.reshape(residual.size, -1),
        residual.reshape(-1), noise,
    )  # fmt: skip
    return None if found is None or found.left > PLAUSIBLE_SHARE * model.robot.reach else found


def _estimate(
    c: Float[np.ndarray, " n"],
    G: Float[np.ndarray, "n p"],
    N: Float[np.ndarray, "n f"],
    r: Float[np.ndarray, " n"],
    noise: float,
) -> LengthScale | None:
    """The scale of `find_length_scale`; of the variance of single numbers at least that of a tracker's noise is taken."""
    U = _range(N)
    c, G, r = (x - U @ (U.T @ x) for x in (c, G, r))
    nominal, places = r, c
    A, S, _ = np.linalg.svd(G, full_matrices=False)
    A, S = A[:, 1e-9 * S[0] < S], S[1e-9 * S[0] < S]
    ca, ra = A.T @ c, A.T @ r
    c, r = c - A @ ca, r - A @ ra
    freedom = len(r) - U.shape[1] - len(S) - 1
    if freedom < MIN_FREEDOM:
        return None
    e = r - c * (c @ r) / max(float(c @ c), 1e-300)
    variance = max(float(e @ e) / freedom, noise)
    weight = 1.0 / (S**2 + variance)
    information = float(c @ c) / variance + float(weight @ ca**2)
    scale = (float(c @ r) / variance + float(weight @ (ca * ra))) / information
    # what the geometry tells at all: of the others only noise is seen
    shown = variance < S**2
    birge = float((weight * (ra - scale * ca) ** 2)[shown].sum()) / max(int(shown.sum()) - 1, 1)
    left = nominal - scale * places
    return LengthScale(
        value=1.0 + scale,
        standard_error=float(np.sqrt(max(birge, 1.0) / information)),
        left=float(np.sqrt(3.0 * np.mean(left**2))),
    )


def _range(N: Float[np.ndarray, "n f"]) -> Float[np.ndarray, "n k"]:
    """An orthonormal basis of what columns span."""
    U, s, _ = np.linalg.svd(N, full_matrices=False)
    return U[:, s > 1e-9 * s[0]]
