"""The languages of robot programs, in one table: to add one, write its folder and its entry here."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float

from robot_programs.core.errors import FileError
from robot_programs.core.program import Frame, Move, Program
from robot_programs.core.robot import Robot
from robot_programs.core.source import Source


@dataclass(frozen=True, eq=False, kw_only=True)
class Surroundings:
    """What a program does not say itself, where its language cannot."""

    robot: Robot | None = None
    """Whose own tool moves where none is given, and whose joints columns name."""
    tool: Frame | None = None
    """What the positions are of."""
    tools: Mapping[str, Frame] = field(default_factory=dict[str, Frame])
    """The same by the name by which a program loads it."""
    part: Frame | None = None
    """Frame in which the positions are counted; the robot's base by default."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Composition:
    """A program to be written; a language takes of it what it can say."""

    name: str
    robot: Robot
    moves: Sequence[Move]
    q: Float[np.ndarray, "moves joints"] | None = None
    """Joint positions in which each motion ends, radians."""
    notes: Sequence[str] = ()
    """A comment before each motion."""
    wait_s: float = 0.0
    """Seconds to wait behind each motion that stops."""
    speed: float = 0.25
    """Of the tool point, for motions that do not say theirs, metres per second."""
    joint_speed_percent: float = 10.0
    """Of motions of all joints, of the axes' largest speeds."""


@dataclass(frozen=True, kw_only=True)
class Language:
    """A language of robot programs."""

    name: str
    suffixes: tuple[str, ...]
    """How its files end; letter case does not matter."""
    read: Callable[[tuple[Source, ...], Surroundings], Program]
    compose: Callable[[Composition], Source] | None
    """Writes a new program; None where that cannot be done."""
    composed: tuple[str, ...] = ()
    """Suffixes of files that a new program can be written to."""
    declares_frames: bool
    """Whether a program says its own tools and frames."""
    marks: str = ""
    """What is found in every file of a program, a regular expression without regard to letter case; empty for anything."""
    base_file: str = ""
    """The file that says where the robot stands in the world, in which frames are counted; empty where they are counted in
    the robot's base."""

    def holds(self, source: Source) -> bool:
        """Whether a file, known by its suffix, is one of a program: controllers have other files with the same suffixes."""
        if "\0" in source.text:
            return False
        return not self.marks or re.search(self.marks, source.text, re.IGNORECASE | re.MULTILINE) is not None


# A language is imported when a file of it is met.


def _read_rapid(sources: tuple[Source, ...], _: Surroundings) -> Program:
    from robot_programs.rapid.read import read_rapid

    return read_rapid(sources)


def _read_krl(sources: tuple[Source, ...], _: Surroundings) -> Program:
    from robot_programs.krl.read import read_krl

    return read_krl(sources)


def _read_apt(sources: tuple[Source, ...], given: Surroundings) -> Program:
    from robot_programs.apt.read import read_apt

    return read_apt(sources, robot=given.robot, tool=given.tool, part=given.part, tools=given.tools)


def _read_tp(sources: tuple[Source, ...], given: Surroundings) -> Program:
    from robot_programs.tp.read import read_tp

    return read_tp(sources, robot=given.robot, tool=given.tool, part=given.part)


def _read_csv(sources: tuple[Source, ...], given: Surroundings) -> Program:
    from robot_programs.csv_path.read import read_csv_path

    return read_csv_path(sources, robot=given.robot, tool=given.tool, part=given.part)


def _compose_rapid(to: Composition) -> Source:
    from robot_programs.rapid.compose import compose_rapid

    return compose_rapid(to.name, to.robot, to.moves, q=to.q, notes=to.notes, wait_s=to.wait_s, speed=to.speed)


def _compose_krl(to: Composition) -> Source:
    from robot_programs.krl.compose import compose_krl

    percent = to.joint_speed_percent
    return compose_krl(
        to.name, to.robot, to.moves, q=to.q, notes=to.notes, wait_s=to.wait_s, joint_speed_percent=percent
    )


def _compose_tp(to: Composition) -> Source:
    from robot_programs.tp.rewrite import compose_tp

    percent = to.joint_speed_percent
    return compose_tp(to.name, to.moves, notes=to.notes, wait_s=to.wait_s, joint_speed_percent=percent)


def _compose_csv(to: Composition) -> Source:
    from robot_programs.csv_path.rewrite import compose_csv_path

    return compose_csv_path(to.name, to.robot, to.moves, notes=to.notes)


LANGUAGES = (
    Language(
        name="RAPID",
        suffixes=(".mod", ".sys", ".prg", ".modx", ".sysx", ".cfg"),
        read=_read_rapid,
        compose=_compose_rapid,
        composed=(".mod", ".prg", ".modx"),
        declares_frames=True,
        marks=r"^\s*MODULE\b|\A\ufeff?\s*MOC:CFG_",
        base_file="MOC.cfg",
    ),
    Language(
        name="KRL",
        suffixes=(".src", ".dat", ".sub"),
        read=_read_krl,
        compose=_compose_krl,
        composed=(".src",),
        declares_frames=True,
        marks=r"^\s*(GLOBAL\s+)?DEF(FCT|DAT)?\b",
        base_file="$machine.dat",
    ),
    Language(
        name="TP",
        suffixes=(".ls", ".va"),
        read=_read_tp,
        compose=_compose_tp,
        composed=(".ls",),
        marks=r"^\s*/POS\b|^\s*\[\*",
        declares_frames=False,
    ),
    Language(
        name="APT",
        suffixes=(".apt", ".aptsource", ".cls", ".clsf", ".cl", ".ncl"),
        read=_read_apt,
        compose=None,
        marks=r"^\s*(GOTO|TLON|LOADTL|LOAD|FEDRAT|RAPID|PARTNO|TOOL PATH|MULTAX|CUTTER)\b",
        declares_frames=False,
    ),
    Language(
        name="CSV",
        suffixes=(".csv",),
        read=_read_csv,
        compose=_compose_csv,
        composed=(".csv",),
        declares_frames=False,
    ),
)
"""All of them, in the order in which messages name them."""

COMPOSED = tuple(suffix for language in LANGUAGES for suffix in language.composed)
"""Suffixes of files that a new program can be written to."""


def language_of(path: Path) -> Language:
    """The language that a file's suffix stands for.

    Raises:
        FileError: the suffix is not known.
    """
    for language in LANGUAGES:
        if path.suffix.lower() in language.suffixes:
            return language
    known = "; ".join(f"{language.name}: {' '.join(language.suffixes)}" for language in LANGUAGES)
    raise FileError(path, f"has no suffix of a robot program; known are {known}")
