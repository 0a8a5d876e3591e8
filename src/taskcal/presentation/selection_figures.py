"""The figure of a choice of parameters: the error over the number of parameters."""

import numpy as np
import plotly.graph_objects as go

from taskcal.adaptation.selection import Selection
from taskcal.presentation.theme import BLUE, GREEN, GREY, INK, PURPLE, VERMILION, styled, with_decades

REFERENCES = {"identifiable": ("identifiable set", GREEN, "square"), "published": ("published set", PURPLE, "diamond")}


def draw_ladder(selection: Selection, accuracy: float | None = None) -> go.Figure:
    """Expected and cross-validated error against the number of parameters, and the size that was chosen.

    Args:
        selection: the choice.
        accuracy: that was asked for, metres.
    """
    figure = go.Figure()
    size = np.array([nested.size for nested in selection.ladder])
    expected = np.array([nested.expected for nested in selection.ladder]) * 1e3
    gone = [nested.dropped_next for nested in selection.ladder]
    figure.add_scatter(
        x=size,
        y=expected,
        mode="lines+markers",
        name="expected over the task (rms)",
        line={"color": BLUE, "width": 2.2},
        marker={"size": 6},
        customdata=[f"; next to go: {name}" if name else "" for name in gone],
        hovertemplate="%{x} parameters: %{y:.3f} mm%{customdata}<extra>expected</extra>",
    )
    _draw_cross_validated(figure, selection)
    _draw_references(figure, selection)
    _draw_choice(figure, selection)
    if accuracy is not None:
        figure.add_scatter(
            x=[size.min() - 1, size.max() + 1],
            y=[accuracy * 1e3] * 2,
            mode="lines",
            name="accuracy asked for",
            line={"color": GREY, "dash": "dash", "width": 1.5},
            hoverinfo="skip",
        )
    styled(figure, height=520, top=110)
    figure.update_xaxes(title_text="parameters in the model", range=[size.min() - 1, size.max() + 1])
    with_decades(figure, "error in space (mm)")
    return figure


def _draw_cross_validated(figure: go.Figure, selection: Selection) -> None:
    """Mean error on left-out rows for every size, where there is a campaign."""
    crossed = [nested for nested in selection.ladder if nested.cross_validated is not None]
    if crossed:
        figure.add_scatter(
            x=[nested.size for nested in crossed],
            y=[1e3 * (nested.cross_validated or 0.0) for nested in crossed],
            error_y={
                "array": [1e3 * (nested.standard_error or 0.0) for nested in crossed],
                "thickness": 1.4,
                "width": 3,
            },
            mode="markers",
            name="cross-validated on the campaign (mean ± standard error)",
            marker={"color": VERMILION, "size": 7, "symbol": "circle-open", "line": {"width": 2}},
            hovertemplate="%{x} parameters: %{y:.3f} mm<extra>cross-validated</extra>",
        )


def _draw_references(figure: go.Figure, selection: Selection) -> None:
    """The published and the identifiable set."""
    for name, (count, error) in selection.references.items():
        label, colour, symbol = REFERENCES[name]
        figure.add_scatter(
            x=[count],
            y=[error * 1e3],
            mode="markers",
            name=f"{label} ({count})",
            marker={"color": colour, "symbol": symbol, "size": 13, "line": {"color": "white", "width": 1.5}},
            hovertemplate=f"{label}, {count} parameters: " + "%{y:.3f} mm<extra></extra>",
        )


def _draw_choice(figure: go.Figure, selection: Selection) -> None:
    """A ring around the size that was chosen."""
    chosen = len(selection.kept)
    figure.add_scatter(
        x=[chosen],
        y=[1e3 * next(nested.expected for nested in selection.ladder if nested.size == chosen)],
        mode="markers",
        name=f"chosen ({chosen})",
        marker={"color": "rgba(0,0,0,0)", "symbol": "circle", "size": 17, "line": {"color": INK, "width": 2.5}},
        hovertemplate=f"chosen: {chosen} parameters, " + "%{y:.3f} mm<extra></extra>",
    )
