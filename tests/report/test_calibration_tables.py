"""The terminal's tables of a calibration are the page's."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.identification.held_out import LeftOut, Outlier
from taskcal.identification.identify import identify
from taskcal.report.calibration import (
    Beside,
    calibration_page,
    describe_outliers,
    tabulate_judged,
    tabulate_left_out,
    tabulate_outliers,
    tabulate_parameters,
)
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate


def test_tables_stand_on_the_page_as_they_are_printed() -> None:
    model, rng = ErrorModel(load_robot("ur5")), np.random.default_rng(0)
    campaign, _ = simulate(model, rng.uniform(-1.0, 1.0, (30, 6)), rng=rng)
    outliers = (Outlier(row=7, line=9, id="p7", target="tool", studentised=6.2, residual=1.5e-3),)
    left_out = (LeftOut(row=3, line=None, id="p3", distance=0.25, studentised=900.0),)
    calibration = replace(identify(model, campaign, keep=["J2"]), outliers=outliers, left_out=left_out)
    parameters = tabulate_parameters(calibration)
    assert [row[0] for row in parameters.rows] == list(calibration.kept)
    assert [row[2] for row in parameters.rows] == [
        f"{calibration.estimate[i] * 1e3:+.4f}" for i in calibration.estimated
    ]
    assert (
        len(tabulate_parameters(calibration, leave_out=lambda name: name == calibration.kept[0])) == len(parameters) - 1
    )
    assert [row[:6] for row in tabulate_outliers(calibration).rows] == [("7", "9", "p7", "tool", "1.500", "6.2")]
    assert tabulate_left_out(calibration).rows == (("3", "–", "p3", "250.00", "900"),)
    page = calibration_page(calibration, Beside(), version="1").html()
    for table in (tabulate_outliers(calibration), tabulate_left_out(calibration)):
        assert all(cell in page for row in table.rows for cell in row[2:])
        assert table.title in page


def outliers_of(count: int) -> tuple[Outlier, ...]:
    return tuple(
        Outlier(row=i, line=i + 2, id=f"p{i}", target="tool", studentised=9.0 - i, residual=1e-3) for i in range(count)
    )


def test_outliers_table_says_reading_or_model_error() -> None:
    table = tabulate_judged(outliers_of(3), (True, False, True), "error mm", mostly=False)
    assert [row[-1] for row in table.rows] == ["model error", "reading", "model error"]
    assert "measuring again does not help" in table.note
    assert "measure again, or leave out" in table.note
    assert len(tabulate_judged(outliers_of(3), (True,) * 3, "error mm", mostly=False, count=2)) == 2


def test_outliers_of_most_points_advise_no_measurement() -> None:
    """Where most points are outliers, none of them is at fault."""
    table = tabulate_judged(outliers_of(3), (True, False, True), "error mm", mostly=True)
    assert {row[-1] for row in table.rows} == {""}
    for text in (table.note, describe_outliers((True, False, True), mostly=True)):
        assert "measure again" not in text
        assert "not those that were calibrated" in text


@pytest.mark.parametrize(
    ("shared", "said"),
    [
        ((), "none"),
        ((False,), "1 outlier, 1 isolated: measure again, or leave out"),
        ((True, True), "2 outliers, 2 with similar errors nearby: model error, do not measure again"),
    ],
    ids=["none", "reading", "model"],
)
def test_outliers_are_counted_by_cause(shared: tuple[bool, ...], said: str) -> None:
    assert describe_outliers(shared, mostly=False) == said
