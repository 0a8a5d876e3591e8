"""Which point belongs to which joints, by geometry alone, where rows were shuffled.

Points and tool positions have the same centre and the same spread in whatever order they stand. From there assignment and
registration take turns, as closest points do (Besl and McKay 1992), every point being given away once.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from taskcal.diagnosis.quick_fit import LEVER_SHARE
from taskcal.diagnosis.search import SOUND_SHARE
from taskcal.diagnosis.supposition import Case
from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.registration import register_closely

HEADINGS = 24
"""Directions in which a standing robot may face, that are tried."""

ROUNDS = 25
"""Of assignment and registration, from one start."""

MOST_ROWS = 300
"""For which it is tried: what an assignment costs grows with the cube of the rows."""

CLEARLY = 0.3
"""Of the distance to the nearest point of another row: paired rows are nearer, by the median."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Pairing:
    """The campaign with its measurements in the order of its joints."""

    mended: Campaign
    error: float
    """Median distance of the paired points from the registered robot, metres."""
    next_best: float
    """Median distance of a point from the nearest place of another row, metres."""
    source: Int[np.ndarray, " n"]
    """Row in which each row's measurements stood."""

    @property
    def moved(self) -> Int[np.ndarray, " k"]:
        """Rows that had the measurements of others."""
        return np.flatnonzero(self.source != np.arange(len(self.source)))

    @property
    def clear(self) -> bool:
        """Whether points are much nearer to their own place than to any other."""
        return self.error < CLEARLY * self.next_best


def pair_rows(case: Case) -> Pairing | None:
    """The only order of the measurements that fits the joints; None where none does, or several might."""
    campaign = case.campaign
    T = case.poses(np.arange(len(campaign)))
    whole = campaign.valid.all(axis=1)
    if not whole.all() or not np.isfinite(T).all() or not 8 <= len(campaign) <= MOST_ROWS:
        return None
    best: Pairing | None = None
    for Z in _starts(T, campaign):
        found = _descend(Z, T, campaign, LEVER_SHARE * case.model.robot.reach)
        if found is not None and (best is None or found.error < best.error):
            best = found
            if best.clear and best.error < SOUND_SHARE * case.model.robot.reach:
                break
    return best if best is not None and best.clear else None


def rearranged(campaign: Campaign, source: Int[np.ndarray, " n"]) -> Campaign:
    """The campaign with the measurements of row ``source[i]`` at row i."""
    return replace(
        campaign,
        points=campaign.points[source],
        rotations=None if campaign.rotations is None else campaign.rotations[source],
        uncertainty=None if campaign.uncertainty is None else campaign.uncertainty[source],
        reference_points={name: places[source] for name, places in campaign.reference_points.items()},
    )


def _starts(T: Float[np.ndarray, "n 4 4"], campaign: Campaign) -> list[Float[np.ndarray, "3 3"]]:
    """Rotations that bring the main axes of positions and points together, and those of a robot that stands."""
    p, y = T[:, :3, 3], campaign.points.mean(axis=1)
    axes = [np.linalg.svd(x - x.mean(axis=0), full_matrices=False)[2].T for x in (p, y)]
    out: list[np.ndarray] = []
    for signs in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)):
        Z = axes[1] @ np.diag(signs) @ axes[0].T
        out.append(Z * np.sign(np.linalg.det(Z)))
    angles = np.arange(HEADINGS) * 2.0 * np.pi / HEADINGS
    return [*out, *se3.turns("z", angles[:, None])]


def _descend(Z: np.ndarray, T: np.ndarray, campaign: Campaign, lever: float) -> Pairing | None:
    """The order where the search ends that starts from one rotation; None where it does not come to an end."""
    from scipy.optimize import linear_sum_assignment

    p, y = T[:, :3, 3], campaign.points
    ends = ((p - p.mean(axis=0)) @ Z.T)[:, None] + y.mean(axis=0)
    turned: np.ndarray | None = None
    source = np.arange(0)
    for _ in range(ROUNDS):
        square = ((ends[:, None] - y[None]) ** 2).sum(axis=3).mean(axis=2)
        if turned is not None and campaign.rotations is not None:
            square = square + lever**2 * 0.5 * ((turned[:, None] - campaign.rotations[None]) ** 2).sum(axis=(2, 3))
        apart = np.sqrt(square)
        # distances, not their squares: a pair that is wrong pulls no harder for being farther off
        chosen = linear_sum_assignment(apart)[1]
        error = float(np.median(apart[np.arange(len(T)), chosen]))
        if len(source) and (chosen == source).all():
            others = np.sort(apart, axis=1)[:, 1]
            mended = rearranged(campaign, source)
            return Pairing(mended=mended, error=error, next_best=float(np.median(others)), source=source)
        source = chosen
        try:
            registration = register_closely(rearranged(campaign, source), T)
        except (CampaignError, np.linalg.LinAlgError):
            return None
        placed = (registration.T_tracker_base @ T)[:, None] @ registration.T_tool_target
        ends, turned = placed[..., :3, 3], placed[:, 0, :3, :3]
    return None
