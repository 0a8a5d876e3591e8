"""Figures of a model over some poses: how much each parameter moves the tool, and how many can be told apart."""

from collections.abc import Mapping

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from taskcal.analysis.identifiability import NEGLIGIBLE, Identifiability
from taskcal.analysis.sensitivity import Sensitivity
from taskcal.presentation.theme import AXIS_COLOURS, GREY, SERIES, label_panels, styled, switch

EXPECTED = "largest influence (µm)"

FLOOR = 1e-18
"""Singular values are drawn no lower; exact zeros have no logarithm."""


def draw_sensitivities(
    sensitivities: Mapping[str, Sensitivity], eliminations: Mapping[str, Identifiability]
) -> go.Figure:
    """Largest influence of each parameter on X, Y and Z, for its tolerance or per unit.

    Args:
        sensitivities: a panel for each set of poses.
        eliminations: of the same sets; parameters that they do not keep are drawn pale.
    """
    figure = make_subplots(
        rows=len(sensitivities),
        cols=1,
        shared_xaxes=True,
        vertical_spacing=0.16,
        subplot_titles=[f"poses in {label}" for label in sensitivities],
    )
    scaled: list[list[float]] = []
    raw: list[list[float]] = []
    for row, (label, found) in enumerate(sensitivities.items(), start=1):
        parameters = found.model.parameters
        names = [p.symbol or p.name for p in parameters]
        kept = eliminations[label].kept
        opacity = [1.0 if p.name in kept else 0.35 for p in parameters]
        hover = [p.name + (f" ({p.symbol})" if p.symbol else "") for p in parameters]
        expected, per_unit = found.maximum(scaled=True) * 1e6, found.maximum()  # m/rad are mm/mrad
        for axis, colour in enumerate(AXIS_COLOURS.items()):
            scaled.append(expected[axis].tolist())
            raw.append(per_unit[axis].tolist())
            figure.add_bar(
                x=names,
                y=expected[axis],
                name=colour[0],
                legendgroup=colour[0],
                showlegend=row == 1,
                marker={"color": colour[1], "opacity": opacity},
                customdata=hover,
                hovertemplate="%{customdata}: %{y:.4g}<extra>" + f"{colour[0]}, {label}</extra>",
                row=row,
                col=1,
            )
    styled(figure, height=350 * len(sensitivities) + 80, top=100)
    figure.update_layout(barmode="group", bargap=0.2, legend={"y": 1.06})
    figure.update_xaxes(tickangle=-60, tickfont={"size": 12}, showticklabels=True, showgrid=False)
    figure.update_yaxes(title_text=EXPECTED)
    axes = [f"yaxis{'' if row == 0 else row + 1}.title.text" for row in range(len(sensitivities))]
    switch(
        figure,
        {
            "scaled by tolerance": ({"y": scaled}, dict.fromkeys(axes, EXPECTED)),
            "per unit": ({"y": raw}, dict.fromkeys(axes, "influence (mm/mm, mm/mrad)")),
        },
        y=1.06,
    )
    return label_panels(figure)


def draw_singular_values(eliminations: Mapping[str, Identifiability]) -> go.Figure:
    """Singular values of the stacked sensitivities, columns of unit length: the gap that decides the rank."""
    figure = go.Figure()
    shapes = ("circle", "diamond", "square", "cross")
    for k, (label, found) in enumerate(eliminations.items()):
        values = np.maximum(found.singular_values, FLOOR)
        colour = SERIES[k % len(SERIES)]
        counted = np.arange(len(values)) < found.rank
        figure.add_scatter(
            x=np.arange(1, len(values) + 1),
            y=values,
            mode="markers",
            name=f"{label}: {found.rank} of {len(values)} count",
            marker={
                "color": np.where(counted, colour, "white").tolist(),
                "line": {"color": colour, "width": 1.6},
                "symbol": shapes[k % len(shapes)],
                "size": 9,
            },
            hovertemplate="%{x}: %{y:.2e}<extra>" + label + "</extra>",
        )
    largest = max(found.singular_values.max(initial=0.0) for found in eliminations.values())
    count = max(len(found.names) for found in eliminations.values())
    figure.add_scatter(
        x=[0.5, count + 0.5],
        y=[NEGLIGIBLE * largest] * 2,
        mode="lines",
        name="limit: 10⁻⁹ of the largest",
        line={"color": GREY, "dash": "dash", "width": 1.5},
        hoverinfo="skip",
    )
    styled(figure, height=420)
    figure.update_xaxes(title_text="number of the singular value", range=[0, count + 1])
    figure.update_yaxes(
        title_text="singular value (columns of unit length)",
        type="log",
        exponentformat="power",
        dtick=3,
        range=[-18.7, 1.3],
    )
    return figure
