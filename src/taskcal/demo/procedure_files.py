"""What a run of the procedure leaves in a folder: its campaigns, and the calibrations of the whole model."""

from pathlib import Path
from typing import Any

from taskcal.demo.procedure import INSIDE, ONE, OUTSIDE, SEVERAL, Errors, Procedure, frame_error
from taskcal.reading.writer import campaign_text

NAMES = {ONE: "one-orientation", SEVERAL: "several-orientations"}
KINDS = {"campaign": "csv", "calibration": "json"}


def procedure_names() -> tuple[str, ...]:
    """Names of all these files."""
    return tuple(f"{kind}-{name}.{ending}" for name in NAMES.values() for kind, ending in KINDS.items())


def procedure_contents(procedure: Procedure, folder: Path) -> tuple[dict[str, Path], dict[Path, str | bytes]]:
    """Which file holds what, and what is to be written in each."""
    files: dict[str, Path] = {}
    contents: dict[Path, str | bytes] = {}
    for label, campaign in procedure.campaigns.items():
        files[f"campaign {label}"] = folder / f"campaign-{NAMES[label]}.csv"
        contents[files[f"campaign {label}"]] = campaign_text(campaign, procedure.model.robot)
    for fit in procedure.fits:
        if fit.parameters == len(procedure.model):
            files[f"calibration {fit.campaign}"] = folder / f"calibration-{NAMES[fit.campaign]}.json"
            contents[files[f"calibration {fit.campaign}"]] = fit.calibration.to_text()
    return files, contents


# The procedure's results for machines.


def procedure_json(procedure: Procedure) -> dict[str, Any]:
    """Machine-readable, in millimetres and micrometres."""
    mechanism = procedure.mechanism
    return {
        "robot": procedure.model.robot.name,
        "seed": procedure.seed,
        "poses": {label: len(campaign) for label, campaign in procedure.campaigns.items()},
        "mechanism": {
            "motorised": mechanism.motorised,
            "passive": mechanism.passive,
            "mobility": mechanism.mobility,
            "overconstraint": mechanism.overconstraint,
        },
        "parameters": _parameters(procedure),
        "elimination": {
            label: {
                "rank": found.rank,
                "kept": found.kept,
                "zero": found.zero,
                "dependent": found.dependent,
                "condition_number": found.condition_number,
            }
            for label, found in procedure.elimination.eliminations.items()
        },
        "registration": _registration(procedure),
        "fits": _fits(procedure),
    }


def _parameters(procedure: Procedure) -> list[dict[str, Any]]:
    scaled = {label: found.maximum(scaled=True) * 1e6 for label, found in procedure.sensitivities.items()}
    return [
        {
            "name": row.name,
            "symbol": row.symbol,
            "published": row.published,
            "repeats": row.repeats,
            "eliminated": row.eliminated,
            "largest_influence_um": {label: values[:, i] for label, values in scaled.items()},
        }
        for i, row in enumerate(procedure.elimination.rows)
    ]


def _registration(procedure: Procedure) -> dict[str, Any]:
    off, turned = frame_error(procedure.registration.T_tracker_base, procedure.truth.T_tracker_base)
    return {
        "poses": len(procedure.sweeps),
        "circles": [
            {
                "axis": procedure.model.robot.joint_names[circle.axis],
                "rows": len(circle.rows),
                "radius_mm": circle.radius * 1e3,
                "residual_mm": circle.residual * 1e3,
            }
            for circle in procedure.circles
        ],
        "frame_error_mm": off * 1e3,
        "frame_error_mrad": turned * 1e3,
    }


def _fits(procedure: Procedure) -> list[dict[str, Any]]:
    covered = {(p.campaign, p.model, p.where): p.share_inside(0.95) for p in procedure.predictions}
    return [
        {
            "campaign": fit.campaign,
            "model": fit.model,
            "parameters": fit.parameters,
            "residual": _errors(fit.residual),
            "inside": _errors(fit.inside),
            "outside": _errors(fit.outside),
            "inside_95": covered[fit.campaign, fit.model, INSIDE],
            "outside_95": covered[fit.campaign, fit.model, OUTSIDE],
        }
        for fit in procedure.fits
    ]


def _errors(errors: Errors) -> dict[str, float]:
    x, y, z = (value * 1e3 for value in errors.per_axis)
    return {
        "mean_mm": errors.mean * 1e3,
        "max_mm": errors.maximum * 1e3,
        "max_x_mm": x,
        "max_y_mm": y,
        "max_z_mm": z,
    }
