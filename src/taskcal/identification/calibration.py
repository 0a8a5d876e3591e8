"""A Calibration: what was identified, how well, and what the robot does with it."""

import base64
import binascii
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from functools import cache, cached_property
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from jaxtyping import Bool, Float, Int
from pydantic import Field, ValidationError

from taskcal.arguments import checked
from taskcal.campaigns.campaign import Campaign, Stations, named_file
from taskcal.errors import CampaignError, FileError, FitError, TaskcalError, shown
from taskcal.estimation.matrices import factor_positive, single_threaded
from taskcal.geometry import se3
from taskcal.geometry.se3 import array_of, of_shape, rigid
from taskcal.identification.calibration_format import FORMAT, FORMAT_VERSION, read_envelope
from taskcal.identification.held_out import NO_UNCERTAINTY, HeldOut, LeftOut, Outlier, shared_with_neighbours
from taskcal.identification.layout import Layout
from taskcal.identification.measured_range import MeasuredRange
from taskcal.identification.problem import Rows, Seen, joint_columns
from taskcal.io.files import write_whole
from taskcal.io.json_file import ON_PURPOSE, note_of_edits, parse_json, sealed, unseal, without_seal
from taskcal.io.toml_file import Finite, NotNegative, Section, explain
from taskcal.kernels import walk
from taskcal.observations import Observation, Point, Pose, block_size, kind_of
from taskcal.registration.registration_file import RegistrationSection, describe_registration
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


def factor_of(rows: Sequence[Sequence[float]], size: int) -> Float[np.ndarray, "z z"]:
    """The factor that has these rows up to the diagonal.

    Raises:
        TaskcalError: there are more or fewer rows, or one has another number of entries.
    """
    if len(rows) != size:
        raise TaskcalError(f"'covariance_factor' has {len(rows)} rows, not {size}")
    B = np.zeros((size, size))
    for i, row in enumerate(rows):
        if len(row) != i + 1:
            raise TaskcalError(f"'covariance_factor' {i + 1} has {len(row)} numbers, not {i + 1}")
        B[i, : i + 1] = row
    return B


# What a calibration file holds: numbers, names and texts of a calibration, as JSON has them.


def describe_calibration(calibration: "Calibration") -> dict[str, Any]:
    """The content of a calibration's file."""
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "provenance": asdict(calibration.provenance),
        "robot": dict(calibration.model.robot.description),
        "lengths_only": calibration.model.lengths_only,
        "units": "metres and radians",
        "effects": [effect.to_json() for effect in calibration.model.effects],
        "kept": list(calibration.kept),
        "targets": list(calibration.targets),
        "pose": calibration.layout.pose,
        "observations": _describe_observations(calibration),
        "fixed_frames": calibration.layout.fixed_frames,
        "turned": calibration.layout.pose and not calibration.layout.fixed_frames,
        "registration": describe_registration(calibration.layout.registration),
        "names": list(calibration.all_names),
        "estimate": calibration.z.tolist(),
        "covariance_factor": describe_factor(calibration.z_spread),
        "T_tracker_base": calibration.T_tracker_base.tolist(),
        **_describe_stations(calibration.layout.stations),
        "T_tool_target": calibration.T_tool_target.tolist(),
        "model_error": list(calibration.model_error),
        "joint_error": list(calibration.joint_error),
        "range_growth": calibration.range_growth,
        "prior_scale": calibration.prior_scale,
        "group_deviations": None if calibration.group_deviations is None else calibration.group_deviations.tolist(),
        **count_parameters(calibration),
        "log_evidence": calibration.log_evidence,
        "ids": list(calibration.ids),
        "q": calibration.q.tolist(),
        "residuals": _without_nan(calibration.residuals),
        "studentised": _without_nan(calibration.studentised),
        "outliers": [asdict(outlier) for outlier in calibration.outliers],
        "left_out": [asdict(row) for row in calibration.left_out],
        "held_out": None if calibration.held_out is None else _describe_held_out(calibration.held_out),
        "iterations": calibration.iterations,
        "rounds": calibration.rounds,
        "reason": calibration.reason,
        "remarks": list(calibration.remarks),
        "edited": list(calibration.edited),
    }


def _describe_stations(stations: Stations | None) -> dict[str, Any]:
    """Describe where a tracker stood that was moved; nothing of one whose station is not named."""
    if stations is None:
        return {}
    T = stations.T_first_station.tolist()
    return {"stations": {"names": list(stations.names), "of": stations.of.tolist(), "T_first_station": T}}


def count_parameters(calibration: "Calibration") -> dict[str, float | int]:
    """Groups with a size, and effective parameters; nothing that is not known."""
    counts = {
        "effective_parameters": calibration.effective_parameters,
        "parameter_groups": calibration.parameter_groups,
    }
    return {key: value for key, value in counts.items() if value is not None}


def _describe_held_out(held_out: "HeldOut") -> dict[str, Any]:
    return {
        "by": held_out.by,
        "folds": held_out.folds,
        "rows": held_out.rows.tolist(),
        "part": held_out.part.tolist(),
        "residuals": _without_nan(held_out.residuals),
        "nominal": _without_nan(held_out.nominal),
        "inside": _truths(held_out.inside),
        "rotation_inside": _truths(held_out.rotation_inside),
    }


def _describe_observations(calibration: "Calibration") -> list[dict[str, Any]]:
    """Describe the kind of observation of each target; none where a tracker measured all."""
    layout = calibration.layout
    if layout.tracked:
        return []
    unknowns = layout.unknowns(calibration.z)
    return [
        {"kind": kind.key, "options": kind.describe(), "unknowns": unknown.tolist()}
        for kind, unknown in zip(layout.kinds, unknowns, strict=True)
    ]


def _truths(array: Float[np.ndarray, "n targets"] | None) -> list[list[bool | None]] | None:
    return None if array is None else [[None if np.isnan(v) else bool(v) for v in row] for row in array]


def _without_nan(array: np.ndarray) -> list[Any]:
    out = array.astype(object)
    out[np.isnan(array)] = None
    return out.tolist()


# Which parameters the data of a calibration inform, and which its prior alone holds.

UNINFORMED_SHARE = 0.95
"""Standard error over the prior's standard deviation, from which on nothing was learnt. A convention: at 0.95 the data add a
tenth of the prior's information."""

WORTHLESS_SIZE = 3e-4
"""Model error, metres per axis, from which on a robot that shows none of its tolerances is no nearly perfect one. A convention:
a nearly perfect robot leaves less."""


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


def tells_nothing(
    standard_errors: Float[np.ndarray, " k"],
    tolerances: Float[np.ndarray, " k"],
    scale: float,
    likeliest_scale: float,
    model_error: float,
) -> bool:
    """Whether a fit learnt nothing, and called all that was measured error.

    The rows tell nothing where every parameter is as uncertain as its prior of the most probable scale, which is next to
    zero then; of the expected one, which allows for what the rows do not exclude, they would always seem to tell a little.

    Args:
        standard_errors: of the parameters that were estimated.
        tolerances: of these.
        scale: of the prior's standard deviations, as expected.
        likeliest_scale: the most probable one.
        model_error: metres per axis.
    """
    if not len(standard_errors) or model_error < WORTHLESS_SIZE:
        return False
    told = np.maximum(standard_errors**-2 - (scale * tolerances) ** -2, 0.0)
    unseen = 1.0 / np.sqrt(1.0 + told * (likeliest_scale * tolerances) ** 2)
    return bool((unseen > UNINFORMED_SHARE).all())


# What a calibration reports: parameters with their standard errors, model error, correlations, points that do not
# fit.

CORRELATIONS = 6
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
        own = 1e3 * deviation[calibration.layout.frame_columns(k)]
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
        errors = np.full(len(values), np.nan) if layout.fixed_frames else deviation[own]
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


def list_parameters(calibration: "Calibration") -> list[dict[str, Any]]:
    """Estimate, standard error and tolerance of every estimated parameter, each in the unit that its key ends with."""
    out: list[dict[str, Any]] = []
    informed = informed_parameters(calibration)
    for i in calibration.estimated:
        p = calibration.model.parameters[i]
        unit = p.shown
        values = {
            f"estimate_{unit.key}": float(calibration.estimate[i]) * unit.factor,
            f"standard_error_{unit.key}": float(calibration.standard_errors[i]) * unit.factor,
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
    campaign, _ = in_its_frames(calibration, campaign)
    kinds = observed_kinds(calibration, campaign)
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


def observed_kinds(calibration: "Calibration", campaign: Campaign) -> tuple[Observation, ...]:
    """Kind of observation of each target of a campaign; a pose's point alone where the calibration knows no rotation."""
    one = Pose() if campaign.rotations is not None and calibration.layout.pose else Point()
    return campaign.observations or (one,) * len(campaign.targets)


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
    for t, kind in enumerate(observed_kinds(calibration, campaign)):
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
    b = block_size(observed_kinds(calibration, campaign))
    return out[:, calibration.rows_of(campaign.targets), :b, :b] + noise[..., :b, :b]


def _covariance_by_kind(
    calibration: "Calibration", campaign: Campaign, noise: Float[np.ndarray, "n targets b b"], *, settled: bool
) -> Float[np.ndarray, "n targets b b"]:
    """The same where not a tracker alone measured.

    With D the covariance of what errs at single rows, noise and model error, and B the derivative by the unknowns that the rows
    locate, least squares leave D − B·M·Bᵀ of D, where M = (Bᵀ·D⁻¹·B + P)⁻¹ and P is what is known of them beforehand, next to
    nothing; of the derivative J by what the calibration knows they leave J − B·M·Bᵀ·D⁻¹·J.
    """
    kinds, numbers = observed_kinds(calibration, campaign), calibration.rows_of(campaign.targets)
    located = _located(calibration, campaign, settled=settled)
    rows, n, b = _rows_on(calibration, campaign, [unknown for unknown, _ in located]), len(campaign), block_size(kinds)
    layout, growth = rows.layout, calibration.growth_at(campaign.q)[:, None]
    by_entry = rows.linearise().by_entry.reshape(n, len(layout.targets), -1, len(rows.z))[:, numbers, :b]
    single = noise[..., :b, :b].copy()
    if any(calibration.joint_error):
        moved = rows.propagate_joints(np.square(calibration.joint_error))[:, numbers, :b, :b]
        single += growth[..., None, None] * moved
    free, deviation = np.zeros(len(rows.z), dtype=bool), np.ones(len(rows.z))
    error = np.repeat(np.square(calibration.model_error), 3)
    for t, (kind, (_, own)) in enumerate(zip(kinds, located, strict=True)):
        block, columns = kind.block(), layout.own[numbers[t]]
        single[:, t, block, block] += growth * error[block]
        free[columns], deviation[columns] = own, kind.deviations
    entry = {name: k for k, name in enumerate(calibration.all_names)}
    known = [entry[layout.names[k]] for k in np.flatnonzero(~free)]
    J, B = np.sqrt(growth)[..., None, None] * by_entry[..., ~free], by_entry[..., free]
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
    for t, kind in zip(numbers, observed_kinds(calibration, campaign), strict=True):
        kinds[t] = kind
    there = replace(layout, kinds=tuple(kinds))
    entry = dict(zip(calibration.all_names, calibration.z, strict=True))
    z = np.array([entry.get(name, 0.0) for name in there.names])
    for t, unknown in zip(numbers, unknowns, strict=True):
        z[there.own[t]] = unknown
    rotations = np.tile(np.eye(3), (n, 1, 1)) if campaign.rotations is None else campaign.rotations
    at = there.walked(campaign.q, z, calibration.model.prepare(campaign.q, campaign.conditions))
    return Rows(there, z, at, Seen(position=points, rotation=rotations, valid=valid, kinds=there.kinds))


# What is uncertain of a pose where it is not known how it is reached, or how warm the robot is.
#
# What is not told counts by its expectation, and adds its variance. With ξ the parameters of the effects that
# depend on conditions, m and S their estimate and covariance, and J_c the derivative of a target by them under a
# condition c of mean zero,
#
#     E[(J_c·ξ)(J_c·ξ)ᵀ] = E[J_c·(m·mᵀ + S)·J_cᵀ],
#
# so that effects which are hardly known add their uncertainty, too.


def covariance_of_unknown_conditions(
    calibration: "Calibration", q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None
) -> Float[np.ndarray, "n targets b b"]:
    """Covariance of the targets by what is not told of the poses, metres² (and radians², for poses), tracker frame.

    A joint whose side is not told came from either one with even chance. Its share of the largest move is evenly spread
    between nothing and all, so that the mean of its square is 1/3, and of its product with the side 1/2. What an effect
    needs and is not told is as far from its reference as the effect says (`Effect.off_reference`).

    Args:
        calibration: with effects that depend on conditions.
        q: joint positions, radians.
        conditions: what is told; nothing by default.
    """
    terms = [term for term in calibration.model.terms if isinstance(term, LinearTerm) and term.given is not None]
    index = {name: i for i, name in enumerate(calibration.all_names)}
    own = np.array([index[name] for term in terms for name in term.names])
    second = calibration.z_covariance[np.ix_(own, own)] + np.outer(calibration.z[own], calibration.z[own])
    at = calibration.layout.walked(q, calibration.z, calibration.model.prepare(q, conditions))
    angular = calibration.layout.pose
    columns = np.stack([joint_columns(at, point, angular=angular) for point in at.points.position], axis=1)
    out = np.zeros((*columns.shape[:3], columns.shape[2]))
    for probe, weight in _probes(calibration, len(q), conditions or Conditions()):
        rows = np.flatnonzero(weight)
        if not len(rows):
            continue
        J = _derivative(terms, q[rows], probe.take(rows), columns[rows])
        out[rows] += weight[rows, None, None, None] * (J @ second @ np.swapaxes(J, -1, -2))
    return out


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


def _probes(
    calibration: "Calibration", count: int, conditions: Conditions
) -> Iterator[tuple[Conditions, Float[np.ndarray, " n"]]]:
    """Conditions, and with which weight the square of what each does counts at every pose.

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
    for effect in calibration.model.effects:
        off = effect.off_reference(count)
        if off is not None:
            told = [getattr(conditions, quantity) for quantity in effect.needs]
            yield off, np.max([np.ones(count) if t is None else ~np.isfinite(t) for t in told], axis=0).astype(float)


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


@dataclass(frozen=True, eq=False, kw_only=True)
class Calibration:
    """An identified robot in its measuring frame."""

    model: ErrorModel
    layout: Layout
    """How z is laid out."""
    estimated: Int[np.ndarray, " kept"]
    """Model parameters that were estimated; the others stay zero and are considered."""
    z: Float[np.ndarray, " z"]
    """All parameters, tracker frame and targets, in the order of `all_names`."""
    z_spread: Float[np.ndarray, "z z"]
    """Lower triangular B of the covariance B·Bᵀ of their error, which so is negative nowhere."""
    T_tracker_base: Float[np.ndarray, "4 4"]
    """Pose of the robot's base in the tracker frame."""
    T_tool_target: Float[np.ndarray, "targets 4 4"]
    """Pose of every target in the tool frame; for a point its rotation is the identity."""
    residuals: Float[np.ndarray, "n targets b"]
    """Measured less predicted in the tracker frame, metres (then radians, for poses); NaN for lost beams."""
    studentised: Float[np.ndarray, "n targets"]
    """Length of each residual over its own standard deviation."""
    outliers: tuple[Outlier, ...]
    """Points whose residual is too long for chance, the longest first."""
    left_out: tuple[LeftOut, ...]
    """Rows that cannot be right, and were not fitted."""
    ids: tuple[str, ...]
    """Names of the rows that were fitted."""
    model_error: tuple[float, ...]
    """Standard deviation of what geometry does not explain: metres per axis (and radians, for poses)."""
    joint_error: tuple[float, ...] = ()
    """Standard deviation of the pose-to-pose error of each joint, radians (metres where it slides); empty where it
    was not asked for."""
    range_growth: float = 0.0
    """Growth g of the covariance beyond the measured range: by the factor 1 + g·u², u how far a pose lies outside
    (`MeasuredRange.extrapolation`)."""
    prior_scale: float | None
    """Factor of the prior's standard deviations; None where there was no prior."""
    group_deviations: Float[np.ndarray, " p"] | None = None
    """Prior standard deviation of every parameter, metres and radians, where each effect of each joint has a size of its own;
    None where all are the tolerances times `prior_scale`."""
    effective_parameters: float | None = None
    """How many of the estimated parameters the rows determine, each counted by the share of its prior variance that they took away;
    None where there was no prior, or the file does not state it."""
    parameter_groups: int | None = None
    """Groups of parameters whose size was estimated from the rows; None where no size was, or the file does not state it."""
    log_evidence: float | None
    """Logarithm of the marginal likelihood, but for a constant of the campaign; None where there was no prior."""
    iterations: int
    """Of the last fit."""
    rounds: int
    """Of fit and hyperparameters in turn."""
    reason: str
    """Why the fit ended."""
    remarks: tuple[str, ...]
    """What a user should look at before believing the result."""
    provenance: Provenance
    q: Float[np.ndarray, "n joints"]
    """Joint positions of the rows that were fitted, radians."""
    held_out: HeldOut | None = None
    """What the fit predicted of rows that it had not seen, if any were held out."""
    source: str = ""
    """File that it was read from."""
    edited: tuple[str, ...] = ()
    """Keys of its file that were edited after it was written, and read all the same (``unsealed``); a file that is made of it names
    them, too."""

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
            model_error: add what the model cannot explain at a new pose; without it, the covariance says how well the fitted
                model itself is known there.

        Returns:
            b = 3 rows for points, metres²; 6 for poses, then radians².
        """
        q = np.asarray(q, dtype=float)
        targets = Rows.of_targets(self.layout, self.z, q, self.model.prepare(q, conditions))
        growth = self.growth_at(q)[:, None, None, None]
        covariance = growth * targets.propagate(self.z_covariance)[1]
        if self.model.conditioned:
            covariance = covariance + covariance_of_unknown_conditions(self, q, conditions)
        if not model_error:
            return covariance
        if any(self.joint_error):
            covariance = covariance + growth * targets.propagate_joints(np.square(self.joint_error))
        return covariance + growth * np.diag(np.repeat(np.square(self.model_error), 3)[: covariance.shape[2]])

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
        self, q: Float[np.ndarray, "n joints"], *, frame: Literal["tracker", "base"] = "tracker"
    ) -> Float[np.ndarray, "n 6 6"]:
        """Covariance of the tool's true pose about the predicted one: position, then rotation.

        It includes what the measured targets do not tell of the tool, as far as the tolerances allow, but not the model
        error of a single new pose (`model_error`).

        Args:
            q: joint positions, radians.
            frame: in which the tool is, and whose axes the covariance is in: the ``tracker``'s, or the robot's ``base``, so that
                what is unknown of where the base stands does not count.

        Returns:
            metres² and radians².
        """
        J = self.tool_jacobian(q)
        if frame == "base":
            J[:, :, self.layout.frame_columns(self.layout.station)] = 0.0
            R = self.T_tracker_base[:3, :3]
            J = np.concatenate([R.T @ J[:, :3], R.T @ J[:, 3:]], axis=1)
        return self.growth_at(q)[:, None, None] * (J @ self.z_covariance @ np.swapaxes(J, 1, 2))

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
            text = json.dumps(self.to_json(), indent=1, allow_nan=False) + "\n"
        except ValueError as error:
            raise TaskcalError(f"the calibration is not written, as it holds what is no number: {error}") from error
        expect_readable(text, self)
        return text

    def to_json(self) -> dict[str, Any]:
        """The content of the file, sealed."""
        return sealed(describe_calibration(self))


# How a target was observed without a tracker, as a calibration's file has it.


class ObservationSection(Section):
    """How a target was observed without a tracker."""

    kind: str
    options: dict[str, Any]
    unknowns: list[Finite]

    def observation(self) -> Observation:
        """The kind, without rows.

        Raises:
            TaskcalError: there is no such kind, or its options are not its own.
        """
        kind = kind_of(self.kind)
        try:
            made = kind.of_description(self.options)
        except (KeyError, TypeError, ValueError) as error:
            raise TaskcalError(f"invalid options for observation '{shown(self.kind)}': {shown(error)}") from error
        if len(made.unknowns) != len(self.unknowns):
            raise TaskcalError(
                f"its observation '{self.kind}' has {len(self.unknowns)} unknowns, where {len(made.unknowns)} belong"
            )
        return made


# The calibration file: its schema, and the calibration it describes.

Count = Annotated[int, Field(strict=True, ge=0, le=10**9)]
Real = Annotated[float, Field(strict=True, ge=-1e300, le=1e300, allow_inf_nan=False)]
AboveZero = Annotated[float, Field(strict=True, gt=0, le=1e6, allow_inf_nan=False)]
Ratio = Annotated[float, Field(strict=True, ge=0, le=1e300, allow_inf_nan=False)]
Flag = Annotated[bool, Field(strict=True)]
Texts = list[str]
Vector = list[Finite]
Matrix = list[list[Finite]]


class OutlierSection(Section):
    """A point that the fit cannot believe."""

    row: Count
    line: Count | None
    id: str
    target: str
    studentised: Ratio
    residual: NotNegative


class LeftOutSection(Section):
    """A row that was not fitted."""

    row: Count
    line: Count | None
    id: str
    distance: NotNegative
    studentised: Ratio


class HeldOutSection(Section):
    """Held-out rows and their predictions."""

    by: Literal["neighbours", "blocks", "rows", "chosen"]
    folds: Count
    rows: list[Count] = Field(min_length=1)
    part: list[Count]
    residuals: list[list[list[Finite | None]]]
    nominal: list[list[list[Finite | None]]]
    inside: list[list[bool | None]] | None = None
    rotation_inside: list[list[bool | None]] | None = None

    def held_out(self, targets: int, width: int, kinds: tuple[type[Observation], ...]) -> HeldOut:
        """Held-out errors that it describes, of targets with these observations.

        Raises:
            TaskcalError: the parts do not belong together.
        """
        n = len(self.rows)
        shape = n, targets, width
        of_shape("held_out, part", np.array(self.part), (n,))
        if max(self.part) >= n:
            raise TaskcalError(f"'held_out, part' counts {max(self.part) + 1} parts of {n} rows")
        residuals = array_of("held_out, residuals", self.residuals, shape)
        if not np.isfinite(residuals[..., 0]).any():
            raise TaskcalError("'held_out, residuals' holds not a single measured point")
        return HeldOut(
            by=self.by,
            folds=self.folds,
            rows=np.array(self.rows),
            part=np.array(self.part),
            residuals=residuals,
            nominal=array_of("held_out, nominal", self.nominal, shape),
            inside=None if self.inside is None else array_of("held_out, inside", self.inside, shape[:2]),
            rotation_inside=None
            if self.rotation_inside is None
            else array_of("held_out, rotation_inside", self.rotation_inside, shape[:2]),
            kinds=kinds,
        )


class ProvenanceSection(Section):
    """Where a calibration comes from."""

    robot: str
    robot_digest: str
    campaign: str
    campaign_digest: str
    rows: Count
    version: str
    created: str
    options: dict[str, Any]
    notes: tuple[str, ...]


class StationsSection(Section):
    """Where a tracker stood that was moved."""

    names: Texts = Field(min_length=1)
    of: list[Count]
    T_first_station: list[Matrix]

    def stations(self, rows: int) -> Stations:
        """The stations of so many rows.

        Raises:
            TaskcalError: the parts do not belong together.
        """
        count, key = len(self.names), "stations, T_first_station"
        of = np.array(self.of, dtype=int)
        of_shape("stations, of", of, (rows,))
        if len(set(self.names)) < count or max(self.of, default=0) >= count:
            raise TaskcalError(f"'stations' names {count}, two of them alike, or 'of' counts more")
        T = rigid(key, array_of(key, self.T_first_station, (count, 4, 4)))
        return Stations(names=tuple(self.names), of=of, T_first_station=T)


class CalibrationFile(Section):
    """A calibration file."""

    format: str
    format_version: int
    provenance: ProvenanceSection
    robot: dict[str, Any]
    lengths_only: Flag
    units: Literal["metres and radians"]
    effects: list[dict[str, Any]]
    kept: Texts
    targets: Texts = Field(min_length=1)
    pose: Flag
    observations: list[ObservationSection]
    fixed_frames: Flag
    turned: Flag
    registration: RegistrationSection
    names: Texts
    estimate: Vector
    covariance_factor: list[Vector]
    T_tracker_base: Matrix
    stations: StationsSection | None = None
    T_tool_target: list[Matrix]
    model_error: list[NotNegative]
    joint_error: list[NotNegative]
    range_growth: Ratio
    prior_scale: AboveZero | None
    group_deviations: list[AboveZero] | None
    effective_parameters: Ratio | None = None
    parameter_groups: Count | None = None
    log_evidence: Real | None
    ids: Texts
    q: Matrix
    residuals: list[list[list[Finite | None]]]
    studentised: list[list[Ratio | None]]
    outliers: list[OutlierSection]
    left_out: list[LeftOutSection]
    held_out: HeldOutSection | None
    iterations: Count
    rounds: Count
    reason: str
    remarks: Texts
    edited: Texts

    def calibration(self, effects: Sequence[Effect]) -> Calibration:
        """The calibration it describes, with its effects.

        Raises:
            TaskcalError: the robot or a parameter is not one, or the parts do not belong together.
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
        model = ErrorModel(robot, lengths_only=self.lengths_only, effects=effects)
        layout = self._layout(model)
        size, rows, width = len(layout.names), len(self.ids), layout.block_size
        self._same_names(layout.names)
        of_shape("model_error", np.array(self.model_error), (width // 3,))
        if self.joint_error:
            of_shape("joint_error", np.array(self.joint_error), (len(robot.joints),))
        if self.provenance.rows < rows:
            raise TaskcalError(f"'ids' names {rows} rows, 'provenance' {self.provenance.rows}")
        return Calibration(
            model=model,
            layout=layout,
            estimated=model.indices(self.kept),
            z=array_of("estimate", self.estimate, (size,)),
            z_spread=factor_of(self.covariance_factor, size),
            T_tracker_base=rigid("T_tracker_base", array_of("T_tracker_base", self.T_tracker_base, (4, 4))),
            T_tool_target=rigid(
                "T_tool_target", array_of("T_tool_target", self.T_tool_target, (len(self.targets), 4, 4))
            ),
            residuals=array_of("residuals", self.residuals, (rows, len(self.targets), width)),
            studentised=array_of("studentised", self.studentised, (rows, len(self.targets))),
            outliers=tuple(Outlier(**section.model_dump()) for section in self.outliers),
            left_out=tuple(LeftOut(**section.model_dump()) for section in self.left_out),
            ids=tuple(self.ids),
            q=array_of("q", self.q, (rows, len(robot.joints))),
            held_out=None
            if self.held_out is None
            else self.held_out.held_out(len(self.targets), width, layout.observed),
            model_error=tuple(self.model_error),
            joint_error=tuple(self.joint_error),
            range_growth=self.range_growth,
            prior_scale=self.prior_scale,
            group_deviations=self._group_deviations(len(model)),
            effective_parameters=self.effective_parameters,
            parameter_groups=self.parameter_groups,
            log_evidence=self.log_evidence,
            iterations=self.iterations,
            rounds=self.rounds,
            reason=self.reason,
            remarks=tuple(self.remarks),
            edited=tuple(self.edited),
            provenance=Provenance(**self.provenance.model_dump()),
        )

    def _layout(self, model: ErrorModel) -> Layout:
        registration = self.registration.registration(len(self.targets))
        kinds: tuple[Observation, ...] = (Pose() if self.pose else Point(),) * len(self.targets)
        if self.observations:
            if len(self.observations) != len(self.targets):
                raise TaskcalError(f"it has {len(self.observations)} observations for {len(self.targets)} targets")
            unknowns = tuple(np.array(section.unknowns, dtype=float) for section in self.observations)
            registration = replace(registration, unknowns=unknowns)
            kinds = tuple(section.observation() for section in self.observations)
        return Layout(
            model=model,
            estimated=np.arange(len(model)),
            registration=registration,
            targets=tuple(self.targets),
            kinds=kinds,
            fixed_frames=self.fixed_frames,
            stations=None if self.stations is None else self.stations.stations(len(self.ids)),
        )

    def _same_names(self, expected: tuple[str, ...]) -> None:
        """Estimate and covariance stand in the order of the names, so that others would give other parameters."""
        if len(self.names) != len(expected):
            raise TaskcalError(
                f"'names' has {len(self.names)} entries, the parameters kept and frames are {len(expected)}"
            )
        for number, (name, wanted) in enumerate(zip(self.names, expected, strict=True), start=1):
            if name != wanted:
                raise TaskcalError(f"'names' {number} is '{shown(name)}', where '{wanted}' belongs")

    def _group_deviations(self, parameters: int) -> Float[np.ndarray, " p"] | None:
        if self.group_deviations is None:
            return None
        return array_of("group_deviations", self.group_deviations, (parameters,))


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
    data, edited = unseal(path, read_envelope(path), f"restore it, or identify again; {ON_PURPOSE}", accept=unsealed)
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
    try:
        if isinstance(packed := data.get("covariance_factor"), dict):
            data = {**data, "covariance_factor": unpack_factor(packed)}
    except TaskcalError as error:
        raise TaskcalError(f"{error}; it may have been edited: identify again") from error
    try:
        content = CalibrationFile.model_validate(data)
    except ValidationError as error:
        raise TaskcalError(f"{explain(error, CalibrationFile)}; it may have been edited: identify again") from error
    effects = [
        _effect(number, effect, None if kinds is None else kinds[number - 1])
        for number, effect in enumerate(content.effects, start=1)
    ]
    try:
        return content.calibration(effects)
    except TaskcalError as error:
        raise TaskcalError(f"is inconsistent: {error}; it may have been edited: identify again") from error


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
    """An effect of a file.

    Raises:
        TaskcalError: it is not known, comes from a module that is not imported, or its options are not its own.
    """
    try:
        if kind is None:
            return effect_from(described)
        return kind.from_json({name: value for name, value in described.items() if name not in ("kind", "module")})
    except KeyError as error:
        raise TaskcalError(f"effect {number} lacks {error}; it may have been edited: identify again") from error
    except (TypeError, ValueError, AttributeError) as error:
        message = f"effect {number} is none: {shown(error)}; it may have been edited: identify again"
        raise TaskcalError(message) from error
