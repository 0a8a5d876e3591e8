"""Random programs in APT, as CAM systems write them."""

from dataclasses import replace

import numpy as np

from robot_programs.core.program import Motion, Program, Waypoint
from taskcal.geometry import se3

_NOISE = [
    "$$ a note, with / and $ 1,2,3",
    "PPRINT OPERATION 1/2, GOTO/1,2,3",
    "SPINDL/ 2300.0,CLW",
    "COOLNT/ON",
    "MULTAX/ON",
    "FEDRAT/MMPM,250.0",
    "FEDRAT/ 900.",
    "RAPID",
    "CUTTER/ 10.0,0.5",
    "PAINT/COLOR,42",
    "LOADTL/1",
    "PSIS/(PLANE/0,0,1,0)",
    "",
]
_TROUBLE = [
    "CIRCLE/0,0,0,0,0,1,5",
    "CIRCLE/0,0,0,0,0,1",
    "GOHOME/1,2,3",
    "ORIGIN/1,2,3",
    "ORIGIN/0,0,0",
    "GOTO/P1",
    "GOTO/1,2",
    "TRACUT/M1",
    "TRACUT/NOMORE",
    "CYCLE/DRILL,5",
    "CYCLE/OFF",
    "UNITS/INCH",
    "UNIT/INCH",
    "CSYS/1,0,0,0,0,1,0,0,0,0,1,0",
    "CSYS/1,0,0,5,0,1,0,0,0,0,1,0",
    "LOAD/TOOL,1",
    "LOAD/TOOL,2",
    "FROBNI/1",
    "UNITS/MM",
    "TLAXIS/0,0,1",
    "MSYS/1,0,0",
    "LOADTL/2",
]


def _point(rng: np.random.Generator, digits: int, axis: bool, word: str) -> str:
    size = 10.0 if word == "GODLTA" else 900.0
    texts = [f"{v:{rng.choice(['', '12'])}.{digits}f}" for v in rng.uniform(-size, size, 3)]
    if axis:
        direction = rng.normal(size=3)
        texts += [f"{v:.6f}" for v in direction / np.linalg.norm(direction)]
    comma = str(rng.choice([",", ", "]))
    if axis and rng.random() < 0.3:
        return f"{word}/{comma.join(texts[:3])},$\n  {comma.join(texts[3:])}"
    return f"{word}{rng.choice(['/', ' / '])}{comma.join(texts)}"


def _arc(rng: np.random.Generator) -> str:
    """A point and an arc from there, in a plane of any direction."""
    center, radius, sweep = rng.uniform(-500, 500, 3), rng.uniform(5, 100), rng.uniform(0.1, 6.1)
    x, y = np.linalg.qr(rng.normal(size=(3, 2)))[0].T
    end = center + radius * (np.cos(sweep) * x + np.sin(sweep) * y)
    text = lambda v: ",".join(f"{c:.5f}" for c in v)  # noqa: E731
    second = "2,INTOF," if sweep > np.pi else ""
    if rng.random() < 0.6:
        full, nx = rng.random() < 0.3, rng.random() < 0.5
        axis = ",".join(f"{c:.9f}" for c in (np.cross(y, x) if nx else np.cross(x, y)))
        return (
            f"GOTO/{text(center + radius * x)}\n"
            f"CIRCLE/{text(center)},{axis}{f',{radius:.5f},0.06,0.5,10.0,0.0' if nx else ''}\n"
            f"{rng.choice(['', '', 'PAINT/COLOR,31'])}\nGOTO/{text(center + radius * x if full else end)}"
        )
    return (
        f"GOTO/{text(center + radius * x)}\nAUTOPS\nINDIRV/ {text(y)}\n"
        f"TLON,GOFWD/ (CIRCLE/ {text(center)},$\n {radius:.5f}),ON,{second}(LINE/ {text(center)},$\n {text(end)})"
    )


def generate(rng: np.random.Generator, trouble: bool = True) -> bytes:
    """A program with points, increments, arcs and, where wanted, what makes motions uncertain."""
    digits = int(rng.integers(7))
    kinds = ["GOTO", "GOTO", "GOTO", "GODLTA", "FROM", "arc", "noise", "noise", *(["trouble"] if trouble else [])]
    lines = ["PARTNO TEST", "UNITS/MM"]
    for kind in rng.choice(kinds, int(rng.integers(1, 13))):
        if kind == "arc":
            lines.append(_arc(rng))
        elif kind in ("noise", "trouble"):
            lines.append(str(rng.choice(_NOISE if kind == "noise" else _TROUBLE)))
        else:
            lines.append(_point(rng, digits, bool(rng.random() < 0.5), str(kind)))
    text = "\n".join(lines) + str(rng.choice(["", "\n", "\nFINI\n"]))
    if rng.random() < 0.3:
        text = text.lower()
    text = text.replace("\n", str(rng.choice(["\n", "\r\n"])))
    return text.encode(str(rng.choice(["utf-8", "utf-8-sig"])))


def nearby_waypoints(rng: np.random.Generator, program: Program, most: int) -> dict[int, tuple[Waypoint, ...]]:
    """New waypoints near the ends of some motions; arcs move as a whole, or become lines."""
    shift = rng.uniform(1e-5, 1e-3, 3)
    curved = any(move.kind == "circular" for move in program.motions)
    waypoints: dict[int, tuple[Waypoint, ...]] = {}
    for number, move in enumerate(program.motions):
        if not curved and rng.random() < 0.5:
            continue
        if move.via is not None and rng.random() < 0.5:
            waypoints[number] = (_waypoint(move, shift),)
            continue
        count = int(rng.integers(1, most + 1))
        line = move if move.via is None else replace(move, kind="linear", via=None)
        waypoints[number] = tuple(_waypoint(line, shift) for _ in range(count))
    return waypoints


def _waypoint(move: Motion, shift: np.ndarray) -> Waypoint:
    def moved(T: np.ndarray | None) -> np.ndarray:
        assert T is not None
        return se3.translation(*shift) @ T

    via = None if move.via is None else Waypoint(kind="circular", q=np.zeros(6), T=moved(move.via.T))
    return Waypoint(kind=move.kind, q=np.zeros(6), T=moved(move.end.T), via=via)
