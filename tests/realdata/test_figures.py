"""What pages say of measured robots, to the digits that they show."""

import importlib
import re
import sys
from pathlib import Path

import pytest

from tests.realdata.figures import MAKERS

sys.path.insert(0, str(Path(__file__).parents[2] / "docs"))
CLAIMS = importlib.import_module("claims").claims()

LONG = {"all_effects_of_ur", "all_effects_of_others", "named_effects", "geometry", "sockets"}
"""Makers that take minutes; tests of effects, conditions and sockets hold to bounds what they make, on fewer splits."""


def fits(made: str, said: str) -> bool:
    """Whether words of a page are those that were made, in which a star stands for any."""
    return re.fullmatch(".*".join(map(re.escape, made.split("*"))), said) is not None


@pytest.mark.realdata
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.long if name in LONG else pytest.mark.slow) for name in MAKERS]
)
def test_figures_of_pages_are_those_measured_again(data_folder: Path, name: str) -> None:
    """Every figure that is made stands on its page as it rounds, and none that its maker alone answers for goes without."""
    claims = [claim for claim in CLAIMS if name in claim.made_by]
    made = list(MAKERS[name](data_folder))
    wrong = [
        (page, words)
        for page, words in made
        if not any(fits(words, said) for c in claims if c.page == page for said in c.says)
    ]
    assert not wrong
    alone = [(c.page, said) for c in claims if c.made_by == (name,) for said in c.says if re.search(r"\d\.\d", said)]
    assert not [(page, said) for page, said in alone if not any(fits(words, said) for at, words in made if at == page)]


def test_figures_makers_are_those_that_claims_name() -> None:
    assert {name for claim in CLAIMS for name in claim.made_by} == set(MAKERS)


@pytest.mark.parametrize(
    ("said", "same"),
    [
        ("| UR5 | the same | 0.64 | 0.11 |", True),
        ("| UR5 | the same | 0.65 | 0.11 |", False),
        ("| UR5 | the same | 0.64 | 0.1 |", False),
    ],
)
def test_figures_differ_where_a_shown_digit_does(said: str, same: bool) -> None:
    assert fits("| UR5 | * | 0.64 | 0.11 |", said) == same
