"""A robot program as its motions: what the controller is told to do, and where that is written."""

from abc import ABC, abstractmethod
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float

from taskcal.errors import shortened
from taskcal.geometry import se3
from taskcal.programs.source import Backup, Place, Source
from taskcal.programs.zone import THROUGH_TARGET, Zone
from taskcal.public_names import FormerName
from taskcal.robot.robot import Robot
from taskcal.short_repr import short_repr

MoveKind = Literal["joint", "linear", "circular", "axes"]
"""To a pose with all joints at once, along a line, along an arc; or to joint positions."""


@runtime_checkable
class Posture(Protocol):
    """Which of the postures that reach a pose is meant, in a controller's own terms."""

    def agrees(self, robot: Robot, q: Float[np.ndarray, "n joints"]) -> Bool[np.ndarray, " n"]:
        """Whether each posture is the one meant."""
        ...


@runtime_checkable
class GradedPosture(Posture, Protocol):
    """A posture of which it can be told how far others are from it, and how far the controller lets them be."""

    @property
    def tolerated(self) -> float:
        """How far off the controller still takes the nearest posture, radians."""
        ...

    def miss(self, robot: Robot, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, " n"]:
        """How far each posture is from the one meant: the joints' largest angle to it, radians; zero where it agrees."""
        ...


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Frame:
    """A tool, or a part's frame."""

    name: str
    """As the program calls it."""
    T: Float[np.ndarray, "4 4"]
    """Its pose: of what the robot holds in the flange, of what stands still in the base; metres."""
    stated: bool = True
    """False of a tool that the program loads by name, and of which nobody has said where it is."""
    moved: bool = False
    """An external axis away from zero has moved it against the robot, or the robot against it."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Target:
    """Where a motion goes: a pose, or joint positions."""

    name: str
    """Of its declaration, with the index of an element; empty where it is written in the instruction itself."""
    T: Float[np.ndarray, "4 4"] | None
    """Pose of the tool in the part's frame, offsets in the instruction included, metres; None for joint positions."""
    q: Float[np.ndarray, " joints"] | None
    """Controller joint positions, radians; None for a pose."""
    posture: Posture | None
    """Of a pose, where the program says it."""
    place: Place
    """Of its numbers."""
    free_spin: bool = False
    """The rotation of the tool about its own z axis is left open; T has some."""
    posture_binds: bool = True
    """Whether the controller stops where it cannot take that posture; otherwise it takes the nearest."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Move:
    """One motion instruction whose target, tool and frame are known."""

    kind: MoveKind
    end: Target
    via: Target | None
    """Via point of an arc."""
    tool: Frame
    part: Frame
    part_in_hand: bool
    """The robot holds the part, and the tool stands still."""
    speed: float | None
    """Programmed speed of the tool point, metres per second; None where it is not known or not meant."""
    stops: bool
    """It comes to rest in its target instead of passing by."""
    follows: int | None
    """Number of the motion that ends where this one begins; None where the text does not tell."""
    routine: str
    place: Place
    turn_speed: float | None = None
    """Programmed speed of the tool's reorientation, radians per second; None where it is not known."""
    divisible: bool = True
    """It may be written as several motions in a row; not one that does something once along its way."""
    texts_motions: int = 1
    """How many motions its text stands for, understood or not: those of a routine that is given several targets, or of the turns
    of a loop."""
    external: tuple[float, ...] = ()
    """Positions of the external axes at its end as they are written, millimetres or degrees; NaN where none is stated."""
    external_offset: str = ""
    """What shifts the external axes from there, by how much is not known; empty where nothing does."""
    waits: bool = True
    """Whether a program that waits where it stops does so here."""
    carrier: str = ""
    """What moves the part's frame, whose pose is then the one in what is moved; empty where the frame stands still."""
    zone: Zone | None = THROUGH_TARGET
    """How near it passes by its target where it does not stop; None where the text does not tell."""

    def flange(self, T: Float[np.ndarray, "*n 4 4"]) -> Float[np.ndarray, "*n 4 4"]:
        """Poses of the flange in the base for poses of the tool in the part's frame."""
        if self.part_in_hand:
            return self.tool.T @ se3.inverse(T) @ se3.inverse(self.part.T)
        return self.part.T @ T @ se3.inverse(self.tool.T)

    def target(self, flange: Float[np.ndarray, "*n 4 4"]) -> Float[np.ndarray, "*n 4 4"]:
        """Poses of the tool in the part's frame for poses of the flange in the base: the inverse of `flange`."""
        if self.part_in_hand:
            return se3.inverse(flange @ self.part.T) @ self.tool.T
        return se3.inverse(self.part.T) @ flange @ self.tool.T


@dataclass(frozen=True, eq=False, kw_only=True)
class Waypoint:
    """Where one motion of a rewritten program ends."""

    kind: MoveKind
    q: Float[np.ndarray, " joints"]
    """Joint positions that the controller is to drive there, radians; they decide the posture that is written."""
    T: Float[np.ndarray, "4 4"] | None
    """Pose of the tool in the part's frame that is written; None for joint positions."""
    via: "Waypoint | None" = None
    """Via point of an arc."""
    external: tuple[float, ...] = ()
    """Positions of the external axes, as in `Move`; empty to leave them as the motion states them."""
    share: float = 1.0
    """How much of the motion is done there, of its length."""


@dataclass(frozen=True, kw_only=True)
class Diagnostic:
    """Something in a program that stays as it is, and why; or that the user should know."""

    place: Place
    text: str
    rejected: bool = False
    """A motion whose numbers were read, but not what they count from or which tool they are of."""

    def __str__(self) -> str:
        return f"{self.place}: {self.text}"


@dataclass(frozen=True, eq=False, kw_only=True)
class Visit:
    """A motion, and a target to which its text leads, as it stands there or shifted."""

    number: int | None
    """Of the motion; None of one that was not resolved."""
    target: Hashable
    """Equal where motions of one path go to one target."""
    place: Place


@dataclass(frozen=True, eq=False, kw_only=True)
class Program(ABC):
    """What was read from one or several files of a robot program."""

    sources: tuple[Source, ...]
    moves: tuple[Move, ...]
    """Those that were resolved, in the order of the text."""
    diagnostics: tuple[Diagnostic, ...]
    """Motions that could not be resolved, and warnings."""
    T_world_base: Float[np.ndarray, "4 4"] | None = None
    """Where the program's files say that the robot stands; None where they do not, and the world is taken for its base."""
    base_from: str = "the program's files"
    """What says it."""
    backup: Backup | None = None
    """The folder or zip file that it was found in; None of files that were named."""

    remarks = FormerName("diagnostics")

    def __repr__(self) -> str:
        paths = shortened(", ".join(str(source.path) for source in self.sources), 120)
        diagnostics = f", {len(self.diagnostics)} diagnostics" if self.diagnostics else ""
        return f"{type(self).__name__}({paths}: {len(self.moves)} motions{diagnostics})"

    @abstractmethod
    def rewrite(self, robot: Robot, waypoints: Mapping[int, tuple[Waypoint, ...]]) -> tuple[Source, ...]:
        """The program's files with some motions rewritten.

        A motion becomes as many as it has waypoints, the last of which ends where it ended; all keep its speed and zone
        and whatever else it says. Everything else stays as it is, byte for byte.

        Args:
            robot: the robot, whose joint positions decide the posture data that are written.
            waypoints: by number of the motion.
        """

    def unwritable(
        self, robot: Robot, waypoints: Mapping[int, tuple[Waypoint, ...]], tolerance: float
    ) -> dict[int, str]:
        """Motions that cannot be rewritten as they should, because others have the same text, and why.

        Args:
            robot: the robot.
            waypoints: by number of the motion.
            tolerance: how far a target may be from its waypoint that is written as the shift of another one, metres.
        """
        return {}

    def visits(self) -> Iterable[Visit]:
        """Which motions of one path go to one target, some of them to a place above it: all are corrected, or none.

        Otherwise the way from one to the other, such as that down to a part, would be another one than was programmed.
        """
        return ()

    @abstractmethod
    def reread(self, sources: tuple[Source, ...]) -> "Program":
        """The program of other texts of the same files, such as `rewrite` gives.

        Raises:
            TaskcalError: they cannot be read.
        """
