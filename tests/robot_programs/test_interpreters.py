"""What is understood of a program is what it does, whichever values its sensors give."""

from contextlib import suppress
from dataclasses import dataclass, replace
from random import Random

import pytest

from robot_programs.core.program import Program
from taskcal_groundwork.errors import InputError
from tests.robot_programs import small_language as small
from tests.robot_programs.conformance.languages import LANGUAGES as CONFORMING
from tests.robot_programs.conformance.languages import Went, refused, understood


@dataclass(frozen=True, kw_only=True)
class Floor:
    """How much of the programs of a language is known."""

    known: int
    """Least lines that are known of those that are reached, in the programs without sensors; and with them."""
    known_with_sensors: int
    seeds: int = 60
    """Of random programs; the language cannot say all of them."""


RUNS = 6
"""Of a program with sensors, which give other values in each."""
LANGUAGES = {**CONFORMING, "KRL in files": replace(CONFORMING["KRL"], write=small.Krl)}
FLOORS = {
    "RAPID": Floor(known=170, known_with_sensors=28),
    "KRL": Floor(known=170, known_with_sensors=27),
    "KRL in files": Floor(known=170, known_with_sensors=27),
    "URScript": Floor(known=170, known_with_sensors=28),
    "TP": Floor(known=155, known_with_sensors=33, seeds=240),
}
"""The least numbers are what this law counted when it was written, of 170 and 68 lines that are reached, in TP of 161 and 53."""


@pytest.mark.parametrize("sensors", [False, True])
@pytest.mark.parametrize("name", FLOORS)
def test_what_is_understood_is_what_a_machine_does(name, sensors):
    """Whatever values sensors give, a line that is not refused sends the robot to no place that is not known; without sensors to
    every place that is known of it, even if it is refused on another way."""
    language, floor, known_lines = LANGUAGES[name], FLOORS[name], 0
    for seed in range(floor.seeds):
        program = small.random_program(Random(seed), sensors=sensors, jumps=seed % 2 == 1)
        if not language.write.takes(program):
            continue
        found = language.read(language.write().program(program))
        known, unknown = understood(found), refused(found)
        went: Went = set()
        for k in range(RUNS if sensors else 1):
            rng = Random(k)
            machine = small.Machine(sensor=lambda rng=rng: rng.randint(0, 60) if sensors else 0)
            machine.run(program)
            went |= machine.went
        reached = {line for line, _ in went}
        assert {one for one in went if one[0] not in unknown} <= known, (seed, found.sources[0].text)
        if not sensors:
            assert {one for one in known if one[0] in reached} <= went, (seed, found.sources[0].text)
        known_lines += len(reached - unknown)
    assert known_lines >= (floor.known_with_sensors if sensors else floor.known)


@pytest.mark.parametrize("name", FLOORS)
def test_a_program_is_read_whichever_line_is_twice_or_not_in_it(name):
    """Names that are declared twice or nowhere, blocks without begin or end: what is not understood is refused; some lines."""
    language, count = LANGUAGES[name], 0
    for seed in range(10):
        program = small.random_program(Random(seed), sensors=True, jumps=True)
        if not language.write.takes(program):
            continue
        first, *others = language.write().program(program)
        lines = first.text.split("\n")
        for at in range(seed % 5, len(lines), 5):
            for instead in ([], [lines[at]] * 2):
                torn = replace(first, text="\n".join([*lines[:at], *instead, *lines[at + 1 :]]))
                with suppress(InputError):
                    language.read([torn, *others])
                    count += 1
    assert count > 30


@pytest.mark.parametrize("name", ["RAPID", "KRL", "KRL in files", "URScript"])
def test_a_program_written_out_does_what_it_did(name):
    """Every line that stands for several motions is written out, as often as there is one; lines count as those they come from.

    A copy of a branch that its turn does not take is read with what stands before it, as any text to which no way leads: of
    programs without sensors the lines count that are reached, of others all.
    """
    lengths = set[int]()
    for seed in range(30):
        program = small.random_program(Random(seed), sensors=seed % 2 == 1)
        given = found = LANGUAGES[name].reading(LANGUAGES[name].written(program))
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


@pytest.mark.parametrize(("name", "seeds"), [("TP", 300), ("RAPID", 60), ("URScript", 60), ("KRL in files", 40)])
def test_summaries_of_routines_change_nothing(monkeypatch, name, seeds):
    """Routines that were gone through in the same state before are not gone through again."""
    language = LANGUAGES[name]
    programs = [small.random_program(Random(seed), sensors=seed % 2 == 0) for seed in range(seeds)]
    texts = [language.write().program(program) for program in programs if language.write.takes(program)]
    summarised = [followed(language.read(text)) for text in texts]
    monkeypatch.setattr("robot_programs.core.interpreter.Interpreter.depends_on", lambda *_: None)
    assert [followed(language.read(text)) for text in texts] == summarised


def followed(program: Program) -> list[tuple[object, ...] | str]:
    """Motions with those before them, and diagnostics."""
    motions = [(one.place, one.end.T.tobytes(), one.follows, one.texts_motions) for one in program.motions]
    return [*motions, *sorted(map(str, program.diagnostics))]
