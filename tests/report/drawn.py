"""What is drawn in a figure."""

from collections.abc import Mapping
from typing import Any

from taskcal.report.chart import Figure


def series(figure: Figure | Mapping[str, Figure]) -> list[Any]:
    assert isinstance(figure, Figure)
    return [one for panel in figure.panels for one in panel.series]


def axis_titles(figure: Figure) -> str:
    return " ".join(f"{panel.x.label} {panel.y.label}" for panel in figure.panels)


def levels(figure: Figure) -> dict[str, float]:
    return {level.name: level.at for panel in figure.panels for level in panel.levels}
