"""A robot program as its motions: what the controller is told to do, and where that is written."""

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Container, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import atan2, copysign, cos, degrees, hypot, inf, radians, sin
from pathlib import Path
from typing import Any, Literal, Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float

from robot_programs.core.robot import NO_ROBOT, Robot
from robot_programs.core.source import Backup, Place, Source, TextEdit
from taskcal_groundwork import se3
from taskcal_groundwork.errors import FileError, InputError, shortened, shown

# How near a motion passes by its target, where it does not stop in it.


@dataclass(frozen=True, kw_only=True)
class Zone:
    """Section of its path in which a motion may be left for the next one.

    The tool leaves the path where every size allows it, and at most half of the path before the target. With all sizes
    zero it goes through the target.
    """

    distance: float = 0.0
    """Of the TCP from the target along its path, metres."""
    turn_distance: float = 0.0
    """Of the TCP from the target where the orientation begins to change for the next motion, metres; it counts
    where it is more than `distance`."""
    angle: float = 0.0
    """Of the orientation from the target's, radians; it counts where the tool only turns."""
    share: float = math.inf
    """Of the motion's own length that is left."""

    @property
    def rounds(self) -> bool:
        """Whether the tool may pass by the target at all."""
        return min(max(self.distance, self.turn_distance, self.angle), self.share) > 0.0


THROUGH_TARGET = Zone()
"""Of motions that meet their targets."""


MAX_JOINTS = 6
"""Of a robot whose motions to a pose can be written again."""

SAME_POSE = 1e-9
"""Poses and joint positions that differ by less are one, metres and radians; single precision on a metre is coarser."""

WRITTEN_M, WRITTEN_RAD, WRITTEN_SPEED = 2e-5, 2e-4, 1e-3
"""What is read back differs by less from what was to be written, metres, radians, and of a speed its share: ten times the last
digit of the coarsest language (FANUC's listings: 0.001 mm and 0.001°), for offsets have levers."""

MotionKind = Literal["joint", "linear", "circular", "axes"]
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
        """Largest deviation at which the controller still takes the nearest posture, radians."""
        ...

    def miss(self, robot: Robot, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, " n"]:
        """Deviation of each posture from the one meant: the joints' largest angle to it, radians; zero where it agrees."""
        ...


NEAR_POSTURE_RAD = radians(1.0)
"""Joint positions differ by less where a posture is the one that a program states by them."""


@dataclass(frozen=True, eq=False, kw_only=True)
class NearPosture:
    """The posture that is nearest to joint positions."""

    q: Float[np.ndarray, " joints"]
    """Radians."""

    def __str__(self) -> str:
        return f"near {[round(degrees(angle), 1) for angle in self.q.tolist()]}°"

    def agrees(self, robot: Robot, q: Float[np.ndarray, "n joints"]) -> Bool[np.ndarray, " n"]:
        """Whether each posture is that one, to `NEAR_POSTURE_RAD`."""
        return np.abs(q - self.q).max(axis=1) < NEAR_POSTURE_RAD

    @property
    def tolerated(self) -> float:
        """Largest deviation at which the controller still takes the nearest posture: any."""
        return inf

    def miss(self, robot: Robot, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, " n"]:
        """Distance of each posture in the space of the joints, by which the nearest is chosen, radians."""
        return np.linalg.norm(q - self.q, axis=1)


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

    def __repr__(self) -> str:
        x, y, z = self.T[:3, 3] * 1e3
        return f"Frame({shortened(self.name, 60)!r}: {x:.4g}, {y:.4g}, {z:.4g} mm)"


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class MotionFrames:
    """Tool and part of a motion, as its poses mean them."""

    tool: Frame
    part: Frame
    part_in_hand: bool
    carrier: str = ""
    """Mechanical unit that moves the part's frame; empty where it stands still."""


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Target:
    """Target of a motion: a pose, or joint positions."""

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

    def __repr__(self) -> str:
        kind = "joint positions" if self.T is None else "pose"
        return f"Target({shortened(self.name, 60)!r}: {kind}, {shortened(str(self.place), 120)})"


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Motion:
    """One motion instruction whose target, tool and frame are known."""

    kind: MotionKind
    end: Target
    via: Target | None = None
    """Via point of an arc."""
    tool: Frame
    part: Frame
    part_in_hand: bool = False
    """The robot holds the part, and the tool stands still."""
    speed: float | None = None
    """Programmed speed of the TCP, metres per second; None where it is not known or not meant."""
    stops: bool
    """It comes to rest in its target instead of passing by."""
    follows: int | None = None
    """Number of the motion that ends where this one begins; None where the text does not tell."""
    begins_at_motion: bool = False
    """It begins where one of the program's motions ends, and not always the same one."""
    routine: str = ""
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

    def __repr__(self) -> str:
        return f"Motion({self.kind} to {shortened(self.end.name, 60)!r}, {shortened(str(self.place), 120)})"

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

    def own_waypoint(self) -> "Waypoint":
        """Its own end, to be written again; joint positions that are not known are NaN."""
        q = np.full(MAX_JOINTS, np.nan) if self.end.q is None else self.end.q
        via = None if self.via is None else Waypoint(kind=self.kind, q=q, T=self.via.T)
        return Waypoint(kind=self.kind, q=q, T=self.end.T, via=via)

    def stays(self, path: "Sequence[Waypoint]") -> bool:
        """Whether its waypoints are where it goes already; about a tool's axis that is free to spin it may turn."""
        (only, *more) = path
        if more or only.kind != self.kind:
            return False
        pairs = [(self.end.q, only.q if only.T is None else None), (self.end.T, only.T)]
        if self.via is not None and only.via is not None:
            pairs.append((self.via.T, only.via.T))
        compared = np.s_[..., 2:] if self.end.free_spin else np.s_[...]
        return all(
            old is None if new is None else old is not None and bool(np.abs((new - old)[compared]).max() < SAME_POSE)
            for old, new in pairs
        )


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Waypoint:
    """End of one motion of a rewritten program."""

    kind: MotionKind
    q: Float[np.ndarray, " joints"]
    """Joint positions that the controller is to drive there, radians; they decide the posture that is written."""
    T: Float[np.ndarray, "4 4"] | None
    """Pose of the tool in the part's frame that is written; None for joint positions."""
    via: "Waypoint | None" = None
    """Via point of an arc."""
    external: tuple[float, ...] = ()
    """Positions of the external axes, as in `Motion`; empty to leave them as the motion states them."""
    share: float = 1.0
    """How much of the motion is done there, of its length."""

    def edited(self, edit: "Edit") -> "Waypoint":
        """The same with other numbers."""
        via = self.via if edit.via is None or self.via is None else replace(self.via, T=edit.via)
        return replace(
            self, T=self.T if edit.T is None else edit.T, q=self.q if edit.q is None else np.asarray(edit.q), via=via
        )


Paths = Mapping[int, tuple[Waypoint, ...]]
"""What motions become, by their numbers."""


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Edit:
    """Other numbers for a motion; what is None stays as it is written."""

    motion: int
    """Its number in the program, counted from 0."""
    T: Float[np.ndarray, "4 4"] | None = None
    """Pose of its tool in its part's frame at its end, metres."""
    via: Float[np.ndarray, "4 4"] | None = None
    """The same at the via point of an arc."""
    q: Float[np.ndarray, " joints"] | None = None
    """Joint positions at its end, radians: its target, or the posture that is written for its pose."""
    speed: float | None = None
    """Of the TCP, metres per second."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Diagnostic:
    """Something in a program that stays as it is, and why; or that the user should know."""

    place: Place
    text: str
    rejected: bool = False
    """A motion whose numbers were read, but not what they count from or which tool they are of."""
    unread: bool = False
    """A motion that was not resolved, on one of the ways that lead to it at least."""

    def __str__(self) -> str:
        return f"{self.place}: {self.text}"


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class TargetVisit:
    """A motion, and a target to which its text leads, as it stands there or shifted."""

    number: int | None
    """Of the motion; None of one that was not resolved."""
    target: Hashable
    """Equal where motions of one path go to one target."""
    place: Place


@dataclass(frozen=True, eq=False, kw_only=True)
class Program(ABC):
    """Robot program read from one or several files."""

    sources: tuple[Source, ...]
    motions: tuple[Motion, ...]
    """Those that were resolved, in the order of the text."""
    diagnostics: tuple[Diagnostic, ...]
    """Motions that could not be resolved, and warnings."""
    T_world_base: Float[np.ndarray, "4 4"] | None = None
    """Where the program's files say that the robot stands; None where they do not, and the world is taken for its base."""
    base_from: str = "the program's files"
    """What says it."""
    base_missing: str = ""
    """What the program counts from, where only the robot tells where that is and it was not given."""
    backup: Backup | None = None
    """The folder or zip file that it was found in; None of files that were named."""
    read: Callable[[tuple[Source, ...]], "Program"] | None = None
    """Reads other texts of the same files; None of a language that says so by `reread` itself."""

    def __repr__(self) -> str:
        paths = shortened(", ".join(str(source.path) for source in self.sources), 120)
        diagnostics = f", {len(self.diagnostics)} diagnostics" if self.diagnostics else ""
        return f"{type(self).__name__}({paths}: {len(self.motions)} motions{diagnostics})"

    @abstractmethod
    def rewrite(self, robot: Robot, waypoints: Paths) -> tuple[Source, ...]:
        """The program's files with some motions rewritten.

        A motion becomes as many as it has waypoints, the last of which ends where it ended; all keep its speed and zone
        and whatever else it says. Everything else stays as it is, byte for byte.

        Args:
            robot: the robot, whose joint positions decide the posture data that are written.
            waypoints: by number of the motion.
        """

    def with_edits(self, edits: Iterable[Edit], robot: Robot | None = None) -> "Program":
        """The program with other numbers in some motions, as it is read again; its files keep every other byte.

        Args:
            edits: at most one for each motion.
            robot: the robot; only for edits that state the posture of a pose, which is kept as it is written otherwise.

        Raises:
            InputError: a motion has no such numbers, or they cannot be written without changing others.
        """
        changes = _by_motion(edits, self.motions, robot)
        waypoints = {
            number: (self.motions[number].own_waypoint().edited(edit),)
            for number, edit in changes.items()
            if edit.T is not None or edit.via is not None or edit.q is not None
        }
        known = NO_ROBOT if robot is None else robot
        for number, why in self.unwritable(known, waypoints, WRITTEN_M).items():
            raise InputError(f"{self.motions[number].place}: the motion's target cannot be written: {why}")
        program = self.reread(self.rewrite(known, waypoints)) if waypoints else self
        _expect_edited(self.motions, program.motions, {n: replace(edit, speed=None) for n, edit in changes.items()})
        texts: list[dict[tuple[int, int], TextEdit]] = [{} for _ in self.sources]
        for number, edit in changes.items():
            if edit.speed is not None:
                file, text = program.speed_edit(number, edit.speed)
                texts[file][text.start, text.end] = text
        if any(texts):
            edited = (source.edited(of.values()) for source, of in zip(program.sources, texts, strict=True))
            program = self.reread(tuple(edited))
            _expect_edited(self.motions, program.motions, changes)
        return replace(program, backup=self.backup)

    def speed_edit(self, number: int, speed: float) -> tuple[int, TextEdit]:
        """What gives a motion another speed: the number of its file, and the edit.

        Args:
            number: of the motion, whose speed is known.
            speed: of the TCP, metres per second.

        Raises:
            InputError: the motion itself does not state its speed.
        """
        raise InputError(
            f"{self.motions[number].place}: its speed is stated before it, for all motions that follow; change it there"
        )

    def unwritable(self, robot: Robot, waypoints: Paths, tolerance: float) -> dict[int, str]:
        """Motions that cannot be rewritten as they should, because others have the same text, and why.

        Args:
            robot: the robot.
            waypoints: by number of the motion.
            tolerance: how far a target may be from its waypoint that is written as the shift of another one, metres.
        """
        return {}

    def least_worst(
        self, robot: Robot, waypoints: Paths, numbers: Collection[int], tolerance: float
    ) -> dict[int, tuple[Waypoint, ...]]:
        """New waypoints of some motions that share their numbers, which all of them reach by the value of the least largest error.

        Args:
            robot: the robot.
            waypoints: where the motions should be, by number.
            numbers: of motions that cannot be rewritten as they should.
            tolerance: the largest error that is good enough, metres.
        """
        return {}

    def written_out(self, numbers: Collection[int]) -> "tuple[Source, ...] | None":
        """The program's files with text written out that some motions have in common with others; None where there is none.

        They do the same: loops are written turn by turn, and routines once for each call.

        Args:
            numbers: of the motions.
        """
        return None

    def tabled(self, numbers: Collection[int]) -> "Program | None":
        """The program with targets of loops in arrays, an element for each turn; None where there is none.

        It does the same, without a longer loop.

        Args:
            numbers: of motions that have text in common with others.
        """
        return None

    def visits(self) -> Iterable[TargetVisit]:
        """Which motions of one path go to one target, some of them to a place above it: all are corrected, or none.

        Otherwise the way from one to the other, such as that down to a part, would be another one than was programmed.
        """
        return ()

    def wrap(
        self,
        function: str,
        added: Source | None,
        *,
        without: Collection[str] = (),
        rejected: Container[int] = (),
        keep_joints: bool = False,
    ) -> "Wrapping":
        """Put a function around the targets of motions that only the running program knows.

        Args:
            function: name of the function, which is given target, tool and frame as the language has them.
            added: the file that declares it, read with the others from then on; None where the program has it.
            without: names of tools and frames, in lower case, with which motions are left as they are.
            rejected: numbers of motions whose targets get it as well, as far as all motions of their text are among these.
            keep_joints: leave motions to joint positions as they are, where the language has such a function for them, too.

        Raises:
            InputError: the language has no place for it, or the program has something of that name already.
        """
        raise InputError(
            f"{self.sources[0].path}: no function is put around targets of this language; correct it without a helper"
        )

    def reread(self, sources: tuple[Source, ...]) -> "Program":
        """The program of other texts of the same files, such as `rewrite` gives.

        Raises:
            InputError: they cannot be read.
        """
        if self.read is None:
            raise NotImplementedError(f"{type(self).__name__} does not say how it is read again")
        return self.read(sources)


# Edits of a program's numbers.


def _by_motion(edits: Iterable[Edit], motions: Sequence[Motion], robot: Robot | None) -> dict[int, Edit]:
    """Edits by their motions' numbers.

    Raises:
        InputError: there is no such motion, or it has no such numbers.
    """
    out: dict[int, Edit] = {}
    for edit in edits:
        if not 0 <= edit.motion < len(motions):
            raise InputError(f"there is no motion {edit.motion}; the program has {len(motions)}, counted from 0")
        if edit.motion in out:
            raise InputError(f"motion {edit.motion} has two edits; state all its new numbers in one")
        motion = motions[edit.motion]
        why = next(_misfits(motion, edit, robot), "")
        if why:
            raise InputError(f"{motion.place}: motion {edit.motion} cannot be edited so: {why}")
        out[edit.motion] = edit
    return out


def _misfits(motion: Motion, edit: Edit, robot: Robot | None) -> Iterator[str]:
    """Why a motion does not have the numbers that an edit states."""
    q, own = edit.q, motion.end.q
    if edit.T is not None and motion.end.T is None:
        yield "it goes to joint positions; state q in place of T"
    if edit.via is not None and motion.via is None:
        yield "it is not an arc, and has no via point"
    if any(T is not None and not se3.is_pose(T) for T in (edit.T, edit.via)):
        yield "a pose has four rows and columns, a rotation in the upper left three, and metres in the last column"
    if q is not None and own is None and robot is None:
        yield "it goes to a pose, whose posture follows from q for a robot only; give the robot, or leave out q"
    if q is not None and (not np.isfinite(q).all() or (own is not None and np.shape(q) != own.shape)):
        yield f"q is {shown(q)}, not {len(own) if own is not None else 'the robot'}'s joint positions"
    if edit.speed is not None and not 0.0 < edit.speed < inf:
        yield f"{edit.speed:g} m/s is not a speed"
    if edit.speed is not None and motion.speed is None:
        yield "its text states no speed of the TCP that could be changed"


def _expect_edited(before: Sequence[Motion], after: Sequence[Motion], edits: Mapping[int, Edit]) -> None:
    """See that motions became what edits ask for, and the others stayed.

    Raises:
        InputError: they did not.
    """
    if len(before) != len(after):
        raise InputError(f"the program of {len(before)} motions would have {len(after)}; leave out some of the edits")
    for number, (old, new) in enumerate(zip(before, after, strict=True)):
        edit = edits.get(number, Edit(motion=number))
        if not _is_edited(old, new, edit):
            shared = "" if number in edits else "; it shares text with another one that is edited"
            raise InputError(f"{old.place}: motion {number} would become another one than was asked for{shared}")


def _is_edited(old: Motion, new: Motion, edit: Edit) -> bool:
    if old.kind != new.kind or not _close(edit.speed or old.speed, new.speed, WRITTEN_SPEED * (new.speed or 0.0)):
        return False
    if old.via is not None and new.via is not None:  # a via point's orientation is not used in every language
        via = old.via.T if edit.via is None else edit.via
        if via is not None and not _close(via[:3, 3], None if new.via.T is None else new.via.T[:3, 3], WRITTEN_M):
            return False
    if old.end.T is None or new.end.T is None:
        return _close(old.end.q if edit.q is None else edit.q, new.end.q, WRITTEN_RAD)
    T = old.end.T if edit.T is None else edit.T
    first = 2 if new.end.free_spin else 0
    return _close(T[:3, 3], new.end.T[:3, 3], WRITTEN_M) and _close(T[:3, first:3], new.end.T[:3, first:3], WRITTEN_RAD)


def _close(a: float | np.ndarray | None, b: float | np.ndarray | None, tolerance: float) -> bool:
    if a is None or b is None:
        return a is b
    return bool(np.max(np.abs(np.asarray(a) - b)) <= tolerance)


@dataclass(frozen=True, eq=False, kw_only=True)
class Wrapping:
    """A program in which a function stands around the targets of some motions."""

    program: Program
    """As read again; the program itself where no motion could be given the function."""
    wrapped: tuple[Place, ...]
    """Motions that have it."""
    left: tuple[Diagnostic, ...]
    """Motions that could not be given it, and why."""
    completed: Callable[[tuple[Source, ...]], tuple[Source, ...]] = lambda sources: sources
    """Files of the program with what was added in them, in languages where that has no file of its own; lines stay until then."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Wrapped:
    """A motion that is given a function, or not."""

    place: Place
    name: str
    """Of its instruction."""
    edits: tuple[TextEdit, ...] = ()
    obstacle: str = ""
    """Why it is not."""

    @classmethod
    def of(cls, place: Place, name: str, edits: Iterable[TextEdit]) -> "Wrapped":
        """A motion with edits that may raise `Unresolved` as they are made, which says why it is not given the function."""
        try:
            return cls(place=place, name=name, edits=tuple(edits))
        except Unresolved as why:
            return cls(place=place, name=name, obstacle=str(why))


def wrapping(
    program: Program,
    found: Iterable[Wrapped],
    added: Source | None,
    cleared: Callable[[Any], tuple[Program, Container[Place]]],
) -> Wrapping:
    """A program whose motions are given a function; of those that have it nothing is to be said any more.

    Args:
        program: the program.
        found: its motions, as far as they are to have the function.
        added: the file that declares it; see `Program.wrap`.
        cleared: of the program as it is read again, what is left of it, and the places of the motions that have the function.
    """
    edits: dict[Path, list[TextEdit]] = {source.path: [] for source in program.sources}
    wrapped, left = list[Place](), list[Diagnostic]()
    for one in found:
        if one.obstacle:
            left.append(Diagnostic(place=one.place, text=f"{one.name} is not corrected at run time: {one.obstacle}"))
        else:
            wrapped.append(one.place)
            edits[one.place.path] += one.edits

    def read(sources: tuple[Source, ...]) -> Program:
        again, having = cleared(program.reread(sources))
        said = tuple(d for d in again.diagnostics if d.place not in having or not d.unread)
        return replace(again, read=read, backup=program.backup, base_from=program.base_from, diagnostics=said)

    sources = tuple(source.edited(edits[source.path]) for source in program.sources)
    return Wrapping(
        program=read(sources if added is None else (*sources, added)) if wrapped else program,
        wrapped=tuple(wrapped),
        left=tuple(left),
    )


# What a language of robot programs can do.


@dataclass(frozen=True, eq=False, kw_only=True)
class Surroundings:
    """Robot and frames that a language does not state itself."""

    robot: Robot | None = None
    """Whose own tool moves where none is given, and whose joints columns name."""
    tool: Frame | None = None
    """What the positions are of."""
    tools: Mapping[str, Frame] = field(default_factory=dict[str, Frame])
    """The same by the name by which a program loads it."""
    part: Frame | None = None
    """Frame in which the positions are counted; the robot's base by default."""
    parts: Mapping[str, Frame] = field(default_factory=dict[str, Frame])
    """Parts' frames by the name by which a program calls them."""
    data: Mapping[str, str] = field(default_factory=dict[str, str])
    """Other data by name, as the program's language writes their values."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Composition:
    """A program to be written; a language takes of it what it can say."""

    name: str
    robot: Robot
    motions: Sequence[Motion]
    q: Float[np.ndarray, "moves joints"] | None = None
    """Joint positions in which each motion ends, radians; they decide the posture of motions to a pose that do not say it."""
    notes: Sequence[str] = ()
    """A comment before each motion."""
    wait_s: float = 0.0
    """Seconds to wait behind each motion that stops."""
    wait_input: str = ""
    """Digital input to wait for there in place of a time, until it has gone off and on: its name in RAPID, elsewhere its number."""
    speed: float = 0.25
    """Of the TCP, for motions that do not say theirs, metres per second."""
    joint_speed_percent: float = 10.0
    """Of motions of all joints, of the axes' largest speeds."""
    zone: str = "z0"
    """In RAPID: of motions that pass by."""

    def expect_name(self, what: str, length: int, *, begins: str = "A-Za-z", reserved: Container[str] = ()) -> None:
        """See that the language takes the name.

        Args:
            what: of what it is the name, in the language.
            length: characters that it may have.
            begins: with which it may begin.
            reserved: words of the language, in lower case.

        Raises:
            InputError: it does not.
        """
        pattern = f"[{begins}][A-Za-z0-9_]{{0,{length - 1}}}"
        if not re.fullmatch(pattern, self.name) or self.name.lower() in reserved:
            raise InputError(
                f"'{self.name}' is not a name of {what}; begin with a letter, and use at most {length} letters, digits and _"
            )

    def note(self, number: int) -> str:
        """The comment before a motion, in one line; empty where there is none."""
        return " ".join(self.notes[number].split()) if self.notes else ""

    def posture(self, number: int) -> Float[np.ndarray, " joints"] | None:
        """Joint positions in which a motion ends, radians."""
        return None if self.q is None else self.q[number]

    def waits(self, number: int, seconds: str, *inputs: str) -> list[str]:
        """Lines that wait behind a motion, if it waits.

        Args:
            number: of the motion.
            seconds: how the language waits for ``{0}`` seconds.
            inputs: how it waits until the input ``{0}`` is off, and until it is on.
        """
        move = self.motions[number]
        if not (move.stops and move.waits):
            return []
        if self.wait_input:
            return [line.format(self.wait_input) for line in inputs]
        return [seconds.format(self.wait_s)] if self.wait_s else []

    def expect_input(self, pattern: str, what: str) -> None:
        """See that the language has an input as it is stated.

        Args:
            pattern: of the whole text.
            what: what it has to be, in words.

        Raises:
            InputError: it does not.
        """
        if self.wait_input and not re.fullmatch(pattern, self.wait_input):
            raise InputError(f"'{self.wait_input}' is not an input of this language; state {what}")

    def written(self, lines: Iterable[str], suffix: str, newline: str = "\r\n") -> Source:
        """The program of some lines, which end as controllers write them."""
        text = "".join(f"{line}{newline}" for line in lines)
        return Source(path=Path(f"{self.name}{suffix}"), text=text, encoding="utf-8")


NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
"""A decimal number, as all languages have them; digits match in one way only, however many there are."""


@dataclass(frozen=True, kw_only=True)
class LiteralForm:
    """Commonest form of a motion whose target is written out, a statement in a line of its own."""

    pattern: str
    """With a group for each number of the target; the rest may call nothing. Letter case does not matter."""
    poses: Callable[[Float[np.ndarray, "n k"], Motion], Float[np.ndarray, "n 4 4"] | None]
    """Poses of such numbers where all else is as in a motion; None where one of them is none that counts."""
    unless: str = ""
    """A pattern of what numbers mean more with than a place, and is not in the program's text."""


@dataclass(frozen=True, kw_only=True)
class Language:
    """A language of robot programs."""

    name: str
    suffixes: tuple[str, ...]
    """How its files end; letter case does not matter."""
    read: Callable[[tuple[Source, ...], Surroundings], Program]
    compose: Callable[[Composition], Source] | None
    """Writes a new program; None where that cannot be done."""
    composed: tuple[str, ...] = ()
    """Suffixes of files that a new program can be written to."""
    declares_frames: bool
    """Whether a program says its own tools and frames."""
    has_logic: bool = False
    """Whether a program may hold more than motions, which a new program of them would lose."""
    marks: str = ""
    """What is found in every file of a program, a regular expression without regard to letter case; empty for anything."""
    takes_data: bool = False
    """Whether data can be given that no file declares, beside tools and parts."""
    form: LiteralForm | None = None
    """By which long programs are read from a few of their lines; None where each line is read."""
    base_file: str = ""
    """The file that says where the robot stands in the world, in which frames are counted; empty where they are counted in
    the robot's base."""
    controller_kinematics: str = ""
    """Files that state with which kinematics a controller of the language computes, where each has its own arm's, as the factory
    measured them; empty where controllers compute with nominal dimensions unless told otherwise."""

    def holds(self, source: Source) -> bool:
        """Whether a file, known by its suffix, is one of a program: controllers have other files with the same suffixes."""
        if "\0" in source.text:
            return False
        return not self.marks or re.search(self.marks, source.text, re.IGNORECASE | re.MULTILINE) is not None


# Values that the text of a program alone does not give.


MissingKind = Literal["tool", "part", "data", "other"]
"""What a name stands for that the files of a program use and do not declare; what is other, no cell file can state."""


class Cause(str):
    """Why something is not known, for the user, with the names that would have to be declared; whatever else it is part of."""

    __slots__ = ("missing",)
    missing: tuple[tuple[str, MissingKind], ...]

    def __new__(cls, text: str, *missing: tuple[str, MissingKind], of: Iterable[object] = ()) -> "Cause":
        """A sentence, and the names that it misses, or that others do of which it is made."""
        self = super().__new__(cls, text)
        self.missing = tuple(dict.fromkeys((*missing, *(name for one in of for name in missing_in(one)))))
        return self

    def __str__(self) -> "Cause":
        return self

    def __reduce__(self) -> Any:
        return Cause._again, (super().__str__(), self.missing)

    @staticmethod
    def _again(text: str, missing: tuple[tuple[str, MissingKind], ...]) -> "Cause":
        return Cause(text, *missing)


def missing_in(reason: object) -> tuple[tuple[str, MissingKind], ...]:
    """Names that a reason misses; none of any other text."""
    said = str(reason)
    return said.missing if isinstance(said, Cause) else ()


class Unresolved(Exception):
    """A value that the text does not give, so that a motion stays as it is; the message says why, for the user: see `Cause`."""


# Motions that cannot be rewritten as they should, where one that stays as it was may keep others from changing.

Change = TypeVar("Change")


def reject_in_turn(
    paths: Mapping[int, Change], conflicts: Callable[[Mapping[int, Change]], Iterable[tuple[int, str]]]
) -> dict[int, str]:
    """Take motions away until no conflict is left among the others.

    Args:
        paths: what each motion should become, by its number.
        conflicts: of some of them: motions that cannot, and why.

    Returns:
        the motions that were taken away, and why.
    """
    rejected: dict[int, str] = {}
    while True:
        rest = {i: path for i, path in paths.items() if i not in rejected}
        more = {i: why for i, why in conflicts(rest) if i in rest}
        if not more:
            return rejected
        rejected |= more


def keep_together(visits: Iterable[TargetVisit], staying: Container[int], changing: Container[int]) -> dict[int, str]:
    """Motions that have to stay because another one of their path stays that goes to the same target, and why.

    Args:
        visits: of the program.
        staying: numbers of motions that were refused.
        changing: numbers of motions that are to be written.
    """
    visits = tuple(visits)
    stays: dict[Hashable, Place] = {}
    for visit in visits:
        if visit.number is None or visit.number in staying:
            stays.setdefault(visit.target, visit.place)
    return {
        visit.number: f"shares its target with the motion in {stays[visit.target]}, which stays as it is: the way between them "
        "would be another one"
        for visit in visits
        if visit.number is not None and visit.number in changing and visit.target in stays
    }


# What a program needs and its files do not have, each once.


@dataclass(frozen=True, eq=False, kw_only=True)
class MissingName:
    """A name that the files of a program use and do not declare."""

    name: str
    kind: MissingKind
    count: int
    """How often it is missed."""
    place: Place
    """Where it is first."""


def missing_from(diagnostics: Iterable[Diagnostic]) -> tuple[MissingName, ...]:
    """Names that a program's files do not declare, in the order of the text."""
    found: dict[str, MissingName] = {}
    for diagnostic in diagnostics:
        for name, kind in missing_in(diagnostic.text):
            known = found.get(name, MissingName(name=name, kind=kind, count=0, place=diagnostic.place))
            found[name] = replace(known, count=known.count + 1)
    return tuple(found.values())


def missing_names(diagnostics: Iterable[Diagnostic]) -> Iterator[Diagnostic]:
    """One diagnostic that lists the names, each with how often it is missed, at the first place; none where none is missing."""
    names = missing_from(diagnostics)
    if names:
        listed = ", ".join(f"{one.name} ({one.count})" if one.count > 1 else one.name for one in names)
        yield Diagnostic(place=names[0].place, text=f"the files miss {len(names)} names: {listed}")


# Rotations as KUKA's and FANUC's controllers state them: three angles about z, y and x, in degrees.

MIN_COS_B = 1e-7
"""Cosine of B below which A and C turn about the same axis."""


def rotation(A: float, B: float, C: float) -> Float[np.ndarray, "3 3"]:
    """Rz(A)·Ry(B)·Rx(C) of angles in degrees.

    Of KUKA's they are A, B and C (KUKA System Software, data type FRAME), of FANUC's R, P and W.
    """
    a, b, c = radians(A), radians(B), radians(C)
    sa, ca, sb, cb, sc, cc = sin(a), cos(a), sin(b), cos(b), sin(c), cos(c)
    return np.array(
        [
            [ca * cb, ca * sb * sc - sa * cc, ca * sb * cc + sa * sc],
            [sa * cb, sa * sb * sc + ca * cc, sa * sb * cc - ca * sc],
            [-sb, cb * sc, cb * cc],
        ]
    )


def rotations(degrees: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3 3"]:
    """The same of many angles."""
    (sa, sb, sc), (ca, cb, cc) = np.sin(np.radians(degrees)).T, np.cos(np.radians(degrees)).T
    rows = [
        [ca * cb, ca * sb * sc - sa * cc, ca * sb * cc + sa * sc],
        [sa * cb, sa * sb * sc + ca * cc, sa * sb * cc - ca * sc],
        [-sb, cb * sc, cb * cc],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def angles(
    R: Float[np.ndarray, "3 3"], near: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> tuple[float, float, float]:
    """A, B and C of a rotation, degrees: of the triples that describe it, the one nearest to some angles.

    They stay within half a turn, as controllers write them, where those angles do.
    """
    B = degrees(atan2(-R[2, 0], hypot(R[0, 0], R[1, 0])))
    if hypot(R[0, 0], R[1, 0]) < MIN_COS_B:
        # R = Rz(A)·Ry(±90°)·Rx(C) depends on A ∓ C only: keep A
        rest = rotation(near[0], B, 0.0).T @ R
        return _within(_near((near[0], B, degrees(atan2(rest[2, 1], rest[1, 1]))), near), near)
    A, C = degrees(atan2(R[1, 0], R[0, 0])), degrees(atan2(R[2, 1], R[2, 2]))
    both = [_near((A, B, C), near), _near((A + 180.0, 180.0 - B, C + 180.0), near)]
    best = min(both, key=lambda triple: sum(abs(angle - old) for angle, old in zip(triple, near, strict=True)))
    return _within(best, near)


def angled_pose(x: float, y: float, z: float, A: float, B: float, C: float) -> Float[np.ndarray, "4 4"]:
    """Pose of a position, millimetres, and angles, degrees, as `rotation` takes them."""
    return se3.pose(rotation(A, B, C), np.array([x, y, z]) * 1e-3)


def pose_numbers(T: Float[np.ndarray, "4 4"], near: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> tuple[float, ...]:
    """Position of a pose, millimetres, and its angles as `angles` chooses them, degrees: the inverse of `angled_pose`."""
    return (*(float(v) for v in T[:3, 3] * 1e3), *angles(T[:3, :3], near))


def _near(triple: tuple[float, float, float], near: tuple[float, float, float]) -> tuple[float, float, float]:
    """The same angles but for whole turns."""
    A, B, C = (angle + 360.0 * round((old - angle) / 360.0) for angle, old in zip(triple, near, strict=True))
    return A, B, C


def _within(triple: tuple[float, float, float], near: tuple[float, float, float]) -> tuple[float, float, float]:
    """The same angles, within half a turn where others are."""
    A, B, C = (
        angle - copysign(360.0, angle) if abs(angle) > 180.0 >= abs(old) else angle
        for angle, old in zip(triple, near, strict=True)
    )
    return A, B, C


# Files of points, which state no tool, or of its orientation only the axis.

UNIT_TOLERANCE = 1e-3
"""How far the length of a quaternion or a direction may be from one: such files round to a few digits."""


def tool_of_points(path: Path, robot: Robot | None, tool: Frame | None) -> Frame:
    """What the points of a file are of: the given tool, or the robot's own.

    Raises:
        FileError: neither is given.
    """
    if tool is None and robot is None:
        raise FileError(path, "does not say what its positions are of; give the tool, or the robot")
    return tool or Frame(name="", T=(robot or NO_ROBOT).T_flange_tool)


def with_axis(axis: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3 3"]:
    """Some orientation of the tool for each direction of its axis.

    Args:
        axis: from the tool's tip towards its holder, as APT has it (CATIA V5, syntax of generated APT instructions); need
            not be of unit length. The tool's own z points the other way, out of the tool.

    Returns:
        Rotations with that z; x lies as near to the first axis of the part's frame as it can, or to the second one
        where the tool is nearly parallel to the first.
    """
    z = -axis / np.linalg.norm(axis, axis=-1, keepdims=True)
    near = np.where(np.abs(z[..., :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    x = near - (near * z).sum(axis=-1, keepdims=True) * z
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    y = z[..., [1, 2, 0]] * x[..., [2, 0, 1]] - z[..., [2, 0, 1]] * x[..., [1, 2, 0]]
    return np.stack([x, y, z], axis=-1)
