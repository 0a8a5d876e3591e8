"""The robot's page in a real browser: chosen, drawn, jogged by slider, number and keyboard, in both languages and colours."""

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from tests.taskcal_studio.conftest import Tab, open_tab, served

pytestmark = [pytest.mark.browser, pytest.mark.long]


def serious(page: Any, **rules: dict[str, bool]) -> list[str]:
    """What axe finds that keeps people out; to gather what is right as well would take a third longer.

    A page whose computation ends meanwhile is loaded anew, and looked at again.
    """
    from axe_playwright_python.sync_playwright import Axe
    from playwright.sync_api import Error

    options = {"resultTypes": ["violations"], "rules": rules}
    try:
        found = Axe().run(page, options=options).response["violations"]
    except Error as error:
        if "navigation" not in error.message:
            raise
        page.wait_for_selector("[data-ready]")
        found = Axe().run(page, options=options).response["violations"]
    return [f"{v['id']}: {v['nodes'][0]['html']}" for v in found if v["impact"] in ("serious", "critical")]


def tool_text(degrees: list[float]) -> str:
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    T = model.nominal.poses(np.radians([degrees]))[0]
    return " ".join(f"{value:.4f}" for value in T[:3, 3] * 1e3) + " mm"


def test_the_first_view_comes_with_the_page_itself(chromium: Any, tmp_path: Path) -> None:
    """Its heading waits for nothing that is asked for afterwards: neither for the scene nor for an answer of the server's."""
    with served(tmp_path) as address, open_tab(chromium, address) as tab:
        begun = time.perf_counter()
        first = tab.page.goto(address).text()
        tab.page.wait_for_selector("h1")
        print(f"the first view after {time.perf_counter() - begun:.2f} s")  # two seconds are wanted
        assert tab.page.inner_text("h1") in first


def test_sliders_and_numbers_move_tool_as_in_library(tab: Tab) -> None:
    """Sliders and number fields move the tool to the pose that the library computes."""
    page = tab.open("robot")
    assert tool_text([0.0] * 6) in page.inner_text("main")
    number = page.get_by_label("J2 (°)")
    number.fill("12.5")
    number.press("Enter")
    page.get_by_text(tool_text([0.0, 12.5, 0.0, 0.0, 0.0, 0.0])).wait_for()
    slider = page.get_by_label("J5", exact=True)
    slider.focus()
    slider.press("End")
    page.get_by_text(tool_text([0.0, 12.5, 0.0, 0.0, 120.0, 0.0])).wait_for()
    page.get_by_label("J4 (°)").fill("310")
    page.get_by_label("J4 (°)").press("Enter")
    page.get_by_role("alert").filter(has_text="J4 = 310.000° is outside -300 to 300°").wait_for()
    number.fill("95")  # crank and rod line up before
    number.press("Enter")
    page.get_by_role("alert").filter(has_text="the four-bar does not close").wait_for()
    page.get_by_role("button", name="All joints to zero").click()
    page.get_by_text(tool_text([0.0] * 6)).wait_for()
    tab.picture("robot")


def test_keys_pressed_faster_than_the_server_answers_all_count(tab: Tab) -> None:
    page = tab.open("robot")
    slider, number = page.get_by_label("J1", exact=True), page.get_by_label("J1 (°)")
    slider.focus()
    slider.press("ArrowRight")
    page.wait_for_function("label => document.querySelector(label).value > 0", arg='input[aria-label="J1 (°)"]')
    step = float(number.input_value())
    for _ in range(29):
        page.keyboard.press("ArrowRight")
    page.get_by_text(tool_text([30 * step, 0.0, 0.0, 0.0, 0.0, 0.0])).wait_for()
    assert float(slider.input_value()) == pytest.approx(30 * step, abs=1e-3)
    assert float(number.input_value()) == pytest.approx(30 * step, abs=1e-3)


def test_what_is_being_typed_stays_while_the_page_goes_on(tab: Tab) -> None:
    page = tab.open("robot")
    number = page.get_by_label("J2 (°)")
    number.press_sequentially("7")
    typed = number.input_value()
    page.evaluate(
        """label => {
      const slider = document.querySelector(label);
      slider.value = 10;
      slider.dispatchEvent(new Event("input"));
    }""",
        'input[aria-label="J1"]',
    )
    page.get_by_text(tool_text([10.0, 0.0, 0.0, 0.0, 0.0, 0.0])).wait_for()
    assert number.input_value() == typed
    number.fill("0")
    number.press("Tab")
    page.get_by_role("button", name="All joints to zero").click()
    page.get_by_text(tool_text([0.0] * 6)).wait_for()
    assert number.input_value() == "0.0000"


def test_another_robot_is_chosen_and_kept(chromium: Any, tmp_path: Path) -> None:
    with served(tmp_path) as address, open_tab(chromium, address) as tab:
        page = tab.open("robot")
        assert "No robot is chosen." in page.inner_text("main")
        page.get_by_label("Robot", exact=True).select_option("ur5")
        page.get_by_text("Joints of Universal Robots UR5").wait_for()
        tab.open("robot")
        assert "Universal Robots UR5" in page.inner_text("table")
        assert tab.complaints == []
    assert 'robot = "ur5"' in (tmp_path / "project.toml").read_text()


@pytest.mark.parametrize(("language", "theme"), [("de", "dark"), ("en", "light")])
def test_nobody_is_kept_out(tab: Tab, language: str, theme: str) -> None:
    page = tab.open("robot")
    page.goto(f"{tab.address}settings?language={language}&page=robot")
    page.goto(f"{tab.address}settings?theme={theme}&page=robot")
    tab.ready()
    assert page.locator("html").get_attribute("lang") == language
    assert page.locator("h1").inner_text() == {"de": "Roboter", "en": "Robot"}[language]
    assert serious(page) == []
    tab.picture(f"robot-{language}-{theme}")


def test_the_page_is_worked_by_keyboard_alone(tab: Tab) -> None:
    page = tab.open("robot")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")  # skip to the content
    reached: list[str] = []
    for _ in range(30):
        page.keyboard.press("Tab")
        reached.append(
            page.evaluate("document.activeElement.getAttribute('aria-label') || document.activeElement.innerText")
        )
    assert {"J1", "J6 (°)", "All joints to zero", "From above"} <= set(reached)


def test_keys_change_the_view_while_the_scene_has_the_focus(tab: Tab) -> None:
    page = tab.open("robot")
    scene = "getElement(document.querySelector('.view').id.slice(1))"
    place = f"() => {scene}.camera.position.clone().sub({scene}.controls.target).toArray()"  # from what it looks at
    page.locator(".view:not([data-initializing])").focus()  # a scene that is not there yet cannot turn
    page.keyboard.press("2")
    page.wait_for_function(f"() => Math.abs(({place})()[1]) < 1e-6")
    page.keyboard.press("3")
    page.wait_for_function(f"() => Math.abs(({place})()[0]) < 1e-6")
    page.keyboard.press("9")
    before = page.evaluate(place)
    page.get_by_label("J1 (°)").focus()
    page.keyboard.press("2")
    page.wait_for_timeout(500)
    assert page.evaluate(place) == pytest.approx(before)  # what is typed into a field is no view
    assert serious(page) == []


def test_dropped_robot_is_accepted_and_wrong_file_rejected(chromium: Any, tmp_path: Path) -> None:
    """A dropped robot file is accepted, and a wrong file is rejected where it was dropped."""
    from importlib import resources

    catalogue = resources.files("taskcal.robot") / "catalogue"
    with served(tmp_path) as address, open_tab(chromium, address) as tab:
        page = tab.open("robot")
        page.get_by_text("A robot that is not in the list").click()
        chooser = page.locator("input[type=file]")
        chooser.set_input_files({"name": "../../<b>mine.toml", "mimeType": "", "buffer": b"name = 3"})
        page.get_by_role("alert").filter(has_text="b-mine.toml").wait_for()
        content = (catalogue / "ur5.toml").read_bytes()
        page.get_by_text("A robot that is not in the list").click()
        page.locator("input[type=file]").set_input_files({"name": "good.toml", "mimeType": "", "buffer": content})
        page.get_by_text("Joints of Universal Robots UR5").wait_for()
        page.get_by_text("A robot that is not in the list").click()
        page.locator("input[type=file]").set_input_files({"name": "x.exe", "mimeType": "", "buffer": b"MZ"})
        page.get_by_role("alert").filter(has_text="'x.exe' is not a file of this kind").wait_for()
    assert sorted(path.name for path in (tmp_path / "robots").iterdir()) == ["b-mine.toml", "good.toml"]
    assert not (tmp_path.parent / "mine.toml").exists()
