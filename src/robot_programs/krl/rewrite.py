"""New numbers for the points of a KRL program, in the places where it states them; and new programs."""

import re
from collections import Counter, defaultdict
from collections.abc import Collection, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import isnan

import numpy as np
from jaxtyping import Bool, Float

from robot_programs.core import se3
from robot_programs.core.errors import InputError
from robot_programs.core.flow import Block, Loop
from robot_programs.core.program import (
    Composition,
    Diagnostic,
    Motion,
    MotionKind,
    Program,
    Target,
    Visit,
    Waypoint,
    Wrapping,
    reject_in_turn,
)
from robot_programs.core.robot import Robot, meeting_point
from robot_programs.core.source import FreshNames, Place, Source, TextEdit, numeral
from robot_programs.core.written_out import (
    Copy,
    Shared,
    Turns,
    WritingOut,
    least_worst,
    loops_to_write,
    reaching,
    written_out,
)
from robot_programs.krl.computed import calls_function, wrap
from robot_programs.krl.data import (
    AXES,
    DECIMALS,
    EXTERNAL,
    Datum,
    File,
    Routine,
    Text,
    axis_values,
    edits_for,
    has_axes,
    has_pose,
    pose_values,
    whole,
)
from robot_programs.krl.routines import calls_of
from robot_programs.krl.syntax import (
    Aggregate,
    Assignment,
    Call,
    Control,
    End,
    MotionLine,
    Operand,
    Reference,
    Statement,
)

# Status and turn, by which KRL tells apart the axis positions that reach one pose.
#
# KUKA System Software, Operating and Programming Instructions for System Integrators, section "Status and Turn":
#
# - T, bit i − 1: axis i stands below 0°. - S, bit 0: the centre of the wrist lies behind axis 1, that is at
# negative x of a frame that turns with axis 1 (overhead area). - S, bit 1: axis 3 stands at or beyond the angle at
# which the wrist's centre, axis 3 and axis 2 are in line; that angle is zero where axis 4 meets axis 3, and follows
# from their offset otherwise. - S, bit 2: axis 5 lies in −180° … 0° or beyond 180°. - S, bit 4: the point was
# taught by a robot whose controller corrects its own geometry.

JOINTS = 6
ACCURATE_BIT = 0b10000
"""Of S, where the controller's own correction was on."""

BORDER_TOLERANCE = 1e-6
"""Nearer to the border between two values of a bit than this, radians or metres, either value is right."""

PROBE_TURN_RAD = 1e-3
"""Of axis 3, by which it is seen about which side of its z axis it counts, radians."""


@dataclass(frozen=True, kw_only=True)
class Status:
    """S and T of a position; either may be missing."""

    S: int | None
    T: int | None

    def agrees(self, robot: Robot, q: Float[np.ndarray, "n joints"]) -> Bool[np.ndarray, " n"]:
        """Whether each posture has this status and turn.

        S does not count on a robot without a wrist of three axes through one point, where it cannot be told.

        Args:
            robot: the robot.
            q: joint positions, radians.
        """
        return self.miss(robot, q) < BORDER_TOLERANCE

    @property
    def tolerated(self) -> float:
        """Largest deviation at which the controller still takes the nearest posture, radians: not at all."""
        return 0.0

    def miss(self, robot: Robot, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, " n"]:
        """Deviation of each posture from the one meant, radians: the angle of joints to the sign that T states.

        On the wrong side of what S tells it is half a turn and more.
        """
        away = np.zeros(len(q))
        if self.T is not None:
            away = _bits_miss(self.T, -q[:, :JOINTS]).max(axis=1)
        beyond = None if self.S is None else _beyond(robot, q)
        if self.S is not None and beyond is not None:
            wrong = _bits_miss(self.S, beyond)
            away = np.maximum(away, np.where(wrong < BORDER_TOLERANCE, wrong, np.pi + wrong).max(axis=1))
        return away

    def of(self, robot: Robot, q: Float[np.ndarray, " joints"]) -> "Status":
        """Status and turn of a posture.

        What the posture does not decide stays as it is here: what is missing, bits of other meaning, bits on the border, and S
        on a robot without a wrist of three axes through one point.

        Args:
            robot: the robot.
            q: joint positions, radians.
        """
        beyond = None if self.S is None else _beyond(robot, q[None])
        S = self.S if self.S is None or beyond is None else _with_bits(self.S, beyond[0])
        T = None if self.T is None else _with_bits(self.T, -q[:JOINTS])
        return Status(S=S, T=T)


def _bits_miss(value: int, positive: Float[np.ndarray, "n bits"]) -> Float[np.ndarray, "n bits"]:
    """Amount by which each value is on the wrong side, zero on the right one."""
    stated = (value >> np.arange(positive.shape[1])) & 1 == 1
    return np.maximum(np.where(stated, -positive, positive), 0.0)


def _with_bits(value: int, positive: Float[np.ndarray, " bits"]) -> int:
    for bit, amount in enumerate(positive):
        if abs(amount) >= BORDER_TOLERANCE:
            value = value | 1 << bit if amount > 0 else value & ~(1 << bit)
    return value


def _beyond(robot: Robot, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 3"] | None:
    """Quantities that are positive where bits 0, 1 and 2 of S are set; None for a robot without such a wrist."""
    geometry = _geometry(robot)
    if geometry is None:
        return None
    ahead = q.copy()
    ahead[:, 0] = 0.0  # seen from a frame that turns with axis 1
    turned, frames = np.split(robot.joint_frames(np.concatenate([ahead, q])), 2)
    overhead = -geometry.wrist(turned)[:, 0]
    second, third = frames[:, 1], frames[:, 2]
    arm, forearm = third[:, :3, 3] - second[:, :3, 3], geometry.wrist(frames) - third[:, :3, 3]
    elbow = np.einsum("ni,ni->n", third[:, :3, 2], np.cross(arm, forearm)) * geometry.elbow_sign
    return np.stack([overhead, elbow, -np.sin(q[:, 4])], axis=1)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Geometry:
    centre: Float[np.ndarray, " 3"]
    """Of the wrist, in the frame behind joint 4."""
    elbow_sign: float
    """Whether axis 3 counts about its z axis or against it."""

    def wrist(self, frames: Float[np.ndarray, "n joints 4 4"]) -> Float[np.ndarray, "n 3"]:
        """Centres of the wrist in the base."""
        return se3.apply(frames[:, 3], self.centre)


@lru_cache(maxsize=8)
def _geometry(robot: Robot) -> _Geometry | None:
    """The arm's geometry; None unless axes 2 and 3 are parallel and axes 4, 5 and 6 meet in one point."""
    if len(robot.joint_names) != JOINTS or any(robot.prismatic):
        return None
    home = np.mean(np.clip(robot.limits, -np.pi, np.pi), axis=1)
    T, turned = robot.joint_frames(np.stack([home, home + PROBE_TURN_RAD * np.eye(JOINTS)[2]]))
    centre, distance = meeting_point(T[3:])
    if distance > BORDER_TOLERANCE or np.linalg.norm(np.cross(T[1, :3, 2], T[2, :3, 2])) > BORDER_TOLERANCE:
        return None
    return _Geometry(
        centre=T[3, :3, :3].T @ (centre - T[3, :3, 3]),
        elbow_sign=float(np.sign((T[1, :3, :3].T @ T[2, :3, 1]) @ (turned[1, :3, :3].T @ turned[2, :3, 0]))),
    )


MAX_NAME_LENGTH = 24
"""Characters of a name in KRL."""

_ALONG = re.compile(r"\s*#(BASE|TOOL)\b", re.IGNORECASE)

KEYWORDS: dict[MotionKind, str] = {"joint": "PTP", "axes": "PTP", "linear": "LIN", "circular": "CIRC"}


@dataclass(frozen=True, eq=False, kw_only=True)
class Written:
    """A point of a motion as it is written."""

    operand: Operand
    aggregates: tuple[Aggregate, ...]
    """What it states, and what is added to it by ``:``."""
    datum: Datum | None
    """Where it is a variable, or starts with one."""
    file: File
    """Of the motion."""
    computed: bool = False
    """Code computes some of it, so that its numbers stand nowhere in the text."""

    @property
    def template(self) -> Source:
        """In which the position stands that it states, or to which is added."""
        return (self.file if self.datum is None else self.datum.file).source

    @property
    def listed(self) -> Datum | None:
        """The variable, if it stands in a line of its own in the program's own data list and no other program uses it."""
        datum = self.datum
        if datum is None or datum.shared or datum.declaration is None or datum.file.module != self.file.module:
            return None
        return datum if len(datum.declaration.variables) == 1 else None


@dataclass(frozen=True, eq=False, kw_only=True)
class Site:
    """A motion's place in the text."""

    file: File
    motion: MotionLine
    written: tuple[Written, ...]
    """Its points, the last of them the end."""
    leans: bool = False
    """It counts from where the motion before ends, at least in part."""
    before: tuple[int, ...] = ()
    """Numbers of the motions that may be the one before, as far as they are known."""

    @property
    def text(self) -> tuple[int, int]:
        """Number of the file and first character."""
        return (self.file.number, self.motion.start)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Use:
    """A variable that gets other numbers for some motions."""

    datum: Datum
    changes: tuple[TextEdit, ...]
    points: list[Written] = field(default_factory=list[Written])


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class KrlProgram(Program):
    """KRL program read from ``.src`` and ``.dat`` files."""

    sites: tuple[Site, ...]
    """Of the moves, in their order."""
    files: tuple[File, ...] = ()
    bodies: Mapping[Routine, Block] = field(default_factory=dict[Routine, Block])
    """Nodes of the routines."""
    turns: Mapping[Loop, tuple[float, ...] | None] = field(default_factory=dict[Loop, tuple[float, ...] | None])
    """See `Flow.turns`."""
    unresolved: frozenset[Text] = frozenset()
    """Motions that are not understood on some way that leads to them."""

    def wrap(
        self, function: str, added: Source | None, *, without: Container[str] = (), rejected: Container[int] = ()
    ) -> Wrapping:
        """Put a function of an E6POS around points; see `Program.wrap`."""
        if added is not None and any(function.upper() in file.mentions for file in self.files):
            raise InputError(f"{self.sources[0].path}: has a function {function} already")
        staying = {site.text for i, site in enumerate(self.sites) if i not in rejected}
        motions = self.unresolved | {site.text for site in self.sites}.difference(staying)
        found = list(wrap(self.files, motions, function, without))
        edits: dict[int, list[TextEdit]] = defaultdict(list)
        for one in found:
            edits[one.file.number] += one.edits

        def read(sources: tuple[Source, ...]) -> Program:
            """The program, of whose motions with the function nothing is to be said any more."""
            again = self.reread(sources)
            assert isinstance(again, KrlProgram)
            having = {
                file.source.place(line.start)
                for file in again.files
                for line in file.statements
                if calls_function(line, function)
            }
            said = tuple(d for d in again.diagnostics if d.place not in having or "stays as it is" not in d.text)
            return replace(again, read=read, backup=self.backup, base_from=self.base_from, diagnostics=said)

        wrapped = tuple(one.file.source.place(one.line.start) for one in found if one.edits)
        sources = tuple(file.source.edited(edits.get(file.number, ())) for file in self.files)
        left = (
            Diagnostic(
                place=one.file.source.place(one.line.start),
                text=f"{one.line.keyword} is not corrected at run time: {one.obstacle}",
            )
            for one in found
            if one.obstacle
        )
        program = read((*sources, added) if added is not None else sources) if wrapped else self
        return Wrapping(program=program, wrapped=wrapped, left=tuple(left))

    def rewrite(self, robot: Robot, waypoints: Mapping[int, tuple[Waypoint, ...]]) -> tuple[Source, ...]:
        """The program's files with some motions rewritten.

        Points of the program's own data list get new numbers there, or a copy beside them where other motions still need the old
        ones; all others are written into the motion itself. Waypoints before the last become motions of their own in the
        lines before.

        Args:
            robot: the robot, whose joint positions decide status and turn.
            waypoints: by number of the motion.

        Raises:
            InputError: a motion is to be rewritten that cannot be, because others share its text.
        """
        for number, why in self.unwritable(robot, waypoints).items():
            raise InputError(
                f"motion {number} of {self.motions[number].place} cannot be rewritten: {why}; leave it out"
            )
        elements = in_data_list(self.sites, self.motions, waypoints)
        rewriting = _Rewriting(robot=robot, files=_files(self.sites))
        changed = {number for number, path in waypoints.items() if not self.motions[number].stays(path)}
        done: set[tuple[int, int]] = set()
        for number, (site, move) in enumerate(zip(self.sites, self.motions, strict=True)):
            path = waypoints.get(number)
            if site.leans:
                leaned_on = number in changed or changed.intersection(site.before)
                path = (path or (move.own_waypoint(),)) if leaned_on else None
            if path is None:
                continue
            if number in elements:
                rewriting.elements(site, move, path)
            elif move.texts_motions == 1:
                rewriting.motion(site, move, path)
            elif not move.stays(path) and site.text not in done:
                done.add(site.text)
                rewriting.motion(site, move, path)
        rewriting.variables()
        return tuple(source.edited(rewriting.edits.get(i, ())) for i, source in enumerate(self.sources))

    def unwritable(
        self, robot: Robot, waypoints: Mapping[int, tuple[Waypoint, ...]], tolerance: float = 0.0
    ) -> dict[int, str]:
        """Motions that cannot be rewritten as they should; see `Program.unwritable`."""
        return Sharing(sites=self.sites, motions=self.motions, robot=robot).unwritable(waypoints)

    def least_worst(
        self, robot: Robot, waypoints: Mapping[int, tuple[Waypoint, ...]], numbers: Collection[int], tolerance: float
    ) -> dict[int, tuple[Waypoint, ...]]:
        """One value where motions share their numbers; see `Program.least_worst`."""
        sharing = Sharing(sites=self.sites, motions=self.motions, robot=robot)
        return sharing.least_worst(waypoints, numbers, tolerance)

    def written_out(self, numbers: Collection[int]) -> tuple[Source, ...] | None:
        """The program's files with shared text written out; see `Program.written_out`."""
        shared = {self.sites[i].text for i in numbers}
        by_name: dict[str, list[Routine]] = defaultdict(list)
        for routine in self.bodies:
            by_name[routine.name].append(routine)
        calls: dict[Routine, list[tuple[Statement, Routine]]] = defaultdict(list)
        for routine in self.bodies:
            for line in routine.lines:
                for other in (other for name in calls_of(line) for other in by_name.get(name, ())):
                    calls[other].append((line, routine))
        motions = [(text, routine) for routine in self.bodies for text in _texts(routine) if text in shared]
        reached = reaching(
            motions, {other: [((r.file.number, x.start), r) for x, r in own] for other, own in calls.items()}
        )
        turns: dict[int, list[Turns]] = defaultdict(list)
        for routine, nodes in self.bodies.items():
            turns[routine.file.number] += _turns_of(routine, nodes, self.turns, reached, by_name)
        fresh = FreshNames((name for file in self.files for name in file.mentions), longest=MAX_NAME_LENGTH)
        plans = {number: WritingOut(turns=tuple(own), fresh=fresh) for number, own in turns.items() if own}
        if not plans:
            plans = _copies(calls, {routine for _, routine in motions}, self.files)
        return written_out(self.sources, [plans.get(i, WritingOut()) for i in range(len(self.sources))])

    def visits(self) -> Iterable[Visit]:
        """Motions of one routine that name one point; see `Program.visits`."""
        return visits_of(self.sites, self.motions, self.files)


# Loops written turn by turn, and routines for each of their calls.


def _texts(routine: Routine) -> Iterator[Text]:
    return ((routine.file.number, line.start) for line in routine.lines)


def _turns_of(
    routine: Routine,
    nodes: Block,
    turns: Mapping[Loop, tuple[float, ...] | None],
    shared: Container[Text],
    routines: Container[str],
) -> Iterator[Turns]:
    """Loops of a routine around some lines that can be written turn by turn."""
    source, number = routine.file.source, routine.file.number
    text = source.text

    def behind_line(position: int) -> int:
        return text.find("\n", position) + 1 or len(text)

    def differs(loop: Loop) -> bool:
        counter = loop.line.words[0].text if loop.line.words else ""
        inside = text[loop.line.end : loop.end.start]
        return loop.kind == "while" or re.search(rf"\b{re.escape(counter)}\b", inside, re.IGNORECASE) is not None

    for loop, taken in loops_to_write(nodes, turns, lambda line: (number, line.start) in shared, differs):
        opening, closing = loop.line, loop.end
        inside = [line for line in routine.lines if opening.start < line.start < closing.start]
        labels = _labels_of(inside)
        jumps = [line for line in routine.lines if isinstance(line, Control) and line.keyword == "GOTO" and line.words]
        outside = {line.words[0].upper for line in jumps if not opening.start < line.start < closing.start}
        if labels is None or labels.keys() & outside:
            continue  # it is left by EXIT, or jumped into
        if any(name in routines for name in calls_of(opening)):  # a function in its head may do more
            continue
        sets = ["" for _ in taken]
        after = ""
        if loop.kind == "counted":
            counter, upper = opening.words[0].text, [word.upper for word in opening.words]
            step = text[opening.words[upper.index("STEP") + 1].start : opening.end] if "STEP" in upper else "1"
            indent = source.indent(opening.start)
            sets = [f"{indent}{counter}={count:.0f}{source.newline}" for count in taken]
            after = f"{indent}{counter}={counter}+({step}){source.newline}"
        yield Turns(
            start=text.rfind("\n", 0, opening.start) + 1,
            end=behind_line(closing.end),
            body=(behind_line(opening.end), text.rfind("\n", 0, closing.start) + 1),
            before=tuple(sets),
            after=after,
            labels=labels,
        )


def _labels_of(lines: Sequence[Statement]) -> dict[str, tuple[tuple[int, int], ...]] | None:
    """Labels and jumps to them in some lines, each with its places; None where a line leaves a loop."""
    found: dict[str, list[tuple[int, int]]] = defaultdict(list)
    for line in lines:
        if not isinstance(line, Control):
            continue
        if line.keyword == "EXIT":
            return None
        if line.keyword in ("LABEL", "GOTO") and line.words:
            found[line.words[0].upper].append((line.words[0].start, line.words[0].end))
    own = {
        line.words[0].upper for line in lines if isinstance(line, Control) and line.keyword == "LABEL" and line.words
    }
    return {label: tuple(places) for label, places in found.items() if label in own}


def _copies(
    calls: Mapping[Routine, Sequence[tuple[Statement, Routine]]], shared: Iterable[Routine], files: Iterable[File]
) -> dict[int, WritingOut]:
    """A copy of routines with shared lines for each call in their file but the first; by number of the file."""
    fresh = FreshNames((name for file in files for name in file.mentions), longest=MAX_NAME_LENGTH)
    copies: dict[int, list[Copy]] = defaultdict(list)
    named: dict[int, dict[tuple[int, int], str]] = defaultdict(dict)
    for routine in sorted(shared, key=lambda one: (one.file.number, one.head.start if one.head else 0)):
        head, file = routine.head, routine.file
        own = [line for line, by in calls.get(routine, ()) if by.file is file and isinstance(line, Call)]
        text = file.source.text
        end = next(
            (line for line in file.statements if head and isinstance(line, End) and line.start > head.start), None
        )
        if head is None or end is None or any(by is routine for _, by in calls.get(routine, ())):
            continue
        name = re.search(rf"\b{re.escape(routine.name)}\b", text[head.start : head.end], re.IGNORECASE)
        if name is None:
            continue
        start, at = text.rfind("\n", 0, head.start) + 1, text.find("\n", end.end) + 1 or len(text)
        for line in own[len(own) == len(calls.get(routine, ())) :]:
            new = fresh.like(name[0])
            named[file.number][line.start, line.start + len(routine.name)] = new
            copies[file.number].append(
                Copy(
                    at=at,
                    before=file.source.newline,
                    span=(start, at),
                    named={(head.start + name.start(), head.start + name.end()): new},
                )
            )
    return {number: WritingOut(copies=tuple(own), named=named[number]) for number, own in copies.items()}


def _files(sites: Sequence[Site]) -> tuple[File, ...]:
    files = {f.number: f for site in sites for f in (site.file, *(w.datum.file for w in site.written if w.datum))}
    return tuple(files.values())


@dataclass(frozen=True, eq=False, kw_only=True)
class _Rewriting:
    robot: Robot
    files: tuple[File, ...]
    edits: dict[int, list[TextEdit]] = field(default_factory=dict[int, list[TextEdit]])
    """By number of the file."""
    uses: dict[tuple[int, int, tuple[TextEdit, ...]], _Use] = field(
        default_factory=dict[tuple[int, int, tuple[TextEdit, ...]], _Use]
    )
    """By file and position of the variable, and by what changes."""

    def _edit(self, file: File, edit: TextEdit) -> None:
        self.edits.setdefault(file.number, []).append(edit)

    def motion(self, site: Site, move: Motion, path: tuple[Waypoint, ...]) -> None:
        """Rewrite a motion, with motions of their own for all waypoints but the last."""
        *before, last = path
        self._before(site, move, before)
        start = site.motion.start
        if last.kind != move.kind or site.leans:
            text = self._instruction(site, move, last, passing=not move.stops)
            self._edit(site.file, TextEdit(start=start, end=site.motion.end, text=text))
            return
        self._point(site.written[-1], last)
        if last.via is not None:
            self._point(site.written[0], last.via)

    def _before(self, site: Site, move: Motion, path: Sequence[Waypoint]) -> None:
        """Put motions of their own before a motion."""
        source, start = site.file.source, site.motion.start
        line = source.text.rfind("\n", 0, start) + 1
        for waypoint in path:
            text = self._instruction(site, move, waypoint, passing=True)
            self._edit(site.file, TextEdit(start=line, end=line, text=f"{source.indent(start)}{text}{source.newline}"))

    def elements(self, site: Site, move: Motion, path: tuple[Waypoint, ...]) -> None:
        """Give the elements to which a motion goes their new numbers, in the data list."""
        *before, last = path
        self._before(site, move, before)
        points = (last,) if last.via is None else (last.via, last)
        for written, waypoint in zip(site.written, points, strict=True):
            datum = written.datum
            assert datum is not None
            edits = self.edits.setdefault(datum.file.number, [])
            known = {(edit.start, edit.end) for edit in edits}
            changes = edits_for(datum.aggregate, values_at(self.robot, written, waypoint))
            edits += [change for change in changes if (change.start, change.end) not in known]

    def _instruction(self, site: Site, move: Motion, waypoint: Waypoint, *, passing: bool) -> str:
        """A motion instruction to a waypoint, with all else that the motion says."""
        keyword = KEYWORDS[waypoint.kind]
        spline = site.motion.keyword.startswith("S")
        if spline:
            # a line in its stead would change the spline
            keyword = "SPL" if site.motion.keyword == "SPL" else f"S{keyword}"
        points = [self._aggregate(site.written[-1], waypoint)]
        if waypoint.via is not None:
            points.insert(0, self._aggregate(site.written[-1], waypoint.via))
        rest = site.file.source.text[site.written[-1].operand.end : site.motion.end]
        if site.motion.along:
            rest = _ALONG.sub("", rest)
        along_path = waypoint.kind in ("linear", "circular")
        if not spline and along_path != (move.kind in ("linear", "circular")):
            rest = ""  # C_PTP is not for paths, C_DIS not for PTP alone
        if passing and (move.stops or not rest):
            rest += " C_SPL" if spline else " C_DIS" if along_path else " C_PTP"
        return f"{keyword} {', '.join(points)}{rest}"

    def _point(self, written: Written, waypoint: Waypoint) -> None:
        """Give a point of a motion its new numbers."""
        first, operand = written.aggregates[0], written.operand
        if has_axes(first) == (waypoint.T is None):
            changes = edits_for(first, values_at(self.robot, written, waypoint))
            if written.datum is None and len(operand.parts) == 1 and not written.computed:
                for change in changes:
                    self._edit(written.file, change)
                return
            datum = written.listed
            if datum is not None and not written.computed:
                key = (datum.file.number, datum.start, tuple(changes))
                self.uses.setdefault(key, _Use(datum=datum, changes=key[2])).points.append(written)
                return
            if not changes and len(operand.parts) < 2:
                return
        self._edit(
            written.file, TextEdit(start=operand.start, end=operand.end, text=self._aggregate(written, waypoint))
        )

    def _aggregate(self, written: Written, waypoint: Waypoint) -> str:
        """A waypoint in braces: as the point is written, if it states the same kind of position completely, in numbers."""
        first = written.aggregates[0]
        values = values_at(self.robot, written, waypoint)
        names = [name for name in values if name not in ("S", "T")]
        beside = {name: value for name, value in zip(EXTERNAL, waypoint.external, strict=False) if not isnan(value)}
        values |= {name: value for name, value in beside.items() if first.field(name)}
        numbers = all(first.field(name) for name in names) and all(part.value is not None for part in first.fields)
        if numbers and not written.computed:
            return written.template.piece(first.start, first.end, edits_for(first, values))
        parts = [f"{name} {numeral(values[name], 5 if name in 'XYZ' else 6)}" for name in names]
        for name in ("S", "T"):
            own = first.field(name)
            if name in values:
                parts.append(f"{name} {int(values[name])}")
            elif own is not None and waypoint.T is not None:
                parts.append(f"{name} {own.text}")
        parts += [
            f"{name} {numeral(values[name], 6) if name in values else component.text}"
            for name in EXTERNAL
            if (component := first.field(name))
        ]
        return f"{{{'E6AXIS' if waypoint.T is None else 'E6POS'}: {','.join(parts)}}}"

    def variables(self) -> None:
        """Change variables where all motions that use one agree, and copy them where they do not."""
        by_datum: dict[tuple[int, int], list[_Use]] = {}
        for (file, start, _), use in self.uses.items():
            by_datum.setdefault((file, start), []).append(use)
        if not self.uses:
            return
        names = FreshNames((name for file in self.files for name in file.mentions), longest=MAX_NAME_LENGTH)
        modules: dict[str, list[File]] = defaultdict(list)
        for file in self.files:
            modules[file.module].append(file)
        for uses in by_datum.values():
            datum = uses[0].datum
            rewritten = {(w.file.number, w.operand.start) for use in uses for w in use.points}
            rewritten.add((datum.file.number, datum.start))
            mentions = {
                (file.number, at) for file in modules[datum.file.module] for at in file.mentions.get(datum.name, ())
            }
            stays = any(not use.changes for use in uses) or mentions - rewritten
            for use in uses:
                if not stays and use is uses[0]:
                    for change in use.changes:
                        self._edit(datum.file, change)
                    name = _name(datum)
                else:
                    name = self._copied(use, names) if use.changes else _name(datum)
                for written in use.points:
                    operand = written.operand
                    if (
                        len(operand.parts) > 1
                        or written.file.source.text[operand.start : operand.end].upper() != name.upper()
                    ):
                        self._edit(written.file, TextEdit(start=operand.start, end=operand.end, text=name))

    def _copied(self, use: _Use, names: FreshNames) -> str:
        """Put a copy of a variable with other numbers behind its line."""
        datum, source = use.datum, use.datum.file.source
        name = names.like(_name(datum))
        start = source.text.rfind("\n", 0, datum.start) + 1
        end = source.text.find("\n", datum.start) + 1
        renamed = TextEdit(start=datum.start, end=datum.start + len(_name(datum)), text=name)
        at = end or len(source.text)
        line = source.piece(start, at, [renamed, *use.changes])
        self._edit(datum.file, TextEdit(start=at, end=at, text=line if end else source.newline + line))
        return name


def values_at(robot: Robot, written: Written, waypoint: Waypoint) -> dict[str, float]:
    """Values of all components of a point at a waypoint, millimetres and degrees."""
    if waypoint.T is None:
        return axis_values(waypoint.q)
    first = written.aggregates[0]
    values = pose_values(waypoint.T, first)
    if has_pose(first) and not (first.field("S") or first.field("T")):
        return values
    if np.isnan(waypoint.q).any():  # written again where it was, of which the posture is not known
        return values
    stated = Status(S=whole(first, "S") or 0, T=whole(first, "T") or 0)
    status = stated.of(robot, waypoint.q)
    return {**values, "S": float(status.S or 0), "T": float(status.T or 0)}


def _name(datum: Datum) -> str:
    """A variable's name as its declaration writes it."""
    return datum.file.source.text[datum.start : datum.start + len(datum.name)]


# Motions that share their text, in a loop or in a routine with several calls: which can be rewritten as each of
# them needs.
#
# A text that goes to elements of an array by a computed index leaves it to the elements, which get their numbers in
# the data list. Any other text can only be rewritten if all of its motions need the same.

NUMBER_TOLERANCE = 2e-5
"""Millimetres and degrees that differ by less are written alike."""

Values = tuple[dict[str, float] | None, ...]
"""New numbers for the points of a motion; None for those that stay."""


def in_data_list(
    sites: Sequence[Site], motions: Sequence[Motion], waypoints: Mapping[int, tuple[Waypoint, ...]]
) -> frozenset[int]:
    """Numbers of motions whose points get their numbers in the data list.

    They go to elements of arrays of the program's own to which a text leads that stands for several motions.
    """
    arrays = [_arrays(site) for site in sites]
    shared = frozenset[str]().union(*(own for own, move in zip(arrays, motions, strict=True) if move.texts_motions > 1))
    return frozenset(
        i
        for i, (own, move) in enumerate(zip(arrays, motions, strict=True))
        if own & shared and all(point.kind == move.kind for point in waypoints.get(i, ())[-1:])
    )


def _arrays(site: Site) -> frozenset[str]:
    """Arrays of the program's own to which a motion goes, by module and name; none where any of its points is anything else."""
    names = [_array(written) for written in site.written]
    return frozenset(names) if all(names) else frozenset()


def _array(written: Written) -> str:
    parts, datum = written.operand.parts, written.datum
    part = parts[0] if len(parts) == 1 else None
    if datum is None or written.computed or not isinstance(part, Reference) or "[" not in datum.name:
        return ""
    if datum.shared or datum.file.module != written.file.module:
        return ""
    return f"{datum.file.module}:{datum.name.partition('[')[0]}"


@dataclass(frozen=True, eq=False, kw_only=True)
class Sharing:
    """The motions of a program."""

    sites: Sequence[Site]
    motions: Sequence[Motion]
    robot: Robot

    def unwritable(self, waypoints: Mapping[int, tuple[Waypoint, ...]]) -> dict[int, str]:
        """Motions that cannot be rewritten as they should, by number, and why."""
        return reject_in_turn(waypoints, self._conflicts)

    def least_worst(
        self, waypoints: Mapping[int, tuple[Waypoint, ...]], numbers: Collection[int], tolerance: float
    ) -> dict[int, tuple[Waypoint, ...]]:
        """New waypoints of motions that share their numbers; see `Program.least_worst`."""
        groups: dict[object, list[Shared]] = defaultdict(list)
        elements = in_data_list(self.sites, self.motions, waypoints)
        for i, (site, move) in enumerate(zip(self.sites, self.motions, strict=True)):
            datum, T = site.written[-1].datum, move.end.T
            if len(site.written) > 1 or site.leans or T is None:
                continue
            if i in elements and datum is not None:
                groups[datum.file.number, datum.start].append(Shared(number=i))
            elif move.texts_motions > 1:
                groups[site.text, T.tobytes()].append(Shared(number=i))
        out: dict[int, tuple[Waypoint, ...]] = {}
        for group in groups.values():
            whole = len(group) in (1, self.motions[group[0].number].texts_motions) or group[0].number in elements
            if whole and any(one.number in numbers for one in group):
                out |= least_worst(group, waypoints, tolerance)
        return out

    def _conflicts(self, waypoints: Mapping[int, tuple[Waypoint, ...]]) -> Iterator[tuple[int, str]]:
        texts: dict[tuple[int, int], list[int]] = defaultdict(list)
        elements = in_data_list(self.sites, self.motions, waypoints)
        for i, (site, move) in enumerate(zip(self.sites, self.motions, strict=True)):
            if move.texts_motions == 1:
                continue
            yield from self._alone(i, waypoints)
            if i not in elements:
                texts[site.text].append(i)
        for group in texts.values():
            yield from self._of_text(group, waypoints)
        yield from self._of_elements(sorted(elements), waypoints)

    def _alone(self, i: int, waypoints: Mapping[int, tuple[Waypoint, ...]]) -> Iterator[tuple[int, str]]:
        """Conflicts of one of several motions of a text, and of those that it affects."""
        site, move = self.sites[i], self.motions[i]
        path = waypoints.get(i)
        if path is not None and move.stays(path):
            path = None
        other = path is not None and (len(path) != 1 or any(waypoint.kind != move.kind for waypoint in path))
        if other or (path is not None and site.leans):
            yield i, f"its text stands for {move.texts_motions} motions, and cannot become other ones for one of them"
        if site.leans:
            why = f"{move.place} counts from where it ends, and its text stands for {move.texts_motions} motions"
            yield from ((before, why) for before in site.before)

    def _of_text(
        self, group: Sequence[int], waypoints: Mapping[int, tuple[Waypoint, ...]]
    ) -> Iterator[tuple[int, str]]:
        """Motions of one text, which has to be the same for all of them."""
        changing = [i for i in group if i in waypoints]
        wants = [self._wanted(i, waypoints.get(i)) for i in group]
        if not changing or all(_agree(wants[0], want) for want in wants):
            return
        places = {
            np.asarray(end.T if end.T is not None else end.q).tobytes() for end in (self.motions[i].end for i in group)
        }
        count = self.motions[group[0]].texts_motions
        apart = " to different places" if len(places) > 1 else ", which need different numbers"
        why = f"its text stands for {count} motions{apart}"
        yield from ((i, why) for i in changing)

    def _of_elements(
        self, numbers: Sequence[int], waypoints: Mapping[int, tuple[Waypoint, ...]]
    ) -> Iterator[tuple[int, str]]:
        """Motions to elements of arrays, each of which has one set of numbers for all that go there."""
        users: dict[tuple[int, int], list[tuple[int, dict[str, float] | None]]] = defaultdict(list)
        data: dict[tuple[int, int], Datum] = {}
        for i in numbers:
            for written, values in zip(self.sites[i].written, self._wanted(i, waypoints.get(i)), strict=True):
                datum = written.datum
                assert datum is not None
                key = (datum.file.number, datum.start)
                data[key] = datum
                users[key].append((i, values))
        own = {(w.file.number, w.operand.start) for i in numbers for w in self.sites[i].written}
        for key, wants in users.items():
            changing = [i for i, values in wants if values is not None]
            if not changing:
                continue
            other = self._other_reading(data[key], own)
            if other is not None:
                why = f"its target {data[key].name} is read for something else in {other}, too"
                yield from ((i, why) for i in changing)
            elif not all(_agree((wants[0][1],), (values,)) for _, values in wants):
                places = ", ".join(dict.fromkeys(str(self.motions[i].place) for i, _ in wants))
                why = f"has its target {data[key].name} in common with {places}, which need other numbers"
                yield from ((i, why) for i in changing)

    def _other_reading(self, datum: Datum, own: set[tuple[int, int]]) -> Place | None:
        """Place at which code names an array beside the motions to its elements."""
        array = datum.name.partition("[")[0]
        for file in _files(self.sites):
            for position in (
                file.mentions.get(array, ()) if file.module == datum.file.module and not file.holds_data else ()
            ):
                if (file.number, position) not in own:
                    return file.source.place(position)
        return None

    def _wanted(self, i: int, path: tuple[Waypoint, ...] | None) -> Values:
        site = self.sites[i]
        if path is None or self.motions[i].stays(path):
            return (None,) * len(site.written)
        last = path[-1]
        points = (last,) if last.via is None or len(site.written) == 1 else (last.via, last)
        if len(points) < len(site.written):
            return (None,) * len(site.written)
        return tuple(values_at(self.robot, w, p) for w, p in zip(site.written, points, strict=True))


def _agree(one: Values, other: Values) -> bool:
    for a, b in zip(one, other, strict=True):
        if a is None or b is None or a.keys() != b.keys():
            if a is not b:
                return False
        elif any(abs(a[name] - b[name]) > NUMBER_TOLERANCE for name in a):
            return False
    return True


def visits_of(sites: Sequence[Site], motions: Sequence[Motion], files: Iterable[File]) -> Iterator[Visit]:
    """Motions of one routine that name one point, or a variable that was last set by it, and those that lean on each other.

    What a variable held before it was set anew as a whole is another target.
    """
    numbers: dict[tuple[int, int], list[int]] = defaultdict(list)
    for i, site in enumerate(sites):
        numbers[site.text].append(i)
    for file in files:
        for routine in file.sections:
            points = {name for line in routine.lines if isinstance(line, MotionLine) for name in _named(line)}
            sets: dict[str, frozenset[str]] = {}
            times: Counter[str] = Counter()
            for line in routine.lines:
                if isinstance(line, Assignment) and not line.component:
                    read = {word.upper for word in line.words}
                    times[line.name] += line.name not in read
                    named = frozenset(points & read) - {line.name}
                    sets[line.name] = named.union(*(sets.get(name, ()) for name in named))
                elif isinstance(line, MotionLine):
                    named = frozenset(_named(line))
                    for name in named.union(*(sets.get(name, ()) for name in named)):
                        for i in numbers.get((file.number, line.start), (None,)):
                            target = (routine, name, times[name])
                            yield Visit(number=i, target=target, place=file.source.place(line.start))
    for i, site in enumerate(sites):
        for number in (i, *site.before) if site.leans else ():
            yield Visit(number=number, target=i, place=motions[number].place)


def _named(motion: MotionLine) -> Iterator[str]:
    """Variables in the points of a motion."""
    for operand in motion.operands:
        yield from (part.name for part in operand.parts if isinstance(part, Reference))


# A new KRL program of given motions.


ZONE_MM, ZONE_PERCENT = 0.3, 1
"""How near motions that do not stop pass by their targets, along paths and by the joints."""


def compose_krl(program: Composition) -> Source:
    """A program of its own, ``name.src``, with all points in its motions.

    Raises:
        InputError: KRL cannot say it.
    """
    program.expect_name("a KRL program", MAX_NAME_LENGTH, begins="A-Za-z_")
    robot = program.robot
    if len(robot.joint_names) > len(AXES) or any(robot.prismatic):
        raise InputError(f"{robot.name} is not a robot of up to six turning axes, which KRL's positions describe")
    nearest = f"$APO.CDIS = {ZONE_MM:g}", f"$APO.CPTP = {ZONE_PERCENT}"
    lines = [
        "&ACCESS RVP",
        f"DEF {program.name} ( )",
        "EXT BAS (BAS_COMMAND :IN,REAL :IN )",
        "GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM ( )",
        "INTERRUPT ON 3",
        "BAS (#INITMOV,0 )",
        f"BAS (#VEL_PTP,{program.joint_speed_percent:g} )",
        *(nearest if any(not move.stops for move in program.motions) else ()),
        *_motions(program),
        "END",
    ]
    return program.written(lines, ".src")


def _motions(program: Composition) -> Iterator[str]:
    before: dict[str, str] = {}
    for i, move in enumerate(program.motions):
        if program.notes:
            yield f"; {program.note(i)}"
        for name, text in _settings(i, move).items():
            if before.get(name) != text:
                before[name] = text
                yield f"{name} = {text}"
        status = _status(program, i) if move.kind == "joint" else None
        points = [_point(move.end, status)]
        if move.via is not None:
            points.insert(0, _point(move.via, None))
        along_path = move.kind in ("linear", "circular")
        passing = "" if move.stops else " C_DIS" if along_path else " C_PTP"
        yield f"{KEYWORDS[move.kind]} {','.join(points)}{passing}"
        if waits_s := program.waits_s(i):
            yield f"WAIT SEC {waits_s:g}"


def _settings(number: int, move: Motion) -> dict[str, str]:
    """System variables that must hold for a motion, and their values."""
    if move.kind == "axes":
        return {}
    if move.part_in_hand:
        raise InputError(
            f"motion {number} has its part in the robot's hand; in KRL that needs frames of TOOL_DATA and BASE_DATA by number"
        )
    out = {
        "$TOOL": _braces(pose_values(move.tool.T)),
        "$BASE": _braces(pose_values(move.part.T)),
    }
    if move.speed is not None:
        out["$VEL.CP"] = f"{move.speed:g}"
    return out


def _status(program: Composition, number: int) -> Status:
    q, stated = program.posture(number), program.motions[number].end.posture
    if q is not None:
        return Status(S=0, T=0).of(program.robot, q)
    if isinstance(stated, Status):
        return stated
    raise InputError(
        f"motion {number} drives all joints to a pose and does not say in which posture; give its joint positions"
    )


def _point(target: Target, status: Status | None) -> str:
    if target.q is not None:
        return _braces(axis_values(target.q))
    if target.T is None:
        raise InputError("a target is given neither a pose nor joint positions")
    values = pose_values(target.T)
    if status is None:
        return _braces(values)
    stated = {name: value for name, value in (("S", status.S), ("T", status.T)) if value is not None}
    return _braces(values, stated)


def _braces(values: dict[str, float], status: dict[str, int] | None = None) -> str:
    parts = [f"{name} {numeral(value, DECIMALS[name])}" for name, value in values.items()]
    parts += [f"{name} {value}" for name, value in (status or {}).items()]
    return f"{{{','.join(parts)}}}"
