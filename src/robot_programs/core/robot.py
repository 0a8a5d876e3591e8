"""What a reader of programs asks of the robot that it is given; any object that has it will do."""

from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float


@runtime_checkable
class Robot(Protocol):
    """A serial robot as it was designed; joint positions are the controller's, in radians or metres."""

    @property
    def name(self) -> str:
        """For messages."""
        ...

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Of its joints, in order from the base."""
        ...

    @property
    def prismatic(self) -> tuple[bool, ...]:
        """Which joints slide."""
        ...

    @property
    def limits(self) -> Float[np.ndarray, "joints 2"]:
        """Lower and upper limit of every joint."""
        ...

    @property
    def has_linkage(self) -> bool:
        """Whether a linkage moves joints with others, such as a parallel rod that drives the forearm."""
        ...

    @property
    def T_flange_tool(self) -> Float[np.ndarray, "4 4"]:
        """Pose of its own tool in the flange in which the controller counts tools, metres."""
        ...

    def joint_frames(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n joints 4 4"]:
        """Frames in the base that each joint turns about their z axes, or moves along them; behind the joint, metres."""
        ...

    def tool_poses(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 4 4"]:
        """Poses of its own tool in the base, metres."""
        ...
