"""Names of poses and of targets in one: ``P12_T1``."""

import re
from collections.abc import Sequence

_PARTED = re.compile(r"(?P<pose>.*[^\s_\-./:])(?:::|[\s_\-./:])(?P<target>[^\s_\-./:]+)")

MOST_TARGETS = 20
"""On one tool; more names are those of something else."""


def split_names(names: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]] | None:
    """Pose and target of each name; None where names do not consist of both throughout.

    All names differ, and `are_poses_and_targets`.
    """
    matches = [_PARTED.fullmatch(name) for name in names]
    if not names or None in matches:
        return None
    poses = tuple(match["pose"] for match in matches if match)
    targets = tuple(match["target"] for match in matches if match)
    return (poses, targets) if are_poses_and_targets(poses, targets) else None


def parts_of_names(names: Sequence[str]) -> tuple[tuple[str, ...] | None, tuple[str, ...]] | None:
    """Group and point of names such as ``Collection::Group::P1``; None where one is written otherwise.

    Parts that are the same in all names are left out: no group is left where only one part differs.
    """
    if not names or "::" not in names[0]:
        return None
    parts = [name.split("::") for name in names]
    if any(len(part) != len(parts[0]) or not all(part) for part in parts):
        return None
    columns = [column for column in zip(*parts, strict=True) if len(set(column)) > 1]
    if len(columns) < 2:
        return None, columns[0] if columns else tuple(part[-1] for part in parts)
    return tuple(map(" ".join, zip(*columns[:-1], strict=True))), columns[-1]


def each_in_most(poses: Sequence[str], targets: Sequence[str]) -> bool:
    """Whether there are several poses, at most `MOST_TARGETS` targets and two at least, and each target is in most poses."""
    seen_in: dict[str, set[str]] = {}
    for pose, target in zip(poses, targets, strict=True):
        seen_in.setdefault(target, set()).add(pose)
    count = len(set(poses))
    return 2 <= len(seen_in) <= MOST_TARGETS and count > 1 and min(map(len, seen_in.values())) > count / 2


def are_poses_and_targets(poses: Sequence[str], targets: Sequence[str]) -> bool:
    """Whether no target stands twice in a pose, and `each_in_most`."""
    return len(set(zip(poses, targets, strict=True))) == len(poses) and each_in_most(poses, targets)
