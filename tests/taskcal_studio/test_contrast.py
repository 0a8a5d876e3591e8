"""What is drawn and written stays readable in grey: contrast by luminance alone, as WCAG 2 defines it."""

import re
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import taskcal_studio
from taskcal.report.scene import MATERIALS
from taskcal_studio.pages.program_page import HIGH, LOW
from taskcal_studio.views import (
    ARROW,
    AXES,
    BEAM,
    BOX,
    CONCERNED,
    CONE,
    DARK_GAIN,
    INK,
    INSTRUMENT,
    KEEP_OUT,
    MARK,
    linear,
)

TEXT, DRAWN = 4.5, 3.0
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
    css = (Path(taskcal_studio.__file__).parent / "studio.css").read_text()
    line = next(line for line in css.splitlines() if line.startswith(f"{scheme} {{ --ink"))
    colours = dict(re.findall(r"--(\w+): (#\w{6})", line))
    for name in ("ink", "quiet", "link", "good", "bad"):
        for ground in ("ground", "panel"):
            assert contrast(colours[name], colours[ground]) >= TEXT, (name, ground)


def brightened(colour: str | tuple[float, float, float]) -> float:
    """Luminance of a colour of a scene on a dark ground."""
    parts = colour if not isinstance(colour, str) else [int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)]
    light = np.minimum(DARK_GAIN * linear(np.array([parts], dtype=float)), 1.0)
    return float(light[0] @ [0.2126, 0.7152, 0.0722])


def test_what_is_drawn_stands_out_from_both_grounds_in_grey() -> None:
    marks = {
        "box": BOX,
        "cone": CONE,
        "arrow": ARROW,
        "point": INK,
        "instrument": INSTRUMENT,
        "beam": BEAM,
        "mark": MARK,
    }
    marks |= {"keep out": KEEP_OUT, "concerned": CONCERNED, "no error": tuple(LOW), "largest error": tuple(HIGH)}
    marks |= {f"axis {k}": colour for k, colour in enumerate(AXES)} | dict(MATERIALS)
    css = (Path(taskcal_studio.__file__).parent / "studio.css").read_text()
    light, dark = re.findall(r"--ground: (#\w{6})", css)
    on_light = {name: contrast(colour, light) for name, colour in marks.items()}
    on_dark = {name: (brightened(colour) + 0.05) / (luminance(dark) + 0.05) for name, colour in marks.items()}
    found = {
        (name, ground): value for ground, all in (("light", on_light), ("dark", on_dark)) for name, value in all.items()
    }
    assert {key: round(value, 2) for key, value in found.items() if value < DRAWN} == {}
    in_reports = {name: contrast(colour, dark) for name, colour in MATERIALS.items()}  # which do not brighten them
    assert {name: round(value, 2) for name, value in in_reports.items() if value < DRAWN} == {}


def test_marks_that_mean_different_things_differ_in_grey() -> None:
    assert contrast(MATERIALS["link"], MATERIALS["joint"]) >= 1.5
    for a, b in combinations((INK, MARK, CONCERNED), 2):
        assert contrast(a, b) >= 1.5, (a, b)


def test_errors_along_a_path_grow_darker_in_grey() -> None:
    scale = [luminance(tuple(LOW + share * (HIGH - LOW))) for share in np.linspace(0.0, 1.0, 9)]
    assert np.all(np.diff(scale) < 0.0)
    assert contrast(tuple(LOW), tuple(HIGH)) >= 2.5


def test_points_are_shown_in_the_colours_that_are_meant() -> None:
    """three.js takes a point's colour for light, and the screen shows that as sRGB."""
    light = linear(np.array([INK, CONCERNED, LOW, HIGH]))
    np.testing.assert_allclose(
        light @ [0.2126, 0.7152, 0.0722], [luminance(tuple(c)) for c in (INK, CONCERNED, LOW, HIGH)]
    )
