"""How a language is added: a small one that nobody speaks, with points, numbers, loops, branches and routines, read and edited."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from robot_programs import Edit, Frame, Language, Motion, Source, Target
from robot_programs.core import flow
from robot_programs.core.form import Assign, Check, Do, Hole, Lit, MoveLine, Ref, Routine
from robot_programs.core.interpreter import FoundMotion, LanguageMeaning, interpreted
from robot_programs.core.kit import Cursor, named, words
from robot_programs.core.program import Diagnostic, Unresolved
from robot_programs.core.sharing import SharingProgram, Spelling, Use
from robot_programs.core.source import TextEdit
from robot_programs.core.values import Lost, Origin, Structure
from robot_programs.languages import Surroundings
from taskcal_groundwork.errors import InputError

# 1. Words, and how operators bind.

NOT_UNDERSTOOD = "is set by a line that is not understood"
WORDS = re.compile(r"(?P<space>[ \t]+|#.*)|(?P<number>\d+(?:\.\d*)?)|(?P<name>[A-Za-z]\w*)|(?P<sign>.)")


class Reader(Cursor):
    BINDING: ClassVar = {"=": 1, "<": 1, "+": 2, "-": 2}
    PREFIXES: ClassVar = {"-": 3}

    def single(self):
        word = self.take()
        if word.kind == "number":
            return Lit(at=self.span(word.start), value=float(word.text))
        if word.upper == "SENSOR":
            return Hole(at=self.span(word.start), why="the sensor is read at run time")
        if word.kind != "name":
            raise self.problem(f"'{word.text}' is not a value")
        part = (self.take().text,) if self.accept(".") else ()
        return Ref(at=self.span(word.start), name=word.text, key=word.upper, path=part)

    def point(self):
        """Three numbers, or any other value."""
        if [one.kind for one in self.words[self.number :]] != ["number"] * 3:
            return self.whole()
        x, y, z = (self.take() for _ in range(3))
        at = self.span(x.start)
        parts = {"x": float(x.text), "y": float(y.text), "z": float(z.text)}
        return Lit(at=at, value=Structure(kind="point", parts=parts, origin=Origin(at=at, owner="point")))


# 2. Lines, lowered to the nodes of routines.


class Lowering:
    def __init__(self, text):
        names = ["main", *re.findall(r"^\s*sub (\w+)", text, re.MULTILINE)]
        self.routines = {name.upper(): Routine(name=name) for name in names}
        self.data = {name.upper(): Ref(at=(0, 0, 0), name=name, key=name.upper()) for name in re.findall(r"\w+", text)}
        self.open = [("MAIN", None, [[]])]
        """What each block is, the line with which it begins, and its bodies."""
        for match in re.finditer(r".+", text):
            found = Reader(list(words(WORDS, match[0], match.start())), 0)
            at = (0, found.place, match.end())
            try:
                nodes = () if found.done else self.line(found.take().upper, found, at)
            except (Unresolved, KeyError) as why:  # of another line than a motion, what it names may be set by it
                other = Do(at=at, changes=named(found.words, self.data), why=NOT_UNDERSTOOD, moves=True)
                nodes = (flow.FlowStep(line=MoveLine(at=at, why=str(why)) if found.words[0].upper == "GO" else other),)
            self.open[-1][2][-1] += nodes
        self.routines["MAIN"].nodes = tuple(self.open[0][2][0])

    def line(self, word, found, at):
        match word:
            case "GO":
                return (flow.FlowStep(line=MoveLine(at=at, points=(found.point(),))),)
            case "DO":
                return (flow.FlowStep(line=Do(at=at, routines=(self.routines[found.take().upper],))),)
            case "LOOP":
                one = Lit(at=at, value=1.0)
                counter = Ref(at=at, name="the counter", key=at)
                self.open.append((word, Check(at=at, conditions=(one, found.whole(), one), counter=counter), [[]]))
            case "IF":
                self.open.append((word, Check(at=at, conditions=(found.whole(),)), [[]]))
            case "SUB":
                self.open.append((found.take().upper, None, [[]]))
            case "ELSE" if self.open[-1][0] == "IF":
                self.open[-1][2].append([])
            case "END" if len(self.open) > 1:
                return self.closed(*self.open.pop())
            case _:
                found.number = 0
                target = found.single()
                found.expect("=")
                return (flow.FlowStep(line=Assign(at=at, target=target, value=found.point())),)
        return ()

    def closed(self, kind, check, bodies):
        bodies = [tuple(body) for body in bodies]
        if kind == "LOOP":
            return (flow.Loop(line=check, name=kind, kind="counted", body=bodies[0]),)
        if kind == "IF":
            arms = zip((check.conditions[0], None), bodies, strict=False)
            return (flow.Branches(line=check, name=kind, arms=tuple(flow.Arm(condition=c, body=b) for c, b in arms)),)
        self.routines[kind].nodes = bodies[0]
        return ()


# 3. What data and motions mean.


@dataclass(eq=False, kw_only=True)
class ToyMeaning(LanguageMeaning):
    PASSES: ClassVar = 20
    SET: ClassVar = "is set to what is not known"
    source: Source

    def declared(self, key):
        return Lost(reason="is not set")

    def part_names(self, value, indices):
        raise Unresolved("it has no elements")

    def blank(self, key, lost):
        return lost

    def coerced(self, key, value):
        return value

    def motion(self, line, points, settings):
        (point,) = points
        if not isinstance(point, Structure):
            raise Unresolved("it goes to what is not a point")
        xyz = {name: point.part(name) for name in "xyz"}
        for name, value in xyz.items():
            if isinstance(value, Lost):
                raise Unresolved(f"its {name} is not known: {value.reason}")
        T, place = np.eye(4), self.source.place(line.at[1])
        T[:3, 3] = np.array([*xyz.values()]) / 1e3
        end = Target(name="", T=T, q=None, posture=None, place=place)
        base = Frame(name="", T=np.eye(4))
        motion = Motion(kind="linear", end=end, tool=base, part=base, stops=True, place=place)
        written = line.points[0].at, point.origin, tuple(xyz.values())
        return FoundMotion(motion=motion, written=written, meaning=(T.tobytes(), point.origin))


# 4. The program: which text leads to the points of its motions, where their numbers stand, and how others are written.


@dataclass(eq=False, kw_only=True)
class ToySpelling(Spelling[tuple[float, ...]]):
    def alike(self, one, other):
        return np.allclose(one, other, rtol=0.0, atol=1e-4)

    def reader(self, slot, texts):
        """Where else the name before the numbers stands, if there is one."""
        text = self.sources[0].text
        name = re.search(r"(\w+)\s*=\s*$", text[: slot.at[1]])
        others = re.finditer(rf"\b{name[1]}\b", text, re.IGNORECASE) if name else ()
        known = {at[1] for at in texts}.union([name.start(1)] if name else ())
        return next((self.place((0, *one.span())) for one in others if one.start() not in known), "")

    def in_place(self, use):
        self.edits[0].append(TextEdit(start=use.slot.at[1], end=use.slot.at[2], text=self.own(use)))

    def own(self, use):
        return " ".join(f"{value:.4f}" for value in use.wanted)

    def insert(self, number, path):
        raise InputError("a motion of a toy program is not divided")


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class ToyProgram(SharingProgram):
    LANGUAGE: ClassVar = "Toy"
    points: tuple[Any, ...]

    def spelling(self, robot, waypoints):
        ends = {number: path[-1].T[:3, 3] * 1e3 for number, path in waypoints.items()}
        uses = [
            Use(motion=number, text=text, slot=slot, numbers=numbers, wanted=tuple(ends.get(number, numbers)))
            for number, (text, slot, numbers) in enumerate(self.points)
        ]
        return ToySpelling(sources=self.sources, uses=uses)


def read_toy(sources: Sequence[Source], around: Surroundings | None = None) -> ToyProgram:
    (source,) = sources
    findings = interpreted(tuple(Lowering(source.text).routines.values()), ToyMeaning(source=source)).findings
    found = list(findings.ordered(lambda one: one.text not in findings.reasons, lambda line: line.at))
    motions = [replace(one.motion.motion, follows=one.follows, texts_motions=one.same_text) for one in found]
    left = {line.at[1]: why for line, (_, why) in findings.reasons.items()}
    said = tuple(Diagnostic(place=source.place(start), text=why, unread=True) for start, why in left.items())
    points = tuple(one.motion.written for one in found)
    return ToyProgram(sources=(source,), motions=tuple(motions), diagnostics=said, points=points, read=read_toy)


TOY = Language(name="Toy", suffixes=(".toy",), read=read_toy, compose=None, declares_frames=True)

# That is all. What it does:

TEXT = """home = 100 200 300   # a point
n = 0
loop 3
  n = n + 10
  go home
  bin = 0 50 5
  bin.x = n
  do drop
end
if n = 30
  go 1 2 3
end
go home
wait for home
go home
sub drop
  go bin
end
"""


def read(text: str) -> ToyProgram:
    return TOY.read((Source.of(Path("a.toy"), text.encode()),), Surroundings())


def test_a_toy_program_is_read():
    program = read(TEXT)
    places = [tuple((move.end.T[:3, 3] * 1e3).round(6).tolist()) for move in program.motions]
    assert places == [(100, 200, 300), (1, 2, 3), (100, 200, 300), (10, 50, 5), (20, 50, 5), (30, 50, 5)]
    assert [move.follows for move in program.motions] == [None, 5, 1, 0, 0, 0]
    (said,) = program.diagnostics
    assert str(said) == "a.toy:15: its x is not known: is set by a line that is not understood"


@pytest.mark.parametrize(
    ("lines", "reason"),
    [
        ("p = 1 2 3\np.x = sensor\ngo p", "its x is not known: the sensor is read at run time"),
        (
            "n = 1\nif sensor < 3\nn = 2\nend\np = 1 2 3\np.x = n\ngo p",
            "its x is not known: n is set in one branch of the IF before and not, or differently, in another",
        ),
        ("go 1 2", "'2' is not evaluated"),
        ("go nowhere", "nowhere is not set"),
    ],
)
def test_what_a_toy_program_does_not_tell_is_refused(lines, reason):
    program = read(lines)
    assert not program.motions
    assert [one.text for one in program.diagnostics] == [reason]


def at(x, y, z) -> np.ndarray:
    T = np.eye(4)
    T[:3, 3] = np.array([x, y, z]) / 1e3
    return T


def test_a_toy_program_is_edited_where_its_numbers_stand():
    program = read(TEXT.replace("wait for home\n", ""))
    again = program.with_edits([Edit(motion=i, T=at(100.5, 200, 300)) for i in (0, 2, 3)])
    assert again.sources[0].text == program.sources[0].text.replace("100 200 300 ", "100.5000 200.0000 300.0000 ")


def test_a_motion_states_its_own_numbers_where_others_need_those_that_stand_there():
    """Other motions, or a line that is not understood."""
    program = read(TEXT)
    again = program.with_edits([Edit(motion=2, T=at(100.5, 200, 300))])
    assert again.sources[0].text == TEXT.replace("go home\nwait", "go 100.5000 200.0000 300.0000\nwait")


def test_a_text_of_several_motions_has_no_numbers_of_its_own():
    program = read(TEXT)
    with pytest.raises(InputError, match=r"a\.toy:\d+: .*its text stands for 3 motions, which need different numbers"):
        program.with_edits([Edit(motion=3, T=at(100.5, 200, 300))])
