"""A hundred thousand points in a real browser: one drawing, in which the server has no part once it is there."""

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taskcal.reading.writer import campaign_text
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate
from tests.taskcal_studio.conftest import open_tab, served, server_of

pytestmark = [pytest.mark.browser, pytest.mark.long]

POINTS = 100_000

DRAWN = "(most) => getElement(document.querySelector('.view').id.slice(1))?.renderer?.info.render.points >= most"
CALLS = "() => getElement(document.querySelector('.view').id.slice(1)).renderer.info.render.calls"
FRAME_MS = """() => {
  const {renderer, scene, camera} = getElement(document.querySelector(".view").id.slice(1));
  const frames = 20, begun = performance.now();
  for (let k = 0; k < frames; k++) renderer.render(scene, camera);
  return (performance.now() - begun) / frames;
}"""

MOST_CALLS = 60
"""The points are one; the parts of the robot, the axes, the tracker and the grid are the others."""

MOST_MS = 16.0
"""Of the page's own work for a frame, for sixty a second; what the graphics processor does comes beside that."""

MOST_SHARE = 0.2
"""Of a core's time that the server takes while the view is turned; a slow machine draws for long, and signs of life go on."""

EVENT = '42["event"'
"""How a message begins by which the page has the server do something; acknowledgements and signs of life begin otherwise."""


def test_a_hundred_thousand_points_are_one_drawing(chromium: Any, tmp_path: Path) -> None:
    model, rng = ErrorModel(load_robot("ur5")), np.random.default_rng(0)
    campaign, _ = simulate(model, rng.uniform(-1.2, 1.2, (POINTS, 6)), rng=rng)
    (tmp_path / "campaigns").mkdir()
    (tmp_path / "campaigns" / "many.csv").write_text(campaign_text(campaign, model.robot))
    (tmp_path / "project.toml").write_text('name = "many"\nrobot = "ur5"\ncampaign = "campaigns/many.csv"\n')
    with served(tmp_path) as address, open_tab(chromium, address) as tab:
        page, sent = tab.page, list[Any]()
        page.on("websocket", lambda socket: socket.on("framesent", lambda frame: sent.append(str(frame))))
        page.goto(f"{tab.address}measurements")
        page.wait_for_selector("[data-ready]", timeout=120_000)
        page.wait_for_function(DRAWN, arg=POINTS, timeout=300_000)
        assert page.evaluate(CALLS) <= MOST_CALLS
        cost = page.evaluate(FRAME_MS)
        view, server = page.locator("canvas"), server_of(tmp_path)
        view.scroll_into_view_if_needed(timeout=120_000)  # drawn without a graphics processor, frames are seldom
        corner = view.bounding_box()
        before, used, begun = len(sent), sum(server.cpu_times()[:2]), time.monotonic()
        page.mouse.move(corner["x"] + 300, corner["y"] + 200)
        page.mouse.down()
        for step in range(20):
            page.mouse.move(corner["x"] + 300 + 10 * step, corner["y"] + 200)
            page.wait_for_timeout(50)
        page.mouse.up()
        share = (sum(server.cpu_times()[:2]) - used) / (time.monotonic() - begun)
        print(f"{cost:.2f} ms a frame, {share:.0%} of a core for the server while it is turned")
        assert cost < MOST_MS
        assert share < MOST_SHARE
        assert any(message.startswith(EVENT) for message in sent[:before])
        assert not [message for message in sent[before:] if message.startswith(EVENT)]
        tab.picture("many-points")
        assert tab.complaints == []
