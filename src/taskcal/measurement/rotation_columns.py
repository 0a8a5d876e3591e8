"""Orientations as instruments write them: quaternions, matrices, and angles whose order must be known."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float

from taskcal.geometry import se3
from taskcal.measurement.column_meaning import Meaning
from taskcal.measurement.units import ANGLES
from taskcal.tabular.column_groups import UNIT_LENGTH
from taskcal.tabular.table import Table

AngleForm = Literal[
    "abc", "wpr", "rpy-deg", "rpy-rad", "fixed-xyz-deg", "fixed-xyz-rad", "moving-xyz-deg", "moving-xyz-rad", "rotation-vector-rad",
    "rotation-vector-deg", "none",
]  # fmt: skip
"""What three angles mean: KUKA's A B C (moving z y x, degrees), FANUC's W P R (fixed x y z, degrees), roll, pitch and yaw (fixed
x y z), three angles about fixed or moving x y z, a rotation vector as Universal Robots writes it; or nothing is read of them."""

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

_LARGEST_RADIANS = 2.0 * np.pi

_NOT_ORTHOGONAL = 1e-3
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


@dataclass(frozen=True, eq=False, kw_only=True)
class RotationColumns:
    """The orientations of a table's rows."""

    rotations: Float[np.ndarray, "rows 3 3"] | None = None
    """None where there are none."""
    rotated: str = ""
    """Whose they are, where their columns say."""
    others: Mapping[str, Float[np.ndarray, "rows 3 3"]] = field(default_factory=dict[str, np.ndarray])
    """Of further targets, by their names."""
    open_angles: OpenAngles | None = None
    notes: tuple[str, ...] = ()
    """What was decided of them."""


def rotations(
    table: Table,
    meanings: Sequence[Meaning | None],
    needed: Mapping[str, Bool[np.ndarray, " rows"]],
    form: AngleForm | None = None,
) -> RotationColumns:
    """The orientations of a table's rows.

    Args:
        table: the cells.
        meanings: of its columns.
        needed: rows that must have one, by target in small letters, empty for any; the others may be empty.
        form: what three angles mean, where their names do not say.

    Raises:
        FileError: columns are lacking, or a cell is not what it must be.
    """
    quaternions: dict[str, dict[int, int]] = {}
    for k, m in enumerate(meanings):
        if m and m.kind == "quaternion":
            quaternions.setdefault(m.target.casefold(), {})[m.index] = k
    matrix = {m.index: k for k, m in enumerate(meanings) if m and m.kind == "matrix"}
    angles = {m.index: k for k, m in enumerate(meanings) if m and m.kind == "euler"}
    if quaternions:
        turned: dict[str, np.ndarray] = {}
        for target, at in quaternions.items():
            first = meanings[next(iter(at.values()))]
            assert first is not None
            turned[first.target] = _of_quaternions(table, at, needed.get(target, needed[""]))
        rotated = next(iter(turned))
        return RotationColumns(rotations=turned.pop(rotated), rotated=rotated, others=turned)
    if len(matrix) >= 9:
        return RotationColumns(rotations=_of_matrices(table, matrix, needed[""]))
    if angles:
        return _of_angles(table, meanings, angles, needed[""], form)
    return RotationColumns()


def _of_quaternions(table: Table, at: dict[int, int], needed: np.ndarray) -> np.ndarray:
    header = table.header
    for part in range(4):
        if part not in at:
            have = header[next(iter(at.values()))]
            lacking = f"q{'xyzw'[part]}"
            raise table.header_error(f"has '{have}' but no column '{lacking}'; a pose needs qx qy qz qw")
    cells = np.stack([table.numbers(header[at[part]], empty=True) for part in range(4)], axis=1)
    _refuse_empty(table, cells, [header[at[part]] for part in range(4)], needed, "a pose needs all of qx qy qz qw")
    lengths = np.linalg.norm(cells, axis=1)
    for row in np.flatnonzero(needed & (np.abs(lengths - 1.0) > UNIT_LENGTH)):
        message = f"the quaternion has length {lengths[row]:.4f}; it must be 1 (is qw last?)"
        raise table.error(message, int(row), header[at[0]])
    cells[~needed] = (0.0, 0.0, 0.0, 1.0)
    return se3.from_quaternion(cells)


def _of_matrices(table: Table, at: dict[int, int], needed: np.ndarray) -> np.ndarray:
    """Nine of the elements, counted from 0 or from 1."""
    first = min(index % 10 for index in at)
    elements = [10 * (i + first) + j + first for i in range(3) for j in range(3)]
    lacking = [index for index in elements if index not in at]
    if lacking:
        have = table.header[next(iter(at.values()))]
        raise table.header_error(
            f"has '{have}' but lacks row {lacking[0] // 10}, column {lacking[0] % 10} of the matrix"
        )
    names = [table.header[at[index]] for index in elements]
    cells = np.stack([table.numbers(name, empty=True) for name in names], axis=1)
    _refuse_empty(table, cells, names, needed, "a pose needs all nine elements")
    R = cells.reshape(-1, 3, 3)
    R[~needed] = np.eye(3)
    off = np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    for row in np.flatnonzero((off > _NOT_ORTHOGONAL) | (np.linalg.det(R) < 0.0)):
        turned = "mirrors; is an axis or a sign swapped?" if np.linalg.det(R[row]) < 0 else "is not a rotation"
        raise table.error(f"the matrix {turned}", int(row), names[0])
    return se3.nearest_rotation(R)


def _of_angles(
    table: Table, meanings: Sequence[Meaning | None], at: dict[int, int], needed: np.ndarray, form: AngleForm | None
) -> RotationColumns:
    names = [table.header[at[i]] for i in range(3)]
    first = meanings[at[0]]
    if form == "none" or first is None:
        return RotationColumns()
    cells = np.stack([table.numbers(name, empty=True) for name in names], axis=1)
    _refuse_empty(table, cells, names, needed, "a pose needs all three angles")
    cells[~needed] = 0.0
    if form is not None or first.form == "rotvec":
        what, unit = _stated(first, form)
        return RotationColumns(rotations=_turned(cells, what, unit))
    unit = first.unit or {"abc": "deg", "wpr": "deg"}.get(first.form)
    largest = np.abs(cells).max(initial=0.0)
    if first.unit is None and unit is not None and 0.0 < largest <= np.pi:
        message = (
            f"no angle of {' '.join(names)} is beyond 3.14: they may be radians; name the columns {names[0]}_deg … or "
            f"{names[0]}_rad …"
        )
        raise table.header_error(message, names[0])
    units = [unit] if unit else ["deg", "rad"] if largest <= _LARGEST_RADIANS else ["deg"]
    meant = {
        what if what in ("abc", "wpr") else f"{what}-{unit}": _turned(cells, what, unit)
        for unit in units
        for what in _CANDIDATES[first.form]
    }
    assumed = None if first.form == "rxyz" or unit is None else next(iter(meant))
    return RotationColumns(
        rotations=None if assumed is None else meant[assumed],
        open_angles=OpenAngles(columns=" ".join(names), assumed=assumed, meanings=meant),
    )


def _turned(cells: Float[np.ndarray, "rows 3"], what: str, unit: str) -> Float[np.ndarray, "rows 3 3"]:
    angles = cells * ANGLES[unit]
    if what == "rotation-vector":
        return se3.exp(angles)
    if what in _MOVING:
        return se3.turns(_MOVING[what], angles)
    return se3.turns("zyx", angles[:, ::-1])


def _stated(first: Meaning, form: AngleForm | None) -> tuple[str, str]:
    """What angles mean and their unit, by the user's word, or by their name where they are a rotation vector."""
    if form is None:
        return "rotation-vector", first.unit or "rad"
    if form in ("abc", "wpr"):
        return form, first.unit or "deg"
    what, _, unit = form.rpartition("-")
    return what, first.unit or unit


def _refuse_empty(table: Table, cells: np.ndarray, names: Sequence[str], needed: np.ndarray, why: str) -> None:
    for row, k in np.argwhere(np.isnan(cells) & needed[:, None]).tolist():
        raise table.error(f"the cell is empty while the position is there; {why}", row, names[k])
