"""Points that only the running program knows get a function where no base moves with something else."""

from pathlib import Path

import pytest

from robot_programs.core.source import Source
from robot_programs.krl.read import read_krl

PART = "DEF PART ( )\nDECL E6POS PICK\n{}ASK (PICK)\nLIN PICK C_DIS\nEND\n"
BAS = "DEF BAS (COMMAND :IN)\nDECL BAS_COMMAND COMMAND\nEND\nDEF EB_BASE (N :IN)\nDECL INT N\n$BASE=EB(N)\nEND\n"
ON_ROBOT = 'MACHINE_FRAME_DAT[2]={MACH_DEF_INDEX 0,PARENT[] " "}'
ON_TABLE = 'MACHINE_FRAME_DAT[2]={MACH_DEF_INDEX 2,PARENT[] "TABLE"}'


@pytest.mark.parametrize(
    ("line", "bases", "gets"),
    [
        ("", ON_ROBOT, True),
        ("", ON_TABLE, False),
        ("$BASE=EB(2)\n", ON_ROBOT, False),
        ("BAS (#EX_BASE,2)\n", ON_ROBOT, False),
    ],
)
def test_point_gets_a_function_where_no_base_is_carried(line: str, bases: str, gets: bool) -> None:
    """The controller's own BAS can couple a base to anything; what counts is what the program and its bases say."""
    files = {"part.src": PART.format(line), "bas.src": BAS, "$config.dat": f"DEFDAT $CONFIG\n{bases}\nENDDAT\n"}
    program = read_krl([Source.of(Path(name), text.encode()) for name, text in files.items()])
    found = program.wrap("CORRECTED", None)
    assert [place.path.name for place in found.wrapped] == (["part.src"] if gets else [])
    assert ("LIN CORRECTEDPath(PICK) C_DIS" in found.program.sources[0].text) == gets
    assert len(found.left) == (0 if gets else 1)
