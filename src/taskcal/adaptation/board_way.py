"""A camera on the wrist that sees boards which stand, and how they are turned."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float, Int

from taskcal.adaptation.camera_way import CameraWay
from taskcal.geometry import se3
from taskcal.measurement.observation import Boards, Way
from taskcal.short_repr import short_repr
from taskcal.task.turn_section import towards


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class BoardWay(CameraWay):
    """Boards in place of landmarks; about their directions they may be turned anyhow."""

    way: ClassVar[Way] = "board"

    def observation(self, of: Int[np.ndarray, " n"]) -> Boards:
        """Boards, with that of each row."""
        return Boards(landmarks=self.standing.names, of=of)

    @property
    def unknown(self) -> Float[np.ndarray, " u"]:
        """Their places, and how they are turned."""
        turned = np.stack([se3.log(R) for R in self._turned])
        return np.concatenate([self.standing.position, turned], axis=1).reshape(-1)

    @property
    def _turned(self) -> Float[np.ndarray, "things 3 3"]:
        return np.stack([towards(direction) for direction in self.standing.direction])

    def rotations(
        self, tip: Float[np.ndarray, "n 4 4"], of: Int[np.ndarray, " n"]
    ) -> Float[np.ndarray, "n 3 3"] | None:
        """Of the boards in the camera's frame."""
        return np.swapaxes(tip[:, :3, :3], 1, 2) @ self._turned[of]
