"""A landmark that stands, seen in the frame of a sensor on the tool: a wrist camera, a touch probe, a scanner."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

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
    Placed,
    Read,
    Scene,
    Standalone,
    TrackerNoise,
    refer,
    spots,
    unlocated,
)
from taskcal.observations.instrument import Fixtures, Instrument, Setting, far_apart, on_the_floor
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr
from taskcal.task.orientation import towards
from taskcal.task.task import Task
from taskcal.task.workspace import Orientation

RESOLUTION = 1e-4
"""How well a sensor on the wrist sees a landmark where the campaign does not say, metres per axis."""

FEWEST = 8
"""Rows, to find the sensor on the tool without a guess."""

FAR = 10.0
"""Times the median distance, from which on a row disagrees."""

ON_THE_WRIST = se3.pose(se3.exp(np.array([0.05, -0.08, 0.3])), np.array([0.06, -0.01, -0.04]))
"""Where a virtual sensor sits on the tool, looking along z."""

AHEAD = 0.35
"""How far from the sensor virtual landmarks are, metres."""

NEAREST, FARTHEST, VIEW = 0.2, 0.8, np.radians(15.0)
"""Of what a virtual sensor sees, metres, and how far from the middle of its picture, radians."""

FEW_ROUNDS, ROUNDS = 8, 60
"""Of a search from each start, and from the best one."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Landmarks(Standalone):
    """y = X⁻¹·l: the landmark l, in the sensor's frame X on the tool; where both are is unknown."""

    key: ClassVar[str] = "landmark"
    needed: ClassVar[tuple[str, ...]] = ("sx", "sy", "sz")
    label: ClassVar[str] = "landmark"
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
    things: ClassVar[str] = "landmarks"
    landmarks: tuple[str, ...]
    """Names."""

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Place of every landmark."""
        return tuple(f"landmark {name}.{c}" for name in self.landmarks for c in ("tx", "ty", "tz"))

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

    def place(self, tool: Float[np.ndarray, "n 4 4"], measured: Measured) -> Placed:
        """P + R·(t + Q·y) = l is linear in t, l and a matrix Q of which nothing is asked; then from many orientations.

        Raises:
            CampaignError: too few rows.
        """
        seen = measured.valid
        if seen.sum() < FEWEST:
            raise CampaignError(
                f"{int(seen.sum())} sightings do not tell where the sensor is; measure {FEWEST} or more"
            )
        R, p, y, k = tool[seen, :3, :3], tool[seen, :3, 3], measured.points[seen], self.numbers[seen]
        case, weight = _Case(R, p, y, k, len(self.landmarks)), np.ones(len(y))
        starts = (case.search(Q, weight, FEW_ROUNDS) for Q in [case.lifted(), *orientations()])
        Q = min(starts, key=lambda found: found[1])[0]
        for _ in range(4):
            Q, _ = case.search(Q, weight, ROUNDS)
            distance = np.linalg.norm(case.place(Q, weight)[2], axis=1)
            weight = np.where(distance <= FAR * max(float(np.median(distance)), 1e-5), 1.0, 0.0)
        left = case.place(Q, weight)[2]
        A = case.design(Q)
        rms = float(np.sqrt((weight @ (left**2).sum(axis=1)) / weight.sum()))
        others = np.concatenate([A[:, :, :3], A[:, :, 6:]], axis=2)
        hidden = unlocated(A[:, :, 3:6].reshape(-1, 3), others.reshape(3 * len(y), -1), rms)
        t, centres, left = case.place(Q, weight, hidden)
        off = np.zeros(len(tool))
        off[seen] = np.linalg.norm(left, axis=1)
        return Placed(se3.pose(Q, t), centres.reshape(-1), off, hidden)

    def settle(
        self, target: Float[np.ndarray, "n 4 4"], measured: Measured, known: Float[np.ndarray, " u"]
    ) -> Float[np.ndarray, " u"]:
        """Each landmark at the mean of what its own rows say."""
        seen = measured.valid
        x, k = se3.apply(target[seen], measured.points[seen]), self.numbers[seen]
        out = np.full((len(self.landmarks), 3), np.nan)
        for number in np.unique(k):
            out[number] = x[k == number].mean(axis=0)
        return out.reshape(-1)

    def covariance(
        self, measured: Measured, uncertainty: Float[np.ndarray, " n"] | None, tracker: TrackerNoise
    ) -> Float[np.ndarray, "n w w"]:
        """Covariance of the noise of each row."""
        deviation = np.full(len(measured.points), RESOLUTION) if uncertainty is None else uncertainty
        return deviation[:, None, None] ** 2 * np.eye(3)

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
        if "landmark" in columns:
            columns.refuse_without("landmark", seen, "name the landmark that was seen")
        labels = columns.texts("landmark") if "landmark" in columns else ("1",) * len(y)
        names, of = refer(tuple(label if there else "" for label, there in zip(labels, seen, strict=True)))
        return Read("sensor", cls(landmarks=names, of=of), y) if names else None

    def cells(self, measured: Measured) -> dict[str, list[str]] | None:
        """The three numbers and the landmark of every row."""
        cells = {
            f"s{'xyz'[axis]}_mm": ["" if np.isnan(v) else f"{v * 1e3:.6f}" for v in measured.points[:, axis]]
            for axis in range(3)
        }
        return {**cells, "landmark": self.labels(measured)}

    def describe(self) -> dict[str, Any]:
        """Describe it for a file."""
        return {"landmarks": list(self.landmarks)}

    @classmethod
    def of_description(cls, content: Mapping[str, Any]) -> "Landmarks":
        """Make it from what `describe` gave, without rows."""
        return cls(landmarks=tuple(content["landmarks"]))


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


class _Case(NamedTuple):
    """Sightings from a tool at known poses: p + R·(t + Q·y) = l."""

    R: np.ndarray
    p: np.ndarray
    y: np.ndarray
    k: np.ndarray
    landmarks: int

    def design(self, Q: np.ndarray) -> np.ndarray:
        """Derivative of p + R·(t + Q·y) − l by a turn of the sensor, by its place t and by the landmarks."""
        A = np.zeros((len(self.y), 3, 6 + 3 * self.landmarks))
        A[:, :, :3] = self.R @ se3.by_twist(self.y @ Q.T)[:, :, 3:]
        A[:, :, 3:6] = self.R
        for number in range(self.landmarks):
            A[self.k == number, :, 6 + 3 * number : 9 + 3 * number] = -np.eye(3)
        return A

    def place(
        self, Q: np.ndarray, weight: np.ndarray, held: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Place of the sensor, landmarks, and what is left of every row; along held directions the sensor is at the tool point."""
        A, root = self.design(Q)[:, :, 3:], np.sqrt(weight)[:, None]
        b = -self.p - (self.R @ (self.y @ Q.T)[:, :, None])[:, :, 0]
        flat = (A * root[:, :, None]).reshape(3 * len(self.y), -1)
        # next to nothing holds the sensor at the tool point where the rows do not tell
        H = flat.T @ flat + 1e-9 * np.eye(flat.shape[1])
        if held is not None:
            H[:3, :3] += 1e9 * held
        x = np.linalg.solve(H, flat.T @ (b * root).reshape(-1))
        return x[:3], x[3:].reshape(-1, 3), b - A @ x

    def search(self, Q: np.ndarray, weight: np.ndarray, rounds: int) -> tuple[np.ndarray, float]:
        """Gauss–Newton on the sensor's orientation, all else following; the orientation and the sum of squares."""
        root = np.sqrt(weight)
        left = self.place(Q, weight)[2]
        cost, damping = float(weight @ (left**2).sum(axis=1)), 1e-6
        for _ in range(rounds):
            A = (self.design(Q) * root[:, None, None]).reshape(3 * len(self.y), -1)
            H, g = A.T @ A, A.T @ (left * root[:, None]).reshape(-1)
            step = np.linalg.lstsq(H + damping * np.diag(np.diag(H) + 1e-12), g, rcond=1e-12)[0]
            turned = se3.exp(step[:3]) @ Q
            trial = self.place(turned, weight)[2]
            following = float(weight @ (trial**2).sum(axis=1))
            if following > cost:
                damping = max(10.0 * damping, 1e-3)
                if damping > 1e4:
                    break
                continue
            gain = 1.0 - following / max(cost, 1e-300)
            Q, left, cost, damping = turned, trial, following, damping / 10.0
            if gain < 1e-12:
                break
        return Q, cost

    def lifted(self) -> np.ndarray:
        """Orientation of the sensor nearest to the matrix that fits best."""
        n = len(self.y)
        A = np.zeros((n, 3, 12 + 3 * self.landmarks))
        for j in range(3):
            A[:, :, 3 * j : 3 * j + 3] = self.R * self.y[:, j, None, None]
        A[:, :, 9:12] = self.R
        for number in range(self.landmarks):
            A[self.k == number, :, 12 + 3 * number : 15 + 3 * number] = -np.eye(3)
        x = np.linalg.lstsq(A.reshape(3 * n, -1), -self.p.reshape(-1), rcond=1e-6)[0]
        return se3.nearest_rotation(x[:9].reshape(3, 3).T)


# A camera on the wrist that sees landmarks: postures in which they are in its sight.

FIELD_OF_VIEW = np.radians(40.0)
"""Full angle of the cone that the camera sees, by default: the smaller side of the picture of a common lens."""

SIGHT_RANGE = 0.2, 0.6
"""Distances from which a landmark is measured, by default, metres."""

TILT = np.radians(45.0)
"""Largest angle between a landmark's normal and the line of sight by default; flatter, patterns are measured badly."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class CameraInstrument(Instrument):
    """Landmarks, and a camera on the tool that looks along its z axis."""

    kind: ClassVar[type[Observation]] = Landmarks
    settings: ClassVar[tuple[Setting, ...]] = (
        Setting(
            "--landmarks",
            "LANDMARKS.csv",
            "Where landmarks or boards are, roughly: landmark, x_mm y_mm z_mm, i j k towards where it is seen from. "
            "Without it three are assumed before the task.",
            ("fixtures",),
        ),
        Setting(
            "--cone-deg",
            "DEG",
            "largest angle between a landmark's normal and the line of sight (45)",
            ("tilt",),
            float(np.radians(1.0)),
            180.0,
        ),
        Setting(
            "--range-mm", "LOW,HIGH", "distances at which the camera measures (200,600)", ("nearest", "farthest"), 1e-3
        ),
        Setting(
            "--fov-deg",
            "DEG",
            "Full angle that the camera sees (40).",
            ("field_of_view",),
            float(np.radians(1.0)),
            180.0,
        ),
    )
    field_of_view: float = FIELD_OF_VIEW
    """Full angle, radians."""
    nearest: float = SIGHT_RANGE[0]
    farthest: float = SIGHT_RANGE[1]
    """From the camera, metres."""
    tilt: float = TILT
    """Largest angle between a landmark's normal and the line of sight, radians."""

    @classmethod
    def arrange(
        cls,
        p: Float[np.ndarray, "n 3"],
        pointing: Float[np.ndarray, " 3"],
        reach: float,
        stated: Mapping[str, Any],
    ) -> Fixtures:
        """Before the tool."""
        low, high = stated.get("nearest", SIGHT_RANGE[0]), stated.get("farthest", SIGHT_RANGE[1])
        return _landmarks(p, pointing, 0.5 * (low + high))

    @property
    def instructions(self) -> str:
        """Instructions for the file of a plan."""
        return "fill in what the camera measures in the plan's file, row by row; identify then reads it"

    def goals(
        self, model: ErrorModel, task: Task, fixture: int, u: Float[np.ndarray, "n 6"]
    ) -> Float[np.ndarray, "n 4 4"]:
        """The camera anywhere before the landmark, turned so that it sees it somewhere in its picture."""
        before = Orientation(rotation=towards(self.fixtures.direction[fixture]), cone=self.tilt)
        sight = before.sample(u[:, :3])[:, :, 2]
        aim = np.stack([towards(-direction) for direction in sight])
        turned = Orientation(rotation=np.eye(3), cone=0.5 * self.field_of_view, spin=np.pi).sample(u[:, 3:])
        # the number that a turn of the cone about its own axis would use is free for the distance
        distance = self.nearest + (self.farthest - self.nearest) * u[:, 2]
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
        within = (distance >= self.nearest - edge) & (distance <= self.farthest + edge)
        seen = (sight * tip[:, :3, 2]).sum(axis=1) >= (np.cos(0.5 * self.field_of_view) - edge) * distance
        faces = -(sight * self.fixtures.direction[of]).sum(axis=1) >= (np.cos(self.tilt) - edge) * distance
        return {
            "the landmark too near, too far, out of the picture or too flat": ~(within & seen & faces),
            "the landmark behind the robot": ~self.sight_is_free(tip, of, links),
        }

    def observation(self, of: Int[np.ndarray, " n"]) -> Landmarks:
        """Landmarks, with that of each row."""
        return Landmarks(landmarks=self.fixtures.names, of=of)

    @property
    def unknown(self) -> Float[np.ndarray, " u"]:
        """Their places."""
        return self.fixtures.position.reshape(-1)


ASSUMED = ("a", "b", "c")
"""Landmarks where nobody states any."""


def _landmarks(p: Float[np.ndarray, "n 3"], pointing: Float[np.ndarray, " 3"], distance: float) -> Fixtures:
    """Three landmarks before the tool, as far from one another as the task has room, all facing it."""
    position = on_the_floor(far_apart(p, len(ASSUMED)) + distance * pointing)
    return Fixtures(names=ASSUMED, position=position, direction=np.tile(-pointing, (len(ASSUMED), 1)))
