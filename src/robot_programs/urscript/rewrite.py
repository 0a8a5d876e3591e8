"""New numbers for the targets of a URScript program, in the places where it states them; and new programs."""

import re
from collections import Counter, defaultdict
from collections.abc import Collection, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from robot_programs.core import se3
from robot_programs.core.errors import InputError
from robot_programs.core.flow import Loop, lines_in
from robot_programs.core.program import (
    Composition,
    Diagnostic,
    Frame,
    Motion,
    NearPosture,
    Paths,
    Program,
    Target,
    Visit,
    Waypoint,
    Wrapping,
    reject_in_turn,
)
from robot_programs.core.robot import JOINTS, Robot
from robot_programs.core.source import FreshNames, Source, TextEdit, numeral, renumbered
from robot_programs.core.written_out import (
    Repeated,
    Shared,
    Turns,
    least_worst,
    loops_to_write,
    reaching,
    written_out,
)
from robot_programs.urscript.computed import with_function, wrap
from robot_programs.urscript.holders import Holders
from robot_programs.urscript.syntax import REST_OF_LINE, Expression, File, Routine, Statement, inside, plain_name
from robot_programs.urscript.values import FUNCTIONS, MOTIONS, Literal, Six, signature, six_of

METRES, RADIANS = 7, 8
"""Decimals written of positions and of angles: a tenth of a micrometre, and as much at the end of an arm."""

NUMBER_TOLERANCE = 1e-8
"""Metres and radians that differ by less are written alike."""

PASSING_M, PASSING_SHARE = 1e-3, 0.3
"""Largest blend radius of points that are put on a path, metres: with none the robot would stop in them; and its share of the
way between two of them, for blends cannot overlap (Universal Robots, *User manual*, waypoints)."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Point:
    """A target of a motion as it is written."""

    slot: Expression
    """What stands for it in the motion, inside of ``get_inverse_kin`` and ``pose_trans``."""
    framed: bool
    """The slot counts in the feature, which the motion names."""
    named: bool
    """The feature is what its variable holds where the motion stands."""
    literal: Literal | None
    """The numbers that state it, in the motion or elsewhere, in the feature if it has one; None where it is computed."""
    values: Six
    joints: bool
    feature: tuple[str, Six] | None
    """The variable that is its part's frame, and the pose that this holds."""
    T: Float[np.ndarray, "4 4"]
    """Its part's frame in the base, as it was read."""
    turns: bool = True
    """The tool gets the orientation that the numbers state."""

    def wanted(self, waypoint: Waypoint) -> Six:
        """Numbers for a waypoint, in the feature or in the base."""
        if self.joints:
            return tuple(float(angle) for angle in waypoint.q)
        assert waypoint.T is not None
        return six_of(waypoint.T if self.feature else self.T @ waypoint.T, self.values)


def slot_of(argument: Expression) -> tuple[Expression, bool]:
    """What stands for a target in a motion's argument, and whether it is moved by a feature that is named there."""
    while argument.kind == "call" and argument.name == "get_inverse_kin" and argument.parts:
        argument = argument.parts[0]
    if (
        argument.kind == "call"
        and argument.name == "pose_trans"
        and [one.kind for one in argument.parts[:1]] == ["name"]
        and len(argument.parts) == 2
    ):
        return argument.parts[1], True
    return argument, False


@dataclass(frozen=True, eq=False, kw_only=True)
class Site:
    """A motion's place in the text."""

    file: File
    call: Expression
    points: tuple[Point, ...]

    @property
    def text(self) -> tuple[int, int]:
        """Number of the file, and first character."""
        return self.file.number, self.call.start


# The program.


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class UrscriptProgram(Program):
    """URScript program read from its files."""

    sites: tuple[Site, ...]
    """Of the moves, in their order."""
    files: tuple[File, ...]
    failing: tuple[tuple[int, Expression], ...] = ()
    """Motions that were not understood, with the numbers of their files."""
    shifted: frozenset[tuple[int, int]] = frozenset()
    """Those of them, by file and first character, where something may move the tool away from its target."""
    turns: Mapping[Loop, tuple[float, ...] | None] = field(default_factory=dict[Loop, tuple[float, ...] | None])
    """See `Flow.turns`."""

    @cached_property
    def _holders(self) -> Holders:
        return Holders(files=self.files)

    def wrap(
        self,
        function: str,
        added: Source | None,
        *,
        without: Collection[str] = (),
        rejected: Container[int] = (),
        keep_joints: bool = False,
    ) -> Wrapping:
        """Put a function of a pose and joint positions near it around targets; see `Program.wrap`."""
        assert isinstance(self.read, partial)
        source, *others = self.sources
        if others:
            raise InputError(f"{others[0].path}: a function has its place in one file; correct one at a time")
        names = {routine.name for file in self.files for routine in file.routines}
        if added is not None and function in names:
            raise InputError(f"{source.path}: has a function {function} already")
        staying = {site.text for i, site in enumerate(self.sites) if i not in rejected}
        motions = {site.text: site.call for site in self.sites if site.text not in staying}
        motions |= {(file, call.start): call for file, call in self.failing if (file, call.start) not in self.shifted}
        found = list(wrap(motions.values(), source, self._holders, function, without=without, keep_joints=keep_joints))
        left = [
            (call, "something may move the tool away from its target")
            for file, call in self.failing
            if (file, call.start) in self.shifted
        ]
        left += [(one.call, one.obstacle) for one in found if one.edit is None]
        wrapped = [one for one in found if one.edit is not None]
        read = partial(self.read, corrects=function)
        return Wrapping(
            program=read((source.edited(one.edit for one in wrapped if one.edit),)) if wrapped else self,
            wrapped=tuple(source.place(one.call.start) for one in wrapped),
            left=tuple(
                Diagnostic(place=source.place(call.start), text=f"{call.name} is not corrected at run time: {obstacle}")
                for call, obstacle in left
            ),
            completed=lambda sources: (with_function(sources[0], added),) if added and wrapped else sources,
        )

    def rewrite(self, robot: Robot, waypoints: Mapping[int, tuple[Waypoint, ...]]) -> tuple[Source, ...]:
        """The program's files with some motions rewritten; see `Program.rewrite`.

        Numbers are changed where they stand, in the motion or where its variable gets them, if all motions that go there
        agree and nothing else reads them. Else the motion states its own.

        Raises:
            InputError: a motion is to become one of another kind, or cannot be what it should.
        """
        for number, path in waypoints.items():
            if any(waypoint.kind != self.motions[number].kind for waypoint in path):
                raise InputError(
                    f"{self.motions[number].place}: the motion cannot become one of another kind in URScript"
                )
        plan = _Plan.of(self, waypoints)
        if plan.conflicts:
            number, why = plan.conflicts[0]
            raise InputError(f"{self.motions[number].place}: {why}")
        edits: list[list[TextEdit]] = [[] for _ in self.sources]
        for file, changes in enumerate(plan.edits):
            edits[file] += changes.values()
        for number, path in waypoints.items():
            site, move = self.sites[number], self.motions[number]
            source, start = self.sources[site.file.number], site.call.start
            parting = source.newline + source.indent(start)
            radius = _passing(path)
            texts = [self._inserted(site, move, waypoint, radius) + parting for waypoint in path[:-1]]
            if texts:
                edits[site.file.number].insert(0, TextEdit(start=start, end=start, text="".join(texts)))
        return tuple(source.edited(e) for source, e in zip(self.sources, edits, strict=True))

    def _inserted(self, site: Site, move: Motion, waypoint: Waypoint, radius: float) -> str:
        """The motion's own text with another target, passing by it."""
        source, call = self.sources[site.file.number], site.call
        edits = [
            TextEdit(start=point.slot.start, end=point.slot.end, text=_text(point, wanted))
            for point, wanted in _wanted(site, waypoint)
        ]
        given = signature(call, MOTIONS[call.name][1]) or {}
        at = (given["r"].start, given["r"].end) if "r" in given else (call.end - 1, call.end - 1)
        edits.append(TextEdit(start=at[0], end=at[1], text=f"{radius:.5f}" if "r" in given else f", r={radius:.5f}"))
        return source.piece(call.start, call.end, edits)

    def speed_edit(self, number: int, speed: float) -> tuple[int, TextEdit]:
        """The argument ``v``; see `Program.speed_edit`."""
        site = self.sites[number]
        given = (signature(site.call, MOTIONS[site.call.name][1]) or {}).get("v")
        start, end = (site.call.end - 1,) * 2 if given is None else (given.start, given.end)
        return site.file.number, TextEdit(start=start, end=end, text=f"{'' if given else ', v='}{speed:.10g}")

    def unwritable(
        self, robot: Robot, waypoints: Mapping[int, tuple[Waypoint, ...]], tolerance: float
    ) -> dict[int, str]:
        """Motions whose text stands for several, which need different numbers; see `Program.unwritable`."""
        return reject_in_turn(waypoints, lambda paths: _Plan.of(self, paths).conflicts)

    def least_worst(
        self, robot: Robot, waypoints: Paths, numbers: Collection[int], tolerance: float
    ) -> dict[int, tuple[Waypoint, ...]]:
        """One value where motions share their numbers; see `Program.least_worst`."""
        groups: dict[object, list[Shared]] = defaultdict(list)
        others, stated = set[object](), dict[object, Six]()
        for i, site in enumerate(self.sites):
            for point in site.points:
                numbers_of = site.text if point.literal is None else point.literal
                part = np.eye(4) if point.feature else point.T  # numbers count in the feature, or in the base
                base, target = part.__matmul__, se3.inverse(part).__matmul__
                same = (
                    stated.setdefault(numbers_of, point.values) == point.values
                )  # else they are computed, turn by turn
                if point.joints or len(site.points) > 1 or not same:
                    others.add(numbers_of)
                groups[numbers_of].append(Shared(number=i, base=base, target=target))
        out: dict[int, tuple[Waypoint, ...]] = {}
        for numbers_of, group in groups.items():
            if numbers_of not in others and any(one.number in numbers for one in group):
                out |= least_worst(group, waypoints, tolerance)
        return out

    def written_out(self, numbers: Collection[int]) -> tuple[Source, ...] | None:
        """The program's files with shared text written out; see `Program.written_out`."""
        shared = {self.sites[i].text for i in numbers}
        routines = [routine for file in self.files for routine in file.routines]
        by_name = {routine.name: routine for routine in routines}
        calls: dict[Routine, list[tuple[tuple[int, int], Routine]]] = defaultdict(list)
        motions: list[tuple[tuple[int, int], Routine]] = []
        for routine in routines:
            for call in (call for line in routine.lines for call in line.calls):
                text = routine.file.number, call.start
                motions += [(text, routine)] if text in shared else []
                if call.name in by_name:
                    calls[by_name[call.name]].append((text, routine))
        reached = reaching(motions, calls)
        turns = (
            (routine.file.source, loop) for routine in routines for loop in _turns_of(routine, self.turns, reached)
        )
        kinds = Counter(routine.name for routine in routines)
        repeated = (
            _repeated(routine, [text for text, _ in calls[routine]])
            for routine in {routine: None for _, routine in motions}
            if routine.kind == "def" and kinds[routine.name] == 1 and all(by is not routine for _, by in calls[routine])
        )
        words = (word for source in self.sources for word in _WORD.findall(source.text))
        fresh = FreshNames(words, longest=MAX_NAME_LENGTH, reserved=RESERVED)
        return written_out(self.sources, turns, [one for one in repeated if one is not None], fresh)

    def visits(self) -> Iterable[Visit]:
        """Motions whose targets are, or are computed of, numbers that variables hold; see `Program.visits`."""
        numbers = self._holders.numbers_of
        named = {name for site in self.sites for point in site.points for name in _names(point.slot)}
        for number, (site, move) in enumerate(zip(self.sites, self.motions, strict=True)):
            for point in site.points:
                names = set(_names(point.slot))
                if point.literal is not None:
                    text = self.sources[point.literal.file].text
                    names = {name for start, end in point.literal.items for name in _WORD.findall(text, start, end)}
                    yield Visit(number=number, target=point.literal[:2], place=move.place)
                if point.feature is not None and point.feature[0] in named:  # a point, too, to which this one is beside
                    names.add(point.feature[0])
                for target in numbers(names):
                    yield Visit(number=number, target=target, place=move.place)
        for file, call in self.failing:
            names = {name for argument in call.parts[:2] for name in _names(slot_of(argument)[0])}
            for target in numbers(names):
                yield Visit(number=None, target=target, place=self.sources[file].place(call.start))


_WORD = re.compile(r"[A-Za-z_]\w*")


def _passing(path: Sequence[Waypoint]) -> float:
    """Blend radius with which a motion passes by its waypoints, metres."""
    points = [waypoint.T[:3, 3] for waypoint in path if waypoint.T is not None]
    ways = [float(np.linalg.norm(b - a)) for a, b in pairwise(points)]
    if ways and path[1].share > path[0].share:  # the first way begins where the motion before ended
        ways.append(ways[0] * path[0].share / (path[1].share - path[0].share))
    return _blend(ways)


def _blend(ways: Iterable[float]) -> float:
    """Blend radius between ways of some lengths, metres."""
    return min([PASSING_M, *(PASSING_SHARE * way for way in ways)])


def _names(expression: Expression) -> Iterator[str]:
    """Variables in an expression."""
    return (plain_name(one.name) for one in inside(expression) if one.kind == "name")


def _wanted(site: Site, waypoint: Waypoint) -> Iterator[tuple[Point, Six]]:
    """Numbers for the points of a motion at a waypoint."""
    points = (waypoint,) if waypoint.via is None else (waypoint.via, waypoint)
    for point, one in zip(site.points, points, strict=True):
        values = point.wanted(one)
        if one is not waypoint or not point.turns:  # an arc's first point has no orientation
            values = (*values[:3], *point.values[3:])
        yield point, values


def _text(point: Point, values: Six) -> str:
    decimals = [RADIANS] * 6 if point.joints else [METRES] * 3 + [RADIANS] * 3
    text = ("" if point.joints else "p") + _brackets(values, decimals)
    return text if point.feature is None or point.framed else f"pose_trans({point.feature[0]}, {text})"


def _brackets(values: Six, decimals: Sequence[int]) -> str:
    return f"[{', '.join(numeral(value, places) for value, places in zip(values, decimals, strict=True))}]"


@dataclass(eq=False, kw_only=True)
class _Plan:
    """What is to be written where."""

    program: UrscriptProgram
    edits: list[dict[tuple[int, int], TextEdit]]
    """By file and place."""
    conflicts: list[tuple[int, str]] = field(default_factory=list[tuple[int, str]])

    @classmethod
    def of(cls, program: UrscriptProgram, waypoints: Mapping[int, tuple[Waypoint, ...]]) -> "_Plan":
        """The plan for some motions."""
        plan = cls(program=program, edits=[{} for _ in program.sources])
        paths = {i: path for i, path in waypoints.items() if not program.motions[i].stays(path)}
        at_literals: dict[Literal, list[tuple[int, int, Six | None]]] = defaultdict(list)
        for i, site in enumerate(program.sites):
            wanted = list(_wanted(site, paths[i][-1])) if i in paths else []
            for k, point in enumerate(site.points):
                if point.literal is not None:
                    at_literals[point.literal].append((i, k, wanted[k][1] if wanted else None))
        by_literal = {
            (i, k) for literal, wants in at_literals.items() if plan._agreed(literal, wants) for i, k, _ in wants
        }
        texts: dict[tuple[int, int], list[int]] = defaultdict(list)
        for i, site in enumerate(program.sites):
            texts[site.text].append(i)
        for group in texts.values():
            plan._own_text(group, paths, by_literal)
        return plan

    def _agreed(self, literal: Literal, wants: Sequence[tuple[int, int, Six | None]]) -> bool:
        """Write numbers where the text states them, if all motions to them want the same."""
        holders = self.program._holders  # pyright: ignore[reportPrivateUsage]
        given = holders.of_literal.get(literal[:2])
        if given in holders.read_at_last:
            return False
        (first, k, values), *others = wants
        if values is None or any(want is None or not _alike(values, want) for _, _, want in others):
            return False
        point = self.program.sites[first].points[k]
        text = self.program.sources[literal.file].text
        decimals = [RADIANS] * 6 if point.joints else [METRES] * 3 + [RADIANS] * 3
        for (start, end), was, value, places in zip(literal.items, point.values, values, decimals, strict=True):
            edit = TextEdit(start=start, end=end, text=renumbered(text[start:end], was, value, places))
            if edit.text != text[start:end]:
                self.edits[literal.file][start, end] = edit
        return True

    def _own_text(
        self, group: Sequence[int], paths: Mapping[int, tuple[Waypoint, ...]], by_literal: set[tuple[int, int]]
    ) -> None:
        """Write numbers into the text of a motion, if all that it stands for want the same."""
        program = self.program
        changing = [i for i in group if i in paths]
        divided = [i for i in changing if len(paths[i]) > 1]
        if len(group) > 1 and divided:
            self.conflicts += [(i, _several(group)) for i in divided]
            return
        for k in range(len(program.sites[group[0]].points)):
            left = [i for i in changing if (i, k) not in by_literal]
            point = program.sites[group[0]].points[k]
            if point.feature is not None and not point.named and (left or divided):
                why = f"its feature {point.feature[0]} is not known where it stands, so that it cannot state its own target there"
                self.conflicts += [(i, why) for i in left or divided]
                continue
            if not left:
                continue
            wanted = [list(_wanted(program.sites[i], paths[i][-1]))[k] for i in left]
            point, values = wanted[0]
            if len(left) < len(group) or not all(_alike(values, other) for _, other in wanted):
                self.conflicts += [(i, _several(group)) for i in left]
                continue
            site, slot = program.sites[group[0]], point.slot
            edit = TextEdit(start=slot.start, end=slot.end, text=_text(point, values))
            self.edits[site.file.number][slot.start, slot.end] = edit


def _several(group: Sequence[int]) -> str:
    return f"its text stands for {len(group)} motions, which need different numbers"


def _alike(one: Six, other: Six) -> bool:
    return all(abs(a - b) < NUMBER_TOLERANCE for a, b in zip(one, other, strict=True))


# Text that stands for several motions, written out.


def _own_lines(file: File, start: int, begins: int) -> tuple[int, int, int, int] | None:
    """Lines of a block: where its header begins and ends, and its end; None where other statements stand in these.

    Args:
        file: of the block.
        start: first character of its header.
        begins: behind its colon.
    """
    text, end = file.source.text, file.ends[start]
    behind_header = REST_OF_LINE.match(text, begins)
    behind = REST_OF_LINE.match(text, end.end)
    first, last = (text.rfind("\n", 0, place) + 1 for place in (start, end.start))
    if behind_header is None or behind is None or text[first:start].strip() or text[last : end.start].strip():
        return None
    return first, behind_header.end(), last, behind.end()


def _turns_of(
    routine: Routine, turns: Mapping[Loop, tuple[float, ...] | None], shared: Container[tuple[int, int]]
) -> Iterator[Turns]:
    """Loops of a routine around some calls that can be written turn by turn."""
    file = routine.file

    def is_shared(line: Statement) -> bool:
        return any((file.number, call.start) in shared for call in line.calls)

    for loop, taken in loops_to_write(routine.body.nodes, turns, is_shared, lambda _: True):
        place = _own_lines(file, loop.line.start, loop.line.end)
        if place is None or any(call.name not in FUNCTIONS for call in loop.line.calls):
            continue  # a function in its head may do more
        first, begins, last, behind = place
        if any(first <= one.start < behind for one in file.routines if one.kind):
            continue
        if any(line.kind in ("break", "continue") for line in lines_in(loop.body)):
            continue
        yield Turns(start=first, end=behind, body=(begins, last), before=("",) * len(taken), after="")


def _repeated(routine: Routine, calls: Sequence[tuple[int, int]]) -> Repeated | None:
    """A function of which each call but the first gets a copy; None where its lines have other statements."""
    file, start = routine.file, routine.start
    place = _own_lines(file, start, routine.begins)
    if place is None:
        return None
    source, (first, _, _, behind) = file.source, place
    name = source.text.index(routine.name, start + len(routine.kind))
    own = [at for number, at in calls if number == file.number]
    return Repeated(
        source=source, at=behind, before="", span=(first, behind), name=(name, name + len(routine.name)),
        calls=tuple((source, (at, at + len(routine.name))) for at in own[len(own) == len(calls) :]),
    )  # fmt: skip


# A new URScript program of given motions.

MAX_NAME_LENGTH = 50

FULL_SPEED_RAD_S = float(np.radians(120.0))
"""Largest speed of the slowest axes of UR10 and UR10e, radians per second (Universal Robots, technical specifications)."""

RESERVED = frozenset({
    "def", "thread", "sec", "end", "if", "elif", "else", "while", "break", "continue", "return", "halt", "global", "local", "run",
    "kill", "join", "pass", "and", "or", "xor", "not", "true", "false", "pi", "enter_critical", "exit_critical",
})  # fmt: skip


def compose_urscript(program: Composition) -> Source:
    """A program of its own, ``name.script``.

    Raises:
        InputError: URScript cannot say it.
    """
    program.expect_name("a URScript program", MAX_NAME_LENGTH, reserved=RESERVED)
    program.expect_input(r"\d+", "its number, such as 3")
    robot = program.robot
    if len(robot.joint_names) != JOINTS or any(robot.prismatic):
        raise InputError(f"{robot.name} is not a robot of six turning axes, which URScript's positions describe")
    lines = [f"def {program.name}():", *(f"  {line}" for line in _motions(program)), "end"]
    return program.written(lines, ".script", "\n")


def _motions(program: Composition) -> Iterator[str]:
    named: dict[str, Frame] = {}

    def frame(stated: Frame) -> tuple[str, str]:
        """Line that states a frame, where it needs one, and the expression for it."""
        text = _pose(stated.T)
        if not _WORD.fullmatch(stated.name) or stated.name.lower() in {*RESERVED, program.name.lower()}:
            return "", text
        known = named.get(stated.name)
        if known is not None and np.array_equal(known.T, stated.T):
            return "", stated.name
        named[stated.name] = stated
        return f"{stated.name} = {text}", stated.name

    tool: Frame | None = None
    points = [None if move.end.T is None else (move.part.T @ move.end.T)[:3, 3] for move in program.motions]
    ways = [np.inf if a is None or b is None else float(np.linalg.norm(b - a)) for a, b in pairwise(points)]
    for i, move in enumerate(program.motions):
        if program.notes:
            yield f"# {program.note(i)}"
        if move.kind != "axes":
            if move.part_in_hand:
                raise InputError(f"motion {i} has its part in the robot's hand, which URScript does not know")
            if tool is None or tool.name != move.tool.name or not np.array_equal(tool.T, move.tool.T):
                tool = move.tool
                line, text = frame(tool)
                yield from (line, f"set_tcp({text})") if line else (f"set_tcp({text})",)
        line, part = frame(move.part) if move.kind != "axes" else ("", "")
        yield from (line,) if line else ()
        yield _motion(program, i, move, part, _blend(ways[max(i - 1, 0) : i + 1]))
        until = "while {}get_standard_digital_in({{0}}):\n    sync()\n  end"
        yield from program.waits(i, "sleep({0:g})", until.format(""), until.format("not "))


def _motion(program: Composition, number: int, move: Motion, part: str, radius: float) -> str:
    passing = "" if move.stops else f", r={radius:.5f}"
    if move.kind == "axes":
        assert move.end.q is not None
        speed = f", v={program.joint_speed_percent / 100.0 * FULL_SPEED_RAD_S:.4g}"
        return f"movej({_joints(move.end.q)}{speed}{passing})"
    end = _target(move.end, part)
    if move.kind == "joint":
        q, stated = program.posture(number), move.end.posture
        q = stated.q if q is None and isinstance(stated, NearPosture) else q
        if q is None:
            raise InputError(
                f"motion {number} drives all joints to a pose and does not say in which posture; give its joint positions"
            )
        return f"movej(get_inverse_kin({end}, qnear={_joints(q)}){passing})"
    speed = f", v={program.speed if move.speed is None else move.speed:g}"
    if move.via is None:
        return f"movel({end}{speed}{passing})"
    return f"movec({_target(move.via, part)}, {end}{speed}{passing})"


def _target(target: Target, part: str) -> str:
    if target.T is None:
        raise InputError("a line or an arc leads to joint positions; URScript's needs its pose")
    return f"pose_trans({part}, {_pose(target.T)})"


def _pose(T: Float[np.ndarray, "4 4"]) -> str:
    return "p" + _brackets(six_of(T), [METRES + 2] * 3 + [RADIANS + 2] * 3)


def _joints(q: Float[np.ndarray, " joints"]) -> str:
    return _brackets(tuple(float(angle) for angle in q), [RADIANS] * len(q))
