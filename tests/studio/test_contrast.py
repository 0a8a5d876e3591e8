"""What is drawn and written stays readable in grey: contrast by luminance alone, as WCAG 2 defines it."""

import re
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import taskcal.studio
from taskcal.studio.pages.program_page import HIGH, LOW
from taskcal.studio.views import (
    ARROW,
    AXES,
    BACKGROUND,
    BOX,
    CONCERNED,
    CONE,
    INK,
    JOINT,
    KEEP_OUT,
    LINK,
    LOOP,
    PICKED,
    SEEN,
    TRACKER,
    linear,
)

TEXT, MARK = 4.5, 3.0
"""Least contrast of text and of what is drawn (WCAG 2.2, 1.4.3 and 1.4.11)."""


def luminance(colour: str | tuple[float, float, float]) -> float:
    parts = colour if not isinstance(colour, str) else [int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)]
    c = np.asarray(parts)
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(a: str | tuple[float, float, float], b: str | tuple[float, float, float]) -> float:
    low, high = sorted((luminance(a), luminance(b)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("scheme", [":root", "body.body--dark"])
def test_text_is_readable_in_grey_in_both_schemes(scheme: str) -> None:
    css = (Path(taskcal.studio.__file__).parent / "studio.css").read_text()
    line = next(line for line in css.splitlines() if line.startswith(f"{scheme} {{ --ink"))
    colours = dict(re.findall(r"--(\w+): (#\w{6})", line))
    for name in ("ink", "quiet", "link", "good", "bad"):
        for ground in ("ground", "panel"):
            assert contrast(colours[name], colours[ground]) >= TEXT, (name, ground)


def test_what_is_drawn_stands_out_from_the_ground_in_grey() -> None:
    marks = {"link": LINK, "joint": JOINT, "loop": LOOP, "box": BOX, "cone": CONE, "arrow": ARROW, "point": INK}
    marks |= {
        "tracker": TRACKER,
        "beam": SEEN,
        "keep out": KEEP_OUT,
        "concerned": CONCERNED,
        "no error": tuple(LOW),
        "largest error": tuple(HIGH),
    }
    found = {name: contrast(colour, BACKGROUND) for name, colour in marks.items()}
    found |= {f"axis {k}": contrast(colour, BACKGROUND) for k, colour in enumerate(AXES)}
    assert {name: round(value, 2) for name, value in found.items() if value < MARK} == {}


def test_marks_that_mean_different_things_differ_in_grey() -> None:
    for a, b in combinations({"link": LINK, "joint": JOINT}.items(), 2):
        assert contrast(a[1], b[1]) >= 1.5, (a, b)
    for a, b in combinations((INK, PICKED, CONCERNED), 2):
        assert contrast(a, b) >= 1.5, (a, b)


def test_errors_along_a_path_grow_darker_in_grey() -> None:
    scale = [luminance(tuple(LOW + share * (HIGH - LOW))) for share in np.linspace(0.0, 1.0, 9)]
    assert np.all(np.diff(scale) < 0.0)
    assert contrast(tuple(LOW), tuple(HIGH)) >= 2.5


def test_points_are_shown_in_the_colours_that_are_meant() -> None:
    """three.js takes a point's colour for light, and the screen shows that as sRGB."""
    light = linear(np.array([INK, PICKED, LOW, HIGH]))
    np.testing.assert_allclose(
        light @ [0.2126, 0.7152, 0.0722], [luminance(tuple(c)) for c in (INK, PICKED, LOW, HIGH)]
    )
