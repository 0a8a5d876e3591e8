"""TP programs as FANUC's controllers list them, with the frames and registers of a backup."""

from pathlib import Path

import numpy as np

from robot_programs.core.program import Frame
from robot_programs.core.source import Source
from robot_programs.tp.read import TpProgram, read_tp
from taskcal.robot.catalogue import load_robot

R2000 = load_robot("fanuc-r2000ic-165f")

FRAMES = """[*SYSTEM*]$MNUFRAME  Storage: CMOS  Access: RW  : ARRAY[2,9] OF POSITION
     [1,1] =
  Group: 1   Config: N D B, 0, 0, 0
  X:  1500.000   Y:  -200.000   Z:  -600.000
  W:     0.000   P:     0.000   R:    10.000
     [1,2] = 'table'
  Group: 1   Config: N D B, 0, 0, 0
  X:  1400.000   Y:   300.000   Z:  -500.000
  W:      .500   P:    -1.000   R:    20.000
     [2,1] =
  Group: 2
  X:     9.000   Y:     9.000   Z:     9.000
  W:     9.000   P:     9.000   R:     9.000
[*SYSTEM*]$MNUFRAMENUM  Storage: CMOS  Access: RW  : ARRAY[1] OF BYTE
     [1] = 1
[*SYSTEM*]$MNUTOOL  Storage: CMOS  Access: RW  : ARRAY[1,10] OF POSITION
     [1,1] =
  Group: 1   Config: N D B, 0, 0, 0
  X:    50.000   Y:     0.000   Z:   300.000
  W:     0.000   P:   -30.000   R:     0.000
"""

REGISTERS = """[*POSREG*]$POSREG  Storage: SHADOW  Access: RW  : ARRAY[1,100] OF Position Reg
    [1,1] =   'home'   Group: 1
  J1 =    20.000 deg   J2 =     0.000 deg   J3 =     0.000 deg
  J4 =     0.000 deg   J5 =   -90.000 deg   J6 =     0.000 deg

    [1,2] =   'X: 5 up'
  Group: 1   Config: N U T, 0, 0, 0
  X:     0.000   Y:     0.000   Z:    50.000
  W:     0.000   P:     0.000   R:     0.000
    [1,3] =   '' Uninitialized
    [1,4] =   'turned'
  Group: 1   Config: N U T, 0, 0, 0
  X:     0.000   Y:     0.000   Z:     0.000
  W:     0.000   P:     5.000   R:     0.000
    [1,5] =   'table'
  Group: 1   Config: N U T, 0, 0, -1
  X:   120.000   Y:    30.000   Z:   250.000
  W:   180.000   P:     0.000   R:    15.000
    [1,6] =   'on the rail'
  Group: 1   Config: N U T, 0, 0, 0
  X:   120.000   Y:    30.000   Z:   250.000
  W:   180.000   P:     0.000   R:    15.000
  EXT1:    40.492 mm
"""


def pose(
    x: float, y: float, z: float, w: float = 180.0, p: float = 0.0, r: float = 0.0, *,
    frames: str = "UF : 1, UT : 1", configuration: str = "N U T, 0, 0, 0",
) -> str:  # fmt: skip
    """A position as a pose, without its number."""
    return (
        f"   GP1:\r\n\t{frames},\t\tCONFIG : '{configuration}',\r\n"
        f"\tX = {x:9.3f}  mm,\tY = {y:9.3f}  mm,\tZ = {z:9.3f}  mm,\r\n"
        f"\tW = {w:9.3f} deg,\tP = {p:9.3f} deg,\tR = {r:9.3f} deg\r\n"
    )


def joints(*degrees: float, frames: str = "UF : 1, UT : 1") -> str:
    """A position as joints, without its number."""
    values = [f"J{k + 1}= {value:9.3f} deg" for k, value in enumerate(degrees)]
    rows = ",\r\n\t".join(",\t".join(values[k : k + 3]) for k in range(0, len(values), 3))
    return f"   GP1:\r\n\t{frames},\t\r\n\t{rows}\r\n"


def listing(instructions: list[str], positions: dict[str, str], name: str = "MILL") -> Source:
    """A listing; instructions without their numbers and semicolons, positions by what stands in their brackets."""
    lines = [f"/PROG  {name}", "/ATTR", "OWNER\t\t= MNEDITOR;", f"LINE_COUNT\t= {len(instructions)};", "/MN"]
    lines += [f"{k + 1:4}:{text}    ;" for k, text in enumerate(instructions)]
    lines += ["/POS", *(f"P[{label}]{{\r\n{inside}}};" for label, inside in positions.items()), "/END", ""]
    return Source.of(Path(f"{name.lower()}.ls"), "\r\n".join(lines).encode())


def backup() -> list[Source]:
    """The files of variables."""
    return [
        Source.of(Path("sysframe.va"), FRAMES.encode()),
        Source.of(Path("posreg.va"), REGISTERS.encode()),
    ]


POSITIONS = {
    "1": joints(0, 10, -20, 0, -60, 0),
    '2:"start"': pose(100, 200, 300),
    "3": pose(150, 250, 300),
    "4": pose(200, 200, 300),
    "5": pose(100, 0, 350, 170, 5, 30, frames="UF : 2, UT : 1"),
}


def read(
    *instructions: str,
    positions: dict[str, str] | None = None,
    tool: Frame | None = None,
    part: Frame | None = None,
) -> TpProgram:
    """A program of some instructions, with the backup's frames and registers."""
    source = listing(list(instructions), POSITIONS if positions is None else positions)
    return read_tp([source, *backup()], robot=R2000, tool=tool, part=part)


def degrees(*values: float) -> np.ndarray:
    return np.radians(values)
