"""Reading URScript programs: where each motion goes, from what nothing calls through all that it calls."""

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from robot_programs.core.interpreter import Interpreter, interpreted, known_motions
from robot_programs.core.program import Cause, Diagnostic, Frame, Motion
from robot_programs.core.robot import Robot
from robot_programs.core.source import Source, uncollected
from robot_programs.urscript.lower import MOTIONS, LoweredUrscript, MotionCall, lowered
from robot_programs.urscript.meaning import UrscriptMeaning, UrscriptSite
from robot_programs.urscript.rewrite import UrscriptProgram
from robot_programs.urscript.syntax import ScriptUnit, parse
from taskcal_groundwork.errors import FileError

BASE = "Base"
"""PolyScope's feature of the robot's base."""


@uncollected()
def read_urscript(
    sources: Sequence[Source],
    robot: Robot | None = None,
    tool: Frame | None = None,
    part: Frame | None = None,
    corrects: str = "",
) -> UrscriptProgram:
    """Read a URScript program.

    Args:
        sources: its files.
        robot: for lines to joint positions and ``get_forward_kin``, whose poses follow from its kinematics.
        tool: the TCP that is active before the first ``set_tcp``.
        part: frame on which motions are that name no feature; the robot's base by default.
        corrects: how functions begin that correct a target at run time; motions to what they return are left out.

    Raises:
        FileError: a file is no URScript, its blocks and their ends do not match, or a header is not understood.
    """
    units = list[ScriptUnit]()
    for number, source in enumerate(sources):
        if "\0" in source.text:
            raise FileError(source.path, "is a binary file; save the program as a .script file")
        own = parse(source, number)
        if len(own) == 1 and own[0].calls.isdisjoint(MOTIONS):
            raise FileError(source.path, "is not URScript: it has no def and no motion")
        units += own
    program = lowered(units, tool, corrects)
    meaning = UrscriptMeaning(sources=sources, program=program, robot=robot, part=part or Frame(name=BASE, T=np.eye(4)))
    routines = [one for one in program.routines if not (corrects and one.name.startswith(corrects))]
    found = interpreted(routines, meaning)
    motions, sites = list[Motion](), list[UrscriptSite]()
    for move, one in known_motions(found.findings):
        motions.append(move)
        sites.append(one.motion.written)
    diagnostics = sorted([*_left(found), *_strange(program), *_by_hand(program)], key=lambda each: each[0])
    return UrscriptProgram(
        sources=tuple(sources),
        motions=tuple(motions),
        diagnostics=tuple(
            Diagnostic(place=sources[file].place(start), text=text, unread=unread)
            for (file, start), text, unread in diagnostics
        ),
        sites=tuple(sites),
        program=program,
        routines=tuple(program.routines),
        failing=tuple(line for line in found.findings.reasons if isinstance(line, MotionCall)),
        shifted=meaning.shifted,
        turns=found.turns,
        read=partial(read_urscript, robot=robot, tool=tool, part=part, corrects=corrects),
    )


Said = tuple[tuple[int, int], str, bool]
"""A file and a place in it, what is said, and whether a motion there is left."""


def _left(found: Interpreter) -> Iterator[Said]:
    """Motions that are not understood, and why."""
    for line, (_, reason) in found.findings.reasons.items():
        assert isinstance(line, MotionCall)
        yield line.at[:2], f"{line.name} stays as it is: {reason}", True


def _strange(program: LoweredUrscript) -> Iterator[Said]:
    """Functions that no file has."""
    for name, places in program.strange.items():
        times = f" ({len(places)} times)" if len(places) > 1 else ""
        text = Cause(
            f"{name} is not in the files given{times}; it is taken to leave TCP and variables as they are; where the robot is "
            "after it is not known",
            (name, "other"),
        )
        yield min(places), text, False


def _by_hand(program: LoweredUrscript) -> Iterator[Said]:
    """That a thread may let a person move the arm, at the first call that does."""
    if program.by_hand:
        text = "a thread may let a person move the arm; motions are those of an arm that stays where they left it"
        yield min(program.by_hand), text, False
