"""Whole roads from an empty folder to the certificate by keyboard alone; a server that is killed; two projects side by side."""

import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taskcal.reading.writer import campaign_text
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate
from taskcal_studio.project import NAME as LOCK
from taskcal_studio.texts import Texts, catalogue
from tests.robot_programs.tp.samples import FRAMES, joints, listing
from tests.taskcal_studio.conftest import Tab, comes_true, open_tab, served, server_of
from tests.taskcal_studio.test_robot_in_browser import serious

pytestmark = [pytest.mark.browser, pytest.mark.long]

FOCUSED = """() => {
  const at = document.activeElement;
  if (!at.closest("#content")) return "";
  return at.getAttribute("aria-label") || at.innerText || at.getAttribute("type") || "";
}"""

MOST_TABS = 150

SETTLE_S = 2.0
"""In which a page whose run has ended is shown anew."""

MOST_ACTS = 14
"""Controls that are used and files that are dropped, from an empty folder to the certificate."""


class Road:
    """A person with a keyboard who does what the pages name as the next; what is used is counted, the way to it is not."""

    def __init__(self, tab: Tab, language: str) -> None:
        self.tab, self.page, self.texts, self.acts = tab, tab.page, Texts(language), 0
        self.page.on("filechooser", lambda _: None)  # who listens later may be too late to intercept the first one

    def to(self, label: str) -> None:
        """Go to a control by the Tab key; a page that changed on the way, since a run began, is gone through again."""
        self.acts += 1
        running = self.page.locator("#content progress")
        while True:
            reached: list[str] = []
            for _ in range(MOST_TABS):
                self.page.keyboard.press("Tab")
                reached.append(self.page.evaluate(FOCUSED))
                if reached[-1] == label:
                    return
            if not running.count():
                break
            running.wait_for(state="detached", timeout=300_000)
            self.page.wait_for_timeout(1000 * SETTLE_S)
            self.tab.ready()
        raise AssertionError(f"'{label}' is not reached by Tab; these are: {sorted(set(reached))}")

    def enter(self, label: str, typed: str = "") -> None:
        """Press a control, or type into it."""
        self.to(label)
        if typed:
            self.page.keyboard.press("Control+A")
            self.page.keyboard.type(typed)
        self.page.keyboard.press("Enter")

    def drop(self, *files: tuple[str, bytes]) -> None:
        """Choose files."""
        self.to("file")
        given = [{"name": name, "mimeType": "", "buffer": content} for name, content in files]
        with self.page.expect_file_chooser() as chooser:
            self.page.keyboard.press("Space")
        with self.page.expect_navigation():
            chooser.value.set_files(given)
        self.tab.ready()

    def next(self, what: str, to: str) -> None:
        """Take the step that is named as the next, as soon as it is."""
        label = self.texts("next.next", what=self.texts(what))
        self.look(self.page.locator(".next").get_by_text(label, exact=True))
        self.enter(label)
        self.page.wait_for_url(f"**/{to}")
        self.page.locator("h1", has_text=self.texts(f"{to}.title")).wait_for()
        self.tab.ready()

    def look(self, awaited: Any) -> None:
        """Wait until a page has what is awaited: it keeps nobody out, and needs no scrolling sideways."""
        awaited.wait_for(timeout=300_000)
        self.page.locator("#content progress").wait_for(state="detached", timeout=300_000)
        self.page.wait_for_timeout(1000 * SETTLE_S)
        self.tab.ready()
        assert serious(self.page) == [], self.page.url
        assert self.page.evaluate("document.documentElement.scrollWidth") <= self.page.viewport_size["width"], (
            self.page.url
        )

    def certificate(self) -> str:
        """Make the report, and open the certificate."""
        self.next("next.report", "report")
        link = self.page.get_by_role("link", name="certificate").first
        self.look(link)
        with self.page.context.expect_page() as opened:
            self.enter(link.inner_text())
        return opened.value.inner_text("body")


def files_of(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != LOCK
    }


def measured(name: str, *home_deg: float) -> list[list[str]]:
    """Cells of a campaign on a virtual robot around a posture, with its header."""
    model = ErrorModel(load_robot(name))
    rng = np.random.default_rng(3)
    campaign, _ = simulate(model, np.radians(home_deg) + rng.uniform(-0.6, 0.6, (60, 6)), rng=rng)
    return [line.split(",") for line in campaign_text(campaign, model.robot).splitlines()]


def test_two_raw_files_become_a_certificate_that_survives(chromium: Any, tmp_path: Path) -> None:
    """On a telephone, in German and dark; what was made is there after the server was killed."""
    rows = measured("ur5", 0, -70, 85, -20, 70, 0)[1:]
    files = [
        (name, "\n".join(" ".join(row[part]) for row in rows).encode())
        for name, part in (("a-points.txt", slice(7, 10)), ("joints.txt", slice(1, 7)))
    ]
    folder = tmp_path / "ur5"
    pages = ("task", "result", "report")
    narrow = {"locale": "de-DE", "color_scheme": "dark"}
    with served(folder) as address, open_tab(chromium, address, **narrow) as tab:
        road = Road(tab, "de")
        tab.page.set_viewport_size({"width": 390, "height": 844})
        page = tab.open("robot")
        road.to("Roboter")
        page.keyboard.type("Universal Robots UR5 (")
        page.keyboard.press("Enter")
        road.next("next.measurements", "measurements")
        road.drop(*files)
        road.next("next.task", "task")
        page.get_by_text("Der Roboter erreicht 100% der Aufgabe.").wait_for(timeout=300_000)
        road.enter(road.texts("task.tolerance"), "0.5")
        road.next("next.identify", "identify")
        road.next("result.title", "result")
        assert page.locator("td.good", has_text="eingehalten").count() > 0
        road.next("program.title", "program")
        road.next("report.title", "report")
        assert "0.500" in road.certificate()
        assert road.acts <= MOST_ACTS
        shown = {key: tab.open(key).inner_text("#content") for key in pages}
        before = files_of(folder)
        server = server_of(folder)
        os.kill(server.pid, signal.SIGKILL)
        server.wait(10)
        assert tab.complaints == []
    assert (folder / LOCK).is_file()  # left behind, and in nobody's way
    assert files_of(folder) == before
    with served(folder) as address, open_tab(chromium, address, **narrow) as tab:
        tab.page.set_viewport_size({"width": 390, "height": 844})
        for key in pages:
            page = tab.open(key)
            assert comes_true(page, lambda: not _lasting(shown[key]) - _lasting(page.inner_text("#content"))), key  # noqa: B023
        assert tab.complaints == []


def test_a_reversed_joint_is_mended_and_a_program_corrected(chromium: Any, tmp_path: Path) -> None:
    """A FANUC, whose axes 2 and 3 are coupled, with a program and the frames of its controller."""
    header, *rows = measured("fanuc-r2000ic-165f", 0, 10, -10, 0, -60, 0)
    for row in rows:
        row[2] = f"{-float(row[2]):.9f}"  # J2 counted the other way round
    wrong = "\n".join(map(",".join, [header, *rows])).encode()
    places = {str(k): joints(10.0 * k, 10, -10, 0, -60, 0, frames="UF : 0, UT : 1") for k in (1, 2)}
    program = listing(["J P[1] 10% FINE", "J P[2] 10% FINE"], places, "PART")
    with served(tmp_path) as address, open_tab(chromium, address) as tab:
        road = Road(tab, "en")
        page = tab.open("robot")
        road.to("Robot")
        page.keyboard.type("FANUC R-2000iC/165F")
        page.keyboard.press("Enter")
        road.next("next.measurements", "measurements")
        road.drop(("wrong.csv", wrong))
        page.get_by_role("button", name="Reverse the sign of J2").wait_for(timeout=300_000)
        tab.ready()
        road.enter("Reverse the sign of J2")
        road.next("next.task", "task")
        road.enter(road.texts("task.tolerance"), "1")
        road.next("next.identify", "identify")
        road.next("result.title", "result")
        road.next("program.title", "program")
        road.drop(("part.ls", program.text.encode()), ("sysframe.va", FRAMES.encode()))
        road.enter("Correct the program")
        road.next("report.title", "report")
        assert "program on the part" in road.certificate()
        assert road.acts <= MOST_ACTS
        assert tab.complaints == []


def _lasting(text: str) -> set[str]:
    """Lines of a project's state: not the letters at axes, nor of a run that a server has seen (commands and what they said)."""
    folded = set(catalogue()["run.as_command"].values())
    lines = {line for line in text.splitlines() if len(line) > 1 and "taskcal " not in line and "wrote" not in line}
    return lines - folded


def test_two_projects_side_by_side_do_not_disturb_each_other(chromium: Any, tmp_path: Path) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    with served(first) as one, served(second) as other, chromium.window() as window:
        a, b = Tab(window, one), Tab(window, other)  # one browser, with the cookies of both
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
