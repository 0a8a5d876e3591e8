"""Rewriting motions of an APT program: points, and arcs of both forms."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from robot_programs.apt.syntax import CircleRecord, CircleTokens, MotionStatements, arc_through
from robot_programs.core.kit import Token
from robot_programs.core.program import SAME_POSE, Motion, Paths, Program, Unresolved, Waypoint
from robot_programs.core.robot import Robot
from robot_programs.core.source import Source, TextEdit, numeral, renumbered
from taskcal_groundwork.errors import InputError

MM, INCHES, AXIS = 5, 6, 7
"""Decimals written of lengths and of directions."""


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class AptProgram(Program):
    """Tool paths read from APT."""

    instructions: tuple[MotionStatements, ...]
    """Where each motion stands."""

    def rewrite(self, robot: Robot, waypoints: Paths) -> tuple[Source, ...]:
        """The files with some motions rewritten; see `Program.rewrite`.

        A point without a tool axis keeps being one: its position changes, its axis stays. What counts from the end of a
        motion that moved, an incremental motion or an arc, is written anew with its own end.

        Raises:
            InputError: a motion is to become one to joint positions, which APT does not know.
        """
        edits: list[list[TextEdit]] = [[] for _ in self.sources]
        for number, (move, instruction) in enumerate(zip(self.motions, self.instructions, strict=True)):
            start = _start(move, instruction, waypoints)
            path = waypoints.get(number)
            stays = path is None
            if instruction.half:  # its statements are the second half's as well
                stays = all(self.motions[k].stays(waypoints[k]) for k in (number, number + 1) if k in waypoints)
            leans = instruction.relative or instruction.circle is not None
            if stays and (not leans or _same_point(start, instruction.begin)):
                continue
            writing = _Writing(source=self.sources[instruction.source], own=instruction, move=move)
            edits[instruction.source] += writing.edits(start, path or (move.own_waypoint(),))
        return tuple(source.edited(e) for source, e in zip(self.sources, edits, strict=True))


def _start(move: Motion, instruction: MotionStatements, waypoints: Paths) -> Float[np.ndarray, " 3"] | None:
    if move.follows is None or move.follows not in waypoints:
        return instruction.begin
    T = waypoints[move.follows][-1].T
    return None if T is None else T[:3, 3]


def _same_point(a: Float[np.ndarray, " 3"] | None, b: Float[np.ndarray, " 3"] | None) -> bool:
    return a is b or (a is not None and b is not None and bool(np.abs(a - b).max() < SAME_POSE))


@dataclass(frozen=True, eq=False, kw_only=True)
class _Writing:
    """Rewriting one motion."""

    source: Source
    own: MotionStatements
    move: Motion

    @property
    def decimals(self) -> int:
        """Decimals of lengths, in the program's unit."""
        return MM if self.own.unit <= 1e-3 else INCHES

    def edits(self, begin: Float[np.ndarray, " 3"] | None, path: Sequence[Waypoint]) -> list[TextEdit]:
        """Edits that give the motion its waypoints: statements before it, and its own numbers."""
        own = self.own
        parting = self.source.newline + self.source.indent(own.start)
        if own.rapid:
            parting += "RAPID" + parting
        ahead = ""
        for waypoint in path if own.half else path[:-1]:
            if waypoint.via is None:
                ahead += self._point(waypoint) + parting
            else:
                ahead += self.source.piece(own.start, own.end, self._arc(begin, waypoint)) + parting
            begin = self._pose(waypoint)[:3, 3]
        out = [TextEdit(start=own.start, end=own.start, text=ahead)] if ahead else []
        return out if own.half else out + self._last(begin, path[-1])

    def _pose(self, waypoint: Waypoint) -> np.ndarray:
        if waypoint.T is None:
            raise InputError(f"{self.move.place}: APT knows no joint positions; write the program in another language")
        return waypoint.T

    def _stated(self, T: np.ndarray) -> list[tuple[float, int]]:
        """Numbers of a point, as many as the motion's own one has, and at least three: value and decimals of each."""
        axis = (-T[:3, 2]).tolist() if len(self.own.numbers) == 6 else []
        return [(v, self.decimals) for v in (T[:3, 3] / self.own.unit).tolist()] + [(v, AXIS) for v in axis]

    def _point(self, waypoint: Waypoint) -> str:
        return "GOTO/" + ",".join(numeral(value, decimals) for value, decimals in self._stated(self._pose(waypoint)))

    def _last(self, begin: Float[np.ndarray, " 3"] | None, waypoint: Waypoint) -> list[TextEdit]:
        """Edits of the motion's own statements."""
        own, now = self.own, self._pose(waypoint)
        if waypoint.via is not None:
            return self._arc(begin, waypoint)
        if own.circle is not None:
            return [TextEdit(start=own.start, end=own.end, text=self._point(waypoint))]
        assert self.move.end.T is not None
        was = self.move.end.T
        if own.relative:
            kept = _same_point(begin, own.begin) and _same_point(now[:3, 3], was[:3, 3])
            return [] if kept else [TextEdit(start=own.body, end=own.end, text=self._point(waypoint))]
        return [
            TextEdit(start=word.start, end=word.end, text=renumbered(word.text, before, value, decimals))
            for word, (before, decimals), (value, _) in zip(
                own.numbers, self._stated(was), self._stated(now), strict=True
            )
        ]

    def _arc(self, begin: Float[np.ndarray, " 3"] | None, waypoint: Waypoint) -> list[TextEdit]:
        """Edits that make the motion's statements an arc; all anew, as numbers that were rounded apart would miss its ends."""
        circle, via, end = self.own.circle, waypoint.via, self._pose(waypoint)[:3, 3]
        if circle is None:
            raise InputError(
                f"{self.move.place}: a line cannot become an arc here; write the program in another language"
            )
        if begin is None or via is None or via.T is None:
            raise InputError(f"{self.move.place}: the arc begins or passes at a place that is not known")
        assert self.move.via is not None
        assert self.move.via.T is not None
        assert self.move.end.T is not None
        was = np.array([self.move.via.T[:3, 3], self.move.end.T[:3, 3]])
        if _same_point(begin, self.own.begin) and _same_point(np.array([via.T[:3, 3], end]), was) and not self.own.half:
            return []
        try:
            arc = arc_through(begin, via.T[:3, 3], end)
        except Unresolved as why:
            raise InputError(f"{self.move.place}: {why}; cut it into fewer pieces") from None
        center, radius = arc.center / self.own.unit, arc.radius / self.own.unit
        lengths, axis = self.decimals, np.cross(begin - arc.center, arc.direction)
        match circle:
            case CircleRecord():
                axis = circle.sense * axis / np.linalg.norm(axis)
                values = [(v, lengths) for v in center] + [(v, AXIS) for v in axis] + [(radius, lengths)]
                return _anew(circle.tokens, values) + _anew(self.own.numbers, self._stated(self._pose(waypoint)))
            case CircleTokens():
                values = [(v, lengths) for v in (*center, radius, *center, *(end / self.own.unit))]
                out = _anew(self.own.numbers, [(v, AXIS) for v in arc.direction]) + _anew(circle.tokens, values)
                start, behind = circle.second
                if arc.second != (start < behind):
                    out.append(TextEdit(start=start, end=behind, text=",2,INTOF" if arc.second else ""))
                return out


def _anew(words: Iterable[Token], values: Iterable[tuple[float, int]]) -> list[TextEdit]:
    """Edits that put values, with their decimals, in the place of numbers; a record has more numbers than an arc."""
    return [
        TextEdit(start=word.start, end=word.end, text=numeral(float(value), decimals))
        for word, (value, decimals) in zip(words, values, strict=False)
    ]
