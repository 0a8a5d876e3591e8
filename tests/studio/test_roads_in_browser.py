"""The whole road on a UR5 by keyboard alone; a server that is killed; two projects side by side."""

import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taskcal.reading.writer import campaign_text
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.studio.project import NAME as LOCK
from taskcal.studio.texts import Texts
from taskcal.virtual.cell import simulate
from tests.studio.conftest import Tab, comes_true, open_tab, served, server_of
from tests.studio.test_robot_in_browser import serious

pytestmark = [pytest.mark.browser, pytest.mark.long]

FOCUSED = """(place) => {
  const at = document.activeElement;
  if (!at.closest(place)) return "";
  return at.getAttribute("aria-label") || at.innerText || at.getAttribute("type") || "";
}"""

MOST_TABS = 150


def tab_to(page: Any, label: str, place: str = "#content") -> None:
    """Go to a control of a part of the page by the Tab key alone."""
    reached: list[str] = []
    for _ in range(MOST_TABS):
        page.keyboard.press("Tab")
        reached.append(page.evaluate(FOCUSED, place))
        if reached[-1] == label:
            return
    raise AssertionError(f"'{label}' is not reached by Tab; these are: {sorted(set(reached))}")


def press(page: Any, label: str, key: str = "Enter", place: str = "#content") -> None:
    tab_to(page, label, place)
    page.keyboard.press(key)


def go(tab: Tab, key: str) -> Any:
    """To a page by its link."""
    title = Texts("en")(f"{key}.title")
    press(tab.page, title, place="nav")
    tab.page.wait_for_url(f"**/{key}")
    tab.page.locator("h1", has_text=title).wait_for()
    return tab.ready()


def files_of(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != LOCK
    }


def ur5_campaign() -> bytes:
    model = ErrorModel(load_robot("ur5"))
    rng = np.random.default_rng(3)
    q = rng.uniform(-1.2, 1.2, (60, 6))
    campaign, _ = simulate(model, q, rng=rng)
    return campaign_text(campaign, model.robot).encode()


def test_ur5_workflow_by_keyboard_survives_server_restart(chromium: Any, tmp_path: Path) -> None:
    """The UR5 workflow with the keyboard alone survives the end of its server."""
    measured = tmp_path / "measured.csv"
    measured.write_bytes(ur5_campaign())
    folder = tmp_path / "ur5"
    pages = ("robot", "measurements", "task", "weight", "plan", "identify", "result", "report")
    with served(folder) as address, open_tab(chromium, address) as tab:
        page = tab.open("robot")
        tab_to(page, "Robot")
        page.keyboard.type("Universal Robots UR5 (")
        page.keyboard.press("Enter")
        page.get_by_text("Joints of Universal Robots UR5 and their limits").wait_for()
        tab.ready()
        page = go(tab, "measurements")
        with page.expect_file_chooser() as chooser:
            press(page, "file", "Space")
        chooser.value.set_files(measured)
        page.get_by_text("Import summary").wait_for()
        page = go(tab, "task")
        press(page, "Begin with a box")
        page.get_by_text("The robot reaches").wait_for()
        tab_to(page, "Turned about fixed axes, ° z")
        for _ in range(20):
            page.keyboard.press("ArrowRight")
        assert comes_true(page, lambda: "rpy_deg" in (folder / "tasks" / "task.toml").read_text())
        page = go(tab, "weight")
        page.locator("[data-updates]").get_by_role("cell").first.wait_for()
        page = go(tab, "plan")
        tab_to(page, "Poses to measure")
        page.keyboard.press("Control+A")
        page.keyboard.type("20")
        press(page, "Plan")
        page.get_by_text("Expected 3D rms error over the task").wait_for(timeout=300_000)
        page = go(tab, "identify")
        press(page, "Fit")
        page.get_by_text("Models side by side").wait_for(timeout=300_000)
        page = go(tab, "result")
        page = go(tab, "report")
        press(page, "Make the report")
        page.get_by_role("link", name="Save").first.wait_for(timeout=300_000)
        shown: dict[str, str] = {}
        for key in pages:
            page = tab.open(key)
            page.wait_for_timeout(400)
            shown[key] = page.inner_text("#content")
            assert serious(page) == []
            tab.picture(f"ur5-{key}")
            page.set_viewport_size({"width": 1440, "height": 900})
        before = files_of(folder)
        server = server_of(folder)
        os.kill(server.pid, signal.SIGKILL)
        server.wait(10)
        assert tab.complaints == []
    assert (folder / LOCK).is_file()  # left behind, and in nobody's way
    assert files_of(folder) == before
    with served(folder) as address, open_tab(chromium, address) as tab:
        for key in pages:
            page = tab.open(key)
            for _ in range(240):  # figures write their texts a little later than the page
                lost = _lasting(shown[key]) - _lasting(page.inner_text("#content"))
                if not lost:
                    break
                page.wait_for_timeout(250)
            assert lost == set(), key
        assert tab.complaints == []


def _lasting(text: str) -> set[str]:
    """Lines of a project's state: not the letters at axes, nor of a run that a server has seen (commands and what they said)."""
    return {line for line in text.splitlines() if len(line) > 1 and "taskcal " not in line and "wrote" not in line}


def test_two_projects_side_by_side_do_not_disturb_each_other(chromium: Any, tmp_path: Path) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    with served(first) as one, served(second) as other:
        context = chromium.new_context(viewport={"width": 1440, "height": 900})
        a, b = Tab(context, one), Tab(context, other)  # one browser, with the cookies of both
        a.open("robot").get_by_label("Robot", exact=True).select_option("ur5")
        a.page.get_by_text("Joints of Universal Robots UR5").wait_for()
        b.open("robot").get_by_label("Robot", exact=True).select_option("abb-irb120")
        b.page.get_by_text("Joints of ABB IRB 120").wait_for()
        a.open("task").get_by_role("button", name="Begin with a box").click()
        a.page.get_by_text("The robot reaches").wait_for()
        before = files_of(second)
        a.page.get_by_label("Edges, mm x (mm)").fill("123")
        a.page.get_by_label("Edges, mm x (mm)").press("Enter")
        assert comes_true(a.page, lambda: "123.0" in (first / "tasks" / "task.toml").read_text())
        assert "No task is chosen." in b.open("task").inner_text("main")
        assert "Universal Robots UR5" in a.open("robot").inner_text("main")
        assert "ABB IRB 120" in b.open("robot").inner_text("main")
        assert files_of(second) == before
        assert a.complaints == b.complaints == []
        context.close()
