"""Readings in lines of text, as an instrument's software writes or sends them; a header or columns state the format once."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from taskcal.errors import FileError, TaskcalError, shown
from taskcal.live.devices import DeviceError, Shot
from taskcal.observations.base import Observation, ObservedColumns, Read, kinds
from taskcal.observations.point import Point
from taskcal.reading.columns import meanings
from taskcal.reading.positions import is_lost
from taskcal.reading.readings import quantity_of
from taskcal.tables.table import LARGEST, LENGTHS, number_of, trouble_with
from taskcal.tables.text import separator_of, split_line, with_point

_BEGINS_A_NUMBER = re.compile(r"[+-]?[.,]?\d")
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+(?:[eE][+-]?\d+)?", re.ASCII)


@dataclass(frozen=True, kw_only=True)
class PointColumns:
    """Where a line has its point."""

    names: tuple[str, ...]
    """Of all columns."""
    axes: tuple[int, int, int]
    """Columns of x, y and z."""
    metres: float
    """Size of their unit."""

    @classmethod
    def of(cls, text: str) -> "PointColumns":
        """Columns by their names, such as ``id x_mm y_mm z_mm`` or ``x [m];y [m];z [m]``; ``-`` for one to skip.

        Args:
            text: the names in order, with what parts them: blanks, commas, semicolons or tabs. Each position states its unit.

        Raises:
            TaskcalError: they do not name one point with its unit.
        """
        names = _split(text)
        known = meanings(names, [""] * len(names), ())
        places = [(one.index, k, one.unit) for k, one in enumerate(known) if one is not None and one.kind == "position"]
        if [axis for axis, _, _ in sorted(places)] != [0, 1, 2]:
            raise TaskcalError(
                f"'{shown(text)}' does not name the columns of one point; write for example 'x_mm y_mm z_mm', with - for each "
                "column to skip"
            )
        units = {unit for _, _, unit in places}
        unit = units.pop()
        if units or unit not in LENGTHS:
            raise TaskcalError(f"'{shown(text)}' states no unit of the point; write for example 'x_mm y_mm z_mm'")
        first, second, third = (k for _, k, _ in sorted(places))
        return cls(names=tuple(names), axes=(first, second, third), metres=LENGTHS[unit])

    def shot(self, line: str, time_s: float) -> Shot:
        """The point of a line, as a measurement made then.

        Raises:
            TaskcalError: as of `point`.
        """
        return shot_at(self.point(line), time_s)

    def point(self, line: str) -> Float[np.ndarray, " 3"]:
        """The point of a line, metres; NaN where the beam was lost, for which it has empty cells or zeros.

        Raises:
            TaskcalError: the line has other columns, or something else than a number.
        """
        cells = _cells(line, self.names)
        own = [cells[k] for k in self.axes]
        if all(map(is_lost, own)):
            return np.full(3, np.nan)
        pointed = _with_points(line, own)
        point = np.array([number_of(cell) for cell in pointed])
        for cell, number in zip(pointed, point, strict=True):
            if not abs(number) <= LARGEST:
                raise TaskcalError(
                    f"'{shown(line)}': {trouble_with(cell, 'give a number')}; have points alone written, or # before other lines, "
                    "and resume (--resume)"
                )
        point = point * self.metres
        return point if point.any() and np.isfinite(point).all() else np.full(3, np.nan)


@dataclass(frozen=True, kw_only=True)
class KindColumns:
    """Where a line has what a kind of observation without a tracker reads."""

    kind: type[Observation]
    names: tuple[str, ...]
    """Of all columns."""
    at: Mapping[str, tuple[int, str | None]]
    """Column and unit of each that the kind reads, by the kind's own name."""

    @classmethod
    def of(cls, kind: type[Observation], names: tuple[str, ...]) -> "KindColumns":
        """Columns by their names, such as ``d_mm`` and ``anchor``."""
        known = meanings(names, [""] * len(names), ())
        at = {one.target: (k, one.unit) for k, one in enumerate(known) if one is not None and one.kind == "observed"}
        return cls(kind=kind, names=names, at=at)

    def read(self, cells: Sequence[str], source: str | Path) -> Read | None:
        """What is read from the cells of a line; None where nothing was.

        Args:
            cells: one for each column.
            source: named in errors.

        Raises:
            FileError: a cell is not what it must be.
        """
        comma = any(_DECIMAL_COMMA.fullmatch(cell) for cell in cells)
        own = {name: with_point(cells[k], ",") if comma else cells[k] for name, (k, _) in self.at.items()}
        try:
            _with_points(" ".join(cells), [cells[k] for k, unit in self.at.values() if unit])
        except TaskcalError as error:
            raise FileError(Path(source), str(error)) from None
        return self.kind.read(
            ObservedColumns(
                path=Path(source),
                lines=np.ones(1, dtype=np.int64),
                cells={name: (cell,) for name, cell in own.items()},
                headers={name: self.names[k] for name, (k, _) in self.at.items()},
                units={name: quantity_of(unit) for name, (_, unit) in self.at.items()},
            )
        )

    def shot(self, line: str, time_s: float) -> Shot:
        """What a line states, as a measurement made then; it is not valid where its cells are empty.

        Raises:
            TaskcalError: the line has other columns, or a cell is not what it must be.
        """
        found = self.read(_cells(line, self.names), "line")
        if found is None:
            return Shot(time_s=time_s, point=np.full(3, np.nan), kind=self.kind.key, reason="nothing read")
        named = found.observation.named if self.kind.label in self.at else ()
        return Shot(time_s=time_s, point=found.points[0], kind=self.kind.key, fixture=named[0] if named else "")


def columns_of(text: str) -> PointColumns | KindColumns:
    """Columns by their names: of a point, or of a kind of observation without a tracker.

    Raises:
        TaskcalError: they are of neither, or state no unit.
    """
    names = tuple(_split(text))
    of_kind = KindColumns.of(Point, names)
    there = [one for one in kinds() if one.needed and of_kind.at.keys() >= set(one.needed)]
    return replace(of_kind, kind=max(there, key=lambda one: len(one.needed))) if there else PointColumns.of(text)


class Lines:
    """The lines of a file or a connection: a point each, after a header where there is one; comments are passed over."""

    def __init__(self, columns: PointColumns | KindColumns | None, source: str):
        """Begin.

        Args:
            columns: None where the first line, a header, names them.
            source: named in errors.
        """
        self._columns, self._source, self._begun = columns, source, False

    def shot(self, line: str, time_s: float, *, old: bool = False) -> Shot | None:
        """The point of a line that arrived then; None for one without, or that is old, of which the header alone counts.

        Raises:
            DeviceError: the line is not as it was stated.
        """
        line = line.strip()
        if not line or line.startswith(("#", "//")):
            return None
        first, self._begun = not self._begun, True
        try:
            if self._columns is None:
                self._columns = columns_of(line)
                return None
            if old or (first and not any(map(_BEGINS_A_NUMBER.match, _split(line)))):
                return None  # a header, beside the columns that were stated
            return self._columns.shot(line, time_s)
        except TaskcalError as error:
            raise DeviceError(f"{self._source}: {error}") from None


def shot_at(point: Float[np.ndarray, " 3"], time_s: float) -> Shot:
    """Shot of a point, which is NaN where the beam was lost."""
    return Shot(time_s=time_s, point=point, reason="" if np.isfinite(point).all() else "beam lost")


def _cells(line: str, names: Sequence[str]) -> Sequence[str]:
    """Cells of a line, one for each column.

    Raises:
        TaskcalError: there are more or fewer.
    """
    cells = _split(line, len(names))
    if len(cells) != len(names):
        raise TaskcalError(
            f"'{shown(line)}' has {len(cells)} fields, {len(names)} are stated ({' '.join(names)}); state the columns as they "
            "are (--columns)"
        )
    return cells


def _with_points(line: str, cells: Sequence[str]) -> list[str]:
    """Numbers of a line with decimal points.

    Raises:
        TaskcalError: some have a comma and others a point, either of which may part thousands.
    """
    comma = next(filter(_DECIMAL_COMMA.fullmatch, cells), None)
    point = next((cell for cell in cells if "." in cell and "," not in cell), None)
    if comma and point:
        raise TaskcalError(
            f"'{shown(line)}': '{shown(comma)}' has a comma and '{shown(point)}' a point; have all numbers written with one "
            f"decimal mark and no mark for thousands, such as {shown(comma.replace(',', '.'))} or {shown(comma.replace(',', ''))}"
        )
    return [with_point(cell, "," if comma else ".") for cell in cells]


def _split(line: str, count: int = 0) -> Sequence[str]:
    """Cells of a line: by semicolons or tabs where it has them, else by the separator that gives so many, where one does."""
    plain = next((separator for separator in (";", "\t") if separator in line), None)
    cells = split_line(line, plain or separator_of([line]))
    if count and len(cells) != count:
        cells = next((one for one in (split_line(line, ","), line.split()) if len(one) == count), cells)
    return cells if len(cells) > 1 else line.replace(",", " ").split()
