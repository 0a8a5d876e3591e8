"""The sentence of a verdict, and its picture: what was decided, by which rule, and how sure that is."""

import re
from typing import Any

import numpy as np
import pytest

from taskcal.report.chart import svg
from taskcal.report.verdict import draw_interval, state_verdict, verdict_section

LOW, EXPECTED, HIGH = 0.021, 0.034, 0.055
ALLOWED = {"met": 0.1, "not met": 0.01, "not known": 0.04}


def verdict(decision: str, allowed: float | None) -> dict[str, Any]:
    """Of a tool point over a task, beside a program that was not corrected."""
    known = {
        "subject": "tool point",
        "decision": decision,
        "tolerance_mm": allowed,
        "expected_mm": EXPECTED,
        "interval_mm": [LOW, HIGH],
        "largest": "geometry",
        "share": 0.9,
        "remedy": "measure more rows",
        "reasons": [],
    }
    unknown = dict.fromkeys(("expected_mm", "interval_mm", "largest", "share", "remedy"))
    program = {**known, **unknown, "subject": "program on the part", "decision": "not known"}
    return {
        "task": "milling",
        "program": "",
        "tool": "its own",
        "rule": "Met: all of it.",
        "override": None,
        "judgements": [known, program],
    }


@pytest.mark.parametrize(("decision", "allowed"), [*ALLOWED.items(), ("not known", None)])
def test_a_verdict_begins_with_a_sentence_that_says_all(decision: str, allowed: float | None) -> None:
    judged = verdict(decision, allowed)
    said = str(state_verdict(judged))
    assert said.startswith("Over the task “milling” the tool point")
    shown = [EXPECTED, LOW, HIGH, *([] if allowed is None else [allowed])]
    assert sorted(float(number) for number in re.findall(r"\d\.\d{3}", said)) == sorted(shown)
    assert said.endswith(
        "no tolerance is stated." if allowed is None else f"{'is ' if decision == 'not known' else ''}{decision}."
    )
    assert said in str(verdict_section(judged).blocks[0])


def test_the_picture_has_interval_and_tolerance_in_scale() -> None:
    """The line of the tolerance lies beyond the interval as far as the numbers say."""
    drawn = svg(draw_interval(verdict("met", 0.1)["judgements"][0], "tool point", "expected error", "tolerance"), "")
    low, high, middle = map(float, re.search(r"M([\d.]+) [\d.]+H([\d.]+)M([\d.]+) [^H]*z", drawn).groups())  # pyright: ignore[reportOptionalMemberAccess]
    line = float(re.findall(r"M([\d.]+) [\d.]+V[\d.]+\"[^>]*dasharray", drawn)[0])
    assert np.diff([low, middle, high, line]) / (high - low) == pytest.approx(
        np.diff([LOW, EXPECTED, HIGH, 0.1]) / (HIGH - LOW), abs=0.01
    )
