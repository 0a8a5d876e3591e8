"""The ladder of model sizes."""

import numpy as np
import pytest

from taskcal.planning.selection import NestedModel, Selection
from taskcal.report.selection import draw_ladder
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
