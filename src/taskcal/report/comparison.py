"""Sentences, tables and sections of a comparison of calibrations, of a foreign model and of a validation."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from taskcal.errors import listed
from taskcal.identification.comparison import Comparison
from taskcal.identification.measured_range import describe_outside
from taskcal.identification.validation import GUARD, RULE_OF, Acceptance, Examination
from taskcal.report.calibration import (
    COUNTED,
    are_most,
    describe_coverage,
    describe_outliers,
    tabulate_errors,
    tabulate_judged,
)
from taskcal.report.content import Bullets, Column, Facts, Section, TextTable

MIN_CHANGE_SIGMAS = 2.0
"""Standard errors from which on a parameter is listed as changed: 5 % of unchanged ones are beyond."""

MAX_LISTED = 10
"""Changed parameters that are listed."""

MIN_STATED_P = 1e-3
"""Smallest probability that is printed: it comes from the tail of a normal distribution, which no robot's errors follow so far out,
and in the machine's numbers it ends at zero."""


def describe_chance(comparison: Comparison) -> str:
    """State the probability of such a difference without a change; a bound where it is near 0 or 1."""
    least = comparison.chance < MIN_STATED_P
    rounded = f"{comparison.chance:.2g}"
    return f"p (no change) {f'< {MIN_STATED_P:g}' if least else f'= {rounded}' if rounded != '1' else '> 0.99'}"


def describe_comparison(comparison: Comparison) -> str:
    """State the verdict with its figures."""
    size, expected = f"3D rms difference {comparison.rms * 1e3:.3f} mm", f"{comparison.expected * 1e3:.3f} mm"
    if comparison.verdict == "unchanged":
        return f"no significant change: {size}, expected from the uncertainties {expected}"
    if comparison.verdict == "small":
        return (
            f"small change: {size}, significant (expected {expected}), but smaller than the model error at a single pose "
            f"({comparison.unexplained * 1e3:.3f} mm); other poses or another temperature may cause it"
        )
    return f"the robot has changed: {size}, expected from the uncertainties {expected}"


def describe_due(comparison: Comparison, accuracy: float) -> str:
    """State whether the robot is due for recalibration at an accuracy, metres."""
    limit, change = f"{accuracy * 1e3:.4g} mm", f"change {comparison.excess * 1e3:.3f} mm rms"
    if comparison.is_due(accuracy):
        return f"yes: {change} exceeds {limit}; use the new calibration"
    if comparison.verdict == "unchanged":
        return f"no: no significant change against {limit}"
    return f"no: {change} is within {limit}"


def describe_resemblance(comparison: Comparison) -> str:
    """State which single parameters are consistent with the change."""
    return "; ".join(
        f"{r.name} by {r.amount * r.unit.factor:+.3f} {r.unit.name} would explain {100 * r.share:.0f} % of it"
        for r in comparison.resembles
    )


def tabulate_changes(comparison: Comparison, count: int | None = MAX_LISTED) -> TextTable:
    """Tabulate parameters by their change over the standard error of the difference.

    Args:
        comparison: of two calibrations.
        count: of those with a significant change; None for all parameters.
    """
    columns = (
        Column("parameter", "name"),
        Column("first", lambda p: p.first * p.unit.factor, "+.4f"),
        Column("second", lambda p: p.second * p.unit.factor, "+.4f"),
        Column("change", lambda p: (p.second - p.first) * p.unit.factor, "+.4f"),
        Column("unit", lambda p: p.unit.name),
        Column("change / 1σ", "over_sigma", "+.1f"),
    )
    clear = [p for p in comparison.parameters if abs(p.over_sigma) >= MIN_CHANGE_SIGMAS][:count]
    return TextTable.of(
        "All parameters"
        if count is None
        else f"Parameters that differ by more than {MIN_CHANGE_SIGMAS:g} standard errors",
        columns,
        comparison.parameters if count is None else clear,
        note="Linearly dependent parameters may share a change differently; the movement of the tool is the measure.",
    )


def comparison_section(title: str, comparison: Comparison, accuracy: float | None, *, all_parameters: bool) -> Section:
    """Make the section of what changed between two calibrations.

    Args:
        title: which ones.
        comparison: of them.
        accuracy: at which recalibration may be due, metres; None for none.
        all_parameters: whether all are listed, not only those that changed significantly.
    """
    changed = comparison.verdict != "unchanged"
    return Section(
        title,
        title,
        Bullets(*comparison.remarks) if comparison.remarks else None,
        Facts(
            ("change", describe_comparison(comparison)),
            ("maximum", f"{comparison.maximum * 1e3:.3f} mm at one of {len(comparison.q)} poses"),
            ("significance", describe_chance(comparison)),
            ("consistent with", describe_resemblance(comparison)) if changed and comparison.resembles else None,
            None if accuracy is None else ("recalibration", describe_due(comparison, accuracy)),
        ),
        tabulate_changes(comparison, None) if all_parameters else tabulate_changes(comparison),
    )


# A model that someone uses, beside a calibration.

DISTANCES = (
    Column("", "label"),
    *(
        Column(f"{words} {unit}", f"{name}_{key}", digits)
        for unit, key, digits in (("mm", "mm", ".3f"), ("°", "deg", ".4f"))
        for words, name in (("mean", "mean"), ("95 %", "p95"), ("max", "max"))
    ),
)

MODELS = {"as it stands": "as_it_stands", "base and tool fitted": "frames_fitted", "nominal robot, fitted": "nominal"}


def model_section(title: str, compared: Mapping[str, Any]) -> Section:
    """Make the section of how far a model is from a calibration.

    Args:
        title: which ones.
        compared: `ModelComparison.summary`.
    """
    worst = compared["worst"]
    joints = ", ".join(
        f"{name.rpartition('_')[0]} {value:.1f}{'°' if name.endswith('_deg') else ' mm'}"
        for name, value in worst["joints"].items()
    )
    place = " ".join(f"{value:.1f}" for value in worst["position_mm"])
    rows = [{"label": label, **compared[key]} for label, key in MODELS.items()]
    return Section(
        title,
        title,
        TextTable.of(f"distance of the TCP, and of its axes, over {compared['poses']} poses", DISTANCES, rows),
        Facts(
            ("farthest, fitted", f"at {place} mm: {joints}"),
            ("uncertainty", f"of the calibration {compared['uncertainty_mm']:.3f} mm (3D rms, 1σ)"),
        ),
    )


# An examination.

MAX_COMPARED = 6
"""Stated lengths that are listed."""

STATISTIC = {"rms": "rms error", "max": "maximum error", "p95": "95th percentile", "mean": "mean error"}


def tabulate_points(examination: Examination, count: int | None) -> TextTable:
    """Tabulate the worst points, or all of them in the order of the campaign.

    Args:
        examination: the points.
        count: how many of the worst; None for all.
    """
    everything = examination.points()
    rows = everything if count is None else [everything[k] for k in examination.worst_first[:count]]
    poses, stated = examination.validation.rotations is not None, examination.studentised is not None
    columns = [
        Column("row", "row", "d"),
        Column("line", "line", "d"),
        Column("id", "id"),
        Column("target", "target"),
        Column("error mm", _error_mm, "s"),
    ]
    if examination.validation.has_axes:
        columns += [Column(f"{axis} mm", f"{axis}_mm", "+.3f") for axis in "xyz"]
    if poses:
        columns.append(Column("error mrad", "error_mrad", ".3f"))
    if stated:
        columns.append(Column("error / 1σ", "studentised", ".1f"))
        columns.append(
            Column("in 95 % region", lambda p: {True: "yes", False: "no"}.get(p["inside"], "not judged"), "s")
        )
    columns.append(Column("outside range", describe_outside, optional=True))
    axes = "; x, y and z along the robot's base." if examination.validation.has_axes else "."
    title = "All points" if count is None else f"The {len(rows)} worst of {len(everything)} points"
    return TextTable.of(title, columns, rows, note=f"{COUNTED[:-1]}{axes}")


def _error_mm(point: Mapping[str, Any]) -> str | None:
    """Of a kind that measures one number with its sign; None of one that measures angles alone."""
    if "signed_mm" in point:
        return f"{point['signed_mm']:+.3f}"
    return f"{point['error_mm']:.3f}" if "error_mm" in point else None


def tabulate_examined_outliers(examination: Examination, count: int | None = None) -> TextTable:
    """Tabulate outliers, and whether the reading or the model is at fault; all, or so many of the worst."""
    mostly = are_most(len(examination.outliers), len(examination.validation))
    return tabulate_judged(examination.outliers, examination.shared, "error mm", mostly=mostly, count=count)


def describe_regions(examination: Examination) -> str:
    """State the coverage of the 95 % regions."""
    if examination.inside is None:
        return "not judged: tracker frame and targets were refitted; the regions are those of the calibration's own"
    text = describe_coverage(np.where(examination.judged, examination.inside, np.nan))
    if any(kind.unknowns for kind in examination.campaign.observations):
        text += ", which allow for fixed objects located from these rows"
    if 0 < (left := int((~examination.judged).sum())) < len(examination.judged):
        text += f"; {left} not judged: too few rows of their fixed object"
    if examination.rotation_inside is not None:
        text += f", {100 * examination.rotation_inside.mean():.1f} % of the rotations"
    for name, (part, share) in examination.by_range().items():
        if share is not None:
            text += f"; {name.replace('_', ' the measured ')} {100 * share:.1f} % of {len(part)}"
    return text


def describe_compared(examination: Examination) -> str:
    """Compare stated lengths with the calibrated ones."""
    compared = examination.validation.compared
    off = np.abs([one.found - one.stated for one in compared]) * 1e3
    every = (f"{one.name} {one.found * 1e3:.3f} for {one.stated * 1e3:.3f} mm" for one in compared)
    return f"mean error {off.mean():.3f} mm, maximum {off.max():.3f} mm: {listed(every, MAX_COMPARED, '; ')}"


def describe_rule(acceptance: Acceptance) -> str:
    """State the decision rule."""
    own = (
        "that of the verdict on a task"
        if acceptance.of == RULE_OF
        else f"asked for; the verdict's is the {STATISTIC[RULE_OF]}"
    )
    return (
        f"accepted if the {STATISTIC[acceptance.of]} plus a guard band of {GUARD} standard uncertainties of the measurement is "
        f"within the limit (JCGM 106, guarded acceptance): consumer's risk at most 5 % at the limit. The statistic is {own}"
    )


def describe_decision(acceptance: Acceptance) -> str:
    """State pass or fail, and by how much."""
    limit, value = f"{acceptance.limit * 1e3:.4g} mm", f"{acceptance.value * 1e3:.4f} mm"
    guard = f"{(acceptance.most - acceptance.value) * 1e3:.4f} mm"
    error = f"{STATISTIC[acceptance.of]} {value}"
    return {
        "pass": f"PASS: {error} plus guard band {guard} is within {limit}",
        "fail": f"FAIL: {error} exceeds the limit {limit} by more than the guard band",
        "undecided": f"FAIL: {error} is within the guard band {guard} of the limit {limit}; measure with a smaller uncertainty",
    }[acceptance.decision]


def examination_section(
    examination: Examination, where: str, acceptance: Acceptance | None, count: int | None
) -> Section:
    """Make the section of an examination.

    Args:
        examination: of a campaign.
        where: robot, campaign and frames, in words.
        acceptance: the decision, if one was asked for.
        count: how many of the worst points and outliers; None for all.
    """
    validation = examination.validation
    parts = {label.replace("_", " measured "): part.summary() for label, (part, _) in examination.by_range().items()}
    statistic = "Position error" if validation.has_axes else "Error"
    mostly = are_most(len(examination.outliers), len(validation))
    return Section(
        "Validation",
        tabulate_errors({"predicted": validation.summary(), **parts}, f"{statistic} of {where}"),
        tabulate_points(examination, count),
        tabulate_examined_outliers(examination, count),
        Facts(
            ("stated distances", describe_compared(examination)) if validation.compared else None,
            ("regions", describe_regions(examination)),
            ("outliers", describe_outliers(examination.shared, mostly=mostly)),
            None if acceptance is None else ("decision", describe_decision(acceptance)),
            None if acceptance is None else ("decision rule", describe_rule(acceptance)),
        ),
    )
