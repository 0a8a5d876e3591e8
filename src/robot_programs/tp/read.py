"""Reading TP programs with the frames and registers of a backup."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from robot_programs.core.flow import Findings
from robot_programs.core.form import MoveLine
from robot_programs.core.interpreter import FoundMotion, interpreted
from robot_programs.core.program import Cause, Diagnostic, Frame, Motion, TargetVisit
from robot_programs.core.robot import NO_ROBOT, Robot
from robot_programs.core.source import Source
from robot_programs.tp.listing import Listing, is_variables, read_variables
from robot_programs.tp.lower import MotionInstruction, lowered
from robot_programs.tp.meaning import (
    KINDS_OF_FRAMES,
    GivenFrames,
    ProgramFrames,
    TpMeaning,
    check_given,
    frames_by_number,
    world_in_base,
)
from robot_programs.tp.rewrite import TpProgram, TpSite
from taskcal_groundwork import se3
from taskcal_groundwork.errors import FileError


def read_tp(
    sources: Sequence[Source],
    *,
    robot: Robot | None = None,
    tool: Frame | None = None,
    part: Frame | None = None,
    tools: Mapping[str, Frame] | None = None,
    parts: Mapping[str, Frame] | None = None,
) -> TpProgram:
    """Read TP programs in their text form.

    Args:
        sources: listings (``.ls``), and for user frames, tools and registers the backup's ``sysframe.va`` and ``posreg.va``.
        robot: whose joints positions mean, and above whose base FANUC's world frame lies. Without one frames count from that frame,
            and lines to joint positions are not read.
        tool: in the flange; for the one tool of the motions that nothing else states. By the name ``UTOOL 2`` it is that one.
        part: in the world; for the one user frame of the motions that nothing else states, likewise.
        tools: tools by name, of which ``UTOOL 1`` stands for that number.
        parts: user frames by name, of which ``UFRAME 1`` stands for that number; in the world.

    Raises:
        FileError: a file is no listing, or none is one.
        InputError: FANUC's world frame is not known of such a robot; or a frame is given otherwise than the backup states it.
    """
    given = [frames_by_number(tools or {}, tool), frames_by_number(parts or {}, part)]
    program, frames = _read(sources, robot, *given)
    # one frame stands for one number: for none of several
    alone = [
        one if len(frames.alone[kind]) < 2 else replace(one, alone=None)
        for kind, one in zip(KINDS_OF_FRAMES, given, strict=True)
    ]
    if alone != given:
        program, _ = _read(sources, robot, *alone)
    return replace(program, read=partial(read_tp, robot=robot, tool=tool, part=part, tools=tools, parts=parts))


def _read(
    sources: Sequence[Source], robot: Robot | None, tools: GivenFrames, parts: GivenFrames
) -> tuple[TpProgram, ProgramFrames]:
    """A program, and its frames; arguments as of `read_tp`."""
    listings = {i: Listing(source.text) for i, source in enumerate(sources) if not is_variables(source)}
    if not listings:
        raise FileError(sources[0].path, "holds variables only; pass the .ls with the motions, too")
    for i, listing in listings.items():
        _check(sources[i], listing)
    T_base_world = np.eye(4) if robot is None else world_in_base(robot)
    frames = ProgramFrames(variables=read_variables(sources), T_base_world=T_base_world, tools=tools, parts=parts)
    check_given(frames)
    routines, strange = lowered(listings)
    meaning = TpMeaning(sources=sources, listings=listings, frames=frames, robot=robot or NO_ROBOT)
    findings = interpreted(tuple(routines.values()), meaning).findings
    motions, sites = list[Motion](), list[TpSite]()
    for one in findings.ordered(lambda found: found.text not in findings.reasons, lambda line: line.at):
        site, once = one.motion.written, one.same_text == 1
        motions.append(
            replace(
                one.motion.motion,
                follows=None if site.motion.keyword == "A" or site.motion.wrist else one.follows,
                texts_motions=one.same_text,
                divisible=once,
            )
        )
        sites.append(site)
    diagnostics = [*_left(findings, sources), *_strange(strange, sources), *_remarks(sites, sources)]
    text = (
        "the robot is not given: frames count from FANUC's world frame, at the height of axis 2, in place of its base"
    )
    said = [] if robot is not None else [Diagnostic(place=sources[min(listings)].place(0), text=text)]
    program = TpProgram(
        sources=tuple(sources),
        motions=tuple(motions),
        diagnostics=(*said, *(one for _, one in sorted(diagnostics, key=lambda found: found[0]))),
        T_world_base=None if robot is None else se3.inverse(T_base_world),
        base_from="FANUC's world frame, on axis 1 at the height of axis 2",
        base_missing="FANUC's world frame" if robot is None else "",
        sites=tuple(sites),
        unresolved=tuple(_unresolved(findings, sources)),
        read=partial(read_tp, robot=robot),
    )
    return program, frames


Placed = tuple[tuple[int, int], Diagnostic]
"""A diagnostic with its file and its place there."""


def _left(findings: Findings[MoveLine, FoundMotion], sources: Sequence[Source]) -> Iterator[Placed]:
    """Motions that are not understood, and why."""
    for line, (_, reason) in findings.reasons.items():
        assert isinstance(line, MotionInstruction)
        place = sources[line.at[0]].place(line.keyword_at)
        yield line.at[:2], Diagnostic(place=place, text=reason, unread=True)


def _unresolved(findings: Findings[MoveLine, FoundMotion], sources: Sequence[Source]) -> Iterator[TargetVisit]:
    """Positions to which they go."""
    for line in findings.reasons:
        assert isinstance(line, MotionInstruction)
        place = sources[line.at[0]].place(line.keyword_at)
        for operand in line.operands:
            if operand.number is not None:
                yield TargetVisit(number=None, target=(line.at[0], operand.name), place=place)


def _strange(calls: Sequence[tuple[int, int, str]], sources: Sequence[Source]) -> Iterator[Placed]:
    """Calls of programs that are not in the files."""
    for file, start, name in calls:
        text = Cause(
            f"{name} is not in the files given; behind it the active frames and all position registers are not known, and "
            "the frames are taken to keep their values; pass its .ls",
            (name, "other"),
        )
        yield (file, start), Diagnostic(place=sources[file].place(start), text=text)


def _remarks(sites: Sequence[TpSite], sources: Sequence[Source]) -> Iterator[Placed]:
    """What is to be known of motions that are understood."""
    said = set[MoveLine]()
    for site in sites:
        line, at = site.motion, site.motion.at[:2]
        place = sources[site.file].place(line.keyword_at)
        if line not in said and (line.keyword == "A" or line.wrist):
            what = (
                "an arc of A is corrected at its points, not looked at between them"
                if line.keyword == "A"
                else "with Wjnt it is corrected at its end, not looked at along the way"
            )
            yield at, Diagnostic(place=place, text=what)
        said.add(line)
    first = next((site.motion for site in sites if site.from_memory), None)
    if first is not None:
        text = "position registers are taken as posreg.va states them; programs that are not given may set them"
        yield first.at[:2], Diagnostic(place=sources[first.at[0]].place(first.keyword_at), text=text)


def _check(source: Source, listing: Listing) -> None:
    """See that a file is a whole listing.

    Raises:
        FileError: it is not.
    """
    for section in ("MN", "POS"):
        if section not in listing.sections:
            hint = (
                "it is binary; save the program as text (.ls)" if "\0" in source.text else f"it has no line /{section}"
            )
            raise FileError(source.path, f"is not a TP listing: {hint}")
    fault = listing.fault()
    if fault is not None:
        raise FileError(source.path, fault[1], line=source.line(fault[0]))
