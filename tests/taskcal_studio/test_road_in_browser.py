"""The road in a real browser: what follows from a change is out of date, and made again with one click."""

from pathlib import Path
from typing import Any

import pytest

from taskcal_studio.project import begin_example
from tests.taskcal_studio.conftest import open_tab, served
from tests.taskcal_studio.test_robot_in_browser import serious

pytestmark = [pytest.mark.browser, pytest.mark.long]


def test_fit_is_outdated_by_edited_rows_and_made_again_by_a_click(chromium: Any, tmp_path: Path) -> None:
    begin_example(tmp_path)
    measured = tmp_path / "campaigns" / "measured.csv"
    with served(tmp_path) as address, open_tab(chromium, address) as tab:
        page = tab.open("result")
        assert "Not yet possible first: Identify" in " ".join(page.inner_text("#content").split())
        page.get_by_role("button", name="Next: Fit", exact=True).click()
        page.get_by_text("Models side by side").wait_for(timeout=300_000)
        lines = measured.read_text().splitlines()
        measured.write_text("\n".join(lines[:-3]) + "\n")
        page = tab.open("task")
        assert "Out of date\nsince you changed: Measurements" in page.inner_text("nav")
        assert serious(page) == []
        page.get_by_role("button", name="Next: Fit again").click()
        page.wait_for_url("**/identify")
        page.get_by_text("Models side by side").wait_for(timeout=300_000)
        page.get_by_role("button", name="Next: Correct the program").wait_for(timeout=300_000)
        assert "Out of date" not in tab.ready().inner_text("nav")
        tab.picture("road")
        assert tab.complaints == []


def test_undo_takes_back_a_drop_and_the_other_window_is_told(chromium: Any, tmp_path: Path) -> None:
    begin_example(tmp_path)
    before = {
        path: path.read_bytes() for path in tmp_path.rglob("*.*") if path.is_file() and "history" not in path.parts
    }
    with served(tmp_path) as address, open_tab(chromium, address) as tab, open_tab(chromium, address) as other:
        page, away = tab.open("program"), other.open("robot")
        dropped = {"name": "second.mod", "mimeType": "", "buffer": b"MODULE second\nENDMODULE\n"}
        page.locator("input[type=file]").first.set_input_files(dropped)
        page.get_by_role("button", name="Undo: programs/second.mod added").wait_for()
        away.get_by_text("Changed elsewhere since this page was shown: programs/second.mod added").wait_for()
        assert serious(away) == []
        away.get_by_role("button", name="Reload").click()
        away.get_by_text("Changed elsewhere").wait_for(state="detached")
        tab.picture("undo")
        page.get_by_role("button", name="Undo: programs/second.mod added").click()
        page.get_by_role("button", name="Undo").wait_for(state="detached")
        assert {path: path.read_bytes() for path in before} == before
        assert not (tmp_path / "programs" / "second.mod").exists()
        away.get_by_text("programs/second.mod put back").wait_for()
        assert tab.complaints == other.complaints == []
