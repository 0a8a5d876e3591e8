"""What stands in the cell to be observed from the tool, sockets, anchors or landmarks, and about where."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from taskcal.errors import FileError, shown
from taskcal.short_repr import short_repr
from taskcal.tabular.csv_form import read_csv
from taskcal.tabular.table import Table

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
