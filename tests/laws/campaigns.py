"""Simulated campaigns: what a tracker would measure on a robot whose defects, frame and targets are known."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from taskcal.campaigns.campaign import Campaign
from taskcal.robot.error_model import ErrorModel


@dataclass(frozen=True, eq=False, kw_only=True)
class Truth:
    """What a simulated campaign was made from."""

    x: np.ndarray
    T_tracker_base: np.ndarray
    T_tool_target: np.ndarray


def random_pose(rng: np.random.Generator, size: float) -> np.ndarray:
    """Any rotation, a translation within ±size."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_quat(rng.normal(size=4)).as_matrix()
    T[:3, 3] = rng.uniform(-size, size, 3)
    return T


def measure(
    rng: np.random.Generator,
    model: ErrorModel,
    q: np.ndarray,
    x: np.ndarray | None = None,
    *,
    targets: int = 1,
    pose: bool = False,
    sigma: float = 0.0,
    rotation_sigma: float = 0.0,
    lost: float = 0.0,
    uncertainty: float | None = None,
) -> tuple[Campaign, Truth]:
    """A campaign of one tool reflector, several, or poses, with white noise of `sigma` metres per axis."""
    x = np.zeros(len(model)) if x is None else x
    base = random_pose(rng, 4.0)
    tools = np.stack([random_pose(rng, 0.15) for _ in range(targets)])
    if not pose:
        tools[:, :3, :3] = np.eye(3)
    ends = base @ model.poses(q, x)[:, None] @ tools
    points = ends[..., :3, 3] + rng.normal(scale=sigma, size=(len(q), targets, 3)) * (sigma > 0)
    rotations = None
    if pose:
        noise = Rotation.from_rotvec(rotation_sigma * rng.normal(size=(len(q), 3))).as_matrix()
        rotations = noise @ ends[:, 0, :3, :3]
    points[rng.random((len(q), targets)) < lost] = np.nan
    names = ("tool",) if targets == 1 else tuple(f"smr{t + 1}" for t in range(targets))
    campaign = Campaign(
        ids=tuple(str(i) for i in range(len(q))), q=q, targets=names, points=points, rotations=rotations,
        uncertainty=None if uncertainty is None else np.full((len(q), targets), uncertainty),
    )  # fmt: skip
    return campaign, Truth(x=x, T_tracker_base=base, T_tool_target=tools)


def with_points(campaign: Campaign, points: np.ndarray) -> Campaign:
    return replace(campaign, points=points)


def with_conditions(campaign: Campaign, **changed: np.ndarray | None) -> Campaign:
    """The campaign with some of its conditions changed."""
    return replace(campaign, conditions=replace(campaign.conditions, **changed))
