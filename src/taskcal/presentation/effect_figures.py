"""Figures of single parameters over some poses: how far each moves the tool point."""

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from taskcal.analysis.sensitivity import Sensitivity
from taskcal.presentation.theme import AXIS_COLOURS, INK, label_panels, styled, switch

FOR_TOLERANCE = "effect of its tolerance (mm)"
MANY = 70
"""Parameters whose names are not all written."""

PER_UNIT = "effect per unit (mm/mm, mm/mrad …)"


def draw_effects(sensitivities: Sensitivity) -> go.Figure:
    """Largest and root mean square effect of every parameter on X, Y, Z and in space, for its tolerance or per unit."""
    names = [p.symbol or p.name for p in sensitivities.model.parameters]
    hover = [p.name + (f" ({p.symbol})" if p.symbol else "") for p in sensitivities.model.parameters]
    figure = make_subplots(
        rows=2,
        cols=1,
        shared_xaxes=True,
        vertical_spacing=0.16,
        subplot_titles=["largest over the poses", "root mean square"],
    )
    to_shown = sensitivities.to_shown()
    scaled: list[list[float]] = []
    raw: list[list[float]] = []
    for row, (per_axis, in_space) in enumerate(
        ((sensitivities.maximum, sensitivities.maximum_in_space), (sensitivities.rms_per_axis, sensitivities.rms)),
        start=1,
    ):
        scaled += [*(per_axis(scaled=True) * 1e3).tolist(), (in_space(scaled=True) * 1e3).tolist()]
        raw += [*(per_axis() * to_shown).tolist(), (in_space() * to_shown).tolist()]
        for axis, (letter, colour) in enumerate(AXIS_COLOURS.items()):
            figure.add_bar(
                x=names,
                y=scaled[4 * (row - 1) + axis],
                name=letter,
                legendgroup=letter,
                showlegend=row == 1,
                marker={"color": colour},
                customdata=hover,
                hovertemplate="%{customdata}: %{y:.4g}<extra>" + letter + "</extra>",
                row=row,
                col=1,
            )
        figure.add_scatter(
            x=names,
            y=scaled[4 * (row - 1) + 3],
            mode="markers",
            name="in space",
            legendgroup="space",
            showlegend=row == 1,
            marker={"symbol": "line-ew-open", "size": 14, "color": INK, "line": {"width": 2}},
            customdata=hover,
            hovertemplate="%{customdata}: %{y:.4g}<extra>in space</extra>",
            row=row,
            col=1,
        )
    styled(figure, height=780, top=100)
    figure.update_layout(barmode="group", bargap=0.2, legend={"y": 1.05})
    figure.update_xaxes(
        tickangle=-60, tickfont={"size": 12 if len(names) < 40 else 10}, showticklabels=True, showgrid=False
    )
    if len(names) < MANY:
        figure.update_xaxes(dtick=1)
    figure.update_yaxes(title_text=FOR_TOLERANCE)
    _switch_units(figure, scaled, raw)
    return label_panels(figure)


def _switch_units(figure: go.Figure, scaled: list[list[float]], raw: list[list[float]]) -> None:
    """Buttons for effects of the tolerances, or per unit."""
    axes = ["yaxis.title.text", "yaxis2.title.text"]
    switch(
        figure,
        {
            "for its tolerance": ({"y": scaled}, dict.fromkeys(axes, FOR_TOLERANCE)),
            "per unit": ({"y": raw}, dict.fromkeys(axes, PER_UNIT)),
        },
        y=1.05,
    )
