"""New numbers for the points of a KRL program, in the places where it states them; and new programs."""

import re
from collections import Counter, defaultdict
from collections.abc import Collection, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import isnan
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from robot_programs.core.errors import InputError
from robot_programs.core.flow import Block, Loop
from robot_programs.core.program import (
    Composition,
    Motion,
    MotionKind,
    Paths,
    Program,
    Target,
    Visit,
    Waypoint,
    Wrapping,
    reject_in_turn,
    wrapping,
)
from robot_programs.core.robot import NO_ROBOT, Robot, arm_bends
from robot_programs.core.source import FreshNames, Place, Source, TextEdit, numeral
from robot_programs.core.written_out import (
    Repeated,
    Shared,
    Table,
    Turns,
    least_worst,
    loops_to_write,
    of_whole_paths,
    reaching,
    same_motions,
    tables,
    with_texts,
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
    BLOCKS,
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
"""Nearer to the border between two values of a bit than this, radians, either value is right."""


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
    """Angles, or the sine of one, that are positive where bits 0, 1 and 2 of S are set; None for a robot without such an arm."""
    bends = arm_bends(robot, q)
    return None if bends is None else np.column_stack([-bends[:, 0], bends[:, 1], -np.sin(q[:, 4])])


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


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class KrlProgram(Program):
    """KRL program read from ``.src`` and ``.dat`` files."""

    sites: tuple[Site, ...]
    """Of the motions, in their order."""
    files: tuple[File, ...] = ()
    bodies: Mapping[Routine, Block] = field(default_factory=dict[Routine, Block])
    """Nodes of the routines."""
    turns: Mapping[Loop, tuple[float, ...] | None] = field(default_factory=dict[Loop, tuple[float, ...] | None])
    """See `Flow.turns`."""
    begun: Mapping[Loop, tuple[float, ...] | None] = field(default_factory=dict[Loop, tuple[float, ...] | None])
    """See `Flow.begun`."""
    unresolved: frozenset[Text] = frozenset()
    """Motions that are not understood on some way that leads to them."""

    def wrap(
        self,
        function: str,
        added: Source | None,
        *,
        without: Collection[str] = (),
        rejected: Container[int] = (),
        keep_joints: bool = False,
    ) -> Wrapping:
        """Put a function of an E6POS around points; see `Program.wrap`."""
        if added is not None and any(function.upper() in file.mentions for file in self.files):
            raise InputError(f"{self.sources[0].path}: has a function {function} already")
        staying = {site.text for i, site in enumerate(self.sites) if i not in rejected}
        motions = self.unresolved | {site.text for site in self.sites}.difference(staying)

        def cleared(again: KrlProgram) -> tuple[KrlProgram, set[Place]]:
            lines = ((file, line) for file in again.files for line in file.statements if calls_function(line, function))
            return again, {file.source.place(line.start) for file, line in lines}

        return wrapping(self, wrap(self.files, motions, function, without), added, cleared)

    def rewrite(self, robot: Robot, waypoints: Paths) -> tuple[Source, ...]:
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
        for number, (site, motion) in enumerate(zip(self.sites, self.motions, strict=True)):
            path = waypoints.get(number)
            if site.leans:
                leaned_on = number in changed or changed.intersection(site.before)
                path = (path or (motion.own_waypoint(),)) if leaned_on else None
            if path is None:
                continue
            if number in elements:
                rewriting.elements(site, motion, path)
            elif motion.texts_motions == 1:
                rewriting.motion(site, motion, path)
            elif not motion.stays(path) and site.text not in done:
                done.add(site.text)
                rewriting.motion(site, motion, path)
        rewriting.variables()
        return tuple(source.edited(rewriting.edits.get(i, ())) for i, source in enumerate(self.sources))

    def unwritable(self, robot: Robot, waypoints: Paths, tolerance: float = 0.0) -> dict[int, str]:
        """Motions that cannot be rewritten as they should; see `Program.unwritable`."""
        return reject_in_turn(waypoints, lambda rest: _conflicts(self, robot, rest))

    def least_worst(
        self, robot: Robot, waypoints: Paths, numbers: Collection[int], tolerance: float
    ) -> dict[int, tuple[Waypoint, ...]]:
        """One value where motions share their numbers; see `Program.least_worst`."""
        groups: dict[object, list[Shared]] = defaultdict(list)
        elements = in_data_list(self.sites, self.motions, waypoints)
        for i, (site, motion) in enumerate(zip(self.sites, self.motions, strict=True)):
            datum, T = site.written[-1].datum, motion.end.T
            if len(site.written) > 1 or site.leans or T is None:
                continue
            if i in elements and datum is not None:
                groups[datum.file.number, datum.start].append(Shared(number=i))
            elif motion.texts_motions > 1:
                groups[site.text, T.tobytes()].append(Shared(number=i))
        out: dict[int, tuple[Waypoint, ...]] = {}
        for group in groups.values():
            whole = len(group) in (1, self.motions[group[0].number].texts_motions) or group[0].number in elements
            if whole and any(one.number in numbers for one in group):
                out |= least_worst(group, waypoints, tolerance)
        return out

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
        lines = ((routine, line) for routine in self.bodies for line in routine.lines)
        motions = [(text, r) for r, line in lines if (text := (r.file.number, line.start)) in shared]
        reached = reaching(
            motions, {other: [((r.file.number, x.start), r) for x, r in own] for other, own in calls.items()}
        )
        turns = (
            (routine.file.source, loop)
            for routine, nodes in self.bodies.items()
            for loop in _turns_of(routine, nodes, self.turns, reached, by_name)
        )
        repeated = _repeated(calls, {routine for _, routine in motions})
        return written_out(self.sources, turns, repeated, _fresh_names(self.files))

    def tabled(self, numbers: Collection[int]) -> tuple[Source, ...] | None:
        """The program's files with targets of loops in arrays, of the data list where one is given; see `Program.tabled`."""
        own: dict[Text, list[int]] = defaultdict(list)
        for i, site in enumerate(self.sites):
            own[site.text].append(i)
        shared, fresh = {self.sites[i].text for i in numbers}, _fresh_names(self.files)
        of_table: dict[Table, Routine] = {}
        for routine, nodes in self.bodies.items():

            def listable(line: Statement, number: int = routine.file.number) -> Sequence[int]:
                same = own[number, line.start] if (number, line.start) in shared else ()
                return same if all(_is_listable(self.sites[i], self.motions[i]) for i in same) else ()

            of_table |= dict.fromkeys(tables(nodes, listable, self.begun, _counter), routine)
        lists = {file.module: file for file in self.files if file.holds_data and not file.serves_all}
        writing = _Rewriting(robot=NO_ROBOT, files=())
        named: dict[Path, dict[tuple[int, int], str]] = defaultdict(lambda: defaultdict(str))
        for one in of_whole_paths(tuple(of_table), numbers, self.visits()):
            routine, name = of_table[one], fresh.nearest(TABLE)
            texts = [writing.aggregate(self.sites[i].written[-1], self.motions[i].own_waypoint()) for i in one.numbers]
            places = (",".join(str(k + 1) for k in place) for place in np.ndindex(one.size))
            declared = f"DECL E6POS {name}[{','.join(map(str, one.size))}]"
            elements = [f"{name}[{place}]={_TYPE.sub('{', text)}" for place, text in zip(places, texts, strict=True)]
            for file, at, lines in _behind(routine, lists.get(routine.file.module), declared, elements):
                named[file.source.path][at, at] += "".join(f"{line}{file.source.newline}" for line in lines)
            operand = self.sites[one.numbers[0]].written[-1].operand
            named[routine.file.source.path][operand.start, operand.end] = f"{name}[{one.index('/')}]"
        sources = with_texts(self.sources, named, fresh) if named else None
        return sources if sources and same_motions(self.motions, self.reread(sources).motions) else None

    def visits(self) -> Iterator[Visit]:
        """Motions of one routine that name one point, or a variable that was last set by it, and those that lean on each other.

        What a variable held before it was set anew as a whole is another target; see `Program.visits`.
        """
        numbers: dict[tuple[int, int], list[int]] = defaultdict(list)
        for i, site in enumerate(self.sites):
            numbers[site.text].append(i)
        for file in self.files:
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
        for i, site in enumerate(self.sites):
            for number in (i, *site.before) if site.leans else ():
                yield Visit(number=number, target=i, place=self.motions[number].place)


# Loops written turn by turn, and routines for each of their calls.


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
        if counter := _counter(loop):
            upper = [word.upper for word in opening.words]
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


def _repeated(
    calls: Mapping[Routine, Sequence[tuple[Statement, Routine]]], shared: Iterable[Routine]
) -> Iterator[Repeated]:
    """Routines with shared lines, of which each call in their file but the first gets a copy."""
    for routine in sorted(shared, key=lambda one: (one.file.number, one.head.start if one.head else 0)):
        head, file, everywhere = routine.head, routine.file, calls.get(routine, ())
        if head is None or any(by is routine for _, by in everywhere):
            continue
        text = file.source.text
        end = next((line for line in file.statements if isinstance(line, End) and line.start > head.start), None)
        name = re.search(rf"\b{re.escape(routine.name)}\b", text[head.start : head.end], re.IGNORECASE)
        if end is None or name is None:
            continue
        own = [line for line, by in everywhere if by.file is file and isinstance(line, Call)]
        first, at = text.rfind("\n", 0, head.start) + 1, text.find("\n", end.end) + 1 or len(text)
        yield Repeated(
            source=file.source, at=at, before=file.source.newline, span=(first, at),
            name=(head.start + name.start(), head.start + name.end()),
            calls=tuple(
                (file.source, (line.start, line.start + len(name[0]))) for line in own[len(own) == len(everywhere) :]
            ),
        )  # fmt: skip


def _counter(loop: Loop) -> str:
    return loop.line.words[0].text if loop.kind == "counted" else ""


def _fresh_names(files: Iterable[File]) -> FreshNames:
    return FreshNames((name for file in files for name in file.mentions), longest=MAX_NAME_LENGTH)


# Targets of loops in arrays.

TABLE = "TASKCAL_TARGETS"
"""Name of an array of targets, an element for each turn of a loop."""

_TYPE = re.compile(r"^\{\s*\w+\s*:\s*")
"""With which a position in braces may begin."""


def _is_listable(site: Site, motion: Motion) -> bool:
    """Whether an element of an array may hold the target of a motion, with all that counts of it there."""
    last = site.written[-1].aggregates[-1]
    stated = motion.kind == "linear" or (whole(last, "S") is not None and whole(last, "T") is not None)
    return stated and len(site.written) == 1 and motion.end.T is not None and not site.leans


def _behind(
    routine: Routine, data: File | None, declared: str, elements: list[str]
) -> Iterator[tuple[File, int, list[str]]]:
    """Places for the lines of an array: in the data list, or in a routine without one; none where there is none."""
    file, head = routine.file, routine.head
    if data is not None:
        end = next((line for line in reversed(data.statements) if isinstance(line, End)), None)
        if end is not None:
            yield data, data.source.text.rfind("\n", 0, end.start) + 1, [declared, *elements]
    elif head is not None:
        text = file.source.text
        block = next(line for line in routine.lines if isinstance(line, Control) and line.keyword in BLOCKS)
        yield file, text.find("\n", head.end) + 1, [declared]
        yield file, text.rfind("\n", 0, block.start) + 1, elements


def _files(sites: Sequence[Site]) -> tuple[File, ...]:
    files = {f.number: f for site in sites for f in (site.file, *(w.datum.file for w in site.written if w.datum))}
    return tuple(files.values())


@dataclass(frozen=True, eq=False, kw_only=True)
class _Rewriting:
    robot: Robot
    files: tuple[File, ...]
    edits: dict[int, list[TextEdit]] = field(default_factory=dict[int, list[TextEdit]])
    """By number of the file."""
    uses: dict[Datum, dict[tuple[TextEdit, ...], list[Written]]] = field(default_factory=dict[Datum, Any])
    """By variable and what changes of it: the points that are to have it so."""

    def _edit(self, file: File, edit: TextEdit) -> None:
        self.edits.setdefault(file.number, []).append(edit)

    def motion(self, site: Site, motion: Motion, path: tuple[Waypoint, ...]) -> None:
        *before, last = path
        self._before(site, motion, before)
        start = site.motion.start
        if last.kind != motion.kind or site.leans:
            text = self._instruction(site, motion, last, passing=not motion.stops)
            self._edit(site.file, TextEdit(start=start, end=site.motion.end, text=text))
            return
        self._point(site.written[-1], last)
        if last.via is not None:
            self._point(site.written[0], last.via)

    def _before(self, site: Site, motion: Motion, path: Sequence[Waypoint]) -> None:
        source, start = site.file.source, site.motion.start
        line = source.text.rfind("\n", 0, start) + 1
        for waypoint in path:
            text = self._instruction(site, motion, waypoint, passing=True)
            self._edit(site.file, TextEdit(start=line, end=line, text=f"{source.indent(start)}{text}{source.newline}"))

    def elements(self, site: Site, motion: Motion, path: tuple[Waypoint, ...]) -> None:
        """Give the elements to which a motion goes their new numbers, in the data list."""
        *before, last = path
        self._before(site, motion, before)
        points = (last,) if last.via is None else (last.via, last)
        for written, waypoint in zip(site.written, points, strict=True):
            datum = written.datum
            assert datum is not None
            edits = self.edits.setdefault(datum.file.number, [])
            known = {(edit.start, edit.end) for edit in edits}
            changes = edits_for(datum.aggregate, values_at(self.robot, written, waypoint))
            edits += [change for change in changes if (change.start, change.end) not in known]

    def _instruction(self, site: Site, motion: Motion, waypoint: Waypoint, *, passing: bool) -> str:
        keyword = KEYWORDS[waypoint.kind]
        spline = site.motion.keyword.startswith("S")
        if spline:
            # a line in its stead would change the spline
            keyword = "SPL" if site.motion.keyword == "SPL" else f"S{keyword}"
        points = [self.aggregate(site.written[-1], waypoint)]
        if waypoint.via is not None:
            points.insert(0, self.aggregate(site.written[-1], waypoint.via))
        behind = site.motion.angle[-1].end if site.motion.angle else site.written[-1].operand.end
        rest = site.file.source.text[behind : site.motion.end]
        if site.motion.along:
            rest = _ALONG.sub("", rest)
        along_path = waypoint.kind in ("linear", "circular")
        if not spline and along_path != (motion.kind in ("linear", "circular")):
            rest = ""  # C_PTP is not for paths, C_DIS not for PTP alone
        if passing and (motion.stops or not rest):
            rest += " C_SPL" if spline else " C_DIS" if along_path else " C_PTP"
        return f"{keyword} {', '.join(points)}{rest}"

    def _point(self, written: Written, waypoint: Waypoint) -> None:
        first, operand = written.aggregates[0], written.operand
        if has_axes(first) == (waypoint.T is None):
            changes = edits_for(first, values_at(self.robot, written, waypoint))
            if written.datum is None and len(operand.parts) == 1 and not written.computed:
                for change in changes:
                    self._edit(written.file, change)
                return
            datum = written.listed
            if datum is not None and not written.computed:
                self.uses.setdefault(datum, {}).setdefault(tuple(changes), []).append(written)
                return
            if not changes and len(operand.parts) < 2:
                return
        self._edit(written.file, TextEdit(start=operand.start, end=operand.end, text=self.aggregate(written, waypoint)))

    def aggregate(self, written: Written, waypoint: Waypoint) -> str:
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
        if not self.uses:
            return
        names = _fresh_names(self.files)
        modules: dict[str, list[File]] = defaultdict(list)
        for file in self.files:
            modules[file.module].append(file)
        for datum, uses in self.uses.items():
            rewritten = {(w.file.number, w.operand.start) for points in uses.values() for w in points}
            rewritten.add((datum.file.number, datum.start))
            mentions = {
                (file.number, at) for file in modules[datum.file.module] for at in file.mentions.get(datum.name, ())
            }
            stays = () in uses or bool(mentions - rewritten)
            for changes, points in uses.items():
                name = self._copied(datum, changes, names) if changes and stays else _name(datum)
                for change in changes if not stays else ():
                    self._edit(datum.file, change)
                stays = True
                for written in points:
                    start, end = written.operand.start, written.operand.end
                    own = written.file.source.text[start:end]
                    if len(written.operand.parts) > 1 or own.upper() != name.upper():
                        self._edit(written.file, TextEdit(start=start, end=end, text=name))

    def _copied(self, datum: Datum, changes: Iterable[TextEdit], names: FreshNames) -> str:
        """Put a copy of a variable with other numbers behind its line."""
        source, name = datum.file.source, names.like(_name(datum))
        start = source.text.rfind("\n", 0, datum.start) + 1
        end = source.text.find("\n", datum.start) + 1
        renamed = TextEdit(start=datum.start, end=datum.start + len(_name(datum)), text=name)
        at = end or len(source.text)
        line = source.piece(start, at, [renamed, *changes])
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


def in_data_list(sites: Sequence[Site], motions: Sequence[Motion], waypoints: Paths) -> frozenset[int]:
    """Numbers of motions whose points get their numbers in the data list.

    They go to elements of arrays of the program's own to which a text leads that stands for several motions.
    """
    arrays = [_arrays(site) for site in sites]
    shared = frozenset[str]().union(
        *(own for own, motion in zip(arrays, motions, strict=True) if motion.texts_motions > 1)
    )
    return frozenset(
        i
        for i, (own, motion) in enumerate(zip(arrays, motions, strict=True))
        if own & shared and all(point.kind == motion.kind for point in waypoints.get(i, ())[-1:])
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


def _conflicts(program: KrlProgram, robot: Robot, waypoints: Paths) -> Iterator[tuple[int, str]]:
    """Motions that cannot be rewritten as they should, by number, and why."""
    sites, motions = program.sites, program.motions
    elements = in_data_list(sites, motions, waypoints)
    wanted = {
        i: _wanted(robot, sites[i], motions[i], path)
        for i, path in waypoints.items()
        if motions[i].texts_motions > 1 or i in elements
    }
    texts: dict[tuple[int, int], list[int]] = defaultdict(list)
    for i, (site, motion) in enumerate(zip(sites, motions, strict=True)):
        if motion.texts_motions == 1:
            continue
        path = waypoints.get(i, ())
        several = f"its text stands for {motion.texts_motions} motions"
        if path and not motion.stays(path) and (len(path) != 1 or path[0].kind != motion.kind or site.leans):
            yield i, f"{several}, and cannot become other ones for one of them"
        if site.leans:
            yield from ((k, f"{motion.place} counts from where it ends, and {several}") for k in site.before)
        if i not in elements:
            texts[site.text].append(i)
    for group in texts.values():
        changing, first = [i for i in group if i in waypoints], motions[group[0]]
        wants = [wanted.get(i, (None,) * len(sites[i].written)) for i in group]
        if changing and not all(_agree(wants[0], want) for want in wants):
            ends = {np.asarray(end.q if end.T is None else end.T).tobytes() for end in (motions[i].end for i in group)}
            apart = " to different places" if len(ends) > 1 else ", which need different numbers"
            yield from ((i, f"its text stands for {first.texts_motions} motions{apart}") for i in changing)
    yield from _of_elements(program, sorted(elements), wanted)


def _of_elements(
    program: KrlProgram, numbers: Sequence[int], wanted: Mapping[int, Values]
) -> Iterator[tuple[int, str]]:
    """Motions to elements of arrays, each of which has one set of numbers for all that go there."""
    users: dict[tuple[int, int], list[tuple[int, dict[str, float] | None]]] = defaultdict(list)
    data: dict[tuple[int, int], Datum] = {}
    points = [(i, written) for i in numbers for written in program.sites[i].written]
    values = (value for i in numbers for value in wanted.get(i, (None,) * len(program.sites[i].written)))
    for (i, written), value in zip(points, values, strict=True):
        assert written.datum is not None
        key = (written.datum.file.number, written.datum.start)
        data[key] = written.datum
        users[key].append((i, value))
    own = {(written.file.number, written.operand.start) for _, written in points}
    for key, wants in users.items():
        changing = [i for i, value in wants if value is not None]
        if not changing:
            continue
        name, other = data[key].name, _other_reading(program.sites, data[key], own)
        if other is not None:
            yield from ((i, f"its target {name} is read for something else in {other}, too") for i in changing)
        elif not all(_agree((wants[0][1],), (value,)) for _, value in wants):
            places = ", ".join(dict.fromkeys(str(program.motions[i].place) for i, _ in wants))
            yield from (
                (i, f"has its target {name} in common with {places}, which need other numbers") for i in changing
            )


def _other_reading(sites: Sequence[Site], datum: Datum, own: set[tuple[int, int]]) -> Place | None:
    """Place at which code names an array beside the motions to its elements."""
    array = datum.name.partition("[")[0]
    for file in _files(sites):
        mentions = file.mentions.get(array, ()) if file.module == datum.file.module and not file.holds_data else ()
        for position in mentions:
            if (file.number, position) not in own and (file is not datum.file or position not in datum.beside):
                return file.source.place(position)
    return None


def _wanted(robot: Robot, site: Site, motion: Motion, path: tuple[Waypoint, ...]) -> Values:
    last = path[-1]
    points = (last,) if last.via is None or len(site.written) == 1 else (last.via, last)
    if motion.stays(path) or len(points) < len(site.written):
        return (None,) * len(site.written)
    return tuple(values_at(robot, w, p) for w, p in zip(site.written, points, strict=True))


def _agree(one: Values, other: Values) -> bool:
    for a, b in zip(one, other, strict=True):
        if a is None or b is None or a.keys() != b.keys():
            if a is not b:
                return False
        elif any(abs(a[name] - b[name]) > NUMBER_TOLERANCE for name in a):
            return False
    return True


def _named(motion: MotionLine) -> Iterator[str]:
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
    program.expect_input(r"\d+", "its number, such as 3")
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
        *(nearest if any(not motion.stops for motion in program.motions) else ()),
        *_motions(program),
        "END",
    ]
    return program.written(lines, ".src")


def _motions(program: Composition) -> Iterator[str]:
    before: dict[str, str] = {}
    for i, motion in enumerate(program.motions):
        if program.notes:
            yield f"; {program.note(i)}"
        for name, text in _settings(i, motion).items():
            if before.get(name) != text:
                before[name] = text
                yield f"{name} = {text}"
        status = _status(program, i) if motion.kind == "joint" else None
        points = [_point(motion.end, status)]
        if motion.via is not None:
            points.insert(0, _point(motion.via, None))
        along_path = motion.kind in ("linear", "circular")
        passing = "" if motion.stops else " C_DIS" if along_path else " C_PTP"
        yield f"{KEYWORDS[motion.kind]} {','.join(points)}{passing}"
        yield from program.waits(i, "WAIT SEC {0:g}", "WAIT FOR NOT $IN[{0}]", "WAIT FOR $IN[{0}]")


def _settings(number: int, motion: Motion) -> dict[str, str]:
    """System variables that must hold for a motion, and their values."""
    if motion.kind == "axes":
        return {}
    if motion.part_in_hand:
        raise InputError(
            f"motion {number} has its part in the robot's hand; in KRL that needs frames of TOOL_DATA and BASE_DATA by number"
        )
    out = {
        "$TOOL": _braces(pose_values(motion.tool.T)),
        "$BASE": _braces(pose_values(motion.part.T)),
    }
    if motion.speed is not None:
        out["$VEL.CP"] = f"{motion.speed:g}"
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
