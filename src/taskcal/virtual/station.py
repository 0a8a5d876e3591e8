"""The measuring station: where the tracker stands, which reflectors the tool carries, and what is in the way."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from jaxtyping import Bool, Float
from pydantic import Field

from taskcal.arguments import repeated
from taskcal.errors import FileError, shown
from taskcal.geometry import se3
from taskcal.io.toml_file import Direction, Finite, HalfTurn, NotNegative, Positive, Quaternion, Section, read_toml
from taskcal.kinematics.clearance import Box, Links, beam_is_free
from taskcal.short_repr import short_repr
from taskcal.tables.forms import read_csv
from taskcal.tables.table import Table


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


# What stands in the cell to be observed from the tool, sockets, anchors or landmarks, and about where.

POSITION, DIRECTION = ("x_mm", "y_mm", "z_mm"), ("i", "j", "k")
"""Columns of the file."""

SHORTEST = 1e-6
"""Of a direction that is one."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Standing:
    """Several things of one kind, roughly where they stand: a measurement finds them anew."""

    names: tuple[str, ...]
    """As the rows of a campaign call them, ``PLACE/NAME`` where a block may stand at several places."""
    position: Float[np.ndarray, "things 3"]
    """In the robot's base, metres."""
    direction: Float[np.ndarray, "things 3"]
    """Unit vectors: out of a socket, or from a landmark to where it is seen from best."""

    @property
    def places(self) -> tuple[str, ...]:
        """Place of each; empty where none is named."""
        return tuple(name.rpartition("/")[0] for name in self.names)


def load_standing(path: str | Path, label: str) -> Standing:
    """Read a table of what stands where: its name, ``x_mm y_mm z_mm`` in the base, and optionally its direction ``i j k``.

    Args:
        path: its file.
        label: the column of the names, ``socket``, ``anchor`` or ``landmark``; sockets may have a ``place`` beside.

    Raises:
        FileError: the file cannot be read, lacks a column or a cell, or names a thing twice.
    """
    table = read_csv(path)
    names = _names(table, label)
    position = np.stack([table.numbers(column) for column in POSITION], axis=1) * 1e-3
    if not len(table):
        raise FileError(Path(path), f"names no {label}; give a row for each")
    return Standing(names=names, position=position, direction=_directions(table))


def _names(table: Table, label: str) -> tuple[str, ...]:
    names = table.texts(label)
    places = table.texts("place") if label == "socket" and "place" in table else [""] * len(names)
    out: list[str] = []
    for row, (place, name) in enumerate(zip(places, names, strict=True)):
        if not name or ("place" in table and label == "socket" and not place):
            column = "place" if name else label
            raise table.error("the cell is empty; give a name", row, column)
        for text, column in ((place, "place"), (name, label)):
            if "/" in text:
                raise table.error(f"'{shown(text)}' has a /, which parts place and {label}; leave it out", row, column)
        whole = f"{place}/{name}" if place else name
        if whole in out:
            raise table.error(f"'{shown(whole)}' stands twice; give each {label} its own name", row, label)
        out.append(whole)
    return tuple(out)


def _directions(table: Table) -> Float[np.ndarray, "things 3"]:
    given = [column for column in DIRECTION if column in table]
    if not given:
        return np.tile([0.0, 0.0, 1.0], (len(table), 1))
    direction = np.stack([table.numbers(column) for column in DIRECTION], axis=1)
    length = np.linalg.norm(direction, axis=1)
    for row in np.flatnonzero(length < SHORTEST):
        raise table.error("0 0 0 is not a direction; give for example 0 0 1", int(row), "i")
    return direction / length[:, None]
