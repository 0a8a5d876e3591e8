"""Rewriting motions: numbers where they stand, clones of shared targets, further motions on the way; and new modules."""

import math
from bisect import bisect_left, bisect_right
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice, pairwise, zip_longest
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from robot_programs.core import se3
from robot_programs.core.errors import InputError
from robot_programs.core.flow import Loop, lines_in
from robot_programs.core.program import (
    Composition,
    Frame,
    Motion,
    MotionKind,
    Paths,
    Program,
    Target,
    Unresolved,
    Visit,
    Waypoint,
    Wrapping,
    reject_in_turn,
    wrapping,
)
from robot_programs.core.robot import Robot
from robot_programs.core.source import FreshNames, Place, Source, TextEdit
from robot_programs.core.written_out import (
    MAX_SHARED_TURN_RAD,
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
from robot_programs.rapid.changes import Use
from robot_programs.rapid.computed import calls_function, wrap
from robot_programs.rapid.names import DATA, Context, File, Symbol
from robot_programs.rapid.parse import RESERVED
from robot_programs.rapid.resolve import (
    JOINTS,
    NAMES,
    Configuration,
    Site,
    TargetArgument,
    TargetType,
    axes_of,
    configuration,
    leaves,
    pose_numbers,
    poses_of,
    renumbered_target,
    target_arguments,
)
from robot_programs.rapid.syntax import (
    LISTED,
    Aggregate,
    Argument,
    Assignment,
    Call,
    Control,
    Declaration,
    Instruction,
    Label,
    Line,
    Node,
    Routine,
    Unparsed,
    list_end,
    parts,
    tokenize,
    words_from,
)
from robot_programs.rapid.values import (
    DEG_DECIMALS,
    MM_DECIMALS,
    pose_of,
    pose_rows,
    quaternion_texts,
    quaternions_texts,
    real,
    reals,
)

# The numbers of a rewritten target, as text.

TEXT_TOLERANCE_MM = 1e-4
TEXT_TOLERANCE_QUATERNION = 1e-7
TEXT_TOLERANCE_DEG = 1e-6
"""Numbers that change by no more keep their text."""

Texts = tuple[str | None, ...]
"""A text for each number of a target before its external axes; None where it keeps its own."""


WANTED_TOLERANCE_MM, WANTED_TOLERANCE = 1e-3, 2e-6
"""Texts that differ by no more, millimetres, and parts of a quaternion or degrees, want the same."""


def agree(target: TargetArgument, texts: Texts, others: Texts) -> bool:
    """Whether two texts of a target want the same numbers."""
    pairs = zip(texts, others, target.meant, strict=True)
    off = [abs((old if a is None else float(a)) - (old if b is None else float(b))) for a, b, old in pairs]
    if target.type == "jointtarget":
        return max(off) <= WANTED_TOLERANCE
    return max(off[:3]) <= WANTED_TOLERANCE_MM and max(off[3:7]) <= WANTED_TOLERANCE and max(off[7:]) == 0.0


Ends = Mapping[TargetArgument, Waypoint]
"""What targets are to become."""


def new_texts(ends: Ends, robot: Robot) -> dict[TargetArgument, Texts]:
    """Texts of waypoints in place of targets."""
    joints = {target: _degree_texts(target, end) for target, end in ends.items() if target.type == "jointtarget"}
    return joints | _pose_texts({target: end for target, end in ends.items() if target not in joints}, robot)


def _degree_texts(target: TargetArgument, waypoint: Waypoint) -> Texts:
    return tuple(
        None if abs(new - old) <= TEXT_TOLERANCE_DEG else real(float(new), DEG_DECIMALS)
        for new, old in zip(np.degrees(waypoint.q), target.meant, strict=True)
    )


def _pose_texts(ends: Ends, robot: Robot) -> dict[TargetArgument, Texts]:
    if not ends:
        return {}
    meant = np.array([target.meant for target in ends])
    pose = pose_rows(np.stack([_pose(waypoint) for waypoint in ends.values()]))
    pose[(pose[:, 3:] * meant[:, 3:7]).sum(axis=1) < 0.0, 3:] *= -1.0
    off = np.abs(pose - meant[:, :7])
    moved, turned = off[:, :3] > TEXT_TOLERANCE_MM, off[:, 3:].max(axis=1) > TEXT_TOLERANCE_QUATERNION
    stated = meant[:, 7:].astype(np.int64)
    confdata = Configuration.confdata(robot, np.stack([waypoint.q for waypoint in ends.values()]), stated)
    places = iter(reals(pose[:, :3][moved].tolist(), MM_DECIMALS))
    quaternions = iter(quaternions_texts(pose[turned, 3:]))
    return {
        target: (
            *(next(places) if new else None for new in changes),
            *(_quaternion_texts(target, next(quaternions)) if turns else (None,) * 4),
            *(None if new == old else str(new) for new, old in zip(cf, was, strict=True)),
        )
        for target, changes, turns, cf, was in zip(
            ends, moved.tolist(), turned.tolist(), confdata.tolist(), stated.tolist(), strict=True
        )
    }


def _quaternion_texts(target: TargetArgument, texts: Texts) -> Texts:
    """Texts of a quaternion, but for those that say what is written."""
    if target.literal is None or target.shifted:
        return texts
    literal = target.literal
    own = literal.values[1] if literal.is_literal else None
    raw = own if isinstance(own, tuple) else (value for _, _, value in islice(leaves(literal), 3, 7))
    return tuple(
        None if text is None or abs(float(text) - value) <= TEXT_TOLERANCE_QUATERNION else text
        for text, value in zip(texts, raw, strict=True)
    )


def fresh_text(type_: TargetType, waypoint: Waypoint, robot: Robot, like: TargetArgument) -> str:
    """An aggregate for a waypoint, with the external axes of a target."""
    if type_ == "jointtarget":
        numbers = _axes_written(np.degrees(waypoint.q))
    else:
        pose = pose_numbers(_pose(waypoint))
        stated = like.meant[3:] if like.type == "robtarget" else None
        sign = 1.0 if stated is None or np.dot(pose[3:], stated[:4]) >= 0.0 else -1.0
        cf = Configuration.of(robot, waypoint.q, configuration(stated[4:]) if stated else None)
        numbers = _pose_written((*pose[:3], *(sign * v for v in pose[3:])), cf)
    return _aggregate(type_, numbers, external_texts(like, waypoint.external))


def _axes_written(degrees: Iterable[float]) -> list[str]:
    return [real(float(angle), DEG_DECIMALS) for angle in degrees]


def _pose_written(pose: tuple[float, ...], cf: Configuration) -> list[str]:
    own = [*(real(v, MM_DECIMALS) for v in pose[:3]), *quaternion_texts(pose[3:])]
    return [*own, *(str(number) for number in (cf.cf1, cf.cf4, cf.cf6, cf.cfx))]


def _pose(waypoint: Waypoint) -> Float[np.ndarray, "4 4"]:
    assert waypoint.T is not None
    return waypoint.T


def meant_text(target: TargetArgument, texts: Texts) -> str:
    """An aggregate for a target, its numbers replaced where there are new ones."""
    meant = target.meant
    own = _axes_written(meant) if target.type == "jointtarget" else _pose_written(meant[:7], configuration(meant[7:]))
    numbers = [new if new is not None else old for new, old in zip(texts, own, strict=True)]
    return _aggregate(target.type, numbers, external_texts(target))


def external_texts(target: TargetArgument, positions: tuple[float, ...] = ()) -> list[str]:
    """The positions of external axes as they are written, or as they would be; or others, where these are numbers."""
    if target.literal is None:
        written = [real(v, MM_DECIMALS) for v in target.external]
    else:
        text = target.file.source.text
        written = [text[start:end] for start, end, _ in list(leaves(target.literal))[-6:]]
    return [
        own if new is None or np.isnan(new) or new == old else real(new, MM_DECIMALS)
        for own, old, new in zip_longest(written, target.external, positions)
    ]


_GROUPS: Mapping[TargetType, tuple[int, ...]] = {"robtarget": (3, 4, 4), "jointtarget": (6,)}
"""Numbers of the records in a target, before its external axes."""


def _aggregate(type_: TargetType, numbers: Iterable[str], external: Iterable[str]) -> str:
    coming = iter(numbers)
    groups = [*(tuple(islice(coming, count)) for count in _GROUPS[type_]), tuple(external)]
    return "[" + ",".join("[" + ",".join(group) + "]" for group in groups) + "]"


# Targets that several motions share: which can be rewritten as each of them needs, and which cannot.
#
# A motion in a routine that is given its target, or in a loop, stands for several motions with one text. What it is
# given can be changed where the call is, if nothing else reads it there; its own text only if all of its motions
# need the same.

Home = tuple[object, ...]
"""Where the numbers of a target stand."""

Datum = tuple[Symbol, tuple[int, ...] | None]
"""Data, or a component or element of them; None where it is not known which."""


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Want:
    """New numbers for a target argument of a motion."""

    number: int
    target: TargetArgument
    motion: Site
    texts: Texts

    @property
    def changes(self) -> bool:
        """Whether some number gets another text."""
        return any(text is not None for text in self.texts)

    @property
    def replaceable(self) -> bool:
        """Whether the name of another target may stand where this one's does, as far as the motion goes."""
        if self.target.passed is not None:
            return self.target.whole
        return self.motion.move.texts_motions == 1

    @property
    def is_carried(self) -> bool:
        """Whether its text stays, because several motions have it, and only what it shifts can change."""
        base = self.target.base
        return base is not None and not base.shifted and self.motion.move.texts_motions > 1

    @property
    def carrier(self) -> TargetArgument:
        """Target that it shifts."""
        assert self.target.base is not None
        return self.target.base

    @property
    def T(self) -> Float[np.ndarray, "4 4"]:
        """The pose that is wanted."""
        own = self.target.meant
        numbers = [old if text is None else float(text) for text, old in zip(self.texts, own, strict=True)]
        quaternion = np.array(numbers[3:7])
        return pose_of(tuple(numbers[:3]), tuple(quaternion / np.linalg.norm(quaternion)))

    @property
    def home(self) -> Home:
        """Place of its numbers."""
        return home_of(self.target)

    def agrees(self, other: "Want") -> bool:
        """Whether two want the same numbers."""
        return agree(self.target, self.texts, other.texts)


def _misses(want: Want, T_base: Float[np.ndarray, "4 4"], tolerance: float) -> str:
    """Why a target cannot go with the one that it shifts; empty where that brings it to where it should be."""
    T = want.target.carried(T_base)
    off = float(np.linalg.norm(T[:3, 3] - want.T[:3, 3]))
    turned = float(np.linalg.norm(se3.log(T[:3, :3].T @ want.T[:3, :3])))
    if off <= tolerance and turned <= MAX_SHARED_TURN_RAD:
        return ""
    return f"goes with the target that it shifts, and would be {off * 1e3:.3f} mm and {math.degrees(turned):.3f}° off"


def _targets(motion: Site) -> list[TargetArgument]:
    return [motion.end] if motion.via is None else [motion.end, motion.via]


def _stands_alone(motion: Site) -> bool:
    """Whether a motion has its text for itself, so that another name or other numbers may stand there."""
    return motion.move.texts_motions == 1 and all(
        target.passed is None and target.root.passed is None for target in _targets(motion)
    )


def _shared_place(target: TargetArgument) -> tuple[object, Home]:
    """Place of the numbers of a target, apart for each call that gives it."""
    return (target.argument if target.passed else None, home_of(target))


def _is_free(target: TargetArgument) -> bool:
    """Whether a target that motions shift may get other numbers in its declaration."""
    return target.passed is None and target.origin is not None and target.literal is not None and not target.shifted


def home_of(target: TargetArgument) -> Home:
    """Place of the numbers of a target."""
    if target.origin is not None:
        return (target.origin.symbol, target.origin.path)
    return (target.argument, target.literal, target.meant if target.literal is None else ())


def other_use(
    uses: Iterable[Use], path: tuple[int, ...], wants: Iterable[Want], goes_along: Callable[[Use], bool]
) -> Use | None:
    """Reference that reads a target beside the arguments that change and those that go with it."""
    changes = _within(want for want in wants if want.changes)
    return next((use for use in uses if use.overlaps(path) and not changes(use) and not goes_along(use)), None)


def _within(wants: Iterable[Want]) -> Callable[[Use], bool]:
    """Whether references stand in the arguments of some motions, none of which stands in another."""
    spans: dict[int, list[tuple[int, int]]] = defaultdict(list)
    for want in wants:
        spans[id(want.target.argument_file)].append((want.target.argument.start, want.target.argument.end))
    for own in spans.values():
        own.sort()

    def stands(use: Use) -> bool:
        own = spans.get(id(use.file), ())
        last = bisect_right(own, use.start, key=lambda span: span[0]) - 1
        return last >= 0 and use.start < own[last][1]

    return stands


def _read_too(what: str, use: Use | None) -> str:
    """Why numbers cannot change that something else reads; empty where nothing does."""
    return "" if use is None else f"{what} is read for something else in {use.file.source.place(use.start)}, too"


def _all_of(group: Iterable[Want], why: str) -> Iterator[tuple[int, str]]:
    return ((want.number, why) for want in group)


def _places(group: Iterable[Want]) -> str:
    places: dict[str, None] = {}
    for want in group:
        places[str(want.motion.move.place)] = None
        if want.target.passed is not None:
            places[str(want.target.argument_file.source.place(want.target.argument.start))] = None
    shown = list(places)[:4]
    return ", ".join(shown) + (" …" if len(places) > len(shown) else "")


MAX_NAME_LENGTH = 32
"""Characters of a name in RAPID."""

S4_NAME_LENGTH = 16
"""Characters of a name on S4 controllers; longer ones are made only for programs that have such."""

FLY_BY = "z0"
"""The finest zone without a stop."""


@dataclass(frozen=True, eq=False, kw_only=True)
class _Edits:
    """Edits by file."""

    by_path: dict[str, list[TextEdit]] = field(default_factory=dict[str, list[TextEdit]])

    def add(self, source: Source, start: int, end: int, text: str) -> None:
        self.by_path.setdefault(str(source.path), []).append(TextEdit(start=start, end=end, text=text))


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class RapidProgram(Program):
    """A program of one or several RAPID modules."""

    sites: tuple[Site, ...]
    """The moves with their text, in the same order."""
    uses: Mapping[Symbol, tuple[Use, ...]]
    """All references to declared data."""
    everywhere: tuple[Context, ...] = ()
    """Modules and routines."""
    unresolved: frozenset[Instruction] = frozenset()
    """Motions that were not resolved, on no way that leads to them."""
    shift: str = ""
    """As in `Settings`."""
    turns: Mapping[Loop, tuple[float, ...] | None] = field(default_factory=dict[Loop, tuple[float, ...] | None])
    """See `Flow.turns`."""
    begun: Mapping[Loop, tuple[float, ...] | None] = field(default_factory=dict[Loop, tuple[float, ...] | None])
    """See `Flow.begun`."""

    def rewrite(self, robot: Robot, waypoints: Paths) -> tuple[Source, ...]:
        """The program's files with some motions rewritten.

        Args:
            robot: the robot, whose joint positions decide the configuration data that are written.
            waypoints: by number of the motion.

        Raises:
            InputError: the robot has not six joints.
        """
        if len(robot.joint_names) != JOINTS:
            count = len(robot.joint_names)
            raise InputError(f"{robot.name} has {count} joints; a RAPID program of it is not written, only of six")
        edits = _Edits()
        ends: dict[TargetArgument, Waypoint] = {}
        numbers: dict[TargetArgument, int] = {}
        for number in sorted(waypoints):
            path, motion = waypoints[number], self.sites[number]
            own = _ends(motion, path[-1], robot, edits)
            ends |= own
            numbers |= dict.fromkeys(own, number)
            if len(path) > 1:
                _insert(motion, path[:-1], robot, edits)
        texts = new_texts(ends, robot)
        wants = [
            Want(number=number, target=target, motion=self.sites[number], texts=texts[target])
            for target, number in numbers.items()
        ]
        _write_targets([*wants, *_carriers(wants, ends, robot)], self.sources, self.uses, edits)
        return tuple(source.edited(edits.by_path.get(str(source.path), ())) for source in self.sources)

    def speed_edit(self, number: int, speed: float) -> tuple[int, TextEdit]:
        r"""The value of ``\V``, which takes the place of the speed's own; see `Program.speed_edit`.

        Raises:
            InputError: the instruction has no ``\V``.
        """
        site = self.sites[number]
        where, text = site.layout, real(speed * 1e3, MM_DECIMALS)
        file = next(i for i, source in enumerate(self.sources) if source.path == site.file.source.path)
        if (given := where.options.get("v")) is not None and given.value is not None:
            return file, TextEdit(start=given.value.start, end=given.value.end, text=text)
        if (name := site.instruction.name.text).lower() not in ("movej", "movel", "movec"):
            raise InputError(f"{site.move.place}: {name} takes no speed of its own; change its speed data")
        return file, TextEdit(start=where.speed.end, end=where.speed.end, text=f"\\V:={text}")

    def unwritable(self, robot: Robot, waypoints: Paths, tolerance: float) -> dict[int, str]:
        """Motions that cannot be rewritten as they should; see `Program.unwritable`."""
        sharing = self._sharing()
        ends: dict[TargetArgument, Waypoint] = {}
        for i in sharing:
            site, last = self.sites[i], waypoints[i][-1] if i in waypoints else None
            if last is not None and last.kind == site.move.kind:
                ends[site.end] = last
                if site.via is not None and last.via is not None:
                    ends[site.via] = last.via
        texts = new_texts(ends, robot)
        return reject_in_turn(waypoints, lambda rest: self._conflicts(rest, sharing, texts, tolerance))

    def motions_in(self, sources: tuple[Source, ...]) -> tuple[Motion, ...]:
        """The motions of other texts of the same files; see `Program.motions_in`."""
        found = _renumbered(self.sites, self.uses, self.sources, sources)
        return super().motions_in(sources) if found is None else found

    def least_worst(
        self, robot: Robot, waypoints: Paths, numbers: Collection[int], tolerance: float
    ) -> dict[int, tuple[Waypoint, ...]]:
        """One value where motions share their numbers; see `Program.least_worst`."""
        groups: dict[object, list[Shared]] = defaultdict(list)
        for i in self._sharing():
            site, target = self.sites[i], self.sites[i].end
            want = Want(number=i, target=target, motion=site, texts=())
            if target.type != "robtarget" or site.via is not None or (target.shifted and not want.is_carried):
                continue
            if want.is_carried:
                one, own = Shared(number=i, base=target.uncarried, target=target.carried), want.carrier
            else:
                one, own = Shared(number=i), target
            groups[_shared_place(own)].append(one)
        out: dict[int, tuple[Waypoint, ...]] = {}
        for group in groups.values():
            if any(one.number in numbers for one in group):
                out |= least_worst(group, waypoints, tolerance)
        return out

    def _sharing(self) -> list[int]:
        """Motions whose texts stand for several or are given by calls, and all that have a target in common with these."""
        others = [motion for motion in self.sites if not _stands_alone(motion)]
        homes = {
            home_of(one) for motion in others for target in _targets(motion) for one in (target, target.base or target)
        }
        return [
            i
            for i, motion in enumerate(self.sites)
            if homes and (not _stands_alone(motion) or any(home_of(target) in homes for target in _targets(motion)))
        ]

    def _conflicts(
        self,
        waypoints: Paths,
        sharing: Sequence[int],
        texts: Mapping[TargetArgument, Texts],
        tolerance: float,
    ) -> Iterator[tuple[int, str]]:
        for i in sharing:
            motion = self.sites[i]
            count = motion.move.texts_motions
            (*before, last) = waypoints.get(i, (None,))
            if count > 1 and (before or (last is not None and last.kind != motion.move.kind)):
                yield i, f"its text stands for {count} motions, and cannot become other ones for one of them"
        by_argument: dict[object, list[Want]] = defaultdict(list)
        by_home: dict[Home, list[Want]] = defaultdict(list)
        carried: list[Want] = []
        for i, target in ((k, target) for k in sharing for target in _targets(self.sites[k])):
            new = (texts.get(target) if i in waypoints else None) or (None,) * len(target.meant)
            want = Want(number=i, target=target, motion=self.sites[i], texts=new)
            if want.is_carried:
                carried.append(want)
            else:
                by_argument[target.argument].append(want)
                by_home[want.home].append(want)
        followed, lost = self._carried(carried, by_home, tolerance)
        yield from lost
        replaced = _within(
            want
            for group in by_argument.values()
            for want in group
            if want.changes
            and want.target.origin is None
            and want.target.shifted
            and want.target.root.passed is not None
        )
        going: dict[object, list[Want]] = defaultdict(list)
        for want in followed:
            going[want.carrier.argument].append(want)
            going[home_of(want.carrier)].append(want)
        for argument, group in by_argument.items():
            yield from self._in_argument(group, going.get(argument, ()), replaced)
        for home, group in by_home.items():
            yield from self._of_home(group, going.get(home, ()))

    def _carried(
        self, carried: Sequence[Want], by_home: Mapping[Home, Sequence[Want]], tolerance: float
    ) -> tuple[list[Want], list[tuple[int, str]]]:
        """Targets that go with those that they shift: those that come to where they should be, and why others cannot."""
        followed: list[Want] = []
        lost: list[tuple[int, str]] = []
        stuck: set[tuple[object, Home]] = set()
        # those whose target no motion goes to itself, which may be anywhere
        alone: dict[tuple[object, Home], list[Want]] = defaultdict(list)
        for want in carried:
            base = want.carrier
            direct = [w for w in by_home.get(home_of(base), ()) if w.changes and not w.target.shifted]
            if base.passed is not None:
                direct = [w for w in direct if w.target.argument is base.argument]
            if not direct and _is_free(base):
                alone[_shared_place(base)].append(want)
            elif why := _misses(want, direct[0].T if direct else base.T, tolerance):
                lost.append((want.number, why))
                stuck.add(_shared_place(base))
            else:
                followed.append(want)
        for group in alone.values():
            if not any(want.changes for want in group):
                continue
            T_base, origin = group[0].target.uncarried(group[0].T), group[0].carrier.origin
            assert origin is not None
            other = other_use(self.uses.get(origin.symbol, ()), origin.path, (), _within(group))
            whys = (_misses(want, T_base, WANTED_TOLERANCE_MM / 1e3) for want in group)
            why = next(filter(None, whys), "") or _read_too(f"its target {origin.name}", other)
            lost += _all_of(group, why) if why else ()
            followed += () if why else group
        return [want for want in followed if _shared_place(want.carrier) not in stuck], lost

    def _in_argument(
        self, group: Sequence[Want], going: Iterable[Want], replaced: Callable[[Use], bool]
    ) -> Iterator[tuple[int, str]]:
        """Motions that get their targets from one argument, each target from one place.

        What reads a parameter in text that numbers take the place of reads it no longer.
        """
        if not any(want.changes for want in group):
            return
        of_home: dict[Home, list[Want]] = defaultdict(list)
        for want in group:
            of_home[want.home].append(want)
        for same in of_home.values():
            if not all(want.agrees(same[0]) for want in same[1:]):
                yield from _all_of(same, f"has its target in common with {_places(same)}, which need other numbers")
        first = group[0]
        computed = first.target.literal is None or first.target.shifted
        if computed and len({want.number for want in group}) > 1 and len(of_home) > 1:
            count = first.motion.move.texts_motions
            yield from _all_of(group, f"its text stands for {count} motions to different places")
        elif first.target.passed is not None:
            why = _read_too("what the call gives it", self._other_reading(group, going, replaced))
            yield from _all_of(group, why) if why else ()

    def _other_reading(
        self, group: Sequence[Want], going: Iterable[Want], replaced: Callable[[Use], bool]
    ) -> Use | None:
        """Reference that reads a parameter beside the motions that go to it."""
        known = {(want.motion.file, want.target.read_at) for want in going}
        parameters: dict[Symbol, None] = {}
        for want in group:
            if (passed := want.target.passed) is not None:
                known |= {*passed.reads, (want.motion.file, want.target.read_at)}
                parameters |= dict.fromkeys(passed.parameters)
        uses = (use for symbol in parameters for use in self.uses.get(symbol, ()))
        return next((use for use in uses if (use.file, use.start) not in known and not replaced(use)), None)

    def _of_home(self, group: Sequence[Want], going: Iterable[Want]) -> Iterator[tuple[int, str]]:
        """Motions whose targets stand in one declaration, which is what has to change where no copy can be named."""
        fixed = [want for want in group if not want.replaceable and want.changes]
        origin = fixed[0].target.origin if fixed else None
        if origin is None:
            return
        first, why = fixed[0], ""
        if not all(want.agrees(first) for want in fixed):
            why = f"has its target in common with {_places(fixed)}, which need other numbers"
        elif first.target.literal is None or any(want.target.shifted for want in fixed):
            why = f"its text stands for {first.motion.move.texts_motions} motions, which need different ones"
        else:
            changed = [want for want in group if want.changes and (want.replaceable or want.agrees(first))]
            other = other_use(self.uses.get(origin.symbol, ()), origin.path, changed, _within(going))
            why = _read_too(f"its target {origin.name}", other)
        yield from _all_of(fixed, why) if why else ()

    def written_out(self, numbers: Collection[int]) -> tuple[Source, ...] | None:
        """The program's files with shared text written out; see `Program.written_out`."""
        shared = {self.sites[i].instruction for i in numbers}
        routines = {context.routine: context for context in self.everywhere if context.routine is not None}
        calls: dict[Routine, list[tuple[Instruction, Routine]]] = defaultdict(list)
        for routine, context in routines.items():
            for line in routine.lines:
                if isinstance(line, Instruction):
                    for other in context.scope.routines.get(line.name.key, ()):
                        calls[other].append((line, routine))
        texts = [(line, routine) for routine in routines for line in routine.lines if line in shared]
        reached = reaching(texts, calls)
        turns = (
            (context.file.source, loop)
            for routine, context in routines.items()
            for loop in _turns_of(routine, context.file.source, self.turns, reached.__contains__)
        )
        return written_out(self.sources, turns, _repeated(routines, calls, {r for _, r in texts}), self._fresh_names())

    def _fresh_names(self) -> FreshNames:
        words = (token.key for source in self.sources for token in tokenize(source.text) if token.kind == "name")
        return FreshNames(words, longest=MAX_NAME_LENGTH, usual=S4_NAME_LENGTH, reserved=RESERVED | set(DATA))

    def tabled(self, numbers: Collection[int]) -> tuple[Source, ...] | None:
        """The program's files with targets of loops in arrays; see `Program.tabled`."""
        own: dict[Instruction, list[int]] = defaultdict(list)
        for i, site in enumerate(self.sites):
            own[site.instruction].append(i)
        shared, fresh = {self.sites[i].instruction for i in numbers}, self._fresh_names()
        of_table: dict[Table, Context] = {}
        for context in self.everywhere:
            if context.routine is None:
                continue

            def listable(line: Instruction, file: File = context.file) -> Sequence[int]:
                same = own[line] if line in shared else ()
                return same if all(_is_listable(self.sites[i], file) for i in same) else ()

            counter = lambda loop: "" if loop.line.counter is None else loop.line.counter.text  # noqa: E731
            of_table |= dict.fromkeys(tables(context.routine.nodes, listable, self.begun, counter), context)
        named: dict[Path, dict[tuple[int, int], str]] = defaultdict(lambda: defaultdict(str))
        for one in of_whole_paths(tuple(of_table), numbers, self.visits()):
            routine, source = of_table[one].routine, of_table[one].file.source
            assert routine is not None
            ends = [self.sites[i].end for i in one.numbers]
            name, newline = fresh.nearest(TABLE), source.newline + source.indent(routine.start) + "  "
            elements = _listed([meant_text(end, (None,) * len(end.meant)) for end in ends], one.size, newline)
            at, size = _behind_header(routine, source.text), ",".join(map(str, one.size))
            named[source.path][at, at] += f"{newline}CONST robtarget {name}{{{size}}}:={elements};"
            named[source.path][ends[0].argument.start, ends[0].argument.end] = f"{name}{{{one.index(' DIV ')}}}"
        sources = with_texts(self.sources, named, fresh) if named else None
        return sources if sources and same_motions(self.motions, self.reread(sources).motions) else None

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
        if added is not None and any(function.lower() in context.scope.routines for context in self.everywhere):
            raise InputError(f"{self.sources[0].path}: has a function {function} already")
        staying = {site.instruction for i, site in enumerate(self.sites) if i not in rejected}
        motions = self.unresolved | {site.instruction for site in self.sites}.difference(staying)

        def cleared(again: RapidProgram) -> tuple[RapidProgram, set[Place]]:
            having = {
                context.file.source.place(line.start)
                for context in again.everywhere
                for line in context.lines
                if isinstance(line, Instruction) and calls_function(line, function)
            }
            left = (one for one in again.unresolved if not calls_function(one, function))
            return replace(again, unresolved=frozenset(left)), having

        return wrapping(self, wrap(self.everywhere, motions, function, without, self.shift), added, cleared)

    def visits(self) -> Iterator[Visit]:
        """Motions of one routine to one target in one tool and work object; see `Program.visits`.

        A motion goes to the target that it names or shifts, and to those from which a variable was set last that it names.
        """
        numbers: dict[Instruction, list[int]] = defaultdict(list)
        for i, site in enumerate(self.sites):
            numbers[site.instruction].append(i)
        read: dict[int, list[tuple[int, Datum]]] = defaultdict(list)
        for symbol, use in ((symbol, use) for symbol, own in self.uses.items() for use in own):
            if use.type in ("robtarget", "jointtarget"):
                read[id(use.file)].append((use.start, (symbol, use.path)))
        for own in read.values():
            own.sort(key=lambda one: one[0])
        for context in self.everywhere:
            if context.routine is not None:
                yield from _visits(context.routine, self._stops(context, numbers, read[id(context.file)]))

    def _stops(
        self, context: Context, numbers: Mapping[Instruction, Sequence[int]], read: Sequence[tuple[int, Datum]]
    ) -> "Iterator[_Stop]":
        """Motions of a routine in the order of the text, given the targets that its file reads, in order, too."""
        starts, source = [start for start, _ in read], context.file.source
        made_of: dict[Symbol, frozenset[Datum]] = {}
        times: Counter[Symbol] = Counter()

        def named(nodes: Iterable[Node]) -> frozenset[Datum]:
            spans = (slice(bisect_left(starts, node.start), bisect_left(starts, node.end)) for node in nodes)
            return frozenset(datum for span in spans for _, datum in read[span])

        for line in context.lines:
            if isinstance(line, Assignment) and not line.target.selectors:
                own = named([line.value])
                for symbol, _ in named([line.target]):
                    times[symbol] += symbol not in {one for one, _ in own}
                    made_of[symbol] = own.union(*(made_of.get(one, ()) for one, _ in own))
            if not isinstance(line, Instruction):
                continue
            for i in (*((None,) if line in self.unresolved else ()), *numbers.get(line, ())):
                site = None if i is None else self.sites[i]
                data = named(line.arguments if site is None else filter(None, target_arguments(line)))
                if site is not None and not data:
                    continue  # numbers alone are shared with no other motion
                data = data.union(*(made_of.get(symbol, ()) for symbol, _ in data))
                given, frames = None, [a for a in line.arguments if a.option == "wobj"]
                frames += [a for a in line.arguments if not a.option] if site is None else [site.layout.tool]
                if site is not None:
                    origin, passed = site.end.root.origin, site.end.root.passed
                    given = None if passed is None else passed.argument
                    if origin is not None:  # the index of an element is known, which the text may not state
                        data = {(s, origin.path if path is None and s is origin.symbol else path) for s, path in data}
                yield _Stop(
                    number=i, given=given, place=source.place(line.start),
                    data=frozenset((symbol, path, times[symbol]) for symbol, path in data),
                    frames=frozenset(source.text[a.start : a.end].lower() for a in frames),
                )  # fmt: skip


class _Stop(NamedTuple):
    """A motion of a routine, with data of which its targets are made."""

    number: int | None
    """None of one that was not resolved."""
    data: frozenset[tuple[Symbol, tuple[int, ...] | None, int]]
    """Each with how often it was set as a whole before: what it held then is no target of this one."""
    frames: frozenset[str]
    """Its tool and work object as they are written; of one that is not read all that it is given."""
    given: Argument | None
    """What a parameter that it goes to was given; None where it goes to none, or that is not known."""
    place: Place


def _visits(routine: Routine, stops: Iterable[_Stop]) -> Iterator[Visit]:
    by_datum: dict[object, list[_Stop]] = defaultdict(list)
    for stop in stops:
        for datum in stop.data:
            by_datum[datum].append(stop)
    for datum, group in by_datum.items():
        kinds = dict.fromkeys((stop.frames, stop.given) for stop in group if stop.number is not None)
        for stop in group:
            # what is given by a call is of no other kind: compared with all, they would take time by their square
            for frames, given in kinds if stop.given is None else ((stop.frames, stop.given),):
                if stop.frames == frames if stop.number is not None else stop.frames >= frames:
                    yield Visit(number=stop.number, target=(routine, datum, frames, given), place=stop.place)


# Loops written turn by turn, and routines for each of their calls.


def _turns_of(
    routine: Routine,
    source: Source,
    turns: Mapping[Loop, tuple[float, ...] | None],
    is_shared: Callable[[Line], bool],
) -> Iterator[Turns]:
    """Loops of a routine around some lines that can be written turn by turn."""
    text = source.text

    def named(loop: Loop) -> list[tuple[int, int]]:
        """Places at which a loop names its counter."""
        line: Control = loop.line
        if line.counter is None:
            return []
        own = [token for token in words_from(text, line.start) if token.start < line.end]
        return [
            (token.start, token.start + len(token.text))
            for before, token in pairwise(own)
            if token.kind == "name" and token.key == line.counter.key and before.key not in (".", "\\")
        ]

    for loop, taken in loops_to_write(
        routine.nodes, turns, is_shared, lambda loop: loop.kind == "while" or len(named(loop)) > 1
    ):
        line: Control = loop.line
        own = [token for token in words_from(text, line.conditions[-1].end) if token.start < line.end]
        closing = own[-1]
        odd = any(isinstance(one, Label | Unparsed) for one in lines_in(loop.body))
        hidden = any(
            isinstance(one, Control) and one.counter is not None and line.counter is not None
            and one.counter.key == line.counter.key for one in lines_in(loop.body)
        )  # fmt: skip
        declares = any(line.start < one.start < line.end for one in routine.declarations)
        asks = any(isinstance(part, Call) for one in line.conditions for part in parts(one))  # which may do more
        if odd or hidden or declares or asks or closing.key not in ("endfor", "endwhile"):
            continue
        begins, ends = own[0].start + len(own[0].text), closing.start
        ends = begins + len(text[begins:ends].rstrip())
        rest, newline = text[begins : text.find("\n", begins)].strip(), source.newline + source.indent(line.start)
        apart = "" if not rest or rest.startswith("!") else newline
        counts = [real(count, COUNT_DECIMALS) for count in taken]
        what = "turn" if line.counter is None else line.counter.text
        heads = [
            f"! {what} {k + 1} of {len(counts)}" if line.counter is None else f"! {what} = {own}"
            for k, own in enumerate(counts)
        ]
        behind = text[line.end : text.find("\n", line.end)].strip()
        yield Turns(
            start=line.start,
            end=line.end,
            body=(begins, ends),
            before=tuple(f"{newline if k else ''}{head}{apart}" for k, head in enumerate(heads)),
            after=newline if behind and not behind.startswith("!") else "",
            named=tuple(
                {at: f"({count})" if count.startswith("-") else count for at in named(loop) if at[0] > begins}
                for count in counts
            ),
        )


COUNT_DECIMALS = 9
"""Of a counter."""

TABLE = "TaskcalTargets"
"""Name of an array of targets, an element for each turn of a loop."""


def _is_listable(site: Site, file: File) -> bool:
    """Whether an array in a routine of a file may hold the target of a motion."""
    end, here = site.end, site.end.argument_file is file
    return here and site.via is None and end.type == "robtarget" and not (end.passed or end.root.passed)


def _listed(elements: Sequence[str], sizes: Sequence[int], newline: str) -> str:
    """An array, each element in a line of its own."""
    if len(sizes) == 1:
        return "[" + ",".join(f"{newline}  {one}" for one in elements) + "]"
    inner = len(elements) // sizes[0]
    rows = (_listed(elements[k : k + inner], sizes[1:], newline) for k in range(0, len(elements), inner))
    return "[" + ",".join(rows) + "]"


def _behind_header(routine: Routine, text: str) -> int:
    """Place in front of what a routine declares: the end of its header's line, or of its header where more stands there."""
    at = routine.name.end
    if text[at : routine.end].lstrip().startswith("("):
        at = text.index(")", at) + 1
    line_end = text.find("\n", at)
    rest = text[at:line_end].strip()
    return at if rest and not rest.startswith("!") else at + len(text[at:line_end].rstrip("\r"))


def _repeated(
    routines: Mapping[Routine, Context],
    calls: Mapping[Routine, Sequence[tuple[Instruction, Routine]]],
    shared: Container[Routine],
) -> Iterator[Repeated]:
    """Procedures with shared lines, of which each call but the first gets a copy."""
    for routine, context in routines.items():
        own = calls.get(routine, ())
        alone = len(context.scope.routines[routine.name.key]) == 1
        if routine in shared and routine.kind == "proc" and alone and all(by is not routine for _, by in own):
            source = context.file.source
            yield Repeated(
                source=source, at=routine.end, before=source.newline * 2 + source.indent(routine.start),
                span=(routine.start, routine.end), name=(routine.name.start, routine.name.end),
                calls=tuple((routines[by].file.source, (line.name.start, line.name.end)) for line, by in own[1:]),
            )  # fmt: skip


# The motions of texts that differ in numbers alone, as those do that were corrected without a further target.


def _renumbered(
    sites: Sequence[Site], uses: Mapping[Symbol, tuple[Use, ...]], before: Sequence[Source], after: Sequence[Source]
) -> tuple[Motion, ...] | None:
    """Motions of texts in which targets have other numbers; None where anything else differs, or may depend on these numbers."""
    if [source.path for source in before] != [source.path for source in after]:
        return None
    written: dict[str, list[Aggregate]] = defaultdict(list)
    for literal, file in _read_by_motions_alone(sites, uses).items():
        written[str(file.source.path)].append(literal)
    changed: dict[Aggregate, Aggregate] = {}
    for old, new in zip(before, after, strict=True):
        pairs = _new_numbers(old.text, new.text, sorted(written[str(old.path)], key=lambda literal: literal.start))
        if pairs is None:
            return None
        changed |= pairs
    targets = [
        t for site in sites for t in _targets(site) if t.literal in changed and t.passed is None and not t.shifted
    ]
    try:
        again = {target: renumbered_target(target, changed[target.literal]) for target in targets if target.literal}
    except Unresolved:
        return None
    poses = dict(zip(again, poses_of([*again.values()]), strict=True))
    return tuple(
        _with_targets(site, again, poses) if site.end in again or site.via in again else site.move for site in sites
    )


def _with_targets(
    site: Site,
    again: Mapping[TargetArgument, TargetArgument],
    poses: Mapping[TargetArgument, Float[np.ndarray, "4 4"] | None],
) -> Motion:

    def target(old: TargetArgument, said: Target) -> Target:
        if old not in again:
            return said
        return again[old].target(poses[old], site.move.place, said.posture is not None, said.posture_binds)

    end, via = target(site.end, site.move.end), site.move.via
    if via is not None and site.via is not None:
        via = target(site.via, via)
    return replace(site.move, end=end, via=via, external=axes_of(again.get(site.end, site.end).external))


def _read_by_motions_alone(sites: Sequence[Site], uses: Mapping[Symbol, tuple[Use, ...]]) -> dict[Aggregate, File]:
    """Lists of numbers that say where motions lead, and nothing else."""
    found: dict[Aggregate, File] = {}
    declared: dict[Symbol, list[TargetArgument]] = defaultdict(list)
    for target in (target for site in sites for target in _targets(site)):
        if target.literal is None or not target.literal.is_literal or target.shifted or target.passed is not None:
            continue
        if target.origin is None:
            found[target.literal] = target.file
        elif not target.origin.path:
            declared[target.origin.symbol].append(target)
    for symbol, own in declared.items():
        named = {(target.argument_file, target.argument.start) for target in own}
        if all((use.file, use.start) in named for use in uses[symbol]):
            found |= {target.literal: target.file for target in own if target.literal is not None}
    return found


def _new_numbers(before: str, after: str, literals: Iterable[Aggregate]) -> dict[Aggregate, Aggregate] | None:
    """Those of some lists in a text that have other numbers in another text; None where more differs than these."""
    changed: dict[Aggregate, Aggregate] = {}
    old = new = 0
    for literal in literals:
        start = new + literal.start - old
        end = list_end(after, start)
        if not end or before[old : literal.start] != after[new:start]:
            return None
        if before[literal.start : literal.end] != after[start:end]:
            changed[literal] = Aggregate(start=start, end=end, content=after)
            if before.count("\n", literal.start, literal.end) != after.count("\n", start, end):
                return None
        old, new = literal.end, end
    return changed if before[old:] == after[new:] else None


def _type(kind: MotionKind) -> TargetType:
    return "jointtarget" if kind == "axes" else "robtarget"


def _ends(motion: Site, waypoint: Waypoint, robot: Robot, edits: _Edits) -> Ends:
    """Edit the instruction's name and arguments as the kind of its last waypoint needs; the numbers are left to do."""
    kind, ends = waypoint.kind, dict[TargetArgument, Waypoint]()
    if kind == motion.move.kind:
        own = [] if motion.via is None else [(motion.via, _via(waypoint))]
        return dict([*own, (motion.end, waypoint)])
    where, source, name = motion.layout, motion.file.source, motion.instruction.name
    edits.add(source, name.start, name.end, _name(motion, kind))
    if where.via is not None:
        edits.add(source, where.via.start, where.to.start, "")
    elif kind == "circular":
        via = fresh_text("robtarget", _via(waypoint), robot, motion.end)
        edits.add(source, where.to.start, where.to.start, f"{via},")
    if _type(kind) == motion.end.type:
        ends[motion.end] = waypoint
    else:
        edits.add(source, where.to.start, where.behind_to, fresh_text(_type(kind), waypoint, robot, motion.end))
    return ends


def _name(motion: Site, kind: MotionKind) -> str:
    """The instruction of another kind of motion that is given the same.

    Raises:
        InputError: there is none.
    """
    if NAMES[kind].lower() in motion.redefined:
        raise InputError(f"{motion.move.place}: cannot become a {NAMES[kind]}, which is a routine of the program's own")
    if motion.instruction.name.key in ("movej", "movel", "movec", "moveabsj"):
        return NAMES[kind]
    raise InputError(f"{motion.move.place}: {motion.instruction.name.text} is not written as another kind of motion")


def _via(waypoint: Waypoint) -> Waypoint:
    assert waypoint.via is not None
    return waypoint.via


def _insert(motion: Site, path: Iterable[Waypoint], robot: Robot, edits: _Edits) -> None:
    r"""Write motions in front of an instruction, with its own arguments.

    They pass by in its zone, or where it stops in the finest zone. \Conc is left to the last one, since the controller
    allows only few of them in a row.
    """
    where, source, instruction = motion.layout, motion.file.source, motion.instruction
    text, newline = source.text, source.newline
    indent = source.indent(instruction.start)
    options = text[where.to.end : where.behind_to]
    if motion.move.stops and where.zone is not None:
        rest = f"{text[where.behind_to : where.zone.start]}{FLY_BY}{text[where.behind_zone : instruction.end]}"
    else:
        rest = text[where.behind_to : instruction.end]
    before: list[str] = []
    for waypoint in path:
        kind = waypoint.kind
        name = instruction.name.text if kind == motion.move.kind else _name(motion, kind)
        target = fresh_text(_type(kind), waypoint, robot, motion.end)
        if kind == "circular":
            target = f"{fresh_text('robtarget', _via(waypoint), robot, motion.end)},{target}"
        before.append(f"{name} {target}{options if kind == 'axes' else ''}{rest}{newline}{indent}")
    if instruction.compact:
        inner = f"{newline}{indent}  "
        edits.add(
            source,
            instruction.start,
            instruction.start,
            "THEN" + inner + inner.join(b.rstrip() for b in before) + inner,
        )
        edits.add(source, instruction.end, instruction.end, f"{newline}{indent}ENDIF")
    else:
        edits.add(source, instruction.start, instruction.start, "".join(before))


def _carriers(wants: Sequence[Want], ends: Ends, robot: Robot) -> Iterator[Want]:
    """New numbers of targets that motions shift, and to which none goes itself."""
    direct = {want.home for want in wants if not want.is_carried and not want.target.shifted}
    seen: set[Home] = set()
    for want in wants:
        base = want.carrier if want.is_carried else None
        if base is None or not _is_free(base) or home_of(base) in direct | seen or not want.changes:
            continue
        seen.add(home_of(base))
        texts = new_texts({base: replace(ends[want.target], T=want.target.uncarried(want.T))}, robot)[base]
        yield replace(want, target=base, texts=(*texts[:POSE_NUMBERS], *[None] * (len(texts) - POSE_NUMBERS)))


POSE_NUMBERS = 7
"""Of a target: position and quaternion; then its configuration, which stays that of the shifted target."""


def _write_targets(
    wants: Sequence[Want], sources: Sequence[Source], uses: Mapping[Symbol, tuple[Use, ...]], edits: _Edits
) -> None:
    """Put the numbers where they belong: into the argument, into the declaration, or into clones of the declaration."""
    declared: dict[tuple[Symbol, tuple[int, ...]], list[Want]] = {}
    once: dict[tuple[object, ...], Want] = {}  # several motions may have one target from one argument
    followed = _within(want for want in wants if want.is_carried)  # their text stays: they go with what they shift
    for want in wants:
        if not want.is_carried:
            once.setdefault((want.target.argument, want.home), want)
    for want in once.values():
        if want.target.origin is not None:
            declared.setdefault((want.target.origin.symbol, want.target.origin.path), []).append(want)
        elif want.changes:
            if want.target.literal is not None and not want.target.shifted:
                _edit_numbers(want, edits)
            else:
                _replace_argument(want, meant_text(want.target, want.texts), edits)
    words = (token.key for source in sources for token in tokenize(source.text) if token.kind == "name")
    fresh = FreshNames(words, longest=MAX_NAME_LENGTH, usual=S4_NAME_LENGTH, reserved=RESERVED | set(DATA))
    for (symbol, path), group in declared.items():
        _write_declared(group, other_use(uses.get(symbol, ()), path, group, followed) is not None, fresh, edits)


def _replace_argument(want: Want, text: str, edits: _Edits) -> None:
    edits.add(want.target.argument_file.source, want.target.argument.start, want.target.argument.end, text)


def _edit_numbers(want: Want, edits: _Edits) -> None:
    if want.target.literal is None:
        return
    edits.add(want.target.file.source, want.target.literal.start, want.target.literal.end, _clone_text(want))


def _write_declared(group: Sequence[Want], others: bool, fresh: FreshNames, edits: _Edits) -> None:
    """Write the numbers of a declared target.

    The declaration takes those of most motions where nothing else reads it. Other motions, and those that shift it by Offs or
    RelTool, get clones.
    """
    kept: Texts | None = None
    direct = [want for want in group if not want.target.shifted and want.target.literal is not None]
    if direct and not others:
        fixed = [want for want in direct if not want.replaceable and want.changes]
        kept = Counter(want.texts for want in fixed or direct).most_common(1)[0][0]
        _edit_numbers(next(want for want in direct if want.texts == kept), edits)
    clones: dict[str, str] = {}
    for want in group:
        if not want.changes or (want in direct and want.texts == kept):
            continue
        value = _clone_text(want)
        if value not in clones:
            clones[value] = _clone(want, value, fresh, edits)
        _replace_argument(want, clones[value], edits)


def _clone_text(want: Want) -> str:
    """The value of a clone, in the style of the declaration where that writes its numbers out."""
    target = want.target
    if target.literal is None or target.shifted:
        return meant_text(target, want.texts)
    start, text = target.literal.start, target.file.source.text
    if target.literal.is_literal:
        pieces = text[start : target.literal.end].split(",")
        own = [
            piece if new is None else LISTED.sub(new, piece, 1) for piece, new in zip(pieces, want.texts, strict=False)
        ]
        return ",".join([*own, *pieces[len(own) :]])
    parts: list[str] = []
    for new, (first, end, _) in zip(want.texts, leaves(target.literal), strict=False):
        if new is not None:
            parts += [text[start:first], new]
            start = end
    return "".join([*parts, text[start : target.literal.end]])


def _clone(want: Want, value: str, fresh: FreshNames, edits: _Edits) -> str:
    """Declare a clone of a target behind it, and say its name."""
    origin = want.target.origin
    assert origin is not None
    assert origin.symbol.declaration is not None
    assert origin.symbol.file is not None
    declaration, source = origin.symbol.declaration, origin.symbol.file.source
    name = fresh.like(origin.symbol.name)
    text = source.text
    storage = text[declaration.start : declaration.type.start]
    type_ = declaration.type.text if declaration.type.key == want.target.type else want.target.type
    assigns = ":="
    if declaration.value is not None and not declaration.dimensions:
        assigns = text[declaration.name.end : declaration.value.start]
    at, before = _behind(declaration, source)
    edits.add(source, at, at, f"{before}{storage}{type_} {name}{assigns}{value};")
    return name


def _behind(declaration: Declaration, source: Source) -> tuple[int, str]:
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
        type_, letter, numbers = "jointtarget", "j", _axes_written(np.degrees(target.q))
    elif target.T is not None:
        type_, letter = "robtarget", "p"
        numbers = _pose_written(pose_numbers(target.T), _configuration(target, q, number, robot))
    else:
        raise InputError(f"motion {number} is given neither a pose nor joint positions")
    value = _aggregate(type_, numbers, NO_AXES)
    return declared.name((type_, value), f"CONST {type_}", f"{letter}{10 * (number + 1)}", value)


def _configuration(target: Target, q: Float[np.ndarray, " joints"] | None, number: int, robot: Robot) -> Configuration:
    if q is not None:
        return Configuration.of(robot, q)
    if isinstance(target.posture, Configuration):
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
