"""What each part of a calibrated model is worth on rows that were not fitted: from the nominal robot to all parameters."""

from dataclasses import dataclass

import numpy as np

from taskcal.adaptation.nested_errors import left_out_errors
from taskcal.errors import CampaignError
from taskcal.identification.calibration import Calibration
from taskcal.identification.cross_validation import split_postures
from taskcal.measurement.campaign import Campaign
from taskcal.robot.error_model import ErrorModel

MIN_ROWS = 20
"""Of which every fold still leaves enough to fit."""


@dataclass(frozen=True, kw_only=True)
class Rung:
    """A nested model."""

    name: str
    parameters: int
    mean: float
    """Error in space on rows left out, metres."""
    p95: float
    """That 95 % of the points stay below, metres."""


def climb(calibration: Calibration, campaign: Campaign, *, folds: int = 5, seed: int = 0) -> tuple[Rung, ...]:
    """Errors of nested models on rows left out: frames alone, joint zeros, geometry, and each kind of effect on top.

    Args:
        calibration: with the whole model.
        campaign: measurements of its targets.
        folds: of neighbouring poses.
        seed: of the folds.

    Raises:
        CampaignError: too few rows, or other targets than the calibration's.
    """
    if campaign.targets != calibration.targets or campaign.observations:
        raise CampaignError("a ladder needs a tracker's campaign of the calibration's own targets")
    if len(campaign) < MIN_ROWS:
        raise CampaignError(f"{len(campaign)} rows are too few for a ladder; at least {MIN_ROWS}")
    names, sizes = list[str](), list[np.ndarray]()
    for name, kept in _nested(calibration):
        names.append(name)
        sizes.append(kept)
    scale = calibration.prior_scale
    prior = calibration.group_deviations
    if prior is None:
        prior = (1.0 if scale is None else scale) * calibration.model.tolerances
    parts = split_postures(campaign.q, folds, seed)
    errors = left_out_errors(calibration, campaign, sizes, prior, parts, None)
    return tuple(
        Rung(
            name=name,
            parameters=len(kept),
            mean=float(np.nanmean(error)),
            p95=float(np.nanpercentile(error, 95)),
        )
        for name, kept, error in zip(names, sizes, errors, strict=True)
    )


def _nested(calibration: Calibration) -> list[tuple[str, np.ndarray]]:
    """Names of nested models, and the parameters that each has."""
    model, estimated = calibration.model, calibration.estimated
    robot = model.robot
    geometry = set(ErrorModel(robot, lengths_only=model.lengths_only).names)
    turns = {f"{joint.name}.{'tz' if joint.kind == 'prismatic' else 'rz'}" for joint in robot.joints}
    zeros = np.array([i for i in estimated if model.names[i] in turns], dtype=int)
    whole = np.array([i for i in estimated if model.names[i] in geometry], dtype=int)
    out = [("nominal robot, frames only", np.zeros(0, dtype=int))]
    if len(zeros):
        out.append(("joint zeros", zeros))
    if len(whole) > len(zeros):
        out.append(("all geometry", whole))
    present = whole
    for effect in model.effects:
        own = {name for name in model.effect_names if name in set(_names(calibration, effect))}
        more = np.array([i for i in estimated if model.names[i] in own and i not in set(present.tolist())], dtype=int)
        if len(more):
            present = np.sort(np.concatenate([present, more]))
            out.append((f"with {effect.name}", present))
    return out


def _names(calibration: Calibration, effect: object) -> tuple[str, ...]:
    alone = ErrorModel(calibration.model.robot, effects=(effect,))  # pyright: ignore[reportArgumentType]
    return alone.effect_names
