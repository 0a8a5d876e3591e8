"""Which convention three angles follow whose names leave it open, told by what the robot can have done."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.measurement.readings import Readings
from taskcal.measurement.registration_start import closed_form_rotations
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot

MIN_POSES = 6
"""Two frames have six unknowns, each pose three angles."""

MOST_POSES = 200
"""That are looked at, spread over all."""

FITS_RAD = float(np.radians(5.0))
"""Root mean square misfit of a nominal robot at most; it misses by tenths of a degree under the right convention."""

FAR_BETTER = 0.2
"""Of two misfits, where the better one decides."""

CALCULATED_RAD = 1e-5
"""Misfit under which angles of no certain meaning are the controller's own: no robot is built and measured so well."""


def with_convention(readings: Readings, robot: Robot) -> Readings:
    """Readings whose orientations follow the convention under which the nominal robot fits them.

    Where none fits far better than the others, it is the usual one of their names. A note says which it was, and what changes it.

    Args:
        readings: joints in radians and metres.
        robot: that was measured.
    """
    angles = readings.open_angles
    if angles is None:
        return readings
    misfits = {} if readings.q is None else _misfits(readings, robot)
    ranked = sorted(misfits, key=lambda form: misfits[form])
    readings = replace(readings, open_angles=None)
    if not ranked or not _decides([misfits[form] for form in ranked]):
        none_fits = ""
        if ranked and (least := misfits[ranked[0]]) > FITS_RAD:
            none_fits = f"; none fits the nominal robot: even as {ranked[0]} it misses them by {np.degrees(least):.0f}°"
        return _as_assumed(readings, angles.columns, angles.assumed, list(angles.meanings), none_fits)
    best, second = ranked[:2]
    off, other_off = np.degrees(misfits[best]), np.degrees(misfits[second])
    compared = f"the nominal robot misses them by {off:.2f}°, as {second} by {other_off:.2f}°"
    if angles.assumed is None and (misfits[best] < CALCULATED_RAD or len(readings.points) > 1):
        why = (
            "several targets are measured" if len(readings.points) > 1 else "they are what the nominal robot calculates"
        )
        return _noted(readings, f"{angles.columns} are left out, since {why}; --angles {best} uses them")
    note = f"{angles.columns} are read as {best}, by what fits: {compared}; --angles changes that"
    return replace(_noted(readings, note), rotations=angles.meanings[best])


def _as_assumed(readings: Readings, columns: str, assumed: str | None, forms: list[str], misfit: str) -> Readings:
    if assumed is None:
        why = "they may be angles about fixed or moving axes or a rotation vector, in degrees or radians"
        return _noted(
            readings, f"{columns} are left out, since {why}; to use them state --angles {' | '.join(forms)}{misfit}"
        )
    others = " or ".join(form for form in forms if form != assumed)
    note = f"{columns} are read as {assumed}, the usual meaning of these names; if they are {others}, state --angles{misfit}"
    return _noted(readings, note)


def _noted(readings: Readings, note: str) -> Readings:
    return replace(readings, notes=(*readings.notes, note))


def _decides(misfits: list[float]) -> bool:
    """Whether the first of rising misfits is small, and far smaller than the second."""
    return len(misfits) > 1 and misfits[0] <= min(FITS_RAD, FAR_BETTER * misfits[1])


def _misfits(readings: Readings, robot: Robot) -> dict[str, float]:
    """Root mean square angle between measured orientations and the registered nominal robot's, by what the angles may mean.

    Nothing where there are too few poses, or the robot cannot take one.
    """
    assert readings.open_angles is not None
    assert readings.q is not None
    seen = np.ones(len(readings), dtype=bool)
    for points in readings.points.values():
        seen &= ~np.isnan(points[:, 0])
    rows = np.flatnonzero(seen & np.isfinite(readings.q).all(axis=1))
    if len(rows) < MIN_POSES:
        return {}
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), MOST_POSES)).astype(int))]
    try:
        R = ErrorModel(robot).poses(readings.q[rows])[:, :3, :3]
    except CampaignError:
        return {}
    return {form: _misfit(R, measured[rows]) for form, measured in readings.open_angles.meanings.items()}


def _misfit(R: Float[np.ndarray, "n 3 3"], measured: Float[np.ndarray, "n 3 3"]) -> float:
    Z, X = closed_form_rotations(R, measured)
    off = se3.log(np.swapaxes(Z @ R @ X, 1, 2) @ measured)
    return float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
