"""Figures of a plan show its numbers, in the units their axes name."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.planning.plan import Plan
from taskcal.report.plan import draw_by_count
from taskcal.report.scene import outline
from taskcal.task.workspace import Workspace
from tests.report.drawn import levels, series


def test_plan_figure_is_in_millimetres() -> None:
    made = Plan(
        q=np.zeros((4, 6)), rows=(0, 1, 2, 3), visible=np.ones((4, 1), dtype=bool), expected=1e-5,
        random=np.array([2e-5, 4e-5]), grid=3e-5, by_count=np.array([9.0, 1e-3, 1e-4, 2e-5]), before=1e-3,
        criterion="task", exchanges=0, accuracy=5e-5,
    )  # fmt: skip
    figure = draw_by_count(made)
    traces = {one.name.split(":")[0]: one for one in series(figure)}
    assert list(traces["greedy selection"].x) == [2, 3, 4]  # one pose alone says nothing, and is left out
    assert traces["random poses"].y[0] == pytest.approx(0.03)
    assert (traces["random poses"].low[0], traces["random poses"].high[0]) == pytest.approx((0.02, 0.04))
    assert traces["space-filling poses"].y[0] == pytest.approx(0.03, rel=1e-9)
    assert traces["this plan, after exchange and refinement"].y[0] == pytest.approx(0.01, rel=1e-9)
    assert {traces[name].x[0] for name in traces if name != "greedy selection"} == {4}
    assert levels(figure)["accuracy that the task needs"] == pytest.approx(0.05)
    with_error = levels(draw_by_count(replace(made, model_error=4e-5 / 3.0**0.5)))
    assert with_error["accuracy that the task needs, less the model error"] == pytest.approx(0.03)
    assert list(levels(draw_by_count(replace(made, model_error=5e-5)))) == ["nominal (registered)"]


@pytest.mark.parametrize("shape", ["box", "cylinder"])
def test_outline_touches_the_workspace_sides(shape: str) -> None:
    space = Workspace(
        T_base_frame=np.eye(4), shape=shape, center=np.array([1.0, 2.0, 3.0]), size=np.array([0.4, 0.4, 0.2]),
        turned=np.eye(3), orientations=(),
    )  # fmt: skip
    edges = np.concatenate(outline(space))
    np.testing.assert_allclose(np.min(edges, axis=0), [0.8, 1.8, 2.9], atol=1e-9)
    np.testing.assert_allclose(np.max(edges, axis=0), [1.2, 2.2, 3.1], atol=1e-9)
