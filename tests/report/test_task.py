"""Maps, ladders, plans and studies show the numbers they are given."""

import numpy as np
import pytest
from scipy.stats import norm

from taskcal.planning.task_map import Slice
from taskcal.report.task import draw_bands, draw_curves, draw_maps


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


def test_maps_lie_as_their_slices_do(slices: list[Slice]) -> None:
    """Columns along u, rows along v, and axes that say which and in millimetres."""
    values = [at.spread(np.arange(11.0)) for at in slices]
    figure = draw_maps(slices, {"one": values})
    for k, at in enumerate(slices):
        np.testing.assert_allclose(figure.data[k].x, 1e3 * at.u)
        np.testing.assert_allclose(figure.data[k].y, 1e3 * at.v)
        np.testing.assert_allclose(figure.data[k].z, 1e3 * values[k])
        axes = [figure.layout[f"{axis}axis{k + 1 if k else ''}"].title.text for axis in "xy"]
        assert [text[0].lower() for text in axes] == list(at.plane)


def test_curves_are_errors_in_millimetres_pose_by_pose() -> None:
    curves = {"a": np.array([1e-3, 2e-3, 5e-4]), "b": np.full(3, 2e-5)}
    for trace in draw_curves(curves).data:
        np.testing.assert_allclose(trace.y, 1e3 * curves[trace.name])
        assert list(trace.x) == [0, 1, 2]


def test_bands_hold_95_percent_of_each_axis() -> None:
    deviation = np.arange(1.0, 13.0).reshape(4, 3) * 1e-5
    figure = draw_bands({"wide": 2.0 * deviation, "narrow": deviation})
    half = norm.ppf(0.975) * 1e3 * deviation
    for row in range(3):
        wide, upper, narrow, line = figure.data[4 * row : 4 * row + 4]
        for area, curve, factor in ((wide, upper, 2.0), (narrow, line, 1.0)):
            np.testing.assert_allclose(curve.y, factor * half[:, row], rtol=1e-3)
            np.testing.assert_allclose(area.y, [*curve.y, *-np.array(curve.y)[::-1]])
            np.testing.assert_allclose(area.x, [0, 1, 2, 3, 3, 2, 1, 0])
        assert (wide.visible, narrow.visible) == (False, True)
