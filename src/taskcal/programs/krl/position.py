"""Positions in KRL: X Y Z in millimetres, A B C or A1 … A6 in degrees, S and T; from text to numbers and back."""

from collections.abc import Mapping
from math import nan

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.programs.krl.syntax import Aggregate
from taskcal.programs.numeral import renumbered
from taskcal.programs.source import Edit
from taskcal.programs.unresolved import Unresolved
from taskcal.programs.zyx_angles import angles, rotation

POSE = ("X", "Y", "Z", "A", "B", "C")
AXES = ("A1", "A2", "A3", "A4", "A5", "A6")
EXTERNAL = ("E1", "E2", "E3", "E4", "E5", "E6")

# KRL's REAL is a 32-bit float: nine digits in all, so 0.1 µm within metres and 1e-6° within a turn.
DECIMALS = {**dict.fromkeys("XYZ", 5), **dict.fromkeys("ABC", 6), **dict.fromkeys((*AXES, *EXTERNAL), 6)}


def has_pose(aggregate: Aggregate) -> bool:
    """Whether any component of a pose is stated."""
    return any(aggregate.field(name) for name in POSE)


def has_axes(aggregate: Aggregate) -> bool:
    """Whether any axis is stated."""
    return any(aggregate.field(name) for name in AXES)


def pose(aggregate: Aggregate, *, needed: tuple[str, ...] = POSE) -> Float[np.ndarray, "4 4"]:
    """The pose that a complete position states, metres.

    Raises:
        Unresolved: a needed component is missing or no number.
    """
    x, y, z, A, B, C = (_stated(aggregate, name, needed) for name in POSE)
    return se3.pose(rotation(A, B, C), np.array([x, y, z]) * 1e-3)


def rotation_stated(aggregate: Aggregate) -> bool:
    """Whether the angles are stated.

    Raises:
        Unresolved: some are, and others not.
    """
    stated = [name for name in "ABC" if aggregate.field(name)]
    if len(stated) in (1, 2):
        raise Unresolved(f"of its angles it states {' and '.join(stated)} only")
    return bool(stated)


def axes(aggregate: Aggregate, *, needed: tuple[str, ...] = AXES) -> Float[np.ndarray, " joints"]:
    """The joint positions that a complete axis position states, radians; zero for what is neither stated nor needed.

    Raises:
        Unresolved: a needed axis is missing or no number.
    """
    return np.radians([_stated(aggregate, name, needed) for name in AXES])


def _stated(aggregate: Aggregate, name: str, needed: tuple[str, ...]) -> float:
    component = aggregate.field(name)
    if component is None and name not in needed:
        return 0.0
    if component is None:
        raise Unresolved(f"{name} is not stated, so it keeps its value of before")
    if component.value is None:
        raise Unresolved(f"{name} is '{component.text}', which is not a number")
    return component.value


def whole(aggregate: Aggregate, name: str) -> int | None:
    """The whole number of 31 bits in a component; None where there is none."""
    value = aggregate.value(name)
    return int(value) if value is not None and 0 <= value < 2**31 and value == int(value) else None


def external(aggregate: Aggregate) -> tuple[float, ...]:
    """Positions of the external axes, millimetres or degrees; NaN where none is stated.

    Raises:
        Unresolved: one is not a number.
    """
    out: list[float] = []
    for name in EXTERNAL:
        axis = aggregate.field(name)
        if axis is not None and axis.value is None:
            raise Unresolved(f"{name} is '{axis.text}', which is not a number")
        out.append(nan if axis is None or axis.value is None else axis.value)
    return tuple(out)


def pose_values(T: Float[np.ndarray, "4 4"], near: Aggregate | None = None) -> dict[str, float]:
    """Values of X Y Z A B C of a pose, millimetres and degrees; angles near those of a position."""
    old = tuple((near.value(name) if near else None) or 0.0 for name in "ABC")
    abc = angles(T[:3, :3], (old[0], old[1], old[2]))
    return dict(zip(POSE, [*(float(v) for v in T[:3, 3] * 1e3), *abc], strict=True))


def axis_values(q: Float[np.ndarray, " joints"]) -> dict[str, float]:
    """Values of A1 … of joint positions, degrees."""
    return dict(zip(AXES, np.degrees(q).tolist(), strict=False))


def _field_text(name: str, text: str, was: float, value: float) -> str:
    """A component's text with a value: as it is where that is its value already, to the digits that KRL holds."""
    if name in ("S", "T"):
        return text if was == value else _integer(text, int(value))
    return renumbered(text, was, value, DECIMALS[name])


def _integer(old: str, value: int) -> str:
    if old[:2].upper() == "'B":
        return f"{old[:2]}{value:0{len(old) - 3}b}'"
    if old[:2].upper() == "'H":
        return f"{old[:2]}{value:0{len(old) - 3}X}'"
    return str(value)


def edits_for(aggregate: Aggregate, values: Mapping[str, float]) -> list[Edit]:
    """The edits that give a position's components other values; those without a number of their own stay as they are."""
    out: list[Edit] = []
    for field in aggregate.fields:
        if field.name in values and field.value is not None:
            text = _field_text(field.name, field.text, field.value, values[field.name])
            if text != field.text:
                blank = " " if field.touches else ""
                out.append(Edit(start=field.start, end=field.end, text=blank + text))
    return out
