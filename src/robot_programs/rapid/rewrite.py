"""Rewriting motions: numbers where they stand, clones of shared targets, further motions on the way; and new modules."""

from bisect import bisect_left, bisect_right
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice, pairwise, zip_longest
from typing import ClassVar, NamedTuple, cast

import numpy as np
from jaxtyping import Float

from robot_programs.core.flow import Loop, lines_in
from robot_programs.core.form import Ask, Assign, Check, Do, Line, MoveLine, Routine, Span, inside
from robot_programs.core.program import (
    Composition,
    Frame,
    Motion,
    MotionKind,
    Paths,
    Target,
    TargetVisit,
    Waypoint,
    Wrapping,
    wrapping,
)
from robot_programs.core.robot import Robot
from robot_programs.core.sharing import Pose, SharingProgram, Spelling, Use
from robot_programs.core.source import FreshNames, Place, Source, TextEdit
from robot_programs.core.values import Origin
from robot_programs.core.written_out import Repeated, TargetArray, Turns
from robot_programs.rapid.helper import calls_function, wrap
from robot_programs.rapid.lower import FRAMES, Labelled, LoweredRapid, Unread
from robot_programs.rapid.meaning import Reference
from robot_programs.rapid.names import DATA, ModuleFile, Procedure, Symbol, Value
from robot_programs.rapid.resolve import (
    JOINTS,
    NAMES,
    Confdata,
    MoveInstruction,
    RapidSite,
    TargetArgument,
    TargetType,
    target_type,
)
from robot_programs.rapid.syntax import RESERVED, DataDeclaration, key_of, tokenize, words
from robot_programs.rapid.values import (
    DEG_DECIMALS,
    MM_DECIMALS,
    TARGETS,
    pose_numbers,
    pose_rows,
    quaternion_texts,
    quaternions_texts,
    real,
    reals,
)
from taskcal_groundwork.errors import InputError

# The numbers of a rewritten target, and their text.

Numbers = tuple[float, ...]
"""Of a target before its external axes; see `TargetArgument.meant`."""

TOLERANCES: Mapping[TargetType, Numbers] = {
    "robtarget": (*(1e-4,) * 3, *(1e-7,) * 4, *(0.0,) * 4), "jointtarget": (1e-6,) * JOINTS,
}  # fmt: skip
"""Numbers that change by no more keep their text."""

Ends = Mapping[TargetArgument, Waypoint]
"""What targets are to become."""


def new_numbers(ends: Ends, robot: Robot) -> dict[TargetArgument, Numbers]:
    """Numbers of waypoints in place of targets; those that keep their text are a target's own."""
    found = dict[TargetArgument, Numbers]()
    for type_ in TOLERANCES:
        own = [target for target in ends if target.type == type_]
        if own:
            meant, q = np.array([target.meant for target in own]), np.stack([ends[target].q for target in own])
            if type_ == "jointtarget":
                rows = _kept(np.degrees(q), meant, type_)
            else:
                rows = _pose_rows(np.stack([_pose(ends[target]) for target in own]), meant)
                rows = np.hstack([rows, Confdata.confdata(robot, q, meant[:, 7:].astype(np.int64))])
            found |= zip(own, map(tuple, rows.tolist()), strict=True)
    return found


def _pose_rows(T: Float[np.ndarray, "n 4 4"], meant: Float[np.ndarray, "n k"]) -> Float[np.ndarray, "n 7"]:
    """Positions and quaternions of poses in place of those of targets, whose signs these have."""
    rows = pose_rows(T)
    rows[(rows[:, 3:] * meant[:, 3:7]).sum(axis=1) < 0.0, 3:] *= -1.0
    return _kept(rows, meant[:, :7], "robtarget")


def _kept(
    rows: Float[np.ndarray, "n k"], meant: Float[np.ndarray, "n k"], type_: TargetType
) -> Float[np.ndarray, "n k"]:
    """Numbers with those of targets where they keep their text: a quaternion as a whole."""
    stays = np.abs(rows - meant) <= np.array(TOLERANCES[type_][: rows.shape[1]])
    if type_ == "robtarget":
        stays[:, 3:] = stays[:, 3:].all(axis=1, keepdims=True)
    return np.where(stays, meant, rows)


Texts = tuple[str, ...]
"""A text for each number of a target before its external axes."""


def written(type_: TargetType, numbers: Sequence[Numbers]) -> list[Texts]:
    """Texts of the numbers of targets of a type."""
    rows, size = np.array(numbers).reshape(-1, len(TOLERANCES[type_])), JOINTS if type_ == "jointtarget" else 3
    own = iter(reals(rows[:, :size].ravel().tolist(), DEG_DECIMALS if type_ == "jointtarget" else MM_DECIMALS))
    first = list(zip(*[own] * size, strict=True))
    if type_ == "jointtarget":
        return first
    turns, confdata = quaternions_texts(rows[:, 3:7]), rows[:, 7:].astype(np.int64).tolist()
    return [(*xyz, *turn, *map(str, cf)) for xyz, turn, cf in zip(first, turns, confdata, strict=True)]


def _pose(waypoint: Waypoint) -> Float[np.ndarray, "4 4"]:
    assert waypoint.T is not None
    return waypoint.T


def external_texts(target: TargetArgument, positions: tuple[float, ...] = ()) -> list[str]:
    """The positions of external axes as they are written, or as they would be; or others, where these are numbers."""
    if target.literal is None:
        written = [real(v, MM_DECIMALS) for v in target.external]
    else:
        text = target.file.source.text
        written = [text[start:end] for start, end, _ in list(target.literal.leaves())[-6:]]
    return [
        own if new is None or np.isnan(new) or new == old else real(new, MM_DECIMALS)
        for own, old, new in zip_longest(written, target.external, positions)
    ]


_GROUPS: Mapping[TargetType, tuple[int, ...]] = {"robtarget": (3, 4, 4), "jointtarget": (6,)}
"""Numbers of the records in a target, before its external axes."""


def _aggregate(type_: TargetType, numbers: Numbers, external: Iterable[str]) -> str:
    (own,) = written(type_, [numbers])
    coming = iter(own)
    groups = [*(tuple(islice(coming, count)) for count in _GROUPS[type_]), tuple(external)]
    return "[" + ",".join("[" + ",".join(group) + "]" for group in groups) + "]"


Datum = tuple[Symbol, tuple[int, ...] | None]
"""Data, or a component or element of them; None where it is not known which."""


MAX_NAME_LENGTH = 32
"""Characters of a name in RAPID."""

S4_NAME_LENGTH = 16
"""Characters of a name on S4 controllers; longer ones are made only for programs that have such."""

FLY_BY = "z0"
"""The finest zone without a stop."""


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class RapidProgram(SharingProgram):
    """A program of one or several RAPID modules."""

    LANGUAGE: ClassVar = "RAPID"
    REWORDS: ClassVar = True
    SHARES_ROUTINES: ClassVar = True
    TABLE: ClassVar = "TaskcalTargets"
    DIVIDED: ClassVar = " DIV "

    sites: tuple[RapidSite, ...] = ()
    routines: tuple[Procedure, ...] = ()
    uses: Mapping[Symbol, tuple[Reference, ...]]
    """All references to declared data."""
    files: tuple[ModuleFile, ...]
    """The modules' files, by their numbers."""
    frames: Mapping[Symbol, Value]
    """What tools and work objects are declared as."""
    form: LoweredRapid
    """The program in the one form."""
    unresolved: frozenset[MoveInstruction] = frozenset()
    """Motions that were not resolved, on no way that leads to them."""
    shift: str = ""
    """As in `Settings`."""

    @property
    def texts(self) -> Sequence[Source]:
        """The modules, by the numbers by which places name them."""
        return [file.source for file in self.files]

    def spelling(self, robot: Robot, waypoints: Paths) -> "RapidSpelling":
        """Numbers are changed where they stand; others are declared beside these, or stand in the argument.

        Raises:
            InputError: the robot has not six joints.
        """
        if len(robot.joint_names) != JOINTS:
            count = len(robot.joint_names)
            raise InputError(f"{robot.name} has {count} joints; a RAPID program of it is not written, only of six")
        return RapidSpelling(sources=self.texts, program=self, robot=robot, uses=[*self._uses(robot, waypoints)])

    def _uses(self, robot: Robot, waypoints: Paths) -> "Iterator[Use[Numbers]]":
        """The targets of all motions."""
        ends = dict[TargetArgument, Waypoint]()
        for number, (*_, last) in waypoints.items():
            site = self.sites[number]
            ends |= {site.end: last} if target_type(last.kind) == site.end.type else {}
            ends |= {site.via: last.via} if site.via is not None and last.via is not None else {}
        wanted = new_numbers(ends, robot)
        for number, (site, move) in enumerate(zip(self.sites, self.motions, strict=True)):
            for target, point, said in (
                (site.via, site.line.points[0], move.via),
                (site.end, site.line.points[-1], move.end),
            ):
                if target is not None and said is not None:
                    end, own = ends.get(target), wanted.get(target, target.meant)
                    T = None if said.T is None else (said.T, said.T if end is None or end.T is None else end.T)
                    yield _use(number, move, site, target, point.at, own, T)

    def speed_edit(self, number: int, speed: float) -> tuple[int, TextEdit]:
        r"""The value of ``\V``, which takes the place of the speed's own; see `Program.speed_edit`.

        Raises:
            InputError: the instruction has no ``\V``.
        """
        site = self.sites[number]
        where, text = site.layout, real(speed * 1e3, MM_DECIMALS)
        file = next(i for i, source in enumerate(self.sources) if source.path == site.file.source.path)
        if (given := where.options.get("v")) is not None and given.value is not None:
            _, start, end = given.value.at
            return file, TextEdit(start=start, end=end, text=text)
        if (name := site.line.name).lower() not in ("movej", "movel", "movec"):
            raise InputError(f"{self.motions[number].place}: {name} takes no speed of its own; change its speed data")
        return file, TextEdit(start=where.speed.end, end=where.speed.end, text=f"\\V:={text}")

    def fresh_names(self) -> FreshNames:
        """Names that are free in all files."""
        found = (key_of(token) for source in self.sources for token in tokenize(source.text) if token.kind == "name")
        return FreshNames(found, longest=MAX_NAME_LENGTH, usual=S4_NAME_LENGTH, reserved=RESERVED | set(DATA))

    def counter(self, loop: Loop) -> str:
        """Name of the counter of a loop; empty where it has none."""
        return _counter(loop.line)

    def differs(self, routine: Procedure, loop: Loop) -> bool:
        """Whether the turns of a loop differ by its own counter."""
        return loop.kind == "while" or len(_counter_names(routine, loop)) > 1

    def turned(self, routine: Procedure, loop: Loop, taken: Sequence[float]) -> Turns | None:
        """A loop turn by turn; see `SharingProgram.turned`."""
        source, text, line = routine.file.source, routine.file.source.text, loop.line
        _, start, end = line.at
        own = list(words(text, max(one.at[2] for one in line.conditions if one.at != line.at), end))
        closing, counter, inner = own[-1], _counter(line), list(lines_in(loop.body))
        odd = any(isinstance(one, Labelled | Unread) for one in inner)
        hidden = counter and counter.lower() in {_counter(one).lower() for one in inner if isinstance(one, Check)}
        declares = any(
            isinstance(one, Symbol) and one.declaration is not None and start < one.declaration.start < end
            for one in routine.variables
        )
        asks = any(isinstance(part, Ask) for one in line.conditions for part in inside(one))  # which may do more
        if odd or hidden or declares or asks or closing.upper not in ("ENDFOR", "ENDWHILE"):
            return None
        begins, ends = own[0].end, closing.start
        ends = begins + len(text[begins:ends].rstrip())
        rest, newline = text[begins : text.find("\n", begins)].strip(), source.newline + source.indent(start)
        apart = "" if not rest or rest.startswith("!") else newline
        counts = [real(count, COUNT_DECIMALS) for count in taken]
        heads = [
            f"! {counter} = {own}" if counter else f"! turn {k + 1} of {len(counts)}" for k, own in enumerate(counts)
        ]
        behind = text[end : text.find("\n", end)].strip()
        return Turns(
            start=start,
            end=end,
            body=(begins, ends),
            before=tuple(f"{newline if k else ''}{head}{apart}" for k, head in enumerate(heads)),
            after=newline if behind and not behind.startswith("!") else "",
            named=tuple(
                {
                    at: f"({count})" if count.startswith("-") else count
                    for at in _counter_names(routine, loop)
                    if at[0] > begins
                }
                for count in counts
            ),
        )

    def copied(self, routine: Procedure) -> Repeated | None:
        """A procedure or function, if it is the only routine of its name; see `SharingProgram.copied`."""
        source, own = routine.file.source, routine.scope.routines[routine.name.lower()]
        if routine.kind not in ("proc", "func") or len(own) > 1:
            return None
        return Repeated(
            source=source, at=routine.end, before=source.newline * 2 + source.indent(routine.start),
            span=(routine.start, routine.end), name=routine.named,
        )  # fmt: skip

    def is_listable(self, number: int, routine: Procedure) -> bool:
        """Whether it goes to a robtarget that its own text states or names."""
        end, via = self.sites[number].end, self.sites[number].via
        return (
            end.argument[0] == routine.file.number
            and via is None
            and end.type == "robtarget"
            and not (end.passed or end.root.passed)
        )

    def listed(self, routine: Procedure, name: str, table: TargetArray) -> Iterator[tuple[Source, Span, str]]:
        """A constant array of a routine; see `SharingProgram.listed`."""
        source, ends = routine.file.source, [self.sites[i].end for i in table.numbers]
        newline, size = source.newline + source.indent(routine.start) + "  ", ",".join(map(str, table.size))
        texts = [_aggregate(end.type, end.meant, external_texts(end)) for end in ends]
        at = _behind_header(routine, source.text)
        yield source, (0, at, at), f"{newline}CONST robtarget {name}{{{size}}}:={_listed(texts, table.size, newline)};"
        yield source, ends[0].argument, f"{name}{{{table.index(self.DIVIDED)}}}"

    def wrap(
        self,
        function: str,
        added: Source | None,
        *,
        without: Collection[str] = (),
        rejected: Container[int] = (),
        keep_joints: bool = False,
    ) -> Wrapping:
        """Put a function of robtarget, tooldata and wobjdata around targets; see `Program.wrap`."""
        if added is not None and any(routine.name.lower() == function.lower() for routine in self.form.procedures):
            raise InputError(f"{self.sources[0].path}: has a function {function} already")
        staying = {site.line for i, site in enumerate(self.sites) if i not in rejected}
        motions = self.unresolved | {site.line for site in self.sites}.difference(staying)

        def cleared(again: RapidProgram) -> tuple[RapidProgram, set[Place]]:
            having = {
                routine.file.source.place(line.at[1])
                for routine in again.form.procedures
                for line in routine.lines
                if isinstance(line, MoveLine | Do) and calls_function(line, function)
            }
            left = (one for one in again.unresolved if not calls_function(one, function))
            return replace(again, unresolved=frozenset(left)), having

        return wrapping(self, wrap(self.form, motions, function, without, self.shift, self.frames), added, cleared)

    def visits(self) -> Iterator[TargetVisit]:
        """Motions of one routine to one target in one tool and work object; see `Program.visits`.

        A motion goes to the target that it names or shifts, and to those from which a variable was set last that it names.
        """
        numbers: dict[Line, list[int]] = defaultdict(list)
        for i, site in enumerate(self.sites):
            numbers[site.line].append(i)
        read: dict[int, list[tuple[int, Datum]]] = defaultdict(list)
        for symbol, use in ((symbol, use) for symbol, own in self.uses.items() for use in own):
            if use.type in TARGETS and use.through is None:
                read[id(use.file)].append((use.start, (symbol, use.path)))
        for own in read.values():
            own.sort(key=lambda one: one[0])
        for routine in self.form.procedures:
            yield from _visits(routine, self._stops(routine, numbers, read[id(routine.file)]))

    def _stops(
        self, routine: Procedure, numbers: Mapping[Line, Sequence[int]], read: Sequence[tuple[int, Datum]]
    ) -> "Iterator[_TargetStop]":
        """Motions of a routine in the order of the text, given the targets that its file reads, in order, too."""
        starts, source = [start for start, _ in read], routine.file.source
        naming = {use.through for own in self.uses.values() for use in own}
        made_of: dict[Symbol, frozenset[Datum]] = {}
        times: Counter[Symbol] = Counter()

        def named(places: Iterable[Span]) -> frozenset[Datum]:
            spans = (slice(bisect_left(starts, start), bisect_left(starts, end)) for _, start, end in places)
            return frozenset(datum for span in spans for _, datum in read[span])

        for line in routine.lines:
            if isinstance(line, Assign) and not line.target.path:
                own = named([line.value.at])
                for symbol, _ in named([line.target.at]):
                    times[symbol] += symbol not in {one for one, _ in own}
                    made_of[symbol] = own.union(*(made_of.get(one, ()) for one, _ in own))
            if not isinstance(line, MoveInstruction):
                continue
            for i in (*((None,) if line in self.unresolved else ()), *numbers.get(line, ())):
                site = None if i is None else self.sites[i]
                data = named([line.at] if site is None else (point.at for point in line.points))
                if site is not None and not data:
                    continue  # numbers alone are shared with no other motion
                data = data.union(*(made_of.get(symbol, ()) for symbol, _ in data))
                given, frames = None, [one for name, one in line.settings.items() if name in FRAMES or not line.points]
                if site is not None:
                    passed = site.end.root.passed
                    given = None if passed is None else passed.argument
                    targets = (site.end, site.via)
                    origins = [one.root.origin for one in targets if one is not None and one.root.origin is not None]
                    for origin in origins[:1]:  # the index of an element is known, which the text may not state
                        data = {(s, origin.place if path is None and s is origin.symbol else path) for s, path in data}
                    if any(s in naming for s, _ in data):
                        data = {one for one in data if one[0] not in naming}.union((o.symbol, o.place) for o in origins)
                yield _TargetStop(
                    number=i, given=given, place=source.place(line.at[1]),
                    data=frozenset((symbol, path, times[symbol]) for symbol, path in data),
                    frames=frozenset(source.text[one.at[1] : one.at[2]].lower() for one in frames),
                )  # fmt: skip


class _TargetStop(NamedTuple):
    """A motion of a routine, with data of which its targets are made."""

    number: int | None
    """None of one that was not resolved."""
    data: frozenset[tuple[Symbol, tuple[int, ...] | None, int]]
    """Each with how often it was set as a whole before: what it held then is no target of this one."""
    frames: frozenset[str]
    """Its tool and work object as they are written; of one that is not read all that it is given."""
    given: tuple[int, int, int] | None
    """What a parameter that it goes to was given; None where it goes to none, or that is not known."""
    place: Place


def _visits(routine: Routine, stops: Iterable[_TargetStop]) -> Iterator[TargetVisit]:
    by_datum: dict[object, list[_TargetStop]] = defaultdict(list)
    for stop in stops:
        for datum in stop.data:
            by_datum[datum].append(stop)
    for datum, group in by_datum.items():
        kinds = dict.fromkeys((stop.frames, stop.given) for stop in group if stop.number is not None)
        for stop in group:
            # what is given by a call is of no other kind: compared with all, they would take time by their square
            for frames, given in kinds if stop.given is None else ((stop.frames, stop.given),):
                if stop.frames == frames if stop.number is not None else stop.frames >= frames:
                    yield TargetVisit(number=stop.number, target=(routine, datum, frames, given), place=stop.place)


# Loops written turn by turn, and routines for each of their calls.


def _counter(line: Check) -> str:
    """Name of the counter of a loop; empty where it has none."""
    return "" if line.counter is None else line.counter.name.strip("'")


def _counter_names(routine: Procedure, loop: Loop) -> list[tuple[int, int]]:
    """Places at which a loop names its counter."""
    counter, (_, start, end) = _counter(loop.line).lower(), loop.line.at
    return [
        (token.start, token.end)
        for before, token in pairwise(words(routine.file.source.text, start, end) if counter else ())
        if token.kind == "name" and token.text.lower() == counter and before.text not in (".", "\\")
    ]


COUNT_DECIMALS = 9
"""Of a counter."""


def _listed(elements: Sequence[str], sizes: Sequence[int], newline: str) -> str:
    """An array, each element in a line of its own."""
    if len(sizes) == 1:
        return "[" + ",".join(f"{newline}  {one}" for one in elements) + "]"
    inner = len(elements) // sizes[0]
    rows = (_listed(elements[k : k + inner], sizes[1:], newline) for k in range(0, len(elements), inner))
    return "[" + ",".join(rows) + "]"


def _behind_header(routine: Procedure, text: str) -> int:
    """Place in front of what a routine declares: the end of its header's line, or of its header where more stands there."""
    _, at = routine.named
    if text[at : routine.end].lstrip().startswith("("):
        at = text.index(")", at) + 1
    line_end = text.find("\n", at)
    rest = text[at:line_end].strip()
    return at if rest and not rest.startswith("!") else at + len(text[at:line_end].rstrip("\r"))


def _name(move: Motion, line: MoveInstruction, kind: MotionKind) -> str:
    """The instruction of another kind of motion that is given the same.

    Raises:
        InputError: there is none.
    """
    if NAMES[kind].lower() in line.scope.routines:
        raise InputError(f"{move.place}: cannot become a {NAMES[kind]}, which is a routine of the program's own")
    if line.key in ("movej", "movel", "movec", "moveabsj"):
        return NAMES[kind]
    raise InputError(f"{move.place}: {line.name} is not written as another kind of motion")


def _via(waypoint: Waypoint) -> Waypoint:
    assert waypoint.via is not None
    return waypoint.via


def _same(T: Pose) -> Pose:
    return T


def _use(
    number: int,
    move: Motion,
    site: RapidSite,
    target: TargetArgument,
    operand: Span,
    wanted: Numbers,
    T: tuple[Pose, Pose] | None,
) -> Use[Numbers]:
    """A target of a motion, with the text that leads to it."""
    alone, base = move.texts_motions == 1, target.base
    follows = base is not None and not base.shifted and not alone
    place = base if base is not None and follows else target
    passed, posed = place.passed is not None, follows or (T is not None and not target.shifted)
    own = Use(
        motion=number, text=place.argument, slot=None if target.shifted and not follows else _slot(place), numbers=target.meant,
        wanted=wanted, point=target, T=T, follows=follows, given=passed,
        poses=(target.uncarried, target.carried) if follows else (_same, _same) if posed else None,
    )  # fmt: skip
    if not passed or not alone:
        return own
    stated = replace(target, argument=operand, file=site.file, origin=None, literal=None, passed=None)
    return replace(own, instead=replace(own, text=operand, slot=None, point=stated, given=False))


def _slot(target: TargetArgument) -> Origin | None:
    """Place of the numbers of a target, empty where they are computed; None where no data are declared so."""
    origin, literal = target.origin, target.literal
    if literal is not None:
        at = (target.file.number, literal.start, literal.end)
        return Origin(at=at, owner=origin and origin.symbol, path=() if origin is None else origin.path)
    if origin is None or origin.symbol.declaration is None:
        return None
    start = origin.symbol.declaration.start
    return Origin(at=(target.file.number, start, start), owner=origin.symbol, path=origin.path)


@dataclass(eq=False, kw_only=True)
class RapidSpelling(Spelling[Numbers]):
    """What is written into modules; what is known of a point is its `TargetArgument`."""

    program: RapidProgram
    robot: Robot
    changed: list[tuple[TargetArgument, Numbers]] = field(default_factory=list[tuple[TargetArgument, Numbers]])
    """Targets that get other numbers in their place."""
    clones: dict[tuple[Symbol, str], str] = field(default_factory=dict[tuple[Symbol, str], str])
    """Names of new data, by those beside which they are declared and their value."""

    @cached_property
    def _fresh(self) -> FreshNames:
        return self.program.fresh_names()

    def alike(self, one: Numbers, other: Numbers) -> bool:
        """Whether numbers differ by less than is written."""
        tolerances = TOLERANCES["jointtarget" if len(one) == JOINTS else "robtarget"]
        return one is other or all(abs(a - b) <= most for a, b, most in zip(one, other, tolerances, strict=True))

    @cached_property
    def _replaced(self) -> Callable[[Reference], bool]:
        """Whether references stand in texts that numbers take the place of, which read them no longer."""
        motions = self.program.motions
        alone = (use for use in self.uses if use.slot is None and motions[use.motion].texts_motions == 1)
        return _within(use.text for use in alone if use.wanted != use.numbers)

    @cached_property
    def _read(self) -> Mapping[Span, Place]:
        """Of arguments of calls, where something else reads what they give than the motions that go there."""
        known, parameters = defaultdict[Span, set[tuple[int, int]]](set), defaultdict[Span, dict[Symbol, None]](dict)
        for use in self.uses:
            passed = (use.point.base if use.follows else use.point).passed
            if passed is not None:
                known[use.text] |= {*passed.reads, (self.program.sites[use.motion].file.number, use.point.read_at)}
                parameters[use.text] |= dict.fromkeys(passed.parameters)
        found = dict[Span, Place]()
        for text, symbols in parameters.items():
            for one in (one for symbol in symbols for one in self.program.uses.get(symbol, ())):
                if (one.file.number, one.start) not in known[text] and not self._replaced(one):
                    found.setdefault(text, one.file.source.place(one.start))
        return found

    def reader(self, slot: Origin, texts: Collection[Span]) -> str:
        """Another reference to declared numbers, or to a parameter that holds them; what computes them."""
        found = next((self._read[text] for text in texts if text in self._read), None)
        if found is not None or slot.at[1] == slot.at[2]:
            return str(found or "what computes them")
        stands, path = _within(texts), cast("tuple[int, ...]", slot.path)
        for one in self.program.uses.get(cast("Symbol", slot.owner), ()):
            if one.overlaps(path) and not stands(one) and not self._replaced(one):
                return str(one.file.source.place(one.start))
        return ""

    def obstacle(self, use: Use[Numbers]) -> str:
        """That the call cannot give it another target."""
        if not use.given:
            return ""
        if use.text in self._read:
            return f"what the call gives it is read for something else in {self._read[use.text]}, too"
        return "" if use.point.whole else "is given its target by a call as a part of other data"

    def in_place(self, use: Use[Numbers]) -> None:
        """Change the numbers that differ."""
        target, wanted = use.point, use.wanted
        if use.follows:  # the configuration stays that of the one that it shifts
            assert use.poses is not None
            assert use.T is not None
            target = target.base
            pose = _pose_rows(use.poses[0](use.T[1])[None], np.array([target.meant]))
            wanted = (*pose[0].tolist(), *target.meant[7:])
        self.changed.append((target, wanted))

    def own(self, use: Use[Numbers]) -> str:
        """The name of data that are declared for it beside its own, or an aggregate."""
        target: TargetArgument = use.point
        if target.literal is None or target.shifted:
            value = _aggregate(target.type, use.wanted, external_texts(target))
        else:
            value = _changed_text(target, use.wanted, *written(target.type, [use.wanted]))
        if target.origin is None:
            return value
        key = target.origin.symbol, value
        if key not in self.clones:
            self.clones[key] = self._clone(*key, target.type)
        return self.clones[key]

    def _clone(self, symbol: Symbol, value: str, type_: TargetType) -> str:
        """Declare a clone of a target behind it, and say its name."""
        assert symbol.declaration is not None
        assert symbol.file is not None
        declaration, source, name = symbol.declaration, symbol.file.source, self._fresh.like(symbol.name)
        text, assigns = source.text, ":="
        storage = text[declaration.start : declaration.type.start]
        type_text = declaration.type.text if key_of(declaration.type) == type_ else type_
        if declaration.value_at and not declaration.dimensions:
            assigns = text[declaration.name.end : declaration.value_at]
        at, before = _behind(declaration, source)
        self._edit(symbol.file.number, at, at, f"{before}{storage}{type_text} {name}{assigns}{value};")
        return name

    def _edit(self, file: int, start: int, end: int, text: str) -> None:
        self.edits[file].append(TextEdit(start=start, end=end, text=text))

    def insert(self, number: int, path: Sequence[Waypoint]) -> None:
        r"""Write motions in front of an instruction, with its own arguments, and give it another name where it needs that.

        They pass by in its zone, or where it stops in the finest zone. \Conc is left to the last one, since the controller
        allows only few of them in a row.
        """
        move, site, (*before, last) = self.program.motions[number], self.program.sites[number], path
        if last.kind != move.kind:
            self._reword(move, site, last)
        if not before:
            return
        where, source, (file, start, end) = site.layout, site.file.source, site.line.at
        text, newline, indent = source.text, source.newline, source.indent(start)
        options = text[where.to.end : where.behind_to]
        rest = text[where.behind_to : end]
        if move.stops and where.zone is not None:
            rest = f"{text[where.behind_to : where.zone.start]}{FLY_BY}{text[where.behind_zone : end]}"
        lines: list[str] = []
        for waypoint in before:
            kind = waypoint.kind
            name = site.line.name if kind == move.kind else _name(move, site.line, kind)
            target = self._target(site, waypoint)
            if kind == "circular":
                target = f"{self._target(site, _via(waypoint))},{target}"
            lines.append(f"{name} {target}{options if kind == 'axes' else ''}{rest}{newline}{indent}")
        if site.line.compact:
            inner = f"{newline}{indent}  "
            self._edit(file, start, start, "THEN" + inner + inner.join(line.rstrip() for line in lines) + inner)
            self._edit(file, end, end, f"{newline}{indent}ENDIF")
        else:
            self._edit(file, start, start, "".join(lines))

    def _reword(self, move: Motion, site: RapidSite, waypoint: Waypoint) -> None:
        """Edit an instruction's name and arguments as another kind needs them; numbers of the same type are left to do."""
        where, kind, (file, start, _) = site.layout, waypoint.kind, site.line.at
        self._edit(file, start, start + len(site.line.name), _name(move, site.line, kind))
        if where.via is not None:
            self._edit(file, where.via.start, where.to.start, "")
        elif kind == "circular":
            self._edit(file, where.to.start, where.to.start, f"{self._target(site, _via(waypoint))},")
        if target_type(kind) != site.end.type:
            self._edit(file, where.to.start, where.behind_to, self._target(site, waypoint))

    def _target(self, site: RapidSite, waypoint: Waypoint) -> str:
        """An aggregate for a waypoint, with the external axes of a motion."""
        like, type_ = site.end, target_type(waypoint.kind)
        if type_ == like.type:
            numbers = new_numbers({like: waypoint}, self.robot)[like]
        elif type_ == "jointtarget":
            numbers = tuple(np.degrees(waypoint.q).tolist())
        else:
            numbers = (
                *pose_numbers(_pose(waypoint)),
                *Confdata.confdata(self.robot, waypoint.q[None], None)[0].tolist(),
            )
        return _aggregate(type_, numbers, external_texts(like, waypoint.external))

    def result(self) -> tuple[Source, ...]:
        """The files with all that was written."""
        for type_ in TOLERANCES:
            own = [one for one in self.changed if one[0].type == type_]
            for (target, wanted), texts in zip(own, written(type_, [numbers for _, numbers in own]), strict=True):
                literal = target.literal
                assert literal is not None
                text = _changed_text(target, wanted, texts)
                self._edit(target.file.number, literal.start, literal.end, text)
        edited = {source.path: source for source in super().result()}
        return tuple(edited.get(source.path, source) for source in self.program.sources)


def _within(spans: Iterable[Span]) -> Callable[[Reference], bool]:
    """Whether references stand in some texts, none of which stands in another."""
    by_file = defaultdict[int, list[tuple[int, int]]](list)
    for file, *span in set(spans):
        by_file[file].append((span[0], span[1]))
    for own in by_file.values():
        own.sort()

    def stands(one: Reference) -> bool:
        own = by_file.get(one.file.number, ())
        last = bisect_right(own, one.start, key=lambda span: span[0]) - 1
        return last >= 0 and one.start < own[last][1]

    return stands


def _changed_text(target: TargetArgument, wanted: Numbers, texts: Texts) -> str:
    """A value with new numbers, in the style in which it writes them out; those that it says already keep their text."""
    literal, text = target.literal, target.file.source.text
    assert literal is not None
    leaves, parts, at = literal.leaves(), list[str](), literal.start
    for new, value, own, (first, end, raw), most in zip(
        texts, wanted, target.meant, leaves, TOLERANCES[target.type], strict=False
    ):
        if value != own and abs(float(new) - raw) > most:
            parts += [text[at:first], new]
            at = end
    return "".join([*parts, text[at : literal.end]])


def _behind(declaration: DataDeclaration, source: Source) -> tuple[int, str]:
    """Position for a declaration after another one, and the text in front of it."""
    text = source.text
    end = text.find("\n", declaration.end)
    end = len(text) if end < 0 else end
    if end > declaration.end and text[end - 1] == "\r":
        end -= 1
    rest = text[declaration.end : end].strip()
    if rest and not rest.startswith("!"):
        return declaration.end, " "
    return end, f"{source.newline}{source.indent(declaration.start)}"


# A new RAPID module of given motions.


MAX_LINE_LENGTH = 120
"""Longer lines are broken between the parts of a value."""

RUN = "_run"
"""Behind the module's name: that of its procedure."""

NO_AXES = ("9E+09",) * 6
"""External axes that are not used."""

LOAD = "[1,[0,0,1],[1,0,0,0],0,0,0]"
"""A load that the controller accepts: a mass has to be greater than zero."""


@dataclass(frozen=True, kw_only=True)
class _Declarations:
    """Data that the module declares, by what they are."""

    lines: list[str] = field(default_factory=list[str])
    names: dict[tuple[object, ...], str] = field(default_factory=dict[tuple[object, ...], str])
    fresh: FreshNames

    def name(self, key: tuple[object, ...], storage: str, wanted: str, value: str) -> str:
        """The name of data, which are declared when they are first needed."""
        if key not in self.names:
            name = self.names[key] = self.fresh.nearest(wanted)
            self.lines.extend(_broken(f"  {storage} {name}:={value};"))
        return self.names[key]


def compose_rapid(program: Composition) -> Source:
    """A module of its own, ``name.mod``, that declares its targets, tools and work objects and a procedure ``name_run``.

    Raises:
        InputError: RAPID cannot say it.
    """
    program.expect_name("a RAPID module", MAX_NAME_LENGTH - len(RUN), reserved=RESERVED)
    program.expect_input(r"[A-Za-z]\w{0,31}", "the name of its signal, such as di_measured")
    name, robot = program.name, program.robot
    if len(robot.joint_names) != JOINTS or any(robot.prismatic):
        raise InputError(f"{robot.name} is not a robot of six turning axes, which RAPID's targets describe")
    fresh = FreshNames(
        (name, f"{name}{RUN}"), longest=MAX_NAME_LENGTH, usual=MAX_NAME_LENGTH, reserved=RESERVED | set(DATA)
    )
    declared = _Declarations(fresh=fresh)
    body: list[str] = []
    for i, motion in enumerate(program.motions):
        body += _comment(program.note(i))
        at = program.posture(i)
        ends = [(motion.end, at)]
        if motion.via is not None:  # the posture there is that of the end, unless it says its own
            ends.insert(0, (motion.via, None if motion.via.posture is not None else at))
        points = [_point(target, q, i, robot, declared) for target, q in ends]
        speed = _speed(program.speed if motion.speed is None else motion.speed, declared)
        arguments = [*points, speed, "fine" if motion.stops else program.zone, _tool(motion, declared)]
        body.append(f"    {NAMES[motion.kind]} {','.join(arguments)};")
        body += program.waits(i, "    WaitTime {0:g};", "    WaitDI {0},0;", "    WaitDI {0},1;")
    lines = [f"MODULE {name}", *declared.lines, "", f"  PROC {name}{RUN}()", *body, "  ENDPROC", "ENDMODULE"]
    return program.written(lines, ".mod")


def _comment(text: str) -> Iterator[str]:
    width = MAX_LINE_LENGTH - 6
    for start in range(0, len(text), width):
        yield f"    ! {text[start : start + width]}"


def _broken(line: str) -> Iterator[str]:
    """A declaration in lines that are not too long."""
    while len(line) > MAX_LINE_LENGTH:
        at = line.rfind(",[", 0, MAX_LINE_LENGTH) + 1
        if at <= 0:
            break
        yield line[:at]
        line = f"    {line[at:]}"
    yield line


def _point(
    target: Target, q: Float[np.ndarray, " joints"] | None, number: int, robot: Robot, declared: _Declarations
) -> str:
    type_: TargetType
    if target.q is not None:
        type_, letter, numbers = "jointtarget", "j", tuple(np.degrees(target.q).tolist())
    elif target.T is not None:
        type_, letter = "robtarget", "p"
        cf = _configuration(target, q, number, robot)
        numbers = (*pose_numbers(target.T), cf.cf1, cf.cf4, cf.cf6, cf.cfx)
    else:
        raise InputError(f"motion {number} is given neither a pose nor joint positions")
    value = _aggregate(type_, numbers, NO_AXES)
    return declared.name((type_, value), f"CONST {type_}", f"{letter}{10 * (number + 1)}", value)


def _configuration(target: Target, q: Float[np.ndarray, " joints"] | None, number: int, robot: Robot) -> Confdata:
    if q is not None:
        return Confdata.of(robot, q)
    if isinstance(target.posture, Confdata):
        return target.posture
    raise InputError(f"motion {number} goes to a pose and does not say in which posture; give its joint positions")


def _speed(speed: float, declared: _Declarations) -> str:
    mm = real(speed * 1e3, MM_DECIMALS)
    if f"v{mm}" in DATA:
        return f"v{mm}"
    return declared.name(("speeddata", mm), "CONST speeddata", "vTool", f"[{mm},500,5000,1000]")


def _tool(motion: Motion, declared: _Declarations) -> str:
    tool_held, fixed = ("FALSE", "TRUE") if motion.part_in_hand else ("TRUE", "FALSE")
    tool, work_object = "tool0", ""
    if motion.part_in_hand or _moves(motion.tool):
        value = f"[{tool_held},{_frame(motion.tool)},{LOAD}]"
        tool = declared.name(("tooldata", value), "PERS tooldata", _wish(motion.tool, "tTool"), value)
    if motion.part_in_hand or _moves(motion.part):
        value = f'[{fixed},TRUE,"",{_frame(motion.part)},[[0,0,0],[1,0,0,0]]]'
        name = declared.name(("wobjdata", value), "PERS wobjdata", _wish(motion.part, "wPart"), value)
        work_object = f"\\WObj:={name}"
    return f"{tool}{work_object}"


def _moves(frame: Frame) -> bool:
    return not np.allclose(frame.T, np.eye(4), rtol=0.0, atol=1e-9)


def _wish(frame: Frame, otherwise: str) -> str:
    name = frame.name
    usable = name.isascii() and name.isidentifier() and not name.startswith("_") and len(name) <= MAX_NAME_LENGTH
    return name if usable else otherwise


def _frame(frame: Frame) -> str:
    pose = pose_numbers(frame.T)
    position = ",".join(real(v, MM_DECIMALS) for v in pose[:3])
    return f"[[{position}],[{','.join(quaternion_texts(pose[3:]))}]]"
