"""Maps and tables of placements show each placement where it is, and mark what cannot be used."""

import re
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from taskcal.correction.part_placement import PartPlacements, PlacedPart
from taskcal.report.placement import (
    SHOWN,
    draw_placements,
    placement_page,
    state_trade,
    tabulate_obstacles,
    tabulate_placements,
    varied_axes,
)
from tests.report.drawn import series

XS, YS, TURNS = (-0.2, 0.0, 0.2), (-0.1, 0.1), (-0.5, 0.5)


def placed(x: float, y: float = 0.0, turn: float = 0.0) -> PlacedPart:
    """A placement whose error tells where it is, impossible at the far end."""
    error = 1e-3 + 1e-3 * x + 2e-4 * y + 1e-5 * turn
    far = x > 0.1
    return PlacedPart(
        shift=np.array([x, y, 0.0]), turn=turn, reached=0.5 if far else 1.0, obstacle="square.csv:2: out of reach" if far else "",
        before=2 * error, after=error, compliance=np.nan, margin=0.3, conditioning=0.1,
    )  # fmt: skip


def test_placement_maps_cross_out_infeasible_places():
    found = PartPlacements(name="square", now=placed(0.0), all=tuple(placed(*at) for at in product(XS, YS, TURNS)))
    assert varied_axes(found) == [0, 1, 3]
    best = found.ranked[0]
    views = draw_placements(found, best)
    assert list(views) == [
        "expected",
        "before",
        "joint margin",
        "executed",
    ]  # corrected is what is expected; there is no force
    panels = views["expected"].panels
    assert len(panels) == 3
    first = panels[0].cells
    assert (list(first.x), list(first.y)) == ([-200.0, 0.0, 200.0], [-100.0, 100.0])
    for i, y in enumerate(YS):
        for k, x in enumerate(XS):
            shown = np.nan if x > 0.1 else placed(x, y, best.turn).expected * 1e3
            np.testing.assert_allclose(first.z[i][k], shown)
    crosses, circle = panels[0].series
    assert set(crosses.x) == {200.0}
    assert (circle.x[0], circle.y[0]) == (best.shift[0] * 1e3, best.shift[1] * 1e3)


def test_placements_along_one_axis_are_a_curve():
    line = PartPlacements(name="square", now=placed(0.0), all=tuple(placed(x) for x in XS))
    (expected, before) = series(draw_placements(line, line.ranked[0]))
    np.testing.assert_allclose(
        np.array(expected.y, dtype=float), [placed(-0.2).expected * 1e3, placed(0.0).expected * 1e3, np.nan]
    )
    assert list(before.x) == [-200.0, 0.0, 200.0]
    one = PartPlacements(name="square", now=placed(0.0), all=(placed(0.0),))
    page = placement_page(one, "robot", calibrated=True)
    assert [section.title for section in page.sections] == ["Best placements"]


def test_placement_page_gives_reasons_of_rejection():
    found = PartPlacements(name="square", now=placed(0.0), all=tuple(placed(x) for x in XS))
    page = placement_page(found, "robot", calibrated=True).html()
    assert "Rejected placements" in page
    assert "square.csv:2: out of reach" in page


def test_tables_and_words_of_placements_are_their_figures():
    """The best first; each reason counted; what the move to the best is, and by which share it reduces the error."""
    every = tuple(placed(*at) for at in product(XS, YS, TURNS))
    found = PartPlacements(name="square", now=placed(0.0), all=every)
    table = tabulate_placements(found)
    at = [table.header.index(name) for name in ("x mm", "y mm", "turn °", "after mm", "least joint margin °")]
    rows = [[float(row[k]) for k in at] for row in table.rows]
    possible = sorted((one for one in every if one.possible), key=lambda one: one.expected)
    wanted = [
        [1e3 * one.shift[0], 1e3 * one.shift[1], np.degrees(one.turn), 1e3 * one.after, np.degrees(one.margin)]
        for one in possible
    ]
    np.testing.assert_allclose(rows, wanted[:SHOWN], atol=0.06)
    assert tabulate_obstacles(found).rows == (("square.csv:2: out of reach", "4"),)
    assert tabulate_obstacles(PartPlacements(name="square", now=placed(0.0), all=tuple(possible))) is None
    best = replace(placed(-0.2, 0.0, 0.5), shift=np.array([-0.2, 0.1, 0.2]), margin=0.2)
    moved, turned, less, cost, *_ = (float(number) for number in re.findall(r"\d+(?:\.\d+)?", state_trade(found, best)))
    assert (moved, turned) == pytest.approx((300.0, np.degrees(0.5)), abs=0.06)
    assert less == round(100 * (1 - best.expected / found.now.expected))
    assert cost == round(np.degrees(found.now.margin - best.margin))
    unknown = replace(found, now=replace(found.now, before=np.nan, after=np.nan))
    assert "% less" not in state_trade(unknown, best)
