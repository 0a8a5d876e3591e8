"""Where the tools and parts of a program are on a robot: as calibrated, or as it truly is."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from taskcal.geometry import se3

PosesAlong = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""From joint positions (n, joints), each in a motion (n) at a share of its length (n), to poses (n, 4, 4) of the robot's own
tool in its base."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Placement:
    """Where what the robot holds and what stands still are."""

    T_tool_grasped: Float[np.ndarray, "4 4"]
    """What is held, in the robot's own tool."""
    T_base_fixed: Float[np.ndarray, "4 4"]
    """What stands still, in the base."""
    part_in_hand: bool
    """The part is held, and the tool stands still."""

    def tool_in_part(self, T_base_tool: Float[np.ndarray, "n 4 4"]) -> Float[np.ndarray, "n 4 4"]:
        """Poses of the program's tool in its part for poses of the robot's own tool in the base."""
        X = se3.inverse(self.T_base_fixed) @ T_base_tool @ self.T_tool_grasped
        return se3.inverse(X) if self.part_in_hand else X

    def robot_tool(self, T: Float[np.ndarray, "n 4 4"]) -> Float[np.ndarray, "n 4 4"]:
        """Poses of the robot's own tool for poses of the program's tool in its part: the inverse of `tool_in_part`."""
        X = se3.inverse(T) if self.part_in_hand else T
        return self.T_base_fixed @ X @ se3.inverse(self.T_tool_grasped)


@dataclass(frozen=True, eq=False, kw_only=True)
class Placed:
    """The motions of a program on a robot, with where their tools and parts are."""

    tool_in_base: PosesAlong
    placements: tuple[Placement, ...]
    number: Int[np.ndarray, " m"]
    """Number of every motion's placement."""

    def tool_in_part(
        self, move: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"], q: Float[np.ndarray, "k joints"]
    ) -> Float[np.ndarray, "k 4 4"]:
        """Poses of the program's tool in its part, for joint positions in some motions at shares of their lengths."""
        B = self.tool_in_base(q, move, share)
        out = np.empty_like(B)
        for rows, placement in self._rows(move):
            out[rows] = placement.tool_in_part(B[rows])
        return out

    def robot_tool(self, move: Int[np.ndarray, " k"], T: Float[np.ndarray, "k 4 4"]) -> Float[np.ndarray, "k 4 4"]:
        """Poses of the robot's own tool in the base, for poses of the program's tool in its part."""
        out = np.empty_like(T)
        for rows, placement in self._rows(move):
            out[rows] = placement.robot_tool(T[rows])
        return out

    def _rows(self, move: Int[np.ndarray, " k"]) -> list[tuple[Int[np.ndarray, " _"], Placement]]:
        own = self.number[move]
        return [(np.flatnonzero(own == k), self.placements[k]) for k in np.unique(own)]
