"""Random programs with random damage: `python -m tests.robot_programs.fuzz rapid 10000 [FIRST_SEED]`.

Whatever the bytes of a file are, reading it ends soon, in a program or in a TaskcalError; without changes every byte stays;
and a program that was read can be rewritten and read again.
"""

import sys
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from robot_programs.core.program import Motion, Program, Waypoint
from robot_programs.core.source import Source
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.robot.robot import Robot

LONGEST = 5.0
"""Seconds of computing that no small file may take."""


def nearby(
    rng: np.random.Generator, move: Motion, size: float = 1e-3, q: np.ndarray | None = None, kind: str = ""
) -> Waypoint:
    """Not far from a motion's end, metres and radians; joint positions decide the posture of a pose."""
    kind, q = kind or move.kind, np.zeros(6) if q is None else q

    def near(T: np.ndarray) -> np.ndarray:
        return T @ se3.pose(se3.exp(rng.normal(scale=size, size=3)), rng.normal(scale=size, size=3))

    if kind == "axes":
        at = q if move.end.q is None else move.end.q
        return Waypoint(kind=kind, q=at + rng.normal(scale=size, size=len(at)), T=None)
    T = np.eye(4) if move.end.T is None else move.end.T
    via = None if move.via is None or kind != "circular" else Waypoint(kind=kind, q=q, T=near(move.via.T))
    return Waypoint(kind=kind, q=q, T=near(T), via=via)


def nearby_waypoints(
    rng: np.random.Generator, program: Program, *, most: int = 3, postures: bool = False, kinds: Sequence[str] = ()
) -> dict[int, tuple[Waypoint, ...]]:
    """For about half of the motions, up to so many waypoints each, of which the last is of the motion's kind.

    Args:
        rng: decides which and where.
        program: whose motions they are for.
        most: so many each.
        postures: they are in any posture.
        kinds: of further points, beside the motion's own.
    """
    out = dict[int, tuple[Waypoint, ...]]()
    for number, move in enumerate(program.motions):
        if rng.random() < 0.5:
            choice = [*(kinds if move.divisible else ()), move.kind]
            every = [str(rng.choice(choice)) for _ in range(int(rng.integers(most)))] + [move.kind]
            at = [rng.uniform(-3.0, 3.0, 6) if postures else np.zeros(6) for _ in every]
            out[number] = tuple(nearby(rng, move, 3e-3, q, kind) for q, kind in zip(at, every, strict=True))
    return out


@dataclass(frozen=True, kw_only=True)
class Language:
    """How programs of a language are made, read and changed."""

    generate: Callable[[np.random.Generator], tuple[Source, ...]]
    """The files of a random valid program."""
    read: Callable[[tuple[Source, ...]], Program]
    waypoints: Callable[[np.random.Generator, Program], Mapping[int, tuple[Waypoint, ...]]] = nearby_waypoints
    """New waypoints for some of its motions."""
    posture: Callable[[Program, int], np.ndarray | None] = lambda program, number: np.zeros(6)
    """Joint positions of the configuration that a motion states, radians; None where its own end is written in another way."""
    robot: Robot
    place: tuple[float, float]
    """By what the places that are read again may differ, as a share and in metres."""
    turn: float
    """The same of orientations, radians."""
    joints: float
    """And of joint positions."""
    postures: bool = False
    """The posture that is written is that of the waypoint's joint positions."""
    leans: Callable[[Any, int], bool] = lambda program, number: False
    """Whether a motion is written whole where the one before it moves, because it counts from that."""
    as_wanted: Callable[[Any, int, int], bool] = lambda program, number, point: True
    """Whether what is written of a motion's first or last point, 0 or -1, is its waypoint's pose."""


LANGUAGES = tuple(sorted(path.parent.name for path in Path(__file__).parent.glob("*/fuzzing.py")))
"""Each has a module ``fuzzing`` in its folder with its `LANGUAGE`."""


def unchanged(language: Language, program: Program) -> dict[int, tuple[Waypoint, ...]]:
    """The own ends of the motions that are written as they are."""
    postures = {number: language.posture(program, number) for number in range(len(program.motions))}
    return {number: (_own(program.motions[number], q),) for number, q in postures.items() if q is not None}


def _own(move: Motion, q: np.ndarray) -> Waypoint:
    via = None if move.via is None else Waypoint(kind=move.kind, q=q, T=move.via.T)
    return Waypoint(kind=move.kind, q=q if move.end.q is None else move.end.q, T=move.end.T, via=via)


def mutated(rng: np.random.Generator, data: bytes, marks: bytes = b"[](){}\\;:=\"'!,<>%$&*/+-. \n\r\t09eE") -> bytes:
    """Some bytes deleted, inserted, changed or repeated."""
    for _ in range(int(rng.integers(1, 6))):
        at, size = int(rng.integers(len(data) + 1)), int(rng.integers(1, 12))
        match int(rng.integers(4)):
            case 0:
                data = data[:at] + data[at + size :]
            case 1:
                data = data[:at] + bytes(rng.integers(0, 256, size, dtype=np.uint8)) + data[at:]
            case 2:
                data = data[:at] + bytes(rng.choice(list(marks), size).tolist()) + data[at + 1 :]
            case _:
                data = data[:at] + data[at : at + 20 * size] + data[at:]
    return data


MARKS = "()[]{}<>,.;:=#!\"'\\-+$ x1"
"""Characters that mean something in robot programs."""


def torn(rng: np.random.Generator, text: str) -> str:
    """Some lines deleted, doubled or exchanged, or a character of them deleted or inserted; the rest stays a program."""
    lines = text.split("\n")
    for _ in range(int(rng.integers(1, 4))):
        at, other = (int(k) for k in rng.integers(len(lines), size=2))
        column = int(rng.integers(len(lines[at]) + 1))
        head, tail = lines[at][:column], lines[at][column:]
        match int(rng.integers(5)):
            case 0 if len(lines) > 1:
                del lines[at]
            case 1:
                lines.insert(at, lines[other])
            case 2:
                lines[at], lines[other] = lines[other], lines[at]
            case 3:
                lines[at] = head + tail[1:]
            case _:
                lines[at] = head + MARKS[int(rng.integers(len(MARKS)))] + tail
    return "\n".join(lines)


def check_case(language: Language, seed: int) -> str:
    """Damage one file of a random program; says what became of it.

    Raises:
        AssertionError: the laws above do not hold.
    """
    rng = np.random.default_rng(seed)
    sources = list(language.generate(rng))
    hit = int(rng.integers(len(sources)))
    source = sources[hit]
    data = mutated(rng, source.encode()) if seed % 2 else torn(rng, source.text).encode(source.encoding)
    sources[hit] = Source.of(source.path, data)
    begin, program, refusal = time.process_time(), None, ""
    try:
        program = language.read(tuple(sources))
    except TaskcalError as error:
        refusal = str(error)
    finally:
        assert time.process_time() - begin < LONGEST, "reading takes too long"
    if program is None:
        assert any(str(source.path) in refusal for source in sources), "the message names no file"
        return "refused"
    same = program.rewrite(language.robot, {})
    assert [s.encode() for s in same] == [s.encode() for s in sources], "bytes change without a reason"
    waypoints = dict(language.waypoints(rng, program))
    for number in program.unwritable(language.robot, waypoints, 0.0):
        del waypoints[number]
    try:
        after = program.rewrite(language.robot, waypoints)
    except TaskcalError:
        return "read"
    again = program.reread(after)
    expected = len(program.motions) + sum(len(path) - 1 for path in waypoints.values())
    assert len(again.motions) == expected, f"{len(again.motions)} motions instead of {expected}"
    return "rewritten"


def language(name: str) -> Language:
    """What a language's folder says of it."""
    return import_module(f"tests.robot_programs.{name}.fuzzing").LANGUAGE


def fuzz(name: str, count: int, first: int = 0) -> int:
    """Check many cases, print those that fail, and say how many did."""
    tested = language(name)
    outcomes: dict[str, int] = {}
    begin = time.perf_counter()
    for seed in range(first, first + count):
        try:
            outcome = check_case(tested, seed)
        except Exception:
            outcome = "failed"
            print(f"seed {seed}:", traceback.format_exc(limit=-3), file=sys.stderr)
        outcomes[outcome] = outcomes.get(outcome, 0) + 1
    print(f"{name}: {count} cases in {time.perf_counter() - begin:.0f} s: {outcomes}")
    return outcomes.get("failed", 0)


if __name__ == "__main__":
    arguments = sys.argv[1:]
    if len(arguments) not in (2, 3) or arguments[0] not in LANGUAGES:
        sys.exit(f"usage: python -m tests.robot_programs.fuzz {'|'.join(LANGUAGES)} COUNT [FIRST_SEED]")
    sys.exit(min(fuzz(arguments[0], *map(int, arguments[1:])), 1))
