"""The page of a performance shows the worst pose, and every figure in millimetres."""

from types import SimpleNamespace

import numpy as np
import pytest

from taskcal.report.performance import path_sections, pose_sections
from tests.report.drawn import series


def items(sections, kind):
    return [block for section in sections for block in section.blocks if type(block).__name__ == kind]


def test_pose_page_has_the_worst_pose_and_every_cycle() -> None:
    poses = {
        ("a", ""): SimpleNamespace(accuracy=2e-3, repeatability=1e-5, cycles=30, distances=np.array([1e-5, 3e-5])),
        ("b", "left"): SimpleNamespace(accuracy=None, repeatability=4e-5, cycles=12, distances=np.array([2e-5, 2e-5])),
        ("c", ""): SimpleNamespace(accuracy=1e-3, repeatability=None, cycles=20, distances=np.array([0.0, 1e-6])),
    }
    summary = {"poses": [{"pose": "a", "accuracy_mm": 2.0}], "directions": [], "distances": []}
    made = pose_sections(SimpleNamespace(poses=poses, summary=lambda: summary))
    (numbers,) = items(made, "Numbers")
    assert [value for value, *_ in numbers.items] == ["2.000", "0.040", "3", "12"]
    bars, cycles = (chart.figure for chart in items(made, "Chart"))
    shown = {one.name.split(" ")[0]: one.x for one in series(bars)}
    assert shown["accuracy"] == pytest.approx([2.0, np.nan, 1.0], nan_ok=True)
    assert shown["repeatability"] == pytest.approx([0.01, 0.04, np.nan], nan_ok=True)
    assert bars.panels[0].y.categories == ("a", "b left", "c")
    for trace, one in zip(series(cycles), poses.values(), strict=True):
        np.testing.assert_allclose(trace.y, 1e3 * one.distances)
        assert list(trace.x) == [1, 2][: len(one.distances)] or len(trace.x) == one.cycles


def test_path_page_has_accuracy_and_repeatability_along_the_path() -> None:
    along = {"accuracy_along": np.array([1e-3, 4e-3]), "repeatability_along": np.array([1e-4, 2e-4])}
    performance = SimpleNamespace(accuracy=4e-3, repeatability=2e-4, cycles=7, summary=lambda: {"cycles": 7}, **along)
    made = path_sections(performance)
    (numbers,), (chart,) = items(made, "Numbers"), items(made, "Chart")
    assert [one[0] for one in numbers.items if one] == ["4.000", "0.200", "7"]
    for trace, key in zip(series(chart.figure), along, strict=True):
        assert trace.name in key
        np.testing.assert_allclose(trace.y, 1e3 * along[key])
