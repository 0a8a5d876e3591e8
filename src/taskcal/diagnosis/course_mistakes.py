"""What happened in the course of a campaign: a target slipped, or the tracker or base moved, at one row or slowly.

Each is a few more columns of the linear fit, free from one row on or growing with the rows; the gain is that of the logarithm
of the likelihood, noise unknown, less the price of the columns (Schwarz 1978) and of the rows tried.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from taskcal.diagnosis.linear_fit import LinearFit, frame_columns

LEAST_GAIN = {"target-slipped": 25.0, "station-moved": 60.0, "drift": 60.0}
"""Of twice the logarithm of the likelihood. What a robot leaves unexplained is not white and follows the rows by chance: on 60
drawn robots with gear errors, half of them measured in the order of their first joint, slips gained 4 at most, drifts 39."""

LEAST_ABRUPT = {"target-slipped": 10.0, "station-moved": 30.0}
"""Of the same, beside a smooth motion: what a robot leaves in rows that follow a joint changes smoothly, a slip or a move does not.
On those robots with gear errors and compliance moves gained 28 at most; moves by 2 mm gained 36 at least, slips by 2 mm 40."""

LEAST_MEDIANS = 1.5
"""Median distances that a point has to move by, so that what is said matters."""

LEAST_MOVE = 1e-3
"""Metres."""

LEAST_FACTOR = 1.05
"""By which it raised the error, at least: less changes nothing that matters."""

LEAST_SHARE = 0.5
"""Of the farthest move, that a target moved by which slipped as well."""

LEAST_ROWS = 4
"""On either side of a slip."""

LEAST_MOVED_SHARE = 0.1
"""Of the rows, on either side of a move: fewer in one corner of the workspace may lack what all others explain."""

MOST_CUTS = 60
"""Rows between which a slip is looked for; the best one's neighbours are looked at as well."""


@dataclass(frozen=True, eq=False, kw_only=True)
class CourseMistake:
    """A slip, a move of the tracker or the base, or a drift."""

    id: str
    targets: tuple[int, ...]
    """That slipped."""
    row: int
    """The first row after a slip or a move, as the campaign counts."""
    move: float
    """How far it moved the points, metres."""
    gain: float
    """Of twice the logarithm of the likelihood, less what the columns cost."""
    believed: bool
    """Whether it is beyond doubt."""
    before: float
    """Root mean square distance of the points, the geometry free within its tolerances, metres."""
    after: float
    """The same with what happened taken into account."""
    motion: Float[np.ndarray, " b"] = field(default_factory=lambda: np.zeros(0))
    """Of a move: translation of the points' centre and rotation about it, metres and radians."""

    @property
    def confidence(self) -> float:
        """0.63 for the least gain that is believed, up to 0.99."""
        return float(np.clip(1.0 - np.exp(-self.gain / LEAST_GAIN[self.id]), 0.0, 0.99))


def find_course_mistake(fit: LinearFit, weight: Float[np.ndarray, " m"], count: int) -> CourseMistake | None:
    """The most likely slip, move or drift, if there is one beyond doubt: of which of them it is the gain decides alone."""
    moves = max(LEAST_MOVE, LEAST_MEDIANS * fit.median)
    tried = (_slip(fit, weight, count), _moved(fit, weight), _drift(fit, weight))
    found = [
        m for m in tried if m is not None and m.gain > 0.0 and m.move > moves and m.before > LEAST_FACTOR * m.after
    ]
    if not any(m.believed for m in found):
        return None
    return max(found, key=lambda m: m.gain)


def gain(fit: LinearFit, before: float, after: float, columns: int, numbers: float) -> float:
    """Of twice the logarithm of the likelihood, less what the columns cost."""
    freedom = max(numbers - fit.columns.shape[2] / 2.0, 6.0)
    return float(freedom * np.log(max(before, 1e-12) / max(after, 1e-12)) - columns * np.log(numbers))


def _drift(fit: LinearFit, weight: np.ndarray) -> CourseMistake:
    """Growing with the rows; believed where it grows evenly, and as likely as what grows faster at one end."""
    time, numbers, before = _time(fit), _numbers(weight), fit.objective(weight)
    curved = _smooth(fit)
    even = curved[:, :, :6]
    gains = [gain(fit, before, fit.objective(weight, c), c.shape[2], numbers) for c in (even, curved)]
    moved = even @ fit.size(weight, even)
    return CourseMistake(
        id="drift",
        targets=(),
        row=int(fit.rows.min()),
        # from the first row to the last
        move=float(np.median(np.linalg.norm(moved, axis=1) / np.maximum(np.abs(time), 0.05))),
        gain=max(gains),
        believed=gains[0] > LEAST_GAIN["drift"],
        before=fit.rms(weight),
        after=fit.rms(weight, (even, curved)[int(np.argmax(gains))]),
    )


def _time(fit: LinearFit) -> Float[np.ndarray, " m"]:
    return (fit.rows - fit.rows.mean()) / max(float(np.ptp(fit.rows)), 1.0)


def _smooth(fit: LinearFit) -> Float[np.ndarray, "m 3 12"]:
    """All points as one rigid body, evenly with the rows, and with their square."""
    time, frame = _time(fit), frame_columns(fit.places)
    return np.concatenate([frame * (time**power)[:, None, None] for power in (1, 2)], axis=2)


def _is_abrupt(
    name: str, fit: LinearFit, weight: np.ndarray, columns: Float[np.ndarray, "m 3 b"], value: float
) -> bool:
    """Whether a slip or a move is beyond doubt, a smooth motion beside it."""
    smooth = _smooth(fit)
    both = np.concatenate([smooth, columns], axis=2)
    more = gain(fit, fit.objective(weight, smooth), fit.objective(weight, both), columns.shape[2], _numbers(weight))
    least = LEAST_ABRUPT[name] + 2.0 * float(np.log(len(np.unique(fit.rows))))
    return value > LEAST_GAIN[name] and more > least


def _moved(fit: LinearFit, weight: np.ndarray) -> CourseMistake | None:
    """All points as one rigid body, from one row on."""
    frame = frame_columns(fit.places)

    def columns(row: int) -> Float[np.ndarray, "m 3 6"]:
        return frame * (fit.rows >= row)[:, None, None]

    least = max(LEAST_ROWS, int(np.ceil(LEAST_MOVED_SHARE * len(np.unique(fit.rows)))))
    cut = _best_cut(fit, weight, columns, least=least)
    if cut is None:
        return None
    row, value = cut
    motion = fit.size(weight, columns(row))
    return CourseMistake(
        id="station-moved",
        targets=(),
        row=row,
        move=float(np.median(np.linalg.norm((frame @ motion)[fit.rows >= row], axis=1))),
        gain=value,
        believed=_is_abrupt("station-moved", fit, weight, columns(row), value),
        before=fit.rms(weight),
        after=fit.rms(weight, columns(row)),
        motion=motion,
    )


def _slip(fit: LinearFit, weight: np.ndarray, count: int) -> CourseMistake | None:
    """Of one target, or of all of them by their own ways, from one row on."""
    choices = [(t,) for t in range(count)] + ([tuple(range(count))] if count > 1 else [])
    best: tuple[float, tuple[int, ...], int] | None = None
    for targets in choices:
        cut = _best_cut(fit, weight, lambda row, chosen=targets: _after(fit, chosen, row), len(choices))
        if cut is not None and (best is None or cut[1] > best[0]):
            best = (cut[1], targets, cut[0])
    if best is None:
        return None
    value, targets, row = best
    columns = _after(fit, targets, row)
    sizes = np.linalg.norm(fit.size(weight, columns).reshape(-1, 3), axis=1)
    return CourseMistake(
        id="target-slipped",
        targets=tuple(t for t, size in zip(targets, sizes, strict=True) if size > LEAST_SHARE * sizes.max()),
        row=row,
        move=float(sizes.max()),
        gain=value,
        believed=_is_abrupt("target-slipped", fit, weight, columns, value),
        before=fit.rms(weight),
        after=fit.rms(weight, columns),
    )


def _best_cut(
    fit: LinearFit,
    weight: np.ndarray,
    columns: Callable[[int], Float[np.ndarray, "m 3 b"]],
    choices: int = 1,
    least: int = LEAST_ROWS,
) -> tuple[int, float] | None:
    """The row from which on the columns explain most, and their gain; None where there are too few rows.

    Args:
        fit: of some rows.
        weight: of its points.
        columns: that are free from a row on.
        choices: number of such columns that are tried at every row.
        least: rows on either side.
    """
    rows = np.unique(fit.rows)
    if len(rows) < 2 * least + 2:
        return None
    places = np.arange(least, len(rows) - least + 1)
    stride = max(1, len(places) // MOST_CUTS)
    tried: dict[int, float] = {}
    for near in (places[::stride], None):
        if near is None:
            top = min(tried, key=lambda k: tried[k])
            near = places[np.abs(places - top) < stride]
        tried |= {int(k): fit.objective(weight, columns(int(rows[k]))) for k in near if int(k) not in tried}
    top = min(tried, key=lambda k: tried[k])
    price = columns(int(rows[top])).shape[2]
    value = gain(fit, fit.objective(weight), tried[top], price, _numbers(weight))
    return int(rows[top]), value - 2.0 * float(np.log(len(places) * choices))


def _numbers(weight: np.ndarray) -> float:
    return 3.0 * float((weight > 0.0).sum())


def _after(fit: LinearFit, targets: tuple[int, ...], row: int) -> Float[np.ndarray, "m 3 b"]:
    out = np.zeros((len(fit.rows), 3, 3 * len(targets)))
    for k, t in enumerate(targets):
        chosen = (fit.targets == t) & (fit.rows >= row)
        out[chosen, :, 3 * k : 3 * k + 3] = fit.turned[chosen]
    return out
