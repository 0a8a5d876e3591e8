"""Orientations as instruments write them: quaternions, matrices, and angles whose order must be known."""

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial.transform import Rotation

from taskcal.measurement.column_meaning import ANGLES, Meaning
from taskcal.tabular.column_groups import UNIT_LENGTH
from taskcal.tabular.table import Table

AngleForm = Literal[
    "abc", "wpr", "rpy-deg", "rpy-rad", "fixed-xyz-deg", "fixed-xyz-rad", "moving-xyz-deg", "moving-xyz-rad", "rotation-vector-rad",
    "rotation-vector-deg", "none",
]  # fmt: skip
"""What three angles mean: KUKA's A B C (moving z y x, degrees), FANUC's W P R (fixed x y z, degrees), roll, pitch and yaw (fixed
x y z), three angles about fixed or moving x y z, a rotation vector as Universal Robots writes it; or nothing is read of them."""

ANGLE_FORMS: tuple[str, ...] = get_args(AngleForm)

_SEQUENCE = {"abc": "ZYX", "wpr": "xyz", "rpy": "xyz", "fixed-xyz": "xyz", "moving-xyz": "XYZ"}
"""SciPy's letters: capitals turn about moving axes."""

_NOT_ORTHOGONAL = 1e-3
"""Largest departure of a matrix that is a rotation written with four decimals."""


def rotations(
    table: Table, meanings: Sequence[Meaning | None], needed: Bool[np.ndarray, " rows"], form: AngleForm | None = None
) -> tuple[Float[np.ndarray, "rows 3 3"] | None, tuple[str, ...]]:
    """The orientations of a table's rows, and what was decided of them; None where it has none.

    Args:
        table: the cells.
        meanings: of its columns.
        needed: rows that must have one; the others may be empty.
        form: what three angles mean, where their names do not say.

    Raises:
        FileError: columns are lacking, or a cell is not what it must be.
    """
    quaternion = {m.index: k for k, m in enumerate(meanings) if m and m.kind == "quaternion"}
    matrix = {m.index: k for k, m in enumerate(meanings) if m and m.kind == "matrix"}
    angles = {m.index: k for k, m in enumerate(meanings) if m and m.kind == "euler"}
    if quaternion:
        return _of_quaternions(table, quaternion, needed), ()
    if len(matrix) >= 9:
        return _of_matrices(table, matrix, needed), ()
    if angles:
        return _of_angles(table, meanings, angles, needed, form)
    return None, ()


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
    return Rotation.from_quat(cells).as_matrix()


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
    return Rotation.from_matrix(R).as_matrix()


def _of_angles(
    table: Table, meanings: Sequence[Meaning | None], at: dict[int, int], needed: np.ndarray, form: AngleForm | None
) -> tuple[np.ndarray | None, tuple[str, ...]]:
    names = [table.header[at[i]] for i in range(3)]
    first = meanings[at[0]]
    if form == "none" or first is None:
        return None, ()
    listed = " ".join(names)
    what, unit = _stated(first, form)
    if what is None or unit is None:
        options = ", ".join(name for name in ANGLE_FORMS if name != "none")
        lacking = (
            "their unit is not stated" if what else "they may be angles about fixed or moving axes or a rotation vector"
        )
        return None, (f"{listed} are left out, since {lacking}; to use them state which: {options}",)
    cells = np.stack([table.numbers(name, empty=True) for name in names], axis=1)
    _refuse_empty(table, cells, names, needed, "a pose needs all three angles")
    cells[~needed] = 0.0
    if (
        form is None
        and first.unit is None
        and what != "rotation-vector"
        and 0.0 < np.abs(cells).max(initial=0.0) <= np.pi
    ):
        message = f"no angle of {listed} is beyond 3.14: they may be radians; name the columns {names[0]}_deg … or {names[0]}_rad …"
        raise table.header_error(message, names[0])
    angles = cells * ANGLES[unit]
    if what == "rotation-vector":
        return Rotation.from_rotvec(angles).as_matrix(), ()
    return Rotation.from_euler(_SEQUENCE[what], angles).as_matrix(), ()


def _stated(first: Meaning, form: AngleForm | None) -> tuple[str | None, str | None]:
    """What angles mean and their unit, by the user's word or by the columns' names; None for what neither says."""
    if form is None:
        by_name = {"rxyz": None, "rotvec": "rotation-vector"}.get(first.form, first.form)
        return by_name, first.unit or {"abc": "deg", "wpr": "deg", "rotvec": "rad"}.get(first.form)
    what, _, unit = form.rpartition("-")
    if form in ("abc", "wpr"):
        return form, "deg"
    return what, first.unit or unit


def _refuse_empty(table: Table, cells: np.ndarray, names: Sequence[str], needed: np.ndarray, why: str) -> None:
    for row, k in np.argwhere(np.isnan(cells) & needed[:, None]).tolist():
        raise table.error(f"the cell is empty while the position is there; {why}", row, names[k])
