"""Maps, ladders, plans and studies show the numbers they are given."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.adaptation.plan import Plan
from taskcal.adaptation.selection import NestedModel, Selection
from taskcal.adaptation.study import Study
from taskcal.adaptation.task_map import Slice
from taskcal.analysis.sensitivity import Sensitivity
from taskcal.presentation.effect_figures import draw_effects
from taskcal.presentation.effect_tables import tabulate_effects
from taskcal.presentation.plan_figures import draw_by_count, outline
from taskcal.presentation.selection_figures import draw_ladder
from taskcal.presentation.study_figures import draw_study
from taskcal.presentation.task_figures import draw_bands, draw_maps
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.workspace import Workspace


@pytest.fixture
def slices() -> list[Slice]:
    reached = np.ones((3, 4), dtype=bool)
    reached[0, 0] = False
    u, v = np.linspace(-0.2, 0.2, 4), np.linspace(-0.1, 0.1, 3)
    return [Slice(plane=plane, u=u, v=v, q=np.zeros((3, 4, 6)), reached=reached) for plane in ("xy", "xz")]


def test_maps_are_in_micrometres_and_every_view_can_be_chosen(slices: list[Slice]) -> None:
    values = np.arange(1.0, 12.0)
    views = {name: [at.spread(scale * values) for at in slices] for name, scale in (("small", 1e-6), ("large", 1e-3))}
    figure = draw_maps(slices, views)
    assert [trace.z[2][3] for trace in figure.data] == [11.0, 11.0]
    assert np.isnan(figure.data[0].z[0][0])
    assert figure.data[0].x[0] == -200.0
    assert (figure.layout.coloraxis.cmin, figure.layout.coloraxis.cmax) == (1.0, 11.0)
    buttons = figure.layout.updatemenus[0].buttons
    assert [button.label for button in buttons] == ["small", "large"]
    maps, scale = buttons[1].args
    assert maps["z"][0][0][0] is None
    assert maps["z"][1][2][3] == 11000.0
    assert (scale["coloraxis.cmin"], scale["coloraxis.cmax"]) == (1000.0, 11000.0)


def test_a_map_that_is_nowhere_reached_or_the_same_everywhere_has_a_scale(slices: list[Slice]) -> None:
    nowhere, even = [np.full((3, 4), np.nan)] * 2, [np.full((3, 4), 3e-4)] * 2
    figure = draw_maps(slices, {"nowhere": nowhere, "even": even}, from_zero=True)
    assert (figure.layout.coloraxis.cmin, figure.layout.coloraxis.cmax) == (0.0, 1.0)
    assert figure.layout.updatemenus[0].buttons[1].args[1]["coloraxis.cmax"] == pytest.approx(300.0)


def test_bands_are_95_percent_in_millimetres() -> None:
    figure = draw_bands({"before": np.full((5, 3), 1e-3), "after": np.full((5, 3), 1e-4)})
    heights = {round(float(np.max(trace.y)), 6) for trace in figure.data}
    assert heights == {1.96, 0.196}


def test_effects_are_those_of_the_table() -> None:
    model = ErrorModel(load_robot("ur5"))
    found = Sensitivity(model=model, matrix=np.random.default_rng(0).normal(size=(7, 3, len(model))))
    np.testing.assert_allclose((found.rms_per_axis() ** 2).sum(axis=0), found.rms() ** 2)
    figure, table = draw_effects(found), tabulate_effects(found)
    assert len(figure.data) == 8
    rows = table.groups[0][1]
    assert len(rows) == len(model)
    assert float(rows[0][-1]) == pytest.approx(figure.data[7].y[0], abs=0.51)
    raw = figure.layout.updatemenus[0].buttons[1].args[0]["y"]
    assert float(rows[3][2]) == pytest.approx(raw[0][3], abs=1e-3)


def test_the_ladder_shows_every_size_the_references_and_the_choice() -> None:
    ladder = tuple(
        NestedModel(
            size=k, dropped_next="a", expected=1e-3 / (1 + k), cross_validated=2e-3 / (1 + k), standard_error=1e-4
        )
        for k in (3, 2, 1, 0)
    )
    found = Selection(
        kept=("a", "b"), dropped={"c": "so"}, ladder=ladder, why="it is", before=1e-3,
        references={"identifiable": (3, 2e-4), "published": (1, 5e-4)}, unreachable=0.0,
    )  # fmt: skip
    traces = {trace.name.split(" (")[0]: trace for trace in draw_ladder(found, accuracy=4e-4).data}
    np.testing.assert_allclose(traces["expected over the task"].y, [0.25, 1 / 3, 0.5, 1.0])
    np.testing.assert_allclose(traces["cross-validated on the campaign"].error_y.array, [0.1] * 4)
    assert (traces["chosen"].x[0], traces["chosen"].y[0]) == (2, pytest.approx(1 / 3))
    assert traces["published set"].y[0] == pytest.approx(0.5)
    assert traces["accuracy asked for"].y[0] == pytest.approx(0.4)


def test_a_plan_is_drawn_in_millimetres() -> None:
    made = Plan(
        q=np.zeros((4, 6)), rows=(0, 1, 2, 3), visible=np.ones((4, 1), dtype=bool), expected=1e-5,
        random=np.array([2e-5, 4e-5]), grid=3e-5, by_count=np.array([9.0, 1e-3, 1e-4, 2e-5]), before=1e-3,
        criterion="task", exchanges=0, accuracy=5e-5,
    )  # fmt: skip
    traces = {trace.name.split(":")[0]: trace for trace in draw_by_count(made).data}
    assert list(traces["chosen one by one"].x) == [2, 3, 4]  # one pose alone says nothing, and is left out
    assert traces["random poses"].y[0] == pytest.approx(0.03)
    assert traces["random poses"].error_y.array[0] == pytest.approx(0.01)
    assert traces["accuracy that the task needs"].y[0] == pytest.approx(0.05)
    with_error = {trace.name: trace for trace in draw_by_count(replace(made, model_error=4e-5 / 3.0**0.5)).data}
    assert with_error["accuracy that the task needs, less the model error"].y[0] == pytest.approx(0.03)
    hopeless = draw_by_count(replace(made, model_error=5e-5))
    assert not [trace.name for trace in hopeless.data if trace.name.startswith("accuracy")]


@pytest.mark.parametrize("shape", ["box", "cylinder"])
def test_the_outline_of_a_workspace_touches_its_sides(shape: str) -> None:
    space = Workspace(
        T_base_frame=np.eye(4), shape=shape, center=np.array([1.0, 2.0, 3.0]), size=np.array([0.4, 0.4, 0.2]),
        turned=np.eye(3), orientations=(),
    )  # fmt: skip
    edges = outline(space)
    np.testing.assert_allclose(np.nanmin(edges, axis=0), [0.8, 1.8, 2.9], atol=1e-9)
    np.testing.assert_allclose(np.nanmax(edges, axis=0), [1.2, 2.2, 3.1], atol=1e-9)


def test_a_study_has_a_box_for_every_model() -> None:
    rows = tuple(
        {"robot": r, "plan": plan, "count": 10, "model": model, "rms_mm": 0.1 + r, "max_mm": 1.0}
        for r in range(3) for plan in ("planned", "grid") for model in ("all", "selected")
    )  # fmt: skip
    figure = draw_study(Study(rows=rows, robots=3, seed=0, accuracy=1e-4))
    assert [trace.name for trace in figure.data] == ["all", "selected"]
    assert len(figure.data[0].y) == 6
    assert figure.layout.annotations[0].y == pytest.approx(-1.0)
    off = draw_study(Study(rows=rows, robots=3, seed=0, accuracy=5e-4, model_error=4e-4 / 3.0**0.5))
    assert off.layout.annotations[0].y == pytest.approx(np.log10(0.3))
    assert not draw_study(Study(rows=rows, robots=3, seed=0, accuracy=4e-4, model_error=4e-4)).layout.annotations
