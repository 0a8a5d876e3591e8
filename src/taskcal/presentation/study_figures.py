"""The figure of a study: how the task error spreads over virtual robots."""

import numpy as np
import plotly.graph_objects as go

from taskcal.adaptation.study import Study
from taskcal.presentation.theme import GREY, SERIES, styled


def draw_study(made: Study, accuracy: float | None = None) -> go.Figure:
    """A box of rms errors over all robots for every plan, number of poses and model.

    Args:
        made: the study.
        accuracy: that the task needs, metres.
    """
    figure = go.Figure()
    models = list(dict.fromkeys(row["model"] for row in made.rows))
    for k, model in enumerate(models):
        mine = [row for row in made.rows if row["model"] == model]
        figure.add_box(
            x=[[f"{row['count']} poses" for row in mine], [row["plan"] for row in mine]],
            y=[row["rms_mm"] for row in mine],
            name=model,
            marker={"color": SERIES[(k + 1) % len(SERIES)], "size": 4},
            line={"width": 1.5},
            boxpoints="all" if made.robots <= 40 else "outliers",
            jitter=0.4,
            hovertemplate="%{y:.4f} mm<extra>" + model + "</extra>",
        )
    styled(figure, height=500, legend=len(models) > 1, top=90)
    figure.update_layout(boxmode="group")
    figure.update_xaxes(showgrid=False)
    figure.update_yaxes(title_text="true task error (mm, rms)", type="log", dtick="D2")
    if accuracy is not None:
        figure.add_hline(y=accuracy * 1e3, line={"color": GREY, "dash": "dash", "width": 1.5})
        figure.add_annotation(
            text="accuracy that the task needs",
            xref="paper",
            x=1.0,
            xanchor="right",
            y=float(np.log10(accuracy * 1e3)),  # annotations of a logarithmic axis are placed by the logarithm
            yanchor="bottom",
            showarrow=False,
            font={"size": 13, "color": GREY},
        )
    return figure
