"""The concept: an observation is a function of the pose of something on the tool, with unknowns and noise of its own."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.arguments import checked
from taskcal.errors import CampaignError, FileError, TaskcalError, UnknownName, shown
from taskcal.io.codec import NOT_IN_FILE, decode, describe
from taskcal.robot.parameter import ShownUnit
from taskcal.short_repr import short_repr
from taskcal.tables.table import Table
from taskcal_groundwork.plugins import load_plugins, state_faults

# Columns of a file that a kind of observation reads, by the kind's own names for them.

Quantity = Literal["length", "angle"]


@dataclass(frozen=True, eq=False, kw_only=True)
class ObservedColumns:
    """The cells of such columns."""

    path: Path
    lines: Int[np.ndarray, " n"]
    """Of the file, from 1."""
    cells: Mapping[str, tuple[str, ...]]
    """As text, by the kind's name of the column."""
    headers: Mapping[str, str]
    """The file's name of each column."""
    units: Mapping[str, tuple[Quantity, float] | None]
    """Quantity and factor to metres or radians of each column's unit; None where it states none."""

    def __contains__(self, column: str) -> bool:
        return column in self.cells

    def __len__(self) -> int:
        return len(self.lines)

    def texts(self, column: str) -> tuple[str, ...]:
        """The cells of a column; empty ones where there is no such column."""
        return self.cells.get(column, ("",) * len(self.lines))

    def lengths(self, column: str) -> Float[np.ndarray, " n"]:
        """The numbers of a column, metres; NaN for empty cells.

        Raises:
            FileError: a cell is not a number, or the column states no unit.
        """
        return self._in_unit(column, "length", "mm")

    def angles(self, column: str) -> Float[np.ndarray, " n"]:
        """The numbers of a column, radians; NaN for empty cells.

        Raises:
            FileError: a cell is not a number, or the column states no unit.
        """
        return self._in_unit(column, "angle", "deg")

    def _in_unit(self, column: str, quantity: Quantity, usual: str) -> Float[np.ndarray, " n"]:
        stated, name = self.units[column], self.headers[column]
        if stated is None:
            raise FileError(self.path, f"the unit is not stated; name the column {name}_{usual}", line=1, column=name)
        if stated[0] != quantity:
            message = f"states the unit of a {stated[0]}, and is a {quantity}"
            raise FileError(self.path, message.replace("a angle", "an angle"), line=1, column=name)
        return stated[1] * self.numbers(column)

    def numbers(self, column: str) -> Float[np.ndarray, " n"]:
        """The numbers of a column as they stand; NaN for empty cells.

        Raises:
            FileError: a cell is not a number.
        """
        rows = tuple((text,) for text in self.cells[column])
        lines = tuple(int(line) for line in self.lines)
        table = Table(path=self.path, header=(self.headers[column],), rows=rows, lines=lines)
        return table.numbers(self.headers[column], empty=True)

    def error(self, message: str, row: int, column: str) -> FileError:
        """An error that points at a cell."""
        return FileError(self.path, message, line=int(self.lines[row]), column=self.headers.get(column, column))

    def refuse_without(self, column: str, present: np.ndarray, needs: str) -> None:
        """See that rows which have one thing have another.

        Raises:
            FileError: a row has no cell where it needs one.
        """
        for row in np.flatnonzero(present):
            if not self.texts(column)[row]:
                raise self.error(f"the cell is empty; {needs}", int(row), column)

    def named(
        self, column: str, there: Bool[np.ndarray, " n"], needs: str
    ) -> tuple[tuple[str, ...], Int[np.ndarray, " n"]]:
        """Names of what the rows that are there refer to, and which of them each does, as of `refer`; ``1`` without the column.

        Raises:
            FileError: a row that is there has no name; `needs` says what to write.
        """
        if column in self:
            self.refuse_without(column, there, needs)
        texts = self.texts(column) if column in self else ("1",) * len(self)
        return refer(tuple(text if here else "" for text, here in zip(texts, there, strict=True)))

    def take(self, rows: Int[np.ndarray, " k"]) -> "ObservedColumns":
        """Some of the rows."""
        cells = {name: tuple(texts[i] for i in rows) for name, texts in self.cells.items()}
        return replace(self, lines=self.lines[rows], cells=cells)

    def shown(self, column: str, row: int) -> str:
        """A cell, for a message."""
        return shown(self.cells[column][row])


# Uncertainty of a laser tracker's points: along the beam and across it, growing with distance.


@checked
@short_repr
@dataclass(frozen=True, kw_only=True)
class TrackerNoise:
    """Maximum permissible errors of range and transverse position, linear in the distance, and what share is 1σ.

    The defaults are those of a Leica AT901: ±(15 µm + 6 µm/m) in both, with the MPE taken as two standard deviations.
    """

    range_m: float = 15e-6
    """MPE along the beam, metres."""
    range_per_m: float = 6e-6
    transverse_m: float = 15e-6
    """MPE across the beam, metres."""
    transverse_per_m: float = 6e-6
    mpe_to_sigma: float = 0.5
    """1σ per MPE: 0.5 where the MPE is two standard deviations, 1/√3 for a rectangular distribution."""
    station: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where the beam leaves, in the measuring frame, metres."""
    rotation: float = 5e-5
    """1σ of each rotation component of a measured pose, radians."""

    def covariance(self, points: Float[np.ndarray, "*b 3"]) -> Float[np.ndarray, "*b 3 3"]:
        """Covariance of measured points, m²; NaN stays NaN."""
        beam = points - np.asarray(self.station)
        distance = np.linalg.norm(beam, axis=-1)[..., None]
        u = beam / np.maximum(distance, 1e-9)
        along = (self.mpe_to_sigma * (self.range_m + self.range_per_m * distance)) ** 2
        across = (self.mpe_to_sigma * (self.transverse_m + self.transverse_per_m * distance)) ** 2
        return across[..., None] * np.eye(3) + (along - across)[..., None] * u[..., :, None] * u[..., None, :]


UNMEASURED = 1.0
"""Variance of what a kind does not measure of its block, m² or rad²: as good as infinite, and finite for the algebra."""


class Measured(NamedTuple):
    """Readings of one target, row by row."""

    points: Float[np.ndarray, "n 3"]
    """The kind's numbers, metres or radians, those it does not measure zero; NaN where nothing was."""
    rotations: Float[np.ndarray, "n 3 3"] | None = None
    """Rotations, for kinds that measure them."""

    @property
    def valid(self) -> Bool[np.ndarray, " n"]:
        """Rows in which something was read."""
        return ~np.isnan(self.points[:, 0])

    def take(self, rows: Int[np.ndarray, " k"] | Bool[np.ndarray, " n"]) -> "Measured":
        """Some of the rows."""
        return Measured(self.points[rows], None if self.rotations is None else self.rotations[rows])


class Differential(NamedTuple):
    """An observation about an estimate, w numbers a row."""

    residual: Float[np.ndarray, "n w"]
    """Measured less predicted."""
    by_target: Float[np.ndarray, "n w 6"]
    """Derivative of what is predicted by the target's twist: velocity of its centre, then rotation, in the measuring frame."""
    by_unknown: Float[np.ndarray, "n w u"]
    """The same by the kind's own unknowns."""


class Placed(NamedTuple):
    """Registered target and unknowns of its kind."""

    T_tool_target: Float[np.ndarray, "4 4"]
    unknown: Float[np.ndarray, " u"]
    distance: Float[np.ndarray, " n"]
    """Residual of each row, metres; zero where nothing was read. A kind that measures angles alone takes them at an arm of 1 m."""
    unobservable: Float[np.ndarray, "3 3"]
    """Projector onto directions in which the rows do not tell where the target sits on the tool."""


class Read(NamedTuple):
    """Readings of one target in a file."""

    target: str
    """Its name."""
    observation: "Observation"
    points: Float[np.ndarray, "n 3"]
    """The kind's numbers, metres or radians; NaN where nothing was read."""
    rotations: Float[np.ndarray, "n 3 3"] | None = None


class Scene(NamedTuple):
    """Fixtures and tool of a virtual cell in which a kind is measured."""

    observation: "Observation"
    """With what each row refers to."""
    target: str
    """Name of what is on the tool."""
    T_tool_target: Float[np.ndarray, "4 4"]
    unknown: Float[np.ndarray, " u"]
    """The kind's unknowns as they are, in the measuring frame."""
    approach: Callable[[Float[np.ndarray, "k 4 4"], Int[np.ndarray, " k"]], Float[np.ndarray, "k 4 4"]] | None = None
    """From poses of the target, and the rows that they are of, to the poses nearby at which those rows are measured; None where
    any pose will do."""


class Stated(NamedTuple):
    """Stated values of unknowns: stated minus estimated, derivative, and uncertainty."""

    residual: Float[np.ndarray, " k"]
    by_unknown: Float[np.ndarray, "k u"]
    uncertainty: Float[np.ndarray, " k"]


_KINDS: dict[str, type["Observation"]] = {}
"""Every kind by its key, entered as it is defined."""

GROUP = "taskcal.observations"
"""Entry points of other packages: classes of kinds."""


@dataclass(frozen=True, kw_only=True)
class Compared:
    """A length that is stated, and the same as the calibrated robot finds it."""

    name: str
    stated: float
    """Metres."""
    found: float
    """Metres."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Observation(ABC):
    """A kind of observation of one target, with what each row refers to.

    The frame of the target is on the tool; poses are in the measuring frame, which is the tracker's where there is one and
    the robot's base where there is none.
    """

    key: ClassVar[str]
    """Name of the kind, in files."""
    width: ClassVar[int] = 3
    """Numbers that it measures in a row, lengths first."""
    angles: ClassVar[int] = 0
    """How many of them, the last, are angles."""
    oriented: ClassVar[bool] = False
    """Whether it measures rotations."""
    turned: ClassVar[bool] = False
    """Whether it depends on how the target is turned on the tool."""
    along_axes: ClassVar[bool] = False
    """Whether its first three numbers are along the axes of the measuring frame: neither a length nor in a sensor's axes."""
    in_tracker: ClassVar[bool] = False
    """Whether it is measured in a frame that stands, whose pose is unknown."""
    streamed: ClassVar[bool] = False
    """Whether it is the position of the target itself, which compiled passes differentiate as they walk the chain."""
    instrument: ClassVar[str] = ""
    """What it is measured with, in a word: the kind's name on the command line."""
    standing_words: ClassVar[tuple[str, ...]] = ()
    """Columns that may name what stands, in its file; the label where there are none."""
    stated_lengths: ClassVar[str] = ""
    """What lengths may be stated of it beside its rows, in words; empty for none."""
    touched: ClassVar[bool] = False
    """Whether no number is read, but the robot is brought to where something touches."""
    pictured: ClassVar[bool] = False
    """Whether its rows only name pictures, which are looked at afterwards."""
    quick: ClassVar[bool] = False
    """Whether it is placed in a millisecond, so that all mistakes of a campaign and their pairs can be tried."""
    columns: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType({})
    """Columns that it reads, each with the words that people write for it, in small letters and parted by blanks."""
    needed: ClassVar[tuple[str, ...]] = ()
    """Those of them that a file must have."""
    things: ClassVar[str] = ""
    """The field that names what rows refer to; empty where they refer to nothing."""
    word: ClassVar[str] = ""
    """What one of them is called in the names of its unknowns; the label by default."""
    each: ClassVar[tuple[str, ...]] = ()
    """Last parts of the names of the unknowns that each of them has."""
    label: ClassVar[str] = ""
    """The column that names what each row refers to: a file with a tracker's points has the kind only where this is there. Empty
    for a kind whose columns mean nothing else."""
    units: ClassVar[Mapping[str, ShownUnit]] = MappingProxyType(dict.fromkeys(("rx", "ry", "rz"), ShownUnit.of("rad")))
    """Units in which people see its unknowns, by the last part of their names; millimetres for all others."""
    of: Annotated[Int[np.ndarray, " n"] | None, NOT_IN_FILE] = None
    """Which of several things each row refers to, −1 for none; None where there is one, or where no rows belong to it."""

    def __init_subclass__(cls) -> None:
        """Register it.

        Raises:
            TaskcalError: another kind has its key or its instrument, or it needs a column that it does not read.
        """
        super().__init_subclass__()
        if "key" not in vars(cls):
            return
        said = f"the kind of observation {cls.__name__} of the module {cls.__module__}"
        taken = [(cls.key, other) for other in _KINDS.values() if other.key == cls.key]
        taken += [(cls.instrument, other) for other in _KINDS.values() if cls.instrument == other.instrument != ""]
        for name, other in taken:
            if (other.__module__, other.__qualname__) != (cls.__module__, cls.__qualname__):
                raise TaskcalError(
                    f"{said} cannot be called '{name}': {other.__name__} of {other.__module__} is; choose another name"
                )
        if lacking := {*cls.needed, *filter(None, [cls.label])} - cls.columns.keys():
            raise TaskcalError(
                f"{said} needs the column '{min(lacking)}' and does not read it; name it in its columns "
                f"({', '.join(cls.columns) or 'none'}), too"
            )
        _KINDS[cls.key] = cls

    @classmethod
    def block(cls) -> list[int]:
        """Places of its numbers in a target's block of three lengths and three angles."""
        lengths = cls.width - cls.angles
        return [*range(lengths), *range(3, 3 + cls.angles)]

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Names of its own unknowns: by default those of each thing, one thing after another."""
        return tuple(f"{self.word or self.label} {name}.{last}" for name in self.named for last in self.each)

    @property
    def deviations(self) -> Float[np.ndarray, " u"]:
        """Standard deviations of its unknowns about where they start: by default as good as unknown."""
        return np.ones(len(self.unknowns))

    @property
    def tells_scale(self) -> bool:
        """Whether it compares the robot with a length that is known."""
        return True

    @property
    def shrinks(self) -> bool:
        """Whether nothing in it holds the size of the robot: its residuals vanish with it, or do not depend on it."""
        return False

    @abstractmethod
    def differentiate(
        self, target: Float[np.ndarray, "n 4 4"], unknown: Float[np.ndarray, " u"], measured: Measured
    ) -> Differential:
        """Residual and derivatives at poses of the target; rows in which nothing was read may hold anything."""

    @abstractmethod
    def covariance(
        self, measured: Measured, uncertainty: Float[np.ndarray, " n"] | None, tracker: TrackerNoise
    ) -> Float[np.ndarray, "n w w"]:
        """Covariance of the noise of each row, m² and rad²; from the uncertainty, metres, where the campaign states it."""

    def settle(
        self, target: Float[np.ndarray, "n 4 4"], measured: Measured, known: Float[np.ndarray, " u"]
    ) -> Float[np.ndarray, " u"]:
        """The unknowns that fit best where the poses of the target are known; NaN for those that no row shows.

        Args:
            target: its poses.
            measured: what was read.
            known: the unknowns as a calibration has them, NaN for those that it does not know; of no concern to most kinds.
        """
        return np.nan_to_num(known)

    def stated(self, unknown: Float[np.ndarray, " u"]) -> Stated:
        """Stated knowledge of the unknowns."""
        return Stated(np.zeros(0), np.zeros((0, len(unknown))), np.zeros(0))

    def with_unknown_scale(self) -> "Observation | None":
        """Return the observation with an unknown instrument scale, or None if the kind has no scale."""
        return None

    def compare(self, unknown: Float[np.ndarray, " u"]) -> tuple[Compared, ...]:
        """Compare stated lengths with those found; empty for kinds of which nothing is stated."""
        return ()

    def named_like(self, other: "Observation", unknown: Float[np.ndarray, " u"]) -> Float[np.ndarray, " v"]:
        """Another one's unknowns in the order of these, NaN for those it does not have."""
        known = dict(zip(other.unknowns, unknown, strict=True))
        return np.array([known.get(name, np.nan) for name in self.unknowns])

    def count_numbers(self, valid: Bool[np.ndarray, " n"]) -> int:
        """How many numbers were measured in the rows in which something was read."""
        return self.width * int(valid.sum())

    def told_of_unknowns(self, unknown: Float[np.ndarray, " u"]) -> Float[np.ndarray, "n k u"]:
        """Derivatives of what each row tells of the unknowns alone, wherever its target is, over the noise; nothing by default."""
        return np.zeros((0 if self.of is None else len(self.of), 0, len(unknown)))

    @property
    def numbers(self) -> Int[np.ndarray, " n"]:
        """Number of what each row refers to, any for rows that refer to nothing."""
        assert self.of is not None
        return np.maximum(self.of, 0)

    @property
    def named(self) -> tuple[str, ...]:
        """Names of what rows refer to."""
        return getattr(self, self.things) if self.things else ()

    def labels(self, measured: Measured) -> list[str]:
        """The name that each row refers to; empty where nothing was read."""
        assert self.of is not None
        return [self.named[k] if k >= 0 and there else "" for k, there in zip(self.of, measured.valid, strict=True)]

    def blank(self, count: int) -> Measured:
        """So many rows as if everything read zero."""
        return Measured(np.zeros((count, 3)), np.tile(np.eye(3), (count, 1, 1)) if self.oriented else None)

    def reproject(
        self, target: Float[np.ndarray, "n 4 4"], unknown: Float[np.ndarray, " u"]
    ) -> tuple[Float[np.ndarray, "c 2"], ...] | None:
        """Pixels of each camera's corners less those predicted for the target where the robot has it; None without pictures."""
        return None

    def with_stated(self, path: Path) -> "Observation | None":
        """The observation with the lengths that a file states; None for kinds of which nothing is stated."""
        return None

    def stated_text(self) -> str | None:
        """The file that `with_stated` reads; None for kinds of which nothing is stated."""
        return None

    def take(self, rows: Int[np.ndarray, " k"]) -> "Observation":
        """The observation of some rows, with what these refer to."""
        if self.of is None:
            return self
        names, of = refer(tuple(self.named[k] if k >= 0 else "" for k in self.of[rows]))
        return replace(self, of=of, **{self.things: names})

    @classmethod
    def stage(cls, tool: Float[np.ndarray, "n 4 4"], places: int | None, rng: np.random.Generator) -> Scene:
        """A virtual cell for robots that measure about some poses of the tool.

        Args:
            tool: one for each row, in the measuring frame.
            places: how many things stand there; as many as are usual by default.
            rng: source of what differs from cell to cell.

        Raises:
            CampaignError: the kind does not say.
        """
        raise CampaignError(f"'{cls.key}' observations cannot be simulated: the kind says nothing of a cell for them")

    def check_unit(self, tool: Float[np.ndarray, "n 4 4"], measured: Measured) -> None:
        """Raise a `UnitError` where few rows tell that numbers are in another unit than they are taken for; by default never."""
        return

    def place(self, tool: Float[np.ndarray, "n 4 4"], measured: Measured) -> Placed:
        """Estimate target and unknowns from poses of the tool alone; for a tracker's measurements the registration finds them."""
        raise CampaignError(
            f"'{self.key}' observations do not tell their own place; they are registered with the tracker"
        )

    @classmethod
    def read(cls, columns: ObservedColumns) -> Read | None:
        """Read the kind's columns of a file; None where it does not have them.

        Raises:
            FileError: a cell is not what it must be.
        """
        return None

    def cells(self, measured: Measured) -> dict[str, list[str]] | None:
        """Columns of a file from which `read` reads the same; None for what a tracker measured."""
        return None

    def describe(self) -> dict[str, Any]:
        """Describe it for a file, beside its key: all but the rows, where these refer to things."""
        return describe(self) if self.things else {}

    @classmethod
    def of_description(cls, content: Mapping[str, Any]) -> "Observation":
        """Make it from what `describe` gave, or a file has of it, without rows.

        Raises:
            TaskcalError: a field is not as its type wants it; the message names it.
        """
        return decode(cls, content, brief=True)


def kinds() -> tuple[type[Observation], ...]:
    """Every kind that is defined; those of other packages behind Taskcal's own."""
    load_plugins(GROUP, Observation, _KINDS)
    return tuple(_KINDS.values())


def find_columns(texts: Sequence[str], *, tracked: bool) -> dict[int, str]:
    """Columns of kinds of observation that need no tracker, by the kinds' own names.

    A kind is there with the columns that it needs; beside a tracker's points, where ``d`` and ``sx`` may mean something else, with
    the column that names what it refers to, if it has one.
    """
    out: dict[int, str] = {}
    for kind in kinds():
        at = {
            column: next((k for k, text in enumerate(texts) if text in words), None)
            for column, words in kind.columns.items()
        }
        there = bool(kind.needed) and all(at[column] is not None for column in kind.needed)
        if there and (not tracked or not kind.label or at[kind.label] is not None):
            out |= {k: column for column, k in at.items() if k is not None}
    return out


def instrument_of(name: str) -> type[Observation]:
    """The kind that is measured with an instrument.

    Raises:
        UnknownName: there is none.
    """
    found = {kind.instrument: kind for kind in kinds() if kind.instrument}
    if name not in found:
        raise UnknownName("instrument", name, tuple(found), state_faults(GROUP))
    return found[name]


def kind_of(key: str) -> type[Observation]:
    """The kind of a key.

    Raises:
        UnknownName: there is none.
    """
    found = next((kind for kind in kinds() if kind.key == key), None)
    if found is None:
        raise UnknownName("kind of observation", key, tuple(_KINDS), state_faults(GROUP))
    return found


def block_size(kinds: Sequence[Observation | type[Observation]]) -> int:
    """Numbers of a target's block: three lengths, and three angles where any kind measures some."""
    return 6 if any(kind.angles for kind in kinds) else 3


def check_lengths(kinds: Iterable[Observation | type[Observation]], source: str = "") -> None:
    """See that not only angles are measured: no angle depends on where the tool is.

    Args:
        kinds: of observation of each target.
        source: the file a message is about, in front of it.

    Raises:
        CampaignError: no kind measures a length.
    """
    if all(kind.width == kind.angles for kind in kinds):
        raise CampaignError(
            f"{source}angles alone do not tell where the tool is; measure positions or lengths beside them: a tracker's points, "
            "balls in sockets, a wire"
        )


def error_lengths(
    residual: Float[np.ndarray, "n targets b"], kinds: Sequence[Observation | type[Observation]]
) -> Float[np.ndarray, "n targets"]:
    """Length of each residual, metres; of kinds that measure angles alone their angle, at an arm of 1 m.

    Args:
        residual: in blocks, metres and radians.
        kinds: of each target.
    """
    out = np.linalg.norm(residual[..., :3], axis=2)
    for t, kind in enumerate(kinds):
        if kind.width == kind.angles:
            out[:, t] = np.linalg.norm(residual[:, t, 3:], axis=1)
    return out


def refer(labels: tuple[str, ...]) -> tuple[tuple[str, ...], Int[np.ndarray, " n"]]:
    """Different names in the order in which they come, and which of them each row has; −1 where it has none."""
    names = tuple(dict.fromkeys(label for label in labels if label))
    number = {name: k for k, name in enumerate(names)}
    return names, np.array([number.get(label, -1) for label in labels], dtype=int)


# Where things stand in a virtual cell: well inside of what the tool reaches, and far from each other.

INNER = 0.5
"""Share of the positions, those nearest to the middle, that things stand at."""


def spots(position: Float[np.ndarray, "n 3"], count: int) -> Int[np.ndarray, " count"]:
    """Numbers of some positions: the one nearest to the middle, then always the one farthest from those taken.

    Some come twice where there are fewer positions.
    """
    away = np.linalg.norm(position - np.median(position, axis=0), axis=1)
    inner = np.argsort(away)[: max(int(INNER * len(position)), min(count, len(position)))]
    taken = [int(inner[0])]
    while len(taken) < count:
        near = np.linalg.norm(position[inner][:, None] - position[taken], axis=2).min(axis=1)
        taken.append(int(inner[np.argmax(near)]))
    return np.array(taken)


def written(values: Float[np.ndarray, " n"], decimals: int = 6) -> list[str]:
    """Numbers as cells of a file; empty ones for NaN."""
    return ["" if np.isnan(value) else f"{value:.{decimals}f}" for value in values]


def means(values: Float[np.ndarray, "n ..."], numbers: Int[np.ndarray, " n"], count: int) -> Float[np.ndarray, "k ..."]:
    """Mean of the rows of each of so many things; NaN of those without rows."""
    out = np.full((count, *values.shape[1:]), np.nan)
    for number in np.unique(numbers):
        out[number] = values[numbers == number].mean(axis=0)
    return out
