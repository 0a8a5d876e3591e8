"""Figures of what a calibration leaves: how much of it goes with each quantity, and how."""

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Bool, Float

from taskcal.identification.regressor import Regressor
from taskcal.identification.residual_analysis import ResidualAnalysis, fit_smooth
from taskcal.presentation.theme import AXIS_COLOURS, BLUE, GREY, INK, styled, switch

SHOWN = 8
"""Quantities that can be chosen."""

SHORT = 0.3
"""Where a direction's movement is less than this share of its largest, the tool hardly tells a turn along it."""


def draw_shares(analysis: ResidualAnalysis) -> go.Figure:
    """Share of the remainder's variance that goes with each quantity; grey where it is not proven."""
    rows = [e for e in analysis.explained[::-1] if e.p_value is not None]
    figure = go.Figure(
        go.Bar(
            x=[100.0 * e.share for e in rows],
            y=[f"{e.regressor.name}: {e.regressor.moves}" for e in rows],
            orientation="h",
            marker={"color": [BLUE if e.proven else GREY for e in rows]},
            customdata=[f"p {e.p_value:.2g}" for e in rows],
            hovertemplate="%{y}<br>%{x:.1f} %, %{customdata}<extra></extra>",
        )
    )
    styled(figure, height=140 + 26 * max(len(rows), 3), legend=False)
    figure.update_xaxes(title_text="share of the variance on poses left out (%)", rangemode="tozero")
    return figure


def draw_against(analysis: ResidualAnalysis) -> go.Figure:
    """The remainder along the direction of each of the first quantities, against it, with the smooth that was fitted."""
    figure = go.Figure()
    owner: list[int] = []
    choices = [e.regressor for e in analysis.explained[:SHOWN]]
    for k, regressor in enumerate(choices):
        along, seen, unit = _along(regressor, analysis.residual)
        smooth = fit_smooth(regressor, analysis.residual) * 1e3
        u = regressor.values[:, 0] * regressor.scale
        order = np.argsort(u, kind="stable")
        names = list(AXIS_COLOURS) if along.shape[1] == 3 else [regressor.moves]
        for d, name in enumerate(names):
            colour = AXIS_COLOURS.get(name, BLUE)
            own = seen[:, d]
            owner += [k, k]
            figure.add_scatter(
                x=u[own],
                y=along[own, d],
                name=name,
                visible=k == 0,
                mode="markers",
                marker={"color": colour, "size": 5, "opacity": 0.55},
                hovertemplate="%{x:.4g}: %{y:.4g} " + unit + f"<extra>{name}</extra>",
            )
            figure.add_scatter(
                x=u[order],
                y=smooth[order, d],
                name=f"{name}, fitted",
                visible=k == 0,
                mode="lines" if regressor.values.shape[1] == 1 and regressor.smooth else "markers",
                line={"color": colour if len(names) > 1 else INK, "width": 2.5},
                marker={"color": colour if len(names) > 1 else INK, "symbol": "diamond", "size": 7},
                hoverinfo="skip",
            )
    styled(figure, height=480, top=100)
    labels = [f"{r.name} ({r.unit})" for r in choices]
    figure.update_xaxes(title_text=labels[0])
    units = [_unit(r) for r in choices]
    figure.update_yaxes(title_text=units[0])
    updates = {
        label: (
            {"visible": [o == k for o in owner]},
            {"xaxis.title.text": label, "yaxis.title.text": units[k]},
        )
        for k, label in enumerate(labels)
    }
    return switch(figure, updates, y=1.12) if len(updates) > 1 else figure


def _unit(regressor: Regressor) -> str:
    return "remainder (mrad)" if regressor.moves.startswith("turn") else "remainder (mm)"


def _along(
    regressor: Regressor, residual: Float[np.ndarray, "n 3"]
) -> tuple[Float[np.ndarray, "n directions"], Bool[np.ndarray, "n directions"], str]:
    """Movement along each direction that each pose's residual asks for, milli; where the pose tells it; its unit."""
    square = (regressor.carrier**2).sum(axis=1)
    along = np.einsum("nij,ni->nj", regressor.carrier, residual) / np.maximum(square, 1e-12)
    return 1e3 * along, square >= SHORT**2 * square.max(axis=0), "mrad" if regressor.moves.startswith("turn") else "mm"
