"""The languages that run the conformance set: how a program is written and read in each, and what a robot of it is."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from robot_programs.apt.read import read_apt
from robot_programs.core.program import Frame, Motion, Program
from robot_programs.core.robot import Robot
from robot_programs.core.source import Source
from robot_programs.csv_path.read import read_csv_path
from robot_programs.krl.read import read_krl
from robot_programs.rapid.read import read_rapid
from robot_programs.tp.read import read_tp
from robot_programs.urscript.read import read_urscript
from tests.robot_programs import small_language as small
from tests.robot_programs.conformance.cases import CASES, UNWRITABLE

Went = set[tuple[int, tuple[int, ...]]]
"""Lines, and places to which they send the robot."""

DOWN = np.diag([1.0, -1.0, -1.0, 1.0])


@dataclass(frozen=True, kw_only=True)
class Language:
    """One language."""

    write: type[small.Writer]
    read: Callable[..., Program]
    robot: str
    home: tuple[float, ...]
    """Joint positions of the robot above the program's origin, degrees; of the posture that the writer states."""
    given: np.ndarray | None = None
    """The tool that is given where the text states none, in the writer's own."""

    def surroundings(self, tool: np.ndarray) -> dict[str, Frame]:
        """What is told to the reader beside the text."""
        return {} if self.given is None else {"tool": Frame(name="tool", T=tool @ self.given)}

    def written(self, program: small.Program, tool: np.ndarray | None = None, home: bool = False) -> list[Source]:
        """The texts of a program."""
        return self.write(tool, self.home if home else ()).program(program)

    def reading(self, sources: Sequence[Source], tool: np.ndarray | None = None, robot: Robot | None = None) -> Program:
        """What is read of texts."""
        around = self.surroundings(np.eye(4) if tool is None else tool)
        return self.read(
            sources, **around, **({} if robot is None or self.read in (read_rapid, read_krl) else {"robot": robot})
        )


ABB = {"robot": "abb-irb120", "home": (10.0, 20.0, 10.0, 10.0, 50.0, 20.0)}
LANGUAGES = {
    "RAPID": Language(write=small.Rapid, read=read_rapid, **ABB),
    "KRL": Language(
        write=small.KrlInOneFile, read=read_krl, robot="kuka-kr16-2", home=(10.0, -70.0, 90.0, 10.0, 50.0, -20.0)
    ),
    "URScript": Language(
        write=small.Urscript, read=read_urscript, robot="ur5", home=(10.0, -70.0, 90.0, -100.0, -80.0, 20.0)
    ),
    "TP": Language(
        write=small.Tp, read=read_tp, robot="fanuc-r2000ic-165f", home=(5.0, 10.0, -20.0, 10.0, -50.0, 20.0)
    ),
    "APT": Language(write=small.Apt, read=read_apt, given=DOWN, **ABB),
    "CSV": Language(write=small.Csv, read=read_csv_path, given=np.eye(4), **ABB),
}


def place_of(motion: Motion) -> tuple[int, tuple[int, ...]]:
    """Its line, and the place to which it leads outside of any frame, to a whole millimetre."""
    xyz = motion.flange(motion.end.T)[:3, 3] * 1e3
    return motion.place.line, tuple(round(value) for value in xyz)


def understood(program: Program) -> Went:
    """Lines and places of all motions."""
    return {place_of(motion) for motion in program.motions}


def refused(program: Program) -> set[int]:
    """Lines of motions that are not read."""
    return {d.place.line for d in program.diagnostics if d.unread}


RUNNING = [(name, case) for name in LANGUAGES for case in CASES if case not in UNWRITABLE.get(name, {})]
"""Languages with the cases that they run."""
