"""What an examination says, for the terminal."""

import numpy as np

from taskcal.identification.acceptance import GUARD, Acceptance
from taskcal.identification.examination import Examination
from taskcal.presentation.calibration_tables import are_most, tabulate_judged
from taskcal.presentation.content import Table

MAX_COMPARED = 6
"""Stated lengths that are listed."""

STATISTIC = {"max": "the largest error", "p95": "the 95th percentile", "rms": "the rms error", "mean": "the mean error"}


def tabulate_points(examination: Examination, count: int | None) -> Table:
    """The worst points, or all of them in the order of the campaign.

    Args:
        examination: the points.
        count: how many of the worst; None for all.
    """
    everything = examination.points()
    numbers = range(len(everything)) if count is None else examination.worst_first[:count]
    poses, stated = examination.validation.rotations is not None, examination.studentised is not None
    axes = ("x_mm", "y_mm", "z_mm") if examination.validation.has_axes else ()
    rows = [
        (
            str(point["row"]),
            "–" if point["line"] is None else str(point["line"]),
            point["id"],
            point["target"],
            f"{point['signed_mm']:+.3f}" if "signed_mm" in point else f"{point['error_mm']:.3f}",
            *(f"{point[axis]:+.3f}" if axis in point else "–" for axis in axes),
            *([f"{point['error_mrad']:.3f}"] if poses else []),
            *([f"{point['studentised']:.1f}", "yes" if point["inside"] else "no"] if stated else []),
        )
        for point in (everything[k] for k in numbers)
    ]
    header = ("row", "line", "id", "target", "error mm", *(axis.replace("_", " ") for axis in axes))
    header += ("error mrad",) if poses else ()
    header += ("over its 1σ", "in its region") if stated else ()
    title = "All points" if count is None else f"The {len(rows)} worst of {len(everything)} points"
    note = "Rows of the campaign, counted from 0, and lines of its file, counted from 1"
    note += "; x, y and z along the robot's base." if axes else "."
    return Table.of_rows(title, header, rows, text_columns=(2, 3), note=note)


def tabulate_examined_outliers(examination: Examination, count: int | None = None) -> Table:
    """Points too far off for chance, and whether the reading or the model is at fault; all, or so many of the worst."""
    mostly = are_most(len(examination.outliers), len(examination.validation))
    return tabulate_judged(examination.outliers, examination.shared, "error mm", mostly=mostly, count=count)


def describe_regions(examination: Examination) -> str:
    """How many points lie where the calibration said they would."""
    if examination.inside is None and examination.campaign.observations:
        return "not judged: what stands was found from these rows, beside which the calibration states nothing"
    if examination.inside is None:
        return "not judged: tracker frame and targets were refitted, and the regions were stated with those of the calibration"
    inside, n = int(examination.inside.sum()), len(examination.inside)
    text = f"{inside} of {n} points ({100 * inside / n:.1f} %) lie in the 95 % region that is stated for them"
    if examination.rotation_inside is not None:
        text += f", {100 * examination.rotation_inside.mean():.1f} % of the rotations"
    return text


def describe_compared(examination: Examination) -> str:
    """Lengths that are stated, and what they were found to be."""
    compared = examination.validation.compared
    off = np.abs([one.found - one.stated for one in compared]) * 1e3
    listed = "; ".join(
        f"{one.name} {one.found * 1e3:.3f} for {one.stated * 1e3:.3f} mm" for one in compared[:MAX_COMPARED]
    )
    more = f"; and {len(compared) - MAX_COMPARED} more" if len(compared) > MAX_COMPARED else ""
    return f"off by {off.mean():.3f} mm in the mean, {off.max():.3f} mm at most: {listed}{more}"


def describe_rule(acceptance: Acceptance) -> str:
    """The decision rule."""
    return (
        f"accepted where {STATISTIC[acceptance.of]} and a guard band of {GUARD} standard uncertainties of the measurement stay "
        "within the limit (JCGM 106, guarded acceptance): at most 5 % risk of accepting what is beyond it"
    )


def describe_decision(acceptance: Acceptance) -> str:
    """Pass or fail, and by how much."""
    limit, value = f"{acceptance.limit * 1e3:.4g} mm", f"{acceptance.value * 1e3:.4f} mm"
    guard = f"{(acceptance.most - acceptance.value) * 1e3:.4f} mm"
    return {
        "pass": f"PASS: {STATISTIC[acceptance.of]}, {value}, and the guard band of {guard} are within {limit}",
        "fail": f"FAIL: {STATISTIC[acceptance.of]}, {value}, is beyond {limit}, by more than the measurement may err",
        "undecided": (
            f"FAIL: {STATISTIC[acceptance.of]}, {value}, is too near {limit} for this measurement to tell, whose guard band is "
            f"{guard}; measure with a smaller uncertainty"
        ),
    }[acceptance.decision]
