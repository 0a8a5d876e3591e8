"""URScript programs as PolyScope generates them and as people write them."""

from pathlib import Path

from robot_programs.core.program import Frame
from robot_programs.core.source import Source
from robot_programs.urscript.read import read_urscript
from robot_programs.urscript.rewrite import UrscriptProgram
from taskcal.robot.catalogue import load_robot

UR5 = load_robot("ur5")

TCP = "set_tcp(p[0.0, 0.0, 0.1, 0.0, 0.0, 0.0])"
WAYPOINTS = """  global Waypoint_1_p=p[-.143968656714, -.435620060803, .202030025428, -.001221359682, 3.116276528482, .038891915637]
  global Waypoint_1_q=[-1.6007, -1.7271, -2.203, -0.808, 1.5951, -0.031]
  global Plane_1=p[.4, -.2, .1, 0.0, 0.0, .5]
"""


def source(text: str, name: str = "prog.script") -> Source:
    return Source.of(Path(name), text.encode())


def read(*lines: str, tcp: bool = True, tool: Frame | None = None, part: Frame | None = None) -> UrscriptProgram:
    """A program of some statements, with two waypoints and a feature."""
    body = "".join(f"  {line}\n" for line in ([TCP] if tcp else []) + list(lines))
    return read_urscript((source(f"def prog():\n{WAYPOINTS}{body}end\n"),), robot=UR5, tool=tool, part=part)
