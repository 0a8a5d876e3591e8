"""What a comparison of calibrations says, for the terminal."""

import numpy as np

from taskcal.identification.comparison import Comparison
from taskcal.identification.validation import GUARD, Acceptance, Examination
from taskcal.report.calibration import are_most, tabulate_judged
from taskcal.report.content import Table

CLEAR = 2.0
"""Standard errors from which on a parameter is listed as changed."""

MOST = 10
"""Parameters that are listed."""


LEAST_STATED = 1e-3
"""Smallest probability that is printed: it comes from the tail of a normal distribution, which no robot's errors keep farther out,
and in the machine's numbers it ends at zero."""


def describe_chance(comparison: Comparison) -> str:
    """With what probability a robot that has not changed differs as much; a bound where it is small."""
    least = comparison.chance < LEAST_STATED
    rounded = f"{comparison.chance:.2g}"
    stated = f"below {LEAST_STATED:g}" if least else f"of {rounded}" if rounded != "1" else "above 0.99"
    return f"a robot that has not changed differs as much with a probability {stated}"


def describe_comparison(comparison: Comparison) -> str:
    """The verdict in a sentence."""
    size = f"{comparison.rms * 1e3:.3f} mm rms in space"
    expected = f"{comparison.expected * 1e3:.3f} mm"
    if comparison.verdict == "unchanged":
        return f"nothing shows: they differ by {size}, their uncertainties alone would give {expected}"
    if comparison.verdict == "small":
        return (
            f"a little: they differ by {size}, more than their uncertainties explain ({expected}), but by less than the models "
            f"leave unexplained ({comparison.unexplained * 1e3:.3f} mm); other poses or another temperature may do that"
        )
    return f"the robot has changed: {size}, where their uncertainties alone would give {expected}"


def describe_due(comparison: Comparison, accuracy: float) -> str:
    """Whether the robot is due again for an accuracy, metres."""
    limit = f"{accuracy * 1e3:.4g} mm"
    if comparison.is_due(accuracy):
        return f"yes: what changed, {comparison.excess * 1e3:.3f} mm rms, is beyond {limit}; use the new calibration"
    if comparison.verdict == "unchanged":
        return f"no: nothing has changed, and {limit} is not in question"
    return f"no: what changed, {comparison.excess * 1e3:.3f} mm rms, is within {limit}"


def describe_resemblance(comparison: Comparison) -> str:
    """Which single parameters would look the most like it."""
    return "; ".join(
        f"{r.name} by {r.amount * r.unit.factor:+.3f} {r.unit.name} would explain {100 * r.share:.0f} % of it"
        for r in comparison.resembles
    )


def tabulate_changes(comparison: Comparison, count: int | None = MOST) -> Table:
    """Parameters by how much they changed over the standard error of the difference.

    Args:
        comparison: of two calibrations.
        count: how many of those that clearly changed; None for all there are.
    """
    clear = [p for p in comparison.parameters if abs(p.over_sigma) >= CLEAR][:count]
    rows = [
        (
            p.name,
            f"{p.first * p.unit.factor:+.4f}",
            f"{p.second * p.unit.factor:+.4f}",
            f"{(p.second - p.first) * p.unit.factor:+.4f}",
            p.unit.name,
            f"{p.over_sigma:+.1f}",
        )
        for p in (comparison.parameters if count is None else clear)
    ]
    return Table.of_rows(
        f"Parameters that differ by more than {CLEAR:g} standard errors" if count is not None else "All parameters",
        ("parameter", "first", "second", "change", "unit", "over its 1σ"),
        rows,
        text_columns=(0, 4),
        note="Parameters that repeat each other may share a change out otherwise; the tool's movement is the measure.",
    )


# What an examination says, for the terminal.

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
