"""Repeatability from a campaign that measured some poses more than once."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import CampaignError
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.pose_performance import PosePerformance, assess_pose, mean_and_three_deviations
from taskcal.short_repr import short_repr

SAME_POSE_RAD = float(np.radians(0.01))
"""Joint positions within this of each other are one pose, radians."""

NORMAL_REPEATABILITY = float(2.0 * np.sqrt(2.0 / np.pi) + 3.0 * np.sqrt(3.0 - 8.0 / np.pi))
"""RP_l of many cycles over the standard deviation of each coordinate, where the noise is normal and the same in all
directions: mean and three standard deviations of the Maxwell distribution, 3.616."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class RepeatedPoses:
    """The poses of a campaign that were measured more than once."""

    rows: tuple[tuple[int, ...], ...]
    """Rows of the campaign that each pose was measured in."""
    performances: tuple[tuple[PosePerformance, ...], ...]
    """For each pose, the repeatability of every target that was seen there more than once."""
    joint_spread: Float[np.ndarray, " poses"]
    """Largest difference of a joint between the rows of a pose, radians."""

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def repeatability(self) -> Float[np.ndarray, " poses"]:
        """RP_l of each pose, mean of its targets, metres (ISO 9283:1998, 7.2.2)."""
        return np.array(
            [np.mean([mean_and_three_deviations(target.distances) for target in pose]) for pose in self.performances]
        )

    @property
    def deviation(self) -> float:
        """Standard deviation of a coordinate about its pose's mean, of all poses and targets together, metres."""
        every = [target for pose in self.performances for target in pose]
        squares = sum(float(np.sum(target.distances**2)) for target in every)
        return float(np.sqrt(squares / (3 * sum(target.cycles - 1 for target in every))))

    @property
    def expected_repeatability(self) -> float:
        """RP_l that many cycles would show if each coordinate were normal with `deviation`, metres.

        A pose of few cycles shows less: with two, RP_l is half their distance.
        """
        return NORMAL_REPEATABILITY * self.deviation

    def summary(self) -> dict[str, float | int]:
        """The repeatability in millimetres and degrees."""
        values = self.repeatability * 1e3
        return {
            "poses": len(self),
            "rows": sum(len(rows) for rows in self.rows),
            "RP_l_mean_mm": float(values.mean()),
            "RP_l_median_mm": float(np.median(values)),
            "RP_l_max_mm": float(values.max()),
            "deviation_mm": self.deviation * 1e3,
            "expected_RP_l_mm": self.expected_repeatability * 1e3,
            "joint_spread_deg": float(np.degrees(self.joint_spread.max())),
        }


def group_postures(q: Float[np.ndarray, "n joints"], same: float) -> Int[np.ndarray, " n"]:
    """The posture of every row, counted from 0: rows that differ by `same` at most in every joint, and chains of such rows.

    Args:
        q: joint positions, radians (metres where a joint slides).
        same: in the same units.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    pairs = KDTree(q).query_pairs(same, p=np.inf, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(q), len(q)))
    return connected_components(graph, directed=False)[1]


def pose_repeatability(campaign: Campaign, *, same: float = SAME_POSE_RAD) -> RepeatedPoses:
    """Repeatability at the poses that a campaign measured more than once (ISO 9283:1998, 7.2.2).

    It contains the tracker's noise, and what the recorded joints of a pose differ by.

    Args:
        campaign: measurements; points or poses.
        same: rows belong to one pose if no joint differs by more, radians (metres where a joint slides).

    Raises:
        CampaignError: no pose was measured twice.
    """
    label = group_postures(campaign.q, same)
    rows: list[tuple[int, ...]] = []
    performances: list[tuple[PosePerformance, ...]] = []
    joint_ranges: list[float] = []
    for pose in np.flatnonzero(np.bincount(label) > 1):
        chosen = np.flatnonzero(label == pose)
        targets = tuple(
            _of_target(campaign, seen, t)
            for t in range(len(campaign.targets))
            if len(seen := chosen[campaign.valid[chosen, t]]) > 1
        )
        if targets:
            rows.append(tuple(int(row) for row in chosen))
            performances.append(targets)
            joint_ranges.append(float(np.ptp(campaign.q[chosen], axis=0).max()))
    if not rows:
        raise CampaignError(
            f"no two of the {len(campaign)} rows measured one pose, with joints within {np.degrees(same):g}°; "
            "repeatability needs poses that recur"
        )
    return RepeatedPoses(rows=tuple(rows), performances=tuple(performances), joint_spread=np.array(joint_ranges))


def _of_target(campaign: Campaign, rows: np.ndarray, target: int) -> PosePerformance:
    rotations = None if campaign.rotations is None else campaign.rotations[rows]
    return assess_pose(campaign.points[rows, target], rotations=rotations)
