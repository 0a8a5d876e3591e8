"""Cross-validation on postures that were not fitted: rows of one posture, measured again and again, are left out together.

Left in the fit, a repeated pose would tell the errors of its own posture beforehand.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import CampaignError
from taskcal.identification.calibration import Calibration
from taskcal.identification.neighbouring_poses import SAME_POSTURE_RAD
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.repeated_poses import group_postures


def split_postures(q: Float[np.ndarray, "n joints"], folds: int, seed: int) -> list[Int[np.ndarray, " _"]]:
    """Rows of each fold. Rows within half a degree of each other in every joint are in one fold, and chains of such rows.

    Args:
        q: joint positions, radians.
        folds: how many parts are left out, one after another.
        seed: of their composition.

    Raises:
        CampaignError: fewer postures than folds.
    """
    posture = group_postures(q, SAME_POSTURE_RAD)
    different = len(np.unique(posture))
    if different < folds:
        raise CampaignError(
            f"{len(q)} rows at {different} different poses are too few to leave out one part of {folds} after another; "
            "measure more poses"
        )
    # the generator, and so the folds, of scikit-learn's GroupKFold, whose import takes longer than a fit
    order = np.random.RandomState(seed).permutation(np.unique(posture))
    part = np.array_split(order, folds)
    return [np.flatnonzero(np.isin(posture, some)) for some in part]


def predict_left_out(
    fit: Callable[[Campaign], Calibration], campaign: Campaign, parts: list[Int[np.ndarray, " _"]]
) -> Float[np.ndarray, "rows targets"]:
    """Error in space of every point when its part is left out of the fit, metres; NaN for lost beams."""
    out = np.full(campaign.valid.shape, np.nan)
    for part in parts:
        fitted = fit(campaign.take(np.setdiff1d(np.arange(len(campaign)), part)))
        out[part] = np.linalg.norm(fitted.residuals_on(campaign.take(part))[..., :3], axis=2)
    return out


def mean_over_rows(values: Float[np.ndarray, "rows targets"]) -> tuple[float, float]:
    """Mean over the points, and its standard error over the rows, whose targets have their errors in common."""
    count, rows = int(np.isfinite(values).sum()), int(np.isfinite(values).any(axis=1).sum())
    mean = float(np.nanmean(values))
    by_row = np.nansum(values - mean, axis=1)
    return mean, float(np.sqrt((by_row**2).sum() * rows / max(rows - 1, 1)) / count)
