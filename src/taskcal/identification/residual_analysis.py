"""What a calibration leaves, and what it goes with: evidence for the next effect, or that there is none to be had.

Each quantity is put to the test by itself: a smooth function of it, a cubic spline held by a ridge, is fitted to the
residuals and predicts those of poses that were left out. The share of their variance that it explains is compared with
shares after the quantity was shuffled among the poses (permutation test), so that a high share by chance shows as such.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.holdout import split_postures
from taskcal.short_repr import short_repr

# What the remainder of a calibration may go with: quantities that vary from pose to pose, and what each would move.

MIN_VARIATION = 1e-6
"""Range, in SI units, below which a quantity is constant. A convention: below any reading of a joint, a position or a
temperature."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Regressor:
    """A quantity, and the directions in which the tool would move with it."""

    name: str
    moves: str
    """What it would move: ``turn of J2``, ``tool in base axes`` …"""
    values: Float[np.ndarray, "n parts"]
    """Of the quantity at each pose, SI units; several parts act one beside the other."""
    carrier: Float[np.ndarray, "n 3 directions"]
    """Movement of the measured point for a unit along each direction, in base axes."""
    unit: str
    """In which the quantity is shown."""
    scale: float
    """From SI to that unit."""
    smooth: bool = True
    """Whether any smooth function of it is meant; else a multiple of it."""


def list_regressors(calibration: Calibration, campaign: Campaign) -> tuple[Regressor, ...]:
    """All quantities that a campaign tells and that vary in it.

    The turn of a joint may go with its own angle (gears, encoders), with gravity's lever about its axis (what the drive
    yields, beyond a straight line too), with the side it was approached from (lost motion) and with its last move (a rest
    of it). The tool may move with the order of measurement and the temperature (drift), with its own tilt (bending), and
    along the beam with the distance from the tracker (the tracker's scale).

    Args:
        calibration: whose remainder it is.
        campaign: the measurements.
    """
    T = calibration.tool_in_base(campaign.q, campaign.conditions)
    # of the mean of the targets
    arm = np.einsum("nij,j->ni", T[:, :3, :3], calibration.T_tool_target[:, :3, 3].mean(axis=0))
    gravity = calibration.model.robot.statics.gravity
    regressors = [
        *_of_joints(calibration, campaign, arm),
        *_of_time(campaign),
        Regressor(
            name="tilt of the tool",
            moves="tool in its own axes",
            values=np.einsum("nji,j->ni", T[:, :3, :3], gravity),
            carrier=T[:, :3, :3],
            unit="of gravity",
            scale=1.0,
        ),
        _of_distance(calibration, campaign, T[:, :3, 3] + arm),
    ]
    return tuple(r for r in regressors if np.ptp(r.values, axis=0).max() > MIN_VARIATION)


def _of_joints(calibration: Calibration, campaign: Campaign, arm: Float[np.ndarray, "n 3"]) -> Iterator[Regressor]:
    """Position, gravity's lever, approach and last move of every joint, each of which would turn it."""
    robot, q = calibration.model.robot, campaign.q
    columns = se3.carry(calibration.model.joint_jacobian(q, calibration.estimate), arm)[:, :3]
    lever = np.einsum("i,nij->nj", robot.statics.gravity, columns)
    for j, joint in enumerate(robot.joint_names):
        slides = bool(robot.prismatic[j])
        moves, carrier = f"{'shift' if slides else 'turn'} of {joint}", columns[:, :, j : j + 1]
        yield Regressor(
            name=f"position of {joint}",
            moves=moves,
            values=q[:, j : j + 1],
            carrier=carrier,
            unit="mm" if slides else "°",
            scale=1e3 if slides else 180.0 / np.pi,
        )
        yield Regressor(
            name=f"gravity on {joint}",
            moves=moves,
            values=lever[:, j : j + 1],
            carrier=carrier,
            unit="m of lever",
            scale=1.0,
        )
        if campaign.approach is not None:
            yield Regressor(
                name=f"approach of {joint}",
                moves=moves,
                values=campaign.approach[:, j : j + 1],
                carrier=carrier,
                unit="side",
                scale=1.0,
                smooth=False,
            )
        if campaign.move is not None:
            yield Regressor(
                name=f"last move of {joint}",
                moves=moves,
                values=campaign.move[:, j : j + 1],
                carrier=carrier,
                unit="mm" if slides else "°",
                scale=1e3 if slides else 180.0 / np.pi,
            )


def _of_time(campaign: Campaign) -> Iterator[Regressor]:
    """Order and temperature, which would move the whole tool."""
    axes = np.broadcast_to(np.eye(3), (len(campaign), 3, 3))
    order = np.arange(len(campaign), dtype=float)[:, None]
    yield Regressor(
        name="order of measurement", moves="tool in base axes", values=order, carrier=axes, unit="row", scale=1.0
    )
    warmth = campaign.temperature
    if warmth is not None and np.isfinite(warmth).all():
        yield Regressor(
            name="temperature", moves="tool in base axes", values=warmth[:, None], carrier=axes, unit="°C", scale=1.0
        )


def _of_distance(calibration: Calibration, campaign: Campaign, point: Float[np.ndarray, "n 3"]) -> Regressor:
    """Distance from the tracker, which stands in the origin of its frame, and of a moved one from its station of each row."""
    stood, own = campaign.stations, calibration.stations
    base = calibration.T_tracker_base[None]
    if stood is not None:
        base = np.stack([own.get(name, calibration.T_tracker_base) for name in stood.names])[stood.of]
    beam = point - se3.inverse(base)[:, :3, 3]
    distance = np.linalg.norm(beam, axis=1, keepdims=True)
    return Regressor(
        name="distance from the tracker",
        moves="tool along the beam",
        values=distance,
        carrier=(beam / distance)[:, :, None],
        unit="mm",
        scale=1e3,
    )


MIN_POSES = 30
"""Poses at least from which on something is said of residuals. A convention: a correlation of 0.36 is beyond chance at 5 % with
30."""

STRENGTHS = tuple(10.0**k for k in range(-2, 5))
"""Of ridges that are tried; a strength of one shrinks as much as one more row of unit size would."""

KNOT_RANGE, POSES_PER_KNOT = (6, 40), 15
"""Fewest and most knots of a spline, and poses for each; splines of several directions or parts have the fewest."""

MAX_P_VALUE, MIN_SHARE = 0.01, 0.01
"""p-value up to which a share is called proven, and the smallest share that is."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Explained:
    """How much of the remainder goes with one quantity."""

    regressor: Regressor
    share: float
    """Of the variance on poses left out; below zero where it predicts worse than nothing."""
    p_value: float | None
    """Chance of such a share where the quantity does not matter; None where the share is not above zero."""

    @property
    def proven(self) -> bool:
        """Whether the share is one per cent or more, and chance gives as much once in a hundred or less."""
        return self.p_value is not None and self.p_value <= MAX_P_VALUE and self.share >= MIN_SHARE


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class ResidualAnalysis:
    """Residual at every pose, and the quantities that explain it."""

    residual: Float[np.ndarray, "n 3"]
    """Measured less predicted, mean over the targets seen, in base axes, metres."""
    rms: float
    """Of its length, metres."""
    tracker: float
    """What the tracker's noise alone would leave of it, metres rms."""
    non_rigid: float | None
    """Where three targets or more were seen: rms per coordinate, metres, by which they move against each other, which no
    motion of the robot explains; None otherwise."""
    rigid: float | None
    """The same of their common motion as one rigid body."""
    explained: tuple[Explained, ...]
    """The largest share first."""

    def summary(self) -> dict[str, Any]:
        """The report, in millimetres."""
        return {
            "rms_mm": self.rms * 1e3,
            "tracker_mm": self.tracker * 1e3,
            "targets_apart_mm": None if self.non_rigid is None else self.non_rigid * 1e3,
            "targets_together_mm": None if self.rigid is None else self.rigid * 1e3,
            "explained": [
                {"quantity": e.regressor.name, "moves": e.regressor.moves, "share": e.share, "p_value": e.p_value}
                for e in self.explained
            ],
        }


def analyse_residuals(
    calibration: Calibration, campaign: Campaign, *, permutations: int = 99, folds: int = 5, seed: int = 0
) -> ResidualAnalysis:
    """Find the quantities that explain the residuals of a calibration.

    Args:
        calibration: the calibration.
        campaign: the measurements that it was fitted to, or others of the same targets.
        permutations: of each quantity, for its p-value.
        folds: of the cross-validation.
        seed: of folds and permutations.

    Raises:
        CampaignError: too few poses, or other targets than the calibration's.
    """
    if campaign.targets != calibration.targets:
        raise CampaignError(
            f"the campaign's targets are {', '.join(campaign.targets)}, the calibration's {', '.join(calibration.targets)}; "
            "name the calibration's targets"
        )
    campaign = campaign.take(np.flatnonzero(campaign.valid.any(axis=1)))
    if len(campaign) < MIN_POSES:
        raise CampaignError(f"{len(campaign)} poses are too few to say what residuals go with; at least {MIN_POSES}")
    each = calibration.residuals_on(campaign, frame="base")[..., :3]
    residual = np.nanmean(each, axis=1)
    noise = np.where(campaign.valid, np.trace(campaign.covariances()[..., :3, :3], axis1=2, axis2=3), 0.0)
    tracker = float(np.sqrt(np.mean(noise.sum(axis=1) / campaign.valid.sum(axis=1) ** 2)))
    ends = calibration.target_poses(campaign.q, campaign.conditions)[..., :3, 3]
    rigid, non_rigid = _move_as_one(each, ends @ calibration.T_tracker_base[:3, :3])
    parts = split_postures(campaign.q, folds, seed)
    rng = np.random.default_rng(seed)
    explained = [_explain(r, residual, parts, permutations, rng) for r in list_regressors(calibration, campaign)]
    return ResidualAnalysis(
        residual=residual,
        rms=float(np.sqrt((residual**2).sum(axis=1).mean())),
        tracker=tracker,
        non_rigid=non_rigid,
        rigid=rigid,
        explained=tuple(sorted(explained, key=lambda e: -e.share)),
    )


def fit_smooth(regressor: Regressor, residual: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n directions"]:
    """The smooth function of a quantity, at the poses: along each of its directions, metres or radians."""
    basis, features = _features(regressor)
    X = _stacked(features)
    square = X.T @ X + _strength(features, residual) * np.eye(X.shape[1])
    weights = np.linalg.solve(square, X.T @ residual.ravel()).reshape(basis.shape[1], -1)
    return basis @ weights / _size(regressor)


def _explain(
    regressor: Regressor,
    residual: Float[np.ndarray, "n 3"],
    parts: list[Int[np.ndarray, " _"]],
    permutations: int,
    rng: np.random.Generator,
) -> Explained:
    basis, features = _features(regressor)
    strength = _strength(features, residual)
    share = _share(features, residual, parts, strength)
    if share <= 0.0:
        return Explained(regressor=regressor, share=share, p_value=None)
    by_chance = [
        _share(_carried(basis[rng.permutation(len(basis))], regressor), residual, parts, strength)
        for _ in range(permutations)
    ]
    p_value = (1 + sum(chance >= share for chance in by_chance)) / (1 + permutations)
    return Explained(regressor=regressor, share=share, p_value=p_value)


def _features(regressor: Regressor) -> tuple[Float[np.ndarray, "n k"], Float[np.ndarray, "n 3 features"]]:
    """The quantity's own functions, and the movements that they carry."""
    if not regressor.smooth:
        basis = regressor.values / max(float(np.abs(regressor.values).max()), 1e-12)
    else:
        fewest, most = KNOT_RANGE
        single = regressor.carrier.shape[2] == 1 == regressor.values.shape[1]
        knots = int(np.clip(len(regressor.values) // POSES_PER_KNOT, fewest, most)) if single else fewest
        varying = regressor.values[:, np.ptp(regressor.values, axis=0) > 1e-9]
        basis = np.hstack([_cubic_splines(values, knots) for values in varying.T])
    return basis, _carried(basis, regressor)


def _cubic_splines(values: Float[np.ndarray, " n"], knots: int) -> Float[np.ndarray, "n k"]:
    """Cubic B-splines at values, over equidistant knots from the least to the greatest of them."""
    from scipy.interpolate import BSpline

    low, high = float(values.min()), float(values.max())
    outside = 3 * (high - low) / (knots - 1)
    all_knots = np.linspace(low - outside, high + outside, knots + 6)
    # rounding puts the outermost inner knots beside the outermost values
    return BSpline.design_matrix(np.clip(values, all_knots[3], all_knots[-4]), all_knots, 3).toarray()


def _carried(basis: Float[np.ndarray, "n k"], regressor: Regressor) -> Float[np.ndarray, "n 3 features"]:
    carrier = regressor.carrier / _size(regressor)
    return (basis[:, None, :, None] * carrier[:, :, None]).reshape(len(basis), 3, -1)


def _size(regressor: Regressor) -> float:
    """Size of the movement, so that a ridge treats all quantities alike."""
    return float(np.sqrt((regressor.carrier**2).sum(axis=1).mean()))


def _stacked(features: Float[np.ndarray, "n 3 features"]) -> Float[np.ndarray, "rows features"]:
    return features.reshape(-1, features.shape[2])


def _strength(features: Float[np.ndarray, "n 3 features"], residual: Float[np.ndarray, "n 3"]) -> float:
    """Strength of the ridge whose fits without a row predict it best: Golub, Heath and Wahba (1979), eq. 1.2."""
    X, y = _stacked(features), residual.ravel()
    U, s, _ = np.linalg.svd(X, full_matrices=False)
    along, leverage = U.T @ y, U**2

    def left_out(strength: float) -> float:
        shrunk = s**2 / (s**2 + strength)
        return float(np.mean(((y - U @ (shrunk * along)) / (1.0 - leverage @ shrunk)) ** 2))

    return min(STRENGTHS, key=left_out)


def _share(
    features: Float[np.ndarray, "n 3 features"],
    residual: Float[np.ndarray, "n 3"],
    parts: list[Int[np.ndarray, " _"]],
    strength: float,
) -> float:
    """Share of the residuals' variance that the features predict on parts left out, by ridge regression."""
    split = [(_stacked(features[part]), residual[part].ravel()) for part in parts]
    squares, products = [X.T @ X for X, _ in split], [X.T @ y for X, y in split]
    square, product = sum(squares) + strength * np.eye(features.shape[2]), sum(products)
    left = sum(
        float(np.sum((y - X @ np.linalg.solve(square - own, product - by)) ** 2))
        for (X, y), own, by in zip(split, squares, products, strict=True)
    )
    return 1.0 - left / float((residual**2).sum())


def _move_as_one(
    each: Float[np.ndarray, "n targets 3"], position: Float[np.ndarray, "n targets 3"]
) -> tuple[float | None, float | None]:
    """Rms per coordinate of the targets' common rigid motion, and of what they move against each other."""
    whole = np.isfinite(each).all(axis=(1, 2))
    targets = each.shape[1]
    if targets < 3 or not whole.any():
        return None, None
    offset = position[whole] - position[whole].mean(axis=1, keepdims=True)
    M = se3.by_twist(offset).reshape(len(offset), 3 * targets, 6)
    moved = each[whole].reshape(len(offset), -1)
    common = np.einsum("nij,nj->ni", M, np.einsum("nij,nj->ni", np.linalg.pinv(M), moved))
    non_rigid = (moved - common).ravel()
    # six of a pose's coordinates go into its motion
    return float(np.sqrt(np.mean(common**2))), float(np.sqrt((non_rigid**2).sum() / (len(moved) * (3 * targets - 6))))
