"""What each part of a calibrated model is worth, as a section of its page."""

from collections.abc import Sequence

import plotly.graph_objects as go

from taskcal.adaptation.calibration_ladder import Rung
from taskcal.presentation.content import Chart, Section, Table
from taskcal.presentation.theme import BLUE, INK, styled


def ladder_section(rungs: Sequence[Rung]) -> Section:
    """The section."""
    rows = [(rung.name, str(rung.parameters), f"{rung.mean * 1e3:.3f}", f"{rung.p95 * 1e3:.3f}") for rung in rungs]
    return Section(
        title="What each part of the model is worth",
        blocks=(
            Chart(
                title="Error on rows left out, from the nominal robot to the whole model",
                figure=draw_ladder_rungs(rungs),
                note="Every bar that is shorter than the one above it is a part of the model worth having; where bars stop getting "
                "shorter, more parameters no longer help. Neighbouring poses are left out together, in five parts.",
            ),
            Table.of_rows("Nested models", ("model", "parameters", "mean mm", "95 % below mm"), rows),
        ),
    )


def draw_ladder_rungs(rungs: Sequence[Rung]) -> go.Figure:
    """A bar for each nested model, with the 95th percentile as a tick."""
    names = [f"{rung.name} ({rung.parameters})" for rung in rungs][::-1]
    figure = go.Figure(
        go.Bar(
            x=[rung.mean * 1e3 for rung in rungs][::-1],
            y=names,
            orientation="h",
            name="mean",
            marker={"color": BLUE},
            text=[f"{rung.mean * 1e3:.3f}" for rung in rungs][::-1],
            textposition="auto",
            textangle=0,
            constraintext="none",
            hovertemplate="%{y}: %{x:.3f} mm<extra></extra>",
        )
    )
    figure.add_scatter(
        x=[rung.p95 * 1e3 for rung in rungs][::-1],
        y=names,
        mode="markers",
        name="95 % of the points are below",
        marker={"symbol": "line-ns-open", "size": 16, "color": INK, "line": {"width": 2.5}},
        hovertemplate="95 % below %{x:.3f} mm<extra></extra>",
    )
    styled(figure, height=150 + 42 * len(rungs), top=60)
    figure.update_xaxes(title_text="error in space on rows left out (mm)", rangemode="tozero")
    return figure
