"""How well a calibration predicts a campaign."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.arguments import checked
from taskcal.campaigns.campaign import Campaign
from taskcal.errors import CampaignError, listed
from taskcal.estimation.noisy_rows import MIN_VARIANCE, PoseNoise
from taskcal.geometry import se3
from taskcal.identification.calibration import (
    Calibration,
    as_known,
    covariance_on,
    in_its_frames,
    residuals_on,
    spread_of,
    unknowns_of,
)
from taskcal.identification.group_model import of_targets
from taskcal.identification.held_out import (
    FOLLOWED_BY_PLACE,
    Outlier,
    Validation,
    in_regions,
    shared_with_neighbours,
    studentise,
)
from taskcal.identification.hyperparameters import Hyperparameters, fit_weighed, stopping_of
from taskcal.identification.identify import fit_nominal
from taskcal.identification.layout import errors_by_unlocated, layout_of, prior_of
from taskcal.identification.measured_range import MeasuredRange, name_rows
from taskcal.identification.options import FitOptions
from taskcal.identification.problem import Problem, problem_of, whitener
from taskcal.observations import Compared
from taskcal.observations.base import TrackerNoise
from taskcal.registration.plausibility import check_plausible
from taskcal.registration.registration import PLAUSIBLE_SHARE, register
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr


@checked
def validate(calibration: Calibration, campaign: Campaign, *, reregister: bool = False) -> Validation:
    """Compare a campaign with the calibration's predictions.

    Args:
        calibration: the calibration.
        campaign: measurements, of the calibration's own targets unless `reregister`.
        reregister: refit tracker frame and targets to this campaign, with the robot's geometry frozen; for a tracker or a
            target that has been moved.

    Raises:
        CampaignError: nothing was measured, or the targets are not the calibration's.
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    return _validation(calibration, reregister_frames(calibration, campaign) if reregister else calibration, campaign)


def _validation(stored: Calibration, calibration: Calibration, campaign: Campaign) -> Validation:
    """Errors by a calibration, or by `stored` in frames that were refitted to these rows, with what qualifies them."""
    _, others = in_its_frames(calibration, campaign)
    residual = errors_on(calibration, campaign)
    if not campaign.valid.any():
        raise CampaignError("the campaign has no measured point to compare with: every beam was lost")
    validation = replace(
        Validation.of_residuals(residual, calibration.T_tracker_base[:3, :3], as_known(calibration, campaign).kinds),
        compared=_compared(calibration, campaign),
        remarks=_station_remarks(calibration, campaign, others),
    )
    remarks = [*_fitted_remarks(stored, campaign), *_refitted_remarks(stored, calibration, campaign)]
    off = float(np.median(validation.errors))
    if off > PLAUSIBLE_SHARE * calibration.model.robot.reach:
        remarks.append(
            f"the campaign is {off * 1e3:.0f} mm away from what the calibration predicts: if the tracker or the target was moved, "
            "rerun with --reregister; otherwise units, joint columns or robot model differ: "
            "run 'taskcal doctor' (in Python: reregister=True, diagnose)"
        )
    outside = calibration.measured_range.warning(
        campaign.q, name_rows([campaign.row_of(row) for row in range(len(campaign))], campaign.ids)
    )
    return replace(validation, remarks=(*validation.remarks, *remarks, *([outside] if outside else [])))


SAME_JOINTS = 1e-7
"""Difference of joint values that writing a row again may leave, radians (metres)."""

SAME_RESIDUAL = 1e-6
"""Difference of residuals that writing a row again may leave, metres (radians): files state points to 0.001 mm at least. Another
measurement of the pose has other noise, along three axes."""

SAME_LENGTH = 1e-8
"""The same of the lengths of residuals, all that can be compared where several stations have axes of their own, metres: those of
other measurements agree by chance more easily than three coordinates do."""


def fitted_rows(calibration: Calibration, campaign: Campaign) -> Bool[np.ndarray, " n"]:
    """Rows that are among those to which a calibration was fitted, in whatever order and under whatever name.

    They have the joint values of one of them, and leave what that one left.

    Args:
        calibration: the calibration.
        campaign: measurements.
    """
    from scipy.spatial import KDTree

    out = np.zeros(len(campaign), dtype=bool)
    shared = [name for name in campaign.targets if name in calibration.targets]
    if not shared or len(calibration.q) == 0:
        return out
    tree = KDTree(calibration.q)
    distance, nearest = map(np.asarray, tree.query(campaign.q))
    at = distance <= SAME_JOINTS
    if not at.any():
        return out
    known = as_known(calibration, campaign.of_targets(shared))
    found, stored = residuals_on(calibration, known), calibration.residuals[:, calibration.rows_of(shared)]
    width, within = min(found.shape[2], stored.shape[2]), SAME_RESIDUAL
    found, stored = found[..., :width], stored[..., :width]
    if campaign.stations is not None or len(calibration.stations) > 1:
        found, stored = (np.linalg.norm(one[..., :3], axis=2, keepdims=True) for one in (found, stored))
        within = SAME_LENGTH

    def same(rows: Int[np.ndarray, " k"], fitted: Int[np.ndarray, " k"]) -> Bool[np.ndarray, " k"]:
        off = np.abs(stored[fitted] - found[rows])
        seen = np.isfinite(off)
        return np.asarray(seen.any(axis=(1, 2)) & (off <= within).all(axis=(1, 2), where=seen))

    rows = np.flatnonzero(at)
    out[rows] = same(rows, nearest[rows])
    for row in rows[~out[rows]]:  # of a pose that was measured several times each
        near = np.array(tree.query_ball_point(campaign.q[row], SAME_JOINTS))
        out[row] = bool(same(np.full(len(near), row), near).any())
    return out


def _fitted_remarks(calibration: Calibration, campaign: Campaign) -> tuple[str, ...]:
    """Say how many rows the calibration was fitted to: their errors are those of the fit."""
    fitted = fitted_rows(calibration, campaign)
    if not fitted.any():
        return ()
    named = listed((campaign.row(int(row)) for row in np.flatnonzero(fitted)), MAX_FITTED)
    return (
        f"{fitted.sum()} of {len(campaign)} rows are those that the calibration was fitted to ({named}): their errors are "
        "residuals of the fit, which underestimate those of other poses, and count in no decision; judge it by rows that were not "
        "fitted",
    )


MAX_FITTED = 3
"""Fitted rows that a remark names."""


def kept_share(stored: Calibration, fitted: Calibration, campaign: Campaign) -> float:
    """Share of the measured numbers that is left to judge by, once frames and targets were found from the same rows.

    A fit takes as many of the numbers as it has unknowns, and as much of the squares of independent errors.

    Args:
        stored: the calibration.
        fitted: the same, or in frames that were refitted to the campaign.
        campaign: measurements.
    """
    unknowns = 6 * len(in_its_frames(fitted, campaign)[1]) if campaign.tracked else 0
    if fitted is not stored:
        unknowns += len(fitted.z) - len(fitted.estimate)
    valid, turns = int(campaign.valid.sum()), fitted.layout.pose and campaign.rotations is not None
    return max(1.0 - unknowns / ((6 if turns else 3) * valid), 0.0) if campaign.tracked and valid else 1.0


def _refitted_remarks(stored: Calibration, calibration: Calibration, campaign: Campaign) -> tuple[str, ...]:
    """Say that the rows that are judged located the frames, where they are so few that this takes much of their errors."""
    kept = kept_share(stored, calibration, campaign)
    if calibration is stored or kept >= ENOUGH_KEPT:
        return ()
    return (
        f"tracker frame and targets were found from these {len(campaign)} rows themselves, which leaves about "
        f"{np.sqrt(kept):.2f} of the errors that predicted rows have: measure more rows",
    )


ENOUGH_KEPT = 0.9
"""Share of the measured numbers that frames which are found from them leave, from which on nothing is said: errors are 5 % less."""


def _station_remarks(calibration: Calibration, campaign: Campaign, others: tuple[str, ...]) -> tuple[str, ...]:
    """Say of which station rows are taken to be that name none, and of which the frame was found from the rows that are judged."""
    if campaign.stations is None and len(calibration.stations) > 1:
        first, *more = calibration.stations
        return (
            f"the rows name no station, and are taken for those of '{first}'; the calibration knows {', '.join(more)} too: name "
            "theirs in a column station, or refit the frames (--reregister)",
        )
    if not others or campaign.stations is None:
        return ()
    rows = dict(zip(campaign.stations.names, campaign.stations.rows, strict=True))
    named = ", ".join(f"{name} ({rows[name]} rows)" for name in others)
    return (
        f"the calibration does not know {'stations' if len(others) > 1 else 'station'} {named}: each frame was found from these "
        "rows themselves, which makes their errors a little smaller than those of predicted rows",
    )


def _compared(calibration: Calibration, campaign: Campaign) -> tuple[Compared, ...]:
    """Lengths that are stated, and as the calibrated robot finds them in a campaign."""
    found = unknowns_of(calibration, campaign, settled=True)
    return tuple(
        one for kind, unknown in zip(campaign.observations, found, strict=True) for one in kind.compare(unknown)
    )


def errors_on(calibration: Calibration, campaign: Campaign) -> Float[np.ndarray, "n targets b"]:
    """Residuals that a validation judges: measured less predicted in the tracker's frame.

    Without a tracker, what stands (sockets, anchors …) is where the calibrated robot finds it in this campaign.

    Raises:
        CampaignError: a target that the calibration does not know.
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    return residuals_on(calibration, campaign, settled=True)


def reregister_frames(
    calibration: Calibration, campaign: Campaign, *, noise: TrackerNoise | None = None
) -> Calibration:
    """Refit tracker frame and targets of a calibration to a campaign, with the robot held as calibrated.

    Positions and rotations count by the covariance that they had in the fit: the instrument's noise, and the calibration's own
    errors of position, rotation and joints at a single pose.

    Args:
        calibration: the calibration.
        campaign: measurements.
        noise: the tracker's, where the campaign does not state uncertainties.

    Returns:
        the calibration in its new frames; their covariance is that of these rows, with the robot as calibrated.

    Raises:
        CampaignError: too few rows, or joints and points that do not belong together.
        FitError: the fit of the frames did not converge.
    """
    campaign = as_known(calibration, campaign)
    registration = register(
        calibration.model, campaign, poses=calibration.tool_in_base(campaign.q, campaign.conditions)
    )
    check_plausible(registration, calibration.model, campaign)
    frames = replace(
        layout_of(calibration.model, np.arange(0), registration, campaign, fixed=False), given=calibration.estimate
    )
    problem = problem_of(frames, campaign, noise)
    z, covariance = _fit_frames(problem, calibration)
    from scipy.linalg import block_diag

    p = len(calibration.model)
    layout = replace(frames, estimated=np.arange(p), given=None)
    T_tracker_base, T_tool_target = frames.frames(z)
    unseen = np.full((*calibration.residuals.shape[:1], len(frames.targets), frames.block_size), np.nan)
    return replace(
        calibration,
        residuals=unseen,  # the rows of the fit were not measured in these frames
        studentised=unseen[..., 0],
        T_tracker_base=T_tracker_base,
        T_tool_target=T_tool_target,
        layout=layout,
        z=np.concatenate([calibration.estimate, z]),
        z_spread=block_diag(calibration.z_spread[:p, :p], spread_of(covariance)),
    )


def _fit_frames(problem: Problem, calibration: Calibration) -> tuple[Float[np.ndarray, " z"], Float[np.ndarray, "z z"]]:
    """Estimate of tracker frame and targets, and its covariance."""
    start, targets, width = problem.layout.start(), len(problem.layout.targets), problem.layout.block_size
    position, rotation = np.maximum(np.square(np.resize(calibration.model_error, 2)), MIN_VARIANCE)
    joints = np.zeros(len(calibration.model.robot.joints))
    joints[: len(calibration.joint_error)] = np.square(calibration.joint_error)
    errors = PoseNoise(position=float(position), rotation=float(rotation) if width == 6 else None, joints=joints)
    blocks = of_targets(problem.linearise(start).covariance(errors, problem.noise), targets)
    prior, equations = prior_of(problem.layout, "tolerances"), problem.equations(whitener(blocks))
    hyper = Hyperparameters(variances=errors.variances[: width // 3], prior_factor=1.0)
    by = fit_weighed(problem, prior, hyper, start, stopping_of(problem), equations=equations)
    held = errors_by_unlocated(prior.unlocated, by.posterior, by.solution.information)
    return by.solution.z, by.posterior + held @ held.T


# A calibration put to the test by a campaign that it has not seen: point by point, with what it stated of its own
# uncertainty.


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
    refitted, for which the calibration states nothing."""
    inside: Bool[np.ndarray, " points"] | None
    """Whether each point is in the 95 % region that is stated for it, noise included; of kinds without a tracker what they measure,
    and of what is located by these very rows no more than they leave."""
    judged: Bool[np.ndarray, " points"]
    """Points of which `inside` says anything: not those that alone locate what they refer to, such as a socket."""
    rotation_inside: Bool[np.ndarray, " turned"] | None
    """The same of each rotation that was measured and is judged; None for points."""
    outliers: tuple[Outlier, ...]
    """Points too far off for chance, the worst first."""
    shared: tuple[bool, ...] = ()
    """Whether neighbouring rows or poses have much the same error as each outlier, as those do that a model leaves."""
    measured_range: MeasuredRange
    """Where the calibration was measured."""
    fitted: Bool[np.ndarray, " points"]
    """Whether each point is of a row that the calibration was fitted to."""
    kept: float
    """Share of the measured numbers that is left to judge by, once frames were found from these very rows (`kept_share`)."""
    off_stored: float | None = None
    """If this is the campaign that the calibration was fitted to: how far its residuals are off the calibration's own, metres or
    radians."""

    @cached_property
    def outside(self) -> Bool[np.ndarray, " points"]:
        """Whether each point was measured at a pose outside of what the calibration was fitted to."""
        return self.measured_range.outside(self.campaign.q)[list(self.validation.rows)]

    def by_range(self) -> dict[str, tuple[Validation, float | None]]:
        """The errors inside and outside of the measured range, each with the share that lies in its stated region.

        Empty where all points are on one side.
        """
        if self.outside.all() or not self.outside.any():
            return {}
        return {
            name: (
                self.validation.of_points(points),
                self.inside_share(points),
            )
            for name, points in (("inside_range", ~self.outside), ("outside_range", self.outside))
        }

    def inside_share(self, points: Bool[np.ndarray, " points"] | None = None) -> float | None:
        """Share of the points, or of some, that are in their regions; None where none is judged."""
        judged = self.judged if points is None else self.judged & points
        return None if self.inside is None or not judged.any() else float(self.inside[judged].mean())

    @cached_property
    def _farthest(self) -> list[dict[str, Any]]:
        return self.measured_range.farthest(self.campaign.q)

    @property
    def worst_first(self) -> Int[np.ndarray, " points"]:
        """Numbers of the points by their error."""
        return np.argsort(-self.validation.errors, kind="stable")

    def points(self) -> list[dict[str, Any]]:
        """Every point in millimetres and milliradians, in the order of the campaign.

        Of a kind that measures one number its error with its sign; along the axes of the base only what was measured along them;
        of a kind that measures angles alone no millimetres.
        """
        return [self._point(k) for k in range(len(self.validation))]

    def _point(self, k: int) -> dict[str, Any]:
        validation, row = self.validation, self.validation.rows[k]
        out: dict[str, Any] = {
            "row": self.campaign.row_of(row),
            "line": self.campaign.line_of(row),
            "id": self.campaign.ids[row],
            "target": self.campaign.targets[self.targets[k]],
        }
        if validation.lengths is None or validation.lengths[k]:
            out["error_mm"] = float(validation.errors[k]) * 1e3
        out |= self._farthest[row]
        if np.isfinite(self.signed[k]):
            out["signed_mm"] = float(self.signed[k]) * 1e3
        if np.isfinite(validation.components[k]).all():
            out |= {
                f"{axis}_mm": float(value) * 1e3 for axis, value in zip("xyz", validation.components[k], strict=True)
            }
        if validation.rotations is not None and np.isfinite(validation.rotations[k]):
            out["error_mrad"] = float(validation.rotations[k]) * 1e3
        if self.studentised is not None and self.inside is not None:
            inside = bool(self.inside[k]) if self.judged[k] else None
            out |= {"studentised": float(self.studentised[k]), "inside": inside}
        return out

    def summary(self) -> dict[str, Any]:
        """Summary: that of `Validation.summary`, coverage of the stated regions, outliers, and every point.

        Where some points lie outside of the measured range, and others inside, the errors of both.
        """
        compared = [
            {"name": one.name, "stated_mm": one.stated * 1e3, "found_mm": one.found * 1e3}
            for one in self.validation.compared
        ]
        return {
            **self.validation.summary(),
            "inside_share": self.inside_share(),
            "rotation_inside_share": None if self.rotation_inside is None else float(self.rotation_inside.mean()),
            "outside_points": int(self.outside.sum()),
            "off_stored_mm": None if self.off_stored is None else self.off_stored * 1e3,
            **{name: {**part.summary(), "inside_share": share} for name, (part, share) in self.by_range().items()},
            "measured_range": self.measured_range.summary(),
            "outliers": [outlier.summary() for outlier in self.outliers],
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
    validation = _validation(calibration, fitted, campaign)
    known = as_known(fitted, campaign)
    residual, covariance = errors_on(fitted, known), known.covariances(noise)
    rows, targets = np.nonzero(campaign.valid)
    error = residual[rows, targets, :3]
    direction = error / np.maximum(np.linalg.norm(error, axis=1), 1e-300)[:, None]
    along = np.einsum("ki,kij,kj->k", direction, covariance[rows, targets, :3, :3], direction)
    studentised = inside = rotation_inside = None
    judged = np.zeros(len(rows), dtype=bool)
    outliers: tuple[Outlier, ...] = ()
    shared: tuple[bool, ...] = ()
    if not (reregister or in_its_frames(calibration, campaign)[1]):
        stated = covariance_on(calibration, known, covariance, settled=True)
        lengths, outliers = studentise(residual, stated, covariance, known, level, FOLLOWED_BY_PLACE)
        shared = shared_with_neighbours(outliers, residual, lengths, campaign.q)
        studentised = lengths[rows, targets]
        within = in_regions(residual, stated, covariance, known.observations)[rows, targets]
        judged, inside = np.isfinite(within), within == 1.0
        turned = in_regions(residual, stated, covariance, known.observations, rotations=True)[rows, targets]
        if np.isfinite(turned).any():
            rotation_inside = turned[np.isfinite(turned)] == 1.0
    one_number = np.array([kind.width == 1 and not kind.angles for kind in campaign.observations])
    return Examination(
        campaign=campaign,
        validation=validation,
        targets=targets,
        signed=np.where(one_number[targets], error[:, 0], np.nan),
        uncertainty=np.sqrt(along),
        studentised=studentised,
        inside=inside,
        judged=judged,
        rotation_inside=rotation_inside,
        outliers=outliers,
        shared=shared,
        measured_range=calibration.measured_range,
        fitted=fitted_rows(calibration, campaign)[rows],
        kept=kept_share(calibration, fitted, campaign),
        off_stored=off_stored_residuals(calibration, campaign),
    )


def off_stored_residuals(calibration: Calibration, campaign: Campaign) -> float | None:
    """How far residuals are off those that the calibration has of its rows, metres or radians; infinite where it has other rows.

    None for another campaign than the one that was fitted.

    Args:
        calibration: the calibration.
        campaign: measurements.
    """
    if campaign.digest != calibration.provenance.campaign_digest:
        return None
    left = iter(enumerate(campaign.ids))
    rows = [row for name in calibration.ids if (row := next((k for k, own in left if own == name), None)) is not None]
    if len(rows) < len(calibration.ids) or campaign.targets != calibration.targets:
        return float("inf")
    if not np.array_equal(campaign.q[rows], calibration.q):
        return float("inf")
    found, stored = residuals_on(calibration, campaign)[rows], calibration.residuals
    if campaign.stations is not None:  # the rows of further stations are stored along other axes
        found, stored = (np.linalg.norm(one[..., :3], axis=2) for one in (found, stored))
    off, lost = np.abs(found - stored), np.isnan(stored)
    return float(np.max(off, where=~lost, initial=0.0)) if np.array_equal(np.isnan(off), lost) else float("inf")


# Whether a calibrated robot is accurate enough: pass or fail by a limit and a guard band.
#
# Decision rule (JCGM 106:2012, 8.3.2, guarded acceptance): a point is accepted where its measured error and 1.645
# standard uncertainties of the measurement stay within the limit together, so that of points right at the limit at
# most 5 % are accepted that are beyond it. The errors of the measurement are taken as all in one direction, the
# worst case for a mean.

GUARD = 1.645
"""Standard uncertainties in the guard band: one side of a normal distribution, 95 %."""

Statistic = Literal["rms", "max", "p95", "mean"]

STATISTICS: tuple[Statistic, ...] = get_args(Statistic)

RULE_OF: Statistic = "rms"
"""Held against a limit unless another is asked for by name: that which a task's tolerance is of. A maximum grows with the number
of points, and is that of one reading; of the poses of a task that were not measured none can be stated."""

_VALUES: dict[str, Callable[[np.ndarray], float]] = {
    "max": lambda errors: float(errors.max()),
    "p95": lambda errors: float(np.percentile(errors, 95)),
    "rms": lambda errors: float(np.sqrt(np.mean(errors**2))),
    "mean": lambda errors: float(errors.mean()),
}


@dataclass(frozen=True, kw_only=True)
class Acceptance:
    """The decision."""

    limit: float
    """Metres."""
    of: Statistic
    """Error statistic compared with the limit."""
    value: float
    """As measured, metres."""
    least: float
    """What it may be, if all errors were measured 1.645 standard uncertainties too large, metres."""
    most: float
    """What it may be, if all errors were measured 1.645 standard uncertainties too small, metres: value and guard band."""

    @property
    def accepted(self) -> bool:
        """Whether it is within the limit beyond reasonable doubt."""
        return self.most <= self.limit

    @property
    def decision(self) -> Literal["pass", "fail", "undecided"]:
        """``undecided`` is not accepted either: the measurement is too uncertain to tell."""
        if self.accepted:
            return "pass"
        return "fail" if self.least > self.limit else "undecided"

    def summary(self) -> dict[str, Any]:
        """The decision, in millimetres."""
        return {
            "limit_mm": self.limit * 1e3,
            "of": self.of,
            "value_mm": self.value * 1e3,
            "guard_band_mm": (self.most - self.value) * 1e3,
            "decision": self.decision,
            "accepted": self.accepted,
        }


def accept(examination: Examination, limit: float, of: Statistic = RULE_OF) -> Acceptance:
    """Decide whether a calibration keeps a limit on the campaign that it was examined with.

    Args:
        examination: the points.
        limit: of the error in space, metres.
        of: what is held against it: the root mean square, the largest error, the 95th percentile or the mean.

    Rows that the calibration was fitted to decide nothing. Where tracker frame and targets were found from the rows that are
    judged, the guard band has what that took of their errors.

    Raises:
        ValueError: a limit that is not above zero, or another statistic.
        CampaignError: the calibration was fitted to all of these rows.
    """
    if of not in STATISTICS:
        raise ValueError(f"of is {of!r}; give {', '.join(STATISTICS)}")
    if not 0.0 < limit < np.inf:
        raise ValueError(f"limit is {limit!r}; give metres above zero")
    unseen = ~examination.fitted
    if not unseen.any():
        raise CampaignError(
            f"all {len(examination.campaign)} rows are those that the calibration was fitted to, so that nothing decides whether "
            "it keeps a limit: give measurements of other poses"
        )
    errors, guard = examination.validation.errors[unseen], GUARD * examination.uncertainty[unseen]
    value, taken = _VALUES[of], float(np.sqrt(max(examination.kept, 1e-6)))
    return Acceptance(
        limit=limit,
        of=of,
        value=value(errors),
        least=value(np.maximum(errors - guard, 0.0)),
        most=value(errors + guard) / taken,
    )


# What a calibration left of the errors at the rows that it was fitted to, beside what the nominal robot leaves there.


@dataclass(frozen=True, eq=False, kw_only=True)
class MeasuredErrors:
    """Residuals (measured − predicted) at fitted rows, base frame."""

    q: Float[np.ndarray, "n joints"]
    """Radians."""
    points: Float[np.ndarray, "n targets 3"]
    """Where the calibrated robot predicts the targets, in the robot's base, metres."""
    before: Float[np.ndarray, "n targets b"]
    """Of the nominal robot with its own tracker frame and targets, metres (then radians, for poses)."""
    after: Float[np.ndarray, "n targets b"]
    """Of the calibrated robot."""


def measured_errors(calibration: Calibration) -> MeasuredErrors | None:
    """Errors before and after, from what the calibration itself holds.

    What was measured is what is predicted and what it left. Where effects depend on how a pose is reached, which is not kept, the
    prediction is that of the middle of their range.

    Args:
        calibration: the calibration.

    Returns:
        None where the calibration was not fitted to what a tracker measured.
    """
    q = calibration.q
    if not calibration.layout.tracked:
        return None
    residual, R = calibration.residuals, calibration.T_tracker_base[:3, :3]
    ends = calibration.target_poses(q)
    campaign = _as_measured(calibration, q, ends)
    nominal = fit_nominal(ErrorModel(calibration.model.robot), campaign, FitOptions())
    after = np.concatenate([residual[..., k : k + 3] @ R for k in range(0, residual.shape[2], 3)], axis=2)
    base = se3.inverse(calibration.T_tracker_base)
    return MeasuredErrors(
        q=q, points=se3.apply(base, ends[..., :3, 3]), before=nominal.residuals_on(campaign, frame="base"), after=after
    )


def _as_measured(
    calibration: Calibration, q: Float[np.ndarray, "n joints"], ends: Float[np.ndarray, "n targets 4 4"]
) -> Campaign:
    """The campaign, from predictions and residuals."""
    residual = calibration.residuals
    rotations = None
    if calibration.layout.pose:
        rotations = np.full((len(q), 3, 3), np.nan)
        seen = np.isfinite(residual[:, 0, 0])
        turned = se3.exp(calibration.layout.unknowns(calibration.z)[0]) @ ends[seen, 0, :3, :3]
        rotations[seen] = se3.exp(residual[seen, 0, 3:]) @ turned
    return Campaign(
        ids=calibration.ids,
        q=q,
        targets=calibration.targets,
        points=ends[..., :3, 3] + residual[..., :3],
        rotations=rotations,
        stations=calibration.layout.stations,
    )
