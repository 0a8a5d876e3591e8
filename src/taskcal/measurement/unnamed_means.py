"""Rows below a table that hold its mean, and other statistics beside it, without a word that says so."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from taskcal.measurement.readings import Readings

MIN_ROWS = 6
"""Above a row that may be their mean."""

MOST_STATISTICS = 8
"""Rows below a table: mean, standard deviation, least, largest, range, median, root mean square …"""

MIN_COLUMNS = 5
"""In which the rows differ, and all of which must agree with one statistic."""

_AGREES = 2e-3
"""Largest difference over the standard deviation of the rows above: a mean is often written with fewer digits."""


def without_means(readings: Readings) -> Readings:
    """Readings without last rows that are the mean of all above, and other statistics of these beside it; a note says so."""
    if readings.q is None or not readings.points or readings.targets_by_row is not None:
        return readings
    values = np.concatenate([readings.q, next(iter(readings.points.values()))], axis=1)
    end = _end_of_measurements(values)
    if end == len(values):
        return readings
    lines = ", ".join(str(line) for line in readings.lines[end:])
    note = f"the last rows (line {lines}) are the mean of those above, or another statistic of them, and are left out"
    rest = readings.take(np.arange(end))
    return replace(rest, notes=(*rest.notes, note))


def _end_of_measurements(values: Float[np.ndarray, "n columns"]) -> int:
    """The first of last rows that are all statistics of the rows before them, one of them the mean; else the number of rows."""
    n = len(values)
    for end in range(max(MIN_ROWS, n - MOST_STATISTICS), n):
        above, below = values[:end], values[end:]
        above = above[~np.isnan(above).any(axis=1)]
        if len(above) < MIN_ROWS:
            continue
        scatter = above.std(axis=0)
        differ = scatter > 0.0
        if differ.sum() < MIN_COLUMNS:
            continue
        statistics = _statistics(above)
        off = np.abs(below[:, None] - statistics[None])[..., differ] / scatter[differ]
        fits = (off < _AGREES).all(axis=2)
        if fits[:, 0].any() and fits.any(axis=1).all():
            return end
    return n


def _statistics(rows: np.ndarray) -> Float[np.ndarray, "statistics columns"]:
    """The mean first."""
    spread = [rows.std(axis=0), rows.std(axis=0, ddof=1), np.ptp(rows, axis=0)]
    places = [rows.mean(axis=0), rows.min(axis=0), rows.max(axis=0), np.median(rows, axis=0)]
    return np.stack([*places, *spread, np.sqrt(np.mean(rows**2, axis=0)), rows.sum(axis=0)])
