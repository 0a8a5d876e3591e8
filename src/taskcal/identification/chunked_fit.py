"""The fit of a campaign in parts: normal equations added up part by part, so that memory does not grow with the rows.

What needs all rows at once is taken from a sample spread evenly over them: the registration to start from, the model error, the
scale of the prior, and what a row that cannot be right looks like. The estimate and its covariance are those of all rows.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from taskcal.estimation.least_squares import Stopping
from taskcal.estimation.matrices import single_threaded
from taskcal.identification.calibration import Calibration
from taskcal.identification.fit import fitted_alone
from taskcal.identification.hyperparameters import Hyperparameters, fit_weighed
from taskcal.identification.identify import GROSS_SIGMAS, attempt, target_errors
from taskcal.identification.layout import prior_of
from taskcal.identification.options import FitOptions
from taskcal.identification.problem import Equations, problem_of, whitener
from taskcal.observations.base import TrackerNoise
from taskcal.reading.chunked import ChunkedCampaign
from taskcal.robot.error_model import ErrorModel


@dataclass(frozen=True, kw_only=True)
class ErrorsOfMany:
    """Errors in space of more points than are kept, metres."""

    count: int = 0
    total: float = 0.0
    squares: float = 0.0
    maximum: float = 0.0

    @property
    def mean(self) -> float:
        """Mean error."""
        return self.total / self.count if self.count else float("nan")

    @property
    def rms(self) -> float:
        """Root mean square."""
        return float(np.sqrt(self.squares / self.count)) if self.count else float("nan")

    def joined(self, residual: Float[np.ndarray, "n targets b"]) -> "ErrorsOfMany":
        """With those of more residuals, NaN where nothing was seen."""
        length = np.linalg.norm(residual[..., :3], axis=2)
        length = length[np.isfinite(length)]
        return ErrorsOfMany(
            count=self.count + len(length),
            total=self.total + float(length.sum()),
            squares=self.squares + float((length**2).sum()),
            maximum=max(self.maximum, float(length.max(initial=0.0))),
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class ChunkedFit:
    """What a campaign in parts gives."""

    calibration: Calibration
    """Estimate and covariance of all rows; rows, residuals and outliers are those of the sample."""
    rows: int
    left_out: tuple[int, ...]
    """Rows that cannot be right beside all others, counted from 0."""
    fitted: ErrorsOfMany
    """Of the calibration on all other rows."""
    unseen: ErrorsOfMany
    """Of the fit of the sample on the rows that were not in it."""


@single_threaded
def identify_in_chunks(
    model: ErrorModel, campaign: ChunkedCampaign, *, noise: TrackerNoise | None = None
) -> ChunkedFit:
    """Identify all parameters of a model, with tracker frame and targets, from a campaign in parts.

    Args:
        model: without effects, which depend on what a part does not tell.
        campaign: in parts.
        noise: the tracker's, where the campaign does not state uncertainties.

    Raises:
        CampaignError: as `identify`, of the sample.
        FitError: the fit did not converge.
        ValueError: the model has effects.
    """
    if model.effects:
        raise ValueError("effects are not fitted in parts")
    options = FitOptions(noise=noise)
    first = attempt(model, campaign.sample, options).learnt().with_growth()
    wrong = {start: target_errors(first, part, noise)[1].max(axis=1) > GROSS_SIGMAS for start, part in campaign}
    calibration = _fit_all(first, campaign, wrong, options)
    fitted, unseen = ErrorsOfMany(), ErrorsOfMany()
    for start, part in campaign:
        right = ~wrong[start]
        fitted = fitted.joined(calibration.residuals_on(part)[right])
        others = (start + np.arange(len(part))) % campaign.step != 0
        unseen = unseen.joined(first.residuals_on(part)[right & others])
    left_out = tuple(int(start + row) for start, rows in wrong.items() for row in np.flatnonzero(rows))
    said = (
        f"fitted in parts: estimate and covariance are of {campaign.rows} rows, {len(left_out)} left out that cannot be right; "
        f"model error, prior scale, residuals and outliers of {len(campaign.sample)} of them, spread evenly"
    )
    return ChunkedFit(
        calibration=replace(calibration, remarks=(said, *calibration.remarks)),
        rows=campaign.rows,
        left_out=left_out,
        fitted=fitted,
        unseen=unseen,
    )


def _fit_all(
    first: Calibration, campaign: ChunkedCampaign, wrong: dict[int, Bool[np.ndarray, " n"]], options: FitOptions
) -> Calibration:
    """The calibration of all rows, from that of the sample on and with its hyperparameters; residuals are the sample's."""
    # what the fit of the sample left out was not seen
    numbers = [campaign.sample.row_of(k) for k in range(len(campaign.sample))]
    sample = campaign.sample.without(np.isin(numbers, [row.row for row in first.left_out]))
    hyper = Hyperparameters.of_deviations(first.model_error, first.prior_scale)

    def equations(z: np.ndarray) -> Equations:
        parts = (problem_of(first.layout, part.without(wrong[start]), options.noise) for start, part in campaign)
        each = (part.equations(whitener(part.covariance(hyper.variances)))(z) for part in parts)
        cost, g, H = next(each)
        for more in each:
            cost, g, H = cost + more[0], g + more[1], H + more[2]
        return cost, g, H

    problem = problem_of(first.layout, sample, options.noise)
    prior = prior_of(first.layout, options.prior, options.target_within)
    by = fit_weighed(problem, prior, hyper, first.z, Stopping(), equations=equations)
    provenance = replace(first.provenance, campaign=campaign.path.name, rows=campaign.rows, notes=campaign.sample.notes)
    return replace(
        fitted_alone(by, problem, sample, options).calibration,
        left_out=first.left_out,
        range_growth=first.range_growth,
        rounds=first.rounds,
        log_evidence=None,
        remarks=first.remarks,
        provenance=provenance,
    )
