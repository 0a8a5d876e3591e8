"""Figures of effects and of what is left: numbers in the units of their axes."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.identification.calibration import Calibration
from taskcal.identification.residual_analysis import Explained, ResidualAnalysis
from taskcal.report.calibration import draw_against, draw_parameters, draw_shares, residual_analysis_section
from taskcal.report.theme import BLUE


def test_effects_are_drawn_in_panels_of_their_units(fitted: tuple[Calibration, ResidualAnalysis]) -> None:
    calibration, _ = fitted
    figure = draw_parameters({"fit": calibration})
    titles = [figure.layout[f"yaxis{k}"].title.text for k in ("", 2, 3, 4)]
    assert titles == ["defect (mm)", "defect (mrad)", "effect (mrad/m)", "effect (mrad/rad)"]
    drawn = np.concatenate([np.asarray(trace.y, dtype=float) for trace in figure.data])
    np.testing.assert_allclose(np.sort(drawn), np.sort(calibration.estimate * 1e3))


def test_shares_and_the_first_quantity(fitted: tuple[Calibration, ResidualAnalysis]) -> None:
    _, found = fitted
    first = found.explained[0]
    assert first.regressor.name == "position of J3"
    bars = draw_shares(found).data[0]
    assert bars.y[-1] == "position of J3: turn of J3"
    assert bars.x[-1] == pytest.approx(100 * first.share)
    figure = draw_against(found)
    assert figure.layout.yaxis.title.text == "residual (mrad)"
    assert figure.layout.xaxis.title.text == "position of J3 (°)"
    points, line = figure.data[:2]
    assert np.all(np.diff(line.x) >= 0.0)
    near = np.interp(points.x, line.x, line.y)
    assert np.corrcoef(near, points.y)[0, 1] > 0.9
    assert 0.5 < np.ptp(line.y) < 3.0  # a milliradian to both sides, less what geometry takes up


def test_bars_are_blue_where_the_sentences_call_the_share_proven(fitted: tuple[Calibration, ResidualAnalysis]) -> None:
    """A large share by chance, a sure share of next to nothing, and one that is both large and sure."""
    kinds = [r.regressor for r in fitted[1].explained]
    told = [(0.05, 0.20), (0.015, 0.03), (0.004, 0.01), (-0.1, None)]
    nothing = replace(
        fitted[1],
        explained=tuple(Explained(regressor=k, share=s, p_value=p) for k, (s, p) in zip(kinds, told, strict=False)),
    )
    something = replace(
        fitted[1], explained=(Explained(regressor=kinds[0], share=0.012, p_value=0.01), *nothing.explained)
    )
    for found, blue in ((nothing, 0), (something, 1)):
        assert list(draw_shares(found).data[0].marker.color).count(BLUE) == blue
        words = str([getattr(block, "items", ()) for block in residual_analysis_section(found, "80 poses").blocks])
        assert ("No tested quantity explains 1 % of it significantly." in words) == (blue == 0)
        assert words.count("of the variance") == blue
