"""Everything that ISO 9283:1998, clauses 7.2 and 7.3, says of a set of poses measured in cycles."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from taskcal.errors import CampaignError, UnknownName
from taskcal.measurement.cycles import PoseCycles
from taskcal.measurement.distance_performance import DistancePerformance, assess_distance
from taskcal.measurement.pose_performance import DirectionVariation, PosePerformance, assess_pose, compare_directions
from taskcal.short_repr import short_repr


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class CyclePerformance:
    """Poses, directions of approach, and distances."""

    poses: Mapping[tuple[str, str], PosePerformance]
    """By pose and direction of approach."""
    directions: Mapping[str, DirectionVariation]
    """By pose, for those approached from several directions."""
    distances: Mapping[tuple[str, str, str], DistancePerformance]
    """By first pose, second pose and direction of approach."""

    def summary(self) -> dict[str, list[dict[str, Any]]]:
        """All of it in millimetres and degrees; a direction is named where there is one."""
        return {
            "poses": [
                {"pose": pose, **_direction(direction), **of_pair.summary()}
                for (pose, direction), of_pair in self.poses.items()
            ],
            "directions": [{"pose": pose, **of_pair.summary()} for pose, of_pair in self.directions.items()],
            "distances": [
                {"from": first, "to": second, **_direction(direction), **of_pair.summary()}
                for (first, second, direction), of_pair in self.distances.items()
            ],
        }


def assess_cycles(cycles: Sequence[PoseCycles], distances: Iterable[tuple[str, str]] | None = None) -> CyclePerformance:
    """Accuracy and repeatability of poses and of distances between them, and what the direction of approach changes.

    A distance is taken in the cycles that two poses have in common, for each direction that both were approached from.

    Args:
        cycles: the poses, as `read_pose_cycles` returns them.
        distances: pairs of poses; by default each pose and the next, as far as they have commands and common cycles.

    Raises:
        CampaignError: a distance that was asked for has no commands or no cycles in common.
        UnknownName: a pose that was asked for is not there.
    """
    poses = {
        (one.pose, one.direction): assess_pose(
            one.attained, one.commanded, rotations=one.rotations, commanded_rotation=one.commanded_rotation
        )
        for one in cycles
    }
    names = list(dict.fromkeys(one.pose for one in cycles))
    by_pose = {name: [performance for (pose, _), performance in poses.items() if pose == name] for name in names}
    between: dict[tuple[str, str, str], DistancePerformance] = {}
    for first, second in pairwise(names) if distances is None else distances:
        for name in (first, second):
            if name not in names:
                raise UnknownName("pose", name, names)
        of_pair = _between(cycles, first, second)
        if distances is not None and not of_pair:
            raise CampaignError(
                f"poses '{first}' and '{second}' have no distance: it needs both commands (command_x_mm …), and cycles that "
                "were measured at both, from the same direction"
            )
        between |= of_pair
    return CyclePerformance(
        poses=poses,
        directions={name: compare_directions(several) for name, several in by_pose.items() if len(several) > 1},
        distances=between,
    )


def _between(cycles: Sequence[PoseCycles], first: str, second: str) -> dict[tuple[str, str, str], DistancePerformance]:
    """The distance of two poses for each direction that they have in common."""
    out: dict[tuple[str, str, str], DistancePerformance] = {}
    ends = [(a, b) for a in cycles if a.pose == first for b in cycles if b.pose == second]
    for a, b in ends:
        common = [name for name in a.cycles if name in b.cycles]
        if a.direction == b.direction and common and a.commanded is not None and b.commanded is not None:
            out[first, second, a.direction] = assess_distance(
                a.attained[[a.cycles.index(name) for name in common]],
                b.attained[[b.cycles.index(name) for name in common]],
                a.commanded,
                b.commanded,
            )
    return out


def _direction(name: str) -> dict[str, str]:
    return {"direction": name} if name else {}
