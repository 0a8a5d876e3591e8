"""$ORI_TYPE: lines and arcs that keep the orientation in which they begin, against a small machine that runs the program."""

import re
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from scipy.spatial.transform import Rotation

from tests.laws.robots import generators
from tests.robot_programs.krl.samples import FRAMES, POSE, read, texts

Line = tuple[str, ...]


@dataclass
class Machine:
    """A controller that runs such lines, at any branch: how its tool is turned where each motion ends, by the motion's line."""

    rng: np.random.Generator
    lines: list[Line]
    found: dict[int, list[np.ndarray]] = field(default_factory=dict)

    def run(self) -> dict[int, list[np.ndarray]]:
        constant, R, at = False, np.eye(3), 0
        while at < len(self.lines):
            kind, *given = self.lines[at]
            if kind == "orientation":
                constant = given[0] == "#CONSTANT"
            elif kind in ("PTP", "LIN", "CIRC"):
                if kind == "PTP" or not constant:
                    a, b, c = (float(word) for word in given[0].split())
                    R = Rotation.from_euler("ZYX", [a, b, c], degrees=True).as_matrix()
                self.found.setdefault(at, []).append(R)
            elif kind == "IF" and self.rng.random() < 0.5:
                at = next(k for k in range(at, len(self.lines)) if self.lines[k][0] == "ELSE")
            elif kind == "ELSE":
                at = next(k for k in range(at, len(self.lines)) if self.lines[k][0] == "ENDIF")
            at += 1
        return self.found


def written(rng: np.random.Generator, line: Line) -> str:
    def point(angles: str = "") -> str:
        numbers = [f"{v:.3f}" for v in rng.uniform([800, -100, 700], [900, 100, 800])]
        named = [*zip("XYZ", numbers, strict=True), *zip("ABC", angles.split(), strict=False)]
        return "{" + ",".join(f"{name} {value}" for name, value in named) + "}"

    match line:
        case ("orientation", value):
            return f"$ORI_TYPE={value}"
        case ("PTP" | "LIN" as kind, angles):
            return f"{kind} {point(angles)}"
        case ("CIRC", angles):
            return f"CIRC {point()},{point(angles)}"
        case ("IF",):
            return "IF $IN[1] THEN"
        case (kind,):
            return kind
        case _:
            raise AssertionError(line)


def random_lines(rng: np.random.Generator) -> list[Line]:
    """A program whose first motion is PTP, perhaps with a branch."""

    def some(count: int) -> list[Line]:
        out: list[Line] = []
        for _ in range(count):
            angles = " ".join(f"{v:.2f}" for v in rng.uniform(-80.0, 80.0, 3))
            kind = str(rng.choice(["PTP", "LIN", "LIN", "LIN", "CIRC"]))
            out += [("orientation", str(rng.choice(["#CONSTANT", "#VAR"])))] if rng.random() < 0.4 else []
            out.append((kind, angles))
        return out

    first: list[Line] = [("PTP", "10.0 80.0 5.0")]
    if rng.random() < 0.5:
        return [*first, *some(int(rng.integers(1, 6)))]
    branches = [*some(int(rng.integers(0, 3))), ("ELSE",), *some(int(rng.integers(0, 3)))]
    return [*first, *some(2), ("IF",), *branches, ("ENDIF",), *some(3)]


@given(generators)
def test_each_motion_ends_as_a_machine_turns_its_tool(rng: np.random.Generator) -> None:
    lines = random_lines(rng)
    body = "\n".join(written(rng, line) for line in lines)
    program = read(f"{FRAMES}{body}")
    offset = 2 + FRAMES.count("\n")
    by_line: dict[int, list[np.ndarray]] = {}
    for move in program.motions:
        assert move.end.T is not None
        by_line.setdefault(move.place.line - offset, []).append(move.end.T[:3, :3])
        if move.via is not None and move.via.T is not None:
            np.testing.assert_allclose(move.via.T[:3, :3], move.end.T[:3, :3])
    for _ in range(4):
        for at, turned in Machine(rng, lines).run().items():
            for R in turned if at in by_line else ():
                assert min(np.abs(R - one).max() for one in by_line[at]) < 1e-9, body
    if ("IF",) not in lines:  # one way: nothing is left
        assert set(by_line) == {k for k, line in enumerate(lines) if line[0] in ("PTP", "LIN", "CIRC")}


DAT = "DECL LDAT LKEEP={VEL 2.0,ACC 100.0,APO_DIST 50.0,APO_FAC 50.0,ORI_TYP #CONSTANT}\nDECL LDAT LTURN={VEL 2.0,ORI_TYP #VAR}"
INLINE = f"FDAT_ACT={{TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE}}\nBAS(#PTP_PARAMS,100)\nPTP {POSE}\n"
LINE = "LIN {X 850,Y 50,Z 750,A 30,B 60,C 10}"


@pytest.mark.parametrize(
    ("before", "line", "kept"),
    [
        ("$ORI_TYPE = #CONSTANT", LINE, [True]),
        ("$ORI_TYPE=#VAR ; not #CONSTANT", LINE, [False]),
        (f"{INLINE}LDAT_ACT=LKEEP\nBAS(#CP_PARAMS,0.2)", LINE, [True]),
        (f"{INLINE}LDAT_ACT=LTURN\nBAS(#CP_PARAMS,0.2)", LINE, [False]),
        ("$ORI_TYPE=#CONSTANT\nBAS(#INITMOV,0)\n" + FRAMES, LINE, [False]),
        ("", f"S{LINE} WITH $ORI_TYPE=SORI_TYP(LKEEP)\n{LINE}", [True, False]),
        ("", f"S{LINE} WITH $ORI_TYPE=#CONSTANT\n{LINE}", [True, False]),
        ("KEEP( )", LINE, [True]),
    ],
)
def test_it_is_set_by_whatever_sets_it(before: str, line: str, kept: list[bool]) -> None:
    body = f"{FRAMES}PTP {POSE}\n{before}\n{line}"
    program = read(body, dat=DAT, more="DEF KEEP( )\n$ORI_TYPE=#CONSTANT\nEND\n")
    start, *ends = (move.end.T for move in program.motions[-len(kept) - 1 :])
    assert len(program.motions) == len(kept) + 1 + before.count("PTP {"), texts(program)
    assert start is not None
    assert [bool(np.allclose(T[:3, :3], start[:3, :3])) for T in ends if T is not None] == kept


@pytest.mark.parametrize(
    ("lines", "reason"),
    [
        (f"PTP {{A1 0,A2 -90,A3 90,A4 0,A5 45,A6 0}}\n$ORI_TYPE=#CONSTANT\n{LINE}", "keeps the orientation in which it begins"),
        (f"PTP {POSE}\n$ORI_TYPE=#CONSTANT\n$TOOL={{X 0,Y 0,Z 50,A 0,B 0,C 0}}\n{LINE}", "keeps the orientation"),
        (f"PTP {POSE}\n$ORI_TYPE=#IGNORE\n{LINE}", "is #IGNORE; known are #VAR, #CONSTANT and #JOINT"),
        (f"PTP {POSE}\n$ORI_TYPE=HOW\n{LINE}", r"\(\$ORI_TYPE\) is not known before it"),
        (f"PTP {POSE}\n$ORI_TYPE=#CONSTANT\nSPLINE\nSPL {POSE}\nS{LINE}\nENDSPLINE", "keeps the orientation"),
    ],
)  # fmt: skip
def test_what_the_text_does_not_tell_is_left_with_the_reason(lines: str, reason: str) -> None:
    program = read(f"{FRAMES}{lines}")
    assert any(re.search(reason, text) for text in texts(program)), texts(program)


def test_turned_by_the_wrist_it_is_not_divided() -> None:
    program = read(f"{FRAMES}PTP {POSE}\n$ORI_TYPE=#JOINT\n{LINE}\n$ORI_TYPE=#VAR\n{LINE}")
    assert [move.divisible for move in program.motions] == [True, False, True]
    assert program.motions[1].end.T is not None
    expected = Rotation.from_euler("ZYX", [30.0, 60.0, 10.0], degrees=True).as_matrix()
    np.testing.assert_allclose(program.motions[1].end.T[:3, :3], expected, atol=1e-12)


@pytest.mark.parametrize(("keyword", "wrapped"), [("LIN", False), ("PTP", True)])
def test_no_function_is_put_around_a_point_whose_orientation_is_not_reached(keyword: str, wrapped: bool) -> None:
    body = f"DECL E6POS P\n{FRAMES}PTP {POSE}\n$ORI_TYPE=#CONSTANT\nP.X=$SEN_PINT[1]\n{keyword} P"
    wrapping = read(body).wrap("TaskcalCorrected", None)
    assert bool(wrapping.wrapped) is wrapped
    said = any("$ORI_TYPE" in one.text for one in wrapping.left)
    assert said is not wrapped
