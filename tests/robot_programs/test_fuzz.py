import pytest

from tests.robot_programs.fuzz import LANGUAGES, check_case, language


@pytest.mark.parametrize("name", LANGUAGES)
def test_damaged_programs_are_read_or_refused_and_keep_every_byte(name):
    outcomes = {check_case(language(name), seed) for seed in range(40)}
    assert "rewritten" in outcomes
