"""What a calibration file holds: numbers, names and texts of a calibration, as JSON has them."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from taskcal.identification.calibration_envelope import FORMAT, FORMAT_VERSION
from taskcal.identification.observation_layout import ObservationLayout
from taskcal.identification.packed_covariance import describe_factor
from taskcal.measurement.registration_file import describe_registration

if TYPE_CHECKING:
    from taskcal.identification.calibration import Calibration
    from taskcal.identification.held_out import HeldOut


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
        "turned": calibration.layout.turned,
        "registration": describe_registration(calibration.layout.registration),
        "names": list(calibration.all_names),
        "estimate": calibration.z.tolist(),
        "covariance_factor": describe_factor(calibration.z_spread),
        "T_tracker_base": calibration.T_tracker_base.tolist(),
        "T_tool_target": calibration.T_tool_target.tolist(),
        "model_error": list(calibration.model_error),
        "joint_error": list(calibration.joint_error),
        "prior_scale": calibration.prior_scale,
        "group_deviations": None if calibration.group_deviations is None else calibration.group_deviations.tolist(),
        "log_evidence": calibration.log_evidence,
        "field": None if calibration.field is None else calibration.field.to_json(),
        "ids": list(calibration.ids),
        "q": None if calibration.q is None else calibration.q.tolist(),
        "residuals": _without_nan(calibration.residuals),
        "studentised": _without_nan(calibration.studentised),
        "outliers": [asdict(outlier) for outlier in calibration.outliers],
        "left_out": [asdict(row) for row in calibration.left_out],
        "held_out": None if calibration.held_out is None else _describe_held_out(calibration.held_out),
        "iterations": calibration.iterations,
        "rounds": calibration.rounds,
        "reason": calibration.reason,
        "remarks": list(calibration.remarks),
    }


def _describe_held_out(held_out: "HeldOut") -> dict[str, Any]:
    return {
        "by": held_out.by,
        "folds": held_out.folds,
        "rows": held_out.rows.tolist(),
        "part": held_out.part.tolist(),
        "residuals": _without_nan(held_out.residuals),
        "nominal": _without_nan(held_out.nominal),
    }


def _describe_observations(calibration: "Calibration") -> list[dict[str, Any]]:
    """How each target was observed; none where a tracker measured all."""
    layout = calibration.layout
    if not isinstance(layout, ObservationLayout):
        return []
    unknowns = layout.unknowns(calibration.z)
    return [
        {"kind": kind.key, "options": kind.describe(), "unknowns": unknown.tolist()}
        for kind, unknown in zip(layout.kinds, unknowns, strict=True)
    ]


def _without_nan(array: np.ndarray) -> list[Any]:
    out = array.astype(object)
    out[np.isnan(array)] = None
    return out.tolist()
