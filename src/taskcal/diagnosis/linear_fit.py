"""A campaign explained by frames, targets and geometry, linearised at the nominal robot, and robustly.

What the geometry may be off by is held by its tolerances, three times over; residuals are those of a damped fit, so that what
stays of a mistake in some of the rows is seen beside errors of tenths of a millimetre, not beside those of the nominal robot.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from taskcal.diagnosis.supposition import Case
from taskcal.errors import CampaignError
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.registration import Registration, register_closely

PRIOR_SCALE = 3.0
"""Of the tolerances."""

LEAST_NOISE = 5e-5
"""Metres per axis; no robot fits better."""

ROUNDS = 8
"""Of weights and noise."""

TUNING = 4.0
"""Median distances from which on a row loses its weight."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LinearFit:
    """The damped linear system of a case, and what is left of it."""

    rows: Int[np.ndarray, " m"]
    """Row of each point."""
    targets: Int[np.ndarray, " m"]
    """Target of each point."""
    columns: Float[np.ndarray, "m 3 u"]
    """Of the unknowns: the geometry in units of its prior, tracker frame, targets."""
    held: int
    """Columns that have a prior, the first ones."""
    residual: Float[np.ndarray, "m 3"]
    """Of the registered nominal robot, metres."""
    turned: Float[np.ndarray, "m 3 3"]
    """From the tool to the tracker frame."""
    noise: float
    """Standard deviation per axis, metres."""
    distance: Float[np.ndarray, " m"]
    """How far each point is off after the robust fit, metres."""
    places: Float[np.ndarray, "m 3"]
    """Points about their centre, metres."""
    centre: Float[np.ndarray, " 3"]
    """In the tracker frame, metres."""

    @property
    def median(self) -> float:
        """Of the distances, metres."""
        return float(np.median(self.distance))

    def objective(self, weight: Float[np.ndarray, " m"], added: Float[np.ndarray, "m 3 b"] | None = None) -> float:
        """Smallest damped sum of squares, in units of the noise, with more columns free."""
        return _solve(self.columns, self.held, self.residual, weight, self.noise, added)[1]

    def rms(self, weight: Float[np.ndarray, " m"], added: Float[np.ndarray, "m 3 b"] | None = None) -> float:
        """Root mean square distance of the points that have a weight, with more columns free, metres."""
        A = self.columns if added is None else np.concatenate([self.columns, added], axis=2)
        left = self.residual - A @ _solve(self.columns, self.held, self.residual, weight, self.noise, added)[0]
        return float(np.sqrt((left[weight > 0.0] ** 2).sum(axis=1).mean()))

    def size(self, weight: Float[np.ndarray, " m"], added: Float[np.ndarray, "m 3 b"]) -> Float[np.ndarray, " b"]:
        """Estimates of the added columns' coefficients."""
        return _solve(self.columns, self.held, self.residual, weight, self.noise, added)[0][self.columns.shape[2] :]


def fit_linearly(case: Case, rows: Int[np.ndarray, " k"]) -> LinearFit | None:
    """The robust linear fit of some rows; None where they cannot be registered."""
    T = case.poses(rows)
    usable = np.isfinite(T[:, 0, 3]) & case.campaign.seen[rows]
    rows, T = rows[usable], T[usable]
    campaign = case.campaign.take(rows)
    try:
        registration = register_trimmed(campaign, T)
    except (CampaignError, np.linalg.LinAlgError):
        return None
    row, target = np.nonzero(campaign.valid)
    Z, offsets = registration.T_tracker_base[:3, :3], registration.T_tool_target[:, :3, 3]
    turned = Z @ T[row, :3, :3]
    predicted = ((registration.T_tracker_base @ T)[row] @ registration.T_tool_target[target])[:, :3, 3]
    residual = campaign.points[row, target] - predicted
    J = case.model.jacobian(campaign.q)[row]
    arm = (T[row, :3, :3] @ offsets[target][:, :, None])[:, :, 0]
    moved = J[:, :3] - np.cross(arm[:, None, :], np.swapaxes(J[:, 3:], 1, 2)).swapaxes(1, 2)
    places = predicted - predicted.mean(axis=0)
    geometry = Z @ moved * (PRIOR_SCALE * case.model.tolerances)
    frames = frame_columns(places)
    own = np.zeros((len(row), 3, 3 * len(campaign.targets)))
    for t in range(len(campaign.targets)):
        own[target == t, :, 3 * t : 3 * t + 3] = turned[target == t]
    columns = np.concatenate([geometry, frames, own], axis=2)
    held = len(case.model)
    noise, distance = _robustly(columns, held, residual)
    return LinearFit(
        rows=rows[row],
        targets=target,
        columns=columns,
        held=held,
        residual=residual,
        turned=turned,
        noise=noise,
        distance=distance,
        places=places,
        centre=predicted.mean(axis=0),
    )


def frame_columns(places: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, "m 3 6"]:
    """How points move with the frame they are given in: its translation and rotation."""
    out = np.zeros((len(places), 3, 6))
    out[:, :, :3] = np.eye(3)
    for axis in range(3):
        out[:, :, 3 + axis] = np.cross(np.eye(3)[axis], places)
    return out


def register_trimmed(campaign: Campaign, T: Float[np.ndarray, "n 4 4"]) -> Registration:
    """Register on the three quarters of the rows that agree best.

    Raises:
        CampaignError: these rows do not show all targets.
    """
    registration = register_closely(campaign, T)
    for _ in range(4):
        ends = (registration.T_tracker_base @ T)[:, None] @ registration.T_tool_target
        distance = np.nanmax(np.linalg.norm(campaign.points - ends[..., :3, 3], axis=2), axis=1)
        kept = np.sort(np.argsort(distance)[: int(np.ceil(0.75 * len(distance)))])
        registration = register_closely(campaign.take(kept), T[kept])
    return registration


def _robustly(columns: np.ndarray, held: int, residual: np.ndarray) -> tuple[float, np.ndarray]:
    distance = np.linalg.norm(residual, axis=1)
    noise = max(float(np.median(distance)) / 1.54, LEAST_NOISE)
    for _ in range(ROUNDS):
        weight = 1.0 / (1.0 + (distance / (TUNING * 1.54 * noise)) ** 2) ** 2
        solution = _solve(columns, held, residual, weight, noise)[0]
        distance = np.linalg.norm(residual - columns @ solution, axis=1)
        # the median length of a normal vector in space is 1.54 σ
        noise = max(float(np.median(distance)) / 1.54, LEAST_NOISE)
    return noise, distance


def _solve(
    columns: np.ndarray,
    held: int,
    residual: np.ndarray,
    weight: np.ndarray,
    noise: float,
    added: np.ndarray | None = None,
) -> tuple[np.ndarray, float]:
    A = columns if added is None else np.concatenate([columns, added], axis=2)
    prior = np.full(A.shape[2], 1e-6)
    # frames, targets and what is added are as good as free
    prior[:held] = 1.0
    root = np.sqrt(weight)[:, None] / noise
    flat = (A * root[:, :, None]).reshape(-1, A.shape[2])
    b = (residual * root).reshape(-1)
    H, g = flat.T @ flat + np.diag(prior), flat.T @ b
    solution = np.linalg.solve(H, g)
    return solution, float(b @ b - g @ solution)
