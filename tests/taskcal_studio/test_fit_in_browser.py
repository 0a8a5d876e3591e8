"""Measurements to result in a real browser: the numbers of the command line, cancelled at once, nothing lost by a reload."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

from taskcal.reading.reader import read_campaign
from taskcal.report.calibration import tabulate_errors
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal_studio.measured_rows import registered_rows
from tests.taskcal_studio.conftest import Tab, open_tab, served
from tests.taskcal_studio.test_robot_in_browser import serious

pytestmark = [pytest.mark.browser, pytest.mark.long]

ROBOT = "abb-irb6660-205-1.9"


def command_line(folder: Path, *arguments: str, accept: tuple[int, ...] = (0,)) -> dict[str, Any]:
    """What the command line says in JSON."""
    command = [sys.executable, "-m", "taskcal", *arguments, "--json"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode in accept, done.stderr
    return json.loads(done.stdout)


def begun_for(process: psutil.Process, folder: Path) -> bool:
    """Whether a process is a fit of a project."""
    try:
        return "identify" in process.cmdline() and Path(process.cwd()) == folder
    except psutil.Error:
        return False


def text_of(page: Any) -> str:
    return page.inner_text("main")


def test_a_file_is_understood_and_its_points_are_picked(tab: Tab, example: tuple[str, Path]) -> None:
    page = tab.open("measurements")
    # once the doctor has found something, the page is loaded anew with it
    page.get_by_text("No mistake found.").first.wait_for()
    tab.ready()
    campaign = read_campaign(example[1] / "campaigns" / "measured.csv", load_robot(ROBOT))
    assert f"poses\n{len(campaign)}" in text_of(page)
    assert page.locator("table", has_text=f"{campaign.points[0, 0, 0] * 1e3:.6f}").count() > 0
    size = np.ptp(registered_rows(ErrorModel(load_robot(ROBOT)), campaign).cloud[0], axis=0) * 1e3
    assert f"{size[0]:.0f} × {size[1]:.0f} × {size[2]:.0f} mm" in text_of(page)
    page.wait_for_timeout(500)
    box = page.locator("canvas").bounding_box()
    page.locator("canvas").click(position={"x": box["width"] / 2 + 20, "y": box["height"] / 2 + 20})
    page.get_by_text("row ").filter(has_text="(id ").wait_for()
    page.locator(".next").get_by_text("Done").wait_for(timeout=10_000)
    assert serious(page) == []
    tab.picture("measurements")


def test_mistakes_are_found_and_mended_with_a_click(chromium: Any, example: tuple[str, Path], tmp_path: Path) -> None:
    lines = (example[1] / "campaigns" / "measured.csv").read_text().splitlines()
    rows = [line.split(",") for line in lines]
    for row in rows[1:]:
        row[5] = str(-float(row[5]))  # J5 counted the other way round; its limits are the same on both sides
    wrong = "\n".join(",".join(row) for row in rows).encode()
    (tmp_path / "project.toml").write_text(f'name = "mend"\nrobot = "{ROBOT}"\n')
    with served(tmp_path) as address, open_tab(chromium, address) as tab:
        page = tab.open("measurements")
        page.locator("input[data-kind=campaign]").set_input_files(
            {"name": "wrong.csv", "mimeType": "", "buffer": wrong}
        )
        page.get_by_role("cell", name="Joint sign reversed (joint-sign)", exact=True).wait_for(timeout=300_000)
        said = command_line(tmp_path, "doctor", "campaigns/wrong.csv", "--robot", ROBOT)["findings"][0]
        assert f"{said['error_before_mm']:.2f}" in text_of(page)
        assert said["fix"] in text_of(page)
        tab.picture("mistakes")
        file = tmp_path / "campaigns" / "wrong.csv"
        page.get_by_role("button", name="Reverse the sign of J5").click()
        page.get_by_role("button", name="Undo: campaigns/wrong.csv changed").wait_for(timeout=300_000)
        assert float(file.read_text().splitlines()[1].split(",")[5]) == pytest.approx(float(lines[1].split(",")[5]))
        page.get_by_text("No mistake found.").first.wait_for(timeout=300_000)
        assert serious(page) == []
        page.get_by_role("button", name="Undo: campaigns/wrong.csv changed").click()
        page.get_by_role("cell", name="Joint sign reversed (joint-sign)", exact=True).wait_for(timeout=300_000)
        assert file.read_bytes() == wrong
        page.get_by_role("button", name="Leave the data as they are").click()
        page.get_by_role("button", name="Next: Define the task").wait_for()
        assert tab.complaints == []


def test_rows_of_a_finding_are_listed(chromium: Any, example: tuple[str, Path], tmp_path: Path) -> None:
    rows = [line.split(",") for line in (example[1] / "campaigns" / "measured.csv").read_text().splitlines()]
    column = rows[0].index("x_mm")
    rows[8][column] = f"{float(rows[8][column]) + 25.0:.4f}"  # a slip of the pen
    (tmp_path / "campaigns").mkdir()
    (tmp_path / "campaigns" / "slip.csv").write_text("\n".join(",".join(row) for row in rows))
    (tmp_path / "project.toml").write_text(f'name = "slip"\nrobot = "{ROBOT}"\ncampaign = "campaigns/slip.csv"\n')
    with served(tmp_path) as address, open_tab(chromium, address) as tab:
        page = tab.open("measurements")
        page.get_by_role("cell", name="row 7 (id 7, line 9)", exact=True).wait_for(timeout=300_000)
        page.get_by_text("Dark red: rows with a finding.").wait_for()
        assert serious(page) == []
        tab.picture("concerned")
        assert tab.complaints == []


def test_a_fit_says_what_the_command_line_says_to_the_digit(tab: Tab, example: tuple[str, Path]) -> None:
    folder = example[1]
    page = tab.open("identify")
    page.get_by_role("button", name="Fit", exact=True).click()
    page.get_by_text("Models side by side").wait_for(timeout=300_000)
    tab.picture("identify")
    assert serious(page) == []
    said = command_line(
        folder,
        "identify",
        "campaigns/measured.csv",
        "--robot",
        ROBOT,
        "--holdout",
        "0.3",
        "--output",
        str(folder / "c.json"),
    )
    page.get_by_role("link", name="Result", exact=True).click()
    tab.ready()
    verdict, shown = (page.locator("table").nth(k).inner_text() for k in (0, 1))
    printed = tabulate_errors({"calibrated": said["held_out"]})
    assert [cell for row in printed.rows for cell in row[1:] if cell not in shown.split()] == []
    judged = command_line(folder, "report", said["calibration"], "--task", "tasks/milling.toml")["verdict"]
    for judgement in judged["judgements"]:
        assert judgement["decision"] in verdict
        assert judgement["expected_mm"] is None or f"{judgement['expected_mm']:.3f}" in verdict
    kept = json.loads((folder / "calibrations" / "measured-geometry.result.json").read_text())
    assert {**kept, "calibration": ""} == {**said, "calibration": ""}
    page.get_by_label("Enlargement").press("End")
    page.get_by_text("× 100000").wait_for()
    assert page.get_by_label("Enlargement").input_value() == page.get_by_label("Enlargement").get_attribute("max")
    page.get_by_label("Enlargement").fill("9")
    page.get_by_text("× 1000", exact=True).wait_for()
    assert serious(page) == []
    tab.picture("result")


def test_fit_survives_reload_and_second_tab_until_cancelled(
    chromium: Any, example: tuple[str, Path], tmp_path: Path
) -> None:
    """A reload and a second tab show the running fit, and cancelling ends it at once."""
    (tmp_path / "campaigns").mkdir()
    box = ("--robot", ROBOT, "--task", str(example[1] / "tasks" / "milling.toml"))
    command_line(tmp_path, "simulate", *box, "--count", "600", "-o", "campaigns/measured.csv")  # takes a while to fit
    choices = (
        f'name = "c"\nrobot = "{ROBOT}"\ncampaign = "campaigns/measured.csv"\n[options.identify]\neffects = "auto"\n'
    )
    (tmp_path / "project.toml").write_text(choices)
    with served(tmp_path) as address, open_tab(chromium, address) as tab, open_tab(chromium, address) as second:
        page = tab.open("identify")
        page.get_by_role("button", name="Fit", exact=True).click()
        page.get_by_role("progressbar").wait_for()
        page.reload()
        tab.ready()
        page.get_by_role("progressbar").wait_for()
        other = second.open("identify")
        assert other.get_by_role("button", name="Fit", exact=True).count() == 0
        other.wait_for_timeout(1500)
        fitting = [process for process in psutil.process_iter() if begun_for(process, tmp_path)]
        assert fitting
        other.get_by_role("button", name="Cancel").click()
        _, alive = psutil.wait_procs(fitting, timeout=3.0)
        assert alive == []
        page.get_by_text("Cancelled; nothing was written.").wait_for()
        assert tab.complaints == second.complaints == []
    assert list((tmp_path / "calibrations").iterdir()) == []
    assert (tmp_path / "project.toml").read_text() == choices
