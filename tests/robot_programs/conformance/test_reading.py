"""Every language reads what its programs do, and refuses what the text does not tell."""

from collections import Counter

import pytest

from tests.robot_programs.conformance.cases import CASES, UNREAD, UNWRITABLE, truth
from tests.robot_programs.conformance.languages import LANGUAGES, RUNNING, place_of, refused, understood


@pytest.mark.parametrize(("name", "case"), RUNNING)
def test_lines_are_read_as_the_machine_goes_or_refused(name, case):
    """A line that goes elsewhere by what sensors give is refused; every other one is read, with all places it leads to."""
    language, made = LANGUAGES[name], CASES[case]()
    program = language.reading(language.written(made))
    done = truth(made)
    went, decided = done.went, done.decided
    left = refused(program) & went.keys()  # a routine that is not in the files may count as a motion
    assert decided <= left, program.sources[0].text
    expected = {(line, place) for line, places in went.items() for place in places if line not in left}
    assert {one for one in understood(program) if one[0] in went.keys() - left} == expected, program.sources[0].text
    if (name, case) in UNREAD:
        assert decided < left, "the gap is closed: take it out of the table"
    else:
        assert decided == left, program.diagnostics


@pytest.mark.parametrize(("name", "case"), RUNNING)
def test_motion_follows_the_one_that_the_machine_makes_before(name, case):
    """Where one motion always comes before another, it is known; where several do, none is."""
    language, made = LANGUAGES[name], CASES[case]()
    program = language.reading(language.written(made))
    before, motions = truth(made).before, program.motions
    known, lines = understood(program), Counter(motion.place.line for motion in motions)
    assert len(known) == len(motions)
    for motion in motions:
        if motion.place.line not in refused(program):
            assert motion.texts_motions == lines[motion.place.line]
            assert motion.divisible == (motion.texts_motions == 1)
        if (here := place_of(motion)) in before:
            (one, *others) = before[here]
            follows = None if motion.follows is None else place_of(motions[motion.follows])
            assert follows == (one if not others and one in known else None)


@pytest.mark.parametrize("name", LANGUAGES)
def test_what_a_language_cannot_say_is_in_the_table(name):
    lacking = {case for case, make in CASES.items() if not LANGUAGES[name].write.takes(make())}
    assert lacking == UNWRITABLE.get(name, {}).keys()
