"""Programs that are read from a few of their lines are what all of their lines make them."""

from collections.abc import Callable
from dataclasses import fields
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


def rapid(rng: Random) -> str:
    def run() -> list[str]:
        name, zone, tool = rng.choice("JL"), rng.choice(["z1", "fine"]), rng.choice(["tGun", "tGun", "tSet", "tNone"])
        cf, blank = rng.choice(["0,-1,0,1", "0,0,0,0"]), rng.choice(["", " "])
        q = rng.choice(["1,0,0,0", "0,0.6,0.8,0", "0.5,0.5,0.5,0.5", "0.5,0.5,0.5,0.9"])
        return [
            f"Move{name} [[{rng.uniform(-9, 9):.3f},{blank}{rng.randint(0, 99)},5.],[{q}],[{cf}],[9E9,9E9,9E9,9E9,9E9,9E9]],"
            f"v100,{zone},{tool}\\WObj:=wobj0;"
            for _ in range(rng.randint(1, 14))
        ]

    def block(depth: int) -> list[str]:
        kind = rng.randint(0, 7 if depth else 2)
        inner = [line for _ in range(2) for line in block(depth - 1)] if kind > 2 else []
        match kind:
            case 3:
                return ["FOR i FROM 1 TO 2 DO", *inner, "ENDFOR"]
            case 4:
                return ["IF di1=1 THEN", *inner, "ELSE", *block(0), "ENDIF"]
            case 5:
                return [
                    *inner,
                    rng.choice(["other;", "Reset do1;", "! note", "tSet.tframe.trans.z:=n;", "RETURN;", "lost"]),
                ]
            case _:
                return run()

    def body() -> list[str]:
        return [line for _ in range(4) for line in block(2)]

    tool = "tooldata {}:=[TRUE,[[10,20,300],[1,0,0,0]],[5,[0,0,100],[1,0,0,0],0,0,0]];"
    head = ["MODULE m", f"PERS {tool.format('tGun')}", f"VAR {tool.format('tSet')}", "VAR num n:=7;", "PROC main()"]
    return "\n".join([*head, *body(), "ENDPROC", "PROC other()", *body(), "ENDPROC", "ENDMODULE", ""])


def krl(rng: Random) -> str:
    def run() -> list[str]:
        name, words = rng.choice(["LIN", "PTP", "SLIN"]), rng.choice(["", " C_DIS", " C_PTP"])
        more = rng.choice(["", ",S 2,T 10", ",E1 0.0"])
        return [
            f"  {name} {{X {rng.uniform(-900, 900):.3f},Y {rng.randint(0, 99)},Z 5.5,A {rng.uniform(-180, 180):.4f},B -1.0,"
            f"C {rng.uniform(-180, 180):.2f}{more}}}{words}"
            for _ in range(rng.randint(1, 14))
        ]

    other = [
        "$BASE=BASE_DATA[1]",
        "$BASE={X 5,Y 0,Z 0,A 0,B 0,C 0}",
        "sub()",
        "; note",
        "$VEL.CP=0.2",
        "IF $IN[1] THEN",
        "ENDIF",
    ]
    other += ["FOR i=1 TO 2", "ENDFOR", "PTP {A1 0,A2 -90,A3 90,A4 0,A5 10,A6 0}", "LIN {X 5}", "HALT"]

    def body() -> list[str]:
        return [line for _ in range(6) for line in (*run(), *([rng.choice(other)] if rng.random() < 0.5 else []))]

    head = ["DEF m()", "INT i", "$TOOL={X 10,Y 20,Z 300,A 0,B 0,C 0}", "$BASE={X 500,Y 0,Z 300,A 0,B 0,C 0}"]
    return "\n".join([*head, *body(), "END", "DEF sub()", *run(), "END", ""])


def urscript(rng: Random) -> str:
    def run() -> list[str]:
        name, rest = rng.choice(["movel", "movej", "movep"]), rng.choice(["", ", a=1.2, v=0.3", ", 1.2, speed, r=0.01"])
        return [
            f"  {name}(p[{rng.uniform(-1, 1):.5f},{rng.uniform(-1, 1):.5f}, .5, {rng.uniform(-3, 3):.4f}, 0, 3.1]{rest})"
            for _ in range(rng.randint(1, 14))
        ]

    other = [
        "  set_tcp(p[0,0,0.1,0,0,0])",
        "  speed = 0.5",
        "  sub()",
        "  # note",
        "  sleep(1)",
        "  force_mode(p[0,0,0,0,0,0])",
    ]

    def body() -> list[str]:
        return [line for _ in range(5) for line in (*run(), *([rng.choice(other)] if rng.random() < 0.5 else []))]

    again = ["  i = 0", "  while i < 2:", *run(), "    i = i + 1", "  end"] if rng.random() < 0.5 else []
    return "\n".join(["def m():", *body(), *again, "end", "def sub():", *run(), "end", ""])


def apt(rng: Random) -> str:
    def run() -> list[str]:
        angle = rng.uniform(-1, 1)
        axis = rng.choice(["", f",0.0,{np.sin(angle):.6f},{np.cos(angle):.6f}"])
        return [
            f"GOTO / {rng.uniform(-90, 90):.4f}, {rng.uniform(-90, 90):.4f}, {rng.randint(-5, 5)}.{axis}"
            for _ in range(rng.randint(1, 14))
        ]

    other = [
        "FEDRAT/100,MMPM",
        "RAPID",
        "UNITS/INCHES",
        "UNITS/MM",
        "$$ note",
        "SPINDL/ON",
        "CYCLE/DRILL,5",
        "CYCLE/OFF",
    ]
    other += [
        "CIRCLE/0.0,0.0,0.0,0.0,0.0,1.0,5.0,0.01,0.5,5.0,0.0",
        "TLAXIS/0.0,0.6,0.8",
        "GODLTA/1.0,2.0,3.0",
        "COPY/1,SAME,2",
    ]
    lines = [line for _ in range(8) for line in (*run(), *([rng.choice(other)] if rng.random() < 0.6 else []))]
    return "\n".join(["PARTNO/m", "LOADTL/1", *lines, "FINI", ""])


def said(program: Program) -> list[object]:
    """All that motions say but their poses, and all that is said of them."""

    def of(thing: object) -> object:
        if isinstance(thing, Target):
            return [(f.name, str(getattr(thing, f.name))) for f in fields(thing) if f.name != "T"]
        return str(thing)

    own = [[(f.name, of(getattr(motion, f.name))) for f in fields(motion)] for motion in program.motions]
    return [*own, *map(str, program.diagnostics), program.base_from]


@pytest.mark.parametrize("name", ["m.mod", "m.src", "m.script", "m.apt"])
def test_folded_programs_are_what_all_lines_say(name: str, tmp_path: Path, monkeypatch):
    written: dict[str, Callable[[Random], str]] = {"m.mod": rapid, "m.src": krl, "m.script": urscript, "m.apt": apt}
    monkeypatch.setattr(folded, "MIN_RUN", 4)
    monkeypatch.setattr(folded, "MIN_FOLDED", 1)
    language, path, times = language_of(Path(name)), tmp_path / name, 0
    around = Surroundings() if language.declares_frames else Surroundings(tool=TOOL)
    for seed in range(25):
        path.write_text(written[name](Random(seed)), newline="\r\n" if seed % 2 else "\n")
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
