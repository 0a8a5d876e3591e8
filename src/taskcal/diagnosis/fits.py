"""A campaign explained by frames, targets and geometry, linearised at the nominal robot, and robustly.

What the geometry may be off by is held by its tolerances, three times over; residuals are those of a damped fit, so that what
stays of a mistake in some of the rows is seen beside errors of tenths of a millimetre, not beside those of the nominal robot.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from taskcal.campaigns.campaign import Campaign
from taskcal.diagnosis.hypotheses import Case
from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.registration.registration import Registration, register_closely
from taskcal.robot.conditions import drive_motion

TRUSTED_SHARE = 0.75
"""Share of the points that a fit follows; the others may be wrong. A convention between the share of wrong rows that is borne
and the use of right ones."""

MEDIAN_SIGMAS = 1.54
"""Median length of a normal vector in space over its standard deviation per axis (Maxwell distribution)."""

PRIOR_SCALE = 3.0
"""Standard deviation of the geometry over its tolerances in the doctor's fit. A convention: a robot is rarely off by more; a
looser one would follow slips."""

ADDED_PRIOR = 1e-6
"""Weight of the prior on frames, targets and what is added, in units of the geometry's: they are as good as free."""

MIN_NOISE_M = 5e-5
"""Standard deviation at least, metres per axis. A convention: no nominal robot fits better."""

ROBUST_ROUNDS = 8
"""Rounds of weights and noise in turn. A convention that bounds the time."""

TUNING_MEDIANS = 4.0
"""Distance over the median one at which a row's weight is a quarter. A convention of the Geman–McClure kind: larger trusts
outliers, smaller wastes rows."""


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
    joints: Float[np.ndarray, "m 3 joints"]
    """Derivatives of the points by the turns of the drives."""
    noise: float
    """Standard deviation per axis, metres."""
    left: Float[np.ndarray, "m 3"]
    """How far each point is off after the robust fit, metres."""
    places: Float[np.ndarray, "m 3"]
    """Points about their centre, metres."""
    centre: Float[np.ndarray, " 3"]
    """In the tracker frame, metres."""

    @property
    def distance(self) -> Float[np.ndarray, " m"]:
        """How far each point is off after the robust fit, metres."""
        return np.linalg.norm(self.left, axis=1)

    @property
    def median(self) -> float:
        """Median distance, metres."""
        return float(np.median(self.distance))

    @property
    def trust(self) -> Float[np.ndarray, " m"]:
        """Weight of each point in the robust fit."""
        return _trust(self.distance, self.noise)

    @property
    def held_out(self) -> Float[np.ndarray, " m"]:
        """How far the points of each half of the rows are off from the robust fit of the other half, metres."""
        half = np.isin(self.rows, np.random.default_rng(0).permutation(np.unique(self.rows))[::2])
        left, trust = np.empty_like(self.residual), self.trust
        for own in (half, ~half):
            solution = _solve(self.columns[own], self.held, self.residual[own], trust[own], self.noise)[0]
            left[~own] = self.residual[~own] - self.columns[~own] @ solution
        return np.linalg.norm(left, axis=1)

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


def fitted_distances(case: Case, rows: Int[np.ndarray, " k"]) -> Float[np.ndarray, " m"]:
    """How far the points of some rows are off from the robust fit of others, metres; infinite where they cannot be registered.

    A measured rotation counts as three more points, at `LEVER_SHARE` of the reach along its axes.
    """
    campaign = case.campaign
    if campaign.rotations is not None:
        axes = LEVER_SHARE * case.reach * np.swapaxes(campaign.rotations, 1, 2)
        points = np.concatenate([campaign.points, campaign.points + axes], axis=1)
        names = (*campaign.targets, "x", "y", "z")
        campaign = replace(campaign, targets=names, points=points, rotations=None, observations=(), uncertainty=None)
    fit = fit_linearly(replace(case, campaign=campaign), rows)
    return np.array([np.inf]) if fit is None else np.maximum(fit.held_out, MIN_NOISE_M)


def fit_linearly(case: Case, rows: Int[np.ndarray, " k"]) -> LinearFit | None:
    """The robust linear fit of some rows; None where they cannot be registered."""
    rows, T = case.usable(rows)
    campaign = case.campaign.take(rows)
    registration = registered_trimmed(campaign, T)
    if registration is None:
        return None
    row, target = np.nonzero(campaign.valid)
    Z, offsets = registration.T_tracker_base[:3, :3], registration.T_tool_target[:, :3, 3]
    turned = Z @ T[row, :3, :3]
    predicted = ((registration.T_tracker_base @ T)[row] @ registration.T_tool_target[target])[:, :3, 3]
    residual = campaign.points[row, target] - predicted
    J = case.model.jacobian(campaign.q)[row]
    arm = (T[row, :3, :3] @ offsets[target][:, :, None])[:, :, 0]
    moved = se3.carry(J, arm)[:, :3]
    joints = se3.carry(case.model.joint_jacobian(campaign.q)[row], arm)[:, :3] @ np.linalg.inv(drive_motion(case.robot))
    places = predicted - predicted.mean(axis=0)
    geometry = Z @ moved * (PRIOR_SCALE * case.model.tolerances)
    frames = frame_columns(places)
    own = np.zeros((len(row), 3, 3 * len(campaign.targets)))
    for t in range(len(campaign.targets)):
        own[target == t, :, 3 * t : 3 * t + 3] = turned[target == t]
    columns = np.concatenate([geometry, frames, own], axis=2)
    held = len(case.model)
    noise, left = _robustly(columns, held, residual)
    return LinearFit(
        rows=rows[row],
        targets=target,
        columns=columns,
        held=held,
        residual=residual,
        turned=turned,
        joints=Z @ joints,
        noise=noise,
        left=left,
        places=places,
        centre=predicted.mean(axis=0),
    )


def frame_columns(places: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, "m 3 6"]:
    """Derivatives of points by translation and rotation of their frame."""
    out = np.zeros((len(places), 3, 6))
    out[:, :, :3] = np.eye(3)
    for axis in range(3):
        out[:, :, 3 + axis] = np.cross(np.eye(3)[axis], places)
    return out


def registered(
    campaign: Campaign, T: Float[np.ndarray, "n 4 4"], rotation: Float[np.ndarray, "3 3"] | None = None
) -> Registration | None:
    """The registration of all rows, from a rotation on where one is given; None where they do not show all targets."""
    try:
        return register_closely(campaign, T, rotation)
    except (CampaignError, np.linalg.LinAlgError):
        return None


def registered_trimmed(campaign: Campaign, T: Float[np.ndarray, "n 4 4"]) -> Registration | None:
    """The registration of the three quarters of the rows that agree best; None where these do not show all targets."""
    found = registered(campaign, T)
    for _ in range(4):
        if found is None:
            return None
        ends = target_poses(found, T)[..., :3, 3]
        distance = np.nanmax(np.linalg.norm(campaign.points - ends, axis=2), axis=1)
        kept = np.sort(np.argsort(distance)[: int(np.ceil(TRUSTED_SHARE * len(distance)))])
        found = registered(campaign.take(kept), T[kept])
    return found


def target_poses(registration: Registration, T: Float[np.ndarray, "n 4 4"]) -> Float[np.ndarray, "n targets 4 4"]:
    """Predicted pose of every target at some poses of the tool."""
    return (registration.T_tracker_base @ T)[:, None] @ registration.T_tool_target


def _trust(distance: Float[np.ndarray, " m"], noise: float) -> Float[np.ndarray, " m"]:
    return 1.0 / (1.0 + (distance / (TUNING_MEDIANS * MEDIAN_SIGMAS * noise)) ** 2) ** 2


def _robustly(columns: np.ndarray, held: int, residual: np.ndarray) -> tuple[float, np.ndarray]:
    left, distance = residual, np.linalg.norm(residual, axis=1)
    noise = max(float(np.median(distance)) / MEDIAN_SIGMAS, MIN_NOISE_M)
    for _ in range(ROBUST_ROUNDS):
        solution = _solve(columns, held, residual, _trust(distance, noise), noise)[0]
        left = residual - columns @ solution
        distance = np.linalg.norm(left, axis=1)
        noise = max(float(np.median(distance)) / MEDIAN_SIGMAS, MIN_NOISE_M)
    return noise, left


def _solve(
    columns: np.ndarray,
    held: int,
    residual: np.ndarray,
    weight: np.ndarray,
    noise: float,
    added: np.ndarray | None = None,
) -> tuple[np.ndarray, float]:
    A = columns if added is None else np.concatenate([columns, added], axis=2)
    prior = np.full(A.shape[2], ADDED_PRIOR)
    prior[:held] = 1.0
    root = np.sqrt(weight)[:, None] / noise
    flat = (A * root[:, :, None]).reshape(-1, A.shape[2])
    b = (residual * root).reshape(-1)
    H, g = flat.T @ flat + np.diag(prior), flat.T @ b
    solution = np.linalg.solve(H, g)
    return solution, float(b @ b - g @ solution)


# Tracker frame and targets for many hypotheses at once, and how far off the measurements are then.
#
# The closed form of `registration_start.closed_form`, by normal equations over a batch: M·y + m = p + R·o is linear
# in the unconstrained matrix M, the vector m and the offsets o. Concentration steps (Rousseeuw and Van Driessen
# 2006) keep the best three quarters.

CHUNK = 400
"""Hypotheses fitted together: what they need stays in the cache and below 100 MB."""

QUICK_ROUNDS = 3
"""Fits, the first to all points, the others to the best of them. A convention: concentration steps settle fast, and each costs
a fit."""

RIDGE_SHARE = 1e-10
"""Share of the normal equations' mean diagonal that is added to it: columns that hardly matter stay at zero. A convention: far
above rounding, far below any information."""

LEVER_SHARE = 0.25
"""Lever over the reach by which a measured rotation's error counts as a distance. A convention."""


MIN_ERROR_M = 2e-4
"""Distance, metres, below which no two explanations are told apart. A convention: below it, noise decides."""


def misfits(
    T: Float[np.ndarray, "h n 4 4"],
    points: Float[np.ndarray, "h n targets 3"],
    rotations: Float[np.ndarray, "h n 3 3"] | None,
    lever: float,
    rounds: int = QUICK_ROUNDS,
) -> Float[np.ndarray, " h"]:
    """Typical distance of the measured points from the registered poses, metres; infinite where poses are not finite.

    It is a geometric mean: a few rows may be off as far as they like, and a mistake that only some rows show still counts.

    Args:
        T: tool poses of every hypothesis.
        points: measured points, NaN where the beam was lost.
        rotations: measured orientations, if there are.
        lever: metres at which the error of a rotation counts.
        rounds: fits to what the one before leaves nearest; the first one is to all points.
    """
    parts = [slice(i, i + CHUNK) for i in range(0, len(T), CHUNK)]
    return np.concatenate(
        [
            _misfit(T[part], points[part], None if rotations is None else rotations[part], lever, rounds)
            for part in parts
        ]
    )


def _misfit(
    T: np.ndarray, points: np.ndarray, rotations: np.ndarray | None, lever: float, rounds: int
) -> Float[np.ndarray, " h"]:
    closes = np.isfinite(T[..., 0, 3])
    usable = closes.mean(axis=1) >= TRUSTED_SHARE
    T = np.where(closes[..., None, None], T, np.eye(4))
    seen = ~np.isnan(points[..., 0]) & closes[..., None]
    y = np.where(seen[..., None], points, 0.0)
    weight = seen.astype(float)
    distance = np.zeros(seen.shape)
    for _ in range(rounds):
        Z = _rotation(T, y, weight)
        distance = _distances(Z, T, y, weight, rotations, lever)
        distance = np.where(seen, distance, np.inf)
        count = np.maximum(np.ceil(TRUSTED_SHARE * seen.sum(axis=(1, 2))).astype(int) - 1, 0)
        flat = np.sort(distance.reshape(len(T), -1), axis=1)
        bound = flat[np.arange(len(T)), count]
        weight = (distance <= bound[:, None, None]).astype(float)
    return np.where(usable, _typical(distance, seen), np.inf)


def _typical(distance: np.ndarray, seen: np.ndarray) -> Float[np.ndarray, " h"]:
    """Geometric mean of what was seen, metres."""
    log = np.log(np.maximum(np.where(seen, distance, 1.0), MIN_ERROR_M)) * seen
    return np.exp(log.sum(axis=(1, 2)) / np.maximum(seen.sum(axis=(1, 2)), 1))


def _rotation(T: np.ndarray, y: np.ndarray, weight: np.ndarray) -> Float[np.ndarray, "h 3 3"]:
    """Rotation from base to tracker, nearest to the inverse of the unconstrained matrix."""
    h, n, count = weight.shape
    centre = (weight[..., None] * y).sum(axis=(1, 2)) / np.maximum(weight.sum(axis=(1, 2)), 1.0)[:, None]
    centred = np.where(weight[..., None] > 0, y - centre[:, None, None], 0.0)
    unknowns = 12 + 3 * count
    A = np.zeros((h, n, count, 3, unknowns))
    for i in range(3):
        A[..., i, 3 * i : 3 * i + 3] = centred
        A[..., i, 9 + i] = 1.0
    for t in range(count):
        A[:, :, t, :, 12 + 3 * t : 15 + 3 * t] = -T[..., :3, :3]
    A *= weight[..., None, None]
    b = np.broadcast_to(T[:, :, None, :3, 3], (h, n, count, 3)) * weight[..., None]
    A, b = A.reshape(h, -1, unknowns), b.reshape(h, -1, 1)
    M = _solve_quick(A, b)[:, :9, 0].reshape(h, 3, 3)
    return np.swapaxes(se3.nearest_rotation(M), 1, 2)


def _distances(
    Z: np.ndarray, T: np.ndarray, y: np.ndarray, weight: np.ndarray, rotations: np.ndarray | None, lever: float
) -> Float[np.ndarray, "h n targets"]:
    """Distance of every point from its prediction with the best translation and offsets, metres."""
    h, n, count = weight.shape
    A = np.zeros((h, n, count, 3, 3 + 3 * count))
    A[..., :3] = np.eye(3)
    turned = Z[:, None] @ T[..., :3, :3]
    for t in range(count):
        A[:, :, t, :, 3 + 3 * t : 6 + 3 * t] = turned
    b = y - (Z[:, None] @ T[..., :3, 3:])[..., 0][:, :, None]
    w = weight[..., None, None]
    solution = _solve_quick((w * A).reshape(h, -1, 3 + 3 * count), (w[..., 0] * b).reshape(h, -1, 1))
    residual = b - (A.reshape(h, -1, 3 + 3 * count) @ solution).reshape(b.shape)
    square = (residual**2).sum(axis=-1)
    if rotations is not None:
        relative = np.swapaxes(turned, -1, -2) @ rotations
        X = se3.nearest_rotation((w[:, :, 0] * relative).sum(axis=1))
        chord = ((turned @ X[:, None] - rotations) ** 2).sum(axis=(-1, -2))
        square = square + lever**2 * 0.5 * chord[..., None]
    return np.sqrt(square)


def _solve_quick(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    At = np.swapaxes(A, 1, 2)
    H = At @ A
    k = np.arange(H.shape[1])
    H[:, k, k] += RIDGE_SHARE * np.maximum(H[:, k, k].mean(axis=1), 1e-12)[:, None] + 1e-300
    return np.linalg.solve(H, At @ b)
