"""Reading tool paths in APT."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from robot_programs.apt.circle import Instruction
from robot_programs.apt.resolve import LoadedTool, Reading, Resolver, tool_key
from robot_programs.apt.rewrite import rewrite
from robot_programs.apt.syntax import parse
from robot_programs.core.errors import FileError
from robot_programs.core.program import Frame, Program, Waypoint
from robot_programs.core.robot import Robot
from robot_programs.core.source import Source


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class AptProgram(Program):
    """Tool paths read from APT."""

    instructions: tuple[Instruction, ...]
    """Where each motion stands."""
    tool: Frame
    part: Frame
    tools: Mapping[str, Frame]

    def rewrite(self, robot: Robot, waypoints: Mapping[int, tuple[Waypoint, ...]]) -> tuple[Source, ...]:
        """The files with some motions rewritten; see `Program.rewrite`.

        A point without a tool axis keeps being one: its position changes, its axis stays. What counts from the end of a
        motion that moved, an incremental motion or an arc, is written anew with its own end.

        Raises:
            InputError: a motion is to become one to joint positions, which APT does not know.
        """
        return rewrite(self.sources, self.moves, self.instructions, waypoints)

    def reread(self, sources: tuple[Source, ...]) -> "AptProgram":
        """The program of other texts of the same files; see `Program.reread`."""
        return read_apt(sources, tool=self.tool, part=self.part, tools=self.tools)


def read_apt(
    sources: Sequence[Source],
    *,
    robot: Robot | None = None,
    tool: Frame | None = None,
    part: Frame | None = None,
    tools: Mapping[str, Frame] | None = None,
) -> AptProgram:
    """Read tool paths in APT. What changes coordinates, or moves in a way that is not read, becomes a diagnostic.

    Args:
        sources: the files, each a path of its own.
        robot: whose own tool moves where `tool` is not given.
        tool: what the positions are of; its z points out of the tool, against APT's tool axis.
        part: frame in which they are counted; the robot's base by default.
        tools: by the name or number by which the program loads them; `tool` is the first one where that is not among them.

    Raises:
        FileError: neither the tool nor the robot is given, or a file is not APT text.
    """
    if tool is None and robot is None:
        raise FileError(sources[0].path, "does not say what its positions are of; give the tool, or the robot")
    own = tool or Frame(name="", T=np.eye(4) if robot is None else robot.T_flange_tool)
    named = {tool_key(name): frame for name, frame in (tools or {}).items()}
    reading = Reading(part=part or Frame(name="", T=np.eye(4)))
    for number, source in enumerate(sources):
        if "\0" in source.text:
            raise FileError(source.path, "is a binary file; export it as APT source")
        loaded = LoadedTool(given=own, told=named, loaded=own)
        resolver = Resolver(reading=reading, source=source, number=number, tools=loaded)
        for statement in parse(source.text):
            resolver.read(statement)
    return AptProgram(
        sources=tuple(sources),
        moves=tuple(reading.moves),
        diagnostics=tuple(reading.diagnostics),
        instructions=tuple(reading.instructions),
        tool=own,
        part=reading.part,
        tools=named,
    )
