"""Long robot programs, read and corrected: time of twice as many lines over time of as many."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from jaxtyping import Float

from robot_programs import read_program
from robot_programs.core.program import Surroundings
from robot_programs.core.source import read_source
from robot_programs.languages import language_of
from taskcal.correction.correct import correct
from taskcal.geometry import se3
from taskcal.identification.identify import identify
from taskcal.robot.error_model import ErrorModel

RAPID = """MODULE Long
PERS tooldata tGun:=[TRUE,[[10,20,300],[1,0,0,0]],[5,[0,0,100],[1,0,0,0],0,0,0]];
PERS wobjdata wPart:=[FALSE,TRUE,"",[[500,0,300],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
PROC main()
{}ENDPROC
ENDMODULE
"""
KRL = """DEF long()
$TOOL={{X 10,Y 20,Z 300,A 0,B 0,C 0}}
$BASE={{X 500,Y 0,Z 300,A 0,B 0,C 0}}
{}END
"""

MOST = 3.0
"""Time of twice as many lines over that of as many: 2 where it is linear, 4 where it grows with the square; up to 2.2 was measured
beside other work."""


LINE = (
    "MoveL [[{:.3f},{:.3f},{:.3f}],[{:.6f},{:.6f},{:.6f},{:.6f}],[0,-1,0,1],"
    "[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v200,z1,tGun\\WObj:=wPart;\n"
)


def rapid(n: int) -> str:
    """Motions to targets that are written out, with a declared tool and work object."""
    rng = np.random.default_rng(0)
    q = rng.normal(size=(n, 4))
    rows = np.hstack([rng.uniform(-500.0, 500.0, (n, 3)), q / np.linalg.norm(q, axis=1, keepdims=True)])
    return RAPID.format("".join(LINE.format(*row) for row in rows.tolist()))


def meander(n: int, T: Float[np.ndarray, "4 4"]) -> str:
    """Motions a millimetre apart about a pose of the robot's flange, without a tool: there and back, row by row."""
    row, column = np.divmod(np.arange(n), 100)
    xyz = T[:3, 3] * 1e3 + np.stack([np.where(row % 2, 99 - column, column), row % 100, 0 * row], axis=1)
    qx, qy, qz, qw = se3.to_quaternion(T[:3, :3])
    lines = (LINE.format(*place, qw, qx, qy, qz) for place in xyz.tolist())
    return f"MODULE m\nPROC main()\n{''.join(lines).replace(TOOL, 'tool0')}ENDPROC\nENDMODULE\n"


TOOL = "tGun\\WObj:=wPart"


def krl(n: int) -> str:
    """Motions to points that are written out."""
    rng = np.random.default_rng(0)
    rows = np.hstack([rng.uniform(-500.0, 500.0, (n, 3)), rng.uniform(-180.0, 180.0, (n, 3))])
    line = "LIN {{X {:.3f},Y {:.3f},Z {:.3f},A {:.4f},B {:.4f},C {:.4f}}} C_DIS\n"
    return KRL.format("".join(line.format(*row) for row in rows.tolist()))


@pytest.mark.guard
@pytest.mark.parametrize(("written", "name"), [(rapid, "long.mod"), (krl, "long.src")], ids=["RAPID", "KRL"])
def test_lines_against_half_as_many(race, tmp_path: Path, smoke, request, written: Callable[[int], str], name: str):
    n = 20 if smoke else 1500

    def reads(lines: int) -> Callable[[], object]:
        return reads_all_lines(tmp_path / str(lines) / name, written(lines), lines)

    language = request.node.callspec.id
    race(f"{language}, {2 * n} lines", reads(2 * n), {f"{n} lines": reads(n)}, below=MOST, rounds=3)


def reads_all_lines(path: Path, text: str, lines: int) -> Callable[[], object]:
    """Reads each line of a program by itself."""
    path.parent.mkdir()
    path.write_text(text, encoding="utf-8")
    read = language_of(path).read
    assert len(read((read_source(path),), Surroundings()).motions) == lines
    return lambda: read((read_source(path),), Surroundings())


FOLDED = 0.5
"""Of the time of all lines, which a program read from a few of them must stay below; a fifth and a tenth were measured."""


@pytest.mark.guard
@pytest.mark.parametrize(("written", "name"), [(rapid, "long.mod"), (krl, "long.src")], ids=["RAPID", "KRL"])
def test_a_few_lines_against_all(race, tmp_path: Path, smoke, request, written: Callable[[int], str], name: str):
    n = 600 if smoke else 3000
    every = reads_all_lines(tmp_path / "all" / name, written(n), n)
    few = tmp_path / "all" / name
    race(
        f"{request.node.callspec.id}, from a few lines",
        lambda: read_program(few),
        {"all lines": every},
        below=FOLDED,
        rounds=3,
    )


@pytest.mark.guard
def test_correcting_lines_against_half_as_many(race, tmp_path: Path, smoke, model: ErrorModel, campaign):
    n, calibration = 20 if smoke else 1500, identify(model, campaign)
    flange = model.poses(campaign.q[:1])[0] @ np.linalg.inv(model.robot.T_flange_tool)

    def corrects(lines: int) -> Callable[[], object]:
        path = tmp_path / f"m{lines}.mod"
        path.write_text(meander(lines, flange), encoding="utf-8")
        program = read_program(path)
        assert len(correct(calibration, program, accept_uncertain=True).corrected) == lines
        return lambda: correct(calibration, program, accept_uncertain=True)

    race(f"correct, {2 * n} lines", corrects(2 * n), {f"{n} lines": corrects(n)}, below=MOST, rounds=3)
