"""Maps, ladders, plans and studies show the numbers they are given."""

import numpy as np
import pytest
from scipy.stats import norm

from taskcal.planning.task_map import Slice
from taskcal.report.task import draw_bands, draw_curves, draw_maps
from tests.report.drawn import series


@pytest.fixture
def slices() -> list[Slice]:
    reached = np.ones((3, 4), dtype=bool)
    reached[0, 0] = False
    u, v = np.linspace(-0.2, 0.2, 4), np.linspace(-0.1, 0.1, 3)
    return [Slice(plane=plane, u=u, v=v, q=np.zeros((3, 4, 6)), reached=reached) for plane in ("xy", "xz")]


def test_maps_are_in_millimetres_with_a_choice_of_view(slices: list[Slice]) -> None:
    values = np.arange(1.0, 12.0)
    views = {name: [at.spread(scale * values) for at in slices] for name, scale in (("small", 1e-6), ("large", 1e-3))}
    drawn = draw_maps(slices, views)
    assert list(drawn) == ["small", "large"]
    for name, top in (("small", 0.011), ("large", 11.0)):
        assert [panel.cells.z[2][3] for panel in drawn[name].panels] == pytest.approx([top, top])
        assert np.isnan(drawn[name].panels[0].cells.z[0][0])
        assert drawn[name].scale[:2] == pytest.approx((top / 11.0, top))


def test_maps_without_range_have_a_scale(slices: list[Slice]) -> None:
    nowhere, even = [np.full((3, 4), np.nan)] * 2, [np.full((3, 4), 3e-4)] * 2
    drawn = draw_maps(slices, {"nowhere": nowhere, "even": even}, from_zero=True)
    assert drawn["nowhere"].scale == (0.0, 1.0, "mm")
    assert drawn["even"].scale[:2] == pytest.approx((0.0, 0.3))


def test_maps_lie_as_their_slices_do(slices: list[Slice]) -> None:
    """Columns along u, rows along v, and axes that say which and in millimetres."""
    values = [at.spread(np.arange(11.0)) for at in slices]
    panels = draw_maps(slices, {"one": values})["one"].panels
    for panel, at, own in zip(panels, slices, values, strict=True):
        np.testing.assert_allclose(panel.cells.x, 1e3 * at.u)
        np.testing.assert_allclose(panel.cells.y, 1e3 * at.v)
        np.testing.assert_allclose(panel.cells.z, 1e3 * own)
        assert [axis.title[0].lower() for axis in (panel.x, panel.y)] == list(at.plane)


def test_curves_are_errors_in_millimetres_pose_by_pose() -> None:
    curves = {"a": np.array([1e-3, 2e-3, 5e-4]), "b": np.full(3, 2e-5)}
    for trace in series(draw_curves(curves)):
        np.testing.assert_allclose(trace.y, 1e3 * curves[trace.name])
        assert list(trace.x) == [0, 1, 2]


def test_bands_hold_95_percent_of_each_axis() -> None:
    deviation = np.arange(1.0, 13.0).reshape(4, 3) * 1e-5
    figure = draw_bands({"wide": 2.0 * deviation, "narrow": deviation})
    half = norm.ppf(0.975) * 1e3 * deviation
    for axis, panel in enumerate(figure.panels):
        for curve, factor in zip(panel.series, (2.0, 1.0), strict=True):
            np.testing.assert_allclose(curve.y, factor * half[:, axis], rtol=1e-3)
            assert list(curve.x) == [0, 1, 2, 3]
