"""User frames and tools by number: from a backup's variables, or given with the program."""

from collections.abc import Mapping, Set
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from taskcal.errors import TaskcalError
from taskcal.geometry import se3, walk
from taskcal.geometry.chain import Chain, Joint, Step
from taskcal.programs.program import Frame
from taskcal.programs.tp.variables import Variables
from taskcal.programs.unresolved import Unresolved
from taskcal.robot.robot import Robot

PARALLEL = 1e-6
"""Sine of the angle between two axes below which they are parallel."""


def world_in_base(robot: Robot) -> Float[np.ndarray, "4 4"]:
    """FANUC's world frame in the robot's base: on axis 1, at the height of axis 2, turned like the base.

    That is the frame from which ROS-Industrial's descriptions of FANUC's robots count the manufacturer's coordinates, too.

    Raises:
        TaskcalError: axes 1 and 2 do not cross, so that there is no such place.
    """
    if len(robot.joints) < 2 or any(robot.prismatic[:2]):
        raise TaskcalError(f"{robot.name} has no two turning axes at its base, where FANUC's world frame would be")
    steps: list[Step] = []
    frames: list[np.ndarray] = []
    for joint in robot.joints[:2]:
        steps += [part.step for part in joint.before]
        steps.append(Joint("revolute"))
        frames.append(walk.poses(Chain.of(steps), np.zeros((1, len(frames) + 1)), np.zeros((0, 6)))[0])
        steps += [part.step for part in joint.after]
    first, second = frames
    common = np.cross(first[:3, 2], second[:3, 2])
    if np.linalg.norm(common) < PARALLEL:
        raise TaskcalError(
            f"axes 1 and 2 of {robot.name} are parallel; FANUC's world frame of such an arm is not known here"
        )
    # along axis 1 to the foot of the line that is perpendicular to both axes
    between = second[:3, 3] - first[:3, 3]
    along = np.linalg.det(np.stack([between, second[:3, 2], common])) / (common @ common)
    return se3.pose(np.eye(3), first[:3, 3] + along * first[:3, 2])


@dataclass(frozen=True, eq=False, kw_only=True)
class Frames:
    """Frames of a program; each is made once, so that one frame is one object."""

    variables: Variables
    T_base_world: Float[np.ndarray, "4 4"]
    changed_frames: Set[int | None]
    """User frames that the program sets itself; None for any."""
    changed_tools: Set[int | None]
    tool: Frame | None
    """For all tools that the variables do not state."""
    part: Frame | None
    """For all user frames that the variables do not state; in the world."""
    made: dict[tuple[str, int], Frame] = field(default_factory=dict[tuple[str, int], Frame])

    def user_frame(self, number: int) -> Frame:
        """A user frame, in the base.

        Raises:
            Unresolved: it is not known.
        """
        made = self.made.get(("UFRAME", number))
        if made is None:
            frame = self._frame("UFRAME", number, self.variables.frames, self.part, self.changed_frames)
            made = self.made["UFRAME", number] = replace(frame, T=self.T_base_world @ frame.T)
        return made

    def tool_frame(self, number: int) -> Frame:
        """A tool, in the flange.

        Raises:
            Unresolved: it is not known.
        """
        made = self.made.get(("UTOOL", number))
        if made is None:
            made = self.made["UTOOL", number] = self._frame(
                "UTOOL", number, self.variables.tools, self.tool, self.changed_tools
            )
        return made

    def _frame(
        self,
        kind: str,
        number: int,
        stated: Mapping[int, Float[np.ndarray, "4 4"]],
        given: Frame | None,
        changed: Set[int | None],
    ) -> Frame:
        if {number, None} & changed:
            raise Unresolved(f"{kind}[{number}] is set in the program, to what is known only at run time")
        T = np.eye(4) if number == 0 else stated.get(number)
        if T is None:
            if given is not None:
                return given
            option = "--part" if kind == "UFRAME" else "--tool"
            raise Unresolved(
                f"{kind} {number} is not known; pass the backup's sysframe.va with the program, or name one of the cell file "
                f"({option})"
            )
        return Frame(name=f"{kind} {number}", T=T)
