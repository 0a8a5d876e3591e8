"""Rewriting motions of an APT program: points, and arcs as CATIA writes them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from robot_programs.apt.circle import Arc, Instruction, arc_through
from robot_programs.apt.syntax import Token
from robot_programs.core.errors import InputError
from robot_programs.core.program import SAME_POSE, Motion, Paths, Program, Waypoint
from robot_programs.core.robot import Robot
from robot_programs.core.source import Place, Source, TextEdit, numeral, renumbered

MM, INCHES, AXIS = 5, 6, 7
"""Decimals written of lengths and of directions."""


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class AptProgram(Program):
    """Tool paths read from APT."""

    instructions: tuple[Instruction, ...]
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
            if instruction.half:
                halves = number, number + 1
                kept = all(half not in waypoints or self.motions[half].stays(waypoints[half]) for half in halves)
                if kept and _same_point(start, instruction.begin):
                    continue
                path = path or (move.own_waypoint(),)
            if path is None:
                leans = instruction.relative or instruction.circle is not None or instruction.record is not None
                if not leans or _same_point(start, instruction.begin):
                    continue
                path = (move.own_waypoint(),)
            writing = _Writing(source=self.sources[instruction.source], instruction=instruction, move=move)
            edits[instruction.source] += writing.edits(start, path)
        return tuple(source.edited(e) for source, e in zip(self.sources, edits, strict=True))


def _start(move: Motion, instruction: Instruction, waypoints: Paths) -> Float[np.ndarray, " 3"] | None:
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
    instruction: Instruction
    move: Motion

    @property
    def place(self) -> Place:
        return self.move.place

    @property
    def decimals(self) -> int:
        """Decimals of lengths, in the program's unit."""
        return MM if self.instruction.unit <= 1e-3 else INCHES

    def edits(self, begin: Float[np.ndarray, " 3"] | None, path: Sequence[Waypoint]) -> list[TextEdit]:
        """Edits that give the motion its waypoints: statements before it, and its own numbers."""
        own = self.instruction
        texts: list[str] = []
        for waypoint in path if own.half else path[:-1]:
            texts.append(self._statement(begin, waypoint))
            begin = self._end(waypoint)
        parting = self.source.newline + self.source.indent(own.start)
        if own.rapid:
            parting += "RAPID" + parting
        ahead = "".join(text + parting for text in texts)
        out = [TextEdit(start=own.start, end=own.start, text=ahead)] if ahead else []
        return out if own.half else out + self._own(begin, path[-1])

    def _end(self, waypoint: Waypoint) -> Float[np.ndarray, " 3"]:
        if waypoint.T is None:
            raise InputError(f"{self.place}: APT knows no joint positions; write the program in another language")
        return waypoint.T[:3, 3]

    def _statement(self, begin: Float[np.ndarray, " 3"] | None, waypoint: Waypoint) -> str:
        own = self.instruction
        if waypoint.via is None:
            return self._point(waypoint)
        return self.source.piece(own.start, own.end, self._arc_edits(begin, waypoint))

    def _point(self, waypoint: Waypoint) -> str:
        point = self._end(waypoint) / self.instruction.unit
        texts = [numeral(float(value), self.decimals) for value in point]
        if len(self.instruction.numbers) == 6 and waypoint.T is not None:
            texts += [numeral(float(value), AXIS) for value in -waypoint.T[:3, 2]]
        return "GOTO/" + ",".join(texts)

    def _own(self, begin: Float[np.ndarray, " 3"] | None, waypoint: Waypoint) -> list[TextEdit]:
        own, end = self.instruction, self._end(waypoint)
        if own.circle is not None or own.record is not None:
            if waypoint.via is not None:
                return self._arc_edits(begin, waypoint)
            return [TextEdit(start=own.start, end=own.end, text=self._point(waypoint))]
        if waypoint.via is not None:
            raise InputError(f"{self.place}: a line cannot become an arc here; write the program in another language")
        assert self.move.end.T is not None
        assert waypoint.T is not None
        was = self.move.end.T
        if own.relative:
            kept = _same_point(begin, own.begin) and bool(np.abs(end - was[:3, 3]).max() < SAME_POSE)
            return [] if kept else [TextEdit(start=own.body, end=own.end, text=self._point(waypoint))]
        out = [
            self._edit(token, was[a, 3] / own.unit, end[a] / own.unit, self.decimals)
            for a, token in enumerate(own.numbers[:3])
        ]
        axes = own.numbers[3:]
        return out + [self._edit(token, -was[a, 2], -waypoint.T[a, 2], AXIS) for a, token in enumerate(axes)]

    def _arc_edits(self, begin: Float[np.ndarray, " 3"] | None, waypoint: Waypoint) -> list[TextEdit]:
        own = self.instruction
        if own.circle is None and own.record is None:
            raise InputError(f"{self.place}: a line cannot become an arc here; write the program in another language")
        via, end = waypoint.via, self._end(waypoint)
        assert self.move.via is not None
        assert self.move.via.T is not None
        assert self.move.end.T is not None
        if begin is None or via is None or via.T is None:
            raise InputError(f"{self.place}: the arc begins or passes at a place that is not known")
        was = self.move.via.T[:3, 3], self.move.end.T[:3, 3]
        stays = _same_point(begin, own.begin) and _same_point(via.T[:3, 3], was[0]) and _same_point(end, was[1])
        if stays and not own.half:
            return []
        arc = arc_through(begin, via.T[:3, 3], end)
        if isinstance(arc, str):
            raise InputError(f"{self.place}: {arc}; cut it into fewer pieces")
        if own.circle is None:
            return self._record_edits(arc, begin, waypoint)
        # all anew: a centre and a radius that were rounded apart from these would miss the arc's ends
        lengths = np.concatenate([arc.center, [arc.radius], arc.center, arc.end]) / own.unit
        out = [
            TextEdit(start=token.start, end=token.end, text=numeral(float(value), decimals))
            for tokens, values, decimals in (
                (own.numbers, arc.direction, AXIS),
                (own.circle.circle + own.circle.line, lengths, self.decimals),
            )
            for token, value in zip(tokens, values, strict=True)
        ]
        start, behind = own.circle.second
        if arc.second != (start < behind):
            out.append(TextEdit(start=start, end=behind, text=",2,INTOF" if arc.second else ""))
        return out

    def _record_edits(self, arc: Arc, begin: Float[np.ndarray, " 3"], waypoint: Waypoint) -> list[TextEdit]:
        own = self.instruction
        assert own.record is not None
        assert waypoint.T is not None
        axis = own.record.sense * np.cross(begin - arc.center, arc.direction)
        values = [*(arc.center / own.unit), *(axis / np.linalg.norm(axis)), arc.radius / own.unit]
        decimals = [self.decimals] * 3 + [AXIS] * 3 + [self.decimals]
        ends = [*(waypoint.T[:3, 3] / own.unit), *(-waypoint.T[:3, 2])]
        written = zip(own.record.tokens, values, decimals, strict=False), zip(own.numbers, ends, decimals, strict=False)
        return [
            TextEdit(start=token.start, end=token.end, text=numeral(float(value), places))
            for tokens in written
            for token, value, places in tokens
        ]

    def _edit(self, token: Token, was: float, now: float, decimals: int) -> TextEdit:
        text = renumbered(token.text, float(was), float(now), decimals)
        return TextEdit(start=token.start, end=token.end, text=text)
