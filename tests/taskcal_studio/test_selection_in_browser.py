"""Rows are selected together in a real browser: in a table, a chart, the scene and the slider, by mouse and by keys."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taskcal.campaigns.campaign import Campaign
from taskcal.reading.reader import read_campaign
from taskcal.reading.writer import campaign_text
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate
from taskcal_studio.measured_rows import registered_rows
from tests.taskcal_studio.conftest import comes_true, open_tab, served
from tests.taskcal_studio.test_robot_in_browser import serious
from tests.taskcal_studio.test_task_in_browser import PIXEL

pytestmark = [pytest.mark.browser, pytest.mark.long]

MODEL = ErrorModel(load_robot("ur5"))

TOOL = """() => {
  const view = getElement(document.querySelector(".view").id.slice(1));
  const balls = view.scene.children.filter((one) => one.geometry?.type === "SphereGeometry" && one.visible);
  return balls.map((one) => one.position.toArray());
}"""
"""Where the balls of the scene are: corners of the robot, the tool and the marks of the selected row."""


def with_nest(rng: np.random.Generator) -> Campaign:
    """A campaign with a reference point, whose drift is a chart."""
    campaign, _ = simulate(MODEL, rng.uniform(-1.2, 1.2, (30, 6)), rng=rng)
    nest = campaign.points[:1, 0] + rng.normal(0.0, 2e-5, (30, 3))
    fields = {"ids": campaign.ids, "q": campaign.q, "targets": campaign.targets, "points": campaign.points}
    return Campaign(**fields, reference_points={"base1": nest})


def test_table_chart_scene_and_slider_select_the_same_row(chromium: Any, tmp_path: Path) -> None:
    file = tmp_path / "campaigns" / "one.csv"
    file.parent.mkdir()
    file.write_text(campaign_text(with_nest(np.random.default_rng(0)), MODEL.robot))
    campaign = read_campaign(file, MODEL.robot)
    measured = registered_rows(MODEL, campaign)
    tools = MODEL.poses(campaign.q)[:, :3, 3]
    (tmp_path / "project.toml").write_text('name = "one"\nrobot = "ur5"\ncampaign = "campaigns/one.csv"\n')
    with served(tmp_path) as address, open_tab(chromium, address, color_scheme="dark") as tab:
        page = tab.open("measurements")
        page.wait_for_selector(".view:not([data-initializing])")
        page.wait_for_timeout(1500)
        slider = page.get_by_label("Pose", exact=True)

        def is_selected(row: int) -> None:
            page.wait_for_function(
                "([label, row]) => document.querySelector(label).value === row",
                arg=['input[aria-label="Pose"]', str(row)],
            )
            page.get_by_text(campaign.row(row)).first.wait_for()
            page.wait_for_function(
                "row => [...document.querySelectorAll('[data-row][aria-current]')].every((e) => e.dataset.row === row)",
                arg=str(row),
            )
            page.wait_for_timeout(500)
            balls = np.array(page.evaluate(TOOL))
            for place in (tools[row], measured.points[row, 0]):
                assert np.linalg.norm(balls - place, axis=1).min() < 1e-3

        is_selected(0)
        page.locator("tr[data-row='4']").click()
        is_selected(4)
        assert page.locator("figure path[data-row='4'][aria-current]").count() > 0
        page.locator("figure path[data-row='9']:visible").first.click(force=True)
        is_selected(9)
        page.locator("figure").filter(has=page.locator("path[data-row]")).first.focus()
        page.keyboard.press("ArrowUp")
        is_selected(8)
        view = page.locator(".view")
        view.focus()
        page.keyboard.press("ArrowRight")
        is_selected(9)
        view.scroll_into_view_if_needed()
        place = page.evaluate(PIXEL, measured.points[17, 0].tolist())
        view.locator("canvas").click(position=place)
        assert comes_true(page, lambda: slider.input_value() != "9")
        slider.focus()
        slider.press("Home")
        is_selected(0)
        assert serious(page) == []
        tab.picture("selected")
        assert tab.complaints == []
