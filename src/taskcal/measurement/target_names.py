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


def are_poses_and_targets(poses: Sequence[str], targets: Sequence[str]) -> bool:
    """Whether no target stands twice in a pose, there are two at least, and each is in most poses."""
    kinds, count = set(targets), len(set(poses))
    if len(set(zip(poses, targets, strict=True))) < len(poses):
        return False
    return 2 <= len(kinds) <= MOST_TARGETS and count > 1 and min(map(targets.count, kinds)) > count / 2
