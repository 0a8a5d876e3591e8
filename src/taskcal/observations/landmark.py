"""A landmark that stands, seen in the frame of a sensor on the tool: a wrist camera, a touch probe, a scanner."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, ClassVar

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.geometry.point_registration import orientations
from taskcal.kinematics.clearance import Links
from taskcal.observations.base import (
    Differential,
    Measured,
    Observation,
    ObservedColumns,
    Read,
    Scene,
    means,
    spots,
    written,
)
from taskcal.observations.instrument import NO_FIXTURES, Fixtures, Instrument, far_apart, on_the_floor
from taskcal.observations.standalone import Search, Standalone
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr
from taskcal.task.orientation import towards
from taskcal.task.task import Task
from taskcal.task.workspace import Orientation
from taskcal_groundwork.options import Option
from taskcal_groundwork.said import Said

FEWEST = 8
"""Rows, to find the sensor on the tool without a guess."""

ON_THE_WRIST = se3.pose(se3.exp(np.array([0.05, -0.08, 0.3])), np.array([0.06, -0.01, -0.04]))
"""Where a virtual sensor sits on the tool, looking along z."""

AHEAD = 0.35
"""How far from the sensor virtual landmarks are, metres."""

NEAREST, FARTHEST, VIEW = 0.2, 0.8, np.radians(15.0)
"""Of what a virtual sensor sees, metres, and how far from the middle of its picture, radians."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Landmarks(Standalone):
    """y = X⁻¹·l: the landmark l, in the sensor's frame X on the tool; where both are is unknown."""

    key: ClassVar[str] = "landmark"
    needed: ClassVar[tuple[str, ...]] = ("sx", "sy", "sz")
    label: ClassVar[str] = "landmark"
    each: ClassVar[tuple[str, ...]] = ("tx", "ty", "tz")
    instrument: ClassVar[str] = "camera"
    columns: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType(
        {
            "sx": ("sx", "sensor x"),
            "sy": ("sy", "sensor y"),
            "sz": ("sz", "sensor z"),
            "landmark": ("landmark", "board", "feature", "tag", "marke"),
        }
    )
    turned: ClassVar[bool] = True
    evaluations: ClassVar[int] = 12
    things: ClassVar[str] = "landmarks"
    landmarks: tuple[str, ...]
    """Names."""

    def differentiate(
        self, target: Float[np.ndarray, "n 4 4"], unknown: Float[np.ndarray, " u"], measured: Measured
    ) -> Differential:
        """Residual and derivatives, in the sensor's frame."""
        n, k = len(target), self.numbers
        back = np.swapaxes(target[:, :3, :3], 1, 2)
        between = unknown.reshape(-1, 3)[k] - target[:, :3, 3]
        predicted = (back @ between[:, :, None])[:, :, 0]
        # a turn w of the sensor moves what it sees by −w × between
        by_target = np.concatenate([-back, back @ se3.by_twist(-between)[:, :, 3:]], axis=2)
        by_unknown = np.zeros((n, 3, len(self.landmarks), 3))
        by_unknown[np.arange(n), :, k] = back
        return Differential(measured.points - predicted, by_target, by_unknown.reshape(n, 3, -1))

    def check(self, rows: Search) -> None:
        """Raise a `CampaignError` where the rows are too few to find the sensor."""
        if len(rows.tool) < FEWEST:
            raise CampaignError(f"{len(rows.tool)} sightings do not tell where the sensor is; measure {FEWEST} or more")

    def starts(self, rows: Search) -> Iterable[Float[np.ndarray, " x"]]:
        """The orientation nearest to a matrix that fits best, and many others, with the place that fits best beside them.

        p + R·(t + Q·y) = l is linear in t, l and a matrix Q of which nothing is asked.
        """
        R, p, y, n = rows.tool[:, :3, :3], rows.tool[:, :3, 3], rows.measured.points, len(rows.tool)
        own = np.zeros((n, 3, len(self.landmarks), 3))
        own[np.arange(n), :, rows.numbers] = -np.eye(3)
        linear = np.concatenate([R, own.reshape(n, 3, -1)], axis=2).reshape(3 * n, -1)
        by_matrix = (R[:, :, None, :] * y[:, None, :, None]).reshape(3 * n, 9)
        Q = np.linalg.lstsq(np.concatenate([by_matrix, linear], axis=1), -p.reshape(-1), rcond=1e-6)[0][:9]
        for turn in (se3.nearest_rotation(Q.reshape(3, 3).T), *orientations()):
            left = -p - (R @ (y @ turn.T)[:, :, None])[:, :, 0]
            yield rows.about(se3.pose(turn, np.linalg.lstsq(linear, left.reshape(-1), rcond=1e-6)[0][:3]))

    def settle(
        self, target: Float[np.ndarray, "n 4 4"], measured: Measured, known: Float[np.ndarray, " u"]
    ) -> Float[np.ndarray, " u"]:
        """Each landmark at the mean of what its own rows say."""
        seen = measured.valid
        places = se3.apply(target[seen], measured.points[seen])
        return means(places, self.numbers[seen], len(self.landmarks)).reshape(-1)

    @classmethod
    def stage(cls, tool: Float[np.ndarray, "n 4 4"], places: int | None, rng: np.random.Generator) -> Scene:
        """One landmark before the sensor, which turns towards it as far as it must to have it in its picture."""
        sensor = tool @ ON_THE_WRIST
        at = sensor[spots(sensor[:, :3, 3], places or 1)]
        landmarks = at[:, :3, 3] + AHEAD * at[:, :3, 2]
        names = tuple(str(number) for number in range(1, len(landmarks) + 1))
        of = np.arange(len(tool)) % len(landmarks)

        def approach(target: np.ndarray, rows: np.ndarray) -> np.ndarray:
            return _look_at(target, landmarks[of[rows]])

        return Scene(cls(landmarks=names, of=of), "sensor", ON_THE_WRIST, landmarks.reshape(-1), approach)

    @classmethod
    def read(cls, columns: ObservedColumns) -> Read | None:
        """A sighting in every row that has all three numbers, of the landmark that is named, or of the only one.

        Raises:
            FileError: some of the three numbers, or the landmark's name, are lacking.
        """
        return None if "sqx" in columns else cls.sightings(columns)

    @classmethod
    def sightings(cls, columns: ObservedColumns) -> Read | None:
        """The same, whether or not the file says how what was seen is turned.

        Raises:
            FileError: some of the three numbers, or the landmark's name, are lacking.
        """
        if "sx" not in columns:
            return None
        y = np.stack([columns.lengths(axis) for axis in ("sx", "sy", "sz")], axis=1)
        seen = np.asarray(np.isfinite(y).any(axis=1))
        for row in np.flatnonzero(seen & ~np.isfinite(y).all(axis=1)):
            raise columns.error("sx, sy and sz belong together; give all three, or leave all empty", int(row), "sx")
        names, of = columns.named("landmark", seen, "name the landmark that was seen")
        return Read("sensor", cls(landmarks=names, of=of), y) if names else None

    def cells(self, measured: Measured) -> dict[str, list[str]] | None:
        """The three numbers and the landmark of every row."""
        cells = {f"s{axis}_mm": written(measured.points[:, k] * 1e3) for k, axis in enumerate("xyz")}
        return {**cells, "landmark": self.labels(measured)}


def _look_at(sensor: Float[np.ndarray, "n 4 4"], seen: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 4 4"]:
    """Poses nearby in which each sensor has its landmark in the picture: turned, and moved along the line of sight."""
    R, between = sensor[:, :3, :3], seen - sensor[:, :3, 3]
    distance = np.linalg.norm(between, axis=1)[:, None]
    sight = between / np.maximum(distance, 1e-9)
    axis = np.cross(R[:, :, 2], sight)
    sine = np.linalg.norm(axis, axis=1)
    angle = np.arctan2(sine, (R[:, :, 2] * sight).sum(axis=1))
    turn = np.maximum(angle - VIEW, 0.0)
    turned = se3.exp((turn / np.maximum(sine, 1e-9))[:, None] * axis) @ R
    return se3.pose(turned, seen - np.clip(distance, NEAREST, FARTHEST) * sight)


# A camera on the wrist that sees landmarks: postures in which they are in its sight.

FIELD_OF_VIEW = np.radians(40.0)
"""Full angle of the cone that the camera sees, by default: the smaller side of the picture of a common lens."""

SIGHT_RANGE = 0.2, 0.6
"""Distances from which a landmark is measured, by default, metres."""

TILT = np.radians(45.0)
"""Largest angle between a landmark's normal and the line of sight by default; flatter, patterns are measured badly."""

ASSUMED = ("a", "b", "c")
"""Landmarks where nobody states any."""


Standing = Annotated[
    Fixtures,
    Option(
        metavar="LANDMARKS.csv",
        help="Approximate landmarks or boards: landmark, x_mm y_mm z_mm, normal i j k; of images board, or camera with its line of "
        "sight. By default in front of the task, landmarks three.",
        named="landmarks",
        kind=Path,
    ),
]


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class CameraInstrument(Instrument):
    """Landmarks, and a camera on the tool that looks along its z axis."""

    kind: ClassVar[type[Observation]] = Landmarks
    fixtures: Standing = NO_FIXTURES
    tilt: Annotated[
        float,
        Option(
            metavar="DEG",
            help="largest angle between a landmark's normal and the line of sight (45)",
            named="cone",
            unit="deg",
            low=0.0,
            high=180.0,
            ends=False,
        ),
    ] = TILT
    """Radians."""
    depths: Annotated[
        tuple[float, float],
        Option(
            metavar="LOW,HIGH",
            help="measuring distances of the camera (200,600)",
            named="range",
            unit="mm",
            low=0.0,
            high=1e6,
            rising=True,
        ),
    ] = SIGHT_RANGE
    """The nearest and the farthest, metres."""
    field_of_view: Annotated[
        float,
        Option(
            metavar="DEG",
            help="Full field of view of the camera (40).",
            named="fov",
            unit="deg",
            low=0.0,
            high=180.0,
            ends=False,
        ),
    ] = FIELD_OF_VIEW
    """Radians."""

    @classmethod
    def arrange(
        cls,
        p: Float[np.ndarray, "n 3"],
        pointing: Float[np.ndarray, " 3"],
        reach: float,
        stated: Mapping[str, Any],
    ) -> Fixtures:
        """Three landmarks before the tool, as far from one another as the task has room, all facing it."""
        distance = 0.5 * sum(stated.get("depths", SIGHT_RANGE))
        position = on_the_floor(far_apart(p, len(ASSUMED)) + distance * pointing)
        return Fixtures(names=ASSUMED, position=position, direction=np.tile(-pointing, (len(ASSUMED), 1)))

    @property
    def instructions(self) -> str:
        """Instructions for the file of a plan."""
        return Said("fill in what the camera measures in the plan's file, row by row; identify then reads it")

    def goals(
        self, model: ErrorModel, task: Task, fixture: int, u: Float[np.ndarray, "n 6"]
    ) -> Float[np.ndarray, "n 4 4"]:
        """The camera anywhere before the landmark, turned so that it sees it somewhere in its picture."""
        before = Orientation(rotation=towards(self.fixtures.direction[fixture]), cone=self.tilt)
        sight = before.sample(u[:, :3])[:, :, 2]
        aim = np.stack([towards(-direction) for direction in sight])
        turned = Orientation(rotation=np.eye(3), cone=0.5 * self.field_of_view, spin=np.pi).sample(u[:, 3:])
        # the number that a turn of the cone about its own axis would use is free for the distance
        nearest, farthest = self.depths
        distance = nearest + (farthest - nearest) * u[:, 2]
        position = self.fixtures.position[fixture] + distance[:, None] * sight
        return se3.pose(aim @ turned, position) @ se3.inverse(self.T_tool_tip)

    def faults(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"], links: Links
    ) -> Mapping[str, Bool[np.ndarray, " n"]]:
        """A landmark out of sight, or hidden by the robot."""
        tip = self.tip(model, q)
        sight = self.fixtures.position[of] - tip[:, :3, 3]
        distance = np.linalg.norm(sight, axis=1)
        edge = 1e-9
        within = (distance >= self.depths[0] - edge) & (distance <= self.depths[1] + edge)
        seen = (sight * tip[:, :3, 2]).sum(axis=1) >= (np.cos(0.5 * self.field_of_view) - edge) * distance
        faces = -(sight * self.fixtures.direction[of]).sum(axis=1) >= (np.cos(self.tilt) - edge) * distance
        return {
            Said("the landmark too near, too far, out of the picture or too flat"): ~(within & seen & faces),
            Said("landmark hidden by the robot"): ~self.sight_is_free(tip, of, links),
        }
