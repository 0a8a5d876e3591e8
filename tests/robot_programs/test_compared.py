"""The comparison of two versions of the readers finds every difference, and none between a version and itself."""

import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from robot_programs.core.program import Program, Zone
from robot_programs.core.source import Source
from robot_programs.krl.read import read_krl
from robot_programs.reading import parse_program
from robot_programs.tp.read import read_tp
from tests.robot_programs import compared, shares
from tests.robot_programs import small_language as small
from tests.robot_programs.compared import EQUAL, FIELDS, Case, Found
from tests.robot_programs.fuzz import LANGUAGES, language

pytestmark = pytest.mark.skipif(
    not hasattr(signal, "setitimer"),
    reason="readings that take too long are ended by a signal that this system does not have",
)

TEXT = """MODULE m
PERS tooldata tA:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,50],[1,0,0,0],0,0,0]];
CONST robtarget p1:=[[500,0,600],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
CONST robtarget p2:=[[500,100,600],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
CONST robtarget p3:=[[400,100,600],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
PROC main()
MoveAbsJ [[0,10,20,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tA;
MoveL p1,v100,z10,tA;
MoveC p2,p3,v100,fine,tA;
MoveL pNowhere,v100,fine,tA;
ENDPROC
ENDMODULE
"""
CASE = Case(name="m.mod", files=(("m.mod", TEXT, "utf-8"),), given={"robot": "abb-irb120"})
JOINTS, LINE, ARC, REFUSED = "m.mod:7", "m.mod:8", "m.mod:9", "m.mod:10"


def kinds(found: list[Found]) -> dict[str, str]:
    """What was found in each place."""
    return {one.place: one.kind for one in found}


def found_with(
    monkeypatch: pytest.MonkeyPatch, old: Callable[..., Program], new: Callable[..., Program], longest_s: float = 60.0
) -> dict[str, str]:
    readings = []
    for read in (old, new):
        monkeypatch.setattr(compared, "parse_program", read)
        readings.append(compared.reading(CASE, writes=False, longest_s=longest_s))
    return kinds(list(compared.found_in(CASE, *readings)))


def altered(line: str, **changes: Any) -> Callable[..., Program]:
    """A reader that takes a motion for another one."""

    def read(sources: tuple[Source, ...], **given: Any) -> Program:
        program = parse_program(sources, **given)
        motions = list(program.motions)
        at = [str(motion.place) for motion in motions].index(line)
        motions[at] = replace(
            motions[at], **{name: change(getattr(motions[at], name)) for name, change in changes.items()}
        )
        return replace(program, motions=tuple(motions))

    return read


def without(line: str) -> Callable[..., Program]:
    """A reader that passes over a line in silence."""

    def read(sources: tuple[Source, ...], **given: Any) -> Program:
        program = parse_program(sources, **given)
        motions = [replace(one, follows=None) for one in program.motions if str(one.place) != line]
        said = [one for one in program.diagnostics if str(one.place) != line]
        return replace(program, motions=tuple(motions), diagnostics=tuple(said))

    return read


ALTERED = {
    "kind": altered(LINE, kind=lambda _: "joint"),
    "T": altered(LINE, end=lambda end: replace(end, T=end.T + 1e-5)),
    "q": altered(JOINTS, end=lambda end: replace(end, q=end.q + 1e-5)),
    "via": altered(ARC, via=lambda via: replace(via, T=via.T + 1e-5)),
    "posture": altered(LINE, end=lambda end: replace(end, posture=replace(end.posture, cf1=1))),
    "tool": altered(LINE, tool=lambda tool: replace(tool, T=tool.T + 1e-5)),
    "part": altered(LINE, part=lambda part: replace(part, T=part.T + 1e-5)),
    "speed": altered(LINE, speed=lambda speed: 2.0 * speed),
    "zone": altered(LINE, zone=lambda _: Zone(distance=0.02)),
    "follows": altered(LINE, follows=lambda _: None),
    "rest": altered(LINE, waits=lambda waits: not waits),
}
"""A reader for each field of a motion that has it otherwise."""


def test_what_is_known_of_a_motion_and_differs_is_named(monkeypatch):
    """Alone, and no other line; what differs by rounding is no difference."""
    assert set(ALTERED) == set(FIELDS)
    for field, read in ALTERED.items():
        found = found_with(monkeypatch, parse_program, read)
        differing = {place: kind for place, kind in found.items() if kind not in EQUAL}
        behind = {ARC: "different: follows"} if field == "T" else {LINE: "different: follows"} if field == "q" else {}
        line = {"q": JOINTS, "via": ARC}.get(field, LINE)
        assert differing == {line: f"different: {field}"} | behind
    rounded = altered(LINE, end=lambda end: replace(end, T=end.T * (1.0 + 1e-9)))
    assert set(found_with(monkeypatch, parse_program, rounded).values()) == {"equal", "refused"}


def test_lines_that_one_version_alone_knows_or_none_are_found(monkeypatch):
    both = found_with(monkeypatch, parse_program, parse_program)
    assert both == {JOINTS: "equal", LINE: "equal", ARC: "equal", REFUSED: "refused"}
    assert found_with(monkeypatch, without(LINE), without(LINE)) == {**both, LINE: "neither"}
    assert found_with(monkeypatch, without(REFUSED), without(REFUSED)) == {**both, REFUSED: "neither", LINE: "equal"}
    assert found_with(monkeypatch, parse_program, without(LINE))[LINE] == "only old"
    assert found_with(monkeypatch, without(LINE), parse_program)[LINE] == "only new"
    assert found_with(monkeypatch, parse_program, without(REFUSED))[REFUSED] == "different: refusal"
    assert found_with(monkeypatch, without(REFUSED), parse_program)[REFUSED] == "different: refusal"


def test_readers_that_crash_refuse_or_find_no_end_are_named(monkeypatch):
    def crashing(*_: object, **__: object) -> Program:
        raise KeyError("a name")

    def endless(*_: object, **__: object) -> Program:
        while True:
            pass

    def refusing(sources: tuple[Source, ...], **given: Any) -> Program:
        return parse_program(tuple(replace(source, path=Path("m.unknown")) for source in sources), **given)

    for read, kind in ((crashing, "crashed"), (endless, "too long")):
        assert found_with(monkeypatch, parse_program, read, 0.2) == {"m.mod": kind}
        assert found_with(monkeypatch, read, parse_program, 0.2) == {"m.mod": f"{kind} before"}
        assert found_with(monkeypatch, read, read, 0.2) == {"m.mod": f"{kind} alike"}
    found = found_with(monkeypatch, parse_program, refusing)
    assert found == {**dict.fromkeys((JOINTS, LINE, ARC), "only old"), REFUSED: "refused"}


def test_texts_that_are_written_otherwise_are_found(monkeypatch):
    """A motion that one version does not write, and a text that it writes in another way."""
    written = compared.written_in

    def fewer(program: Program, robot: Any) -> shares.Written:
        one = written(program, robot)
        places = {place for place in one.places if str(place) != LINE}
        return replace(one, places=places, sources=tuple(replace(s, text=f"{s.text}\n") for s in one.sources))

    old = compared.reading(CASE, writes=True)
    assert {LINE, ARC, JOINTS} == set(old["written"]["places"])
    monkeypatch.setattr(compared, "written_in", fewer)
    new = compared.reading(CASE, writes=True)
    for a, b, kind in ((old, new, "only old writes"), (new, old, "only new writes")):
        found = [one for one in compared.found_in(CASE, a, b) if one.kind not in EQUAL]
        assert kinds(found) == {LINE: kind, "m.mod": "files differ"}
        assert "+1 lines" in (found[-1].old, found[-1].new)


def samples() -> list[Case]:
    """A random program of each language, read by the reader of any."""
    with compared.recorded() as cases:
        for name in LANGUAGES:
            tested = language(name)
            parse_program(tested.generate(np.random.default_rng(1)), robot=tested.robot)
    return list(cases.values())


def test_what_is_kept_is_equal_to_itself(tmp_path, capsys):
    """Of all languages, with what is written, and of damaged texts; whatever a reader is given beside is kept."""
    cases = samples()
    assert len(cases) == len(LANGUAGES)
    torn = list(compared.damaged(cases, 60, seed=3))
    assert torn == list(compared.damaged(cases, 60, seed=3))
    assert sum(a.files != b.files for a, b in zip(torn, compared.damaged(cases, 60, seed=4), strict=True)) > 50
    for of, writes in ((cases, True), (torn, False)):
        kept = compared.keep(of, tmp_path / "kept.json", writes=writes)
        assert list(compared.opened(tmp_path / "kept.json")) == kept
        assert not [known for _, known in kept if "crashed" in (one["ended"] for one in known.values() if one)]
        assert compared.main(["compare", str(tmp_path / "kept.json")]) == 0
        known = {case.language for case, one in kept if any(line["known"] for line in one["read"]["lines"].values())}
        assert len(known) == len(LANGUAGES)
    assert "equal" in capsys.readouterr().out


def test_a_difference_is_listed_and_ends_in_status_1(tmp_path, monkeypatch, capsys):
    compared.keep([CASE], tmp_path / "kept.json", writes=True)
    monkeypatch.setattr(compared, "parse_program", ALTERED["speed"])
    assert compared.main(["compare", str(tmp_path / "kept.json")]) == 1
    out = capsys.readouterr().out
    assert f"different: speed: 1\n    {LINE}: MoveL p1,v100,z10,tA;" in out
    assert "old: 1 motions [0.1]" in out
    assert "new: 1 motions [0.2]" in out


@pytest.mark.parametrize(
    ("name", "path", "lines", "those"),
    [
        ("RAPID", "m.mod", ("PROC MoveIt()", "MoveL p;", "!MoveL", '"MoveL p"', "IF a MoveJ p;MoveL q;", "MoveL:=1;"), [2, 5, 5]),
        ("RAPID", "m.mod", ("ENDMODULE", "MODULE n", "ArcLStart p,v;", "ENDMODULE", "MoveL p,v;"), [3]),
        ("KRL", "m.src", (";FOLD PTP P1", "PTP XP1", "  slin {X 1}", "LIN_REL {X 1}", "PTP $POS_ACT ; here", "LIN=3"), [2, 3, 4]),
        ("KRL", "bas.src", ("PTP $AXIS_ACT", "PTP XHOME"), []),
        ("TP", "m.ls", ("/MN", "  1:J P[1] 5% FINE ;", "  2:  L=1 ;", "  3:C PR[1] ;", "   :  P[2] ;", "  4://L P[1] ;"), [2, 4]),
        ("URScript", "m.script", ("def movel(p):", "  movej(p)", "  # movel(p)", '  textmsg("movel(p)")', "  remove(p)"), [2]),
        ("APT", "m.apt", ("GOTO/1,2,3", "$$ GOTO/1,2,3", "L1)GODLTA/1", "TLON,GOFWD/(C),$", " (LINE/1)", "GOHOME"), [1, 3, 4, 6]),
        ("CSV", "m.csv", ("move;x_mm;y_mm", "joint;0;1", "via;1;2", "circular;.5;2", "# 1;2"), [2, 4]),
    ],
)  # fmt: skip
def test_motions_are_counted_by_their_text(name, path, lines, those):
    assert shares.motion_lines(name, Source.of(Path(path), "\n".join(lines).encode())) == those


@pytest.mark.parametrize(("write", "read"), [(small.Krl, read_krl), (small.Tp, read_tp)])
def test_motions_by_their_text_are_those_that_a_program_was_written_with(write, read):
    """Every line that a reader knows or refuses is one, and no other line."""
    for seed in range(12):
        program = small.random_program(Random(seed), sensors=True)
        if not write.takes(program):
            continue
        sources = write().program(program)
        found = read(sources)
        known = {(m.place.path, m.place.line) for m in found.motions}
        known |= {(d.place.path, d.place.line) for d in found.diagnostics if d.unread}
        counted = {(s.path, k) for s in sources for k in shares.motion_lines(compared.language_of(s.path).name, s)}
        assert known == counted
