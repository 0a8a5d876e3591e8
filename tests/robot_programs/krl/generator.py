"""Random KRL programs: declarations, frames and motions in any spelling that KRL allows."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robot_programs.core.source import Source

BLANKS = ("", " ", "  ", "\t")
COMMENTS = ("", "", "", " ; to the part", ";FOLD x;%{PE}", " ; \u00fcber den Tisch \u2013 lang", '; "{X 1" C_DIS')
PASSIVE = (
    "WAIT SEC 0.5", "$OUT[3]=TRUE", "BAS(#VEL_PTP,50)", "", "; nothing", "HALT", "I=I+1", "$ADVANCE=3", "DECL INT I2",
    "IF $IN[1] THEN\nHALT\nENDIF", "FOR I=1 TO 3\nENDFOR", "AGAIN:",
)  # fmt: skip


@dataclass(frozen=True)
class Generated:
    """A random program."""

    sources: tuple[Source, ...]
    motions: int
    """All of which can be resolved."""


LEANING = (
    "LIN {Z 100.5}",
    "lin_rel {X 10.0,Z -3} C_DIS #TOOL",
    "SLIN_REL {Y 1} #BASE",
    "LIN {X 1,Y 2}",
    "circ_rel {X 10,Y 5},{X 20.5} C_DIS",
)
"""Motions that count from where the one before ended."""


def generate(rng: np.random.Generator) -> Generated:
    """A ``.src`` and its ``.dat``, with tool and base set before the first motion."""
    points = [f"XP{i + 1}" for i in range(int(rng.integers(5)))]
    dat = ["&ACCESS RVP", "DEFDAT  PART PUBLIC", "EXT  BAS (BAS_COMMAND  :IN,REAL  :IN )"]
    dat += [f"DECL{_one(rng, BLANKS[1:])}E6POS {point}={_pose(rng)}{_one(rng, COMMENTS)}" for point in points]
    frames = [f"$TOOL={_pose(rng, status=False)}", f"$BASE = {_pose(rng, status=False)}"]
    declared = ["DECL E6POS FP", "INT N", "DECL FRAME F"]
    src = ["&ACCESS RVP", "&REL 3", "DEF PART( )", *declared, "BAS (#INITMOV,0 )", *frames, "$VEL.CP=0.1"]
    motions, calls = 0, False
    for _ in range(int(rng.integers(1, 9))):
        moves = rng.random() < 0.6
        motions += moves
        if rng.random() < 0.1:
            src += [f"LIN {_pose(rng)}", _one(rng, LEANING)]
            motions += 2
        if rng.random() < 0.1:
            src += _computed(rng)
            motions += 1
        if rng.random() < 0.15:
            lines, count = _flowing(rng, int(rng.integers(10**6)))
            src += lines
            motions += count
        if rng.random() < 0.1:
            src.append(_one(rng, ("SUB(1)", "sub( 2 )", "SUB(N,F)")))
            motions += not calls
            calls = True
        src.append(_one(rng, BLANKS) + (_motion(rng, points) if moves else _one(rng, PASSIVE)) + _one(rng, COMMENTS))
    above = ["DEFFCT E6POS ABOVE(P :IN,D :IN)", "DECL E6POS P", "REAL D", "P.Z=P.Z+D", "RETURN P", "ENDFCT"]
    sub = ["DEF SUB(N :IN,F :OUT)", "INT N", "DECL FRAME F", "N=N+1", f"LIN {_pose(rng)}", "END"] if calls else []
    newline, encoding = _one(rng, ("\r\n", "\n")), _one(rng, ("utf-8", "cp1252"))
    last = _one(rng, ("", newline))
    return Generated(
        sources=tuple(
            Source.of(Path(name), (newline.join(lines) + last).encode(encoding))
            for name, lines in (("part.src", [*src, "END", *sub, *above]), ("PART.DAT", [*dat, "ENDDAT"]))
        ),
        motions=motions,
    )


def _computed(rng: np.random.Generator) -> list[str]:
    """Lines that compute a point from constants, and a motion there."""
    steps = (
        [f"FP={_pose(rng)}", "FP.Z=FP.Z+1.5"],
        ["N=2", f"FP={_pose(rng)}", "IF N == 2 THEN", "FP.X=N*2-(1.5+FP.Y)", "ELSE", "FP.A=$ANIN[1]", "ENDIF"],
        [f"F={_pose(rng, status=False)}", f"FP=F:{_pose(rng, status=False)}"],
        [f"FP={_pose(rng)}", "$BASE.Z=$BASE.Z+1.5", "$TOOL.X = 2*2.5" if rng.random() < 0.3 else "N=3"],
    )
    return [
        *steps[int(rng.integers(len(steps)))],
        _one(
            rng,
            (
                "LIN FP",
                "ptp fp",
                "LIN FP:{X 0,Y 0,Z 1} C_DIS",
                "SLIN FP",
                "LIN Above(FP,2.5) C_DIS",
                "LIN FP:INV_POS(FP)",
            ),
        ),
    ]


def _flowing(rng: np.random.Generator, number: int) -> tuple[list[str], int]:
    """Lines with a flow that the text decides, and how many different motions they make."""
    ways = (
        ([f"FP={_pose(rng)}", "FOR I=1 TO 3", "FP.Z=FP.Z+1.5", "LIN FP", "ENDFOR"], 3),
        (["N=1", f"FP={_pose(rng)}", "WHILE N<3", "N=N+1", "FP.X=N*10", "SLIN FP C_DIS", "ENDWHILE"], 2),
        ([f"FP={_pose(rng)}", "N=0", "REPEAT", "N=N+1", "FP.Y=N", "PTP FP", "UNTIL N==2"], 2),
        (
            [f"FP={_pose(rng)}", "N=0", "LOOP", "N=N+1", "IF N>2 THEN", "EXIT", "ENDIF", "FP.Y=N", "PTP FP", "ENDLOOP"],
            2,
        ),
        ([f"FP={_pose(rng)}", f"L{number}:", "LIN FP", "IF $IN[1] THEN", f"GOTO L{number}", "ENDIF"], 1),
        ([f"FP={_pose(rng)}", f"GOTO L{number}", "FP.Z=0", f"L{number}:", "LIN FP"], 1),
        ([f"FP={_pose(rng)}", "SWITCH $ANIN[1]", "CASE 1,2", "HALT", "DEFAULT", "FP.Z=FP.Z", "ENDSWITCH", "LIN FP"], 1),
    )
    return ways[int(rng.integers(len(ways)))]


def _one(rng: np.random.Generator, choices: Sequence[str]) -> str:
    return choices[int(rng.integers(len(choices)))]


def _number(rng: np.random.Generator, low: float, high: float) -> str:
    places = int(rng.integers(7))
    value = rng.uniform(low, high)
    return _one(rng, (f"{value:.{places}f}", f"{value:.{places}f}", f"{value:.3E}", "0.0"))


def _pose(rng: np.random.Generator, *, status: bool = True) -> str:
    """A complete position in braces."""
    fields = [f"{name} {_number(rng, -900, 900)}" for name in "XYZ"]
    fields += [f"{name} {_number(rng, -180, 180)}" for name in "ABC"]
    if status and rng.random() < 0.8:
        fields += [f"S {rng.integers(8)}", _one(rng, (f"T {rng.integers(64)}", f"T 'B{rng.integers(64):06b}'"))]
    if rng.random() < 0.5:
        fields += [f"E{i} 0.0" for i in range(1, 7)]
    if rng.random() < 0.2:
        rng.shuffle(fields)
    kind = "E6POS: " if status and rng.random() < 0.3 else ""
    return f"{{{kind}{_one(rng, (',', ', ', ' ,')).join(fields)}}}"


def _motion(rng: np.random.Generator, points: list[str]) -> str:
    word = _one(rng, ("PTP", "LIN", "CIRC", "SPTP", "SLIN", "SCIRC"))
    joint = word.endswith("PTP")
    target = _operand(rng, points, axes=joint)
    if word.endswith("CIRC"):
        target = f"{_operand(rng, points)}{_one(rng, (',', ', '))}{target}"
    passing = _one(rng, ("", "", " C_PTP" if joint else " C_DIS"))
    return f"{_one(rng, (word, word.lower(), word.capitalize()))} {target}{passing}"


def _operand(rng: np.random.Generator, points: list[str], *, axes: bool = False) -> str:
    choice = rng.random()
    if axes and choice < 0.2:
        return "{" + ",".join(f"A{i} {_number(rng, -120, 30)}" for i in range(1, 7)) + "}"
    if points and choice < 0.5:
        return _one(rng, points)
    if points and choice < 0.7:
        return f"{_one(rng, points)}:{{X 1,Y 0,Z -2.5,A 0,B 0,C 3}}"
    return _pose(rng)
