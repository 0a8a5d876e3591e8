"""A fit as people read it: its errors, what to do next, what it rests on, and which effects were worth their parameters."""

import math
import shlex
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from taskcal.analysis.identifiability import identifiability
from taskcal.errors import listed
from taskcal.identification.calibration import COURSE_IN_DOUBT, Calibration
from taskcal.identification.checks.digits import few_digits_of
from taskcal.identification.chunked_fit import ChunkedFit
from taskcal.identification.effects import Explanation
from taskcal.identification.validation import measured_errors
from taskcal.report.calibration import (
    are_most,
    geometry_of,
    held_out_section,
    outliers_section,
    residuals_section,
    state_end,
    state_placement,
    summary_section,
    tabulate_estimates,
)
from taskcal.report.camera import camera_facts
from taskcal.report.content import Column, Facts, NextStep, Section, TextTable, describe_effective, millimetres

MAX_HELD_OUT_RATIO = 1.6
"""Ratio of held-out error to fit residual, beyond which more poses are recommended: the fit has more freedom than its rows."""

MAX_NOISE_RATIO = 2.0
"""Ratio of the error to tracker noise, beyond which non-geometric effects are recommended."""

MAX_NAMED_ROWS = 5


def fit_sections(
    calibration: Calibration,
    result: Mapping[str, Any],
    steps: Sequence[str],
    explanation: Explanation | None,
    *,
    parameters: bool = False,
) -> list[Section]:
    """Make the sections of a fit: those of the calibration's page on errors and rows, what to do next, and what it rests on.

    Args:
        calibration: the fit.
        result: as `taskcal identify --json` has it.
        steps: what to do next.
        explanation: the choice of effects, if there was one.
        parameters: whether to list the parameters, too.
    """
    errors = measured_errors(calibration) if calibration.held_out is None else None
    held_out = held_out_section(calibration)
    return [
        summary_section(calibration, errors, None),
        Section("Next", *map(NextStep, steps)),
        Section(held_out.title, *(one for one in held_out.blocks if not isinstance(one, TextTable) or not one.folded)),
        residuals_section(calibration, errors),
        outliers_section(calibration),
        *([] if explanation is None else [explanation_section(explanation)]),
        *([_parameters(calibration)] if parameters else []),
        Section("Fit", Facts(*_facts(calibration, result))),
    ]


def _parameters(calibration: Calibration) -> Section:
    found = identifiability(geometry_of(calibration), calibration.q)
    return Section("Parameters", *tabulate_estimates(calibration, found))


def next_steps(
    calibration: Calibration,
    result: Mapping[str, Any],
    tracker_mm: float,
    again: str = "",
    *,
    program: str = "taskcal",
) -> list[str]:
    """List the next steps, the most urgent first.

    Args:
        calibration: the fit.
        result: as `taskcal identify --json` has it.
        tracker_mm: mean 3D error of tracker noise alone.
        again: options that name the images again, for a report that shows them.
        program: how the command line is called.
    """
    cal, held_out = shlex.quote(str(result["calibration"])), result["held_out"]
    steps: list[str] = []
    mostly = are_most(len(calibration.outliers), int(np.isfinite(calibration.studentised).sum()))
    judged = [
        (outlier.row, mostly or alike)
        for outlier, alike in zip(calibration.outliers, calibration.shared_outliers, strict=True)
    ]
    wrong = {row.row for row in calibration.left_out} | {row for row, of_model in judged if not of_model}
    if wrong:
        steps.append(f"measure {_rows(wrong)} again, or leave {'them' if len(wrong) > 1 else 'it'} out: see below")
    of_model = {row for row, of_model in judged if of_model} - wrong
    if of_model:
        steps.append(
            f"do not measure {_rows(of_model)} again: neighbouring rows deviate alike, so the cause is model error; see below"
        )
    left, fitted = (held_out or result["fitted"])["mean_mm"], result["fitted"]["mean_mm"]
    if held_out is not None and left > MAX_HELD_OUT_RATIO * fitted:
        steps.append(
            f"measure more poses: the held-out error is {left / fitted:.1f} times the fit residual; {program} plan selects them"
        )
    turning = {
        name
        for name, kind in zip(calibration.targets, calibration.layout.kinds, strict=True)
        if kind.width == kind.angles
    }
    if any(target["unlocated"] for name, target in result["targets"].items() if name not in turning):
        steps.append(
            "measure in several orientations: these poses do not locate every target, so other orientations are uncertain by "
            "centimetres; or state how near to the TCP it sits (--target-within-mm)"
        )
    if may_have_effects(calibration, result, tracker_mm):
        kind = "fitted" if held_out is None else "held-out"
        steps.append(
            f"fit non-geometric effects (--effects auto): {kind} error {left:.3f} mm, tracker noise {tracker_mm:.3f} mm"
        )
    correcting = f"; correct a program: {program} correct -c {cal} PROGRAM" if result["parameters"] else ""
    steps.append(f"full report: {program} report {cal}{again}{correcting}")
    return steps


def may_have_effects(calibration: Calibration, result: Mapping[str, Any], tracker_mm: float) -> bool:
    """Whether non-geometric effects, which were not looked for, may explain what is left; arguments as of `next_steps`."""
    searched = "explanation" in result or calibration.model.effects
    in_doubt = any(remark.startswith(COURSE_IN_DOUBT) for remark in calibration.remarks)
    of_rows = in_doubt or few_digits_of(calibration) is not None
    left = (result["held_out"] or result["fitted"])["mean_mm"]
    return not (searched or of_rows or calibration.model.robot.driven) and left > MAX_NOISE_RATIO * tracker_mm


def _rows(numbers: Collection[int]) -> str:
    return f"row{'s' if len(numbers) > 1 else ''} {listed(sorted(numbers), MAX_NAMED_ROWS)}"


def _facts(calibration: Calibration, result: Mapping[str, Any]) -> list[tuple[str, str]]:
    unseen = sum(p["seen"] is False for p in result["parameters"])
    identified = f"{len(result['parameters'])} identified"
    scale = "measured lengths {value:.4f} times the nominal robot's, SE {standard_error:.4f} by its tolerances"
    known = describe_effective(identified, result["effective_parameters"], result["parameter_groups"])
    return [
        *([("scale", scale.format(**result["length_scale"]))] if result["length_scale"] else []),
        ("tracker frame", _measuring_frame(result)),
        *camera_facts(result),
        *([("prior", f"{unseen} parameters prior-dominated (posterior 1σ ≥ 0.95 prior 1σ)")] if unseen else []),
        *([("parameters", f"{known}; --parameters lists them")] if result["parameters"] else []),
        ("convergence", state_end(calibration.reason, calibration.iterations, calibration.rounds)),
    ]


def _measuring_frame(result: Mapping[str, Any]) -> str:
    if result["tracker_frame"] is None:
        unknowns = sum(len(one["unknowns"]) for one in result["observations"])
        return f"none: measured in the robot's base, with {unknowns} unknowns of the fixed objects fitted (see --json)"
    file, circles = result["registration"]["file"], result["registration"]["method"] == "circles"
    text = f"base at {state_placement(result['tracker_frame'])}"
    if not (file or circles):
        return text
    return f"{text}; registered from {f'{file}, ' if file else ''}{'circles' if circles else 'poses'}"


# Effects: the comparison of models.

MAX_NAMED_EFFECTS = 3
MAX_NAMED_COLLINEAR = 4


def explanation_section(explanation: Explanation) -> Section:
    """Make the section of the comparison of the models, and of the contribution of each effect among all others."""
    added = _of_stages("added to the rows above", millimetres("error mm", "cross_validated", ".4f"), "used")
    worths = _of_stages("effect", millimetres("increase mm", "worth", ".4f"), "supported")
    named = [
        f"{near.name} is {_percent(near.share)} explained by {', '.join(near.by)}"
        for near in explanation.collinearities
    ]
    poorly = (
        f"at the fitted poses {listed(named, MAX_NAMED_COLLINEAR, '; ')}. Individual values are poorly determined; "
        "predictions at similar poses are unaffected"
    )
    untried = "; ".join(f"{name}: {reason}" for name, reason in explanation.untried.items())
    return Section(
        "Effects",
        TextTable.of(
            "Model comparison: mean 3D error, cross-validated, with the standard error (SE) of its change",
            added,
            explanation.steps,
        ),
        TextTable.of(
            "Effect contributions: increase of the error when the effect is removed", worths, explanation.worths
        ),
        Facts(
            ("summary", _sentence(explanation)),
            ("poorly determined", poorly) if named else None,
            ("not tried", untried) if untried else None,
        ),
    )


def _of_stages(label: str, size: Column, accepted: str) -> tuple[Column, ...]:
    return (
        Column(label, "name"),
        Column("parameters", "parameters", "d"),
        size,
        millimetres("SE mm", "standard_error", ".4f"),
        Column(accepted, lambda stage: "yes" if stage.accepted else "no"),
        Column("reason", "reason"),
    )


def _percent(share: float) -> str:
    """Rounded down, so that only an exact repeat is 100 %."""
    return f"{math.floor(min(share + 1e-9, 1.0) * 1e4) / 1e2:g} %"


def _sentence(explanation: Explanation) -> str:
    first, *others = explanation.steps
    steps = [f"geometry {first.cross_validated * 1e3:.4f} mm"]
    for stage in others:
        name = "all effects" if explanation.worths and stage is others[-1] else stage.name
        steps.append(f"with {name} {stage.cross_validated * 1e3:.4f} mm{'' if stage.accepted else ' (not used)'}")
    largest = [stage.name for stage in explanation.worths if stage.accepted][:MAX_NAMED_EFFECTS]
    if largest:
        steps.append(f"largest contributions {' and '.join(largest)}")
    return f"{', '.join(steps)}; tracker noise {explanation.tracker * 1e3:.4f} mm"


# A file of more rows than are fitted at once.


def parts_sections(result: Mapping[str, Any], fitted: ChunkedFit, *, parameters: bool) -> list[Section]:
    """Make the sections of a fit in parts."""
    all_rows, unseen = result["fitted"], result["held_out_from_sample"]
    left_out = listed(fitted.left_out, 10)
    said = Section(
        "Result",
        f"{result['robot']}: mean 3D position error {result['nominal_of_sample']['mean_mm']:.3f} mm nominal, "
        f"{all_rows['mean_mm']:.3f} mm calibrated ({all_rows['n']} fitted points); a fit of the sample alone: "
        f"{unseen['mean_mm']:.3f} mm ({unseen['n']} held-out points)",
        Facts(
            ("maximum", f"{all_rows['max_mm']:.3f} mm of the fitted rows"),
            ("left out", f"{len(fitted.left_out)} rows with gross errors{f': {left_out}' if left_out else ''}"),
            ("model error", f"{result['model_error_mm']:.3g} mm per axis (1σ), from the sample"),
        ),
    )
    return [*([_parameters(fitted.calibration)] if parameters else []), said]
