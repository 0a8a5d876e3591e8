"""A Calibration: what was identified, how well, and what the robot does with it."""

import base64
import binascii
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cache, cached_property
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from jaxtyping import Bool, Float, Int
from pydantic import Field

from taskcal.arguments import checked, joints_checked
from taskcal.campaigns.campaign import Campaign, Stations, named_file
from taskcal.errors import CampaignError, FileError, FitError, TaskcalError, shown
from taskcal.estimation.matrices import factor_positive, root_of, single_threaded
from taskcal.geometry import se3
from taskcal.geometry.se3 import RIGID
from taskcal.identification.calibration_format import CALIBRATION
from taskcal.identification.held_out import NO_UNCERTAINTY, HeldOut, LeftOut, Outlier, shared_with_neighbours
from taskcal.identification.layout import Layout
from taskcal.identification.measured_range import MeasuredRange
from taskcal.identification.problem import Rows, Seen, joint_columns
from taskcal.io.codec import (
    GAPS,
    NOT_IN_FILE,
    ONLY_WHERE_KNOWN,
    InFile,
    Marked,
    consistent,
    describe,
    schema_of,
    shaped,
    value_of,
    values_of,
)
from taskcal.io.files import write_whole
from taskcal.io.json_file import note_of_edits, parse_json, without_seal
from taskcal.io.toml_file import FileSection, Finite, NotNegative, Ratio
from taskcal.kernels import walk
from taskcal.observations import Observation, Point, Pose, block_size, kind_of
from taskcal.registration.registration import Registration
from taskcal.registration.stations import frame_of_points
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects import Effect, LinearTerm, effect_from
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.parameter import ShownUnit
from taskcal.robot.robot_file import robot_from
from taskcal.robot.statics import Load

# A covariance as a calibration file holds it: a triangular factor of it, to the last bit, so that it is one when
# read.
#
# A large factor stands in a sixth of the room of its digits.

PACKED_FROM = 150
"""Entries from which on a factor is packed; smaller ones are left for people to read."""

MAX_FACTOR_ENTRIES = 20_000
"""Of a packed factor; the effects of a seven-joint robot have under a thousand."""

ROUNDING = 1e-9
"""How far under zero rounding may leave an eigenvalue of the correlations, for each entry; sums of squares leave 10⁻¹³."""

NUMBER = np.dtype("<f8")
"""Binary64, the least significant byte first, on every machine."""


def spread_of(C: Float[np.ndarray, "z z"]) -> Float[np.ndarray, "z z"]:
    """Lower triangular B with B·Bᵀ the covariance C of a fit.

    Raises:
        FitError: C is none, as a combination of its entries would have a negative variance.
    """
    try:
        return factor_positive(C, ROUNDING * len(C))
    except np.linalg.LinAlgError as error:
        raise FitError(
            f"the covariance of the fit is none: {error}; the rows do not determine all that is fitted: fit fewer parameters "
            "or effects (--keep, --effects)"
        ) from error


def describe_factor(B: Float[np.ndarray, "z z"]) -> Any:
    """A lower triangular factor for JSON: its rows up to the diagonal, or packed where it is large."""
    if len(B) < PACKED_FROM:
        return [row[: i + 1].tolist() for i, row in enumerate(B)]
    lower = B[np.tril_indices(len(B))].astype(NUMBER)
    return {"size": len(B), "lower": base64.b64encode(lower.tobytes()).decode("ascii")}


def unpack_factor(described: dict[str, Any]) -> list[list[float]]:
    """The rows of a packed factor, up to the diagonal.

    Raises:
        TaskcalError: it lacks a part, its size is not a number of entries, or it does not hold as many numbers.
    """
    if set(described) != {"size", "lower"}:
        keys = ", ".join(map(str, described))
        raise TaskcalError(f"'covariance_factor' has the keys {shown(keys)}, not 'size' and 'lower'")
    size, triangle = described["size"], described["lower"]
    if type(size) is not int or not 0 <= size <= MAX_FACTOR_ENTRIES:
        raise TaskcalError(
            f"the size of 'covariance_factor' is {shown(repr(size))}, not a number from 0 to {MAX_FACTOR_ENTRIES}"
        )
    try:
        content = base64.b64decode(triangle, validate=True)
    except (TypeError, ValueError, binascii.Error) as error:
        raise TaskcalError(f"the lower triangle of 'covariance_factor' is not base64: {error}") from error
    wanted = size * (size + 1) // 2 * NUMBER.itemsize
    if len(content) != wanted:
        raise TaskcalError(
            f"the lower triangle of 'covariance_factor' has {len(content)} bytes, one of size {size} has {wanted}"
        )
    numbers = np.frombuffer(content, dtype=NUMBER)
    return [row.tolist() for row in np.split(numbers, np.cumsum(np.arange(1, size)))] if size else []


def factor_of(rows: Sequence[Sequence[float]]) -> Float[np.ndarray, "z z"]:
    """The factor that has these rows up to the diagonal.

    Raises:
        TaskcalError: a row has another number of entries.
    """
    for i, row in enumerate(rows, start=1):  # before there is room for so many
        if len(row) != i:
            raise TaskcalError(f"'covariance_factor' {i} has {len(row)} numbers, not {i}")
    B = np.zeros((len(rows), len(rows)))
    B[np.tril_indices(len(B))] = [number for row in rows for number in row]
    return B


FACTOR = InFile(
    key="covariance_factor", kind=list[list[Finite]], write=describe_factor, read=lambda _, rows: factor_of(rows)
)
"""Of a field that is a factor."""


# Which parameters the data of a calibration inform, and which its prior alone holds.

UNINFORMED_SHARE = 0.95
"""Standard error over the prior's standard deviation, from which on nothing was learnt. A convention: at 0.95 the data add a
tenth of the prior's information."""


def informed_parameters(calibration: "Calibration") -> dict[str, bool | None]:
    """For each kept parameter whether its standard error fell below that of the prior.

    None where that cannot be said: without a prior, or with one that is not the tolerances'.
    """
    scale = calibration.prior_scale
    if scale is None or calibration.provenance.options.get("prior") == "given":
        return dict.fromkeys(calibration.kept)
    own = calibration.group_deviations
    limit = UNINFORMED_SHARE * (scale * calibration.model.tolerances if own is None else own)
    return {calibration.names[i]: bool(calibration.standard_errors[i] < limit[i]) for i in calibration.estimated}


FILE_IN_DOUBT = "robot file in doubt: "
"""Beginning of remarks that the robot file, or the joints as it counts them, may not be those of this robot."""

SCALE_IN_DOUBT = "scale in doubt: "
"""Beginning of remarks that all measured lengths may be wrong by one factor, which rows that were held out do not show."""

COURSE_IN_DOUBT = "course in doubt: "
"""Beginning of remarks that something happened between the rows, which rows that were held out went through, too."""


# What a calibration reports: parameters with their standard errors, model error, correlations, points that do not
# fit.

CORRELATIONS = 10
"""How many of the largest correlations are named."""


def summarise_calibration(calibration: "Calibration") -> dict[str, Any]:
    """The report of a calibration, in millimetres and milliradians."""
    rotation, like = calibration.model_error[1:], calibration.provenance.options.get("like")
    return {
        "robot": calibration.model.robot.name,
        "campaign": calibration.provenance.campaign,
        "options": dict(calibration.provenance.options),
        "effects": [effect.to_json() for effect in calibration.model.effects],
        "field": any(effect.key == "field" for effect in calibration.model.effects),
        "stations": list_stations(calibration),
        "model_error_mm": calibration.model_error[0] * 1e3,
        **({"model_error_mrad": rotation[0] * 1e3} if rotation else {}),
        "prior_scale": calibration.prior_scale,
        **({"like": like} if like else {}),
        "effective_parameters": calibration.effective_parameters,
        "parameter_groups": calibration.parameter_groups,
        "measured_range": calibration.measured_range.summary(),
        "parameters": list_parameters(calibration),
        "correlations": [
            {"a": a, "b": b, "correlation": value} for a, b, value in largest_correlations(calibration, CORRELATIONS)
        ],
        "left_out": [
            {
                "row": row.row,
                "line": row.line,
                "id": row.id,
                "distance_mm": row.distance * 1e3,
                "studentised": row.studentised,
            }
            for row in calibration.left_out
        ],
        "outliers": [outlier.summary() for outlier in calibration.outliers],
        "reason": calibration.reason,
        "remarks": list(calibration.remarks),
        "iterations": calibration.iterations,
        "rounds": calibration.rounds,
    }


def list_stations(calibration: "Calibration") -> list[dict[str, Any]]:
    """Rows and frame of every named station, with standard errors: position in mm, rotation about the base's axes in mrad."""
    stations, out = calibration.layout.stations, list[dict[str, Any]]()
    if stations is None:
        return out
    deviation = np.sqrt(np.maximum(np.diag(calibration.z_covariance), 0.0))
    for k, (name, T) in enumerate(calibration.stations.items()):
        own = 1e3 * deviation[calibration.layout.bases[k].columns]
        out.append(
            {
                "name": name,
                "rows": stations.rows[k],
                "position_mm": (T[:3, 3] * 1e3).tolist(),
                "quaternion": se3.to_quaternion(T[:3, :3]).tolist(),
                "standard_error_mm": own[:3].tolist(),
                "standard_error_mrad": own[3:].tolist(),
            }
        )
    return out


def list_unknowns(calibration: "Calibration") -> list[dict[str, Any]]:
    """List the unknowns of the observations (sockets, anchors …), each number with its standard error.

    Millimetres, milliradians, or parts per million, as the keys say; directions as they are.
    """
    layout = calibration.layout
    if layout.tracked:
        return []
    deviation = np.sqrt(np.maximum(np.diag(calibration.z_covariance), 0.0))
    out: list[dict[str, Any]] = []
    for target, kind, own, values in zip(
        layout.targets, layout.kinds, layout.own, layout.unknowns(calibration.z), strict=True
    ):
        errors = np.full(len(values), np.nan) if own.held else deviation[own.columns]
        unknowns = {
            name: _in_unit(kind.units.get(name.rpartition(".")[2], ShownUnit.of("m")), float(value), float(error))
            for name, value, error in zip(kind.unknowns, values, errors, strict=True)
        }
        out.append({"target": target, "kind": kind.key, "tells_scale": kind.tells_scale, "unknowns": unknowns})
    return out


def _in_unit(unit: ShownUnit, value: float, error: float) -> dict[str, float | None]:
    key = f"_{unit.key}" if unit.name else ""
    return {
        f"value{key}": value * unit.factor,
        f"standard_error{key}": None if np.isnan(error) else error * unit.factor,
    }


COVERAGE_95 = 1.96
"""Standard uncertainties on either side of an interval that holds 95 % of a normal distribution."""


def list_parameters(calibration: "Calibration") -> list[dict[str, Any]]:
    """Estimate, standard error, 95 % interval and tolerance of every estimated parameter, in the unit that each key ends with."""
    out: list[dict[str, Any]] = []
    informed = informed_parameters(calibration)
    for i in calibration.estimated:
        p = calibration.model.parameters[i]
        unit = p.shown
        value, error = (float(one[i]) * unit.factor for one in (calibration.estimate, calibration.standard_errors))
        values = {
            f"estimate_{unit.key}": value,
            f"standard_error_{unit.key}": error,
            f"interval_{unit.key}": [value - COVERAGE_95 * error, value + COVERAGE_95 * error],
            f"tolerance_{unit.key}": p.tolerance * unit.factor,
        }
        out.append({"name": p.name, "symbol": p.symbol, "unit": unit.name, **values, "seen": informed[p.name]})
    return out


def largest_correlations(calibration: "Calibration", count: int) -> list[tuple[str, str, float]]:
    """The largest posterior correlations between estimated parameters, tracker frame and targets, by absolute value.

    Args:
        calibration: the calibration.
        count: how many at most.
    """
    p, size = len(calibration.model), len(calibration.all_names)
    fitted = np.concatenate([calibration.estimated, np.arange(p, size)])
    names = [calibration.all_names[i] for i in fitted]
    correlation = calibration.correlation[np.ix_(fitted, fitted)]
    i, j = np.triu_indices(len(names), 1)
    largest = np.argsort(-np.abs(correlation[i, j]), kind="stable")[:count]
    return [(names[i[k]], names[j[k]], float(correlation[i[k], j[k]])) for k in largest]


# What a calibration says of a campaign: its residuals, and how sure it is of what it predicts of it.


MIN_STATION_ROWS = 3
"""Fitted rows from which on a station's frame is known: three points determine it."""


def in_its_frames(calibration: "Calibration", campaign: Campaign) -> tuple[Campaign, tuple[str, ...]]:
    """A campaign of several stations carried into the frame of the calibration's first one, and the stations unknown to it.

    A station that the calibration knows has the frame that was fitted. That of another is found from its own rows: the calibrated
    robot has the same targets there.

    Raises:
        CampaignError: the rows of a station that is not known do not determine its frame.
    """
    stations = campaign.stations
    if stations is None:
        return campaign, ()
    known = calibration.layout.stations
    fitted = {} if known is None else dict(zip(known.names, known.rows, strict=True))
    own, base, out, others = calibration.stations, calibration.T_tracker_base, [], list[str]()
    measured = campaign.carried(np.tile(np.eye(4), (len(stations.names), 1, 1)))
    predicted: np.ndarray | None = None
    for k, name in enumerate(stations.names):
        rows = stations.of == k
        if fitted.get(name, 0) >= MIN_STATION_ROWS or not rows.any():
            out.append(base @ se3.inverse(own[name]) if name in own else np.eye(4))
            continue
        if predicted is None:
            ends = calibration.target_poses(campaign.q, campaign.conditions)
            predicted = ends[:, calibration.rows_of(campaign.targets)][..., :3, 3]
        seen = rows[:, None] & campaign.valid
        said = f"{named_file(campaign)}station '{name}'"
        there = frame_of_points(predicted[seen], measured.points[seen], calibration.model.robot.reach, said)
        out.append(se3.inverse(there))
        others.append(name)
    return campaign.carried(np.stack(out)), tuple(others)


def residuals_on(
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
        frame: whose axes residuals are in, of kinds that measure along axes.
        settled: let what stands (sockets, anchors …) be where this campaign says, given the calibrated robot; else only what the
            calibration does not know of it.

    Raises:
        CampaignError: a target that the calibration does not know.
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    campaign, _ = in_its_frames(calibration, as_known(calibration, campaign))
    kinds = campaign.observations
    ends = calibration.target_poses(campaign.q, campaign.conditions)[:, calibration.rows_of(campaign.targets)]
    b = block_size(kinds)
    out = np.full((*campaign.valid.shape, b), np.nan)
    out[campaign.valid] = 0.0
    for t, (kind, unknown) in enumerate(zip(kinds, unknowns_of(calibration, campaign, settled=settled), strict=True)):
        seen = campaign.valid[:, t]
        residual = kind.differentiate(ends[:, t], unknown, campaign.read(t)).residual[seen]
        out[np.flatnonzero(seen)[:, None], t, kind.block()] = residual
    if frame == "base":
        along = np.array([kind.along_axes for kind in kinds])
        for first in range(0, b, 3):
            out[:, along, first : first + 3] = out[:, along, first : first + 3] @ calibration.T_tracker_base[:3, :3]
    return out


def as_known(calibration: "Calibration", campaign: Campaign) -> Campaign:
    """A campaign, without a tracker's rotations where the calibration knows none."""
    known = campaign.rotations is None or calibration.layout.pose or not campaign.tracked
    return campaign if known else replace(campaign, rotations=None)


def unknowns_of(
    calibration: "Calibration", campaign: Campaign, *, settled: bool = False
) -> tuple[Float[np.ndarray, " _"], ...]:
    """Unknowns of each kind, from the calibration, or from the campaign's own rows where the calibration has none.

    Args:
        calibration: of these targets.
        campaign: observations of them.
        settled: take all from the campaign's rows.
    """
    return tuple(unknown for unknown, _ in _located(calibration, campaign, settled=settled))


def _located(
    calibration: "Calibration", campaign: Campaign, *, settled: bool
) -> list[tuple[Float[np.ndarray, " _"], Bool[np.ndarray, " _"]]]:
    """Unknowns of each kind, and which of them are from the campaign's own rows."""
    numbers, layout = calibration.rows_of(campaign.targets), calibration.layout
    ends = calibration.target_poses(campaign.q, campaign.conditions)[:, numbers]
    out: list[tuple[np.ndarray, np.ndarray]] = []
    for t, kind in enumerate(campaign.observations):
        known, own = np.full(len(kind.unknowns), np.nan), layout.kinds[numbers[t]]
        if own.key == kind.key:
            known = kind.named_like(own, layout.unknowns(calibration.z)[numbers[t]])
        if not settled and np.isfinite(known).all():
            out.append((known, np.zeros(len(known), dtype=bool)))
            continue
        found = kind.settle(ends[:, t], campaign.read(t), known)
        # what the rows do not show, such as an instrument's scale, a kind hands back as it was known
        located = ~np.isnan(found) & (found != known) if settled else np.isnan(known)
        out.append((np.where(located, found, known), located))
    return out


def covariance_on(
    calibration: "Calibration", campaign: Campaign, noise: Float[np.ndarray, "n targets b b"], *, settled: bool = False
) -> Float[np.ndarray, "n targets b b"]:
    """Covariance of each residual, as of `residuals_on`: of what the calibration predicts, and of the measurement.

    Args:
        calibration: of these targets.
        campaign: observations of them.
        noise: covariance of the measurements, m² and rad².
        settled: as of `residuals_on`. What the campaign's own rows locate follows them, and leaves them the less to err.

    Raises:
        CampaignError: no uncertainty is stated of rows that locate something.
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    layout, stations = calibration.layout, campaign.stations
    if not layout.tracked:
        return _covariance_by_kind(calibration, campaign, noise, settled=settled)
    if layout.stations is None or stations is None:
        out = calibration.predict_covariance(campaign.q, campaign.conditions)
    else:
        out = np.zeros((len(campaign), len(layout.targets), *2 * (layout.block_size,)))
        for k, name in enumerate(stations.names):
            part, names = campaign.take(stations.of == k), layout.stations.names
            there = replace(calibration, layout=replace(layout, station=names.index(name) if name in names else 0))
            out[stations.of == k] = there.predict_covariance(part.q, part.conditions)
    b = block_size(as_known(calibration, campaign).observations)
    return out[:, calibration.rows_of(campaign.targets), :b, :b] + noise[..., :b, :b]


def _covariance_by_kind(
    calibration: "Calibration", campaign: Campaign, noise: Float[np.ndarray, "n targets b b"], *, settled: bool
) -> Float[np.ndarray, "n targets b b"]:
    """The same where not a tracker alone measured.

    With D the covariance of what errs at single rows, noise and model error, and B the derivative by the unknowns that the rows
    locate, least squares leave D − B·M·Bᵀ of D, where M = (Bᵀ·D⁻¹·B + P)⁻¹ and P is what is known of them beforehand, next to
    nothing; of the derivative J by what the calibration knows they leave J − B·M·Bᵀ·D⁻¹·J.
    """
    kinds, numbers = campaign.observations, calibration.rows_of(campaign.targets)
    located = _located(calibration, campaign, settled=settled)
    rows, n, b = _rows_on(calibration, campaign, [unknown for unknown, _ in located]), len(campaign), block_size(kinds)
    layout = rows.layout
    by_entry = rows.linearise().by_entry.reshape(n, len(layout.targets), -1, len(rows.z))[:, numbers, :b]
    errors = pose_errors(calibration, campaign.q, rows.by_tool()[:, numbers, :b], campaign.conditions)
    single = noise[..., :b, :b] + errors.covariance
    free, deviation = np.zeros(len(rows.z), dtype=bool), np.ones(len(rows.z))
    for t, (kind, (_, own)) in enumerate(zip(kinds, located, strict=True)):
        columns = layout.own[numbers[t]].columns
        free[columns], deviation[columns] = own, kind.deviations
    entry = {name: k for k, name in enumerate(calibration.all_names)}
    sure = np.array([name in entry for name in layout.names]) & ~free  # frames that were held have no error
    known = [entry[layout.names[k]] for k in np.flatnonzero(sure)]
    J, B = np.sqrt(errors.growth)[:, None, None, None] * by_entry[..., sure], by_entry[..., free]
    if free.any():
        try:
            L = np.linalg.cholesky(single)
        except np.linalg.LinAlgError as singular:
            raise CampaignError(NO_UNCERTAINTY) from singular
        white = np.linalg.solve(L, B).reshape(-1, B.shape[3])
        Q = np.linalg.qr(np.concatenate([white, np.diag(1.0 / deviation[free])]))[0][: len(white)]
        W = np.linalg.solve(L, J).reshape(len(Q), -1)
        J, B = L @ (W - Q @ (Q.T @ W)).reshape(J.shape), L @ Q.reshape(B.shape)
        single = single - B @ np.swapaxes(B, 2, 3)
    return single + (J @ calibration.z_covariance[np.ix_(known, known)]) @ np.swapaxes(J, 2, 3)


def _rows_on(calibration: "Calibration", campaign: Campaign, unknowns: Sequence[Float[np.ndarray, " _"]]) -> Rows:
    """The rows of a campaign in the calibration's layout, with unknowns of the campaign's own kinds."""
    layout, numbers, n = calibration.layout, calibration.rows_of(campaign.targets), len(campaign)
    kinds = [replace(kind, of=np.zeros(n, dtype=int)) if kind.things else kind for kind in layout.kinds]
    points, valid = np.zeros((n, len(kinds), 3)), np.zeros((n, len(kinds)), dtype=bool)
    points[:, numbers], valid[:, numbers] = campaign.points, campaign.valid
    for t, kind in zip(numbers, campaign.observations, strict=True):
        kinds[t] = kind
    free = replace(layout, fixed_frames=False)
    there = replace(free, kinds=tuple(kinds))
    entry = dict(zip(free.names, free.start(), strict=True)) | dict(
        zip(calibration.all_names, calibration.z, strict=True)
    )
    z = np.array([entry.get(name, 0.0) for name in there.names])
    for t, unknown in zip(numbers, unknowns, strict=True):
        z[there.own[t].columns] = unknown
    rotations = np.tile(np.eye(3), (n, 1, 1)) if campaign.rotations is None else campaign.rotations
    at = there.walked(campaign.q, z, calibration.model.prepare(campaign.q, campaign.conditions))
    return Rows(there, z, at, Seen(position=points, rotation=rotations, valid=valid, kinds=there.kinds))


# What is uncertain of a predicted pose: of a frame on the tool, such as a target or the tool's point.
#
# The errors of the estimate are the same at all poses, and so is how warm the robot is where that is not told: no number of
# poses averages them out. The others are of each pose alone: what the model cannot explain there, how far the joints are off,
# and the side from which they came and how far, where that is not told. All of them grow beyond the measured range.
#
# What is not told counts by its expectation, and adds its variance. With ξ the parameters of the effects that depend on
# conditions, m and S their estimate and covariance, and J_c the derivative of a target by them under a condition c of mean zero,
#
#     E[(J_c·ξ)(J_c·ξ)ᵀ] = E[J_c·(m·mᵀ + S)·J_cᵀ],
#
# so that effects which are hardly known add their uncertainty, too.


@dataclass(frozen=True, eq=False, kw_only=True)
class PoseErrors:
    """What errs of frames on the tool at some poses beside the estimate; metres and radians, tracker axes."""

    growth: Float[np.ndarray, " n"]
    """Factor of all covariances: 1 in the measured range, more beyond."""
    warmth: Float[np.ndarray, "n frames b c"]
    """Errors by how warm the robot is, where it is not told: by independent causes of one standard deviation, the same at all
    poses."""
    single: Float[np.ndarray, "n frames b b"]
    """Covariance of the errors of each pose alone."""

    @property
    def covariance(self) -> Float[np.ndarray, "n frames b b"]:
        """Of all of them."""
        return self.warmth @ np.swapaxes(self.warmth, 2, 3) + self.single

    def with_estimate(self, estimated: Float[np.ndarray, "n frames b b"]) -> Float[np.ndarray, "n frames b b"]:
        """Covariance of where the frames are.

        Args:
            estimated: by the error of the estimate, as propagated.
        """
        return self.growth[:, None, None, None] * estimated + self.covariance


def pose_errors(
    calibration: "Calibration",
    q: Float[np.ndarray, "n joints"],
    by_tool: Float[np.ndarray, "n frames b 6"],
    conditions: Conditions | None = None,
) -> PoseErrors:
    """What errs of frames on the tool, or of what is measured of them, at some poses beside the estimate.

    Args:
        calibration: the calibration.
        q: joint positions, radians.
        by_tool: derivative of the frames by the tool's twist in tracker axes: vx vy vz wx wy wz at its origin. Of b = 6 numbers
            the last three are rotations.
        conditions: how the poses are reached. What is not told counts as uncertain.
    """
    growth, b = calibration.growth_at(q), by_tool.shape[2]
    error = np.zeros(b)
    own = np.repeat(np.square(calibration.model_error), 3)[:b]
    error[: len(own)] = own
    warmth, single = np.zeros((*by_tool.shape[:3], 0)), np.zeros((*by_tool.shape[:3], b)) + np.diag(error)
    if any(calibration.joint_error) or calibration.model.conditioned:
        at = calibration.layout.walked(q, calibration.z, calibration.model.prepare(q, conditions))
        columns = by_tool @ joint_columns(at)[:, None]
        joints = columns[..., : len(calibration.joint_error)]
        single = single + (joints * np.square(calibration.joint_error)) @ np.swapaxes(joints, 2, 3)
        warmth, way = _of_unknown_conditions(calibration, q, columns, conditions or Conditions())
        single = single + way
    grown = growth[:, None, None, None]
    return PoseErrors(growth=growth, warmth=np.sqrt(grown) * warmth, single=grown * single)


def _of_unknown_conditions(
    calibration: "Calibration",
    q: Float[np.ndarray, "n joints"],
    columns: Float[np.ndarray, "n frames b coordinates"],
    conditions: Conditions,
) -> tuple[Float[np.ndarray, "n frames b c"], Float[np.ndarray, "n frames b b"]]:
    """Errors of frames by how warm the robot is, and their covariance by how poses are reached, as far as it is not told.

    A joint whose side is not told came from either one with even chance. Its share of the largest move is evenly spread
    between nothing and all, so that the mean of its square is 1/3, and of its product with the side 1/2. What an effect
    needs and is not told is as far from its reference as the effect says (`Effect.off_reference`).
    """
    model, nothing = calibration.model, np.zeros((*columns.shape[:3], 0))
    given = [(effect, term) for effect, term in zip(model.effects, model.effect_terms, strict=True) if term.given]
    covariance = np.zeros((*columns.shape[:3], columns.shape[2]))
    if not given:
        return nothing, covariance
    index = {name: i for i, name in enumerate(calibration.all_names)}

    def second_moment(terms: Sequence[LinearTerm]) -> Float[np.ndarray, "p p"]:
        own = np.array([index[name] for term in terms for name in term.names])
        return calibration.z_covariance[np.ix_(own, own)] + np.outer(calibration.z[own], calibration.z[own])

    terms = [term for _, term in given]
    second = second_moment(terms)
    for probe, weight in _ways(calibration, len(q), conditions):
        rows = np.flatnonzero(weight)
        if len(rows):
            J = _derivative(terms, q[rows], probe.take(rows), columns[rows])
            covariance[rows] += weight[rows, None, None, None] * (J @ second @ np.swapaxes(J, -1, -2))
    warmth = [nothing]
    for effect, term in given:
        off = effect.off_reference(len(q))
        if off is not None:
            told = [getattr(conditions, quantity) for quantity in effect.needs]
            unknown = np.max([np.ones(len(q)) if t is None else ~np.isfinite(t) for t in told], axis=0)
            J = _derivative([term], q, off, columns) @ root_of(second_moment([term]))
            warmth.append(unknown[:, None, None, None] * J)
    return np.concatenate(warmth, axis=3), covariance


def _derivative(
    terms: list[LinearTerm],
    q: Float[np.ndarray, "k joints"],
    conditions: Conditions,
    columns: Float[np.ndarray, "k targets b coordinates"],
) -> Float[np.ndarray, "k targets b p"]:
    """Derivative of the targets by the parameters of terms under conditions."""
    parts: list[np.ndarray] = []
    for term in terms:
        factor = term.prepare(q, conditions)
        part = np.zeros((*columns.shape[:3], len(term.names)))
        for k, (coordinate, parameter) in enumerate(term.pairs):
            part[..., parameter] += columns[..., coordinate] * factor[:, None, None, k]
        parts.append(part)
    return np.concatenate(parts, axis=3)


def _ways(
    calibration: "Calibration", count: int, conditions: Conditions
) -> Iterator[tuple[Conditions, Float[np.ndarray, " n"]]]:
    """Ways of the joints to poses, and with which weight the square of what each does counts at every pose.

    Of a side a and a move b, where neither is told, (a + b)², a² and b² with ½, ½ and −1/6 are a² + 2·½·a·b + ⅓·b².
    """
    joints = len(calibration.model.robot.joints)
    nothing = np.zeros((count, joints))
    side = nothing if conditions.approach is None else conditions.approach
    move = nothing if conditions.move is None else conditions.move
    no_side, no_move = side == 0.0, np.broadcast_to((move == 0.0).all(axis=1, keepdims=True), move.shape)
    for j in range(joints):
        way = np.zeros((count, joints))
        way[:, j] = 1.0
        a, b = no_side[:, j], no_move[:, j]
        yield Conditions(approach=way, move=way), np.where(a & b, 0.5, 0.0)
        yield Conditions(approach=way), np.where(a, np.where(b, 0.5, 1.0), 0.0)
        yield Conditions(move=way), np.where(b, np.where(a, -1.0 / 6.0, 1.0 / 3.0), 0.0)


Real = Annotated[float, Field(strict=True, ge=-1e300, le=1e300, allow_inf_nan=False)]
AboveZero = Annotated[float, Field(strict=True, gt=0, le=1e6, allow_inf_nan=False)]


# Where a calibration comes from.


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """Where a calibration comes from."""

    robot: str
    robot_digest: str
    campaign: str
    """File of the campaign."""
    campaign_digest: str
    rows: int
    version: str
    created: str
    options: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """Of the identification: parameters kept, prior, loss, noise, and what was given instead of estimated."""
    notes: tuple[str, ...] = ()
    """What the reader of the campaign left out and decided."""

    @classmethod
    def of(cls, model: ErrorModel, campaign: Campaign, options: Mapping[str, Any]) -> "Provenance":
        """Provenance of a fit made now with these options."""
        return cls(
            robot=model.robot.name,
            robot_digest=model.robot.digest,
            campaign=campaign.source,
            campaign_digest=campaign.digest,
            rows=len(campaign),
            version=package_version(),
            created=datetime.now(UTC).isoformat(timespec="seconds"),
            options=options,
            notes=campaign.notes,
        )


@cache
def package_version() -> str:
    """Version of the installed package."""
    try:
        return version("taskcal")
    except PackageNotFoundError:
        return "unknown"


@joints_checked
@dataclass(frozen=True, eq=False, kw_only=True)
class Calibration:
    """An identified robot in its measuring frame."""

    model: Annotated[ErrorModel, NOT_IN_FILE]
    layout: Annotated[Layout, NOT_IN_FILE]
    """How z is laid out."""
    estimated: Annotated[Int[np.ndarray, " kept"], NOT_IN_FILE]
    """Model parameters that were estimated; the others stay zero and are considered."""
    z: Annotated[Float[np.ndarray, " z"], InFile(key="estimate")]
    """All parameters, tracker frame and targets, in the order of `all_names`."""
    z_spread: Annotated[Float[np.ndarray, "z z"], FACTOR]
    """Lower triangular B of the covariance B·Bᵀ of their error, which so is negative nowhere."""
    T_tracker_base: Annotated[Float[np.ndarray, "4 4"], RIGID]
    """Pose of the robot's base in the tracker frame."""
    T_tool_target: Annotated[Float[np.ndarray, "targets 4 4"], RIGID]
    """Pose of every target in the tool frame; for a point its rotation is the identity."""
    model_error: tuple[NotNegative, ...]
    """Standard deviation of what geometry does not explain: metres per axis (and radians, for poses)."""
    joint_error: tuple[NotNegative, ...] = ()
    """Standard deviation of the pose-to-pose error of each joint, radians (metres where it slides); empty where it
    was not asked for."""
    range_growth: Ratio = 0.0
    """Growth g of the covariance beyond the measured range: by the factor 1 + g·u², u how far a pose lies outside
    (`MeasuredRange.extrapolation`)."""
    prior_scale: AboveZero | None
    """Factor of the prior's standard deviations; None where there was no prior."""
    group_deviations: Annotated[Float[np.ndarray, " p"] | None, InFile(entry=AboveZero)] = None
    """Prior standard deviation of every parameter, metres and radians, where each effect of each joint has a size of its own;
    None where all are the tolerances times `prior_scale`."""
    effective_parameters: Annotated[Ratio | None, ONLY_WHERE_KNOWN] = None
    """How many of the estimated parameters the rows determine, each counted by the share of its prior variance that they took away;
    None where there was no prior, or the file does not state it."""
    parameter_groups: Annotated[int | None, ONLY_WHERE_KNOWN] = None
    """Groups of parameters whose size was estimated from the rows; None where no size was, or the file does not state it."""
    log_evidence: Real | None
    """Logarithm of the marginal likelihood, but for a constant of the campaign; None where there was no prior."""
    ids: Annotated[tuple[str, ...], InFile(counts="n")]
    """Names of the rows that were fitted."""
    q: Float[np.ndarray, "n joints"]
    """Joint positions of the rows that were fitted, radians."""
    residuals: Annotated[Float[np.ndarray, "n targets b"], GAPS]
    """Measured less predicted in the tracker frame, metres (then radians, for poses); NaN for lost beams."""
    studentised: Annotated[Float[np.ndarray, "n targets"], InFile(entry=Ratio | None)]
    """Length of each residual over its own standard deviation."""
    outliers: tuple[Outlier, ...]
    """Points whose residual is too long for chance, the longest first."""
    left_out: tuple[LeftOut, ...]
    """Rows that cannot be right, and were not fitted."""
    held_out: HeldOut | None = None
    """What the fit predicted of rows that it had not seen, if any were held out."""
    iterations: int
    """Of the last fit."""
    rounds: int
    """Of fit and hyperparameters in turn."""
    reason: str
    """Why the fit ended."""
    remarks: tuple[str, ...]
    """What a user should look at before believing the result."""
    edited: tuple[str, ...] = ()
    """Keys of its file that were edited after it was written, and read all the same (``unsealed``); a file that is made of it names
    them, too."""
    provenance: Annotated[Provenance, NOT_IN_FILE]
    source: Annotated[str, NOT_IN_FILE] = ""
    """File that it was read from."""

    def __repr__(self) -> str:
        scale = "" if self.prior_scale is None else f", prior × {self.prior_scale:.2g}"
        return (
            f"Calibration({self.model.robot.name}: {len(self.estimated)} parameters from {len(self.residuals)} rows, "
            f"model error {self.model_error[0] * 1e3:.3f} mm{scale}{', edited' if self.edited else ''})"
        )

    @property
    def edit_warning(self) -> str:
        """That its file was edited after it was identified, with the keys; empty where it was not."""
        return f"not as it was identified: {note_of_edits(self.source, self.edited)}" if self.edited else ""

    @property
    def origin(self) -> dict[str, Any]:
        """File that it was read from, robot and campaign, as another calibration names it."""
        named = "robot", "robot_digest", "campaign", "campaign_digest", "rows"
        return {
            "file": note_of_edits(self.source, self.edited),
            **{name: getattr(self.provenance, name) for name in named},
        }

    @property
    def targets(self) -> tuple[str, ...]:
        """Names of the targets."""
        return self.layout.targets

    @cached_property
    def stations(self) -> Mapping[str, Float[np.ndarray, "4 4"]]:
        """Pose of the robot's base in the tracker frame at each named station, the first being ``T_tracker_base``."""
        stations = self.layout.stations
        return {} if stations is None else dict(zip(stations.names, self.layout.station_frames(self.z), strict=True))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the model's parameters."""
        return self.model.names

    @property
    def kept(self) -> tuple[str, ...]:
        """Names of the parameters that were estimated."""
        return tuple(self.model.names[i] for i in self.estimated)

    @property
    def all_names(self) -> tuple[str, ...]:
        """Names of the entries of z: parameters, ``base.*``, targets."""
        return self.layout.names

    @cached_property
    def shared_outliers(self) -> tuple[bool, ...]:
        """Whether neighbouring rows or poses have much the same error as each outlier; none where the poses are not known."""
        if len(self.q) != len(self.residuals):
            return (False,) * len(self.outliers)
        return shared_with_neighbours(self.outliers, self.residuals, self.studentised, self.q)

    @cached_property
    def measured_range(self) -> MeasuredRange:
        """Where each joint was in the rows that were fitted, and how far poses lie outside of it.

        Raises:
            CampaignError: the calibration has no rows.
        """
        return MeasuredRange.of_rows(self.model.robot, self.q, self.tool_jacobian)

    @property
    def doubts(self) -> tuple[str, ...]:
        """Remarks with which no tolerance can be called met, nor a program that is corrected be called better."""
        return tuple(
            remark for remark in self.remarks if remark.startswith((FILE_IN_DOUBT, SCALE_IN_DOUBT, COURSE_IN_DOUBT))
        )

    @cached_property
    def estimate(self) -> Float[np.ndarray, " p"]:
        """Every parameter of the model, zero where not kept, metres and radians."""
        return self.layout.parameters(self.z)

    @cached_property
    @single_threaded
    def z_covariance(self) -> Float[np.ndarray, "z z"]:
        """Covariance of the error of z; of a parameter that was not estimated its prior's."""
        return self.z_spread @ self.z_spread.T

    @cached_property
    def covariance(self) -> Float[np.ndarray, "p p"]:
        """Covariance of the model's parameters; of one that was not estimated its prior's."""
        p = len(self.model)
        return self.z_covariance[:p, :p]

    @cached_property
    def standard_errors(self) -> Float[np.ndarray, " p"]:
        """Posterior standard deviation of every parameter, metres and radians."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @cached_property
    def correlation(self) -> Float[np.ndarray, "z z"]:
        """Posterior correlation of the entries of z."""
        deviation = np.sqrt(np.maximum(np.diag(self.z_covariance), 1e-300))
        return self.z_covariance / deviation / deviation[:, None]

    @checked
    def predict(
        self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None
    ) -> Float[np.ndarray, "n targets 3"] | Float[np.ndarray, "n 4 4"]:
        """Predict the targets in the tracker frame: points (n, targets, 3), metres, or poses (n, 4, 4).

        Args:
            q: joint positions, radians.
            conditions: how the poses are reached, for effects that depend on it; as in the middle by default.

        Raises:
            ClosureError: a closed loop cannot be assembled at some pose.
        """
        T = self.predict_tool(q, conditions)
        if self.layout.pose:
            return T @ self.T_tool_target[0]
        return np.stack([se3.apply(T, target[:3, 3]) for target in self.T_tool_target], axis=1)

    def target_poses(
        self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None
    ) -> Float[np.ndarray, "n targets 4 4"]:
        """Poses of the targets in the tracker frame; where points were measured, with the tool's rotation.

        Args:
            q: joint positions, radians.
            conditions: how the poses are reached, for effects that depend on it; as in the middle by default.

        Raises:
            ClosureError: a closed loop cannot be assembled at some pose.
        """
        return self.predict_tool(q, conditions)[:, None] @ self.T_tool_target

    def residuals_on(
        self, campaign: Campaign, *, frame: Literal["tracker", "base"] = "tracker"
    ) -> Float[np.ndarray, "n targets b"]:
        """Measured less predicted, metres, and radians where both the campaign and the calibration are of poses.

        Args:
            campaign: measurements of the calibration's targets, or of some of them.
            frame: whose axes the residuals are in: the ``tracker``'s or those of the robot's ``base``.

        Returns:
            b = 3 numbers for points, 6 for poses; NaN where a beam was lost.

        Raises:
            CampaignError: a target that the calibration does not know.
            ClosureError: a closed loop cannot be assembled at some pose.
        """
        return residuals_on(self, campaign, frame)

    def rows_of(self, targets: Sequence[str]) -> list[int]:
        """Which of the calibration's targets each of some is."""
        unknown = [name for name in targets if name not in self.targets]
        if unknown:
            raise CampaignError(
                f"the campaign's target '{unknown[0]}' is not in the calibration, which knows {', '.join(self.targets)}; choose "
                "among its targets, or refit tracker frame and targets (--reregister)"
            )
        return [self.targets.index(name) for name in targets]

    def predict_covariance(
        self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None, *, model_error: bool = True
    ) -> Float[np.ndarray, "n targets b b"]:
        """Covariance of the targets' true positions about the predicted ones, in the tracker frame.

        Args:
            q: joint positions, radians.
            conditions: how the poses are reached, for effects that depend on it. What is not told, the side from which a
                joint comes, its last move, the temperature, counts by its expectation and adds its variance.
            model_error: add what the estimate does not tell of a new pose (`PoseErrors`); without it, the covariance says how
                well the fitted model itself is known there.

        Returns:
            b = 3 rows for points, metres²; 6 for poses, then radians².
        """
        q = np.asarray(q, dtype=float)
        targets = Rows.of_targets(self.layout, self.z, q, self.model.prepare(q, conditions))
        estimated = targets.propagate(self.z_covariance)[1]
        if not model_error:
            return self.growth_at(q)[:, None, None, None] * estimated
        return pose_errors(self, q, targets.by_tool(), conditions).with_estimate(estimated)

    def predict_tool(
        self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None
    ) -> Float[np.ndarray, "n 4 4"]:
        """Poses of the tool itself in the tracker frame.

        Raises:
            ClosureError: a closed loop cannot be assembled at some pose.
        """
        return self.T_tracker_base @ self.tool_in_base(q, conditions)

    def tool_in_base(
        self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None
    ) -> Float[np.ndarray, "n 4 4"]:
        """Poses of the tool in the robot's base.

        Raises:
            ClosureError: a closed loop cannot be assembled at some pose.
        """
        return self.model.poses(np.asarray(q, dtype=float), self.estimate, conditions)

    def tool_covariance(
        self,
        q: Float[np.ndarray, "n joints"],
        conditions: Conditions | None = None,
        *,
        frame: Literal["tracker", "base"] = "tracker",
        model_error: bool = True,
    ) -> Float[np.ndarray, "n 6 6"]:
        """Covariance of the tool's true pose about the predicted one: position, then rotation.

        It includes what the measured targets do not tell of the tool, as far as the tolerances allow.

        Args:
            q: joint positions, radians.
            conditions: as of `predict_covariance`.
            frame: in which the tool is, and whose axes the covariance is in: the ``tracker``'s, or the robot's ``base``, so that
                what is unknown of where the base stands does not count.
            model_error: as of `predict_covariance`. Where points were measured, nothing is known of how far the model errs in
                rotation.

        Returns:
            metres² and radians².
        """
        q = np.asarray(q, dtype=float)
        J = self.tool_jacobian(q, conditions)
        if frame == "base":
            J[:, :, self.layout.bases[self.layout.station].columns] = 0.0
        estimated = (J @ self.z_covariance @ np.swapaxes(J, 1, 2))[:, None]
        if model_error:
            itself = np.broadcast_to(np.eye(6), (len(q), 1, 6, 6))
            covariance = pose_errors(self, q, itself, conditions).with_estimate(estimated)[:, 0]
        else:
            covariance = self.growth_at(q)[:, None, None] * estimated[:, 0]
        if frame == "base":
            turn = np.kron(np.eye(2), self.T_tracker_base[:3, :3].T)
            covariance = turn @ covariance @ turn.T
        return covariance

    def growth_at(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, " n"]:
        """Factor of the covariance of what is predicted at poses: 1 in the measured range, more beyond.

        Args:
            q: joint positions, radians.
        """
        q = np.asarray(q, dtype=float)
        if not self.range_growth or not len(self.q):
            return np.ones(len(q))
        return 1.0 + self.range_growth * self.measured_range.extrapolation(q)

    def tool_jacobian(
        self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None
    ) -> Float[np.ndarray, "n 6 z"]:
        """Derivative of the tool's pose by the entries of z: rows vx vy vz wx wy wz at the TCP, in tracker axes.

        Args:
            q: joint positions, radians.
            conditions: how the poses are reached, for effects that depend on it; as in the middle by default.
        """
        q = np.asarray(q, dtype=float)
        at = self.layout.walked(q, self.z, self.model.prepare(q, conditions))
        return walk.columns(at.chain, at.s, at.e, at.layout, at.factor, angular=True)

    def under(self, load: Load) -> "Calibration":
        """The calibrated robot under another load; residuals and outliers stay those of the load it was measured under.

        Args:
            load: payload, force and moment.

        Raises:
            TaskcalError: the model has no `Compliance`, or the robot file states no masses.
        """
        model = self.model.under(load)
        return replace(self, model=model, layout=replace(self.layout, model=model))

    def summary(self) -> dict[str, Any]:
        """The report, in millimetres and milliradians."""
        return summarise_calibration(self)

    @checked
    def save(self, path: str | Path) -> None:
        """Write a versioned JSON file, all at once; `load_calibration` reads it back exactly.

        Raises:
            FileError: the folder is missing or not writable.
            TaskcalError: as `to_text`; nothing is written then.
        """
        write_whole(path, self.to_text())

    def to_text(self) -> str:
        """The text of the file that `save` writes, once it was read back.

        Raises:
            TaskcalError: the file would be refused on reading, or hold another calibration.
        """
        try:
            text = CALIBRATION.text(_stated(self))
        except ValueError as error:
            raise TaskcalError(f"the calibration is not written, as it holds what is no number: {error}") from error
        expect_readable(text, self)
        return text

    def to_json(self) -> dict[str, Any]:
        """The content of the file, sealed."""
        return CALIBRATION.seal(_stated(self))


# The calibration file: what it states beside the fields of the calibration, and the calibration that all of it describes.


@dataclass(frozen=True, eq=False, kw_only=True)
class Observed:
    """How a target was observed without a tracker."""

    kind: str
    options: Mapping[str, Any]
    unknowns: Float[np.ndarray, " unknowns"]

    def observation(self) -> Observation:
        """The kind, without rows.

        Raises:
            TaskcalError: there is no such kind, or its options are not its own.
        """
        kind = kind_of(self.kind)
        try:
            made = kind.of_description(self.options)
        except (KeyError, TypeError, ValueError, TaskcalError) as error:
            raise TaskcalError(f"invalid options for observation '{shown(self.kind)}': {shown(error)}") from error
        if len(made.unknowns) != len(self.unknowns):
            raise TaskcalError(
                f"its observation '{self.kind}' has {len(self.unknowns)} unknowns, where {len(made.unknowns)} belong"
            )
        return made


@dataclass(frozen=True, eq=False, kw_only=True)
class Setup:
    """What was fitted to what: robot and effects, and how the targets were observed."""

    provenance: Provenance
    robot: Mapping[str, Any]
    """As its file describes it."""
    lengths_only: bool
    units: Literal["metres and radians"] = "metres and radians"
    effects: tuple[dict[str, Any], ...]
    kept: tuple[str, ...]
    targets: Annotated[tuple[str, ...], Field(min_length=1), InFile(counts="targets")]
    pose: bool
    observations: tuple[Observed, ...]
    """Of each target; none where a tracker measured all."""
    fixed_frames: bool
    turned: bool
    registration: Registration
    names: tuple[str, ...]
    """Of the entries of the estimate."""
    stations: Annotated[Stations | None, ONLY_WHERE_KNOWN] = None

    @classmethod
    def of(cls, calibration: Calibration) -> "Setup":
        """Of a calibration."""
        layout, model = calibration.layout, calibration.model
        unknowns = () if layout.tracked else layout.unknowns(calibration.z)
        return cls(
            provenance=calibration.provenance,
            robot=model.robot.description,
            lengths_only=model.lengths_only,
            effects=tuple(effect.to_json() for effect in model.effects),
            kept=calibration.kept,
            targets=layout.targets,
            pose=layout.pose,
            observations=tuple(
                Observed(kind=kind.key, options=kind.describe(), unknowns=unknown)
                for kind, unknown in zip(layout.kinds, unknowns, strict=False)
            ),
            fixed_frames=layout.fixed_frames,
            turned=layout.pose and not layout.fixed_frames,
            registration=layout.registration,
            names=layout.names,
            stations=layout.stations,
        )

    def model(self, effects: Sequence[Effect]) -> ErrorModel:
        """The model, with its effects.

        Raises:
            TaskcalError: the robot is not one, or was changed.
        """
        try:
            robot = robot_from(self.robot)
        except TaskcalError as error:
            raise TaskcalError(f"its robot: {error}") from error
        if robot.digest != self.provenance.robot_digest:
            raise TaskcalError(
                f"its robot was changed: its digest is {robot.digest}, that of the robot that was fitted "
                f"'{shown(self.provenance.robot_digest)}'"
            )
        return ErrorModel(robot, lengths_only=self.lengths_only, effects=effects)

    def layout(self, model: ErrorModel) -> Layout:
        """The layout of the estimate.

        Raises:
            TaskcalError: an observation is none, or the names are not those of the layout.
        """
        registration = self.registration
        kinds: tuple[Observation, ...] = (Pose() if self.pose else Point(),) * len(self.targets)
        if self.observations:
            if len(self.observations) != len(self.targets):
                raise TaskcalError(f"it has {len(self.observations)} observations for {len(self.targets)} targets")
            registration = replace(registration, unknowns=tuple(one.unknowns for one in self.observations))
            kinds = tuple(one.observation() for one in self.observations)
        stations = self.stations
        if stations is not None:
            count = len(stations.names)
            if len(set(stations.names)) < count or max(stations.of, default=0) >= count:
                raise TaskcalError(f"'stations' names {count}, two of them alike, or 'of' counts more")
        layout = Layout(
            model=model,
            estimated=np.arange(len(model)),
            registration=registration,
            targets=self.targets,
            kinds=kinds,
            fixed_frames=self.fixed_frames,
            stations=stations,
        )
        self._same_names(layout.names)
        return layout

    def _same_names(self, expected: tuple[str, ...]) -> None:
        """Estimate and covariance stand in the order of the names, so that others would give other parameters."""
        if len(self.names) != len(expected):
            raise TaskcalError(
                f"'names' has {len(self.names)} entries, the parameters kept and frames are {len(expected)}"
            )
        for number, (name, wanted) in enumerate(zip(self.names, expected, strict=True), start=1):
            if name != wanted:
                raise TaskcalError(f"'names' {number} is '{shown(name)}', where '{wanted}' belongs")


def _stated(calibration: Calibration) -> dict[str, Any]:
    """What a calibration's file states."""
    return {**describe(Setup.of(calibration)), **describe(calibration)}


@checked
def load_calibration(path: str | Path, *, unsealed: bool = False) -> Calibration:
    """Read a calibration saved by `Calibration.save`.

    Args:
        path: the file.
        unsealed: read a file that was edited since it was written, too; `Calibration.edited` has the keys then.

    Raises:
        FileError: the file is missing, truncated, of another format or version, edited, or inconsistent in itself; the message
            names the key and its value.
    """
    path = Path(path)
    data, edited = CALIBRATION.read(path, accept=unsealed)
    try:
        read = calibration_from(data)
        return replace(read, source=path.name, edited=tuple(dict.fromkeys((*read.edited, *edited))))
    except TaskcalError as error:
        raise FileError(path, str(error)) from error


def calibration_from(data: dict[str, Any], kinds: Sequence[type[Effect]] | None = None) -> Calibration:
    """The calibration that the content of a file describes.

    Args:
        data: the content.
        kinds: of its effects; by default those that are registered under their names.

    Raises:
        TaskcalError: it is inconsistent in itself; the message names the key and its value.
    """
    schema = schema_of(Calibration, base=schema_of(Setup, base=Marked))
    with consistent(CALIBRATION, schema):
        if isinstance(packed := data.get("covariance_factor"), dict):
            data = {**data, "covariance_factor": unpack_factor(packed)}
        content = schema.model_validate(data)
        setup = value_of(Setup, content, {"n": len(vars(content)["ids"])})
    effects = [
        _effect(number, effect, None if kinds is None else kinds[number - 1])
        for number, effect in enumerate(setup.effects, start=1)
    ]
    with consistent(CALIBRATION, schema):
        return _calibration(setup, content, setup.model(effects))


def _calibration(setup: Setup, content: FileSection, model: ErrorModel) -> Calibration:
    """The calibration of a setup, by the content of a file."""
    layout, joints = setup.layout(model), len(model.robot.joints)
    sizes = {"z": len(layout.names), "p": len(model), "joints": joints}
    sizes |= {"targets": len(layout.targets), "b": layout.block_size}
    found = Calibration(
        model=model,
        layout=layout,
        estimated=model.indices(setup.kept),
        provenance=setup.provenance,
        **values_of(Calibration, content, sizes),
    )
    shaped("model_error", np.array(found.model_error), "axes", {"axes": layout.block_size // 3})
    if found.joint_error:
        shaped("joint_error", np.array(found.joint_error), "joints", sizes)
    if setup.provenance.rows < len(found.ids):
        raise TaskcalError(f"'ids' names {len(found.ids)} rows, 'provenance' {setup.provenance.rows}")
    held_out = found.held_out
    if held_out is None:
        return found
    if max(held_out.part, default=0) >= len(held_out):
        raise TaskcalError(f"'held_out, part' counts {max(held_out.part) + 1} parts of {len(held_out)} rows")
    if not np.isfinite(held_out.residuals[..., 0]).any():
        raise TaskcalError("'held_out, residuals' holds not a single measured point")
    return replace(found, held_out=replace(held_out, kinds=layout.observed))


def expect_readable(text: str, calibration: Calibration) -> None:
    """Read the text of a calibration's file back before it is written.

    Raises:
        TaskcalError: it would be refused, or be another calibration.
    """
    try:
        content, changes = without_seal(parse_json(text, "its file"))
        if changes:
            raise TaskcalError(f"'{next(iter(changes))}' is read back as something else")
        again = calibration_from(content, [type(effect) for effect in calibration.model.effects])
        for name in ("z", "z_spread", "T_tracker_base", "T_tool_target"):
            if not np.array_equal(getattr(again, name), getattr(calibration, name)):
                raise TaskcalError(f"'{name}' is read back as something else")
    except TaskcalError as error:
        raise TaskcalError(f"the calibration is not written, for its file could not be read: {error}") from error


def _effect(number: int, described: Mapping[str, Any], kind: type[Effect] | None) -> Effect:
    """An effect of a file."""
    try:
        if kind is None:
            return effect_from(described)
        return kind.from_json({name: value for name, value in described.items() if name not in ("kind", "module")})
    except KeyError as error:
        raise TaskcalError(f"effect {number} lacks {error}; it may have been edited: identify again") from error
    except (TypeError, ValueError, AttributeError) as error:
        message = f"effect {number} is none: {shown(error)}; it may have been edited: identify again"
        raise TaskcalError(message) from error
