"""Charts are images that stand alone: their marks inside their axes, their words apart, whatever is drawn and in whatever words."""

import math
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.report.chart import (
    DARK,
    NARROW,
    SHAPES,
    SIZE,
    WIDE,
    Axis,
    Figure,
    Heatmap,
    Level,
    Panel,
    Scale,
    Series,
    boxed,
    html,
    plain,
    svg,
    text_width,
)  # fmt: skip
from tests.taskcal_studio.hostile_project import MARKUP

SVG = "{http://www.w3.org/2000/svg}"
WORDS = st.text(st.characters(exclude_categories=["Cs"]), max_size=40)
NUMBERS = st.one_of(st.floats(-1e4, 1e4), st.floats(-1e-6, 1e-6), st.just(math.nan), st.just(math.inf))


@st.composite
def figures(draw) -> Figure:
    """Panels of all kinds of marks, on linear and logarithmic axes and beside categories, with missing numbers."""
    names = tuple(draw(st.lists(WORDS, min_size=1, max_size=12)))

    def axis(**more) -> Axis:
        return Axis(title=draw(WORDS), unit=draw(st.sampled_from(["", "mm", "°"])), zero=draw(st.booleans()), **more)

    def series(kind: str, count: int, **more) -> Series:
        x, y = (np.array(draw(st.lists(NUMBERS, min_size=count, max_size=count))) for _ in "xy")
        low, high = (y - 1.0, y + 2.0) if draw(st.booleans()) else (None, None)
        shape = draw(st.sampled_from(["", *SHAPES]))
        return Series(
            **{"kind": kind, "name": draw(WORDS), "x": x, "y": y, "low": low, "high": high, "shape": shape, **more}
        )

    count = draw(st.integers(1, 30))
    plane = Panel(
        x=axis(log=draw(st.booleans())),
        y=axis(log=draw(st.booleans())),
        title=draw(WORDS),
        series=tuple(series(kind, count) for kind in ("points", "line")),
        levels=(Level(at=draw(NUMBERS.filter(math.isfinite)), name=draw(WORDS)),),
    )
    places = np.array(draw(st.lists(st.integers(0, len(names) - 1), min_size=count, max_size=count)))
    kinds = ("bars", "boxes", "points")
    beside = tuple(series(kind, count, y=places, low=None, high=None) for kind in kinds)
    named = Panel(x=axis(log=draw(st.booleans())), y=Axis(categories=names), series=beside)
    edges, heights = (
        np.linspace(0.0, 1.0, count + 1),
        np.array(draw(st.lists(st.integers(0, 9), min_size=count, max_size=count))),
    )
    steps = Panel(x=axis(), y=Axis(zero=True), series=(Series(kind="steps", x=edges, y=heights),))
    z = np.array(draw(st.lists(NUMBERS, min_size=6, max_size=6))).reshape(2, 3)
    cells = Panel(x=axis(), y=axis(), cells=Heatmap(x=np.arange(3.0), y=np.arange(2.0), z=z), equal=draw(st.booleans()))
    return Figure(
        panels=(plane, named, steps, cells), columns=draw(st.integers(1, 3)), shared=draw(st.sampled_from(["", "x"]))
    )


def drawn(figure: Figure, width: float = WIDE) -> ElementTree.Element:
    return ElementTree.fromstring(svg(figure, "title", width=width))


def boxes_of_words(image: ElementTree.Element) -> list[tuple[float, float, float, float, str]]:
    """Left, right, top, bottom and text of every word, by an estimate of its width."""
    out: list[tuple[float, float, float, float, str]] = []
    for word in image.iter(f"{SVG}text"):
        x, y, text = float(word.get("x", "")), float(word.get("y", "")), word.text or ""
        wide = text_width(text)
        left = x - {"end": wide, "middle": 0.5 * wide}.get(word.get("text-anchor", ""), 0.0)
        out.append((left, left + wide, y - 0.75 * SIZE, y + 0.2 * SIZE, text))
    return [box for box in out if box[4].strip()]


@given(figures(), st.sampled_from([WIDE, NARROW]))
def test_every_mark_lies_inside_the_image(figure, width):
    image = drawn(figure, width)
    high = float(image.get("viewBox", "").split()[3])
    for path in image.iter(f"{SVG}path"):
        assert "nan" not in path.get("d", "")
        for x, y in re.findall(r"[ML](-?[\d.]+) (-?[\d.]+)", path.get("d", "")):
            assert -1.0 <= float(x) <= width + 1.0
            assert -1.0 <= float(y) <= high + 1.0


@given(figures(), st.sampled_from([WIDE, NARROW]))
def test_words_of_ticks_and_categories_do_not_overlap(figure, width):
    ends = [box for box in boxes_of_words(drawn(figure, width)) if not box[4].isspace()]
    for k, a in enumerate(ends):
        for b in ends[k + 1 :]:
            apart = a[1] <= b[0] + 0.5 or b[1] <= a[0] + 0.5 or a[3] <= b[2] + 0.5 or b[3] <= a[2] + 0.5
            assert apart, (a, b)


@given(figures())
def test_the_same_chart_is_the_same_image_without_a_script(figure):
    text = html({"a": figure, "b": figure}, "title")
    assert text == html({"a": figure, "b": figure}, "title")
    assert not re.search(r"<script|\bid=|\bon\w+=\"|href", re.sub(r">[^<]*<", "><", text))


@pytest.mark.parametrize(
    "words", [MARKUP, "</title><script>alert(1)</script>", "a & b", "\x1b[31m\x00", 'x" onload="y']
)
def test_words_from_files_are_no_markup(words):
    one = Series(name=words, x=[1.0, 2.0], y=[0, 1], labels=[words] * 2, rows=[words] * 2)
    axis = Axis(title=words, unit=words, categories=())
    panels = (
        Panel(
            x=axis,
            y=Axis(categories=(words, words)),
            title=words,
            series=(one,),
            levels=(Level(at=1.0, name=words, along="x"),),
        ),
        Panel(x=axis, y=axis, series=(one,)),
    )
    image = ElementTree.fromstring(svg(Figure(panels=panels), words))
    assert {part.tag.removeprefix(SVG) for part in image.iter()} == {"svg", "title", "g", "path", "text"}
    assert not [name for part in image.iter() for name in part.attrib if name.startswith("on")]


def test_marks_name_their_value_and_their_row():
    one = Series(name="calibrated", x=[1.0, 2.0, 3.0], y=[0.25, math.nan, 0.5], rows=[7, 8, 9])
    figure = Figure(panels=(Panel(x=Axis(title="pose"), y=Axis(title="error", unit="mm"), series=(one,)),))
    image = ElementTree.fromstring(svg(figure, "title", selects=True))
    marks = [part for part in image.iter(f"{SVG}path") if part.get("data-row")]
    assert [mark.get("data-row") for mark in marks] == ["7", "9"]
    assert [mark[0].text for mark in marks] == ["pose 1: 0.25 mm, calibrated", "pose 3: 0.5 mm, calibrated"]
    narrow = ElementTree.fromstring(svg(figure, "title", width=NARROW, selects=True))
    assert [part.get("data-row") for part in narrow.iter(f"{SVG}path") if part.get("data-row")] == ["7", "9"]


def test_numbers_are_written_as_the_caller_does():
    figure = Figure(panels=(Panel(x=Axis(), y=Axis(), series=(Series(x=[0.5, 1.5], y=[0.25, 0.75]),)),))
    text = svg(figure, "t", say=lambda value, form: plain(value, form).replace(".", ","))
    words = [
        word.text or "" for word in ElementTree.fromstring(text).iter() if word.tag in (f"{SVG}text", f"{SVG}title")
    ]
    assert any("," in word for word in words)
    assert not any("." in word for word in words)


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6), st.booleans(), st.floats(60.0, 800.0))
def test_ticks_lie_on_their_axis_in_order(low, length, log, pixels):
    low = abs(low) + 1e-3 if log else low
    scale = Scale(low, low + length, log, 0.0, pixels)
    ticks = scale.ticks(plain, across=True)
    places = [at for at, _ in ticks]
    assert places == sorted(places)
    assert all(-1e-6 <= at <= pixels + 1e-6 for at in places)
    assert len({text for _, text in ticks}) == len(ticks)


@given(st.floats(0.0, 1e4), st.floats(1.2, 1e4), st.floats(60.0, 800.0))
def test_an_axis_that_counts_has_whole_ticks_alone(low, length, pixels):
    ticks = Scale(low, low + length, False, 0.0, pixels).ticks(plain, across=True, whole=True)
    assert ticks
    assert all(text.isdecimal() for _, text in ticks)


def test_an_axis_whose_larger_end_is_first_counts_backwards():
    """Same ticks as forwards, mirrored."""
    forwards, backwards = (Scale(*ends, False, 0.0, 300.0) for ends in ((0.0, 900.0), (900.0, 0.0)))
    ticks = {text: at for at, text in forwards.ticks(plain, across=False)}
    assert {text: 300.0 - at for at, text in backwards.ticks(plain, across=False)} == pytest.approx(ticks)
    assert len(ticks) > 4


@given(st.floats(1e-4, 1e3), st.floats(1.5, 1e4))
def test_a_logarithmic_axis_has_two_ticks_at_least(least, factor):
    assert len(Scale(least, least * factor, True, 300.0, 0.0).ticks(plain, across=False)) >= 2


def test_a_box_is_tukeys():
    values = np.r_[np.arange(1.0, 12.0), 100.0, -50.0]
    first, third = np.quantile(values, (0.25, 0.75))
    near = values[(values >= first - 1.5 * (third - first)) & (values <= third + 1.5 * (third - first))]
    assert boxed(values) == pytest.approx((near.min(), first, np.median(values), third, near.max()))


def luminance(colour: str) -> float:
    parts = (int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
    linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
    return float(np.dot(linear, (0.2126, 0.7152, 0.0722)))


def contrast(one: str, other: str) -> float:
    high, low = sorted((luminance(one), luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def test_colours_stand_out_in_light_and_in_dark():
    """WCAG 2.2, 1.4.11 and 1.4.3: marks by 3, words, which have the page's ink, by 4.5; report and studio."""
    source = Path(__file__).parents[2] / "src"
    for style, names in (
        ("taskcal/report/report.html.j2", ("ink", "ground")),
        ("taskcal_studio/studio.css", ("ink", "ground")),
    ):
        text = (source / style).read_text(encoding="utf-8")
        (ink, night_ink), (ground, night) = (
            [re.findall(rf"--{name}: (#\w+)", text)[k] for k in (0, 1)] for name in names
        )
        assert min(contrast(ink, ground), contrast(night_ink, night)) >= 4.5
        assert min(contrast(colour, ground) for colour in DARK) >= 3.0
        assert min(contrast(colour, night) for colour in DARK.values()) >= 3.0


@pytest.mark.parametrize("count", [1, 2, 3])
def test_boxes_stand_where_bars_stand_in_the_order_of_the_series(count):
    """Side by side in each category, about its middle."""
    at = {}
    for kind in ("bars", "boxes"):
        x, y = np.tile([1.0, 2.0, 3.0], 2), np.repeat([0.0, 1.0], 3)
        series = tuple(Series(kind=kind, x=x, y=y, colour=f"#{k}{k}{k}") for k in range(count))
        figure = Figure(panels=(Panel(x=Axis(), y=Axis(categories=("a", "b")), series=series),))
        groups = [group for group in drawn(figure).iter() if group.get("color") in {one.colour for one in series}]
        paths = [[part.get("d") for part in group if part.get("d")] for group in groups]
        middle = 4.5 if kind == "bars" else 0.0  # a bar begins at its upper edge, a box at the middle of its whisker
        at[kind] = [sorted({float(re.match(r"M\S+ ([-\d.]+)", path)[1]) + middle for path in own}) for own in paths]
    assert at["bars"] == at["boxes"]
    assert at["boxes"] == sorted(at["boxes"])
    assert len(at["boxes"]) == count
