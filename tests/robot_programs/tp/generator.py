"""Random TP programs, in the spellings of listings."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from robot_programs.core.program import Motion, Program, Waypoint
from robot_programs.core.source import Source
from taskcal.geometry import se3
from tests.robot_programs.tp.samples import backup, joints, pose

PASSIVE = (
    "  !note; with P[1]", "  WAIT    .50(sec)", "  DO[3:on]=ON", "", "  R[1]=R[1]+1", "  TIMER[1]=START", "  PAYLOAD[1]",
    "  IF R[1]=1,JMP LBL[1]", "  LBL[1]", "  CALL OTHER(1,'x')", "  UFRAME_NUM=1", "  UTOOL_NUM=1", "  OVERRIDE=50%",
    "  IF (DI[1]) THEN",
    "  ENDIF", "  FOR R[2]=1 TO 3", "  ENDFOR", "  //L P[1] 100mm/sec FINE",
)  # fmt: skip
FRAMES = ("UF : 1, UT : 1", "UF : 0, UT : 1")
TROUBLE = (
    "L P[1] 100mm/sec FINE INC", "L P[R[1]] 100mm/sec FINE", "J PR[99] 100% FINE", "  PR[2]=LPOS", "  UFRAME[1]=PR[5]",
    "  UFRAME_NUM=R[3]", "L P[1] 100mm/sec FINE Offset", "S P[1] 100mm/sec CNT100", "L P[1] FINE", "C P[1] 100mm/sec FINE",
    "  P[2]=LPOS", "J P[77] 10% FINE", "L P[1] 100mm/sec CNT100 COORD",
)  # fmt: skip


def generate(rng: np.random.Generator, trouble: bool = True) -> tuple[Source, ...]:
    """A listing and the backup's variables."""
    one = lambda choices: choices[int(rng.integers(len(choices)))]  # noqa: E731
    newline = str(one(["\r\n", "\n"]))
    count = int(rng.integers(1, 6))
    positions: list[str] = []
    of_joints: list[bool] = []
    for number in range(1, count + 1):
        comment = one(["", "", ':"on top"'])
        of_joints.append(bool(rng.random() < 0.3))
        if of_joints[-1]:
            inside = joints(*rng.uniform(-30, 30, 4), float(rng.uniform(-80, -20)), float(rng.uniform(-90, 90)))
        else:
            x, y, z = rng.uniform(-300, 300, 3)
            inside = pose(
                x,
                y,
                z,
                170 + rng.uniform(0, 9),
                *rng.uniform(-40, 40, 2),
                frames=one(["UF : 1, UT : 1", "UF : 0, UT : 1"]),
            )
        positions.append(f"P[{number}{comment}]{{\n{inside}}};")
    lines: list[str] = []
    for _ in range(int(rng.integers(1, 10))):
        if rng.random() < 0.5:
            number = int(rng.integers(1, count + 1))
            stop = one(["FINE", "CNT100", "CNT 0", "CNT5"])
            option = one(
                [
                    "",
                    "",
                    " ACC50",
                    " Offset,PR[2:up]",
                    " Tool_Offset,PR[2]",
                    " TB .10sec,CALL X",
                    " Skip,LBL[1]",
                    " Wjnt",
                ]
            )
            shifted = "ffset" in option and of_joints[number - 1]
            keyword, speed = one(
                [("J", "50%"), ("L", "500mm/sec"), ("L", "20.5cm/min"), ("L", "R[1:v]mm/sec"), ("A", "9inch/min")]
            )
            lines.append(f"{keyword} P[{number}{one(['', ':on top'])}] {speed} {stop}{'' if shifted else option}")
        elif rng.random() < 0.2:
            a, b = int(rng.integers(1, count + 1)), int(rng.integers(1, count + 1))
            lines.append(f"C P[{a}]    \n    :  P[{b}] 100mm/sec FINE")
        else:
            lines.append(one(PASSIVE if not trouble or rng.random() < 0.6 else TROUBLE))
    numbers = rng.random() < 0.8
    body = [f"{k + 1 if numbers else '':>4}:{line}    ;" for k, line in enumerate(lines)]
    text = [
        "/PROG  PART",
        "/ATTR",
        f"LINE_COUNT\t= {len(lines)};",
        "/APPL",
        "/MN",
        *body,
        "/POS",
        *positions,
        "/END",
        "",
    ]
    data = "\n".join(text).replace("\r\n", "\n").replace("\n", newline).encode(one(["utf-8", "latin-1"]))
    return (Source.of(Path("part.ls"), data), *backup())


def moved(move: Motion, shift: np.ndarray, turn: np.ndarray) -> Waypoint:
    """A motion's end, a little elsewhere."""
    q = move.end.q if move.end.q is not None else getattr(move.end.posture, "q", np.radians([0, 10, -20, 0, -60, 0]))
    if move.end.T is None:
        return Waypoint(kind=move.kind, q=q + np.resize(turn, 6), T=None)
    near = se3.pose(se3.exp(turn), shift)
    via = None if move.via is None else Waypoint(kind=move.kind, q=q, T=move.via.T @ near)
    return Waypoint(kind=move.kind, q=q, T=move.end.T @ near, via=via)


def nearby_waypoints(rng: np.random.Generator, program: Program, most: int) -> dict[int, tuple[Waypoint, ...]]:
    """Waypoints near the ends of some motions."""
    out: dict[int, tuple[Waypoint, ...]] = {}
    for number, move in enumerate(program.motions):
        if rng.random() < 0.5:
            pieces = 1 if move.kind in ("axes", "joint") else int(rng.integers(1, most + 1))
            out[number] = tuple(
                replace(moved(move, rng.uniform(-1e-3, 1e-3, 3), rng.uniform(-1e-3, 1e-3, 3))) for _ in range(pieces)
            )
    return out
