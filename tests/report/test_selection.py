"""The ladder of model sizes."""

import numpy as np
import pytest

from taskcal.planning.selection import NestedModel, Selection
from taskcal.report.selection import draw_ladder, tabulate_dropped, tabulate_ladder
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from tests.report.drawn import levels, series


def test_ladder_shows_sizes_references_and_choice() -> None:
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
    figure = draw_ladder(found, accuracy=4e-4)
    traces = {one.name.split(" (")[0]: one for one in series(figure)}
    np.testing.assert_allclose(traces["expected over the task"].y, [0.25, 1 / 3, 0.5, 1.0])
    crossed = traces["cross-validated on the campaign"]
    np.testing.assert_allclose(crossed.high - crossed.y, [0.1] * 4)
    assert (traces["chosen"].x[0], traces["chosen"].y[0]) == (2, pytest.approx(1 / 3))
    assert traces["published set"].y[0] == pytest.approx(0.5)
    assert levels(figure) == {"accuracy asked for": pytest.approx(0.4)}


def test_tables_of_a_choice_name_every_size_and_parameter_once() -> None:
    """Sizes in a row have the same figures; parameters that go together stand under the name of their group."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    a, b, c, d, e = model.names[:5]
    errors = {6: 2e-4, 5: 2e-4, 4: 2e-4, 3: 3e-4, 2: 3e-4, 1: 5e-4, 0: 1e-3}
    ladder = tuple(
        NestedModel(size=k, dropped_next="", expected=error, cross_validated=None, standard_error=None)
        for k, error in errors.items()
    )
    found = Selection(
        kept=("x", "y", "z"), dropped={a: "one", b: "one", c: "two", d: "one", e: "two"}, ladder=ladder, why="", before=1e-3,
        references={}, unreachable=0.0, groups={"springs": (b, d)},
    )  # fmt: skip
    table = tabulate_ladder(found)
    assert [(row[0], float(row[1])) for row in table.rows] == [
        ("6 to 4", 0.2), ("3", 0.3), ("2", 0.3), ("1", 0.5), ("0", 1.0)
    ]  # fmt: skip
    assert [row[-1] for row in table.rows] == ["", "chosen", "", "", ""]
    symbols = {p.name: p.symbol for p in model.parameters}
    dropped = tabulate_dropped(found, model)
    assert dropped.rows == (
        ("one", f"{a} ({symbols[a]}), springs"),
        ("two", f"{c} ({symbols[c]}), {e} ({symbols[e]})"),
    )
    assert "5 dropped" in dropped.title
