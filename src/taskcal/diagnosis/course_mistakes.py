"""What happened in the course of a campaign: a target slipped, or the tracker or base drifted.

Each is a few more columns of the linear fit, free from one row on or growing with the rows; the gain is that of the logarithm
of the likelihood, noise unknown, less the price of the columns (Schwarz 1978) and of the rows tried.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.diagnosis.linear_fit import LinearFit, frame_columns

LEAST_GAIN = {"target-slipped": 25.0, "drift": 60.0}
"""Of twice the logarithm of the likelihood. What a robot leaves unexplained is not white and follows the rows by chance: on 60
drawn robots with gear errors, half of them measured in the order of their first joint, slips gained 4 at most, drifts 39."""

LEAST_MEDIANS = 1.5
"""Median distances that a point has to move by, so that what is said matters."""

LEAST_MOVE = 1e-3
"""Metres."""

LEAST_SHARE = 0.5
"""Of the farthest move, that a target moved by which slipped as well."""

LEAST_ROWS = 4
"""On either side of a slip."""

MOST_CUTS = 60
"""Rows between which a slip is looked for; the best one's neighbours are looked at as well."""


@dataclass(frozen=True, eq=False, kw_only=True)
class CourseMistake:
    """A slip or a drift."""

    id: str
    targets: tuple[int, ...]
    """That slipped."""
    row: int
    """The first row after the slip, as the campaign counts."""
    move: float
    """How far it moved the points, metres."""
    gain: float
    """Of twice the logarithm of the likelihood, less what the columns cost."""

    @property
    def confidence(self) -> float:
        """0.63 for the least gain that is believed, up to 0.99."""
        return float(np.clip(1.0 - np.exp(-self.gain / LEAST_GAIN[self.id]), 0.0, 0.99))


def find_course_mistake(fit: LinearFit, weight: Float[np.ndarray, " m"], count: int) -> CourseMistake | None:
    """The most likely slip or drift, if there is one beyond doubt: of which of the two it is the gain decides alone."""
    moves = max(LEAST_MOVE, LEAST_MEDIANS * fit.median)
    found = [m for m in (_slip(fit, weight, count), _drift(fit, weight)) if m is not None and m.move > moves]
    if not any(m.gain > LEAST_GAIN[m.id] for m in found):
        return None
    return max(found, key=lambda m: m.gain)


def gain(fit: LinearFit, before: float, after: float, columns: int, numbers: float) -> float:
    """Of twice the logarithm of the likelihood, less what the columns cost."""
    freedom = max(numbers - fit.columns.shape[2] / 2.0, 6.0)
    return float(freedom * np.log(max(before, 1e-12) / max(after, 1e-12)) - columns * np.log(numbers))


def _drift(fit: LinearFit, weight: np.ndarray) -> CourseMistake | None:
    time = (fit.rows - fit.rows.mean()) / max(float(np.ptp(fit.rows)), 1.0)
    columns = frame_columns(fit.places) * time[:, None, None]
    before, after = fit.objective(weight), fit.objective(weight, columns)
    moved = columns @ fit.size(weight, columns)
    # from the first row to the last
    move = float(np.median(np.linalg.norm(moved, axis=1) / np.maximum(np.abs(time), 0.05)))
    numbers = 3.0 * float((weight > 0.0).sum())
    return CourseMistake(
        id="drift", targets=(), row=int(fit.rows.min()), move=move, gain=gain(fit, before, after, 6, numbers)
    )


def _slip(fit: LinearFit, weight: np.ndarray, count: int) -> CourseMistake | None:
    before = fit.objective(weight)
    numbers = 3.0 * float((weight > 0.0).sum())
    rows = np.unique(fit.rows)
    if len(rows) < 2 * LEAST_ROWS + 2:
        return None
    places = np.arange(LEAST_ROWS, len(rows) - LEAST_ROWS + 1)
    coarse = places[:: max(1, len(places) // MOST_CUTS)]
    choices = [(t,) for t in range(count)] + ([tuple(range(count))] if count > 1 else [])
    best: tuple[float, tuple[int, ...], int] | None = None
    for targets in choices:
        tried = {int(k): fit.objective(weight, _after(fit, targets, int(rows[k]))) for k in coarse}
        top = min(tried, key=lambda k: tried[k])
        for k in places[np.abs(places - top) < max(1, len(places) // MOST_CUTS)]:
            tried[int(k)] = fit.objective(weight, _after(fit, targets, int(rows[k])))
        top = min(tried, key=lambda k: tried[k])
        price = 3 * len(targets)
        value = gain(fit, before, tried[top], price, numbers) - 2.0 * np.log(len(places) * len(choices))
        if best is None or value > best[0]:
            best = (value, targets, int(rows[top]))
    assert best is not None
    value, targets, row = best
    sizes = np.linalg.norm(fit.size(weight, _after(fit, targets, row)).reshape(-1, 3), axis=1)
    return CourseMistake(
        id="target-slipped",
        targets=tuple(t for t, size in zip(targets, sizes, strict=True) if size > LEAST_SHARE * sizes.max()),
        row=row,
        move=float(sizes.max()),
        gain=value,
    )


def _after(fit: LinearFit, targets: tuple[int, ...], row: int) -> Float[np.ndarray, "m 3 b"]:
    out = np.zeros((len(fit.rows), 3, 3 * len(targets)))
    for k, t in enumerate(targets):
        chosen = (fit.targets == t) & (fit.rows >= row)
        out[chosen, :, 3 * k : 3 * k + 3] = fit.turned[chosen]
    return out
