"""Maps, ladders, plans and studies show the numbers they are given."""

import numpy as np
import pytest

from taskcal.planning.task_map import Slice
from taskcal.report.task import draw_maps


@pytest.fixture
def slices() -> list[Slice]:
    reached = np.ones((3, 4), dtype=bool)
    reached[0, 0] = False
    u, v = np.linspace(-0.2, 0.2, 4), np.linspace(-0.1, 0.1, 3)
    return [Slice(plane=plane, u=u, v=v, q=np.zeros((3, 4, 6)), reached=reached) for plane in ("xy", "xz")]


def test_maps_are_in_millimetres_with_a_choice_of_view(slices: list[Slice]) -> None:
    values = np.arange(1.0, 12.0)
    views = {name: [at.spread(scale * values) for at in slices] for name, scale in (("small", 1e-6), ("large", 1e-3))}
    figure = draw_maps(slices, views)
    assert [trace.z[2][3] for trace in figure.data] == pytest.approx([0.011, 0.011])
    assert np.isnan(figure.data[0].z[0][0])
    assert figure.data[0].x[0] == -200.0
    assert (figure.layout.coloraxis.cmin, figure.layout.coloraxis.cmax) == pytest.approx((0.001, 0.011))
    buttons = figure.layout.updatemenus[0].buttons
    assert [button.label for button in buttons] == ["small", "large"]
    maps, scale = buttons[1].args
    assert maps["z"][0][0][0] is None
    assert maps["z"][1][2][3] == pytest.approx(11.0)
    assert (scale["coloraxis.cmin"], scale["coloraxis.cmax"]) == pytest.approx((1.0, 11.0))


def test_maps_without_range_have_a_scale(slices: list[Slice]) -> None:
    nowhere, even = [np.full((3, 4), np.nan)] * 2, [np.full((3, 4), 3e-4)] * 2
    figure = draw_maps(slices, {"nowhere": nowhere, "even": even}, from_zero=True)
    assert (figure.layout.coloraxis.cmin, figure.layout.coloraxis.cmax) == (0.0, 1.0)
    assert figure.layout.updatemenus[0].buttons[1].args[1]["coloraxis.cmax"] == pytest.approx(0.3)
