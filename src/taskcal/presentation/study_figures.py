"""The figure of a study: how the task error spreads over virtual robots."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import plotly.graph_objects as go

from taskcal.adaptation.study import Study
from taskcal.presentation.theme import GREY, SERIES, styled, with_decades


def draw_study(study: Study) -> go.Figure:
    """A box of rms errors of the geometry over all robots for every plan, number of poses and model.

    A line shows what the accuracy that the task needs leaves to the geometry, beside the model error of a single pose.
    """
    figure = go.Figure()
    models = list(dict.fromkeys(row["model"] for row in study.rows))
    for k, model in enumerate(models):
        of_model = [row for row in study.rows if row["model"] == model]
        figure.add_box(
            x=[[f"{row['count']} poses" for row in of_model], [_label(study, row) for row in of_model]],
            y=[row["rms_mm"] for row in of_model],
            name=model,
            marker={"color": SERIES[(k + 1) % len(SERIES)], "size": 4},
            line={"width": 1.5},
            boxpoints="all" if study.robots <= 40 else "outliers",
            jitter=0.4,
            hovertemplate="%{y:.3f} mm<extra>" + model + "</extra>",
        )
    styled(figure, height=500, legend=len(models) > 1, top=90)
    figure.update_layout(boxmode="group")
    figure.update_xaxes(showgrid=False)
    with_decades(figure, "true task error (mm, rms)")
    if study.geometry_allowance:
        allowed = study.geometry_allowance * 1e3
        figure.add_hline(y=allowed, line={"color": GREY, "dash": "dash", "width": 1.5})
        figure.add_annotation(
            text=f"accuracy that the task needs{', less the model error' if study.model_error else ''}",
            xref="paper",
            x=1.0,
            xanchor="right",
            y=float(np.log10(allowed)),  # annotations of a logarithmic axis are placed by the logarithm
            yanchor="bottom",
            showarrow=False,
            font={"size": 13, "color": GREY},
        )
    return figure


def _label(study: Study, row: Mapping[str, Any]) -> str:
    """Of a box: the plan, or what was measured by."""
    return f"{row['observe']}, {row['plan']}" if study.aligned else row["plan"]
