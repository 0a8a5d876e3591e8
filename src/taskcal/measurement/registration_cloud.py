"""Measured points beside the tool poses at which they were measured: what a registration is found from."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.measurement.campaign import Campaign
from taskcal.measurement.registration_moments import Moments


@dataclass(frozen=True, eq=False, kw_only=True)
class Cloud:
    """Every target that was seen at a row is a point."""

    R: Float[np.ndarray, "n 3 3"]
    """Rotation of the tool."""
    p: Float[np.ndarray, "n 3"]
    """Position of the tool, metres."""
    y: Float[np.ndarray, "n 3"]
    """The point as measured, metres."""
    target: Int[np.ndarray, " n"]
    """Number of its target."""
    row: Int[np.ndarray, " n"]
    """Row of the campaign."""
    count: int
    """Of targets."""
    Y: Float[np.ndarray, "n 3 3"] | None = None
    """Measured rotations, for poses."""

    @classmethod
    def of(cls, T: Float[np.ndarray, "rows 4 4"], campaign: Campaign) -> "Cloud":
        """All that was seen, with poses T of the tool in the base."""
        row, target = np.nonzero(campaign.valid)
        at = T if len(row) == len(T) and campaign.valid.shape[1] == 1 else T[row]
        return cls(
            R=np.ascontiguousarray(at[:, :3, :3]),
            p=np.ascontiguousarray(at[:, :3, 3]),
            y=campaign.points[row, target],
            target=target,
            row=row,
            count=len(campaign.targets),
            Y=None if campaign.rotations is None else campaign.rotations[row],
        )

    def take(self, points: Bool[np.ndarray, " n"]) -> "Cloud":
        """Some of the points."""
        if points.all():
            return self
        return Cloud(
            R=self.R[points],
            p=self.p[points],
            y=self.y[points],
            target=self.target[points],
            row=self.row[points],
            count=self.count,
            Y=None if self.Y is None else self.Y[points],
        )

    @property
    def shows_all(self) -> bool:
        """Whether every target was seen."""
        return bool(np.bincount(self.target, minlength=self.count).all())

    @cached_property
    def moments(self) -> Moments:
        """Sums that say all of how a tracker frame and targets fit."""
        return Moments.of(self.R, self.p, self.y, self.target, self.count)

    def residual(
        self, Z: Float[np.ndarray, "3 3"], t: Float[np.ndarray, " 3"], offsets: Float[np.ndarray, "targets 3"]
    ) -> Float[np.ndarray, "n 3"]:
        """What a tracker frame and targets leave of the points: y − Z·(p + R·o) − t, metres."""
        local = self.R @ offsets[0] if self.count == 1 else (self.R @ offsets[self.target][:, :, None])[:, :, 0]
        return self.y - (self.p + local) @ Z.T - t
