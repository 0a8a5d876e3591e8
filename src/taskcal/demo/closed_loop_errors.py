"""How far the true cutter of a closed loop is from its path, in a few numbers, and how far it was said to be."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.special import chdtri

from taskcal.correction.assessment import Deviations
from taskcal.demo.closed_loop import LoopRun

LINES: tuple[str, str, str] = "as programmed", "touched off", "corrected"
"""What is told of every robot."""

RADIUS_95 = float(np.sqrt(chdtri(3, 1.0 - 0.95) / 3.0))
"""Within which 95 % of errors lie that are alike in all directions, as a multiple of their root mean square in space."""


def errors_by_line(run: LoopRun) -> dict[str, Deviations]:
    """Errors of the true cutter on the true parts, by what was done against them."""
    return dict(zip(LINES, (run.before, run.touched_off, run.after), strict=True))


def largest_errors(runs: Sequence[LoopRun]) -> dict[str, Float[np.ndarray, " runs"]]:
    """The largest error of every robot in each line of `LINES`, and the ``stated`` radius of 95 % at the worst target, metres."""
    largest = {line: np.array([errors_by_line(run)[line].length.max() for run in runs]) for line in LINES}
    return {**largest, "stated": np.array([RADIUS_95 * stated_errors(run).max() for run in runs])}


def rms(values: Float[np.ndarray, " k"]) -> float:
    """Root mean square."""
    return float(np.sqrt((values**2).mean()))


def stated_errors(run: LoopRun) -> Float[np.ndarray, " k"]:
    """Root mean square of the error in space that the correction states for every point of `LoopRun.after`, metres."""
    return run.correction.uncertainty[run.after.move]


def share_within(run: LoopRun) -> float:
    """Share of the points of the corrected program at which the true error is within the stated radius of 95 %."""
    return float((run.after.length <= RADIUS_95 * stated_errors(run)).mean())


def summarise_runs(runs: Sequence[LoopRun]) -> list[dict[str, Any]]:
    """Largest and root-mean-square errors of every robot, millimetres, what was stated, and the effects that were found."""
    names = dict(zip(LINES, ("before", "touched_off", "after"), strict=True))
    return [
        {
            **{f"{names[line]}_max_mm": float(e.length.max() * 1e3) for line, e in errors_by_line(run).items()},
            **{f"{names[line]}_rms_mm": rms(e.length) * 1e3 for line, e in errors_by_line(run).items()},
            "stated_mm": float(stated_errors(run).max() * 1e3),
            "stated_rms_mm": rms(stated_errors(run)) * 1e3,
            "stated_95_mm": float(RADIUS_95 * stated_errors(run).max() * 1e3),
            "within_95": share_within(run),
            "effects": [effect.name for effect in run.calibration.model.effects],
            "refused": float(len(run.correction.rejected)),
        }
        for run in runs
    ]
