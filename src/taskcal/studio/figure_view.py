"""A figure of a report on a page."""

import json
from typing import TYPE_CHECKING

from nicegui import ui
from nicegui.element import Element

from taskcal.presentation.figure_json import figure_json
from taskcal.studio.controls import set_attribute, text

if TYPE_CHECKING:
    import plotly.graph_objects as go


def figure(caption: str, drawn: "go.Figure", note: str = "") -> Element:
    """Show a figure.

    Args:
        caption: what it shows.
        drawn: the figure.
        note: how to read it.
    """
    content = json.loads(figure_json(drawn))
    with ui.element("figure").classes("chart") as whole:
        text("figcaption", caption)
        shown = ui.plotly({**content, "config": {"displayModeBar": False, "responsive": True}})
        shown.props("role=img")
        set_attribute(shown, "aria-label", caption)
        if note:
            text("p", note).classes("quiet")
    return whole
