"""What is understood of a program is what it does, whichever values its sensors give."""

from random import Random

import numpy as np
import pytest

from robot_programs.core.program import Program
from robot_programs.krl.read import KrlProgram, read_krl
from robot_programs.rapid.read import read_rapid
from tests.robot_programs import small_language as small

Went = set[tuple[int, tuple[int, ...]]]


def rapid(program: small.Program) -> Program:
    return read_rapid(small.Rapid().program(program))


def krl(program: small.Program) -> KrlProgram:
    return read_krl(small.Krl().program(program))


def understood(program: Program) -> Went:
    """Lines and places of all motions, outside of any frame."""
    went = {
        (move.place.line, tuple(np.round((move.part.T @ move.end.T)[:3, 3] * 1e3).astype(int)))
        for move in program.motions
    }
    return {(line, tuple(map(int, place))) for line, place in went}


def refused(program: Program) -> set[int]:
    return {d.place.line for d in program.diagnostics if "stays as it is" in d.text}


@pytest.mark.parametrize("read", [rapid, krl])
def test_a_program_without_sensors_is_understood(read):
    for seed in range(60):
        program = small.random_program(Random(seed), sensors=False, jumps=seed % 2 == 1)
        found = read(program)
        machine = small.Machine(sensor=lambda: 0)
        machine.run(program)
        reached = {line for line, _ in machine.went}
        assert not refused(found) & reached, (seed, found.diagnostics, found.sources[0].text)
        assert {one for one in understood(found) if one[0] in reached} == machine.went, (seed, found.sources[0].text)


@pytest.mark.parametrize("read", [rapid, krl])
def test_a_program_written_out_does_what_it_did(read):
    """Every line that stands for several motions is written out, as often as there is one; lines count as those they come from.

    A copy of a branch that its turn does not take is read with what stands before it, as any text to which no way leads: of
    programs without sensors the lines count that are reached, of others all.
    """
    lengths = set[int]()
    for seed in range(30):
        program = small.random_program(Random(seed), sensors=seed % 2 == 1)
        given = found = read(program)
        machine = small.Machine(sensor=lambda: 0)
        machine.run(program)
        dead = set[int]() if seed % 2 == 1 else {line for line, _ in understood(given)} | refused(given)
        dead -= {line for line, _ in machine.went}
        for _ in range(4):
            shared = [i for i, motion in enumerate(found.motions) if motion.texts_motions > 1]
            sources = found.written_out(shared) if shared else None
            if sources is None:
                break
            found = found.reread(sources)
            went = [{one for one in understood(each) if one[0] not in dead} for each in (found, given)]
            assert went[0] == went[1], (seed, found.sources[0].text)
            known = {line for line, _ in understood(given)}  # a branch may be taken in one turn, and not in others
            assert refused(found) - known - dead == refused(given) - known - dead, (seed, found.sources[0].text)
        lengths.add(found.sources[0].text.count("\n") - given.sources[0].text.count("\n"))
    assert max(lengths) > 20


@pytest.mark.parametrize("read", [rapid, krl])
def test_nothing_is_understood_that_sensors_decide(read):
    for seed in range(60):
        program = small.random_program(Random(seed), sensors=True, jumps=seed % 2 == 1)
        found = read(program)
        known, unknown = understood(found), refused(found)
        for k in range(6):
            rng = Random(k)
            machine = small.Machine(sensor=lambda rng=rng: rng.randint(0, 60))
            machine.run(program)
            assert {one for one in machine.went if one[0] not in unknown} <= known, (seed, found.sources[0].text)


def test_summaries_of_routines_change_nothing(monkeypatch):
    """Routines that were gone through in the same state before are not gone through again."""
    programs = [small.random_program(Random(seed), sensors=seed % 2 == 0) for seed in range(40)]
    summarised = [followed(krl(program)) for program in programs]
    monkeypatch.setattr("robot_programs.krl.read._Flow.depends_on", lambda *_: None)
    assert [followed(krl(program)) for program in programs] == summarised


def followed(program: KrlProgram) -> list[tuple[object, ...]]:
    """Motions with those before them, and diagnostics."""
    motions = [
        (motion.place, motion.end.T.tobytes(), motion.follows, motion.texts_motions, site.before)
        for motion, site in zip(program.motions, program.sites, strict=True)
    ]
    return [*motions, *sorted(map(str, program.diagnostics))]
