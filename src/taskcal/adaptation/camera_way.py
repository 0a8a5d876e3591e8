"""A camera on the wrist that sees landmarks which stand: postures in which they are in its sight."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.adaptation.measuring_way import MeasuringWay
from taskcal.geometry import se3
from taskcal.kinematics.clearance import Links
from taskcal.measurement.observation import Landmarks, Way
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr
from taskcal.task.task import Task
from taskcal.task.turn_section import towards
from taskcal.task.workspace import Orientation

FIELD_OF_VIEW = np.radians(40.0)
"""Full angle of the cone that the camera sees, by default: the smaller side of the picture of a common lens."""

NEAREST, FARTHEST = 0.2, 0.6
"""Distances from which a landmark is measured, by default, metres."""

TILT = np.radians(45.0)
"""Largest angle between a landmark's normal and the line of sight by default; flatter, patterns are measured badly."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class CameraWay(MeasuringWay):
    """Landmarks, and a camera on the tool that looks along its z axis."""

    way: ClassVar[Way] = "camera"
    label: ClassVar[str] = "landmark"
    fewest: ClassVar[int] = 5
    field_of_view: float = FIELD_OF_VIEW
    """Full angle, radians."""
    nearest: float = NEAREST
    farthest: float = FARTHEST
    """From the camera, metres."""
    tilt: float = TILT
    """Largest angle between a landmark's normal and the line of sight, radians."""

    def goals(
        self, model: ErrorModel, task: Task, thing: int, u: Float[np.ndarray, "n 6"]
    ) -> Float[np.ndarray, "n 4 4"]:
        """The camera anywhere before the landmark, turned so that it sees it somewhere in its picture."""
        before = Orientation(rotation=towards(self.standing.direction[thing]), cone=self.tilt)
        sight = before.sample(u[:, :3])[:, :, 2]
        aim = np.stack([towards(-direction) for direction in sight])
        turned = Orientation(rotation=np.eye(3), cone=0.5 * self.field_of_view, spin=np.pi).sample(u[:, 3:])
        # the number that a turn of the cone about its own axis would use is free for the distance
        distance = self.nearest + (self.farthest - self.nearest) * u[:, 2]
        position = self.standing.position[thing] + distance[:, None] * sight
        return se3.pose(aim @ turned, position) @ se3.inverse(self.T_tool_tip)

    def faults(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"], links: Links
    ) -> Mapping[str, Bool[np.ndarray, " n"]]:
        """A landmark out of sight, or hidden by the robot."""
        tip = self.tip(model, q)
        sight = self.standing.position[of] - tip[:, :3, 3]
        distance = np.linalg.norm(sight, axis=1)
        edge = 1e-9
        within = (distance >= self.nearest - edge) & (distance <= self.farthest + edge)
        seen = (sight * tip[:, :3, 2]).sum(axis=1) >= (np.cos(0.5 * self.field_of_view) - edge) * distance
        faces = -(sight * self.standing.direction[of]).sum(axis=1) >= (np.cos(self.tilt) - edge) * distance
        return {
            "the landmark too near, too far, out of the picture or too flat": ~(within & seen & faces),
            "the landmark behind the robot": ~self.line_is_free(tip, of, links),
        }

    def observation(self, of: Int[np.ndarray, " n"]) -> Landmarks:
        """Landmarks, with that of each row."""
        return Landmarks(landmarks=self.standing.names, of=of)

    @property
    def unknown(self) -> Float[np.ndarray, " u"]:
        """Their places."""
        return self.standing.position.reshape(-1)
