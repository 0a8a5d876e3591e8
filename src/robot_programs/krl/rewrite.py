"""New numbers for the points of a KRL program, in the places where it states them; and new programs."""

import re
from collections import Counter, defaultdict
from collections.abc import Collection, Container, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import isnan
from typing import ClassVar

import numpy as np

from robot_programs.core.flow import Loop
from robot_programs.core.form import Ref, Routine, Span, Text
from robot_programs.core.program import (
    Composition,
    Motion,
    MotionKind,
    Paths,
    Target,
    TargetVisit,
    Waypoint,
    Wrapping,
    wrapping,
)
from robot_programs.core.robot import NO_ROBOT, Robot
from robot_programs.core.sharing import SharingProgram, Spelling, Use, points_of
from robot_programs.core.source import FreshNames, Place, Source, TextEdit, numeral
from robot_programs.core.values import Origin, Structure
from robot_programs.core.written_out import Repeated, TargetArray, Turns
from robot_programs.krl.data import Datum, KrlFile, KrlRoutine, calls_of
from robot_programs.krl.helper import calls_function, wrap
from robot_programs.krl.lower import Coded, MotionStep
from robot_programs.krl.points import KrlSite, StatusTurn, WrittenPoint
from robot_programs.krl.syntax import (
    BLOCKS,
    Assignment,
    Control,
    Counting,
    End,
    KrlLine,
)
from robot_programs.krl.values import (
    AXES,
    DECIMALS,
    EXTERNAL,
    POSE,
    STATUS,
    axis_values,
    edits_for,
    has_any,
    numbers_in,
    pose_values,
    texts_in,
    whole,
)
from taskcal_groundwork.errors import InputError

MAX_NAME_LENGTH = 24
"""Characters of a name in KRL."""

_ALONG = re.compile(r"\s*#(BASE|TOOL)\b", re.IGNORECASE)

KEYWORDS: dict[MotionKind, str] = {"joint": "PTP", "axes": "PTP", "linear": "LIN", "circular": "CIRC"}


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class PointNumbers:
    """What a point states, or all that a motion says which is written anew."""

    values: Mapping[str, float] = field(default_factory=dict[str, float])
    """Of components, millimetres and degrees."""
    words: str = ""


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class KrlProgram(SharingProgram):
    """KRL program read from ``.src`` and ``.dat`` files."""

    LANGUAGE: ClassVar = "KRL"
    REWORDS: ClassVar = True
    TABLE: ClassVar = "TASKCAL_TARGETS"

    sites: tuple[KrlSite, ...] = ()
    routines: tuple[Coded, ...] = ()
    beside: tuple[Routine, ...] = ()
    """What runs beside the lines of these, and lines outside of any."""
    files: tuple[KrlFile, ...] = ()
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

        return wrapping(
            self, wrap(self.files, (*self.routines, *self.beside), motions, function, without), added, cleared
        )

    def spelling(self, robot: Robot, waypoints: Paths) -> "KrlSpelling":
        """Numbers are changed where they stand; else the data list states others beside them, or the motion its own.

        A motion that counts from where the one before ends, or becomes one of another kind, is written anew.
        """
        uses = [*self._uses(robot, self._touched(waypoints))]
        return KrlSpelling(sources=self.sources, program=self, robot=robot, uses=uses)

    def _touched(self, waypoints: Paths) -> Paths:
        """What motions become: those, too, that count from where others end, as long as one of them changes."""
        leaning = [number for number, site in enumerate(self.sites) if site.leans]
        if not leaning:
            return waypoints
        changed = {number for number, path in waypoints.items() if not self.motions[number].stays(path)}
        touched = {number: path for number, path in waypoints.items() if not self.sites[number].leans}
        for number in leaning:
            if number in changed or not changed.isdisjoint(self.sites[number].before):
                touched[number] = waypoints.get(number) or (self.motions[number].own_waypoint(),)
        return touched

    @cached_property
    def _staying(self) -> Sequence[Sequence[Use[PointNumbers]]]:
        """Points of each motion, without other numbers."""
        return [[*_stated(number, site)] for number, site in enumerate(self.sites)]

    def _uses(self, robot: Robot, paths: Paths) -> Iterator[Use[PointNumbers]]:
        sites, moves = self.sites, self.motions
        anew = {sites[i].text for i, path in paths.items() if sites[i].leans or path[-1].kind != moves[i].kind}
        for number, (site, move, points) in enumerate(zip(sites, moves, self._staying, strict=True)):
            path = paths.get(number)
            if site.text in anew:
                (file, start), end = site.text, site.motion.end
                own = site.file.source.text[start:end]
                new = own if path is None else instruction(robot, site, move, path[-1], passing=not move.stops)
                yield Use(
                    motion=number, text=(file, start, end), slot=None, numbers=PointNumbers(words=own),
                    wanted=PointNumbers(words=new), counts_from=site.before,
                )  # fmt: skip
            elif path is None or (move.texts_motions > 1 and move.stays(path)):
                yield from points
            else:
                for use, waypoint in zip(points, points_of(len(points), path[-1]), strict=True):
                    yield use if waypoint is None else self._moved(use, robot, waypoint)

    @cached_property
    def _moves(self) -> dict[tuple[Use[PointNumbers], Robot, Waypoint], Use[PointNumbers]]:
        return {}

    def _moved(self, use: Use[PointNumbers], robot: Robot, waypoint: Waypoint) -> Use[PointNumbers]:
        """A point with what is to become of it: made once where it is asked for again and again, as others share its text."""
        if use.motion not in self._sharing:
            return _moved(use, robot, waypoint)
        key = use, robot, waypoint
        if key not in self._moves:
            self._moves[key] = _moved(use, robot, waypoint)
        return self._moves[key]

    @property
    def texts(self) -> Sequence[Source]:
        """The files, with values that none of them states."""
        return [file.source for file in self.files]

    def fresh_names(self) -> FreshNames:
        """Names that are free in all files."""
        return FreshNames((name for file in self.files for name in file.mentions), longest=MAX_NAME_LENGTH)

    def counter(self, loop: Loop) -> str:
        """Name of the counter of a loop; empty without one."""
        opening = loop.line.statement
        return opening.counter.text if isinstance(opening, Counting) and opening.counter else ""

    def differs(self, routine: Coded, loop: Loop) -> bool:
        """Whether the turns of a loop differ by its own counter."""
        opening, closing = loop.line.statement, loop.end.statement
        counter = self.counter(loop)
        inside = routine.section.file.source.text[opening.end : closing.start]
        return loop.kind == "while" or re.search(rf"\b{re.escape(counter)}\b", inside, re.IGNORECASE) is not None

    def turned(self, routine: Coded, loop: Loop, taken: Sequence[float]) -> Turns | None:
        """A loop turn by turn; see `SharingProgram.turned`."""
        source, lines = routine.section.file.source, routine.section.lines
        text, opening, closing = source.text, loop.line.statement, loop.end.statement
        inside = [line for line in lines if opening.start < line.start < closing.start]
        labels = _labels_of(inside)
        jumps = [line for line in lines if isinstance(line, Control) and line.keyword == "GOTO" and line.words]
        outside = {line.words[0].upper for line in jumps if not opening.start < line.start < closing.start}
        if labels is None or labels.keys() & outside:
            return None  # it is left by EXIT, or jumped into
        own = {one.name for one in self.routines}
        if not own.isdisjoint(calls_of(opening)):  # a function in its head may do more
            return None
        sets, after = ["" for _ in taken], ""
        if counter := self.counter(loop):
            step = text[opening.bounds[2][0].start : opening.end] if len(opening.bounds) > 2 else "1"
            indent = source.indent(opening.start)
            sets = [f"{indent}{counter}={count:.0f}{source.newline}" for count in taken]
            after = f"{indent}{counter}={counter}+({step}){source.newline}"
        return Turns(
            start=text.rfind("\n", 0, opening.start) + 1,
            end=_behind_line(text, closing.end),
            body=(_behind_line(text, opening.end), text.rfind("\n", 0, closing.start) + 1),
            before=tuple(sets),
            after=after,
            labels=labels,
        )

    def copied(self, routine: Coded) -> Repeated | None:
        """A routine in whole lines; see `SharingProgram.copied`."""
        head, file = routine.section.head, routine.section.file
        assert head is not None
        text = file.source.text
        end = next((line for line in file.statements if isinstance(line, End) and line.start > head.start), None)
        name = re.search(rf"\b{re.escape(routine.name)}\b", text[head.start : head.end], re.IGNORECASE)
        if end is None or name is None:
            return None
        first, at = text.rfind("\n", 0, head.start) + 1, _behind_line(text, end.end)
        return Repeated(
            source=file.source, at=at, before=file.source.newline, span=(first, at),
            name=(head.start + name.start(), head.start + name.end()),
        )  # fmt: skip

    def is_listable(self, number: int, routine: Coded) -> bool:
        """Whether an element of an array may hold the target of a motion, with all that counts of it there."""
        site, motion = self.sites[number], self.motions[number]
        last = site.written[-1].stated[-1]
        stated = motion.kind == "linear" or (whole(last, "S") is not None and whole(last, "T") is not None)
        return stated and len(site.written) == 1 and motion.end.T is not None and not site.leans

    def listed(self, routine: Coded, name: str, table: TargetArray) -> Iterator[tuple[Source, Span, str]]:
        """An array of the data list where one is given, else of the routine; see `SharingProgram.listed`."""
        sites, places = self.sites, (",".join(str(k + 1) for k in place) for place in np.ndindex(table.size))
        texts = [literal(NO_ROBOT, sites[i].written[-1], self.motions[i].own_waypoint()) for i in table.numbers]
        declared = f"DECL E6POS {name}[{','.join(map(str, table.size))}]"
        elements = [f"{name}[{place}]={_TYPE.sub('{', text)}" for place, text in zip(places, texts, strict=True)]
        module = routine.section.file.module
        lists = (
            file for file in reversed(self.files) if file.holds_data and not file.serves_all and file.module == module
        )
        for file, at, lines in _behind(routine.section, next(lists, None), declared, elements):
            yield file.source, (0, at, at), "".join(f"{line}{file.source.newline}" for line in lines)
        operand = sites[table.numbers[0]].written[-1].operand
        element = f"{name}[{table.index(self.DIVIDED)}]"
        yield routine.section.file.source, (0, operand.start, operand.end), element

    def visits(self) -> Iterator[TargetVisit]:
        """Motions of one routine that name one point, or a variable that was last set by it, and those that lean on each other.

        What a variable held before it was set anew as a whole is another target; see `Program.visits`.
        """
        numbers: dict[tuple[int, int], list[int]] = defaultdict(list)
        for i, site in enumerate(self.sites):
            numbers[site.text].append(i)
        named_by = {
            step.at[:2]: frozenset(_named(step))
            for one in self.routines
            for step in one.lines
            if isinstance(step, MotionStep)
        }
        for file in self.files:
            for routine in file.sections:
                own = {line.start: named_by.get((file.number, line.start)) for line in routine.lines}
                points = frozenset[str]().union(*filter(None, own.values()))
                sets: dict[str, frozenset[str]] = {}
                times: Counter[str] = Counter()
                for line in routine.lines:
                    if isinstance(line, Assignment) and not line.component:
                        read = {word.upper for word in line.words}
                        times[line.name] += line.name not in read
                        named = frozenset(points & read) - {line.name}
                        sets[line.name] = named.union(*(sets.get(name, ()) for name in named))
                    elif named := own[line.start]:
                        for name in named.union(*(sets.get(name, ()) for name in named)):
                            for i in numbers.get((file.number, line.start), (None,)):
                                target = (routine, name, times[name])
                                yield TargetVisit(number=i, target=target, place=file.source.place(line.start))
        for i, site in enumerate(self.sites):
            for number in (i, *site.before) if site.leans else ():
                yield TargetVisit(number=number, target=i, place=self.motions[number].place)


# Loops written turn by turn, and routines for each of their calls.


def _behind_line(text: str, position: int) -> int:
    return text.find("\n", position) + 1 or len(text)


def _labels_of(lines: Sequence[KrlLine]) -> dict[str, tuple[tuple[int, int], ...]] | None:
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


# Targets of loops in arrays.

_TYPE = re.compile(r"^\{\s*\w+\s*:\s*")
"""With which a position in braces may begin."""


def _behind(
    routine: KrlRoutine, data: KrlFile | None, declared: str, elements: list[str]
) -> Iterator[tuple[KrlFile, int, list[str]]]:
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


# Points and motions as they are written.

NUMBER_TOLERANCE = 2e-5
"""Millimetres and degrees that differ by less are written alike."""


def _stated(number: int, site: KrlSite) -> Iterator[Use[PointNumbers]]:
    """The points of a motion."""
    for written in site.written:
        numbers, operand = PointNumbers(values=numbers_in(written.first)), written.operand
        posed = len(site.written) == 1 and has_any(written.first, POSE)
        yield Use(
            motion=number, text=(site.file.number, operand.start, operand.end), slot=written.slot, numbers=numbers,
            wanted=numbers, point=(written, None), counts_from=site.before if site.leans else (),
            poses=(written.without_offset, written.with_offset) if posed else None,
        )  # fmt: skip


def _moved(use: Use[PointNumbers], robot: Robot, waypoint: Waypoint) -> Use[PointNumbers]:
    """A point with what is to become of it."""
    written: WrittenPoint = use.point[0]
    first, values, before = written.first, values_at(robot, written, waypoint), use.numbers.values
    own = {name: values.get(name, value) for name, value in before.items()}
    moved = replace(use, wanted=PointNumbers(values=own), point=(written, waypoint))
    if len(written.stated) == 1:
        return moved
    assert waypoint.T is not None
    base, slot = pose_values(written.without_offset(waypoint.T), first), use.slot
    wanted = {name: base.get(name, value if name in STATUS else own[name]) for name, value in before.items()}
    if written.stating is not first:
        status = {name: values[name] for name in STATUS if name in values}
        own |= status
        slot = slot if status.items() <= numbers_in(written.stating).items() else None
    return replace(moved, slot=slot, wanted=PointNumbers(values=wanted), shifted=PointNumbers(values=own))


def values_at(robot: Robot, written: WrittenPoint, waypoint: Waypoint) -> dict[str, float]:
    """Values of all components that state a waypoint in place of a point, millimetres and degrees."""
    first, T = written.first, waypoint.T
    values = axis_values(waypoint.q) if T is None else pose_values(T, first)
    beside = zip(EXTERNAL, waypoint.external, strict=False)
    values |= {name: value for name, value in beside if name in first.parts and not isnan(value)}
    has_posture = T is not None and (has_any(written.stating, STATUS) or not has_any(first, POSE))
    if has_posture and not np.isnan(waypoint.q).any():  # else it is written again where it was
        S, turn = (whole(written.stating, name) or 0 for name in STATUS)
        status = StatusTurn(S=S, T=turn).of(robot, waypoint.q)
        values |= {"S": float(status.S or 0), "T": float(status.T or 0)}
    return values


def literal(robot: Robot, written: WrittenPoint, waypoint: Waypoint) -> str:
    """A waypoint in braces: as the point is written, if it states the same kind of position completely, in numbers."""
    first, values = written.first, values_at(robot, written, waypoint)
    names = [name for name in values if name in POSE or name in AXES]
    stated = first.parts.keys() >= {*names} and all(isinstance(part, float) for part in first.parts.values())
    if stated and not written.computed and first.origin and (written.stating is first or "S" not in values):
        return written.template.piece(*first.origin.at[1:], edits_for(first, values))
    type_, names = ("E6AXIS", EXTERNAL) if waypoint.T is None else ("E6POS", (*STATUS, *EXTERNAL))
    kept = {name: text for one in (first, written.stating) for name, text in texts_in(one).items() if name in names}
    return braces({**kept, **values}, type_)


def braces(values: Mapping[str, float | str], type_: str = "") -> str:
    """A position of some values, or of texts of them; S and T are whole."""
    parts = (
        f"{name} {one if isinstance(one := values[name], str) else numeral(one, DECIMALS.get(name, 0))}"
        for name in (*POSE, *AXES, *STATUS, *EXTERNAL)
        if name in values
    )
    return f"{{{type_ and f'{type_}: '}{','.join(parts)}}}"


def instruction(robot: Robot, site: KrlSite, motion: Motion, waypoint: Waypoint, *, passing: bool) -> str:
    """A motion to a waypoint, which says whatever else another one says."""
    keyword, end = KEYWORDS[waypoint.kind], site.written[-1]
    spline = site.motion.keyword.startswith("S")
    if spline:
        # a line in its stead would change the spline
        keyword = "SPL" if site.motion.keyword == "SPL" else f"S{keyword}"
    points = [literal(robot, end, one) for one in (waypoint.via, waypoint) if one is not None]
    behind = site.motion.angle[-1].end if site.motion.angle else end.operand.end
    rest = site.file.source.text[behind : site.motion.end]
    if site.motion.along:
        rest = _ALONG.sub("", rest)
    along_path = waypoint.kind in ("linear", "circular")
    if not spline and along_path != (motion.kind in ("linear", "circular")):
        rest = ""  # C_PTP is not for paths, C_DIS not for PTP alone
    if passing and (motion.stops or not rest):
        rest += " C_SPL" if spline else " C_DIS" if along_path else " C_PTP"
    return f"{keyword} {', '.join(points)}{rest}"


@dataclass(eq=False, kw_only=True)
class KrlSpelling(Spelling[PointNumbers]):
    """What is written into the files."""

    program: KrlProgram
    robot: Robot

    @cached_property
    def fresh(self) -> FreshNames:
        """For variables of the data lists."""
        return self.program.fresh_names()

    @cached_property
    def _modules(self) -> Mapping[str, Sequence[KrlFile]]:
        """Files with code, by their modules."""
        out = defaultdict[str, list[KrlFile]](list)
        for file in self.program.files:
            out[file.module] += [] if file.holds_data else [file]
        return out

    @cached_property
    def _known(self) -> Set[tuple[int, int]]:
        """Where motions name variables whose numbers can be written."""
        return {use.text[:2] for use in self.uses if use.slot is not None}

    def alike(self, one: PointNumbers, other: PointNumbers) -> bool:
        """Whether numbers differ by less than is written, or motions are written with the same words."""
        a, b = one.values, other.values
        return one is other or (
            one.words == other.words
            and a.keys() == b.keys()
            and all(abs(a[name] - b[name]) <= NUMBER_TOLERANCE for name in a)
        )

    def reader(self, slot: Origin, texts: Collection[Span]) -> str:
        """Where else a routine names a variable."""
        datum = slot.owner
        if not isinstance(datum, Datum):
            return ""
        for file in self._modules[datum.file.module]:
            own = datum.beside if file is datum.file else ()
            for at in file.mentions.get(datum.variable, ()):
                if (file.number, at) not in self._known and at not in own:
                    return self.place((file.number, at, at))
        return ""

    def in_place(self, use: Use[PointNumbers]) -> None:
        """Change each component that differs."""
        assert use.slot is not None
        written: WrittenPoint = use.point[0]
        self.edits[use.slot.at[0]] += edits_for(written.first, use.wanted.values)

    def own(self, use: Use[PointNumbers]) -> str:
        """The point in braces, or the motion's own words."""
        return use.own.words or literal(self.robot, *use.point)

    def clone(self, use: Use[PointNumbers]) -> str | None:
        """Put a copy of a variable behind its line, where that is for it alone."""
        written: WrittenPoint = use.point[0]
        datum, values = written.datum, use.own.values
        declared = None if datum is None else datum.declaration
        if (
            datum is None
            or declared is None
            or not isinstance(datum.value, Structure)
            or len(declared.variables) > 1
            or not values.keys() <= use.numbers.values.keys()
        ):
            return None
        source, behind = datum.file.source, datum.start + len(datum.name)
        name = self.fresh.like(source.text[datum.start : behind])
        start, end = source.text.rfind("\n", 0, datum.start) + 1, source.text.find("\n", datum.start) + 1
        at = end or len(source.text)
        renamed = TextEdit(start=datum.start, end=behind, text=name)
        line = source.piece(start, at, [renamed, *edits_for(datum.value, values)])
        text = line if end else source.newline + line
        self.edits[datum.file.number].append(TextEdit(start=at, end=at, text=text))
        return name

    def insert(self, number: int, path: Sequence[Waypoint]) -> None:
        """Write the motion's own text with other points in lines before, passing by them."""
        site, motion = self.program.sites[number], self.program.motions[number]
        source, start = site.file.source, site.motion.start
        line = source.text.rfind("\n", 0, start) + 1
        for waypoint in path[:-1]:
            text = instruction(self.robot, site, motion, waypoint, passing=True)
            text = f"{source.indent(start)}{text}{source.newline}"
            self.edits[site.file.number].append(TextEdit(start=line, end=line, text=text))


def _named(motion: MotionStep) -> Iterator[str]:
    text = motion.routine.file.source.text
    for point in motion.points:
        if isinstance(point, Ref):
            yield "".join(text[point.at[1] : point.at[2]].upper().split())


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
        "$TOOL": braces(pose_values(motion.tool.T)),
        "$BASE": braces(pose_values(motion.part.T)),
    }
    if motion.speed is not None:
        out["$VEL.CP"] = f"{motion.speed:g}"
    return out


def _status(program: Composition, number: int) -> StatusTurn:
    q, stated = program.posture(number), program.motions[number].end.posture
    if q is not None:
        return StatusTurn(S=0, T=0).of(program.robot, q)
    if isinstance(stated, StatusTurn):
        return stated
    raise InputError(
        f"motion {number} drives all joints to a pose and does not say in which posture; give its joint positions"
    )


def _point(target: Target, status: StatusTurn | None) -> str:
    if target.q is not None:
        return braces(axis_values(target.q))
    if target.T is None:
        raise InputError("a target is given neither a pose nor joint positions")
    stated = {} if status is None else {"S": status.S, "T": status.T}
    return braces({**pose_values(target.T), **{name: value for name, value in stated.items() if value is not None}})
