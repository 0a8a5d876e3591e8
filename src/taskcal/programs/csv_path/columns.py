"""What the columns of a path in CSV mean."""

import re
from collections.abc import Mapping
from dataclasses import dataclass

from taskcal.robot.robot import Robot
from taskcal.tabular.column_groups import POSITION, QUATERNION, ColumnGroups, joint_scale

AXIS = ("i", "j", "k")
WORDS = ("id", "name", "move", "speed_mm_s", "stop", "tool", "frame")

_NUMBERED = re.compile(r"[jq](\d+)_(deg|rad|mm|m)$")


@dataclass(frozen=True, kw_only=True)
class Columns:
    """Which columns a path has; names as the file writes them."""

    position: tuple[str, ...]
    """x, y, z; empty where the path has joint positions only."""
    rotation: tuple[str, ...]
    """Four of a quaternion, or three of the tool's axis."""
    joints: tuple[str, ...]
    """In the robot's order; empty where there are none."""
    joint_scale: tuple[float, ...]
    """What a joint's number is multiplied by for radians or metres."""
    words: Mapping[str, str]
    """The others: names in the file by their meaning."""

    @property
    def only_axis(self) -> bool:
        """The rotation about the tool's axis is left open."""
        return len(self.rotation) == 3

    @property
    def pose(self) -> tuple[str, ...]:
        """Those of a pose."""
        return self.position + self.rotation


def columns_of(groups: ColumnGroups, robot: Robot | None) -> Columns:
    """The columns of a path.

    Raises:
        FileError: one is not known, is lacking, or its unit is not stated; two mean the same.
    """
    joints = _numbered_joints(groups) if robot is None else groups.joint_columns(robot)
    position, quaternion, axis = (groups.together(names) for names in (POSITION, QUATERNION, AXIS))
    words = {word: column for word in WORDS for column in groups.together([word])}
    groups.refuse_unused(
        f"a path has {' '.join(POSITION)} with {' '.join(QUATERNION)} or the tool axis {' '.join(AXIS)}, or joints such as J1_deg, "
        f"and optionally {', '.join(WORDS)}"
    )
    if quaternion and axis:
        raise groups.refusal("has both a quaternion and a tool axis; keep one of them")
    if position and not (quaternion or axis):
        raise groups.refusal("has positions without the tool's orientation; add qx qy qz qw, or the tool axis i j k")
    if (quaternion or axis) and not position:
        raise groups.refusal("has orientations without positions; add x_mm y_mm z_mm")
    if not position and not joints:
        raise groups.refusal("has neither positions x_mm y_mm z_mm nor joints such as J1_deg")
    return Columns(
        position=position,
        rotation=quaternion or axis,
        joints=joints,
        joint_scale=tuple(joint_scale(joints).tolist()),
        words=words,
    )


def _numbered_joints(groups: ColumnGroups) -> tuple[str, ...]:
    """The joints' columns in the order of their numbers, where no robot is known."""
    numbered = {int(match[1]): name for lower, name in groups.names.items() if (match := _NUMBERED.match(lower))}
    lacking = [i for i in range(1, max(numbered, default=0) + 1) if i not in numbered]
    if lacking:
        raise groups.refusal(f"has no column for joint {lacking[0]}, such as J{lacking[0]}_deg")
    return groups.together([numbered[i] for i in sorted(numbered)])
