"""A fit as people read it: its errors, what to do next, what it rests on, and which effects were worth their parameters."""

import math
import re
import shlex
from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from taskcal.errors import listed
from taskcal.identification.calibration import COURSE_IN_DOUBT, Calibration
from taskcal.identification.checks.digits import few_digits_of
from taskcal.identification.chunked_fit import ChunkedFit
from taskcal.identification.effects import Explanation
from taskcal.report.calibration import (
    are_exact,
    are_most,
    describe_held_out,
    fit_facts,
    outliers_section,
    state_end,
    state_placement,
    state_result,
    tabulate_errors,
    tabulate_parameters,
    tabulate_stations,
)
from taskcal.report.camera import camera_facts
from taskcal.report.content import NOMINAL, Column, Facts, Section, Step, Table, describe_effective, millimetres
from taskcal.robot.error_model import ErrorModel

MAX_HELD_OUT_RATIO = 1.6
"""Ratio of held-out error to fit residual, beyond which more poses are recommended: the fit has more freedom than its rows."""

MAX_NOISE_RATIO = 2.0
"""Ratio of the error to tracker noise, beyond which non-geometric effects are recommended."""

MAX_NAMED_ROWS = 5
MAX_SHOWN_EFFECTS = 40
"""Parameters of effects that a terminal shows, whatever their significance."""

MIN_SIGNIFICANCE = 2.0
"""Standard errors from zero beyond which more of them are shown: 95 % of a normal distribution."""


def fit_sections(
    calibration: Calibration, result: Mapping[str, Any], steps: Sequence[str], *, parameters: bool = False
) -> list[Section]:
    """Make the sections of a fit: its errors and what to do next, the rows at fault, and what it rests on.

    Args:
        calibration: the fit.
        result: as `taskcal identify --json` has it.
        steps: what to do next.
        parameters: whether to list the parameters, too.
    """
    held_out = result["held_out"]
    summaries = {} if are_exact(calibration) else {NOMINAL: result["nominal"]}
    summaries["fitted"] = result["fitted"]
    summaries |= {} if held_out is None else {"held out": held_out}
    held = None if calibration.held_out is None else ("held out", describe_held_out(calibration.held_out))
    return [
        Section(
            "Result",
            state_result(calibration, result["nominal"], held_out or result["fitted"]),
            tabulate_errors(summaries),
            tabulate_stations(calibration),
            *map(Step, steps),
        ),
        outliers_section(calibration),
        Section(
            "Fit",
            *(_parameters(calibration, result) if parameters else ()),
            Facts(held, *fit_facts(calibration), *_facts(result, parameters=parameters)),
        ),
    ]


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
        steps.append(f"measure {_rows(wrong)} again, or leave them out: see below")
    of_model = {row for row, of_model in judged if of_model} - wrong
    if of_model:
        steps.append(
            f"do not measure {_rows(of_model)} again: neighbouring rows deviate alike, so the cause is model error; see below"
        )
    left, fitted = (held_out or result["fitted"])["mean_mm"], result["fitted"]["mean_mm"]
    if held_out is None:
        steps.append("estimate the held-out error: --holdout 0.3, or --folds 5 to use every row")
    elif left > MAX_HELD_OUT_RATIO * fitted:
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
    return f"rows {listed(sorted(numbers), MAX_NAMED_ROWS)}"


def _parameters(calibration: Calibration, result: Mapping[str, Any]) -> list[Table | str | None]:
    unclear = _unclear_effects(calibration)
    table = tabulate_parameters(
        calibration, leave_out=lambda name: _HARMONIC.match(name) is not None or name in unclear
    )
    more = (
        f"{len(unclear)} more parameters of effects, within {MIN_SIGNIFICANCE:g} standard errors of zero or of the smooth "
        "field: see --json"
    )
    return [table, more if unclear else None, tabulate_harmonics(result["parameters"])]


def _unclear_effects(calibration: Calibration) -> set[str]:
    """Parameters of effects that have a meaning alone and may be zero; harmonics are shown by their amplitudes."""
    geometry = set(ErrorModel(calibration.model.robot).names)
    names = {calibration.model.names[i]: i for i in calibration.estimated}
    effects = {name: i for name, i in names.items() if name not in geometry}
    if len(effects) <= MAX_SHOWN_EFFECTS:
        return set()
    return {
        name
        for name, i in effects.items()
        if not _HARMONIC.match(name)
        and (abs(calibration.estimate[i]) < MIN_SIGNIFICANCE * calibration.standard_errors[i] or ".field_" in name)
    }


def _facts(result: Mapping[str, Any], *, parameters: bool) -> list[tuple[str, str]]:
    pairs = [f"{c['a']} and {c['b']} {c['correlation']:+.3f}" for c in result["correlations"]]
    unseen = sum(p["seen"] is False for p in result["parameters"])
    facts = [("prior", f"{unseen} parameters prior-dominated (posterior 1σ ≥ 0.95 prior 1σ)")] if unseen else []
    facts += [
        *([("largest correlations", "; ".join(pairs))] if parameters else []),
        *([("scale", _length_scale(result["length_scale"]))] if result["length_scale"] else []),
        ("tracker frame", _measuring_frame(result)),
        *camera_facts(result),
    ]
    if parameters:
        facts.append(("convergence", state_end(result["reason"], result["iterations"], result["rounds"])))
    elif result["parameters"]:
        identified = f"{len(result['parameters'])} identified"
        said = describe_effective(identified, result["effective_parameters"], result["parameter_groups"])
        facts.append(("parameters", f"{said}; --parameters lists them"))
    return facts


def _length_scale(found: Mapping[str, float]) -> str:
    return f"measured lengths {found['value']:.4f} times the nominal robot's, SE {found['standard_error']:.4f} by its tolerances"


def _measuring_frame(result: Mapping[str, Any]) -> str:
    if result["tracker_frame"] is None:
        unknowns = sum(len(one["unknowns"]) for one in result["observations"])
        return f"none: measured in the robot's base, with {unknowns} unknowns of the fixed objects fitted (see --json)"
    file, circles = result["registration"]["file"], result["registration"]["method"] == "circles"
    text = f"base at {state_placement(result['tracker_frame'])}"
    if not (file or circles):
        return text
    return f"{text}; registered from {f'{file}, ' if file else ''}{'circles' if circles else 'poses'}"


# Effects: the comparison of models, and harmonics by their amplitudes.

MAX_HARMONICS = 12
"""Harmonics that are shown, the strongest."""

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
        Table.of(
            "Model comparison: mean 3D error, cross-validated, with the standard error (SE) of its change",
            added,
            explanation.steps,
        ),
        Table.of("Effect contributions: increase of the error when the effect is removed", worths, explanation.worths),
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


_HARMONIC = re.compile(r"(.+)\.(?:cos|sin)(\d+(?:\.\d+)?)$")
"""Name of a cosine or sine of a joint's angle."""


def strongest_harmonics(parameters: Sequence[Mapping[str, Any]]) -> list[tuple[str, float, float, float]]:
    """Joint, order, amplitude and its standard error, mrad, of the harmonics, largest first."""
    parts: dict[tuple[str, float], list[Mapping[str, Any]]] = defaultdict(list)
    for parameter in parameters:
        match = _HARMONIC.match(parameter["name"])
        if match is not None:
            parts[match[1], float(match[2])].append(parameter)
    harmonics: list[tuple[str, float, float, float]] = []
    for (joint, order), (a, b) in ((key, pair) for key, pair in parts.items() if len(pair) == 2):
        x, y = a["estimate_mrad"], b["estimate_mrad"]
        size = (x**2 + y**2) ** 0.5
        errors = a["standard_error_mrad"], b["standard_error_mrad"]
        spread = ((x * errors[0]) ** 2 + (y * errors[1]) ** 2) ** 0.5 / size if size else max(errors)
        harmonics.append((joint, order, size, spread))
    return sorted(harmonics, key=lambda row: -row[2])


def tabulate_harmonics(parameters: Sequence[Mapping[str, Any]]) -> Table:
    """Tabulate the strongest harmonics."""
    harmonics = strongest_harmonics(parameters)
    more = f", the {MAX_HARMONICS} strongest of {len(harmonics)}" if len(harmonics) > MAX_HARMONICS else ""
    columns = (
        Column("joint", lambda row: row[0]),
        Column("periods per turn", lambda row: row[1], "g"),
        Column("amplitude mrad", lambda row: row[2], ".4f"),
        Column("1σ mrad", lambda row: row[3], ".4f"),
    )
    return Table.of(f"Harmonics of the joint angles{more}", columns, harmonics[:MAX_HARMONICS])


# A file of more rows than are fitted at once.


def parts_section(result: Mapping[str, Any], fitted: ChunkedFit, *, parameters: bool) -> Section:
    """Make the section of a fit in parts."""
    all_rows, unseen = result["fitted"], result["held_out_from_sample"]
    left_out = listed(fitted.left_out, 10)
    return Section(
        "Result",
        tabulate_parameters(fitted.calibration) if parameters else None,
        f"{result['robot']}: mean 3D position error {result['nominal_of_sample']['mean_mm']:.3f} mm nominal, "
        f"{all_rows['mean_mm']:.3f} mm calibrated ({all_rows['n']} fitted points); a fit of the sample alone: "
        f"{unseen['mean_mm']:.3f} mm ({unseen['n']} held-out points)",
        Facts(
            ("maximum", f"{all_rows['max_mm']:.3f} mm of the fitted rows"),
            ("left out", f"{len(fitted.left_out)} rows with gross errors{f': {left_out}' if left_out else ''}"),
            ("model error", f"{result['model_error_mm']:.3g} mm per axis (1σ), from the sample"),
        ),
    )
