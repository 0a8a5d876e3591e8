"""A wire from the tool to anchors: postures in which it is long enough, short enough, and free."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.adaptation.candidates import enlarge
from taskcal.adaptation.measuring_way import MeasuringWay
from taskcal.kinematics.clearance import Links
from taskcal.measurement.observation import Lengths, Way
from taskcal.measurement.observation.distance import FEWEST
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr
from taskcal.task.task import Task

SHORTEST, LONGEST = 0.1, 2.0
"""Length of a wire by default, metres: draw-wire sensors are sold from half a metre to many; two metres are common."""

ANGLE = np.radians(110.0)
"""Largest angle between the wire and the tool's axis by default: tied to a swivel at the tip, it must not lean on the tool."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class WireWay(MeasuringWay):
    """Anchors, and the wire's end on the tool."""

    way: ClassVar[Way] = "wire"
    label: ClassVar[str] = "anchor"
    fewest: ClassVar[int] = FEWEST
    shortest: float = SHORTEST
    longest: float = LONGEST
    """Lengths that the instrument measures, metres."""
    angle: float = ANGLE
    """Largest angle between the wire and the direction in which the tool points, radians."""
    scaled: bool = False
    """Whether the instrument's scale is unknown."""

    def goals(
        self, model: ErrorModel, task: Task, thing: int, u: Float[np.ndarray, "n 6"]
    ) -> Float[np.ndarray, "n 4 4"]:
        """Poses around the task."""
        room = enlarge(task, model).workspace
        assert room is not None
        return room.place(u)

    def faults(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"], links: Links
    ) -> Mapping[str, Bool[np.ndarray, " n"]]:
        """A wire that is too short or too long, leans on the tool, or meets the robot."""
        tip = self.tip(model, q)
        way = self.standing.position[of] - tip[:, :3, 3]
        length = np.linalg.norm(way, axis=1)
        within = (length >= self.shortest) & (length <= self.longest)
        steep = (way * tip[:, :3, 2]).sum(axis=1) < np.cos(self.angle) * length
        return {
            "the wire too short or too long": ~within,
            "the wire leaning on the tool": steep,
            "the wire across the robot": ~self.line_is_free(tip, of, links),
        }

    def observation(self, of: Int[np.ndarray, " n"]) -> Lengths:
        """Lengths, with the anchor of each row."""
        return Lengths(anchors=self.standing.names, of=of, scaled=self.scaled)

    @property
    def unknown(self) -> Float[np.ndarray, " u"]:
        """Anchors and offsets, then the scale."""
        own = np.concatenate([self.standing.position, np.zeros((self.things, 1))], axis=1).reshape(-1)
        return np.concatenate([own, np.zeros(int(self.scaled))])

    @property
    def stages(self) -> Int[np.ndarray, " things"]:
        """One anchor at a time."""
        return np.arange(self.things)
