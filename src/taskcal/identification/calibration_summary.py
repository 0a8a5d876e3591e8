"""What a calibration reports: parameters with their standard errors, model error, correlations, points that do not fit."""

from typing import TYPE_CHECKING, Any

import numpy as np

from taskcal.identification.informed_parameters import informed_parameters
from taskcal.identification.observation_layout import ObservationLayout
from taskcal.robot.parameter import ShownUnit

if TYPE_CHECKING:
    from taskcal.identification.calibration import Calibration

CORRELATIONS = 6
"""How many of the largest correlations are named."""


def summarise_calibration(calibration: "Calibration") -> dict[str, Any]:
    """The report of a calibration, in millimetres and milliradians."""
    rotation = calibration.model_error[1:]
    return {
        "robot": calibration.model.robot.name,
        "effects": [effect.to_json() for effect in calibration.model.effects],
        "field": calibration.field is not None or any(effect.key == "field" for effect in calibration.model.effects),
        "model_error_mm": calibration.model_error[0] * 1e3,
        **({"model_error_mrad": rotation[0] * 1e3} if rotation else {}),
        "prior_scale": calibration.prior_scale,
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
        "outliers": [
            {
                "row": outlier.row,
                "line": outlier.line,
                "id": outlier.id,
                "target": outlier.target,
                "residual_mm": outlier.residual * 1e3,
                "studentised": outlier.studentised,
            }
            for outlier in calibration.outliers
        ],
        "reason": calibration.reason,
        "remarks": list(calibration.remarks),
        "iterations": calibration.iterations,
        "rounds": calibration.rounds,
    }


def list_unknowns(calibration: "Calibration") -> list[dict[str, Any]]:
    """What stands where a tracker did not measure all: sockets, anchors …, each number with its standard error.

    Millimetres, milliradians, or parts per million, as the keys say; directions as they are.
    """
    layout = calibration.layout
    if not isinstance(layout, ObservationLayout):
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
