"""What a page and a terminal say of rows that were held out."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.identification.held_out import HeldOut
from taskcal.report.calibration import describe_held_out, held_out_section


def of_lengths(mm, part, folds=0, by="neighbours"):
    residuals = np.asarray(mm, dtype=float)[:, None, None] * np.array([1e-3, 0.0, 0.0])
    return HeldOut(
        by=by, folds=folds, rows=np.arange(len(mm)), part=np.asarray(part), residuals=residuals, nominal=10 * residuals
    )  # fmt: skip


def test_the_sentence_has_mean_spread_and_the_best_and_worst_part():
    sentence = describe_held_out(of_lengths([0.1, 0.1, 0.3, 0.3], [0, 0, 1, 1]))
    assert "2 groups of neighbouring poses, excluded from the fit" in sentence
    assert "mean 0.200 mm, standard error 0.100 mm" in sentence
    assert "from 0.100 to 0.300 mm" in sentence
    assert "3 folds of blocks" in describe_held_out(of_lengths([0.1, 0.2, 0.3], [0, 1, 2], folds=3, by="blocks"))
    assert "has no standard error" in describe_held_out(of_lengths([0.1, 0.2], [0, 0]))


def test_the_page_shows_them_or_says_how_to_get_them(fitted):
    calibration, _ = fitted
    nothing = held_out_section(calibration)
    assert "--folds 5" in nothing.blocks[0].paragraphs[0]
    shown = held_out_section(replace(calibration, held_out=of_lengths([0.1, 0.1, 0.3, np.nan], [0, 0, 1, 2])))
    _, errors, parts = shown.blocks
    assert [row[0] for row in errors.rows] == ["nominal (registered)", "calibrated"]
    assert errors.rows[0][5] == "1.667"
    assert parts.rows == (("0", "2", "0.100", "0.100"), ("1", "1", "0.300", "0.300"))


@pytest.mark.parametrize("by", ["rows", "chosen"])
def test_hundreds_of_parts_are_not_listed(fitted, by):
    many = of_lengths(np.linspace(0.1, 0.2, 100), np.arange(100), by=by)
    assert len(held_out_section(replace(fitted[0], held_out=many)).blocks) == 2
