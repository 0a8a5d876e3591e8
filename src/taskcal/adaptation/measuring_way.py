"""A way of measuring without a tracker: what stands in the cell, what the tool carries, and which postures that allows."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.kinematics.clearance import Box, Links, line_is_free, without_carriers
from taskcal.measurement.observation import Measured, Observation, Way
from taskcal.measurement.standing import Standing
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task


@dataclass(frozen=True, eq=False, kw_only=True)
class MeasuringWay(ABC):
    """What stands, and what the tool carries; a subclass says which postures may be measured, and what is read in them."""

    way: ClassVar[Way]
    label: ClassVar[str]
    """What each thing that stands is called, and the column that names it."""
    fewest: ClassVar[int]
    """Rows that each of the things needs."""
    standing: Standing
    T_tool_tip: Float[np.ndarray, "4 4"] = field(default_factory=lambda: np.eye(4))
    """What the tool carries, ball, wire's end or sensor, roughly; its z axis points away from the tool."""
    keep_out: tuple[Box, ...] = ()
    """Boxes that neither robot nor line of sight may enter."""

    @property
    def things(self) -> int:
        """How many stand."""
        return len(self.standing.names)

    def tip(self, model: ErrorModel, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 4 4"]:
        """Where the nominal robot has what the tool carries, in the base."""
        return model.poses(q) @ self.T_tool_tip

    def line_is_free(
        self, tip: Float[np.ndarray, "n 4 4"], of: Int[np.ndarray, " n"], links: Links
    ) -> Bool[np.ndarray, " n"]:
        """Whether the straight line from the thing of each row to the tool misses the links and the boxes."""
        free, links = np.ones(len(tip), dtype=bool), without_carriers(links, tip[:, :3, 3])
        for k in range(self.things):
            mine = of == k
            own = Links(start=links.start[mine], end=links.end[mine], radius=links.radius)
            free[mine] = line_is_free(self.standing.position[k], tip[mine, :3, 3], own, self.keep_out)
        return free

    @abstractmethod
    def goals(
        self, model: ErrorModel, task: Task, thing: int, u: Float[np.ndarray, "n 6"]
    ) -> Float[np.ndarray, "n 4 4"]:
        """Poses of the tool in which one of the things may be measured, for numbers u in [0, 1)."""

    @abstractmethod
    def faults(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"], links: Links
    ) -> Mapping[str, Bool[np.ndarray, " n"]]:
        """Postures that cannot be measured although the robot reaches them clear of itself, by reason.

        Args:
            model: of the nominal robot.
            q: the postures, radians.
            of: which of the things is measured in each.
            links: of the robot in each.
        """

    @abstractmethod
    def observation(self, of: Int[np.ndarray, " n"]) -> Observation:
        """The kind of observation, with the thing of each row."""

    @property
    @abstractmethod
    def unknown(self) -> Float[np.ndarray, " u"]:
        """The kind's own unknowns, as they are stated."""

    def columns(self, of: Int[np.ndarray, " n"]) -> dict[str, list[str]]:
        """Columns of a campaign behind its joints: what each row is of, and empty cells for what is to be read."""
        kind = self.observation(of)
        rotations = np.tile(np.eye(3), (len(of), 1, 1)) if kind.width == 6 else None
        cells = kind.cells(Measured(np.zeros((len(of), 3)), rotations)) or {}
        return {name: texts if name in (self.label, "place") else [""] * len(of) for name, texts in cells.items()}

    @property
    def stages(self) -> Int[np.ndarray, " things"]:
        """Which of the things stand at the same time: things of one number do."""
        return np.zeros(self.things, dtype=np.int64)

    def rotations(
        self, tip: Float[np.ndarray, "n 4 4"], of: Int[np.ndarray, " n"]
    ) -> Float[np.ndarray, "n 3 3"] | None:
        """Rotations that would be measured; None for kinds that measure none."""
        return None
