"""A kind of observation: the height of the tool's tip over a plate, as a dial gauge or a laser sensor on the plate shows it."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.observations import Placed, Planes, Read, refer

RESOLUTION = 1e-5
"""1σ of a height where the campaign does not say, metres: that of a dial gauge."""

STROKE = 0.01
"""Heights in a virtual cell are up to this, metres."""

FEWEST = 6
"""Heights over a plate, to find it beside the tip."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Heights(Planes):
    """h = n·p − d: how far the tip p is above a plate with unknown normal n and offset d; a touch is a height of zero."""

    key = "height"
    instrument = "gauge"
    touched = False
    needed = ("height",)
    label = "plate"
    columns = {"height": ("height", "gauge height"), "plate": ("plate",)}  # noqa: RUF012

    @property
    def unknowns(self):
        """Normal and offset of every plate."""
        return tuple(f"plate {name}.{c}" for name in self.planes for c in ("nx", "ny", "nz", "offset"))

    @property
    def tells_scale(self):
        """Heights are lengths."""
        return True

    @property
    def shrinks(self):
        """A robot of no size shows no heights."""
        return False

    def differentiate(self, target, unknown, measured):
        """A touch's, with a height in place of none."""
        touch = super().differentiate(target, unknown, measured)
        return touch._replace(residual=touch.residual + measured.points[:, :1])

    def covariance(self, measured, uncertainty, tracker):
        """Of the noise of each row."""
        deviation = np.full(len(measured.points), RESOLUTION) if uncertainty is None else uncertainty
        return deviation[:, None, None] ** 2

    def settle(self, target, measured, known):
        """Plates where the tip is known: linear in normal and offset. NaN for those that no row shows."""
        out = np.full((len(self.planes), 4), np.nan)
        for number in range(len(self.planes)):
            own = (self.numbers == number) & measured.valid
            if own.sum() >= 4:
                A = np.column_stack([target[own, :3, 3], -np.ones(own.sum())])
                found = np.linalg.lstsq(A, measured.points[own, 0])[0]
                out[number] = found / np.linalg.norm(found[:3])
        return out.reshape(-1)

    def place(self, tool, measured):
        """Tip and plates from poses of the tool alone, in spite of a few heights that are wrong."""
        seen, k = measured.valid, self.numbers
        for number, name in enumerate(self.planes):
            if 0 < (count := int((seen & (k == number)).sum())) < FEWEST:
                raise CampaignError(
                    f"{count} heights over plate '{name}' do not tell where it is; read {FEWEST} or more"
                )

        def at(x):
            return tool @ se3.pose(np.eye(3), x[:3])

        def off(x):
            return self.differentiate(at(x), x[3:], measured).residual[seen, 0]

        def residual(x):
            return np.concatenate([off(x), self.stated(x[3:]).residual])

        start = np.nan_to_num(self.settle(tool, measured, np.full(4 * len(self.planes), np.nan)), nan=0.5)
        found = least_squares(
            residual, np.concatenate([np.zeros(3), start]), loss="soft_l1", f_scale=1e-3, x_scale="jac"
        )
        distance = np.zeros(len(tool))
        distance[seen] = np.abs(off(found.x))
        # planes in three directions and a tool that turns tell where the tip is; whoever has fewer is told by the fit
        return Placed(se3.pose(np.eye(3), found.x[:3]), found.x[3:], distance, np.zeros((3, 3)))

    @classmethod
    def stage(cls, tool, places, rng):
        """The plates of touches, each row at a height within the gauge's stroke."""
        scene = super().stage(tool, places, rng)
        normal = scene.unknown.reshape(-1, 4)[scene.observation.of, :3]
        above = normal * rng.uniform(0.0, STROKE, (len(tool), 1))

        def approach(target, rows):
            raised = scene.approach(target, rows)
            raised[:, :3, 3] += above[rows]
            return raised

        return scene._replace(approach=approach)

    @classmethod
    def read(cls, columns):
        """A height in every row that has one."""
        if "height" not in columns:
            return None
        points = np.zeros((len(columns), 3))
        points[:, 0] = columns.lengths("height")
        there = ~np.isnan(points[:, 0])
        points[~there] = np.nan
        columns.refuse_without("plate", there, "name the plate over which the height was read")
        names, of = refer(tuple(text if here else "" for text, here in zip(columns.texts("plate"), there, strict=True)))
        return Read("tip", cls(planes=names, of=of), points) if names else None

    def cells(self, measured):
        """Height and plate of every row."""
        heights = ["" if np.isnan(h) else f"{1e3 * h:.6f}" for h in measured.points[:, 0]]
        return {"height_mm": heights, "plate": self.labels(measured)}
