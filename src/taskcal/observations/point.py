"""A reflector on the tool, measured by a laser tracker; and the station: where the tracker is, and what it sees."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from jaxtyping import Bool, Float, Int
from pydantic import Field

from taskcal.arguments import checked, repeated
from taskcal.errors import ReachError
from taskcal.geometry import se3
from taskcal.io.codec import InFile, read_brief
from taskcal.io.toml_file import HalfTurn, NotNegative, Positive, Quaternion
from taskcal.kinematics.clearance import Box, Links, beam_is_free, clear_of_boxes, clear_of_itself, place_links
from taskcal.observations.base import Differential, Measured, Observation, TrackerNoise
from taskcal.observations.instrument import IN_A_BOX, NOT_REACHED, TOO_NEAR, Instrument, Measurable
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr
from taskcal.task.task import Task, TaskPoses, enlarge, reach_task
from taskcal_groundwork.said import Said


@dataclass(frozen=True, eq=False, kw_only=True)
class Point(Observation):
    """y = p: what a laser tracker sees of a reflector."""

    key: ClassVar[str] = "point"
    instrument: ClassVar[str] = "tracker"
    along_axes: ClassVar[bool] = True
    in_tracker: ClassVar[bool] = True
    streamed: ClassVar[bool] = True

    def differentiate(
        self, target: Float[np.ndarray, "n 4 4"], unknown: Float[np.ndarray, " u"], measured: Measured
    ) -> Differential:
        """Residual and derivatives."""
        by_target = np.zeros((len(target), 3, 6))
        by_target[:, :, :3] = np.eye(3)
        return Differential(measured.points - target[:, :3, 3], by_target, np.zeros((len(target), 3, 0)))

    def covariance(
        self, measured: Measured, uncertainty: Float[np.ndarray, " n"] | None, tracker: TrackerNoise
    ) -> Float[np.ndarray, "n w w"]:
        """Covariance of the noise of each row."""
        if uncertainty is not None:
            return uncertainty[:, None, None] ** 2 * np.eye(3)
        return tracker.covariance(measured.points)


# The measuring station: where the tracker is, which reflectors the tool carries, and what is in the way.

TRACKER_POSE = se3.pose(se3.exp(np.array([0.02, -0.01, 2.1])), np.array([3.2, -1.9, -0.35]))
"""Pose of the base in the tracker's frame by default: a tracker some four metres away that is nearly upright."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Reflector:
    """A reflector on the tool."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")]
    position: Annotated[Float[np.ndarray, " 3"], InFile(unit="mm")]
    """Centre in the tool frame, metres."""
    axis: Annotated[Float[np.ndarray, " 3"], se3.DIRECTION] | None = None
    """Direction it looks in, in the tool frame; None for a reflector that is seen from everywhere."""
    acceptance: Annotated[HalfTurn, InFile(unit="deg"), Field(gt=0)] = float(np.radians(30.0))
    """Largest angle between its axis and the beam, radians."""


@dataclass(frozen=True, eq=False, kw_only=True)
class StatedBox:
    """A box in the robot's base, as people write it."""

    center: Annotated[Float[np.ndarray, " 3"], InFile(unit="mm")]
    size: Annotated[Float[np.ndarray, " 3"], InFile(unit="mm", entry=Positive)]
    quaternion: Quaternion = (0.0, 0.0, 0.0, 1.0)

    @classmethod
    def of(cls, box: Box) -> "StatedBox":
        """Of a box."""
        placed = se3.StatedPose.of(box.pose)
        return cls(center=placed.position, size=box.size, quaternion=placed.quaternion)

    def box(self) -> Box:
        """The box."""
        placed = se3.StatedPose(position=self.center, quaternion=self.quaternion)
        return Box(pose=placed.transform(), size=self.size)


STATED_BOX = InFile(kind=StatedBox, write=StatedBox.of, read=lambda _, stated: stated.box())


@checked
@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Station:
    """Position of the tracker, its reflectors and obstacles."""

    position: Annotated[Float[np.ndarray, " 3"], InFile(unit="mm")]
    """Of the tracker in the robot's base, metres."""
    reach: Annotated[Positive, InFile(key="reach_m")] = 30.0
    """Farthest measured distance, metres."""
    nearest: Annotated[NotNegative, InFile(key="nearest_m")] = 0.5
    """Nearest measured distance, metres."""
    reflectors: Annotated[tuple[Reflector, ...], InFile(key="reflector"), Field(min_length=1, max_length=100)]
    keep_out: tuple[Annotated[Box, STATED_BOX], ...] = ()
    """Boxes that neither robot nor beam may enter."""

    @staticmethod
    def check_stated(stated: Mapping[str, Any]) -> None:
        """See that each reflector has its own name."""
        if twice := repeated(one.name for one in stated["reflector"]):
            raise ValueError(f"two reflectors are named '{min(twice)}'; give each its own name")

    @property
    def T_tracker_base(self) -> Float[np.ndarray, "4 4"]:
        """The base seen from a tracker that stands parallel to it."""
        return se3.translation(*(-self.position))

    @property
    def offsets(self) -> Float[np.ndarray, "targets 3"]:
        """Reflector centres in the tool frame, metres."""
        return np.stack([reflector.position for reflector in self.reflectors])

    def visible(self, T: Float[np.ndarray, "n 4 4"], links: Links) -> Bool[np.ndarray, "n targets"]:
        """Find the reflectors visible to the tracker at tool poses T in the base."""
        seen = np.zeros((len(T), len(self.reflectors)), dtype=bool)
        for k, reflector in enumerate(self.reflectors):
            center = se3.apply(T, np.broadcast_to(reflector.position, (len(T), 3)))
            sight = self.position - center
            distance = np.linalg.norm(sight, axis=1)
            ok = (distance <= self.reach) & (distance >= self.nearest)
            if reflector.axis is not None:
                looks = T[:, :3, :3] @ reflector.axis
                ok &= (looks * sight).sum(axis=1) >= np.cos(reflector.acceptance) * distance
            seen[:, k] = ok & beam_is_free(self.position, center, links, self.keep_out)
        return seen


@checked
def load_station(path: str | Path) -> Station:
    """Read a station file.

    Raises:
        FileError: it is missing, no TOML, or does not describe a station.
    """
    return read_brief(Path(path), Station)


# The tracker as the instrument of a plan: poses about the task in which it sees a reflector.


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Tracker(Instrument):
    """A laser tracker; without a station it sees one reflector at the TCP from everywhere."""

    kind: ClassVar[type[Observation]] = Point
    smooth_share: ClassVar[float] = 1.0
    varies: ClassVar[bool] = True
    station: Station | None = None

    @property
    def T_measuring_base(self) -> Float[np.ndarray, "4 4"]:
        """Pose of the base in the tracker's frame."""
        return TRACKER_POSE if self.station is None else self.station.T_tracker_base

    @property
    def T_tool_targets(self) -> Float[np.ndarray, "targets 4 4"]:
        """Poses of the reflectors in the tool frame."""
        if self.station is None:
            return np.eye(4)[None]
        return se3.pose(np.tile(np.eye(3), (len(self.station.reflectors), 1, 1)), self.station.offsets)

    @property
    def targets(self) -> tuple[str, ...]:
        """Names of the reflectors."""
        return ("tool",) if self.station is None else tuple(reflector.name for reflector in self.station.reflectors)

    @property
    def obstacles(self) -> tuple[Box, ...]:
        """Boxes that the robot must stay clear of: the station's."""
        return self.keep_out if self.station is None else self.station.keep_out

    def observation(self, of: Int[np.ndarray, " n"], target: Float[np.ndarray, "n 4 4"] | None = None) -> Point:
        """Points."""
        return Point()

    @property
    def unknown(self) -> Float[np.ndarray, " u"]:
        """Nothing but the tracker's frame."""
        return np.zeros(0)

    def find(self, model: ErrorModel, task: Task, candidates: int | np.ndarray, seed: int) -> Measurable:
        """Poses about the task, or those given, that the robot reaches clear of itself and of boxes, and the tracker sees.

        Raises:
            ReachError: none is left; the message counts why.
        """
        if isinstance(candidates, int):
            return self.keep(model, reach_task(model, enlarge(task, model), candidates, seed))
        q = np.asarray(candidates, dtype=float)
        n = len(q)
        return self.keep(
            model, TaskPoses(T=model.poses(q), q=q, weights=np.full(n, 1.0 / n), unreachable=np.zeros(n, dtype=bool))
        )

    def keep(self, model: ErrorModel, reached: TaskPoses) -> Measurable:
        """Keep the poses that can be measured.

        Raises:
            ReachError: none can; the message counts why.
        """
        links = place_links(model, reached.q)
        ok, seen = self.check(model, reached.q, links)
        clear = clear_of_itself(links)
        boxes = clear_of_boxes(links, self.obstacles)
        lost: dict[str, int] = {
            NOT_REACHED: int(reached.unreachable.sum()),
            TOO_NEAR: int((~clear).sum()),
            IN_A_BOX: int((clear & ~boxes).sum()),
            Said("no reflector visible"): int((clear & boxes & ~seen.any(axis=1)).sum()),
        }
        if not ok.any():
            reasons = ", ".join(f"{number} {reason}" for reason, number in lost.items() if number)
            raise ReachError(
                f"none of {len(reached.unreachable)} candidate poses can be measured: {reasons}; move the tracker, turn the "
                "reflectors or widen their acceptance, or move the keep-out boxes"
            )
        return Measurable(q=reached.q[ok], rows=np.flatnonzero(ok), visible=seen[ok], lost=lost)

    def check(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], links: Links
    ) -> tuple[Bool[np.ndarray, " n"], Bool[np.ndarray, "n targets"]]:
        """Whether each pose can be measured, and which reflectors are seen there."""
        ok = clear_of_itself(links)
        if self.station is None:
            return ok, np.ones((len(q), 1), dtype=bool)
        ok &= clear_of_boxes(links, self.station.keep_out)
        seen = self.station.visible(model.poses(q), links)
        return ok & seen.any(axis=1), seen

    def own_poses(
        self, model: ErrorModel, task: Task, measurable: Measurable, tried: int, seed: int, needed: int
    ) -> Measurable:
        """Measurable poses of the task itself; of the candidates, where the tracker does not see enough of the task."""
        try:
            own = self.keep(model, reach_task(model, task, tried, seed))
        except ReachError:
            return measurable
        return own if len(own.q) >= needed else measurable
