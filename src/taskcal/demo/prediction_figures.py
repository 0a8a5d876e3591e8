"""Figures of predictions on poses that were not measured: how large the errors are, where, and whether it was foreseen."""

from collections.abc import Mapping, Sequence

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float
from plotly.subplots import make_subplots
from scipy.special import chdtri

from taskcal.demo.predictions import Predictions
from taskcal.demo.procedure import Fitted
from taskcal.presentation.theme import BLUE, GREY, INK, SERIES, VERMILION, label_panels, styled, styled_space, switch

LEVELS = np.linspace(0.0, 1.0, 101)
TICKS = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000]


def draw_held_out(fits: Sequence[Fitted]) -> go.Figure:
    """Mean and largest error of every model, inside the measured orientations and outside."""
    campaigns = list(dict.fromkeys(f.campaign for f in fits))
    titles = [
        f"measured in {campaign}: {where}"
        for campaign in campaigns
        for where in ("same orientations", "turned farther")
    ]
    figure = make_subplots(
        rows=len(campaigns),
        cols=2,
        shared_yaxes=True,
        shared_xaxes="all",  # pyright: ignore[reportArgumentType]
        subplot_titles=titles,
        horizontal_spacing=0.04,
        vertical_spacing=0.14,
    )
    for row, campaign in enumerate(campaigns, start=1):
        mine = [f for f in fits if f.campaign == campaign]
        names = [f.model for f in mine]
        for col, errors in enumerate(([f.inside for f in mine], [f.outside for f in mine]), start=1):
            mean, largest = np.array([[e.mean, e.maximum] for e in errors]).T * 1e6
            first = row == col == 1
            for name, low, high in zip(names, mean, largest, strict=True):
                figure.add_scatter(
                    x=[low, high],
                    y=[name, name],
                    mode="lines",
                    line={"color": "#b8c1ca", "width": 5},
                    showlegend=False,
                    hoverinfo="skip",
                    row=row,
                    col=col,
                )
            for values, label, colour, symbol, side in (
                (mean, "mean", BLUE, "circle", "middle left"),
                (largest, "largest", VERMILION, "diamond", "middle right"),
            ):
                figure.add_scatter(
                    x=values,
                    y=names,
                    mode="markers+text",
                    text=[f" {v:.0f} " for v in values],
                    textposition=side,
                    textfont={"size": 13},
                    marker={"color": colour, "symbol": symbol, "size": 11},
                    name=label,
                    legendgroup=label,
                    showlegend=first,
                    hovertemplate="%{y}: %{x:.1f} µm<extra>" + label + "</extra>",
                    cliponaxis=False,
                    row=row,
                    col=col,
                )
    styled(figure, height=230 * len(campaigns) + 130, top=90)
    errors = [value * 1e6 for f in fits for e in (f.inside, f.outside) for value in (e.mean, e.maximum)]
    span = [np.log10(min(errors)) - 0.35, np.log10(max(errors)) + 0.35]
    figure.update_xaxes(type="log", range=span, tickvals=TICKS, tickfont={"size": 12})
    figure.update_xaxes(title_text="error of the predicted tool point (µm)", row=len(campaigns))
    figure.update_yaxes(autorange="reversed", ticks="")
    figure.update_layout(legend={"y": 1.07})
    return label_panels(figure)


def draw_error_over_angle(predictions: Sequence[Predictions]) -> go.Figure:
    """Error of every new pose over the rotation of its tool from the one measured orientation."""
    figure = go.Figure()
    shapes = ("circle", "diamond", "square", "cross")
    for k, label in enumerate(dict.fromkeys(_fit_label(p) for p in predictions)):
        mine = [p for p in predictions if _fit_label(p) == label]
        figure.add_scatter(
            x=np.degrees(np.concatenate([p.angle for p in mine])),
            y=np.concatenate([p.length for p in mine]) * 1e6,
            mode="markers",
            name=label,
            marker={"color": SERIES[k % len(SERIES)], "symbol": shapes[k % len(shapes)], "size": 5, "opacity": 0.65},
            hovertemplate="%{x:.1f}°: %{y:.1f} µm<extra>" + label + "</extra>",
        )
    styled(figure, height=440)
    figure.update_xaxes(title_text="rotation of the tool from the single measured orientation (°)")
    figure.update_yaxes(title_text="error of the predicted tool point (µm)", type="log", tickvals=TICKS)
    return figure


def draw_coverage(predictions: Sequence[Predictions]) -> go.Figure:
    """Whether errors are as large as was stated: beside the stated uncertainty, and inside the stated ellipsoids."""
    figure = make_subplots(
        rows=1, cols=2, horizontal_spacing=0.12, subplot_titles=["pose by pose", "share inside the stated ellipsoid"]
    )
    limits = chdtri(3, 1.0 - LEVELS)
    low = high = 1.0
    for k, p in enumerate(predictions):
        colour, label = SERIES[k % len(SERIES)], f"{_fit_label(p)}; {p.where}"
        stated, actual = p.stated * 1e6, p.length * 1e6
        low, high = min(low, stated.min()), max(high, stated.max(), actual.max())
        figure.add_scatter(
            x=stated,
            y=actual,
            mode="markers",
            name=label,
            legendgroup=label,
            marker={"color": colour, "size": 4, "opacity": 0.5},
            hovertemplate="stated %{x:.1f} µm, actual %{y:.1f} µm<extra>" + label + "</extra>",
            row=1,
            col=1,
        )
        figure.add_scatter(
            x=100.0 * LEVELS,
            y=100.0 * np.mean(p.squared_distance[:, None] <= limits, axis=0),
            mode="lines",
            name=label,
            legendgroup=label,
            showlegend=False,
            line={"color": colour, "width": 2.5},
            hovertemplate="%{x:.0f} % ellipsoid holds %{y:.0f} %<extra>" + label + "</extra>",
            row=1,
            col=2,
        )
    for col, ends in ((1, [low, high]), (2, [0.0, 100.0])):
        figure.add_scatter(
            x=ends,
            y=ends,
            mode="lines",
            line={"color": INK, "width": 1.2, "dash": "dash"},
            name="as stated",
            showlegend=col == 1,
            hoverinfo="skip",
            row=1,
            col=col,
        )
    styled(figure, height=560, top=70)
    figure.update_layout(legend={"y": -0.17, "yanchor": "top", "itemsizing": "constant"}, margin={"b": 150})
    figure.update_xaxes(
        title_text="stated standard uncertainty in space (µm)", type="log", tickvals=TICKS, row=1, col=1
    )
    figure.update_yaxes(title_text="actual error in space (µm)", type="log", tickvals=TICKS, row=1, col=1)
    figure.update_xaxes(title_text="stated probability (%)", range=[0, 100], row=1, col=2)
    figure.update_yaxes(title_text="new poses inside (%)", range=[0, 102], row=1, col=2)
    return label_panels(figure)


def draw_workspace(predictions: Sequence[Predictions], measured: Mapping[str, Float[np.ndarray, "n 3"]]) -> go.Figure:
    """New poses where they are in the workspace, coloured by the error of their prediction.

    Args:
        predictions: views to choose from; all share one logarithmic scale of colours.
        measured: for each campaign, the tool points that were measured, in the base, metres.
    """
    figure = go.Figure()
    top = float(np.ceil(2.0 * np.log10(max(p.length.max() for p in predictions) * 1e6)) / 2.0)
    for k, p in enumerate(predictions):
        x, y, z = p.position.T * 1e3
        figure.add_scatter3d(
            x=x,
            y=y,
            z=z,
            mode="markers",
            name="new poses",
            visible=k == 0,
            marker={
                "size": 5,
                "color": np.log10(np.maximum(p.length * 1e6, 1e-3)),
                "colorscale": "Viridis",
                "cmin": 0.0,
                "cmax": top,
                "colorbar": {
                    "title": {"text": "error (µm)"},
                    "tickvals": np.log10(TICKS).tolist(),
                    "ticktext": [str(t) for t in TICKS],
                    "len": 0.8,
                },
            },
            customdata=np.stack([p.length * 1e6, np.degrees(p.angle)], axis=1),
            hovertemplate="%{customdata[0]:.1f} µm, turned %{customdata[1]:.0f}°<extra></extra>",
        )
        x, y, z = measured[p.campaign].T * 1e3
        figure.add_scatter3d(
            x=x,
            y=y,
            z=z,
            mode="markers",
            name="measured poses",
            visible=k == 0,
            marker={"size": 3, "symbol": "cross", "color": GREY},
            hoverinfo="skip",
        )
    styled_space(figure, distance=1.6)
    if len(predictions) > 1:
        count = 2 * len(predictions)
        choices = {
            f"{_fit_label(p)}; {p.where}": ({"visible": [j // 2 == k for j in range(count)]},)
            for k, p in enumerate(predictions)
        }
        switch(figure, choices, y=1.02)
    return figure


def _fit_label(p: Predictions) -> str:
    return f"measured in {p.campaign}, {p.model}"
