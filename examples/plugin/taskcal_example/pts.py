"""A language of programs: lines ``LIN x y z w p r``, millimetres and degrees about fixed x, y, z, in the robot's base."""

import re
from dataclasses import dataclass

import numpy as np

from robot_programs import FileError, Frame, Language, Motion, Program, Target
from robot_programs.core.program import angles, rotation
from robot_programs.core.source import TextEdit

LINE = re.compile(r"^[ \t]*LIN((?:[ \t]+[-+.\d]+){6})[ \t]*\r?$", re.MULTILINE)
"""A motion; lines that begin with LIN and are none are refused, all others are left as they are."""


def numbers_of(T) -> str:
    """The six numbers of a pose."""
    w, p, r = angles(T[:3, :3])[::-1]
    return " ".join(f"{value:.6f}" for value in (*(1e3 * T[:3, 3]), w, p, r))


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class PtsProgram(Program):
    """Paths of straight lines."""

    spans: tuple[tuple[int, int, int], ...]
    """Where the numbers of each motion stand: number of the file, first character, and the one behind the last."""
    given: object
    """Robot, tool and part, as they were given."""

    def rewrite(self, robot, waypoints):
        """The files with other numbers; a motion with several waypoints becomes as many lines."""
        edits = [[] for _ in self.sources]
        for number, path in waypoints.items():
            file, start, end = self.spans[number]
            text = f"{self.sources[file].newline}LIN ".join(numbers_of(waypoint.T) for waypoint in path)
            edits[file].append(TextEdit(start=start, end=end, text=text))
        return tuple(source.edited(own) for source, own in zip(self.sources, edits, strict=True))

    def reread(self, sources):
        """The program of other texts."""
        return read(sources, self.given)


def read(sources, given) -> PtsProgram:
    """Read paths; the tool is the robot's own where none is given."""
    if given.tool is None and given.robot is None:
        raise FileError(sources[0].path, "does not say what its positions are of; give the tool, or the robot")
    tool = given.tool or Frame(name="", T=given.robot.T_flange_tool)
    part = given.part or Frame(name="", T=np.eye(4))
    motions, spans = [], []
    for file, source in enumerate(sources):
        for wrong in re.finditer(r"^[ \t]*LIN\b.*$", source.text, re.MULTILINE):
            if not LINE.match(wrong[0]):
                message = f"'{wrong[0].strip()}' is not a motion; write LIN and six numbers, x y z w p r"
                raise FileError(source.path, message, line=source.line(wrong.start()))
        for number, match in enumerate(LINE.finditer(source.text)):
            x, y, z, w, p, r = map(float, match[1].split())
            T = np.eye(4)
            T[:3, :3], T[:3, 3] = rotation(r, p, w), 1e-3 * np.array([x, y, z])
            place = source.place(match.start(1))
            end = Target(name="", T=T, q=None, posture=None, place=place)
            motions.append(
                Motion(
                    kind="linear",
                    end=end,
                    via=None,
                    tool=tool,
                    part=part,
                    part_in_hand=False,
                    speed=None,
                    stops=True,
                    follows=len(motions) - 1 if number else None,
                    routine=source.path.stem,
                    place=place,
                )
            )
            spans.append((file, match.start(1) + len(match[1]) - len(match[1].lstrip()), match.end(1)))
    return PtsProgram(sources=tuple(sources), motions=tuple(motions), diagnostics=(), spans=tuple(spans), given=given)


PTS = Language(name="PTS", suffixes=(".pts",), read=read, compose=None, declares_frames=False, marks=r"^[ \t]*LIN\b")
