"""Motions that share their text, in a loop or in a routine with several calls: which can be rewritten as each of them needs.

A text that goes to elements of an array by a computed index leaves it to the elements, which get their numbers in the data list.
Any other text can only be rewritten if all of its motions need the same.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from taskcal.programs.krl.data_lists import Datum, File
from taskcal.programs.krl.rewrite import Site, Written, mentions_of, stays, values_at
from taskcal.programs.krl.syntax import Assignment, Begin, Motion, Reference, Statement
from taskcal.programs.program import Move, Visit, Waypoint
from taskcal.programs.source import Place
from taskcal.programs.unwritable import reject_in_turn
from taskcal.robot.robot import Robot

SAME = 2e-5
"""Millimetres and degrees that differ by less are written alike."""

Values = tuple[dict[str, float] | None, ...]
"""New numbers for the points of a motion; None for those that stay."""


def in_data_list(
    sites: Sequence[Site], moves: Sequence[Move], waypoints: Mapping[int, tuple[Waypoint, ...]]
) -> frozenset[int]:
    """Numbers of motions whose points get their numbers in the data list.

    They go to elements of arrays of the program's own to which a text leads that stands for several motions.
    """
    arrays = [_arrays(site) for site in sites]
    shared = frozenset[str]().union(*(own for own, move in zip(arrays, moves, strict=True) if move.texts_motions > 1))
    return frozenset(
        i
        for i, (own, move) in enumerate(zip(arrays, moves, strict=True))
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
    moves: Sequence[Move]
    robot: Robot

    def unwritable(self, waypoints: Mapping[int, tuple[Waypoint, ...]]) -> dict[int, str]:
        """Motions that cannot be rewritten as they should, by number, and why."""
        return reject_in_turn(waypoints, self._conflicts)

    def _conflicts(self, waypoints: Mapping[int, tuple[Waypoint, ...]]) -> Iterator[tuple[int, str]]:
        texts: dict[tuple[int, int], list[int]] = defaultdict(list)
        elements = in_data_list(self.sites, self.moves, waypoints)
        for i, (site, move) in enumerate(zip(self.sites, self.moves, strict=True)):
            if move.texts_motions == 1:
                continue
            yield from self._alone(i, waypoints)
            if i not in elements:
                texts[site.text].append(i)
        for group in texts.values():
            yield from self._of_text(group, waypoints)
        yield from self._of_elements(sorted(elements), waypoints)

    def _alone(self, i: int, waypoints: Mapping[int, tuple[Waypoint, ...]]) -> Iterator[tuple[int, str]]:
        """What one of several motions of a text cannot become, and what it keeps others from."""
        site, move = self.sites[i], self.moves[i]
        path = waypoints.get(i)
        if path is not None and stays(move, path):
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
            np.asarray(end.T if end.T is not None else end.q).tobytes() for end in (self.moves[i].end for i in group)
        }
        count = self.moves[group[0]].texts_motions
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
                places = ", ".join(dict.fromkeys(str(self.moves[i].place) for i, _ in wants))
                why = f"has its target {data[key].name} in common with {places}, which need other numbers"
                yield from ((i, why) for i in changing)

    def _other_reading(self, datum: Datum, own: set[tuple[int, int]]) -> Place | None:
        """Where code names an array beside the motions that go to its elements."""
        array = datum.name.partition("[")[0]
        for file, position in mentions_of(array, self.sites, datum.file.module):
            if not file.holds_data and (file.number, position) not in own:
                return file.source.place(position)
        return None

    def _wanted(self, i: int, path: tuple[Waypoint, ...] | None) -> Values:
        site = self.sites[i]
        if path is None or stays(self.moves[i], path):
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
        elif any(abs(a[name] - b[name]) > SAME for name in a):
            return False
    return True


def visits_of(sites: Sequence[Site], moves: Sequence[Move], files: Iterable[File]) -> Iterator[Visit]:
    """Motions of one routine that name one point, or a variable that was last set by it, and those that lean on each other."""
    numbers: dict[tuple[int, int], list[int]] = defaultdict(list)
    for i, site in enumerate(sites):
        numbers[site.text].append(i)
    for file in files:
        for lines in _routines(file):
            points = {name for line in lines if isinstance(line, Motion) for name in _named(line)}
            sets: dict[str, frozenset[str]] = {}
            for line in lines:
                if isinstance(line, Assignment) and not line.component:
                    named = frozenset(points.intersection(word.upper for word in line.words)) - {line.name}
                    sets[line.name] = named.union(*(sets.get(name, ()) for name in named))
                elif isinstance(line, Motion):
                    named = frozenset(_named(line))
                    for name in named.union(*(sets.get(name, ()) for name in named)):
                        for i in numbers.get((file.number, line.start), (None,)):
                            target = (file.number, lines[0].start, name)
                            yield Visit(number=i, target=target, place=file.source.place(line.start))
    for i, site in enumerate(sites):
        for number in (i, *site.before) if site.leans else ():
            yield Visit(number=number, target=i, place=moves[number].place)


def _routines(file: File) -> Iterator[list[Statement]]:
    """The lines of each routine of a file."""
    lines: list[Statement] = []
    for line in file.statements:
        if isinstance(line, Begin) and lines:
            yield lines
            lines = []
        lines.append(line)
    if lines:
        yield lines


def _named(motion: Motion) -> Iterator[str]:
    """Variables in the points of a motion."""
    for operand in motion.operands:
        yield from (part.name for part in operand.parts if isinstance(part, Reference))
