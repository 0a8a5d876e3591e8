"""New numbers for the points of a KRL program, in the places where it states them."""

import re
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import isnan

import numpy as np

from taskcal.programs.fresh_names import FreshNames
from taskcal.programs.krl.data_lists import Datum, File
from taskcal.programs.krl.lexer import lines_of_words
from taskcal.programs.krl.position import AXES, EXTERNAL, axis_values, edits_for, has_axes, has_pose, pose_values, whole
from taskcal.programs.krl.status import Status
from taskcal.programs.krl.syntax import Aggregate, Motion, Operand
from taskcal.programs.numeral import numeral
from taskcal.programs.program import Move, MoveKind, Waypoint
from taskcal.programs.source import Edit, Source, edited_piece
from taskcal.robot.robot import Robot

LONGEST_NAME = 24
"""Characters of a name in KRL."""

_SAME = 1e-9
"""Poses and joint positions that differ by less are one, metres and radians."""

_ALONG = re.compile(r"\s*#(BASE|TOOL)\b", re.IGNORECASE)

KEYWORDS: dict[MoveKind, str] = {"joint": "PTP", "axes": "PTP", "linear": "LIN", "circular": "CIRC"}


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
    def template(self) -> str:
        """The text of the position it states, or to which is added."""
        first = self.aggregates[0]
        return (self.file if self.datum is None else self.datum.file).source.text[first.start : first.end]

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
    motion: Motion
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
    changes: tuple[Edit, ...]
    points: list[Written] = field(default_factory=list[Written])


def rewrite(
    sources: tuple[Source, ...],
    sites: Sequence[Site],
    moves: Sequence[Move],
    robot: Robot,
    waypoints: Mapping[int, tuple[Waypoint, ...]],
    elements: Container[int],
) -> tuple[Source, ...]:
    """The sources with some motions rewritten; see `KrlProgram.rewrite`.

    Args:
        sources: the files.
        sites: of the motions.
        moves: the motions.
        robot: the robot.
        waypoints: by number of the motion.
        elements: numbers of motions whose points get their numbers in the data list, because others share their text.
    """
    rewriting = _Rewriting(robot=robot, files=_files(sites))
    changed = {number for number, path in waypoints.items() if not stays(moves[number], path)}
    done: set[tuple[int, int]] = set()
    for number, (site, move) in enumerate(zip(sites, moves, strict=True)):
        path = waypoints.get(number)
        if site.leans:
            path = (path or (_own(move),)) if number in changed or changed.intersection(site.before) else None
        if path is None:
            continue
        if number in elements:
            rewriting.elements(site, move, path)
        elif move.texts_motions == 1:
            rewriting.motion(site, move, path)
        elif stays(move, path):
            continue
        elif site.text not in done:
            done.add(site.text)
            rewriting.motion(site, move, path)
    rewriting.variables()
    return tuple(source.edited(rewriting.edits.get(i, ())) for i, source in enumerate(sources))


def stays(move: Move, path: tuple[Waypoint, ...]) -> bool:
    """Whether a motion is to go where it goes already."""
    (only, *more) = path
    if more or only.kind != move.kind:
        return False
    pairs = [(move.end.q, only.q if only.T is None else None), (move.end.T, only.T)]
    if move.via is not None and only.via is not None:
        pairs.append((move.via.T, only.via.T))
    return all(
        old is None if new is None else old is not None and bool(np.abs(new - old).max() < _SAME) for old, new in pairs
    )


def _own(move: Move) -> Waypoint:
    """A motion's own end, to be written again."""
    q = np.full(len(AXES), np.nan) if move.end.q is None else move.end.q
    via = None if move.via is None else Waypoint(kind=move.kind, q=q, T=move.via.T)
    return Waypoint(kind=move.kind, q=q, T=move.end.T, via=via)


def _files(sites: Sequence[Site]) -> tuple[File, ...]:
    files = {f.number: f for site in sites for f in (site.file, *(w.datum.file for w in site.written if w.datum))}
    return tuple(files.values())


@dataclass(frozen=True, eq=False, kw_only=True)
class _Rewriting:
    robot: Robot
    files: tuple[File, ...]
    edits: dict[int, list[Edit]] = field(default_factory=dict[int, list[Edit]])
    """By number of the file."""
    uses: dict[tuple[int, int, tuple[Edit, ...]], _Use] = field(
        default_factory=dict[tuple[int, int, tuple[Edit, ...]], _Use]
    )
    """By file and position of the variable, and by what changes."""

    def _edit(self, file: File, edit: Edit) -> None:
        self.edits.setdefault(file.number, []).append(edit)

    def motion(self, site: Site, move: Move, path: tuple[Waypoint, ...]) -> None:
        """Rewrite a motion, with motions of their own for all waypoints but the last."""
        *before, last = path
        self._before(site, move, before)
        start = site.motion.start
        if last.kind != move.kind or site.leans:
            text = self._instruction(site, move, last, passing=not move.stops)
            self._edit(site.file, Edit(start=start, end=site.motion.end, text=text))
            return
        self._point(site.written[-1], last)
        if last.via is not None:
            self._point(site.written[0], last.via)

    def _before(self, site: Site, move: Move, path: Sequence[Waypoint]) -> None:
        """Put motions of their own before a motion."""
        source, start = site.file.source, site.motion.start
        line = source.text.rfind("\n", 0, start) + 1
        for waypoint in path:
            text = self._instruction(site, move, waypoint, passing=True)
            self._edit(site.file, Edit(start=line, end=line, text=f"{source.indent(start)}{text}{source.newline}"))

    def elements(self, site: Site, move: Move, path: tuple[Waypoint, ...]) -> None:
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

    def _instruction(self, site: Site, move: Move, waypoint: Waypoint, *, passing: bool) -> str:
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
        self._edit(written.file, Edit(start=operand.start, end=operand.end, text=self._aggregate(written, waypoint)))

    def _aggregate(self, written: Written, waypoint: Waypoint) -> str:
        """A waypoint in braces: as the point is written, if it states the same kind of position completely, in numbers."""
        first = written.aggregates[0]
        values = values_at(self.robot, written, waypoint)
        names = [name for name in values if name not in ("S", "T")]
        beside = {name: value for name, value in zip(EXTERNAL, waypoint.external, strict=False) if not isnan(value)}
        values |= {name: value for name, value in beside.items() if first.field(name)}
        numbers = all(first.field(name) for name in names) and all(part.value is not None for part in first.fields)
        if numbers and not written.computed:
            return edited_piece(written.template, edits_for(first, values), first.start)
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
        needed = {use.datum.name for use in self.uses.values()}
        mentions = _mentions(self.files, needed)
        names = FreshNames((name for _, name, _ in _all_names(self.files)), longest=LONGEST_NAME)
        for uses in by_datum.values():
            datum = uses[0].datum
            rewritten = {(w.file.number, w.operand.start) for use in uses for w in use.points}
            rewritten.add((datum.file.number, datum.start))
            stays = any(not use.changes for use in uses) or mentions[datum.file.module, datum.name] - rewritten
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
                        self._edit(written.file, Edit(start=operand.start, end=operand.end, text=name))

    def _copied(self, use: _Use, names: FreshNames) -> str:
        """Put a copy of a variable with other numbers behind its line."""
        datum, source = use.datum, use.datum.file.source
        name = names.like(_name(datum))
        start = source.text.rfind("\n", 0, datum.start) + 1
        end = source.text.find("\n", datum.start) + 1
        renamed = Edit(start=datum.start, end=datum.start + len(_name(datum)), text=name)
        line = edited_piece(source.text[start : end or None], [renamed, *use.changes], start)
        at = end or len(source.text)
        self._edit(datum.file, Edit(start=at, end=at, text=line if end else source.newline + line))
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


def mentions_of(variable: str, sites: Sequence[Site], module: str) -> Iterator[tuple[File, int]]:
    """Files and positions at which a module names a variable of its own."""
    files = tuple(file for file in _files(sites) if file.module == module)
    return ((file, position) for file, name, position in _all_names(files) if name == variable)


def _name(datum: Datum) -> str:
    """A variable's name as its declaration writes it."""
    return datum.file.source.text[datum.start : datum.start + len(datum.name)]


def _mentions(files: tuple[File, ...], names: set[str]) -> dict[tuple[str, str], set[tuple[int, int]]]:
    """By module and name: the places, as file and position, where some names stand."""
    out: dict[tuple[str, str], set[tuple[int, int]]] = {(f.module, name): set() for f in files for name in names}
    for file, name, position in _all_names(files):
        if name in names:
            out[file.module, name].add((file.number, position))
    return out


def _all_names(files: tuple[File, ...]) -> Iterator[tuple[File, str, int]]:
    for file in files:
        for words in lines_of_words(file.source.text):
            for word in words:
                if word.kind == "name":
                    yield file, word.upper, word.start
