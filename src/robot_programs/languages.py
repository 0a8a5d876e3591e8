"""The languages of robot programs, in one table, with those of other packages that name a `Language` as an entry point."""

import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

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
    from robot_programs.rapid.rewrite import compose_rapid

    return compose_rapid(to.name, to.robot, to.moves, q=to.q, notes=to.notes, wait_s=to.wait_s, speed=to.speed)


def _compose_krl(to: Composition) -> Source:
    from robot_programs.krl.rewrite import compose_krl

    percent = to.joint_speed_percent
    return compose_krl(
        to.name, to.robot, to.moves, q=to.q, notes=to.notes, wait_s=to.wait_s, joint_speed_percent=percent
    )


def _compose_tp(to: Composition) -> Source:
    from robot_programs.tp.rewrite import compose_tp

    percent = to.joint_speed_percent
    return compose_tp(to.name, to.moves, notes=to.notes, wait_s=to.wait_s, joint_speed_percent=percent)


def _compose_csv(to: Composition) -> Source:
    from robot_programs.csv_path.read import compose_csv_path

    return compose_csv_path(to.name, to.robot, to.moves, notes=to.notes)


_OWN = (
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

GROUP = "robot_programs.languages"
"""Entry points of other packages, a `Language` each."""


@cache
def languages() -> tuple[Language, ...]:
    """All of them, in the order in which messages name them; those of other packages last.

    A package whose language cannot be loaded, or has a name or suffix of another, is named in a warning and left out.
    """
    found = dict.fromkeys(_OWN, "robot_programs")
    for point in sorted(entry_points(group=GROUP), key=lambda point: (point.value, point.name)):
        package = point.dist.name if point.dist is not None else point.value.partition(".")[0]
        try:
            language = point.load()
            if not isinstance(language, Language):
                raise TypeError(f"{point.value} is not a Language")
            for other, owner in found.items():
                if taken := {language.name, *language.suffixes} & {other.name, *other.suffixes}:
                    raise ValueError(f"the package '{owner}' has '{min(taken)}' already")
            found[language] = package
        except Exception as error:
            fault = f"the package '{package}' cannot add the language '{point.name}': {type(error).__name__}: {error}"
            _FAULTS.append(fault)
            warnings.warn(f"{fault}; mend the package or uninstall it", stacklevel=2)
    return tuple(found)


_FAULTS: list[str] = []
"""What is wrong with packages that add languages."""


def __getattr__(name: str) -> Any:
    if name == "LANGUAGES":
        return languages()
    if name == "COMPOSED":  # suffixes of files that a new program can be written to
        return tuple(suffix for language in languages() for suffix in language.composed)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")


def language_of(path: Path) -> Language:
    """The language that a file's suffix stands for.

    Raises:
        FileError: the suffix is not known.
    """
    for language in languages():
        if path.suffix.lower() in language.suffixes:
            return language
    known = "; ".join([*(f"{language.name}: {' '.join(language.suffixes)}" for language in languages()), *_FAULTS])
    raise FileError(path, f"has no suffix of a robot program; known are {known}")
