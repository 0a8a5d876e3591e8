"""Programs that are read from a few of their lines are what all of their lines make them."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from gc import collect
from pathlib import Path
from random import Random
from weakref import ref

import numpy as np
import pytest

from robot_programs import Frame, read_program
from robot_programs.core import folded
from robot_programs.core.folded import FoldedProgram
from robot_programs.core.program import Program, Surroundings, Target, Waypoint
from robot_programs.core.source import Source, read_source
from robot_programs.languages import language_of
from robot_programs.reading import parse_program
from taskcal.robot.catalogue import load_robot

TOOL = Frame(name="gun", T=np.diag([1.0, -1.0, -1.0, 1.0]))


@dataclass(frozen=True, kw_only=True)
class Kind:
    """Programs of a language, of runs of lines that are alike."""

    motion: str
    """A line, with random numbers ``u`` and ``v``, small ones, ``a`` and ``c``, angles, and ``i``, whole."""
    words: Mapping[str, Sequence[str]]
    """Of its other fields, chosen for each run."""
    other: Sequence[str]
    """Lines between runs, some of them around one."""
    text: str
    runs: int
    share: float
    """Of runs that others follow."""

    def write(self, rng: Random) -> str:
        def run() -> str:
            own = {name: rng.choice(words) for name, words in self.words.items()}

            def line() -> str:
                u, v, a, c = (rng.uniform(-most, most) for most in (9.0, 0.9, 180.0, 3.0))
                return self.motion.format(u=u, v=v, a=a, c=c, i=rng.randint(0, 99), **own)

            return "\n".join(line() for _ in range(rng.randint(1, 14)))

        def body() -> str:
            parts = [run() for _ in range(self.runs)]
            some = (f"{part}\n{rng.choice(self.other)}" if rng.random() < self.share else part for part in parts)
            return "\n".join(re.sub("RUN", lambda _: run(), part) for part in some)

        return re.sub("BODY", lambda _: body(), re.sub("LINES", lambda _: run(), self.text))


DATA = "tooldata {}:=[TRUE,[[10,20,300],[1,0,0,0]],[5,[0,0,100],[1,0,0,0],0,0,0]];"
KINDS = {
    "m.mod": Kind(
        motion="Move{name} [[{u:.3f},{blank}{i},5.],[{q}],[{cf}],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,{zone},{tool}\\WObj:=wobj0;",
        words={
            "name": "JL", "zone": ["z1", "fine"], "tool": ["tGun", "tGun", "tSet", "tNone"], "blank": ["", " "],
            "cf": ["0,-1,0,1", "0,0,0,0"], "q": ["1,0,0,0", "0,0.6,0.8,0", "0.5,0.5,0.5,0.5", "0.5,0.5,0.5,0.9"],
        },
        other=[
            "FOR i FROM 1 TO 2 DO\nRUN\nENDFOR", "IF di1=1 THEN\nRUN\nELSE\nRUN\nENDIF", "other;", "Reset do1;", "! note", "lost",
            "FOR i FROM 1 TO 2 DO\nIF di1=1 THEN\nRUN\nENDIF\nRUN\nENDFOR", "tSet.tframe.trans.z:=n;", "RETURN;",
        ],
        text=f"MODULE m\nPERS {DATA.format('tGun')}\nVAR {DATA.format('tSet')}\nVAR num n:=7;\nPROC main()\nBODY\nENDPROC\n"
        "PROC other()\nBODY\nENDPROC\nENDMODULE\n",
        runs=4, share=0.7,
    ),
    "m.src": Kind(
        motion="  {name} {{X {a:.3f},Y {i},Z 5.5,A {a:.4f},B -1.0,C {c:.2f}{more}}}{end}",
        words={
            "name": ["LIN", "PTP", "SLIN"], "end": ["", " C_DIS", " C_PTP"], "more": ["", ",S 2,T 10", ",E1 0.0"],
        },
        other=[
            "$BASE=BASE_DATA[1]", "$BASE={X 5,Y 0,Z 0,A 0,B 0,C 0}", "sub()", "; note", "$VEL.CP=0.2", "IF $IN[1] THEN", "ENDIF",
            "FOR i=1 TO 2", "ENDFOR", "PTP {A1 0,A2 -90,A3 90,A4 0,A5 10,A6 0}", "LIN {X 5}", "HALT",
        ],
        text="DEF m()\nINT i\n$TOOL={X 10,Y 20,Z 300,A 0,B 0,C 0}\n$BASE={X 500,Y 0,Z 300,A 0,B 0,C 0}\nBODY\nEND\n"
        "DEF sub()\nLINES\nEND\n",
        runs=6, share=0.5,
    ),
    "m.script": Kind(
        motion="  {name}(p[{v:.5f},{v:.4f}, .5, {c:.4f}, 0, 3.1]{rest})",
        words={"name": ["movel", "movej", "movep"], "rest": ["", ", a=1.2, v=0.3", ", 1.2, speed, r=0.01"]},
        other=[
            "  set_tcp(p[0,0,0.1,0,0,0])", "  speed = 0.5", "  sub()", "  # note", "  sleep(1)", "  force_mode(p[0,0,0,0,0,0])",
            "  i = 0\n  while i < 2:\nRUN\n    i = i + 1\n  end",
        ],
        text="def m():\nBODY\nend\ndef sub():\nLINES\nend\n", runs=5, share=0.5,
    ),
    "m.apt": Kind(
        motion="GOTO / {a:.4f}, {u:.4f}, {i}.{axis}",
        words={"axis": ["", ",0.0,0.6,0.8", ",0.0,-0.280000,0.960000", ",0.6,0.0,0.8", ",0.6,0.0,0.9"]},
        other=[
            "FEDRAT/100,MMPM", "RAPID", "UNITS/INCHES", "UNITS/MM", "$$ note", "SPINDL/ON", "CYCLE/DRILL,5", "CYCLE/OFF",
            "CIRCLE/0.0,0.0,0.0,0.0,0.0,1.0,5.0,0.01,0.5,5.0,0.0", "TLAXIS/0.0,0.6,0.8", "GODLTA/1.0,2.0,3.0", "COPY/1,SAME,2",
        ],
        text="PARTNO/m\nLOADTL/1\nBODY\nFINI\n", runs=8, share=0.6,
    ),
}  # fmt: skip


def said(program: Program) -> list[object]:
    """All that motions say but their poses, and all that is said of them."""

    def of(thing: object) -> object:
        if isinstance(thing, Target):
            return [(f.name, str(getattr(thing, f.name))) for f in fields(thing) if f.name != "T"]
        return str(thing)

    own = [[(f.name, of(getattr(motion, f.name))) for f in fields(motion)] for motion in program.motions]
    return [*own, *map(str, program.diagnostics), program.base_from]


@pytest.mark.parametrize("name", KINDS)
def test_folded_programs_are_what_all_lines_say(name: str, tmp_path: Path, monkeypatch):
    monkeypatch.setattr(folded, "MIN_RUN", 4)
    monkeypatch.setattr(folded, "MIN_FOLDED", 1)
    language, path, times = language_of(Path(name)), tmp_path / name, 0
    around = Surroundings() if language.declares_frames else Surroundings(tool=TOOL)
    for seed in range(25):
        path.write_text(KINDS[name].write(Random(seed)), newline="\r\n" if seed % 2 else "\n")
        sources = (read_source(path),)
        one, other = parse_program(sources, tool=around.tool), language.read(sources, around)
        times += isinstance(one, FoldedProgram)
        assert said(one) == said(other), seed
        for a, b in zip(one.motions, other.motions, strict=True):
            for x, y in ((a.end, b.end), (a.via, b.via)):
                if x is not None and x.T is not None:
                    np.testing.assert_allclose(x.T, y.T, atol=1e-12)
        if isinstance(one, FoldedProgram):
            assert list(one.visits()) or not list(other.visits())
    assert times > 5, "hardly any of these programs was folded"


POINT = "GOTO/{}.,0.,0."
MOVEL = "movel(p[0.5,{},0,0,3.1,0], a=1.2, v={}st)"


@pytest.mark.parametrize(
    ("name", "head", "lines"),
    [
        ("m.script", ["fast = 0.2", "Fast = 0.5"], [MOVEL.format(k / 9, "Fa" if k == 4 else "fa") for k in range(9)]),
        ("m.apt", ["UNITS/INCHES"], [POINT.format(k % 4) for k in (4, *range(4, 9))]),
        ("m.apt", [], [POINT.format(2000000000 if k == 4 else k) for k in range(9)]),
    ],
)
def test_a_line_between_alike_ones_is_not_taken_for_them(name, head, lines, monkeypatch):
    monkeypatch.setattr(folded, "MIN_RUN", 4)
    monkeypatch.setattr(folded, "MIN_FOLDED", 1)
    language, around = language_of(Path(name)), Surroundings(tool=TOOL)
    sources = (Source.of(Path(name), "\n".join([*head, *lines, ""]).encode()),)
    one, other = parse_program(sources, tool=TOOL), language.read(sources, around)
    assert said(one) == said(other)
    np.testing.assert_allclose([a.end.T for a in one.motions], [b.end.T for b in other.motions], atol=1e-12)


@pytest.fixture
def long(tmp_path: Path) -> Path:
    path = tmp_path / "long.mod"
    line = "MoveL [[{},0,5],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,z1,tool0;\n"
    path.write_text(f"MODULE m\nPROC main()\n{''.join(line.format(k) for k in range(600))}ENDPROC\nENDMODULE\n")
    return path


def test_what_is_read_for_writing_is_given_back(long: Path):
    program = read_program(long)
    assert isinstance(program, FoldedProgram)
    T = np.eye(4)
    T[:3, 3] = 0.3, 0.02, 0.005
    paths = {300: (Waypoint(kind="linear", q=np.zeros(6), T=T),)}
    robot, whole = load_robot("abb-irb120"), ref(program.unfolded)
    assert len(program.unfolded.motions) == 600
    written = program.rewrite(robot, paths)
    collect()
    assert whole() is None
    assert program.rewrite(robot, paths) == written


def test_a_long_program_is_edited_as_a_short_one(long: Path):
    path, program = long, read_program(long)
    assert isinstance(program, FoldedProgram)
    T = np.eye(4)
    T[:3, 3] = 0.3, 0.02, 0.005
    from robot_programs import Edit

    again = program.with_edits([Edit(motion=300, T=T, speed=0.25)])
    np.testing.assert_allclose(again.motions[300].end.T, T, atol=1e-9)
    (source,) = again.sources
    changed = [
        k for k, (a, b) in enumerate(zip(path.read_text().split("\n"), source.text.split("\n"), strict=True)) if a != b
    ]
    assert changed == [302]
