"""Which rows a fit does not see, so that they show what it predicts: groups of neighbouring poses, blocks, or single rows.

Of two poses side by side, one in the fit tells the error of the other, and rows held out one by one flatter the fit.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float, Int

from taskcal.campaigns.campaign import Campaign
from taskcal.campaigns.performance import group_postures
from taskcal.errors import CampaignError
from taskcal.identification.calibration import Calibration
from taskcal.identification.held_out import GROUPINGS, SAME_POSTURE_RAD, Grouping, HeldOut, group_neighbours

GROUPS = 20
"""Into which the rows are divided, unless a small share or many folds need more."""

Fit = Callable[[Campaign], Calibration]


@dataclass(frozen=True, kw_only=True)
class Holdout:
    """What is held out: a share of the rows, once, or every row once, in folds.

    Raises:
        ValueError: not exactly one of share and folds, or one of no meaning.
    """

    share: float | None = None
    """Of the rows, held out once; the calibration is that of the others."""
    folds: int | None = None
    """Parts that are held out one after another; the calibration is that of all rows."""
    by: Grouping = "neighbours"
    seed: int = 0
    """Of the choice of groups."""

    def __post_init__(self) -> None:
        if (self.share is None) == (self.folds is None):
            raise ValueError("give a share of the rows or a number of folds, and only one of them")
        if self.share is not None and not 0.0 < self.share < 1.0:
            raise ValueError(f"share is {self.share!r}; give a number between 0 and 1, such as 0.3")
        if self.folds is not None and self.folds < 2:
            raise ValueError(f"folds is {self.folds!r}; give 2 or more")
        if self.by not in GROUPINGS:
            raise ValueError(f"by is {self.by!r}; give {', '.join(GROUPINGS)}")

    def groups(self, campaign: Campaign) -> Int[np.ndarray, " n"]:
        """The group of every row, counted from 0."""
        n = len(campaign)
        if self.by == "rows":
            return np.arange(n)
        share = 0.5 if self.share is None else min(self.share, 1.0 - self.share)
        count = min(max(GROUPS, 2 * (self.folds or 0), int(np.ceil(2.0 / share))), n)
        return np.arange(n) * count // n if self.by == "blocks" else group_neighbours(campaign.q, count)

    def choose(self, campaign: Campaign) -> Int[np.ndarray, " k"]:
        """Rows that are held out, where a share is.

        Raises:
            CampaignError: none, or all.
        """
        n, share = len(campaign), self.share or 0.0
        wanted = round(share * n)
        if not 0 < wanted < n:
            raise CampaignError(f"holding out {share:g} of {n} rows leaves {n - wanted} to fit and {wanted} to test")
        group = self.groups(campaign)
        rows = np.bincount(group)
        if len(rows) < 2:
            raise CampaignError(f"all {n} rows are one pose: a part held out would say nothing; measure at other poses")
        order = np.random.default_rng(self.seed).permutation(len(rows))
        reached = np.cumsum(rows[order])[:-1]
        count = int(np.argmin(np.abs(reached - wanted))) + 1
        return np.flatnonzero(np.isin(group, order[:count]))

    def divide(self, campaign: Campaign) -> list[Int[np.ndarray, " _"]]:
        """Rows of every fold.

        Raises:
            CampaignError: fewer groups than folds.
        """
        folds, group = self.folds or 0, self.groups(campaign)
        rows = np.bincount(group)
        if len(rows) < folds:
            raise CampaignError(
                f"{len(campaign)} rows at {len(rows)} different poses are too few to hold out one part of {folds} after another; "
                "choose fewer folds, or measure more poses"
            )
        order = np.random.default_rng(self.seed).permutation(len(rows))
        fold = np.empty(len(rows), dtype=int)
        held = np.zeros(folds)
        for number in order[np.argsort(-rows[order], kind="stable")]:
            fold[number] = int(held.argmin())
            held[fold[number]] += rows[number]
        return [np.flatnonzero(fold[group] == k) for k in range(folds)]


def hold_out(fit: Fit, campaign: Campaign, holdout: Holdout, nominal: Fit) -> Calibration:
    """Fit a campaign, and keep with the calibration how well rows were predicted that a fit had not seen.

    Args:
        fit: of the rows of a campaign.
        campaign: the measurements.
        holdout: what is held out.
        nominal: the same of the nominal robot, whose tracker frame and targets alone are fitted.

    Raises:
        CampaignError: too few rows or poses, or nothing was measured in the rows held out.
        FitError: a fit did not converge.
    """
    if holdout.folds is None:
        out = holdout.choose(campaign)
        calibration = fit(_without(campaign, out))
        group = np.unique(holdout.groups(campaign)[out], return_inverse=True)[1].reshape(-1)
        return with_held_out(calibration, campaign, out, nominal, by=holdout.by, part=group)
    calibration, parts = fit(campaign), holdout.divide(campaign)
    fits = [fit(_without(campaign, part)) for part in parts]
    part = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    return _with_errors(calibration, campaign, parts, fits, nominal, by=holdout.by, folds=len(parts), part=part)


def with_held_out(
    calibration: Calibration,
    campaign: Campaign,
    out: Int[np.ndarray, " k"],
    nominal: Fit,
    *,
    by: Grouping | None = None,
    part: Int[np.ndarray, " k"] | None = None,
) -> Calibration:
    """The calibration with its errors on rows that it has not seen.

    Args:
        calibration: fitted to all other rows.
        campaign: all rows.
        out: those that were held out.
        nominal: the fit of the nominal robot's tracker frame and targets.
        by: how they were chosen; None where the user named the rows to fit.
        part: the group of each; None to group neighbours.
    """
    if part is None:
        part = group_neighbours(campaign.q[out], GROUPS)
    return _with_errors(calibration, campaign, [out], [calibration], nominal, by=by or "chosen", folds=0, part=part)


def _with_errors(
    calibration: Calibration,
    campaign: Campaign,
    parts: Sequence[Int[np.ndarray, " _"]],
    fits: Sequence[Calibration],
    nominal: Fit,
    *,
    by: Grouping | Literal["chosen"],
    folds: int,
    part: Int[np.ndarray, " k"],
) -> Calibration:
    """The calibration with the errors of parts of a campaign, each predicted by the fit that has not seen it."""
    predicted = [_predict(one, campaign, part, nominal) for one, part in zip(fits, parts, strict=True)]
    held_out = HeldOut(
        by=by,
        folds=folds,
        rows=np.array([campaign.row_of(int(i)) for i in np.concatenate(parts)]),
        part=part,
        residuals=np.concatenate([own for own, _ in predicted]),
        nominal=np.concatenate([before for _, before in predicted]),
        kinds=campaign.kinds,
    )
    return replace(calibration, held_out=held_out)


def _without(campaign: Campaign, out: Int[np.ndarray, " k"]) -> Campaign:
    return campaign.take(np.setdiff1d(np.arange(len(campaign)), out))


def _predict(
    fitted: Calibration, campaign: Campaign, out: Int[np.ndarray, " k"], nominal: Fit
) -> tuple[Float[np.ndarray, "k targets b"], Float[np.ndarray, "k targets b"]]:
    """Residuals of held-out rows, in the axes of the robot's base, and those that the nominal robot leaves.

    Raises:
        CampaignError: nothing was measured in them.
    """
    unseen, rest = campaign.take(out), _without(campaign, out)
    if not unseen.valid.any():
        raise CampaignError(
            f"in none of the {len(out)} rows that are held out was anything measured; choose others (seed)"
        )
    wrong = {row.id for row in fitted.left_out}
    before = nominal(rest.without(np.array([name in wrong for name in rest.ids])))
    return fitted.residuals_on(unseen, frame="base"), before.residuals_on(unseen, frame="base")


# Cross-validation on postures that were not fitted: rows of one posture, measured again and again, are left out
# together.
#
# Left in the fit, a repeated pose would tell the errors of its own posture beforehand.


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
