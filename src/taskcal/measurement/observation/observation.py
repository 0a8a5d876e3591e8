"""The concept: an observation is a function of the pose of something on the tool, with unknowns and noise of its own."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import CampaignError, UnknownName
from taskcal.measurement.observation.columns import ObservedColumns
from taskcal.measurement.tracker import TrackerNoise
from taskcal.robot.parameter import ShownUnit

UNMEASURED = 1.0
"""Variance of what a kind does not measure of its block, m² or rad²: as good as infinite, and finite for the algebra."""


class Measured(NamedTuple):
    """What was read of one target, row by row."""

    points: Float[np.ndarray, "n 3"]
    """The kind's numbers, metres, those it does not measure zero; NaN where nothing was."""
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
    """Where a registration puts a target and the kind's own unknowns."""

    T_tool_target: Float[np.ndarray, "4 4"]
    unknown: Float[np.ndarray, " u"]
    distance: Float[np.ndarray, " n"]
    """How far each row is off, metres; zero where nothing was read."""
    unobservable: Float[np.ndarray, "3 3"]
    """Projector onto directions in which the rows do not tell where the target sits on the tool."""


class Read(NamedTuple):
    """What a file says of one target that a kind observed."""

    target: str
    """Its name."""
    observation: "Observation"
    points: Float[np.ndarray, "n 3"]
    """The kind's numbers, metres; NaN where nothing was read."""
    rotations: Float[np.ndarray, "n 3 3"] | None = None


class Scene(NamedTuple):
    """What stands in a virtual cell, and what the tool carries: enough to measure a kind there."""

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
    """What is known of the unknowns beside the measurements: stated less found, its derivative, and how sure it is."""

    residual: Float[np.ndarray, " k"]
    by_unknown: Float[np.ndarray, "k u"]
    uncertainty: Float[np.ndarray, " k"]


_KINDS: dict[str, type["Observation"]] = {}
"""Every kind by its key, entered as it is defined."""


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
    """Numbers that it measures in a row."""
    turned: ClassVar[bool] = False
    """Whether it depends on how the target is turned on the tool."""
    along_axes: ClassVar[bool] = False
    """Whether its first three numbers are along the axes of the measuring frame: neither a length nor in a sensor's axes."""
    in_tracker: ClassVar[bool] = False
    """Whether it is measured in a frame that stands, whose pose is unknown."""
    instrument: ClassVar[str] = ""
    """What it is measured with, in a word: the kind's name on the command line."""
    touched: ClassVar[bool] = False
    """Whether no number is read, but the robot is brought to where something touches."""
    columns: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType({})
    """Columns that it reads, each with the words that people write for it, in small letters and parted by blanks."""
    needed: ClassVar[tuple[str, ...]] = ()
    """Those of them that a file must have."""
    label: ClassVar[str] = ""
    """The column that names what each row refers to: a file with a tracker's points has the kind only where this is there."""
    units: ClassVar[Mapping[str, ShownUnit]] = MappingProxyType(dict.fromkeys(("rx", "ry", "rz"), ShownUnit.of("rad")))
    """Units in which people see its unknowns, by the last part of their names; millimetres for all others."""
    of: Int[np.ndarray, " n"] | None = None
    """Which of several things each row refers to, −1 for none; None where there is one, or where no rows belong to it."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if "key" in vars(cls):
            _KINDS[cls.key] = cls

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Names of its own unknowns."""
        return ()

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
        """Whether its residuals vanish with the size of the robot, whatever was read."""
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
        """Of the noise of each row, m² and rad²; the uncertainty, metres, where the campaign states it."""

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
        """What is known of the unknowns."""
        return Stated(np.zeros(0), np.zeros((0, len(unknown))), np.zeros(0))

    def compare(self, unknown: Float[np.ndarray, " u"]) -> tuple[Compared, ...]:
        """What is stated beside what is found; nothing for kinds of which nothing is stated."""
        return ()

    def named_like(self, other: "Observation", unknown: Float[np.ndarray, " u"]) -> Float[np.ndarray, " v"]:
        """Another one's unknowns in the order of these, NaN for those it does not have."""
        known = dict(zip(other.unknowns, unknown, strict=True))
        return np.array([known.get(name, np.nan) for name in self.unknowns])

    def numbered_like(self, other: "Observation") -> "Observation":
        """The same rows, what they refer to numbered as another one does; −1 where that does not know it."""
        return self

    def take(self, rows: Int[np.ndarray, " k"]) -> "Observation":
        """That of some of the rows."""
        return self

    @classmethod
    def read(cls, columns: ObservedColumns) -> Read | None:
        """What a file says; None where it does not have the kind's columns.

        Raises:
            FileError: a cell is not what it must be.
        """
        return None

    def cells(self, measured: Measured) -> dict[str, list[str]] | None:
        """Columns of a file from which `read` reads the same; None for what a tracker measured."""
        return None

    def describe(self) -> dict[str, Any]:
        """What a file holds of it, beside its key: all but the rows."""
        return {}

    @classmethod
    def of_description(cls, content: Mapping[str, Any]) -> "Observation":
        """What `describe` gave, without rows."""
        return cls(**content)


class Standalone(Observation):
    """A kind that needs no tracker: it finds by itself where it is."""

    things: ClassVar[str]
    """The field that names what rows refer to."""

    @property
    def numbers(self) -> Int[np.ndarray, " n"]:
        """What each row refers to, any for rows that refer to nothing."""
        assert self.of is not None
        return np.maximum(self.of, 0)

    @property
    def named(self) -> tuple[str, ...]:
        """Names of what rows refer to."""
        return getattr(self, self.things)

    def labels(self, measured: Measured) -> list[str]:
        """The name that each row refers to; empty where nothing was read."""
        assert self.of is not None
        return [self.named[k] if k >= 0 and there else "" for k, there in zip(self.of, measured.valid, strict=True)]

    def numbered_like(self, other: Observation) -> Observation:
        """The same rows, with numbers of another one."""
        assert self.of is not None
        assert isinstance(other, Standalone)
        number = [other.named.index(name) if name in other.named else -1 for name in self.named]
        return replace(other, of=np.array([*number, -1])[self.of])

    def take(self, rows: Int[np.ndarray, " k"]) -> Observation:
        """That of some of the rows, with what these refer to."""
        assert self.of is not None
        names, of = refer(tuple(self.named[k] if k >= 0 else "" for k in self.of[rows]))
        return replace(self, of=of, **{self.things: names})

    @classmethod
    def stage(cls, tool: Float[np.ndarray, "n 4 4"], places: int | None, rng: np.random.Generator) -> Scene:
        """A virtual cell for robots that measure about some poses of the tool.

        Args:
            tool: one for each row.
            places: how many things stand there; as many as are usual by default.
            rng: source of what differs from cell to cell.

        Raises:
            CampaignError: the kind does not say.
        """
        raise CampaignError(f"'{cls.key}' observations cannot be simulated: the kind says nothing of a cell for them")

    @abstractmethod
    def place(self, tool: Float[np.ndarray, "n 4 4"], measured: Measured) -> Placed:
        """Where target and unknowns are, from poses of the tool alone, in spite of a few rows that are wrong.

        Raises:
            CampaignError: the rows do not tell.
        """


def kinds() -> tuple[type[Observation], ...]:
    """Every kind that is defined."""
    return tuple(_KINDS.values())


def find_columns(texts: Sequence[str], *, tracked: bool) -> dict[int, str]:
    """Columns of kinds of observation that need no tracker, by the kinds' own names.

    A kind is there with the columns that it needs; beside a tracker's points, where ``d`` and ``sx`` may mean something else, with
    the column that names what it refers to.
    """
    out: dict[int, str] = {}
    for kind in kinds():
        at = {
            column: next((k for k, text in enumerate(texts) if text in words), None)
            for column, words in kind.columns.items()
        }
        there = bool(kind.needed) and all(at[column] is not None for column in kind.needed)
        if there and (not tracked or at[kind.label] is not None):
            out |= {k: column for column, k in at.items() if k is not None}
    return out


def instrument_of(name: str) -> type[Standalone]:
    """The kind that is measured with an instrument.

    Raises:
        UnknownName: there is none.
    """
    found = {kind.instrument: kind for kind in kinds() if kind.instrument and issubclass(kind, Standalone)}
    if name not in found:
        raise UnknownName("way to measure", name, ("tracker", *found))
    return found[name]


def kind_of(key: str) -> type[Observation]:
    """The kind of a key.

    Raises:
        UnknownName: there is none.
    """
    if key not in _KINDS:
        raise UnknownName("kind of observation", key, tuple(_KINDS))
    return _KINDS[key]


def refer(labels: tuple[str, ...]) -> tuple[tuple[str, ...], Int[np.ndarray, " n"]]:
    """Different names in the order in which they come, and which of them each row has; −1 where it has none."""
    names = tuple(dict.fromkeys(label for label in labels if label))
    number = {name: k for k, name in enumerate(names)}
    return names, np.array([number.get(label, -1) for label in labels], dtype=int)
