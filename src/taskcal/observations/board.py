"""A board that stands, seen with its orientation in the frame of a sensor on the tool: a wrist camera and a printed pattern."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.observations.base import Differential, Measured, Observation, ObservedColumns, Read, Scene, written
from taskcal.observations.landmark import CameraInstrument, Landmarks
from taskcal.observations.pose import turn_by_rotation
from taskcal.short_repr import short_repr
from taskcal.task.orientation import towards

QUATERNION = ("sqx", "sqy", "sqz", "sqw")

UNIT_LENGTH = 1e-2
"""By which the length of a quaternion may differ from 1."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Boards(Landmarks):
    """Y = X⁻¹·L: the board's frame L, in the sensor's frame X on the tool; where both are is unknown."""

    key: ClassVar[str] = "board"
    needed: ClassVar[tuple[str, ...]] = ("sx", "sy", "sz", *QUATERNION)
    columns: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType(
        {**Landmarks.columns, **{name: (name, f"sensor {name[1:]}") for name in QUATERNION}}
    )
    width: ClassVar[int] = 6
    angles: ClassVar[int] = 3
    oriented: ClassVar[bool] = True
    instrument: ClassVar[str] = "board"
    turn_resolution: ClassVar[float] = 1e-3  # a tenth of a millimetre over a hand's breadth
    word: ClassVar[str] = "board"
    each: ClassVar[tuple[str, ...]] = ("tx", "ty", "tz", "rx", "ry", "rz")

    def differentiate(
        self, target: Float[np.ndarray, "n 4 4"], unknown: Float[np.ndarray, " u"], measured: Measured
    ) -> Differential:
        """Residual and derivatives, in the sensor's frame."""
        assert measured.rotations is not None
        n, k, seen = len(target), self.numbers, measured.valid
        boards = unknown.reshape(-1, 6)
        at = super().differentiate(target, boards[:, :3].reshape(-1), measured)
        back = np.swapaxes(target[:, :3, :3], 1, 2)
        predicted = back @ se3.exp(boards[:, 3:])[k]
        turned = np.zeros((n, 3))
        turned[seen] = se3.log(measured.rotations[seen] @ np.swapaxes(predicted[seen], 1, 2))
        by_turn = turn_by_rotation(turned) @ back
        by_target = np.concatenate([at.by_target, np.zeros((n, 3, 6))], axis=1)
        by_target[:, 3:, 3:] = -by_turn
        by_unknown = np.zeros((n, 6, len(boards), 6))
        by_unknown[:, :3, :, :3] = at.by_unknown.reshape(n, 3, len(boards), 3)
        turning = np.stack([se3.left_jacobian(r) for r in boards[:, 3:]])
        by_unknown[np.arange(n), 3:, k, 3:] = by_turn @ turning[k]
        return Differential(np.concatenate([at.residual, turned], axis=1), by_target, by_unknown.reshape(n, 6, -1))

    def settle(
        self, target: Float[np.ndarray, "n 4 4"], measured: Measured, known: Float[np.ndarray, " u"]
    ) -> Float[np.ndarray, " u"]:
        """Each board at the mean of what its own rows say."""
        places = super().settle(target, measured, known.reshape(-1, 6)[:, :3].reshape(-1)).reshape(-1, 3)
        return np.concatenate([places, self._turned(target, measured)], axis=1).reshape(-1)

    def _turned(self, target: Float[np.ndarray, "n 4 4"], measured: Measured) -> Float[np.ndarray, "boards 3"]:
        """Rotation vector of each board, the middle of what its rows say; NaN where no row shows it."""
        assert measured.rotations is not None
        R, seen = target[:, :3, :3] @ measured.rotations, measured.valid
        out = np.full((len(self.landmarks), 3), np.nan)
        for number in np.unique(self.numbers[seen]):
            own = R[seen & (self.numbers == number)]
            middle = se3.nearest_rotation(np.median(own, axis=0))
            out[number] = se3.log(se3.exp(np.median(se3.log(own @ middle.T), axis=0)) @ middle)
        return out

    @classmethod
    def stage(cls, tool: Float[np.ndarray, "n 4 4"], places: int | None, rng: np.random.Generator) -> Scene:
        """Stage it as a landmark, the board turned towards the sensor, but for some 20°."""
        scene = super().stage(tool, places, rng)
        landmarks = scene.unknown.reshape(-1, 3)
        facing = se3.nearest_rotation(tool[:, :3, :3].mean(axis=0))
        turned = se3.log(se3.exp(0.2 * rng.normal(size=landmarks.shape)) @ facing)
        return scene._replace(unknown=np.concatenate([landmarks, turned], axis=1).reshape(-1))

    @classmethod
    def read(cls, columns: ObservedColumns) -> Read | None:
        """A sighting with a quaternion in every row that has all seven numbers.

        Raises:
            FileError: some of the numbers, or the board's name, are lacking, or a quaternion has not the length 1.
        """
        if not all(name in columns for name in QUATERNION):
            return None
        found = cls.sightings(columns)
        if found is None:
            return None
        quaternion = np.stack([columns.numbers(name) for name in QUATERNION], axis=1)
        seen = np.isfinite(found.points[:, 0])
        for row in np.flatnonzero(seen & ~np.isfinite(quaternion).all(axis=1)):
            raise columns.error("a board seen here needs all of sqx sqy sqz sqw", int(row), "sqx")
        length = np.linalg.norm(quaternion, axis=1)
        for row in np.flatnonzero(seen & (np.abs(length - 1.0) > UNIT_LENGTH)):
            raise columns.error(
                f"the quaternion has length {length[row]:.4f}; it must be 1 (is sqw last?)", int(row), "sqx"
            )
        quaternion[~seen] = (0.0, 0.0, 0.0, 1.0)
        return found._replace(rotations=se3.from_quaternion(quaternion / np.linalg.norm(quaternion, axis=1)[:, None]))

    def cells(self, measured: Measured) -> dict[str, list[str]] | None:
        """Position, quaternion and board of every row."""
        assert measured.rotations is not None
        quaternion, seen = se3.to_quaternion(measured.rotations), measured.valid
        quaternion[~seen] = np.nan
        turned = {name: written(quaternion[:, k], 10) for k, name in enumerate(QUATERNION)}
        return {**(super().cells(measured) or {}), **turned}


# A camera on the wrist that sees boards, and how they are turned.


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class BoardInstrument(CameraInstrument):
    """Boards in place of landmarks; about their directions they may be turned anyhow."""

    kind: ClassVar[type[Observation]] = Boards

    @property
    def unknown(self) -> Float[np.ndarray, " u"]:
        """Their places, and how they are turned."""
        turned = np.stack([se3.log(towards(direction)) for direction in self.fixtures.direction])
        return np.concatenate([self.fixtures.position, turned], axis=1).reshape(-1)
