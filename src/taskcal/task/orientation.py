"""An orientation in a task file: a quaternion, angles in one of three ways, or a direction."""

import numpy as np
from jaxtyping import Float
from pydantic import model_validator

from taskcal.geometry import se3
from taskcal.geometry.euler import ANGLES, AngleForm, from_angles
from taskcal.io.toml_file import Direction, FileSection, Finite, Quaternion
from taskcal.tables.table import QUATERNION, Table

Triple = tuple[Finite, Finite, Finite]

WAYS = ("quaternion", "rpy_deg", "abc_deg", "wpr_deg")


class TurnSection(FileSection):
    """A rotation, stated in one way at most."""

    quaternion: Quaternion | None = None
    rpy_deg: Triple | None = None
    abc_deg: Triple | None = None
    wpr_deg: Triple | None = None

    @model_validator(mode="after")
    def _once(self) -> "TurnSection":
        ways = [key for key in (*WAYS, "direction") if getattr(self, key, None) is not None]
        if len(ways) > 1:
            raise ValueError(f"gives the orientation as {' and as '.join(ways)}; keep one of them")
        return self

    @property
    def stated(self) -> bool:
        """Whether it says a rotation."""
        return any(getattr(self, key) is not None for key in WAYS)

    def rotation(self) -> Float[np.ndarray, "3 3"]:
        """The rotation; none where it says none."""
        forms: tuple[AngleForm, ...] = ("rpy", "abc", "wpr")
        for form in forms:
            angles = getattr(self, f"{form}_deg")
            if angles is not None:
                return from_angles(form, np.radians(angles))
        return np.eye(3) if self.quaternion is None else se3.from_quaternion(np.array(self.quaternion))


class DirectedSection(TurnSection):
    """A rotation, or a direction of the tool's z axis, which leaves the turn about it open."""

    direction: Direction | None = None

    def rotation(self) -> Float[np.ndarray, "3 3"]:
        """The rotation, or one that brings the z axis to the direction."""
        return super().rotation() if self.direction is None else towards(np.array(self.direction))


def towards(axis: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    """A rotation whose z axis has this direction."""
    z = axis / np.linalg.norm(axis)
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


# Tool poses in a table: a position with a quaternion, with angles in one of three ways, or with a direction.

QUATERNION_LENGTH = 1e-2
"""How far the length of a quaternion or a direction may be from one: files of tasks are written by hand."""

DIRECTION = ("i", "j", "k")

KNOWN = "x_mm y_mm z_mm with qx qy qz qw, roll_deg pitch_deg yaw_deg, a_deg b_deg c_deg (KUKA), w_deg p_deg r_deg (FANUC) or i j k"
"""Columns of a table of poses."""


def has_poses(columns: Table) -> bool:
    """Whether a table has an orientation for its points."""
    return any(name in columns for names in _ways().values() for name in names)


def read_tool_poses(columns: Table) -> Float[np.ndarray, "n 4 4"]:
    """The poses of a table's rows, metres; a direction of the tool's z axis leaves the turn about it at any value.

    Raises:
        FileError: a column is lacking, the orientation is not stated or stated twice, or a cell is not a number.
    """
    p = columns.points()
    ways = {way: names for way, names in _ways().items() if any(name in columns for name in names)}
    if len(ways) != 1:
        said = "says no orientation" if not ways else f"says the orientation twice, {' and '.join(ways)}"
        raise columns.header_error(f"{said}; a table of poses has the columns {KNOWN}")
    ((way, names),) = ways.items()
    if way == "quaternion":
        return se3.pose(se3.from_quaternion(columns.quaternions(within=QUATERNION_LENGTH)), p)
    columns.together(names, "an orientation needs all three")
    values = columns.side_by_side(names)
    if way == "direction":
        columns.check_lengths(values, np.ones(len(values), dtype=bool), names[0], "direction", QUATERNION_LENGTH)
        return se3.pose(np.array([towards(row) for row in values]).reshape(-1, 3, 3), p)
    form: AngleForm = next(form for form in ANGLES if form == way)
    return se3.pose(from_angles(form, np.radians(values)), p)


def _ways() -> dict[str, tuple[str, ...]]:
    """Columns of each way to write an orientation."""
    angles = {form: tuple(f"{name}_deg" for name in names) for form, names in ANGLES.items()}
    return {"quaternion": QUATERNION, **angles, "direction": DIRECTION}
