"""Figures of a campaign's course hold its own numbers, and a plan is read as it was written."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.campaigns.performance import pose_repeatability
from taskcal.reading.writer import write_joints
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate

pytest.importorskip("nicegui", reason="the extra 'studio' is not installed")

from taskcal_studio.pages.measurements_page import draw_drift, draw_repeatability
from taskcal_studio.pages.plan_page import read_plan
from taskcal_studio.texts import Texts
from tests.report.drawn import series

TEXTS = Texts("en")
MODEL = ErrorModel(load_robot("abb-irb120"))


def postures(count: int, seed: int = 0) -> np.ndarray:
    limits = 0.4 * MODEL.robot.limits
    return np.random.default_rng(seed).uniform(limits[:, 0], limits[:, 1], (count, len(limits)))


def test_the_planned_poses_are_read_as_they_were_written(tmp_path):
    q = postures(7)
    write_joints(tmp_path / "plan.csv", q, MODEL.robot)
    read, ids = read_plan(tmp_path / "plan.csv", MODEL.robot)
    np.testing.assert_allclose(read, q, atol=1e-10)
    assert ids == [str(number) for number in range(7)]


def test_repeated_poses_and_reference_points_are_drawn_by_row():
    campaign, _ = simulate(MODEL, np.repeat(postures(5), 3, axis=0), rng=np.random.default_rng(1))
    repeated = pose_repeatability(campaign)
    (panel,) = draw_repeatability(repeated, TEXTS).panels
    np.testing.assert_allclose(panel.series[0].x, repeated.repeatability * 1e3)
    assert panel.y.categories == ("0", "3", "6", "9", "12")
    nest = np.tile([1.0, 2.0, 0.5], (15, 1))
    nest[10:, 2] += 2e-4
    moved = replace(campaign, reference_points={"nest": nest})
    (marks,) = series(draw_drift(moved, TEXTS))
    np.testing.assert_allclose(marks.y, np.r_[np.zeros(10), np.full(5, 0.2)], atol=1e-9)
