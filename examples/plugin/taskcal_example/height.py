"""A kind of observation: the height of the tool's tip over a plate, as a dial gauge or a laser sensor on the plate shows it."""

from dataclasses import dataclass

import numpy as np

from taskcal.errors import CampaignError
from taskcal.observations import Planes, Read

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
    resolution = 1e-5  # of a dial gauge, metres
    columns = {"height": ("height", "gauge height"), "plate": ("plate",)}  # noqa: RUF012

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

    def check(self, rows):
        """See that there are heights enough over every plate."""
        for name, count in zip(self.planes, rows.counts, strict=True):
            if 0 < count < FEWEST:
                raise CampaignError(
                    f"{count} heights over plate '{name}' do not tell where it is; read {FEWEST} or more"
                )

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
        names, of = columns.named("plate", there, "name the plate over which the height was read")
        return Read("tip", cls(planes=names, of=of), points) if names else None

    def cells(self, measured):
        """Height and plate of every row."""
        heights = ["" if np.isnan(h) else f"{1e3 * h:.6f}" for h in measured.points[:, 0]]
        return {"height_mm": heights, "plate": self.labels(measured)}
