"""Programs of a few lines."""

from robot_programs.krl.read import KrlProgram, read_krl
from tests.robot_programs.krl.samples import CONFIG_DAT, source

FRAMES = "$TOOL={X 0,Y 0,Z 100,A 0,B 0,C 0}\n$BASE=$NULLFRAME\n"


POSE = "{X 900,Y 0,Z 800,A 0,B 90,C 0}"


def read(body: str, dat: str = "", config: str = CONFIG_DAT, more: str = "") -> KrlProgram:
    sources = [source("part.src", f"DEF PART( )\n{body}\nEND\n{more}")]
    if dat:
        sources.append(source("part.dat", f"DEFDAT PART\n{dat}\nENDDAT\n"))
    return read_krl([*sources, source("$config.dat", config)])


def texts(program: KrlProgram) -> list[str]:
    return [str(diagnostic) for diagnostic in program.diagnostics]
