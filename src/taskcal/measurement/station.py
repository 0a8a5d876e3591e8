"""The measuring station: where the tracker stands, which reflectors the tool carries, and what is in the way."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from jaxtyping import Bool, Float
from pydantic import Field

from taskcal.errors import FileError
from taskcal.geometry import se3
from taskcal.kinematics.clearance import Box, Links, beam_is_free
from taskcal.repeated import repeated
from taskcal.short_repr import short_repr
from taskcal.toml_file import Direction, Finite, HalfTurn, NotNegative, Positive, Quaternion, Section, read_toml


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Reflector:
    """A reflector on the tool."""

    name: str
    position: Float[np.ndarray, " 3"]
    """Centre in the tool frame, metres."""
    axis: Float[np.ndarray, " 3"] | None
    """Direction it looks in, in the tool frame; None for a reflector that is seen from everywhere."""
    acceptance: float
    """Largest angle between its axis and the beam, radians."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Station:
    """Where and what the tracker measures."""

    position: Float[np.ndarray, " 3"]
    """Of the tracker in the robot's base, metres."""
    reach: float
    """Farthest measured distance, metres."""
    nearest: float
    """Nearest measured distance, metres."""
    reflectors: tuple[Reflector, ...]
    keep_out: tuple[Box, ...]
    """Boxes that neither robot nor beam may enter."""

    @property
    def T_tracker_base(self) -> Float[np.ndarray, "4 4"]:
        """The base seen from a tracker that stands parallel to it."""
        return se3.translation(*(-self.position))

    @property
    def offsets(self) -> Float[np.ndarray, "targets 3"]:
        """Reflector centres in the tool frame, metres."""
        return np.stack([reflector.position for reflector in self.reflectors])

    def visible(self, T: Float[np.ndarray, "n 4 4"], links: Links) -> Bool[np.ndarray, "n targets"]:
        """Which reflectors the tracker sees at tool poses T in the base."""
        seen = np.zeros((len(T), len(self.reflectors)), dtype=bool)
        for k, reflector in enumerate(self.reflectors):
            center = se3.apply(T, np.broadcast_to(reflector.position, (len(T), 3)))
            way = self.position - center
            distance = np.linalg.norm(way, axis=1)
            ok = (distance <= self.reach) & (distance >= self.nearest)
            if reflector.axis is not None:
                looks = T[:, :3, :3] @ reflector.axis
                ok &= (looks * way).sum(axis=1) >= np.cos(reflector.acceptance) * distance
            seen[:, k] = ok & beam_is_free(self.position, center, links, self.keep_out)
        return seen


class ReflectorSection(Section):
    """A reflector of a station file."""

    name: str = Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")
    position_mm: tuple[Finite, Finite, Finite]
    axis: Direction | None = None
    acceptance_deg: Annotated[HalfTurn, Field(gt=0)] = 30.0

    def reflector(self) -> Reflector:
        """The reflector it describes."""
        axis = None if self.axis is None else np.array(self.axis) / np.linalg.norm(self.axis)
        return Reflector(
            name=self.name,
            position=np.array(self.position_mm) * 1e-3,
            axis=axis,
            acceptance=float(np.radians(self.acceptance_deg)),
        )


class BoxSection(Section):
    """A box of a station file, in the robot's base."""

    center_mm: tuple[Finite, Finite, Finite]
    size_mm: tuple[Positive, Positive, Positive]
    quaternion: Quaternion = (0.0, 0.0, 0.0, 1.0)

    def box(self) -> Box:
        """The box it describes."""
        R = se3.from_quaternion(np.array(self.quaternion))
        return Box(pose=se3.pose(R, np.array(self.center_mm) * 1e-3), size=np.array(self.size_mm) * 1e-3)


class StationFile(Section):
    """A station file."""

    position_mm: tuple[Finite, Finite, Finite]
    reach_m: Positive = 30.0
    nearest_m: NotNegative = 0.5
    reflector: tuple[ReflectorSection, ...] = Field(min_length=1, max_length=100)
    keep_out: tuple[BoxSection, ...] = ()

    def station(self) -> Station:
        """The station it describes."""
        return Station(
            position=np.array(self.position_mm) * 1e-3,
            reach=self.reach_m,
            nearest=self.nearest_m,
            reflectors=tuple(section.reflector() for section in self.reflector),
            keep_out=tuple(section.box() for section in self.keep_out),
        )


def load_station(path: str | Path) -> Station:
    """Read a station file.

    Raises:
        FileError: it is missing, no TOML, or does not describe a station.
    """
    path = Path(path)
    described = read_toml(path, StationFile)
    names = [section.name for section in described.reflector]
    if twice := repeated(names):
        raise FileError(path, f"two reflectors are named '{min(twice)}'; give each its own name")
    return described.station()
