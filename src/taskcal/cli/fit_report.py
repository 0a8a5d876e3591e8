"""What ``identify`` shows of a fit: a sentence, next steps, and tables."""

from collections.abc import Callable, Collection, Mapping
from typing import Any

import numpy as np

from taskcal.campaigns.campaign import Campaign
from taskcal.cli.options.effects import is_harmonic, show_harmonics
from taskcal.cli.output import placement, say, show, show_facts, started_as, tell
from taskcal.identification.calibration import Calibration, list_unknowns
from taskcal.identification.validation import validate
from taskcal.registration.registration import Registration
from taskcal.report.calibration import (
    NOMINAL,
    are_most,
    describe_held_out,
    describe_unobservable,
    tabulate_errors,
    tabulate_left_out,
    tabulate_outliers,
    tabulate_parameters,
)
from taskcal.report.calibration import verdict as sentence
from taskcal.report.content import model_error_origin, prior_scale_origin
from taskcal.robot.error_model import ErrorModel

MUCH_WORSE = 1.6
"""Times the fitted error, beyond which held-out rows say that there are too few."""


MUCH_UNEXPLAINED = 2.0
"""Times the tracker's noise, beyond which it is worth asking what else the joints do."""


MAX_NAMED_IN_VERDICT = 5
"""Rows that are named."""


def verdict(calibration: Calibration, result: Mapping[str, Any]) -> str:
    """The fit in a sentence.

    Args:
        calibration: the fit.
        result: what `calibration_report.report` says.
    """
    held_out = result["held_out"]
    after = (held_out or result["fitted"])["mean_mm"]
    in_space = all(kind.width >= 3 for kind in calibration.layout.observed)
    before, number = result["nominal"]["mean_mm"], held_out and held_out["n"]
    return sentence(result["robot"], before, after, number, in_space=in_space)


def next_steps(calibration: Calibration, result: Mapping[str, Any], tracker_mm: float) -> list[str]:
    """What to do next, the most urgent first.

    Args:
        calibration: the fit.
        result: what `calibration_report.report` says.
        tracker_mm: mean error in space that the tracker's noise alone would leave.
    """
    taskcal, cal, held_out = started_as(), result["calibration"], result["held_out"]
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
            f"do not measure {_rows(of_model)} again: model error, since their neighbours err alike; see below"
        )
    if held_out is None:
        steps.append("see what it predicts: --holdout 0.3 gives rows away for that, --folds 5 gives none away")
    elif held_out["mean_mm"] > MUCH_WORSE * result["fitted"]["mean_mm"]:
        steps.append(
            f"measure more poses: rows that were not fitted are {held_out['mean_mm'] / result['fitted']['mean_mm']:.1f} times as "
            f"far off as those that were; {taskcal} plan says which"
        )
    if any(target["unlocated"] for target in result["targets"].values()):
        steps.append("measure in several orientations: these poses do not locate every target")
    left = (held_out or result["fitted"])["mean_mm"]
    searched = "explanation" in result or calibration.model.effects
    if not (searched or calibration.model.robot.driven) and left > MUCH_UNEXPLAINED * tracker_mm:
        steps.append(
            f"ask what else the joints do: --effects auto; {left:.3f} mm are left, the tracker alone would leave {tracker_mm:.3f}"
        )
    steps.append(f"look at the whole: {taskcal} report {cal}; use it: {taskcal} correct -c {cal} PROGRAM")
    return steps


def _rows(numbers: Collection[int]) -> str:
    rows = sorted(numbers)
    more = f" and {len(rows) - MAX_NAMED_IN_VERDICT} more" if len(rows) > MAX_NAMED_IN_VERDICT else ""
    return f"rows {', '.join(map(str, rows[:MAX_NAMED_IN_VERDICT]))}{more}"


MAX_SHOWN = 40
"""Parameters of effects that a terminal shows, whatever they are."""


CLEAR = 2.0
"""Standard errors from zero beyond which more of them are shown."""


def report(calibration: Calibration, measured: Campaign, nominal: Callable[[Campaign], Calibration]) -> dict[str, Any]:
    """Everything that a reader of the fit asks for, in millimetres and milliradians.

    Args:
        calibration: the fit.
        measured: the rows that were fitted, those that cannot be right among them.
        nominal: the fit of tracker frame and targets of the nominal robot.
    """
    wrong = {row.id for row in calibration.left_out}
    right = measured.take([i for i, name in enumerate(measured.ids) if name not in wrong])
    held_out = calibration.held_out
    before = validate(nominal(right), right) if held_out is None else held_out.nominal_validation
    return {
        **calibration.summary(),
        "rows": len(measured),
        "nominal": before.summary(),
        "fitted": validate(calibration, right).summary(),
        "held_out": None if held_out is None else held_out.validation.summary(),
        "holdout": None if held_out is None else held_out.summary(),
        "model_error_origin": model_error_origin(calibration),
        "prior_scale_origin": prior_scale_origin(calibration) or None,
        "tracker_frame": placement(calibration.T_tracker_base) if _in_tracker(calibration) else None,
        "observations": list_unknowns(calibration),
        "registration": _registered(calibration.layout.registration),
        "targets": {
            name: {**placement(T), "located": not unlocated, "unlocated": unlocated or None}
            for name, T, unlocated in zip(
                calibration.targets,
                calibration.T_tool_target,
                describe_unobservable(calibration.layout.registration),
                strict=True,
            )
        },
    }


def _in_tracker(calibration: Calibration) -> bool:
    """Whether a tracker measured anything; else the measuring frame is the robot's base."""
    return calibration.layout.base_size > 0


def _registered(registration: Registration) -> dict[str, str | None]:
    return {"method": registration.method, "file": registration.file or None}


def show_report(
    calibration: Calibration, result: Mapping[str, Any], *, tracker_mm: float, parameters: bool = False
) -> None:
    """Print a calibration and what `report` says of it: the verdict, the errors, what to do next, and the rest.

    Args:
        calibration: the fit.
        result: what `report` says of it.
        tracker_mm: mean error in space that the tracker's noise alone would leave.
        parameters: whether to print the parameters, too.
    """
    summaries = {NOMINAL: result["nominal"], "fitted": result["fitted"]}
    if result["held_out"] is not None:
        summaries["held out"] = result["held_out"]
    say(verdict(calibration, result))
    tell()
    title = "Position error: largest along the axes of the robot's base, then in space"
    title = title if "max_x_mm" in result["fitted"] else "Error: measured less predicted"
    show(tabulate_errors(title, summaries))
    steps = next_steps(calibration, result, tracker_mm)
    show_facts([("next" if number == 0 else "", step) for number, step in enumerate(steps)])
    tell()
    for table in (tabulate_left_out(calibration), tabulate_outliers(calibration)):
        if len(table):
            show(table)
    if parameters:
        _show_parameters(calibration, result)
    held_out = [] if calibration.held_out is None else [("held out", describe_held_out(calibration.held_out))]
    show_facts([*held_out, *_facts(result, parameters=parameters)])


def _show_parameters(calibration: Calibration, result: Mapping[str, Any]) -> None:
    unclear = _unclear_effects(calibration)
    table = tabulate_parameters(calibration, leave_out=lambda name: is_harmonic(name) or name in unclear)
    if len(table):
        show(table)
    if unclear:
        say(
            f"{len(unclear)} more parameters of effects, within {CLEAR:g} standard errors of zero or of the smooth field, are in "
            "--json"
        )
    show_harmonics(result["parameters"])


def _unclear_effects(calibration: Calibration) -> set[str]:
    """Parameters of effects that stand for themselves and may be zero; those of harmonics are told by their amplitudes."""
    geometry = set(ErrorModel(calibration.model.robot).names)
    effects = [i for i in calibration.estimated if calibration.model.names[i] not in geometry]
    if len(effects) <= MAX_SHOWN:
        return set()
    names = {calibration.model.names[i]: i for i in effects if not is_harmonic(calibration.model.names[i])}
    return {
        name
        for name, i in names.items()
        if abs(calibration.estimate[i]) < CLEAR * calibration.standard_errors[i] or ".field_" in name
    }


def _facts(result: Mapping[str, Any], *, parameters: bool) -> list[tuple[str, str]]:
    scale = result["prior_scale"]
    pairs = [f"{c['a']} and {c['b']} {c['correlation']:+.3f}" for c in result["correlations"]]
    rotation = f" and {result['model_error_mrad']:.3g} mrad" if "model_error_mrad" in result else ""
    held = f", {result['prior_scale_origin']}" if result["prior_scale_origin"] else ""
    facts = [
        ("model error", f"{result['model_error_mm']:.3g} mm{rotation} per axis (1σ), {result['model_error_origin']}"),
        ("prior scale", "no prior" if scale is None else f"{scale:.3g} times the tolerances{held}"),
        *([("largest correlations", "; ".join(pairs))] if parameters else []),
        ("tracker frame", _measuring_frame(result)),
    ]
    for name, target in result["targets"].items():
        unsure = f"; {target['unlocated']}" if target["unlocated"] else ""
        facts.append((f"target {name}", f"at {_point(target)} of the tool frame{unsure}"))
    ended = f"{result['reason']}; {result['iterations']} iterations in the last of {result['rounds']} rounds"
    unseen = sum(p["seen"] is False for p in result["parameters"])
    if unseen:
        facts.insert(
            0, ("not seen", f"{unseen} parameters: the data say next to nothing of them, their 1σ is that of the prior")
        )
    if parameters:
        facts.append(("ended", ended))
    else:
        facts.append(("parameters", f"{len(result['parameters'])} were identified: --parameters lists them"))
    facts.append(("calibration", f"wrote {result['calibration']}"))
    return facts


def _measuring_frame(result: Mapping[str, Any]) -> str:
    if result["tracker_frame"] is None:
        stands = sum(len(one["unknowns"]) for one in result["observations"])
        return f"none: measured in the robot's base, with {stands} numbers of what stands fitted (see --json)"
    return f"base at {_point(result['tracker_frame'])}{_found_from(result['registration'])}"


def _found_from(registration: Mapping[str, str | None]) -> str:
    """Where the fit's start of tracker frame and targets comes from, unless it is all poses as ever."""
    file = f"{registration['file']}, " if registration["file"] else ""
    from_circles = registration["method"] == "circles"
    return f"; registered from {file}{'circles' if from_circles else 'poses'}" if file or from_circles else ""


def _point(placed: Mapping[str, Any]) -> str:
    position = " ".join(f"{value:.3f}" for value in placed["position_mm"])
    quaternion = " ".join(f"{value:.6f}" for value in placed["quaternion"])
    return f"{position} mm, quaternion {quaternion}"
