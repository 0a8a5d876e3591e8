"""An orientation in a task file: a quaternion, angles in one of three ways, or a direction."""

import numpy as np
from jaxtyping import Float
from pydantic import model_validator

from taskcal.geometry import se3
from taskcal.geometry.euler import AngleForm, from_angles
from taskcal.toml_file import Direction, Finite, Quaternion, Section

Triple = tuple[Finite, Finite, Finite]

WAYS = ("quaternion", "rpy_deg", "abc_deg", "wpr_deg")


class TurnSection(Section):
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
