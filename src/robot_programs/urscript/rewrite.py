"""New numbers for the targets of a URScript program, in the places where it states them; and new programs."""

import re
from collections.abc import Collection, Container, Iterable, Iterator, Sequence, Set
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from robot_programs.core import flow
from robot_programs.core.form import Arming, Ask, Expression, Hole, Op, Span, inside
from robot_programs.core.kit import parted, words
from robot_programs.core.program import (
    Composition,
    Frame,
    Motion,
    NearPosture,
    Paths,
    Target,
    TargetVisit,
    Waypoint,
    Wrapped,
    Wrapping,
    wrapping,
)
from robot_programs.core.robot import JOINTS, Robot
from robot_programs.core.sharing import SharingProgram, Spelling, Use
from robot_programs.core.source import FreshNames, Source, TextEdit, numeral, renumbered
from robot_programs.core.values import Origin
from robot_programs.core.written_out import Repeated, Turns
from robot_programs.urscript.helper import MAKINGS, Holders, with_function, wrap
from robot_programs.urscript.lower import Function, LoweredUrscript, MotionCall
from robot_programs.urscript.meaning import UrscriptSite, WrittenTarget, slot_of
from robot_programs.urscript.syntax import REST_OF_LINE, WORD
from robot_programs.urscript.values import Six, has_value, six_of
from taskcal_groundwork import se3
from taskcal_groundwork.errors import InputError

METRES, RADIANS = 7, 8
"""Decimals written of positions and of angles: a tenth of a micrometre, and as much at the end of an arm."""

NUMBER_TOLERANCE = 1e-8
"""Metres and radians that differ by less are written alike."""

PASSING_M, PASSING_SHARE = 1e-3, 0.3
"""Largest blend radius of points that are put on a path, metres: with none the robot would stop in them; and its share of the
way between two of them, for blends cannot overlap (Universal Robots, *User manual*, waypoints)."""


# The program.


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class UrscriptProgram(SharingProgram):
    """URScript program read from its files."""

    LANGUAGE: ClassVar = "URScript"

    sites: tuple[UrscriptSite, ...] = ()
    routines: tuple[Function, ...] = ()
    program: LoweredUrscript
    failing: tuple[MotionCall, ...] = ()
    """Motions that were not understood."""
    shifted: Set[MotionCall] = frozenset()
    """Those of them where something may move the tool away from its target."""

    @cached_property
    def holders(self) -> Holders:
        """Which data may hold which numbers."""
        return Holders(routines=self.program.routines)

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
        if added is not None and function in self.program.by_name:
            raise InputError(f"{source.path}: has a function {function} already")
        staying = {site.line for i, site in enumerate(self.sites) if i not in rejected}
        lines = dict.fromkeys(site.line for site in self.sites if site.line not in staying)
        lines |= dict.fromkeys(line for line in self.failing if line not in self.shifted)
        why = "something may move the tool away from its target"
        found = [
            *(Wrapped(place=source.place(one.at[1]), name=one.name, obstacle=why) for one in self.failing if one in self.shifted),
            *wrap(lines, source, self.holders, function, without=without, keep_joints=keep_joints),
        ]  # fmt: skip
        program = replace(self, read=partial(self.read, corrects=function))
        made = wrapping(program, found, None, lambda again: (again, ()))
        if added is None or not made.wrapped:
            return made
        return replace(made, completed=lambda sources: (with_function(sources[0], added),))

    def spelling(self, robot: Robot, waypoints: Paths) -> "UrscriptSpelling":
        """Numbers are changed where they stand, in the motion or where its variable gets them; else the motion states its own."""
        return UrscriptSpelling(sources=self.sources, program=self, uses=[*self._uses(waypoints)])

    def _uses(self, waypoints: Paths) -> "Iterator[Use[Six]]":
        """The points of all motions."""
        for number, (site, move) in enumerate(zip(self.sites, self.motions, strict=True)):
            path = waypoints.get(number, ())
            stays = not path or move.stays(path)
            wanted = [point.values for point in site.points] if stays else [*_wanted(site, path[-1])]
            for point, values in zip(site.points, wanted, strict=True):
                # numbers count in the feature, or in the base
                part = np.eye(4) if point.feature else point.T
                posed = len(site.points) == 1 and not point.joints
                yield Use(
                    motion=number, text=point.slot.at, slot=point.literal, numbers=point.values, wanted=values, point=point,
                    poses=(part.__matmul__, se3.inverse(part).__matmul__) if posed else None,
                )  # fmt: skip

    def speed_edit(self, number: int, speed: float) -> tuple[int, TextEdit]:
        """The argument ``v``; see `Program.speed_edit`."""
        site = self.sites[number]
        start, end, before = _argument(site.line, "v")
        return site.file, TextEdit(start=start, end=end, text=f"{before}{speed:.10g}")

    def fresh_names(self) -> FreshNames:
        """Names that are free in all files."""
        taken = (word for source in self.sources for word in _WORD.findall(source.text))
        return FreshNames(taken, longest=MAX_NAME_LENGTH, reserved=RESERVED)

    def turned(self, routine: Function, loop: flow.Loop, taken: Sequence[float]) -> Turns | None:
        """A loop turn by turn; see `SharingProgram.turned`."""
        (file, start, begins), end = loop.line.at, loop.end.at
        place = _own_lines(self.sources[file], (start, begins), end[1:])
        if place is None or not _is_plain(loop.condition) or _is_left(loop.body):
            return None
        first, begins, last, behind = place
        units = (one.unit for one in self.routines if one.unit.file == file and one.unit.kind)
        if any(first <= unit.head.start < behind for unit in units):
            return None
        return Turns(start=first, end=behind, body=(begins, last), before=("",) * len(taken), after="")

    def copied(self, routine: Function) -> Repeated | None:
        """A function of a name of its own that no thread runs, if its lines have no other statements."""
        unit, head = routine.unit, routine.unit.head
        run = (one for by in self.routines for line in by.lines if isinstance(line, Arming) for one in line.routines)
        if unit.kind != "def" or len(self.program.by_name[routine.name]) > 1 or routine in run:
            return None
        assert head.end is not None
        place = _own_lines(unit.source, (head.start, head.begins), (head.end.start, head.end.end))
        if place is None:
            return None
        first, behind, name = place[0], place[3], head.words[1]
        return Repeated(source=unit.source, at=behind, before="", span=(first, behind), name=(name.start, name.end))

    def visits(self) -> Iterable[TargetVisit]:
        """Motions whose targets are, or are computed of, numbers that variables hold; see `Program.visits`."""
        holders = self.holders
        named = {key for site in self.sites for point in site.points for key in MAKINGS.of(point.slot)}
        for number, (site, move) in enumerate(zip(self.sites, self.motions, strict=True)):
            for point in site.points:
                keys = set(MAKINGS.of(point.slot))
                if point.literal is not None:
                    stated = point.literal.at[:2]
                    keys = set(holders.items.get(stated, ()))
                    yield TargetVisit(number=number, target=stated, place=move.place)
                # a point, too, to which this one is beside
                if point.feature is not None and point.feature.key in named:
                    keys.add(point.feature.key)
                for target in holders.numbers_of(keys):
                    yield TargetVisit(number=number, target=target, place=move.place)
        for line in self.failing:
            keys = {key for argument in line.points for key in MAKINGS.of(slot_of(argument)[0])}
            for target in holders.numbers_of(keys):
                yield TargetVisit(number=None, target=target, place=self.sources[line.at[0]].place(line.at[1]))


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


def _argument(line: MotionCall, name: str) -> tuple[int, int, str]:
    """Where an argument stands, or is to stand, and what is to be written before its value."""
    given = line.given.get(name)
    return (line.at[2] - 1, line.at[2] - 1, f", {name}=") if given is None else (*given.at[1:], "")


def _is_plain(condition: Expression) -> bool:
    """Whether no function in a condition may do more than give a value."""
    return not any(
        isinstance(one, Ask | Hole) or (isinstance(one, Op) and not has_value(one.sign)) for one in inside(condition)
    )


def _is_left(nodes: flow.Block) -> bool:
    """Whether ``break`` or ``continue`` stands in a loop, or in loops in it."""
    return any(isinstance(node, flow.Leave) and node.way in ("exit", "jump") for node in flow.nodes_in(nodes))


def _wanted(site: UrscriptSite, waypoint: Waypoint) -> Iterator[Six]:
    """Numbers for the points of a motion at a waypoint."""
    points = (waypoint,) if waypoint.via is None else (waypoint.via, waypoint)
    for point, one in zip(site.points, points, strict=True):
        values = point.wanted(one)
        turns = one is waypoint and point.turns  # an arc's first point has no orientation
        yield values if turns else (*values[:3], *point.values[3:])


def _decimals(point: WrittenTarget) -> list[int]:
    return [RADIANS] * 6 if point.joints else [METRES] * 3 + [RADIANS] * 3


def _text(point: WrittenTarget, values: Six) -> str:
    text = ("" if point.joints else "p") + _brackets(values, _decimals(point))
    return text if point.feature is None or point.framed else f"pose_trans({point.feature.name}, {text})"


def _brackets(values: Six, decimals: Sequence[int]) -> str:
    return f"[{', '.join(numeral(value, places) for value, places in zip(values, decimals, strict=True))}]"


@dataclass(eq=False, kw_only=True)
class UrscriptSpelling(Spelling[Six]):
    """What is written into the files; numbers of a point are six, in its feature or in the base.

    No number is declared: an assignment states it, which runs. So a motion states its own.
    """

    program: UrscriptProgram

    def alike(self, one: Six, other: Six) -> bool:
        """Whether numbers differ by less than is written."""
        return one is other or all(abs(a - b) < NUMBER_TOLERANCE for a, b in zip(one, other, strict=True))

    def reader(self, slot: Origin, texts: Collection[Span]) -> str:
        """What reads the variable that gets numbers for something else than a motion's target."""
        return "others" if self.program.holders.of_literal.get(slot.at[:2]) in self.program.holders.read_at_last else ""

    def in_place(self, use: Use[Six]) -> None:
        """Change each number that differs."""
        assert use.slot is not None
        file, start, end = use.slot.at
        text, decimals = self.sources[file].text, _decimals(use.point)
        for (first, behind), was, value, places in zip(
            _items(text, start, end), use.numbers, use.wanted, decimals, strict=True
        ):
            new = renumbered(text[first:behind], was, value, places)
            self.edits[file] += [TextEdit(start=first, end=behind, text=new)] if new != text[first:behind] else []

    def own(self, use: Use[Six]) -> str:
        """Brackets, in the feature that the motion is on."""
        return _text(use.point, use.wanted)

    def obstacle(self, use: Use[Six]) -> str:
        """That its feature cannot be named."""
        feature = use.point.feature
        if feature is None or use.point.named:
            return ""
        return f"its feature {feature.name} is not known where it stands, so that it cannot state its own target there"

    def insert(self, number: int, path: Sequence[Waypoint]) -> None:
        """Write the motion's own text with other targets, passing by them."""
        site = self.program.sites[number]
        source, (file, start, end), radius = self.sources[site.file], site.line.at, _passing(path)
        first, behind, before = _argument(site.line, "r")
        passing = TextEdit(start=first, end=behind, text=f"{before}{radius:.5f}")
        texts = [
            source.piece(start, end, [
                *(TextEdit(start=point.slot.at[1], end=point.slot.at[2], text=_text(point, wanted))
                  for point, wanted in zip(site.points, _wanted(site, waypoint), strict=True)),
                passing,
            ]) + source.newline + source.indent(start)
            for waypoint in path[:-1]
        ]  # fmt: skip
        self.edits[file].append(TextEdit(start=start, end=start, text="".join(texts)))


def _items(text: str, start: int, end: int) -> Iterator[tuple[int, int]]:
    """Places of numbers in brackets."""
    opening = text.index("[", start, end) + 1
    found = [word for word in words(WORD, text[opening : end - 1], opening) if word.kind != "newline"]
    for item in parted(found, ","):
        yield item[0].start, item[-1].end


# Text that stands for several motions, written out.


def _own_lines(source: Source, head: tuple[int, int], end: tuple[int, int]) -> tuple[int, int, int, int] | None:
    """Lines of a block: where its header begins and ends, and its end; None where other statements stand in these.

    Args:
        source: of the block.
        head: first character of its header, and behind its colon.
        end: the same of its end.
    """
    text = source.text
    behind_header, behind = (REST_OF_LINE.match(text, place) for place in (head[1], end[1]))
    first, last = (text.rfind("\n", 0, place) + 1 for place in (head[0], end[0]))
    if behind_header is None or behind is None or text[first : head[0]].strip() or text[last : end[0]].strip():
        return None
    return first, behind_header.end(), last, behind.end()


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
