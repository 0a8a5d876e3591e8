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


def wrapped(*texts: str, data: str = "") -> tuple[list[str], list[str]]:
    """Motions of some files that get a function, and what is said of the others."""
    files = {f"f{k}.src": text for k, text in enumerate(texts)} | {"$config.dat": f"DEFDAT $CONFIG\n{data}\nENDDAT\n"}
    found = read_krl([Source.of(Path(name), text.encode()) for name, text in files.items()]).wrap("NEW", None)
    lines = [found.program.sources[int(p.path.stem[1:])].text.splitlines()[p.line - 1].strip() for p in found.wrapped]
    return lines, [d.text for d in found.left]


@pytest.mark.parametrize(
    ("motion", "becomes"),
    [
        ("PTP P", "PTP NEW(P)"),
        ("SLIN P", "SLIN NEWPath(P)"),
        ("CIRC P,F", "CIRC NEWPath(P),NEWFrame(F)"),
        ("PTP F", "PTP NEWFrame(F)"),
        ("PTP P:F", "PTP NEWFrame(P:F:$NULLFRAME)"),
        ("LIN F:P", "LIN NEWFrame(F:P:$NULLFRAME)"),
        ("LIN P:{X 1,Y 2,Z 3,A 0,B 0,C 0} C_DIS", "LIN NEWFrame(P:{X 1,Y 2,Z 3,A 0,B 0,C 0}:$NULLFRAME) C_DIS"),
        ("LIN INV_POS(F):P", "LIN NEWFrame(INV_POS(F):P:$NULLFRAME)"),
        ("LIN XP1", "LIN NEWFrame(XP1:$NULLFRAME)"),
        ("FDAT_ACT=FP1\nPTP XP1 C_PTP", "PTP NEW(XP1) C_PTP"),
        ("FDAT_ACT=FHOME\nPTP XHOME", ""),
        ("PTP F:P", ""),
        ("PTP XP1", ""),
        ("LIN P:{X 1}", ""),
        ("LIN OTHERS(P)", ""),
        ("LIN $POS_ACT:F", ""),
        ("PTP Q", ""),
        ("LIN_REL {X 1}", "LIN NEWFrame({FRAME: X 1,Y 0,Z 0,A 0,B 0,C 0}:NEWHere())"),
        ("LIN_REL{Z -H, A 0} #Tool C_DIS", "LIN NEWFrame(NEWHere():{FRAME: X 0,Y 0,Z -H,A 0,B 0,C 0}) C_DIS"),
        ("SPTP_REL {X 1} #BASE", "SPTP NEWFrame({FRAME: X 1,Y 0,Z 0,A 0,B 0,C 0}:NEWHere())"),
        (
            "CIRC_REL {X 1},{Y 2}",
            "CIRC NEWFrame({FRAME: X 1,Y 0,Z 0,A 0,B 0,C 0}:NEWHere()),NEWFrame({FRAME: X 0,Y 2,Z 0,A 0,B 0,C 0}:NEWHere())",
        ),
        (
            "CIRC P,F:P, CA -H C_DIS",
            "CIRC NEWFrame(NEWArc(P:$NULLFRAME,F:P:$NULLFRAME,0.5*(-H))),"
            "NEWFrame(NEWArc(P:$NULLFRAME,F:P:$NULLFRAME,1.0*(-H))) C_DIS",
        ),
        ("CIRC_REL {X 1},{Y 2},CA 90", ""),
        ("CIRC P,Q,CA 90", ""),
        ("LIN_REL {X 1,A 5}", ""),
        ("LIN_REL F", ""),
        ("PTP_REL {A1 5}", ""),
        ("LIN_REL {X $POS_ACT.X}", ""),
    ],
)
def test_function_serves_the_type_of_a_point(motion: str, becomes: str) -> None:
    """What is a FRAME by its last part is one; of a PTP to anything else status and turn have to be known."""
    text = f"DEF A ( )\nDECL E6POS P\nDECL FRAME F\nDECL E6AXIS Q\nASK(P,F,Q)\n{motion}\nEND\n"
    lines, left = wrapped(text)
    assert lines == ([becomes] if becomes else [])
    assert len(left) == (not becomes)


PROBED = "DEF PROBE ( )\n{}BASE_DATA[3]=MET:F\nEND\n"
MAIN = "DEF MAIN ( )\nDECL E6POS P\nASK(P)\n{}LIN P\nEND\n"


@pytest.mark.parametrize(
    ("main", "probe", "gets", "says"),
    [
        ("PROBE()\n", "MET=$POS_INT\n", False, "'BASE_DATA' comes from where the robot stood"),
        ("", "MET=$POS_INT\n", True, "BASE_DATA is not corrected at run time: it is set from where the robot stood"),
        ("PROBE()\n", "MET=GIVEN\n", True, ""),
        ("PROBE()\n", "DECL FRAME MET\nMET=$POS_INT\nMET.X=0\n", False, "'BASE_DATA' comes from"),
        ("PROBE()\n", "DECL FRAME P\nP=$POS_INT\n", True, ""),
        ("INTERRUPT DECL 5 WHEN $IN[1] DO PROBE()\n", "MET=$POS_INT\n", False, "'BASE_DATA' comes from"),
    ],
)
def test_base_from_where_the_robot_stood_is_true_already(main: str, probe: str, gets: bool, says: str) -> None:
    """Unless a program of its own sets it; and a variable of one routine is none of another."""
    lines, left = wrapped(
        MAIN.format(main), PROBED.format(probe), data="DECL FRAME MET\nDECL FRAME F\nDECL FRAME GIVEN"
    )
    assert lines == (["LIN NEWPath(P)"] if gets else [])
    assert says in "".join(left)
    assert bool(left) == bool(says)
