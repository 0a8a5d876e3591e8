"""Laws of all languages, on random programs."""

import pytest
from hypothesis import given

from tests.laws.robots import generators
from tests.robot_programs.fuzz import LANGUAGES, check_case, language, unchanged


@pytest.mark.parametrize("name", LANGUAGES)
@given(rng=generators)
def test_rewrite_keeps_every_byte_without_changes(name, rng):
    """Every byte stays where nothing is rewritten, and where motions get the ends that they have."""
    tested = language(name)
    sources = tested.generate(rng)
    program = tested.read(sources)
    for waypoints in ({}, unchanged(tested, program)):
        again = program.rewrite(tested.robot, waypoints)
        assert [source.encode() for source in again] == [source.encode() for source in sources]


@pytest.mark.parametrize("name", LANGUAGES)
def test_damaged_program_keeps_every_byte_or_is_refused(name):
    """Damaged programs are read or refused with the name of a file, and keep every byte; those read can be rewritten."""
    outcomes = {check_case(language(name), seed) for seed in range(40)}
    assert "rewritten" in outcomes
