"""A kinematic chain as plain arrays: fixed parts, joints and error frames, in the order of the walk."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from taskcal.short_repr import short_repr

JointKind = Literal["revolute", "prismatic"]
"""Whether a joint turns or slides."""

FIXED, REVOLUTE, PRISMATIC, ERROR_FRAME = range(4)


@short_repr
@dataclass(frozen=True, eq=False)
class Fixed:
    """A fixed part of the chain."""

    transform: Float[np.ndarray, "4 4"]
    """Pose of the part's end in its start."""


@dataclass(frozen=True)
class Joint:
    """A joint about, or along, the local z axis."""

    kind: JointKind = "revolute"
    number: int | None = None
    """Chain coordinate that moves it; joints without a number are counted in the order they are met."""


@dataclass(frozen=True)
class ErrorFrame:
    """A small transform T(tx, ty, tz)·Rx·Ry·Rz, one parameter for each defect."""


Step = Fixed | Joint | ErrorFrame


class Steps(NamedTuple):
    """The arrays of a chain as the compiled passes take them; `Chain` says what each holds."""

    kind: Int[np.ndarray, " steps"]
    which: Int[np.ndarray, " steps"]
    fixed: Float[np.ndarray, "parts 12"]
    """Row by row."""


@dataclass(frozen=True, eq=False)
class Chain:
    """The steps of a walk from base to tool. Error frames, and joints without a number, are counted in the order they are met."""

    kind: Int[np.ndarray, " steps"]
    """FIXED, REVOLUTE, PRISMATIC or ERROR_FRAME."""
    index: Int[np.ndarray, " steps"]
    """Which fixed part, joint or error frame the step is."""
    fixed: Float[np.ndarray, "parts 3 4"]
    """Transforms of the fixed parts: rotation and translation, metres."""
    joints: int
    """Number of joints."""
    frames: int
    """Number of error frames."""

    @cached_property
    def steps(self) -> Steps:
        """For the compiled passes."""
        return Steps(self.kind, self.index, self.fixed.reshape(-1, 12))

    @cached_property
    def joint_columns(self) -> "Columns":
        """One column for each joint, none for error frames."""
        joints = np.arange(self.joints)
        return Columns(frames=np.empty((0, 6), dtype=np.int64), joint=joints, column=joints, count=self.joints)

    @classmethod
    def of(cls, steps: Sequence[Step]) -> "Chain":
        """Build the arrays; neighbouring fixed parts become one, identities none."""
        kinds: list[int] = []
        indices: list[int] = []
        fixed: list[np.ndarray] = []
        joints = counted = frames = 0
        pending = np.eye(4)

        def flush() -> None:
            nonlocal pending
            if not np.array_equal(pending, np.eye(4)):
                kinds.append(FIXED)
                indices.append(len(fixed))
                fixed.append(pending[:3])
                pending = np.eye(4)

        for step in steps:
            match step:
                case Fixed(transform):
                    pending = pending @ transform
                case Joint(kind, number):
                    flush()
                    kinds.append(REVOLUTE if kind == "revolute" else PRISMATIC)
                    indices.append(counted if number is None else number)
                    counted += number is None
                    joints += 1
                case ErrorFrame():
                    flush()
                    kinds.append(ERROR_FRAME)
                    indices.append(frames)
                    frames += 1
        flush()
        return cls(
            kind=np.array(kinds, dtype=np.int64),
            index=np.array(indices, dtype=np.int64),
            fixed=np.array(fixed, dtype=float).reshape(-1, 3, 4),
            joints=joints,
            frames=frames,
        )


# Which movement of a chain each column of a Jacobian belongs to.


class ColumnArrays(NamedTuple):
    """The arrays of `Columns` as the compiled passes take them."""

    frames: Int[np.ndarray, "frames 6"]
    joint: Int[np.ndarray, " pairs"]
    column: Int[np.ndarray, " pairs"]


@dataclass(frozen=True, eq=False)
class Columns:
    """Which column of the Jacobian each movement of the chain belongs to."""

    frames: Int[np.ndarray, "frames 6"]
    """Column of each error-frame parameter, −1 where it is not asked for."""
    joint: Int[np.ndarray, " pairs"]
    """Joint moved by the k-th joint-side pair …"""
    column: Int[np.ndarray, " pairs"]
    """… and the column it adds to; the factor ∂s/∂ξ comes with each pose."""
    count: int
    """Number of columns."""

    @cached_property
    def arrays(self) -> ColumnArrays:
        """For the compiled passes."""
        return ColumnArrays(self.frames, self.joint, self.column)
