"""What a user wants to know of a fit first: what it was worth, and what to do next."""

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from taskcal.cli.output import started_as
from taskcal.identification.calibration import Calibration
from taskcal.presentation.calibration_tables import are_most
from taskcal.presentation.verdict import verdict as sentence

MUCH_WORSE = 1.6
"""Times the fitted error, beyond which held-out rows say that there are too few."""

MUCH_UNEXPLAINED = 2.0
"""Times the tracker's noise, beyond which it is worth asking what else the joints do."""

MOST_NAMED = 5
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
        if outlier.row is not None
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
    searched = "explanation" in result or calibration.model.effects or calibration.field is not None
    if not (searched or calibration.model.robot.driven) and left > MUCH_UNEXPLAINED * tracker_mm:
        steps.append(
            f"ask what else the joints do: --effects auto; {left:.3f} mm are left, the tracker alone would leave {tracker_mm:.3f}"
        )
    steps.append(f"look at the whole: {taskcal} report {cal}; use it: {taskcal} correct -c {cal} PROGRAM")
    return steps


def _rows(numbers: Collection[int]) -> str:
    rows = sorted(numbers)
    more = f" and {len(rows) - MOST_NAMED} more" if len(rows) > MOST_NAMED else ""
    return f"rows {', '.join(map(str, rows[:MOST_NAMED]))}{more}"
