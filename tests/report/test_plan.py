"""Figures of a plan show its numbers, in the units their axes name."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from taskcal.planning.plan import Plan
from taskcal.report.plan import describe_accuracy, draw_by_count, tabulate_poses
from taskcal.report.scene import outline
from taskcal.robot.catalogue import load_robot
from taskcal.task.workspace import Workspace
from tests.report.drawn import levels, series

PLAN = Plan(
    q=np.zeros((4, 6)), rows=(0, 1, 2, 3), visible=np.ones((4, 1), dtype=bool), expected=2e-5, random=np.full(3, 4e-5),
    grid=3e-5, by_count=np.array([9e-5, 6e-5, 4e-5, 2e-5]), before=1e-3, criterion="task", exchanges=0,
)  # fmt: skip


def told(plan: Plan) -> dict[str, Any]:
    """What the command line prints of a plan."""
    return {**plan.summary(), "task": "list", "measured_before": 0}


def test_plan_figure_is_in_millimetres() -> None:
    made = Plan(
        q=np.zeros((4, 6)), rows=(0, 1, 2, 3), visible=np.ones((4, 1), dtype=bool), expected=1e-5,
        random=np.array([2e-5, 4e-5]), grid=3e-5, by_count=np.array([9.0, 1e-3, 1e-4, 2e-5]), before=1e-3,
        criterion="task", exchanges=0, accuracy=5e-5,
    )  # fmt: skip
    figure = draw_by_count(told(made))
    traces = {one.name.split(":")[0]: one for one in series(figure)}
    assert list(traces["greedy selection"].x) == [2, 3, 4]  # one pose alone says nothing, and is left out
    assert traces["random poses"].y[0] == pytest.approx(0.03)
    assert (traces["random poses"].low[0], traces["random poses"].high[0]) == pytest.approx((0.02, 0.04))
    assert traces["space-filling poses"].y[0] == pytest.approx(0.03, rel=1e-9)
    assert traces["this plan, after exchange and refinement"].y[0] == pytest.approx(0.01, rel=1e-9)
    assert {traces[name].x[0] for name in traces if name != "greedy selection"} == {4}
    assert levels(figure)["accuracy that the task needs"] == pytest.approx(0.05)
    with_error = levels(draw_by_count(told(replace(made, model_error=4e-5 / 3.0**0.5))))
    assert with_error["accuracy that the task needs, less the model error"] == pytest.approx(0.03)
    assert list(levels(draw_by_count(told(replace(made, model_error=5e-5))))) == ["nominal (registered)"]


@pytest.mark.parametrize("shape", ["box", "cylinder"])
def test_outline_touches_the_workspace_sides(shape: str) -> None:
    space = Workspace(
        T_base_frame=np.eye(4), shape=shape, center=np.array([1.0, 2.0, 3.0]), size=np.array([0.4, 0.4, 0.2]),
        turned=np.eye(3), orientations=(),
    )  # fmt: skip
    edges = np.concatenate(outline(space))
    np.testing.assert_allclose(np.min(edges, axis=0), [0.8, 1.8, 2.9], atol=1e-9)
    np.testing.assert_allclose(np.max(edges, axis=0), [1.2, 2.2, 3.1], atol=1e-9)


@pytest.mark.parametrize(
    ("accuracy", "model_error", "words"),
    [
        (None, 0.0, "the task states none"),
        (5e-5, 0.0, "the first 3 poses chosen meet the task's 0.05 mm"),
        (1e-5, 0.0, "about 16 poses would"),
        (1e-5, 1e-4, "no number of poses meets the task's 0.01 mm: the model error alone leaves 0.173 mm"),
    ],
)
def test_describe_accuracy(accuracy: float | None, model_error: float, words: str) -> None:
    assert words in describe_accuracy(told(replace(PLAN, accuracy=accuracy, model_error=model_error)))


def test_the_whole_plan_may_do_where_the_greedy_start_does_not() -> None:
    refined = replace(PLAN, by_count=PLAN.by_count * 2.0, accuracy=3e-5)
    assert describe_accuracy(told(refined)) == "the whole plan meets the task's 0.03 mm, model error included"


def test_what_is_not_known_of_poses_is_not_shown() -> None:
    robot, q = load_robot("ur5"), np.zeros((2, 6))
    gaps = {"between_links": [12.34, 5.0], "to_keep_out": None}
    table = tabulate_poses({"clearance_mm": gaps}, robot, q)
    assert (table.header[7:], [row[7:] for row in table.rows]) == (("between links mm",), [("12",), ("5",)])
    table = tabulate_poses({"visible": [["smr1", "smr2"], ["smr2"]]}, robot, q)
    assert (table.header[7:], [row[7:] for row in table.rows]) == (("visible",), [("smr1, smr2",), ("smr2",)])
