"""The fit of a campaign in parts: normal equations added up part by part, so that memory does not grow with the rows.

What needs all rows at once is taken from a sample spread evenly over them: the registration to start from, the model error, the
scale of the prior, and what a row that cannot be right looks like. The estimate and its covariance are those of all rows.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from taskcal.errors import FitError
from taskcal.estimation.least_squares import Solution, fit
from taskcal.estimation.matrices import invert_positive, single_threaded
from taskcal.identification.calibration import Calibration, spread_of
from taskcal.identification.held_out import studentise
from taskcal.identification.identify import GROSS_SIGMAS, farthest_targets, identify_parameters
from taskcal.identification.layout import prior_of
from taskcal.identification.options import FitOptions
from taskcal.identification.problem import problem_of, whitener
from taskcal.kernels.points import SQUARED
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
    first = identify_parameters(model, campaign.sample, options=options)
    wrong = {start: farthest_targets(first, part, noise)[1] > GROSS_SIGMAS for start, part in campaign}
    solution, precision = _fit_all(first, campaign, wrong, noise)
    if not solution.converged:
        raise FitError(f"the fit of all rows did not converge: {solution.reason}; fit fewer of them at once")
    calibration = _with_all(first, solution, invert_positive(solution.information + precision), campaign, options)
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
    first: Calibration,
    campaign: ChunkedCampaign,
    wrong: dict[int, Bool[np.ndarray, " n"]],
    noise: TrackerNoise | None,
) -> tuple[Solution, Float[np.ndarray, "z z"]]:
    """The fit of all rows from that of the sample on, with its hyperparameters; and the prior's precision."""
    layout, variances = first.layout, np.square(first.model_error)
    prior = prior_of(layout, "tolerances")
    assert first.prior_scale is not None
    precision = prior.precision(first.prior_scale**2)

    def equations(z: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        cost, g, H = 0.0, np.zeros(len(z)), np.zeros((len(z), len(z)))
        for start, part in campaign:
            problem = problem_of(layout, part.without(wrong[start]), noise)
            more = problem.equations(whitener(problem.covariance(variances)), SQUARED, 1.0)(z)
            cost, g, H = cost + more[0], g + more[1], H + more[2]
        return cost, g, H

    return fit(equations, first.z, prior.mean, precision, prior.scale), precision


def _with_all(
    first: Calibration,
    solution: Solution,
    covariance: Float[np.ndarray, "z z"],
    campaign: ChunkedCampaign,
    options: FitOptions,
) -> Calibration:
    """The calibration of all rows, with the residuals of the sample."""
    # what the fit of the sample left out was not seen
    numbers = [campaign.sample.row_of(k) for k in range(len(campaign.sample))]
    sample = campaign.sample.without(np.isin(numbers, [row.row for row in first.left_out]))
    problem = problem_of(first.layout, sample, options.noise)
    residual, predicted = problem.propagate(solution.z, covariance)
    whole = problem.covariance(np.square(first.model_error))
    studentised, outliers = studentise(residual, whole - predicted, whole, sample, options.outlier_level)
    T_tracker_base, T_tool_target = first.layout.frames(solution.z)
    return replace(
        first,
        z=solution.z,
        z_spread=spread_of(covariance),
        T_tracker_base=T_tracker_base,
        T_tool_target=T_tool_target,
        residuals=residual,
        studentised=studentised,
        outliers=outliers,
        iterations=solution.iterations,
        reason=solution.reason,
        log_evidence=None,
        provenance=replace(
            first.provenance, campaign=campaign.path.name, rows=campaign.rows, notes=campaign.sample.notes
        ),
    )
