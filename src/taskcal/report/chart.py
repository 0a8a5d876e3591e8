"""Charts: frozen data, and their image as SVG, which stands in a page or alone, in light, in dark and on paper."""

import base64
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from html import escape
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from taskcal.errors import printable

# Colours: those of Okabe and Ito (2008), which colour-blind readers distinguish, each dark enough for marks on white.

BLUE, ORANGE, GREEN, VERMILION, PURPLE, GREY = "#0072B2", "#B97D00", "#009E73", "#D55E00", "#AA4499", "#7A7A7A"
DARK = {
    BLUE: "#56B4E9", ORANGE: "#E69F00", GREEN: "#3CC79B", VERMILION: "#FF8A3D", PURPLE: "#DB8ACB", GREY: "#A3ADB7",
}  # fmt: skip
"""The same on a dark ground."""
INK = "currentColor"
"""That of the words around the image."""

AXIS_COLOURS = {"X": BLUE, "Y": ORANGE, "Z": GREEN}
SERIES = (VERMILION, BLUE, GREEN, PURPLE, ORANGE, GREY)
SHAPES = ("circle", "square", "diamond", "triangle", "cross", "x")
"""Of series, which differ without colour, too."""

STYLE = (
    ".chart{container-type:inline-size}.chart svg{display:block;width:100%;max-width:1060px;height:auto}"
    ".chart svg.chart-narrow{display:none}@container (max-width:620px){.chart svg.chart-narrow{display:block}"
    ".chart svg.chart-wide{display:none}}"
)
"""Of a page that shows charts."""


def dark_style(within: str = "") -> str:
    """Rules for charts on a dark ground, of all or of those within a selector."""
    return "".join(f"{within} .c-{light[1:]}{{color:{dark}}}" for light, dark in DARK.items())


# What a chart shows.

Values = Sequence[float] | np.ndarray[Any, Any]
"""Numbers of a series."""


@dataclass(frozen=True, kw_only=True)
class Axis:
    """What an axis measures, or the categories along it, from the top."""

    title: str = ""
    unit: str = ""
    log: bool = False
    span: tuple[float, float] | None = None
    """Its ends, the larger first where it counts downwards or to the left; by default all that is drawn, and a little room."""
    zero: bool = False
    """Whether it begins at zero."""
    categories: tuple[str, ...] = ()
    """Names of the values 0, 1, 2 …; of a vertical axis alone, where names have room."""
    whole: bool = False
    """Whether it counts, so that only whole numbers are ticks; of a horizontal axis."""

    @property
    def label(self) -> str:
        """Title and unit."""
        return f"{self.title} ({self.unit})" if self.title and self.unit else self.title or self.unit


@dataclass(frozen=True, kw_only=True, eq=False)
class Series:
    """Marks of one kind; what is not finite is not drawn."""

    x: Values
    y: Values
    name: str = ""
    """In the legend."""
    kind: Literal["points", "line", "bars", "boxes", "steps"] = "points"
    """Bars reach from zero to `x`; boxes are of the `x` in each category; steps have heights `y` between the edges `x`."""
    colour: str = BLUE
    shape: str = ""
    """One of `SHAPES`; points are circles by default, and a line has no marks."""
    low: Values | None = None
    """Lower ends of intervals: of `x` beside categories, else of `y`."""
    high: Values | None = None
    hollow: Sequence[bool] | bool = False
    """Which marks are empty: those that do not count."""
    dash: bool = False
    labels: Sequence[str] = ()
    """What each mark stands for; by default its value along the other axis."""
    rows: Sequence[int | str] = ()
    """Row that each mark stands for, by which a page selects it (``data-row``) where it does."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Heatmap:
    """A map: coloured cells about their middles, empty where a value is NaN."""

    x: Float[np.ndarray, " x"]
    y: Float[np.ndarray, " y"]
    z: Float[np.ndarray, "y x"]


@dataclass(frozen=True, kw_only=True)
class Level:
    """A line of reference right through a panel, such as a tolerance."""

    at: float
    name: str
    colour: str = GREY
    along: Literal["x", "y"] = "y"
    """Axis on which its value is."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Panel:
    """What has one pair of axes."""

    x: Axis
    y: Axis
    title: str = ""
    series: tuple[Series, ...] = ()
    cells: Heatmap | None = None
    levels: tuple[Level, ...] = ()
    image: bytes = b""
    """JPEG behind all, from one end of the axes to the other."""
    height: float = 260.0
    """Of the axes, CSS pixels; categories have the height that they need."""
    equal: bool = False
    """Whether both axes have the same scale."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Figure:
    """Panels side by side where there is room, with one legend."""

    panels: tuple[Panel, ...]
    columns: int = 1
    shared: str = ""
    """Axes, ``x``, ``y`` or both, that have the same ends in all panels."""
    scale: tuple[float, float, str] = (0.0, 1.0, "")
    """Values of the darkest and the brightest cell, and their unit."""

    def said(self, by: Callable[[str], str]) -> "Figure":
        """The figure with all that it says as a function has it, such as that of a page's language."""

        def axis(one: Axis) -> Axis:
            return replace(one, title=by(one.title), categories=tuple(map(by, one.categories)))

        panels = (
            replace(
                panel,
                title=by(panel.title),
                x=axis(panel.x),
                y=axis(panel.y),
                series=tuple(replace(s, name=by(s.name), labels=tuple(map(by, s.labels))) for s in panel.series),
                levels=tuple(replace(level, name=by(level.name)) for level in panel.levels),
            )
            for panel in self.panels
        )
        low, high, unit = self.scale
        return replace(self, panels=tuple(panels), scale=(low, high, by(unit)))


def boxed(values: Float[np.ndarray, " n"]) -> tuple[float, float, float, float, float]:
    """Whisker, quartile, median, quartile and whisker, which reaches the last value within 1.5 boxes (Tukey 1977)."""
    first, median, third = (float(v) for v in np.quantile(values, (0.25, 0.5, 0.75)))
    near = values[np.abs(values - 0.5 * (first + third)) <= 2.0 * (third - first) + 1e-300]
    return float(near.min(initial=first)), first, median, third, float(near.max(initial=third))


# Numbers.

Say = Callable[[float, str], str]
"""A number as text, by its format."""


def plain(value: float, form: str) -> str:
    """A number in English."""
    return format(value, form).replace("-", "−")


def _value(value: float, say: Say) -> str:
    whole = value == round(value) and abs(value) < 1e9
    return say(value, ".0f" if whole or abs(value) >= 1e3 else ".4g")


SMALL_STEP, LARGE_TICK = 1e-6, 1e7
"""Steps below, and ticks from there on, are written with a power of ten: millimetres are not worth more decimals."""


def _tick_text(value: float, step: float, say: Say) -> str:
    if step > 0.0:
        if step < SMALL_STEP or abs(value) >= LARGE_TICK:
            digits = math.ceil(math.log10(max(abs(value), step) / step)) + 1
            return say(value + 0.0, f".{digits}g")
        return say(value + 0.0, f".{max(0, -math.floor(math.log10(step) + 1e-9))}f")
    if 1e-4 <= value < 1e6:
        return say(value, ".7g")
    return "10" + str(round(math.log10(value))).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def _even(low: float, high: float, most: int) -> tuple[list[float], float]:
    """Ticks at 1, 2 or 5 of a decade, at most so many, and their step."""
    rough = max(high - low, 1e-300) / most
    decade = 10.0 ** math.floor(math.log10(rough))
    step = next(m * decade for m in (1, 2, 5, 10) if m * decade >= rough * (1 - 1e-9))
    return [k * step for k in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)], step


def _decades(low: float, high: float) -> Iterator[tuple[list[float], float]]:
    """Ticks of a logarithmic axis, from many to few; even steps where no two of them lie on it."""
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    choices = [((1, 2, 5), 1), *(((1,), every) for every in (1, 2, 3, 6, 12, 24, 48, 96))]
    for digits, every in choices:
        ticks = [float(f"{m}e{k}") for k in range(first, last + 1) if k % every == 0 for m in digits]
        ticks = [tick for tick in ticks if low * (1 - 1e-9) <= tick <= high * (1 + 1e-9)]
        if len(ticks) > 1:
            yield ticks, 0.0
    yield from (_even(low, high, most) for most in (5, 3, 2, 1))


@dataclass(frozen=True)
class Scale:
    """From the values of an axis to places in the image."""

    low: float
    high: float
    log: bool
    start: float
    end: float

    def at(self, values: Values | float) -> Float[np.ndarray, "..."]:
        """Places of values; NaN for those beyond the ends."""
        low, high = (math.log10(v) if self.log else v for v in (self.low, self.high))
        values = np.asarray(values, dtype=float)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = ((np.log10(values) if self.log else values) - low) / (high - low)
        return np.where(np.abs(share - 0.5) <= 0.5 + 1e-9, self.start + share * (self.end - self.start), np.nan)

    def ticks(self, say: Say, *, across: bool, whole: bool = False) -> list[tuple[float, str]]:
        """Places and texts of as many ticks as have room, of an axis across or upright; only of whole numbers where it counts."""
        low, high = sorted((self.low, self.high))
        choices = _decades(low, high) if self.log else (_even(low, high, most) for most in range(9, 0, -1))
        drawn: list[tuple[float, str]] = []
        for ticks, step in choices:
            if whole and step < 1.0:
                continue
            placed = zip(self.at(ticks).tolist(), ticks, strict=True)
            drawn = [(at, _tick_text(tick, step, say)) for at, tick in placed if math.isfinite(at)]
            room = [text_width(text) + 10 if across else 1.7 * SIZE for _, text in drawn]
            pairs = zip(drawn, drawn[1:], room, room[1:], strict=False)
            if all(abs(b[0] - a[0]) >= 0.5 * (r + s) for a, b, r, s in pairs):
                break
        return drawn


def _ends(axis: Axis, name: str, panels: Iterable[Panel]) -> tuple[float, float]:
    """Ends of an axis that shows all that is drawn."""
    if axis.categories:
        return -0.5, len(axis.categories) - 0.5
    if axis.span is not None:
        return axis.span
    seen = np.concatenate([np.empty(0), *(_shown(panel, name) for panel in panels)])
    seen = seen[np.isfinite(seen) & ((seen > 1e-300) | (not axis.log))]
    if not len(seen):
        return (0.1, 10.0) if axis.log else (0.0, 1.0)
    low, high = float(seen.min()), float(seen.max())
    if axis.log:
        room = max((high / low) ** 0.05, 1.15)
        return low / room, high * room
    largest = max(abs(low), abs(high))
    if largest < 1e-12:  # nothing but rounding
        return 0.0 if axis.zero else -1.0, 1.0
    room = 0.05 * (high - low if high - low > 1e-9 * largest else largest)
    return 0.0 if axis.zero and low >= 0.0 else low - room, high + room


def _shown(panel: Panel, name: str) -> Float[np.ndarray, " n"]:
    """Values of a panel along an axis."""
    if panel.cells is not None:
        return _edges(getattr(panel.cells, name))
    across = bool(panel.y.categories) == (name == "x")  # the axis along which intervals lie
    parts: list[Values] = [[level.at for level in panel.levels if level.along == name]]
    for one in panel.series:
        parts += [getattr(one, name), *((end for end in (one.low, one.high) if end is not None) if across else ())]
        if one.kind in ("bars", "steps") and name == ("x" if one.kind == "bars" else "y"):
            parts.append([0.0])
    return np.concatenate([np.asarray(part, dtype=float).ravel() for part in parts])


def _edges(middles: Float[np.ndarray, " n"]) -> Float[np.ndarray, " m"]:
    if len(middles) < 2:
        return np.array([middles[0] - 0.5, middles[0] + 0.5])
    between = 0.5 * (middles[1:] + middles[:-1])
    return np.r_[2 * middles[0] - between[0], between, 2 * middles[-1] - between[-1]]


# Words.

SIZE = 13.0
"""Of letters, CSS pixels."""
FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"
LINE = 1.25 * SIZE


_WIDTHS = dict.fromkeys(" ijlftI.,:;'|!()[]−-", 0.36) | dict.fromkeys("mwMW@%…", 0.95)


def text_width(text: str) -> float:
    """Room that a text takes in a wide typeface without serifs, CSS pixels; no font is at hand where the image is made."""
    other = {c: 1.05 if ord(c) > 0x2E7F else 0.74 if c.isupper() else 0.62 for c in text}
    return SIZE * sum(_WIDTHS.get(c, other[c]) for c in text)


def _wrapped(text: str, room: float) -> list[str]:
    """Lines of a text that have room, cut between words, or within one that has none."""
    lines: list[str] = [""]
    for word in printable(text).split(" "):
        whole = f"{lines[-1]} {word}".strip()
        if text_width(whole) <= room:
            lines[-1] = whole
            continue
        lines += [""] if lines[-1] else []
        for letter in word:
            if text_width(lines[-1] + letter) > room and lines[-1]:
                lines.append("")
            lines[-1] += letter
    return lines


def _escaped(text: str) -> str:
    return escape(printable(text))


def _word(x: float, y: float, text: str, more: str = "") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}"{more}>{_escaped(text)}</text>'


# Marks.

WIDE, NARROW = 880, 350
"""Widths of the images of a page, CSS pixels: for a desk and for a telephone, on which letters have the same size."""

MAX_NAMED = 300
"""Marks of a series up to which each names its value under the pointer, and lines have such marks at all."""

MAX_ON_LINE = 60
"""Points up to which a line without marks names them."""

R = 4.0
"""Radius of a mark, CSS pixels."""
PATHS = {
    "circle": f"m-{R} 0a{R} {R} 0 1 0 {2 * R} 0a{R} {R} 0 1 0-{2 * R} 0z",
    "square": "m-3.5-3.5h7v7h-7z",
    "diamond": "m-4.7 0l4.7-4.7 4.7 4.7-4.7 4.7z",
    "triangle": "m-4.4 3.4l4.4-7.8 4.4 7.8z",
    "cross": "m-4.4 0h8.8m-4.4-4.4v8.8",
    "x": "m-3.6-3.6l7.2 7.2m0-7.2l-7.2 7.2",
    "tick": "m0-8v16",
    "ring": "m-8 0a8 8 0 1 0 16 0a8 8 0 1 0-16 0z",
}
SMALL = {
    "circle": "m-2 0a2 2 0 1 0 4 0a2 2 0 1 0-4 0z",
    "square": "m-1.8-1.8h3.6v3.6h-3.6z",
    "diamond": "m-2.4 0l2.4-2.4 2.4 2.4-2.4 2.4z",
    "triangle": "m-2.3 1.8l2.3-4 2.3 4z",
    "cross": "m-2.2 0h4.4m-2.2-2.2v4.4",
    "x": "m-1.8-1.8l3.6 3.6m0-3.6l-3.6 3.6",
}
"""Where marks are many."""

DOTS = {"circle": "round", "square": "square"}
"""Shapes of the ends of a line without length, which takes half the room of a path around them, where marks are many."""
DOT, DOT_WIDTH = "h0", 5.0

VIRIDIS = np.array([[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]], dtype=float)
"""Colours of cells, even in grey as well."""


def _shade(share: float) -> str:
    rgb = [np.interp(4.0 * share, np.arange(5), VIRIDIS[:, k]) for k in range(3)]
    return "#" + "".join(f"{round(v):02x}" for v in rgb)


@dataclass(frozen=True, kw_only=True)
class _Canvas:
    """A panel's axes in an image."""

    panel: Panel
    x: Scale
    y: Scale
    say: Say
    named: bool
    selects: bool

    def mark(self, path: str, said: str, row: int | str | None = None, more: str = "") -> str:
        data = "" if row is None or not self.selects else f' data-row="{_escaped(str(row))}"'
        if not said or not self.named:
            return f'<path d="{path}"{data}{more}/>'
        return f'<path d="{path}"{data}{more}><title>{_escaped(said)}</title></path>'

    def said(self, one: Series, k: int, x: float, y: float) -> str:
        """What a mark says under the pointer: what it is, its value, the name of its series."""
        axes = self.panel.x, self.panel.y
        across = bool(axes[1].categories)
        over, value, at, other = (axes[0], x, axes[1], y) if across else (axes[1], y, axes[0], x)
        where = f"{at.title} {_value(other, self.say)} {at.unit}".strip()
        label = one.labels[k] if len(one.labels) else at.categories[round(other)] if at.categories else where
        interval = ""
        if one.low is not None and one.high is not None:
            low, high = (float(np.asarray(end, dtype=float)[k]) for end in (one.low, one.high))
            interval = f" ({_value(low, self.say)} … {_value(high, self.say)})"
        name = f", {one.name}" if one.name else ""
        return f"{label}: {_value(value, self.say)}{interval} {over.unit}".rstrip() + name

    def draw(self, one: Series, shift: float) -> Iterator[str]:
        """The marks of a series; those of a category moved by so many pixels."""
        x, y = (np.asarray(v, dtype=float).ravel() for v in (one.x, one.y))
        at = self.x.at(x), self.y.at(y) + (shift if self.panel.y.categories else 0.0)
        yield f'<g class="c-{one.colour[1:]}" color="{one.colour}" fill="currentColor" stroke="currentColor" stroke-width="1.4">'
        if one.kind == "boxes":
            yield from self._boxes(one, x, y, shift)
        elif one.kind == "steps":
            yield from self._steps(one, x, y)
        elif one.kind == "bars":
            zero = float(self.x.at(min(max(0.0, self.x.low), self.x.high)))
            bars = [f"M{zero:.1f} {b - 4.5:.1f}H{a:.1f}v9H{zero:.1f}z" for a, b in zip(*at, strict=True)]
            yield from self._marks(one, x, y, bars, named=True)
        else:
            if one.kind == "line":
                dash = ' stroke-dasharray="6 4"' if one.dash else ""
                more = f' fill="none" stroke-width="2" stroke-linejoin="round"{dash}'
                yield self.mark(_line(*at), one.name, more=more)
            yield from self._points(one, x, y, at)
        yield "</g>"

    def _points(self, one: Series, x: np.ndarray, y: np.ndarray, at: tuple[np.ndarray, np.ndarray]) -> Iterator[str]:
        unseen = one.kind == "line" and not one.shape
        many = int(np.isfinite(at[0] + at[1]).sum()) > (MAX_ON_LINE if unseen else MAX_NAMED)
        if unseen and (many or not self.named):
            return
        shape = one.shape or "circle"
        dots = many and shape in DOTS and one.low is None and not np.any(one.hollow)
        path = DOT if dots else SMALL.get(shape, PATHS[shape]) if many else PATHS[shape]
        paths = [f"M{a:.1f} {b:.1f}{path}" for a, b in zip(*at, strict=True)]
        if one.low is not None and one.high is not None and one.kind == "points":
            beside = bool(self.panel.y.categories)
            ends = zip(*((self.x if beside else self.y).at(v) for v in (one.low, one.high)), strict=True)
            bars = (
                f"M{low:.1f} {b:.1f}H{high:.1f}" if beside else f"M{a:.1f} {low:.1f}V{high:.1f}"
                for (low, high), a, b in zip(ends, *at, strict=True)
            )
            paths = [(bar if "nan" not in bar else "") + path for bar, path in zip(bars, paths, strict=True)]
        dotted = f'<g stroke-opacity=".7" stroke-width="{DOT_WIDTH}" stroke-linecap="{DOTS.get(shape)}">'
        yield '<g opacity="0">' if unseen else dotted if dots else '<g fill-opacity=".7">'
        yield from self._marks(one, x, y, paths, named=not many)
        yield "</g>"

    def _marks(self, one: Series, x: np.ndarray, y: np.ndarray, paths: list[str], *, named: bool) -> Iterator[str]:
        """Marks that are drawn; as one path where none of them stands for anything by itself."""
        hollow = np.broadcast_to(np.asarray(one.hollow, dtype=bool), x.shape).tolist()
        fills = {True: ' fill="none"', False: ""}
        seen = [k for k, path in enumerate(paths) if "nan" not in path]
        if not (self.named and named) and not (self.selects and len(one.rows)):
            for empty, fill in fills.items():
                whole = "".join(paths[k] for k in seen if hollow[k] is empty)
                yield self.mark(whole, "", more=fill) if whole else ""
            return
        for k in seen:
            said = self.said(one, k, float(x[k]), float(y[k])) if named else ""
            yield self.mark(paths[k], said, one.rows[k] if len(one.rows) else None, fills[hollow[k]])

    def _boxes(self, one: Series, x: np.ndarray, y: np.ndarray, shift: float) -> Iterator[str]:
        for place in np.unique(y):
            own = x[(y == place) & np.isfinite(self.x.at(x))]
            if not len(own):
                continue
            numbers = boxed(own)
            a, b, c, d, e = self.x.at(numbers)
            at = float(self.y.at(place)) + shift
            away = "".join(
                f"M{v:.1f} {at:.1f}{SMALL['circle']}" for v in self.x.at(own[(own < numbers[0]) | (own > numbers[-1])])
            )
            path = (
                f"M{a:.1f} {at:.1f}H{b:.1f}M{d:.1f} {at:.1f}H{e:.1f}M{b:.1f} {at - 5:.1f}H{d:.1f}v10H{b:.1f}z"
                f"M{c:.1f} {at - 5:.1f}v10{away}"
            )
            said = self.said(one, 0, numbers[2], float(place))
            spread = " … ".join(_value(v, self.say) for v in (numbers[1], numbers[3]))
            yield self.mark(path, f"{said}; {spread}", more=' fill-opacity=".25"')

    def _steps(self, one: Series, x: np.ndarray, y: np.ndarray) -> Iterator[str]:
        left, tops, zero = self.x.at(x), self.y.at(y), float(self.y.at(0.0))
        yield '<g stroke="none" fill-opacity=".22">'
        for k, top in enumerate(tops):
            path = f"M{left[k]:.1f} {zero:.1f}V{top:.1f}H{left[k + 1]:.1f}V{zero:.1f}z"
            ends = " … ".join(_value(float(v), self.say) for v in x[k : k + 2])
            yield self.mark(path, f"{ends} {self.panel.x.unit}: {_value(float(y[k]), self.say)}, {one.name}")
        dash = ' stroke-dasharray="6 4"' if one.dash else ""
        over = "".join(f"V{top:.1f}H{right:.1f}" for top, right in zip(tops, left[1:], strict=True))
        yield f'</g><path d="M{left[0]:.1f} {zero:.1f}{over}V{zero:.1f}" fill="none" stroke-width="2"{dash}/>'

    def cells(self, cells: Heatmap, scale: tuple[float, float, str]) -> Iterator[str]:
        """A map; cells of one colour as one path where none names its value."""
        alike: dict[str, str] = {}
        left, top = self.x.at(_edges(cells.x)), self.y.at(_edges(cells.y))
        yield '<g shape-rendering="crispEdges">'
        for j, i in zip(*np.nonzero(np.isfinite(cells.z)), strict=True):
            value = float(cells.z[j, i])
            share = (value - scale[0]) / ((scale[1] - scale[0]) or 1.0)
            path = f"M{left[i]:.1f} {top[j]:.1f}H{left[i + 1]:.1f}V{top[j + 1]:.1f}H{left[i]:.1f}z"
            place = ", ".join(_value(float(v), self.say) for v in (cells.x[i], cells.y[j]))
            said = f"{place}: {_value(value, self.say)} {scale[2]}"
            shade = _shade(min(max(share, 0.0), 1.0))
            if self.named:
                yield self.mark(path, said, more=f' fill="{shade}"')
            else:
                alike[shade] = alike.get(shade, "") + path
        yield from (self.mark(path, "", more=f' fill="{shade}"') for shade, path in alike.items())
        yield "</g>"


def _line(x: Float[np.ndarray, " n"], y: Float[np.ndarray, " n"]) -> str:
    """A path through points, broken where one is not drawn; of very many the lowest and highest of each pixel."""
    if len(x) > 4 * WIDE:
        parts = np.array_split(np.arange(len(x)), WIDE)
        ends = [(part[np.argmin(y[part])], part[np.argmax(y[part])]) for part in parts if np.isfinite(y[part]).all()]
        keep = np.unique(np.array(ends, dtype=int).ravel())
        x, y = x[keep], y[keep]
    out, before = "", False
    for a, b in zip(x, y, strict=True):
        drawn = math.isfinite(a + b)
        out += f"{'L' if before else 'M'}{a:.1f} {b:.1f}" if drawn else ""
        before = drawn
    return out


# The image.

FIRST_TICK = 18.0
"""Room of half the text at the left end of a horizontal axis, CSS pixels."""
ROW = 19.0
"""Height of a category, CSS pixels; of several series with bars or boxes, each has 11 of its own."""


def svg(figure: Figure, title: str, *, width: float = WIDE, say: Say = plain, selects: bool = False) -> str:
    """Draw a chart.

    Args:
        figure: the chart.
        title: what it shows, for those who do not see it.
        width: of the image, CSS pixels; panels stand one below the other where it is `NARROW`.
        say: number to text.
        selects: whether the page selects marks by their rows, which takes an element for each of many, too.

    Returns:
        An SVG element that needs no style and no script; words have the colour of the page's.
    """
    columns = figure.columns if width > NARROW else 1
    gap, room = 22.0, float(width)
    across = (room - gap * (columns - 1)) / columns
    body, y = _legend(figure, room, say)
    for start in range(0, len(figure.panels), columns):
        heights = [0.0]
        for k, panel in enumerate(figure.panels[start : start + columns]):
            drawn, height = _draw(
                figure, panel, k * (across + gap), y, across, say, named=width > NARROW, selects=selects
            )
            body += drawn
            heights.append(height)
        y += max(heights) + 8.0
    name = "chart-wide" if width > NARROW else "chart-narrow"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="{name}" role="img" viewBox="0 0 {width:.0f} {y:.0f}" width="{width:.0f}" '
        f'height="{y:.0f}" font-family="{escape(FONT)}" font-size="{SIZE:.0f}" fill="currentColor"><title>{_escaped(title)}</title>'
        f"{''.join(body)}</svg>"
    )


def _draw(
    figure: Figure, panel: Panel, left: float, top: float, width: float, say: Say, *, named: bool, selects: bool
) -> tuple[list[str], float]:
    """A panel, and its height."""
    out: list[str] = []
    y = top
    heading = [(f"{line}", ' font-weight="600"') for line in (_wrapped(panel.title, width) if panel.title else ())]
    heading += [(line, "") for line in (_wrapped(panel.y.label, width) if panel.y.label else ())]
    for line, more in heading:
        y += LINE
        out.append(_word(left, y, line, more))
    y += 9.0
    dodged = [one for one in panel.series if one.kind in ("bars", "boxes")]
    x_ends, y_ends = (
        _ends(axis, name, figure.panels if name in figure.shared else (panel,))
        for axis, name in ((panel.x, "x"), (panel.y, "y"))
    )
    if panel.y.categories:
        names = [_wrapped(name, 0.42 * width) for name in panel.y.categories]
        row = max(ROW, *(SIZE * 1.1 * len(lines) + 6 for lines in names), 11.0 * len(dodged) + 7)
        scale = Scale(-0.5, len(names) - 0.5, False, y, y + row * len(names))
        margin = max(8 + max(text_width(line) for lines in names for line in lines), FIRST_TICK)
        labels = [
            _word(left + margin - 8, at + 4.5 + SIZE * 1.1 * (k - 0.5 * (len(lines) - 1)), line, ' text-anchor="end"')
            for at, lines in zip(scale.at(np.arange(len(names))), names, strict=True)
            for k, line in enumerate(lines)
        ]
        marked: list[float] = scale.at(np.arange(len(names))).tolist()
    else:
        scale = Scale(*y_ends, panel.y.log, y + panel.height, y)
        ticks = scale.ticks(say, across=False)
        margin = 8 + max((text_width(text) for _, text in ticks), default=0.0)
        if panel.equal:
            wanted = (width - margin - 18) * abs((y_ends[1] - y_ends[0]) / (x_ends[1] - x_ends[0]))
            scale = Scale(*y_ends, panel.y.log, y + min(max(wanted, 60.0), 420.0), y)
            ticks = scale.ticks(say, across=False)
        labels = [_word(left + margin - 8, at + 4.5, text, ' text-anchor="end"') for at, text in ticks]
        marked = [at for at, _ in ticks]
    low, high = sorted((scale.start, scale.end))
    end = left + width - 18
    if panel.equal:
        end = min(end, left + margin + (high - low) * abs((x_ends[1] - x_ends[0]) / (y_ends[1] - y_ends[0])))
    canvas = _Canvas(
        panel=panel, x=Scale(*x_ends, panel.x.log, left + margin, end), y=scale, say=say, named=named, selects=selects
    )
    below = canvas.x.ticks(say, across=True, whole=panel.x.whole)
    if panel.image:
        place = f'x="{canvas.x.start:.1f}" y="{low:.1f}" width="{end - canvas.x.start:.1f}" height="{high - low:.1f}"'
        data = base64.b64encode(panel.image).decode()
        out.append(f'<image {place} preserveAspectRatio="none" href="data:image/jpeg;base64,{data}"/>')
    grid = "".join(f"M{canvas.x.start:.1f} {at:.1f}H{end:.1f}" for at in marked)
    grid += "".join(f"M{at:.1f} {low:.1f}V{high:.1f}" for at, _ in below)
    out.append(f'<path d="{grid}" stroke="currentColor" stroke-opacity=".15" fill="none"/>')
    out.append(
        f'<path d="M{canvas.x.start:.1f} {low:.1f}V{high:.1f}H{end:.1f}" stroke="currentColor" stroke-opacity=".55" fill="none"/>'
    )
    out += [*labels, *(_word(at, high + 16.5, text, ' text-anchor="middle"') for at, text in below)]
    if panel.cells is not None:
        out += canvas.cells(panel.cells, figure.scale)
    for level in panel.levels:
        out.append(_level(level, canvas, (low, high), end))
    for one in panel.series:
        shift = 11.0 * (dodged.index(one) - 0.5 * (len(dodged) - 1)) if one in dodged else 0.0
        out += canvas.draw(one, shift)
    y = high + 22.0
    for line in _wrapped(panel.x.label, end - canvas.x.start) if panel.x.label else ():
        y += LINE
        out.append(_word(0.5 * (canvas.x.start + end), y - 3, line, ' text-anchor="middle"'))
    return out, y + 8.0 - top


def _level(level: Level, canvas: _Canvas, upright: tuple[float, float], end: float) -> str:
    at = float((canvas.y if level.along == "y" else canvas.x).at(level.at))
    if not math.isfinite(at):
        return ""
    across, up = f"M{canvas.x.start:.1f} {at:.1f}H{end:.1f}", f"M{at:.1f} {upright[0]:.1f}V{upright[1]:.1f}"
    path, axis = (across, canvas.panel.y) if level.along == "y" else (up, canvas.panel.x)
    said = f"{level.name}: {_value(level.at, canvas.say)} {axis.unit}".rstrip() if level.name else ""
    dash = ' stroke-dasharray="7 4" stroke-width="1.8" fill="none"'
    return f'<g class="c-{level.colour[1:]}" color="{level.colour}" stroke="currentColor">{canvas.mark(path, said, more=dash)}</g>'


def _legend(figure: Figure, width: float, say: Say) -> tuple[list[str], float]:
    """What each colour and shape stands for, and the height of it; nothing where it would have one entry."""
    entries: dict[str, Series | Level] = {}
    for panel in figure.panels:
        for one in (*panel.series, *panel.levels):
            if one.name:
                entries.setdefault(one.name, one)
    out: list[str] = []
    x, y = 0.0, 0.0
    if len(entries) > 1:
        y = LINE + 2
        for name, one in entries.items():
            lines = _wrapped(name, width - 30)
            room = 30 + max(map(text_width, lines)) + 16
            if x and x + room - 16 > width:
                x, y = 0.0, y + LINE + 3
            out.append(_key(one, x, y - 4.5))
            out += [_word(x + 30, y + k * LINE, line) for k, line in enumerate(lines)]
            y += (len(lines) - 1) * LINE
            x += room
        y += 10.0
    if any(panel.cells is not None for panel in figure.panels):
        low, high, unit = figure.scale
        scale, count = Scale(low, high, False, 20.0, 20.0 + min(300.0, width - 90)), 40
        cell = (scale.end - scale.start) / count
        across = f"h{cell + 0.3:.1f}v12h-{cell + 0.3:.1f}z"
        strips = (
            f'<path d="M{scale.start + k * cell:.1f} {y + 4:.1f}{across}" fill="{_shade(k / (count - 1))}"/>'
            for k in range(count)
        )
        out += [*strips, _word(scale.end + 14, y + 15, unit)]
        out += [_word(at, y + 31, text, ' text-anchor="middle"') for at, text in scale.ticks(say, across=True)]
        y += 40.0
    return out, y


def _key(one: Series | Level, x: float, y: float) -> str:
    """A mark of the legend."""
    if isinstance(one, Level) or one.kind in ("line", "steps"):
        dash = ' stroke-dasharray="6 4"' if isinstance(one, Level) or one.dash else ""
        path, more = f"M{x:.1f} {y:.1f}h24", f' stroke-width="2"{dash}'
        if isinstance(one, Series) and one.shape:
            path += f"M{x + 12:.1f} {y:.1f}{PATHS[one.shape]}"
    elif one.kind in ("bars", "boxes"):
        path, more = f"M{x + 5:.1f} {y - 5:.1f}h14v10h-14z", ""
    else:
        path, more = f"M{x + 12:.1f} {y:.1f}{PATHS[one.shape or 'circle']}", ' stroke-width="1.4"'
    empty = one.hollow is True if isinstance(one, Series) else True
    fill = "none" if empty else "currentColor"
    return (
        f'<path class="c-{one.colour[1:]}" color="{one.colour}" fill="{fill}" stroke="currentColor"{more} d="{path}"/>'
    )


def html(figure: "Figure | Mapping[str, Figure]", title: str, say: Say = plain, *, selects: bool = False) -> str:
    """A chart as it stands in a page with `STYLE`: for wide and narrow screens, each view but the first on demand.

    Args:
        figure: the chart, or views of it by their labels.
        title: what it shows.
        say: number to text.
        selects: as of `svg`.
    """
    views = {"": figure} if isinstance(figure, Figure) else dict(figure)
    draw = partial(svg, title=title, say=say, selects=selects)
    images = [f'<div class="chart">{draw(one)}{draw(one, width=NARROW)}</div>' for one in views.values()]
    if len(images) == 1:
        return images[0]
    folds = (
        f'<details class="view"{"" if k else " open"}><summary>{_escaped(label)}</summary>{image}</details>'
        for k, (label, image) in enumerate(zip(views, images, strict=True))
    )
    return "".join(folds)
