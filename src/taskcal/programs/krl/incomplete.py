"""Points that do not state all their components, and motions by a distance: both count from where the motion before ended.

A component that a point leaves out keeps the value that it has there (KUKA System Software, programming of motions to points);
``LIN_REL`` and ``PTP_REL`` add theirs to it, along the base's axes, or with ``#TOOL`` along the tool's. Both points of ``CIRC_REL``
count from where the arc begins (KUKA.PLC mxAutomation as in Beckhoff TF5120, KRC_MoveCircRelative).
"""

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.programs.krl.position import AXES, EXTERNAL, POSE, axes, has_pose, pose, pose_values, rotation_stated
from taskcal.programs.krl.syntax import Aggregate
from taskcal.programs.program import Move
from taskcal.programs.unresolved import Unresolved

UNKNOWN = "it counts from where the motion before ended, and that is not known"


def is_incomplete(aggregate: Aggregate) -> bool:
    """Whether components of a pose, or axes, are left out."""
    names = POSE if has_pose(aggregate) else AXES
    return not all(aggregate.field(name) for name in names)


def completed_axes(aggregate: Aggregate, before: Move | None) -> Float[np.ndarray, " joints"]:
    """Joint positions, those left out as they were, radians.

    Raises:
        Unresolved: where the motion before ended is not known by its joints.
    """
    if not is_incomplete(aggregate):
        return axes(aggregate)
    if before is None or before.end.q is None:
        missing = next(name for name in AXES if not aggregate.field(name))
        raise Unresolved(f"{missing} is not stated, and {UNKNOWN}")
    return np.where([aggregate.field(name) is not None for name in AXES], axes(aggregate, needed=()), before.end.q)


def completed_pose(aggregate: Aggregate, before: Move | None) -> Float[np.ndarray, "4 4"]:
    """A pose, what is left out as it was; either all of A, B and C are, or none.

    Args:
        aggregate: the point.
        before: the motion before, with the same tool and base.

    Raises:
        Unresolved: it is not known where that ended, or only some of the angles are stated.
    """
    if not is_incomplete(aggregate):
        return pose(aggregate)
    if before is None or before.end.T is None:
        missing = next(name for name in POSE if not aggregate.field(name))
        raise Unresolved(f"{missing} is not stated, and {UNKNOWN}")
    oriented = rotation_stated(aggregate)
    kept = pose_values(before.end.T)
    position = [kept[name] if aggregate.field(name) is None else None for name in "XYZ"]
    T = pose(aggregate, needed=())
    xyz = [own if old is None else old * 1e-3 for own, old in zip(T[:3, 3], position, strict=True)]
    return se3.pose(T[:3, :3] if oriented else before.end.T[:3, :3], np.array(xyz))


def moved_pose(step: Float[np.ndarray, "4 4"], before: Move | None, *, by_tool: bool) -> Float[np.ndarray, "4 4"]:
    """Where a motion by a distance ends.

    Args:
        step: the distance, metres.
        before: the motion before, with the same tool and base.
        by_tool: whether it is along the tool's axes.

    Raises:
        Unresolved: it is not known where it begins, or it turns, too.
    """
    if before is None or before.end.T is None:
        raise Unresolved(UNKNOWN)
    if np.abs(step[:3, :3] - np.eye(3)).max() > 0.0:
        raise Unresolved("it turns the tool by angles that are not added here; write a motion to a complete point")
    T = before.end.T.copy()
    T[:3, 3] += T[:3, :3] @ step[:3, 3] if by_tool else step[:3, 3]
    return T


def refuse_moved_axes(aggregate: Aggregate) -> None:
    """Let no external axis be moved by a distance, which would be taken for its position.

    Raises:
        Unresolved: one is.
    """
    for name in EXTERNAL:
        if aggregate.field(name) and aggregate.value(name) != 0.0:
            raise Unresolved(
                f"it moves {name} by a distance that is not added here; write a motion to a complete point"
            )


def moved_axes(aggregate: Aggregate, before: Move | None) -> Float[np.ndarray, " joints"]:
    """Where a motion by angles of the axes ends.

    Raises:
        Unresolved: it is not known by its joints where it begins.
    """
    if before is None or before.end.q is None:
        raise Unresolved(UNKNOWN)
    return before.end.q + axes(aggregate, needed=())
