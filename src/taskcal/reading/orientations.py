"""Orientations as instruments write them: quaternions, matrices, and angles whose order must be known."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.reading.columns import Meaning, MeasuredTable
from taskcal.tables.options import AngleForm
from taskcal.tables.table import ANGLES, Table

_MOVING = {"abc": "zyx", "moving-xyz": "xyz"}
"""About which moving axes the angles turn; all others are about fixed x, y, z."""

_CANDIDATES: dict[str, tuple[str, ...]] = {
    "wpr": ("wpr", "moving-xyz"),
    "abc": ("abc", "fixed-xyz", "moving-xyz"),
    "rpy": ("rpy", "moving-xyz"),
    "rxyz": ("fixed-xyz", "moving-xyz", "rotation-vector"),
}
"""What angles of each name are written for, the usual first: RoboDK heads angles about moving axes W P R, and Mitsubishi those
about fixed x y z A B C."""

MAX_RADIANS = 2.0 * np.pi
"""Angle, at most, that may be in radians: a turn."""

MAX_NOT_ORTHOGONAL = 1e-3
"""Largest departure of a matrix that is a rotation written with four decimals."""


@dataclass(frozen=True, eq=False, kw_only=True)
class OpenAngles:
    """Three angles whose names leave open what they mean."""

    columns: str
    """As the file names them."""
    assumed: str | None
    """What they usually mean; None where they are left out unless it is told."""
    meanings: Mapping[str, Float[np.ndarray, "rows 3 3"]]
    """The orientations by each `AngleForm` that they may follow."""

    def mapped(self, function: Callable[[np.ndarray], np.ndarray]) -> "OpenAngles":
        """With other orientations in place of each, such as some of the rows."""
        return replace(self, meanings={form: function(R) for form, R in self.meanings.items()})


def rotations_of(
    measured: MeasuredTable, points: Mapping[str, Float[np.ndarray, "rows 3"]], form: AngleForm | None = None
) -> dict[str, Any]:
    """Fields of `Readings` on the orientations of a table's rows, and on what is open of them.

    Args:
        measured: the cells.
        points: positions by target, NaN where it was not seen: only rows with one must have an orientation.
        form: what three angles mean, where their names do not say.

    Raises:
        FileError: columns are lacking, or a cell is not what it must be.
    """
    seen = {name.casefold(): ~np.isnan(values[:, 0]) for name, values in points.items()}
    needed = np.any(list(seen.values()), axis=0) if seen else np.ones(len(measured), dtype=bool)
    if quaternions := measured.by_target("quaternion"):
        return {
            "rotations": {
                next(iter(at.values()))[1].target: _of_quaternions(measured, at, seen.get(target, needed))
                for target, at in quaternions.items()
            }
        }
    matrix = {meaning.index: name for name, meaning in measured.of("matrix")}
    if len(matrix) >= 9:
        return {"rotations": {"": _of_matrices(measured, matrix, needed)}}
    angles = {meaning.index: (name, meaning) for name, meaning in measured.of("euler")}
    if angles and form != "none":
        return _of_angles(measured, [angles[i][0] for i in range(3)], angles[0][1], needed, form)
    return {}


def _of_quaternions(table: Table, at: Mapping[int, tuple[str, Meaning]], needed: np.ndarray) -> np.ndarray:
    if lacking := [f"q{name}" for part, name in enumerate("xyzw") if part not in at]:
        have = next(iter(at.values()))[0]
        raise table.header_error(f"has '{have}' but no column '{lacking[0]}'; a pose needs qx qy qz qw")
    columns = [at[part][0] for part in range(4)]
    return se3.from_quaternion(table.quaternions(columns, needed=needed, remedy="give a number"))


def _of_matrices(table: Table, at: Mapping[int, str], needed: np.ndarray) -> np.ndarray:
    """Nine of the elements, counted from 0 or from 1."""
    first = min(index % 10 for index in at)
    elements = [10 * (i + first) + j + first for i in range(3) for j in range(3)]
    lacking = [index for index in elements if index not in at]
    if lacking:
        element = f"row {lacking[0] // 10}, column {lacking[0] % 10}"
        raise table.header_error(f"has '{next(iter(at.values()))}' but lacks {element} of the matrix")
    names = [at[index] for index in elements]
    cells = table.side_by_side(names, empty=True)
    table.refuse_empty(cells, names, needed, "a pose needs all nine elements")
    R = cells.reshape(-1, 3, 3)
    R[~needed] = np.eye(3)
    off = np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    for row in np.flatnonzero((off > MAX_NOT_ORTHOGONAL) | (np.linalg.det(R) < 0.0)):
        turned = "mirrors; is an axis or a sign swapped?" if np.linalg.det(R[row]) < 0 else "is not a rotation"
        raise table.error(f"the matrix {turned}", int(row), names[0])
    return se3.nearest_rotation(R)


def _of_angles(
    table: Table, names: Sequence[str], first: Meaning, needed: np.ndarray, form: AngleForm | None
) -> dict[str, Any]:
    cells = table.side_by_side(names, empty=True)
    table.refuse_empty(cells, names, needed, "a pose needs all three angles")
    cells[~needed] = 0.0
    if form is not None or first.form == "rotvec":
        return {"rotations": {"": _turned(cells, *_stated(first, form))}}
    unit = first.unit or {"abc": "deg", "wpr": "deg"}.get(first.form)
    largest = np.abs(cells).max(initial=0.0)
    if first.unit is None and unit is not None and 0.0 < largest <= np.pi:
        message = (
            f"no angle of {' '.join(names)} is beyond 3.14: they may be radians; name the columns {names[0]}_deg … or "
            f"{names[0]}_rad …"
        )
        raise table.header_error(message, names[0])
    units = [unit] if unit else ["deg", "rad"] if largest <= MAX_RADIANS else ["deg"]
    meant = {
        what if what in ("abc", "wpr") else f"{what}-{unit}": _turned(cells, what, unit)
        for unit in units
        for what in _CANDIDATES[first.form]
    }
    assumed = None if first.form == "rxyz" or unit is None else next(iter(meant))
    open_angles = OpenAngles(columns=" ".join(names), assumed=assumed, meanings=meant)
    return {"open_angles": open_angles, "rotations": {} if assumed is None else {"": meant[assumed]}}


def _turned(cells: Float[np.ndarray, "rows 3"], what: str, unit: str) -> Float[np.ndarray, "rows 3 3"]:
    angles = cells * ANGLES[unit]
    if what == "rotation-vector":
        return se3.exp(angles)
    if what in _MOVING:
        return se3.turns(_MOVING[what], angles)
    return se3.turns("zyx", angles[:, ::-1])


def _stated(first: Meaning, form: AngleForm | None) -> tuple[str, str]:
    """Meaning and unit of angles as the user states them, or of a rotation vector by its name."""
    if form is None:
        return "rotation-vector", first.unit or "rad"
    if form in ("abc", "wpr"):
        return form, first.unit or "deg"
    what, _, unit = form.rpartition("-")
    return what, first.unit or unit
