"""The library by itself: its guide runs with NumPy alone, and edits of any language change the motions that they name."""

import re
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from robot_programs import Edit, Frame, InputError, Motion, Source, read_program, write_program
from taskcal_groundwork.se3 import exp
from tests.examples.test_documentation import ROOT, blocks
from tests.robot_programs.fuzz import LANGUAGES, language
from tests.robot_programs.tp.samples import R2000

ALONE = "import sys; sys.modules |= dict.fromkeys(['taskcal', 'scipy', 'numba', 'pandas', 'sympy'])\n"


def test_the_guide_runs_with_numpy_alone(tmp_path):
    (tmp_path / "guide.py").write_text(ALONE + "\n".join(blocks("docs/robot-programs.md", "python")), encoding="utf-8")
    ran = [sys.executable, "-W", "error", "guide.py"], [sys.executable, "-m", "robot_programs", "part-raised.mod"]
    printed = [
        subprocess.run(command, cwd=tmp_path, capture_output=True, encoding="utf-8", check=True).stdout
        for command in ran
    ]
    assert "MoveL p1_2,v100\\V:=50,fine,tGun; ! above" in printed[0]
    assert "v100\\V:=50" in printed[0]
    assert "0 part-raised.mod:6 linear to 600.000 0.000 401.000 mm, tGun in wobj0 50 mm/s" in printed[1]
    assert "    pip install robot_programs-*.whl\n    python -m robot_programs part.mod\n" in (
        ROOT / "src/robot_programs/README.md"
    ).read_text(encoding="utf-8")


def numbers_of(motion: Motion) -> np.ndarray:
    """Target, tool and part's frame of a motion."""
    end = motion.end.q if motion.end.T is None else motion.end.T
    via = [] if motion.via is None or motion.via.T is None else motion.via.T[:3, 3]
    return np.concatenate([np.ravel(part) for part in (end, via, motion.tool.T, motion.part.T, motion.speed or 0.0)])


def nearby(rng: np.random.Generator, number: int, motion: Motion) -> tuple[Edit, Motion]:
    """A random edit of a motion, and its own end as it is to be."""
    if motion.end.T is None:
        q = motion.end.q + rng.uniform(-0.01, 0.01, len(motion.end.q))
        return Edit(motion=number, q=q), replace(motion, end=replace(motion.end, q=q))
    T = motion.end.T.copy()
    T[:3, 3] += rng.uniform(-0.01, 0.01, 3)
    if not motion.end.free_spin:
        T[:3, :3] = T[:3, :3] @ exp(rng.uniform(-0.01, 0.01, 3))
    return Edit(motion=number, T=T), replace(motion, end=replace(motion.end, T=T))


MOST_WORDS = 20
"""Numbers of a pose with its quaternion and the words that touch them, in texts of some hundred."""


NUMBER = re.compile(r"[-+]?(?<![A-Za-z_\d])\.?\d[\d.]*(E[-+]?\d+)?", re.IGNORECASE)
NUMBERS_ALONE = {"csv_path": 1.0, "apt": 0.6, "krl": 0.5, "urscript": 0.5, "rapid": 0.4, "tp": 0.0}
"""Least share of edits of which numbers change alone: of others, points are declared anew or written into the motion."""


def changed_lines(before: Sequence[Source], after: Sequence[Source]) -> int | None:
    """How many lines have other numbers; None where anything else changes."""
    if [NUMBER.sub("#", one.text) for one in before] != [NUMBER.sub("#", one.text) for one in after]:
        return None
    lines = ([line for one in of for line in one.text.splitlines()] for of in (before, after))
    return sum(a != b for a, b in zip(*lines, strict=True))


@pytest.mark.parametrize("name", LANGUAGES)
def test_an_edit_changes_its_motion_and_no_other(name):
    of, done, tried, changed = language(name), 0, 0, list[int]()
    for seed in range(20):
        rng = np.random.default_rng(seed)
        program = of.read(of.generate(rng))
        if not program.motions:
            continue
        number, tried = int(rng.integers(len(program.motions))), tried + 1
        edit, wanted = nearby(rng, number, program.motions[number])
        try:
            sources = program.with_edits([edit]).sources
        except InputError:
            continue  # others have the same text
        done += 1
        again = of.read(sources).motions
        for meant, found in zip(
            [*program.motions[:number], wanted, *program.motions[number + 1 :]], again, strict=True
        ):
            np.testing.assert_allclose(numbers_of(found), numbers_of(meant), atol=2e-5)
        old, new = ({word for one in texts for word in one.text.split()} for texts in (program.sources, sources))
        assert len(old - new) <= MOST_WORDS
        if (count := changed_lines(program.sources, sources)) is not None:
            changed.append(count)
    assert done > tried / 2
    assert len(changed) >= NUMBERS_ALONE[name] * done
    assert set(changed) <= ({1} if name == "csv_path" else {1, 2, 3})  # of a position that several lines state


LISTING = """/PROG A
/MN
   1:  UFRAME_NUM=0 ;
   2:  UTOOL_NUM=1 ;
   3:L P[1] {0} FINE ;
/POS
P[1]{{
   GP1:
    UF : 0, UT : 1,     CONFIG : 'N U T, 0, 0, 0',
    X = 600.000 mm, Y = 0.000 mm, Z = 400.000 mm,
    W = 180.000 deg, P = 0.000 deg, R = 0.000 deg
}};
/END
"""
MODULE = "MODULE m\nPROC main()\nMoveJ [[6,0,4],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],{0},fine,tool0;\nENDPROC\nENDMODULE"
SCRIPT = "set_tcp(p[0,0,0,0,0,0])\nmovel(p[1,0,0,0,0,0]{0}) # v\n"
SPEEDS = [
    ("a.mod", MODULE, "v100", "v100\\V:=250"),
    ("a.mod", MODULE, "v50\\V:=100", "v50\\V:=250"),
    ("a.script", SCRIPT, ", 1.2, 0.1", ", 1.2, 0.25"),
    ("a.script", SCRIPT, "", ", v=0.25"),
    ("a.csv", "x_mm,y_mm,z_mm,qx,qy,qz,qw,speed_mm_s\n6,0,4,0,1,0,0,{0}\n", "100", "250.000000"),
    ("a.ls", LISTING, "100mm/sec", "250mm/sec"),
    ("a.ls", LISTING, "600 cm/min", "1500 cm/min"),
]


@pytest.mark.parametrize(("name", "text", "slow", "fast"), SPEEDS)
def test_a_speed_is_changed_where_the_motion_states_it(name, text, slow, fast, tmp_path):
    (tmp_path / name).write_text(text.format(slow), encoding="utf-8", newline="")
    tool = None if name.endswith(".mod") else Frame(name="t", T=np.eye(4))
    robot = R2000 if name.endswith(".ls") else None
    program = read_program(tmp_path / name, tool=tool, robot=robot).with_edits([Edit(motion=0, speed=0.25)])
    assert program.sources[0].text == text.format(fast)
    assert program.motions[0].speed == pytest.approx(0.25)


KRL = "DEF a()\nBAS(#INITMOV,0)\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\n$VEL.CP=0.1\nLIN {X 600,Y 0,Z 400,A 0,B 90,C 0}\nEND\n"
REFUSED = {
    "motion 3": {"motion": 3, "speed": 1.0},
    "give the robot": {"motion": 0, "q": np.zeros(6)},
    "not an arc": {"motion": 0, "via": np.eye(4)},
    "a rotation": {"motion": 0, "T": np.diag([1.0, 1.0, 2.0, 1.0])},
    "not a speed": {"motion": 0, "speed": -1.0},
    "stated before it": {"motion": 0, "speed": 1.0},
}


@pytest.mark.parametrize("why", REFUSED)
def test_an_edit_that_cannot_be_written_is_refused(why, tmp_path):
    (tmp_path / "a.src").write_text(KRL, encoding="utf-8")
    program = read_program(tmp_path / "a.src")
    with pytest.raises(InputError, match=why):
        program.with_edits([Edit(**REFUSED[why])])


def test_what_was_read_is_never_overwritten(tmp_path):
    (tmp_path / "a.src").write_text(KRL, encoding="utf-8")
    program = read_program(tmp_path / "a.src")
    with pytest.raises(InputError, match="never overwritten"):
        write_program(program, tmp_path)
    assert write_program(program, tmp_path / "b.src") == (tmp_path / "b.src",)
    assert (tmp_path / "b.src").read_bytes() == (tmp_path / "a.src").read_bytes()
