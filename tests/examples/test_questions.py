"""The pages that answer integrators' questions show what their study prints, here of one robot."""

import importlib
import re
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
sys.path.insert(0, str(DOCS))
STUDY = importlib.import_module("questions_study")
NUMBER = r"\d+(?:\.\d+)?"
ROBOTS = 1
"""Robots, in place of the pages' ten or twenty: what they show is then right within a factor of two."""


def rows(page: str, begins: str) -> list[list[float]]:
    """Numbers of the lines of a page's tables that begin in a way."""
    text = (DOCS / "how-to" / page).read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if re.match(rf"\| {begins}", line)]
    return [[float(n) for n in re.findall(NUMBER, line)] for line in lines]


@pytest.mark.filterwarnings("ignore:.*measured numbers for.*")
def test_one_reflector_or_three():
    found = list(STUDY.reflectors(ROBOTS))
    said = rows("one-reflector-or-three.md", "(one orientation|tilted and turned)")
    assert len(found) == len(said) == 4
    for (_, count, mm, _), (said_count, said_mm, _) in zip(found, said, strict=True):
        assert count == said_count
        assert 0.5 < mm / said_mm < 2.0


def test_error_outside_the_measured_range():
    found = list(STUDY.outside(5))
    said = rows("read-the-uncertainty.md", "(geometric errors only|gear errors)")
    assert len(found) == len(said) == 4
    for robot, page in zip(found, said, strict=True):
        assert all(0.5 < one / other < 2.0 for one, other in zip(robot[2:], page, strict=True))


@pytest.mark.filterwarnings("ignore:.*measured numbers for.*", "ignore:no model error could be told.*")
def test_how_often_again():
    found = {(mrad, count): (100.0 * share, mm) for mrad, count, share, mm, _ in STUDY.change(ROBOTS)}
    assert len(found) == 9
    said = rows("compare-calibrations.md", rf"{NUMBER} mrad \|")
    assert len(said) == 2
    for mrad, mm, *shares in said:
        assert 0.5 < found[mrad, 40][1] / mm < 2.0
        for count, share in zip((10, 20, 40), shares, strict=True):
            if share in (0.0, 100.0):
                assert found[mrad, count][0] == share
    assert all(found[0.0, count][0] == 0.0 for count in (10, 20, 40))
