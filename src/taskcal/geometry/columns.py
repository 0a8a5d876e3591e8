"""Which movement of a chain each column of a Jacobian belongs to."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Int

from taskcal.geometry.chain import Chain


class Layout(NamedTuple):
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
    def arrays(self) -> Layout:
        """For the compiled passes."""
        return Layout(self.frames, self.joint, self.column)

    @cached_property
    def fills(self) -> bool:
        """Whether every column belongs to something."""
        return int(np.count_nonzero(self.frames >= 0)) + len(np.unique(self.column)) == self.count

    @classmethod
    def of_joints(cls, chain: Chain) -> "Columns":
        """One column for each joint of the chain, none for error frames."""
        joints = np.arange(chain.joints)
        return cls(frames=np.full((chain.frames, 6), -1), joint=joints, column=joints, count=chain.joints)
