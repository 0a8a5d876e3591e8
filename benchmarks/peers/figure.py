"""Pictures of the documentation: the cost of a calibration by each peer and of Taskcal alone, and spreads of errors."""

from io import BytesIO
from typing import Any

from pypdfium2 import PdfDocument

from benchmarks.peers.measure import slope
from benchmarks.peers.scaling import CHAIN_POSES
from taskcal.report.chart import SERIES, SHAPES, Axis, Figure, Panel, Series
from taskcal.report.content import Chart, Section
from taskcal.report.page import Report, draw_figures


def draw(result: dict[str, Any]) -> Figure:
    """Two panels, a line for each peer."""
    return Figure(
        panels=tuple(
            _panel(
                title,
                "one calibration",
                [
                    _line(
                        number, name, [row for row in result[what].get(name, []) if "failed" not in row], size, "warm_s"
                    )
                    for number, name in enumerate(result["peers"])
                ],
            )
            for title, what, size in (
                ("poses, 51 unknowns", "poses", "size"),
                ("parameters, 400 poses", "parameters", "model_parameters"),
            )
        ),
        columns=2,
    )


def draw_scaling(result: dict[str, Any]) -> Figure:
    """Three panels of Taskcal alone: its passes against poses and parameters, its studies against robots; slopes at their ends."""
    passes = result["scaling"]
    names = [key for key in passes["poses"][0] if key != "size"]
    panels = [
        _panel(
            title,
            "processor time",
            [_line(k, _with_slope(name, passes), passes[what], "size", name) for k, name in enumerate(names)],
        )
        for title, what in (("poses, 42 parameters", "poses"), (f"parameters, {CHAIN_POSES} poses", "parameters"))
    ]
    done = [row for row in result["robots"] if "failed" not in row]
    study = _line(len(names), f"study{_power(slope(done, 'warm_s'))}", done, "size", "warm_s")
    return Figure(panels=(*panels, _panel("robots, 60 poses each", "processor time", [study])), columns=3)


def _with_slope(name: str, passes: dict[str, Any]) -> str:
    return f"{name}{_power(*(slope(passes[what], name) for what in ('poses', 'parameters')))}"


def _power(*exponents: float | None) -> str:
    """Exponents of the cost, against what the panels have below."""
    known = [f"{one:.1f}" for one in exponents if one is not None]
    return f" (exponent {' and '.join(known)})" if known else ""


def _panel(below: str, title: str, series: list[Series]) -> Panel:
    y = Axis(title=title, unit="s", log=True)
    return Panel(x=Axis(title=below, log=True), y=y, series=tuple(series), height=300.0)


def _line(number: int, name: str, rows: list[dict[str, Any]], size: str, key: str) -> Series:
    return Series(
        kind="line",
        name=name,
        x=[row[size] for row in rows],
        y=[row[key] for row in rows],
        colour=SERIES[number % len(SERIES)],
        shape=SHAPES[number % len(SHAPES)],
        dash=number >= len(SERIES),
    )


def draw_spreads(found: dict[str, dict[str, Any]], title: str) -> Figure:
    """Median, and what nine in ten have, of each name in several series, millimetres."""
    series: list[Series] = []
    for k, (name, rows) in enumerate(found.items()):
        x, low, high = ([row[key] for row in rows.values()] for key in ("median_mm", "p05_mm", "p95_mm"))
        style = SERIES[k], SHAPES[2 * k]
        series.append(Series(name=name, x=x, y=range(len(x)), low=low, high=high, colour=style[0], shape=style[1]))
    names = tuple(next(iter(found.values())))
    panel = Panel(x=Axis(title=title, unit="mm", log=True), y=Axis(categories=names), series=tuple(series))
    return Figure(panels=(panel,))


def as_png(figure: Figure, title: str) -> bytes:
    """The picture of a chart, two pixels for each of the page."""
    sheet = draw_figures(Report(title=title, sections=[Section(title, Chart(title, figure))]), "pdf")[title]
    picture = BytesIO()
    PdfDocument(sheet)[0].render(scale=2 * 96 / 72).to_pil().save(picture, "PNG", optimize=True)
    return picture.getvalue()
