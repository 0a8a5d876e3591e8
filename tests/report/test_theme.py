"""Logarithmic axes say whole numbers, enough of them to read the figure by."""

import numpy as np
import plotly.graph_objects as go
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.report.theme import with_decades


@given(st.floats(1e-4, 1e3), st.floats(1.0, 1e4))
def test_decades_label_at_least_two_ticks_in_range(least, factor):
    figure = go.Figure(go.Scatter(y=[least, least * factor, None, 0.0]))
    axis = with_decades(figure, "mm").layout.yaxis
    assert axis.type == "log"
    ticks = np.array(axis.tickvals)
    assert [float(text) for text in axis.ticktext] == pytest.approx(ticks, rel=1e-6)
    assert (np.diff(ticks) > 0).all()
    assert (ticks > 0).all()
    assert ((ticks >= 0.6 * least) & (ticks <= 1.7 * least * factor)).sum() >= 2


def test_decades_without_values_keep_the_axis():
    assert len(with_decades(go.Figure(), "mm").layout.yaxis.tickvals) > 10
